# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import pytest

from cocotb_tests.cocotb_run import run_cocotb

TB = Path(__file__).parent / "asi_seq_tb.sv"


# the rules that depend on a parameter
COUNTING = "rising_order|lost|random_plants|gaps"


@pytest.mark.parametrize("parameters, only", [
    ({}, ".*"), ({"DexgRetry": 0, "FailCycles": 1}, COUNTING), ({"DexgRetry": 3, "FailCycles": 7}, COUNTING),
], ids=["default", "smallest", "largest"])
def test_seq(parameters, only):
    """LK-001 .. LK-014, LK-018 .. LK-021: the sequencer with a link RAM and a stand-in for asi_xact; each test names
    its numbers."""
    run_cocotb("asi_seq_tb", ["link/asi_seq.sv", TB], "cocotb_tests.block.cocotb_seq", parameters=parameters,
               env={"COCOTB_TEST_FILTER": only})
