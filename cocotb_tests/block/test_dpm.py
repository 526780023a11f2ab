# SPDX-License-Identifier: Apache-2.0
from cocotb_tests.cocotb_run import run_cocotb


def test_dpm():
    run_cocotb("asi_dpm", ["soc/asi_ram.sv", "dpm/asi_dpm.sv"], "cocotb_tests.block.cocotb_dpm")
