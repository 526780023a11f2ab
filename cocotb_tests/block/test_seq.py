# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import pytest

from cocotb_tests.cocotb_run import run_cocotb

TB = Path(__file__).parent / "asi_seq_tb.sv"


@pytest.mark.parametrize("parameters", [{}, {"DexgRetry": 0, "FailCycles": 1}, {"DexgRetry": 3, "FailCycles": 7}],
                         ids=["default", "smallest", "largest"])
def test_seq(parameters):
    """All LK rules, on the sequencer with a link RAM and a stand-in for asi_xact."""
    run_cocotb("asi_seq_tb", ["link/asi_seq.sv", TB], "cocotb_tests.block.cocotb_seq", parameters=parameters)
