#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Line coverage of the RTL from Verilator's coverage files, and of the firmware from gcov, as one figure each.

usage: coverage.py [--json FILE]   reads build/coverage-*.dat and build/firmware/native/*.gcda (if gcov is there)
Prints a line per file below 100 %, then the totals. Exit code 0; 2 when there is nothing to read.
"""
import argparse
import gzip
import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
POINT = re.compile(r"C '(.*)' (\d+)$")


def rtl_lines(build):
    """-> {file: {line: hits}} over all coverage files; a line is hit when every point on it was hit."""
    points = defaultdict(int)
    for path in sorted(build.glob("coverage-*.dat")):
        for row in path.read_text(errors="replace").splitlines():
            if not (match := POINT.match(row)):
                continue
            keys = dict(part.split("\x02", 1) for part in match[1].split("\x01") if "\x02" in part)
            try:
                name = Path(keys["f"]).resolve().relative_to(ROOT / "rtl").as_posix()
            except ValueError:
                continue
            if not name.startswith("generated/") and not name.endswith("_pkg.sv"):  # constant functions never run
                points[name, int(keys["l"]), keys.get("o", "")] += int(match[2])
    lines = defaultdict(dict)
    for (name, line, _), hits in points.items():
        lines[f"rtl/{name}"][line] = min(hits, lines[f"rtl/{name}"].get(line, hits))
    return lines


def firmware_lines(build):
    """-> {file: {line: hits}} from gcov's JSON; empty when gcov is missing or nothing was built for coverage."""
    lines = defaultdict(dict)
    counters = sorted((build / "firmware/native").glob("*.gcda"))
    if not counters or not shutil.which("gcov"):
        return lines
    with tempfile.TemporaryDirectory() as tmp:
        subprocess.run(["gcov", "--json-format", *map(str, counters)], cwd=tmp, capture_output=True, check=False)
        for report in Path(tmp).glob("*.gcov.json.gz"):
            for entry in json.loads(gzip.decompress(report.read_bytes()))["files"]:
                path = Path(entry["file"])
                path = path if path.is_absolute() else ROOT / path
                try:
                    name = path.resolve().relative_to(ROOT).as_posix()
                except ValueError:
                    continue
                if name.startswith("firmware/core"):
                    for row in entry["lines"]:
                        number = row["line_number"]
                        lines[name][number] = lines[name].get(number, 0) + row["count"]
    return lines


def totals(lines):
    total = sum(len(v) for v in lines.values())
    hit = sum(1 for v in lines.values() for n in v.values() if n)
    return {"lines": total, "hit": hit, "percent": round(100 * hit / total, 1) if total else None}


def report(build=ROOT / "build"):
    """-> (list of text lines, dict for JSON)"""
    text, data = [], {}
    for name, lines in (("RTL", rtl_lines(build)), ("firmware core", firmware_lines(build))):
        data[name] = totals(lines)
        data[name]["missing"] = {}
        for path, rows in sorted(lines.items()):
            missing = sorted(n for n, hits in rows.items() if not hits)
            if missing:
                data[name]["missing"][path] = missing
                text.append(f"{path}: {100 * (1 - len(missing) / len(rows)):.0f} %, not reached: "
                            + ", ".join(map(str, missing[:12])) + (" ..." if len(missing) > 12 else ""))
        figure = data[name]["percent"]
        text.append(f"line coverage {name}: " + (f"{figure} % of {data[name]['lines']} lines" if figure is not None
                                                 else "not measured (no coverage data; firmware needs gcov)"))
    return text, data


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    text, data = report()
    print("\n".join(text))
    if args.json:
        args.json.parent.mkdir(parents=True, exist_ok=True)
        args.json.write_text(json.dumps(data, indent=1) + "\n")
    return 0 if any(v["lines"] for v in data.values()) else 2


if __name__ == "__main__":
    sys.exit(main())
