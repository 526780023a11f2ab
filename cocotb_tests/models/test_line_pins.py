# SPDX-License-Identifier: Apache-2.0
import pytest

from cocotb_tests.cocotb_run import run_cocotb

XACT = [f"phy/{name}.sv" for name in ("asi_sync", "asi_pulse_filter", "asi_tx", "asi_rx", "asi_xact")]


@pytest.mark.parametrize("clk_hz", [8_000_000, 16_000_000])
def test_line_pins(clk_hz):
    """TL-005, LT-004, LT-005, RX-008, RX-011: models and RTL agree on the line, at two clocks."""
    run_cocotb("asi_xact", XACT, "cocotb_tests.models.cocotb_line_pins", parameters={"ClkHz": clk_hz})
