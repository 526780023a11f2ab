# SPDX-License-Identifier: Apache-2.0
"""asi_master: the floors joined, without the real firmware. One small C program does the accesses of the core."""
from cocotb_tests.block.rv_build import build
from cocotb_tests.block.test_soc import VEXRISCV
from cocotb_tests.cocotb_run import PACKAGES, ROOT, RTL, run_cocotb

SOURCES = [line.strip() for line in (RTL / "asi_master.f").read_text().splitlines() if line.strip().endswith(".sv")]
SOURCES = [s for s in SOURCES if RTL / s not in PACKAGES] + [VEXRISCV]


def test_master():
    program = ROOT / "build/cocotb/master_probe.hex"
    build(ROOT / "cocotb_tests/block/soc_probe.c", 0, program)
    # shorter filters: the defaults are the business of the line guard's own test
    run_cocotb("asi_master", SOURCES, "cocotb_tests.block.cocotb_master", name="asi_master-block",
               parameters={"ClkHz": 8_000_000, "ApfOkNs": 100_000, "ApfOnNs": 50_000, "EfNs": 100_000},
               plusargs=[f"+firmware={program}"])
