# SPDX-License-Identifier: Apache-2.0
import pytest

from cocotb_tests.cocotb_run import run_cocotb

XACT = [f"phy/asi_{name}.sv" for name in ("sync", "pulse_filter", "tx", "rx", "xact")]


@pytest.mark.parametrize("mhz", [8, 16, 48])
def test_xact(mhz):
    run_cocotb("asi_xact", XACT, "cocotb_tests.block.cocotb_xact", parameters={"ClkHz": mhz * 10**6})


@pytest.mark.parametrize("mhz", [8, 16])
def test_xact_echo(mhz):
    """RX-014, RX-015, ST-001 .. ST-003: read-back, and the report of each attempt."""
    run_cocotb("asi_xact", XACT, "cocotb_tests.block.cocotb_xact_echo", parameters={"ClkHz": mhz * 10**6})


def test_xact_no_read_back():
    """RX-012, LT-002: the same without read-back, and without echo."""
    run_cocotb("asi_xact", XACT, "cocotb_tests.block.cocotb_xact", parameters={"ClkHz": 8 * 10**6, "ReadBack": 0})


def test_line_guard():
    run_cocotb("asi_line_guard", ["phy/asi_sync.sv", "phy/asi_line_guard.sv"], "cocotb_tests.block.cocotb_line_guard")
