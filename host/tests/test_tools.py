# SPDX-License-Identifier: Apache-2.0
"""The generators of docs/verification.md and sim/views."""
import re

import pytest

from tools import matrix, views

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


def test_views_are_the_generated_ones(tmp_path):
    """PL-003: the shipped views are what the generator makes, and a wave file without their signals is noticed."""
    for path, render in views.OUTPUTS.items():
        assert path.read_text() == render(), path
    waves = tmp_path / "w.vcd"
    waves.write_text("$timescale 1ns $end\n$scope module TOP $end\n$scope module asi_master $end\n"
                     "$var wire 1 ! clk_i $end\n$var wire 12 # host_addr_i [13:2] $end\n$scope module u_trace $end\n"
                     "$var wire 96 % last_a[3] [95:0] $end\n$upscope $end\n"
                     "$upscope $end\n$upscope $end\n$enddefinitions $end\n#0\n0!\nb0 #\nb0 %\n")
    gone = views.missing(waves)
    for there in ("clk_i", "host_addr_i", "u_trace.last_a.[3]"):
        assert f"TOP.asi_master.{there}" not in gone
    for missing in ("rst_i", "u_trace.request_text_o", "u_trace.last_a.[4]", "u_trace.last_b.[3]"):
        assert f"TOP.asi_master.{missing}" in gone
    assert views.main(["--check", str(waves)]) == 1


def test_both_views_show_the_same():
    """PL-003: request, answer with error class, phase and the last data of all 62 slaves, in both viewers."""
    surfer, gtkw = views.surfer().splitlines(), views.gtkwave().splitlines()
    paths = [line.split()[1] for line in surfer if line.startswith("variable_add ")]
    shown = [re.sub(r"\[\d+:\d+\]$", "", line.rpartition(" ")[2]) for line in gtkw if "TOP." in line]
    for name in ("last_a", "last_b"):   # the names in FST, those in VCD
        assert [f"TOP.asi_master.u_trace.{name}.{name}[{k}]" in shown for k in range(1, 32)] == [True] * 31
        assert [f"TOP.asi_master.u_trace.{name}[{k}]" in shown for k in range(1, 32)] == [True] * 31
    assert [name.replace("[", ".[") for name in shown if not re.search(r"(\w+)\.\1\[", name)] == paths
    for text in ("request_text_o", "answer_text_o", "phase_text_o"):
        assert f"TOP.asi_master.u_trace.{text}" in paths
    assert sum(".last_" in path for path in paths) == 62
    assert gtkw.count("@c00200") == gtkw.count("@1401200") == 2     # the slaves' groups are closed


def test_surfer_commands_name_the_item_before():
    """PL-003: the place in each item_focus, in Surfer's digits a to p, is that of the item added last."""
    place, commands = -1, set()
    for line in views.surfer().splitlines():
        if line.startswith("#"):
            continue
        command, *rest = line.split(maxsplit=1)
        commands.add(command)
        if command in ("divider_add", "variable_add"):
            place += 1
            assert command != "divider_add" or re.fullmatch(r"\w+", rest[0])
        elif command == "item_focus":
            digits = rest[0].partition("_")[0]
            assert int("".join("0123456789abcdef"["abcdefghijklmnop".index(d)] for d in digits), 16) == place
    assert place > 62
    assert commands == {"divider_add", "variable_add", "item_focus", "item_set_format", "item_rename", "item_unfocus",
                        "cursor_set"}
