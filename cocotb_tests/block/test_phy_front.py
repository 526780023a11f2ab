# SPDX-License-Identifier: Apache-2.0
"""The blocks between asi_xact and the front end."""
import pytest

from cocotb_tests.cocotb_run import ROOT, run_cocotb

MHZ = pytest.mark.parametrize("mhz", [8, 16])


@MHZ
def test_tx_guard(mhz):
    run_cocotb("asi_tx_guard", ["phy/asi_tx_guard.sv"], "cocotb_tests.block.cocotb_tx_guard",
               parameters={"ClkHz": mhz * 10**6})


@MHZ
def test_vth(mhz):
    sources = [f"phy/asi_{name}.sv" for name in ("sync", "pulse_filter", "vth")]
    run_cocotb("asi_vth_tb", [*sources, ROOT / "cocotb_tests/block/asi_vth_tb.sv"], "cocotb_tests.block.cocotb_vth",
               parameters={"ClkHz": mhz * 10**6})


# the bias at its default and at both ends of its range
@pytest.mark.parametrize("mhz, bias", [(8, 12), (16, 12), (8, 0), (16, 63)])
def test_tx_shape(mhz, bias):
    run_cocotb("asi_tx_shape", ["phy/asi_tx_shape.sv"], "cocotb_tests.block.cocotb_tx_shape",
               parameters={"ClkHz": mhz * 10**6, "TxBias": bias})
