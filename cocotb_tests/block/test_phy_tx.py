# SPDX-License-Identifier: Apache-2.0
import pytest

from cocotb_tests.cocotb_run import run_cocotb


@pytest.mark.parametrize("mhz", [8, 16, 48])
def test_pulse_filter(mhz):
    run_cocotb("asi_pulse_filter", ["phy/asi_pulse_filter.sv"], "cocotb_tests.block.cocotb_pulse_filter",
               parameters={"ClkHz": mhz * 10**6})


@pytest.mark.parametrize("mhz", [8, 16, 48])
def test_tx(mhz):
    run_cocotb("asi_tx", ["phy/asi_tx.sv"], "cocotb_tests.block.cocotb_tx", parameters={"ClkHz": mhz * 10**6})
