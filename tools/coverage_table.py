# SPDX-License-Identifier: Apache-2.0
"""One table from gcov's counters: lines and branches of each file, over all libraries the counters belong to.

usage: coverage_table.py FOLDER [--under firmware/core] [--untaken] [--below PERCENT]
A line or branch counts as taken when any of the libraries took it: the same source is built with several constants and
beside several fakes. Where constants change the branches of a line, the build with most of them counts.
"""
import argparse
import json
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def read(folder):
    """Every .gcda of the folder -> {source path: [(line number, count, [branch counts])]}; raises when gcov fails."""
    seen = defaultdict(list)
    for counters in sorted(folder.glob("*.gcda")):
        out = subprocess.run(["gcov", "--branch-probabilities", "--json-format", "--stdout", counters.name], cwd=folder,
                             check=True, capture_output=True, text=True).stdout
        for document in out.splitlines():
            for file in json.loads(document)["files"]:
                path = (folder / file["file"]).resolve()
                for line in file["lines"]:
                    seen[path].append((line["line_number"], line["count"], [b["count"] for b in line["branches"]]))
    return seen


def merge(lines):
    """-> {line number: (taken?, [branch taken?])}"""
    merged = {}
    for number, count, branches in lines:
        taken, old = merged.get(number, (False, []))
        new = [c > 0 for c in branches]
        if len(new) == len(old):
            old = [a or b for a, b in zip(old, new)]
        merged[number] = taken or count > 0, new if len(new) > len(old) else old
    return merged


def share(good, of):
    return f"{100 * good / of:6.1f}" if of else "     -"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where the .gcda files are")
    parser.add_argument("--under", default="firmware/core", help="only sources in this folder of the repository")
    parser.add_argument("--untaken", action="store_true", help="name the lines with a branch that was never taken")
    parser.add_argument("--below", type=float, default=0.0, help="exit with 1 when fewer branches were taken in all (%%)")
    a = parser.parse_args()
    rows, untaken = [], []
    for path, lines in sorted(read(a.folder).items()):
        if (ROOT / a.under).resolve() not in path.parents:
            continue
        merged = merge(lines)
        branches = [b for _, line in merged.values() for b in line]
        rows.append((path.name, sum(t for t, _ in merged.values()), len(merged), sum(branches), len(branches)))
        untaken += [(path, n, line) for n, (_, line) in sorted(merged.items()) if not all(line)]
    if not rows:
        sys.exit(f"no counters of {a.under} in {a.folder}")
    rows.append(("all", *(sum(r[k] for r in rows) for k in range(1, 5))))
    print(f"{'file':22}{'lines':>7}{'%':>8}{'branches':>10}{'taken':>7}{'%':>8}")
    for name, good, of, taken, branches in rows:
        print(f"{name:22}{of:7}{share(good, of):>8}{branches:10}{taken:7}{share(taken, branches):>8}")
    if a.untaken:
        for path, number, line in untaken:
            text = path.read_text().splitlines()[number - 1].strip()
            print(f"{path.name}:{number}: {''.join('01'[b] for b in line)}  {text}")
    sys.exit(100 * rows[-1][3] < a.below * rows[-1][4])


if __name__ == "__main__":
    main()
