# SPDX-License-Identifier: Apache-2.0
"""The generators of docs/verification.md and sim/views/asi.gtkw."""
import pytest

from tools import gtkw, matrix

REQUIREMENTS = "# R\n## AA: first\n| ID | Rule |\n|---|---|\n" + "".join(
    f"| AA-{n:03} | rule {n} | |\n" for n in range(1, 6)) + "## BB: second\n| BB-001 | other | Exp |\n"
TEST = '''
import cocotb
def test_one():
    """AA-001, BB-001: both."""
class Many:
    def test_method(self):
        """AA-003..AA-005: a range."""
@cocotb.test(timeout_time=1)
async def any_name(dut):
    """AA-001: by decorator."""
def helper():
    """AA-002: is no test."""
def test_sim():
    run_cocotb("x")
def test_silent():
    """Says nothing, AA-002 is not named before a colon."""
'''


@pytest.fixture
def tree(tmp_path):
    for folder in ("docs", "cocotb_tests", "host/tests", "firmware/tests"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "docs/requirements.md").write_text(REQUIREMENTS)
    (tmp_path / "host/tests/test_it.py").write_text(TEST)
    return tmp_path


def test_matrix_finds_tests_and_gaps(tree, capsys):
    """PL-002: the matrix names per requirement the tests that verify it, and prints the gaps."""
    assert matrix.main([], tree) == 0
    rows = dict(line.split(" | ", 1) for line in (tree / "docs/verification.md").read_text().splitlines()
                if line.startswith(("| AA", "| BB")))
    assert rows["| AA-001"] == "rule 1 | `host/tests/test_it.py`: test_one, any_name |"
    assert rows["| AA-002"] == "rule 2 | **none** |"
    assert "test_method" in rows["| AA-004"] and "test_one" in rows["| BB-001"]
    out = capsys.readouterr().out
    assert "5 of 6 requirements have a test" in out and "without: AA-002" in out
    assert out.rstrip().endswith("host/tests/test_it.py: test_silent") and "test_sim" not in out


def test_matrix_check(tree, capsys):
    """PL-002: --check fails on a stale file and changes nothing; an unknown number fails always."""
    assert matrix.main(["--check"], tree) == 1 and not (tree / "docs/verification.md").exists()
    matrix.main([], tree)
    assert matrix.main(["--check"], tree) == 0
    (tree / "host/tests/test_it.py").write_text(TEST.replace("AA-001, ", ""))
    assert matrix.main(["--check"], tree) == 1
    (tree / "host/tests/test_it.py").write_text(TEST.replace("AA-001, ", "ZZ-001, "))
    assert matrix.main([], tree) == 1 and "test_one: ZZ-001 is not a requirement" in capsys.readouterr().err


@pytest.mark.parametrize("text, numbers", [
    ("AA-001: x", ["AA-001"]), ("AA-001, AA-003 and AA-004: x", ["AA-001", "AA-003", "AA-004"]), ("x AA-001: y", []),
    ("AA-001..AA-003, BB-001: x", ["AA-001", "AA-002", "AA-003", "BB-001"]),
    ("AA-001 to AA-002: x", ["AA-001", "AA-002"]),
    (None, []), ("AA-001 x", [])])
def test_named(text, numbers):
    """PL-002: requirement numbers stand before the first colon; ranges are spelled out."""
    assert list(matrix.named(text)) == numbers


def test_view_is_the_generated_one(tmp_path):
    """PL-003: the shipped GTKWave view is what the generator makes, and a wave file without its signals is noticed."""
    assert gtkw.OUTPUT.read_text() == gtkw.render()
    waves = tmp_path / "w.vcd"
    waves.write_text("$timescale 1ns $end\n$scope module TOP $end\n$scope module asi_master $end\n"
                     "$var wire 1 ! clk_i $end\n$var wire 3 # phase_o [2:0] $end\n$upscope $end\n$upscope $end\n"
                     "$enddefinitions $end\n#0\n0!\nb000 #\n")
    gone = gtkw.missing(waves)
    assert "TOP.asi_master.clk_i" not in gone and "TOP.asi_master.phase_o" not in gone
    assert "TOP.asi_master.u_trace.request_text_o" in gone and gtkw.main(["--check", str(waves)]) == 1
