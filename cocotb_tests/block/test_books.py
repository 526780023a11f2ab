# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import pytest

from cocotb_tests.cocotb_run import run_cocotb

HERE = Path(__file__).parent


@pytest.mark.parametrize("words", [16, 1024])
def test_shared_mem(words):
    run_cocotb("asi_shared_mem", ["soc/asi_shared_mem.sv"], "cocotb_tests.block.cocotb_shared_mem",
               parameters={"Words": words})


def test_stats():
    """ST-001 .. ST-005: the counters with their memory and a core at its port; each test names its numbers."""
    run_cocotb("asi_stats_tb", ["link/asi_stats.sv", "soc/asi_shared_mem.sv", HERE / "asi_stats_tb.sv"],
               "cocotb_tests.block.cocotb_stats")


@pytest.mark.parametrize("mhz", [8, 16, 24])
def test_monitor(mhz):
    """ST-006, ST-008: the monitor with its ring; each test names its numbers."""
    run_cocotb("asi_monitor_tb", ["phy/asi_rx.sv", "link/asi_monitor.sv", "soc/asi_shared_mem.sv",
                                  HERE / "asi_monitor_tb.sv"],
               "cocotb_tests.block.cocotb_monitor", parameters={"ClkHz": mhz * 10**6})
