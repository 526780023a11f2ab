# SPDX-License-Identifier: Apache-2.0
from cocotb_tests.cocotb_run import run_cocotb


def test_trace():
    run_cocotb("asi_trace", ["soc/asi_trace.sv"], "cocotb_tests.block.cocotb_trace")
