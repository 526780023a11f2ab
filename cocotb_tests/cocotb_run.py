# SPDX-License-Identifier: Apache-2.0
"""Build a module with Verilator and run a cocotb test module on it, from pytest.

Everything lands in build/cocotb/<name>; each cocotb test becomes part of the pytest test that calls this.
Set WAVES=1 for a waveform (FST where lz4 and zlib headers exist, else VCD), ASI_COVERAGE=1 for line coverage.
"""
import os
import shutil
import xml.etree.ElementTree as ET
from pathlib import Path

from cocotb_tools.runner import Verilator, get_runner

ROOT = Path(__file__).resolve().parent.parent
RTL = ROOT / "rtl"
PACKAGES = [RTL / "generated/asi_map_pkg.sv", RTL / "phy/asi_timing_pkg.sv"]


class _Quick(Verilator):
    """Keeps signals private unless a .vlt file names them: the simulation is about three times as fast."""

    def _build_command(self):
        commands = super()._build_command()
        commands[0].remove("--public-flat-rw")
        return commands


def run_cocotb(top, sources, test_module, *, name=None, parameters=None, extra_args=(), env=None, plusargs=(),
               quick=False):
    """Build `top` from PACKAGES + sources (paths below rtl/ or absolute) and run test_module; AssertionError if not.

    quick: only the signals that a .vlt file among extra_args makes public are seen by the tests.
    """
    name = name or "-".join([top, *(f"{k}{v}" for k, v in (parameters or {}).items())])
    build_dir = ROOT / "build/cocotb" / name
    waves = os.environ.get("WAVES") == "1"
    # one file per model: this Verilator's makefile cannot include its precompiled header when it splits a large one
    args = ["--assert", "-Wall", "--output-split", "0", "--timescale", "1ns/1ps",
            str(ROOT / "tools/lint.vlt"), *extra_args]
    if os.environ.get("ASI_COVERAGE") == "1":
        args.append("--coverage-line")
    os.environ.setdefault("OBJCACHE", f"bash {ROOT / 'tools/objcache.sh'} {ROOT / 'build/objcache'}")
    runner = _Quick() if quick else get_runner("verilator")
    runner.build(sources=[*PACKAGES, *(p if Path(p).is_absolute() else RTL / p for p in map(Path, sources))],
                 hdl_toplevel=top, parameters=parameters or {}, build_args=args, build_dir=build_dir, waves=waves,
                 verbose=False)
    results = build_dir / f"{test_module}.xml"
    runner.test(hdl_toplevel=top, test_module=test_module, build_dir=build_dir, test_dir=build_dir, waves=waves,
                results_xml=str(results), extra_env={"PYTHONPATH": os.environ.get("PYTHONPATH", ""), **(env or {})},
                plusargs=list(plusargs))
    cases = ET.parse(results).findall(".//testcase")
    assert cases, f"{test_module}: no test ran"
    failed = [c.get("name") for c in cases if c.find("failure") is not None or c.find("error") is not None]
    assert not failed, f"{test_module}: failed: {', '.join(failed)}"
    if (data := build_dir / "coverage.dat").exists():
        shutil.copy(data, ROOT / "build" / f"coverage-{name}-{test_module}.dat")
    return len(cases)
