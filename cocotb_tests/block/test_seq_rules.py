# SPDX-License-Identifier: Apache-2.0
import re
from pathlib import Path

from cocotb_tests.cocotb_run import ROOT, RTL, run_cocotb

TB = Path(__file__).parent / "asi_seq_rules_tb.sv"
HARNESS = ROOT / "formal/asi_seq_fv.sv"


def covered(data):
    """-> {cover label: hits} of a Verilator coverage file."""
    hits = {}
    for line in data.read_text(errors="replace").splitlines():
        if found := re.match(r"C '(.*)' (\d+)$", line):
            fields = dict(f.split("\x02", 1) for f in found[1].split("\x01") if "\x02" in f)
            if fields.get("page", "").startswith("v_user"):
                label = fields.get("o", "")
                hits[label] = hits.get(label, 0) + int(found[2])
    return hits


def test_rules():
    """LK-001, LK-002, LK-004, LK-008..LK-010, LK-013..LK-021: the rules of the proof hold in simulation from reset, and
    each of its covers is reached, so none of them holds for want of traffic."""
    run_cocotb("asi_seq_rules_tb", ["link/asi_seq.sv", HARNESS, TB], "cocotb_tests.block.cocotb_seq_rules",
               extra_args=["--coverage-user", "-DFV_SIM", "-Wno-lint", "-Wno-style"],
               plusargs=["+verilator+seed+1"])
    hits = covered(ROOT / "build/cocotb/asi_seq_rules_tb/coverage.dat")
    for copy in (ROOT / "build").glob("coverage-asi_seq_rules_tb-*.dat"):
        copy.unlink()  # covers are no lines
    named = {label for path in (HARNESS, RTL / "link/asi_seq.sv")
             for label in re.findall(r"(\w+_C):\s+cover", path.read_text())}
    assert set(hits) == named
    assert not [label for label, count in hits.items() if not count]
