# SPDX-License-Identifier: Apache-2.0
"""What must hold for the repository as a whole: generated files are current, the RTL is lint-clean."""
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent


def run(*command):
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=os.environ)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_registers_are_generated():
    """HW-006: the register files in the tree are what rdl/asi.rdl makes (make regs)."""
    run(sys.executable, "tools/gen_registers.py", "--check")
    run(sys.executable, "tools/gen_ctt.py", "--check")


@pytest.mark.parametrize("old, new, reason", [
    ("toggle_pos ", "toggle_po ", "missing, but in use: CTT1_TOGGLE_POS"),
    ("value = 3,", "value = \"3\",", "ctt1.toggle_pos: "),
    ("value = 3,", "", "ctt1.toggle_pos: needs value"), ("[ctt1]", "a = 1\n[ctt1]", "a: a key outside of a table"),
    ("[ctt1]", "[ctt1", "Expected ']'"), ("exp = true, doc", "exp = 1, doc", "ctt1.toggle_pos: ")])
def test_choices_of_the_combined_transactions_are_checked(old, new, reason, tmp_path, monkeypatch, capsys):
    """CT-001: a bad rdl/ctt.toml gives one line and exit code 2, and nothing is written."""
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    import gen_ctt
    (tmp_path / "rdl").mkdir()
    (tmp_path / "rdl/ctt.toml").write_text((ROOT / "rdl/ctt.toml").read_text().replace(old, new, 1))
    for folder in ("firmware", "tb"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    monkeypatch.setattr(gen_ctt, "ROOT", tmp_path)
    assert gen_ctt.main([]) == 2
    message = capsys.readouterr().err
    assert message.startswith(f"rdl/ctt.toml: {reason}") and message.count("\n") == 1


def test_matrix_is_generated():
    """PL-002: docs/verification.md is current and every requirement has a test (make matrix)."""
    run(sys.executable, "tools/matrix.py", "--check")
    assert "**none**" not in (ROOT / "docs/verification.md").read_text()


def test_lint():
    """LT-001: Verilator -Wall is silent at the smallest, default and largest parameters (make lint)."""
    output = run("make", "--no-print-directory", f"VENV={Path(sys.prefix)}", "lint")
    assert len(re.findall(r"^lint ", output, re.M)) >= 4
    assert "%Warning" not in output


@pytest.mark.parametrize("page", sorted(p.relative_to(ROOT).as_posix() for p in [
    ROOT / "README.md", ROOT / "host/sigrok/README.md", *ROOT.glob("docs/*.md")]))
def test_links_lead_somewhere(page):
    """PL-002: every file that a page links or names as `path/file` exists; every `make target` exists."""
    text = (ROOT / page).read_text()
    for target in re.findall(r"\]\((?!https?:|#)([^)#]+)", text):
        assert ((ROOT / page).parent / target).exists(), target
    for name in re.findall(r"`((?:rtl|rdl|firmware|tb|cocotb_tests|sim|host|docs|tools|syn)/[\w./-]+)`", text):
        assert (ROOT / name).exists(), name
    known = set(re.findall(r"^([a-z][\w-]*):", "".join(p.read_text() for p in (
        ROOT / "Makefile", ROOT / "firmware/firmware.mk", ROOT / "tb/tb.mk")), re.M))
    for target in re.findall(r"`make ([a-z][\w-]*)", text):
        assert target in known, f"make {target}"
