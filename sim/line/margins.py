# SPDX-License-Identifier: Apache-2.0
"""`make margins`: where telegrams begin to fail, one parameter at a time and all at once.

usage: python -m sim.line.margins [--samples N] [--telegrams N] [--seed N] [--scheduler ADDRESS | --no-dask]
                                  [--out FOLDER] [--docs] [--sample POPULATION:NUMBER] [--from-json]
Writes FOLDER/margins.json, margins.md and SVG plots; --docs writes docs/margins.md and docs/images as well.
--sample runs one Monte Carlo sample again and prints what it was and what happened to it.
Exit 1 when a telegram was accepted wrongly in the legal population or a published limit was not kept.
Requirements: AN-008, AN-009 (docs/requirements.md).
"""
import argparse
import datetime
import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from .monte_carlo import EXCHANGES, POPULATIONS, Sample, draw, run_sample, run_samples, summary
from .sweeps import SWEEPS, first_error, keeps_limit, run_point

CHUNK = 20                       # samples per task
WAYS = ("request", "answer")


def run_task(task: tuple) -> tuple[tuple, Any]:
    """One unit of work: ('sweep', name, value, telegrams, seed) or ('mc', population, first, count, seed)."""
    kind, *rest = task
    return task, run_point(*rest) if kind == "sweep" else run_samples(*rest)


def _tasks(args: argparse.Namespace) -> list[tuple]:
    tasks: list[tuple] = [("sweep", s.name, v, args.telegrams, args.seed) for s in SWEEPS for v in s.values]
    return tasks + [("mc", population, first, min(CHUNK, args.samples - first), args.seed)
                    for population in POPULATIONS for first in range(0, args.samples, CHUNK)]


def _local(tasks: list[tuple], _: argparse.Namespace) -> Iterator[tuple[tuple, Any]]:
    return map(run_task, tasks)


def _dask(tasks: list[tuple], args: argparse.Namespace) -> Iterator[tuple[tuple, Any]]:
    from dask.distributed import Client, LocalCluster, as_completed

    from sim.line.margins import run_task as work     # by its importable name: workers import it, nothing is pickled
    cluster = None
    if not args.scheduler:
        cluster = LocalCluster(n_workers=os.cpu_count(), threads_per_worker=1, dashboard_address=None)
    with Client(cluster or args.scheduler) as client:
        for _, result in as_completed(client.map(work, tasks, pure=False), with_results=True):
            yield result
    if cluster:
        cluster.close()


def measure(args: argparse.Namespace, console: Console) -> dict[str, Any]:
    """All sweeps and both populations."""
    tasks, began = _tasks(args), time.monotonic()
    points: dict[str, dict[float, Any]] = {s.name: {} for s in SWEEPS}
    samples: dict[str, list[Sample]] = {p: [] for p in POPULATIONS}
    run: Callable = _local if args.no_dask else _dask
    with Progress(console=console, transient=True) as progress:
        bar = progress.add_task("margins", total=len(tasks))
        for (kind, name, first, *_), result in run(tasks, args):
            if kind == "sweep":
                points[name][first] = result
            else:
                samples[name] += result
            progress.advance(bar)
    data: dict[str, Any] = {
        "date": datetime.date.today().isoformat(), "seed": args.seed, "seconds": round(time.monotonic() - began),
        "telegrams_per_point": args.telegrams, "exchanges_per_sample": EXCHANGES,
        "command": f"make margins ARGS='--samples {args.samples} --telegrams {args.telegrams} --seed {args.seed}'",
        "sweeps": [], "monte_carlo": {}}
    for sweep in SWEEPS:
        found = [points[sweep.name][v] for v in sweep.values]
        entry = {"name": sweep.name, "title": sweep.title, "unit": sweep.unit, "source": sweep.source,
                 "limits": {"request": sweep.request_limit, "answer": sweep.answer_limit}, "points": found}
        for where in WAYS:
            good, bad = first_error(sweep, found, where)
            entry[where] = {"last_good": good, "first_bad": bad, "keeps_limit": keeps_limit(sweep, found, where),
                            "wrong": sum(p[where]["wrong"] for p in found)}
        data["sweeps"].append(entry)
    for population in POPULATIONS:
        part = sorted(samples[population], key=lambda s: s.number)
        data["monte_carlo"][population] = {**summary(part), "extremes_ns": [[s.early_ns, s.late_ns] for s in part],
                                           "by_disturbance": by_disturbance(part)}
    return data


def by_disturbance(samples: list[Sample]) -> list[dict[str, Any]]:
    """Failed and wrong telegrams by the sum of the disturbances' peaks, in steps of 0.5 V (0.1 V below 0.5 V)."""
    edges = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0]
    out = []
    for low, high in zip(edges, edges[1:]):
        part = [s.classes[w] for s in samples if low <= s.disturbed_v < high for w in WAYS]
        telegrams = sum(sum(c.values()) for c in part)
        if telegrams:
            out.append({"from_v": low, "to_v": high, "telegrams": telegrams,
                        "failed": telegrams - sum(c.get("OK", 0) for c in part),
                        "wrong": sum(c.get("WRONG", 0) for c in part)})
    return out


# ---------------------------------------------------------------- output
def _cell(value: float | None, unit: str) -> str:
    return "none" if value is None else f"{value:g} {unit}".strip()


def sweep_rows(data: dict[str, Any]) -> list[list[str]]:
    """Per sweep: title, limit, last good and first bad of both directions, verdict."""
    rows = []
    for entry in data["sweeps"]:
        limit = [entry["limits"][w] for w in WAYS]
        shown = "" if limit == [None, None] else _cell(limit[0], entry["unit"]) if limit[0] == limit[1] else \
            f"{limit[0]:g} / {_cell(limit[1], entry['unit'])}"
        kept = [entry[w]["keeps_limit"] for w in WAYS]
        rows.append([entry["title"], shown, *(
            f"{_cell(entry[w]['last_good'], entry['unit'])} | {_cell(entry[w]['first_bad'], entry['unit'])}"
            for w in WAYS), "" if kept == [None, None] else "yes" if all(kept) else "**no**"])
    return rows


def mc_rows(data: dict[str, Any]) -> list[list[str]]:
    rows = []
    for population, found in data["monte_carlo"].items():
        for where in WAYS:
            d = found[where]
            rows.append([population, where, f"{d['telegrams']}", f"{d['failed']}", f"{d['accepted']}", f"{d['wrong']}",
                         f"{d['wrong_bound']:.1e}", ", ".join(f"{k} {v}" for k, v in sorted(
                             d["classes"].items(), key=lambda item: -item[1]))])
    return rows


def show(data: dict[str, Any], console: Console) -> None:
    table = Table("parameter", "limit", "request: last good | first error", "answer: last good | first error", "kept",
                  title="one parameter at a time")
    for row in sweep_rows(data):
        table.add_row(*row)
    console.print(table)
    table = Table("population", "direction", "telegrams", "failed", "accepted", "wrong", "bound (95 %)", "classes",
                  title="all at once")
    for row in mc_rows(data):
        table.add_row(*row)
    console.print(table)


def broken(data: dict[str, Any]) -> list[str]:
    """What must not be: wrong telegrams accepted on a legal line, limits not kept."""
    out = [f"legal: {data['monte_carlo']['legal'][w]['wrong']} wrong telegrams accepted ({w})" for w in WAYS
           if data["monte_carlo"]["legal"][w]["wrong"]]
    return out + [f"{e['title']}: fails within its limit ({w})" for e in data["sweeps"] for w in WAYS
                  if e[w]["keeps_limit"] is False]


def one_sample(text: str, seed: int, console: Console) -> None:
    population, _, number = text.partition(":")
    if population not in POPULATIONS or not number.isdecimal():
        raise SystemExit(f"--sample {text}: POPULATION:NUMBER, population one of {', '.join(POPULATIONS)}")
    setup, _ = draw(population, int(number), seed)
    console.print(setup)
    console.print(run_sample(population, int(number), seed))


def main() -> None:
    parser = argparse.ArgumentParser(prog="make margins ARGS=...", description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=2000, help="Monte Carlo samples per population")
    parser.add_argument("--telegrams", type=int, default=64, help="exchanges per point of a sweep")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scheduler", default="", help="Dask scheduler (tcp://...); default: a process per core")
    parser.add_argument("--no-dask", action="store_true", help="in this process")
    parser.add_argument("--out", type=Path, default=Path("build/margins"))
    parser.add_argument("--docs", action="store_true", help="write docs/margins.md and its plots as well")
    parser.add_argument("--sample", metavar="POPULATION:NUMBER", help="run one sample again and show it")
    parser.add_argument("--from-json", action="store_true", help="no measurement: tables and plots from margins.json")
    args = parser.parse_args()
    console = Console()
    if args.sample:
        one_sample(args.sample, args.seed, console)
        return
    if min(args.samples, args.telegrams) < 1:
        raise SystemExit("--samples and --telegrams: at least 1")
    args.out.mkdir(parents=True, exist_ok=True)
    target = args.out / "margins.json"
    if args.from_json:
        data = json.loads(target.read_text())
    else:
        data = measure(args, console)
        target.write_text(json.dumps(data, indent=1) + "\n")
    show(data, console)
    from .margins_page import write_page
    write_page(data, args.out, args.out)
    if args.docs:
        write_page(data, Path("docs"), Path("docs/images"))
    console.print(f"{target}, {args.out}/margins.md and plots; {data['seconds']} s")
    if problems := broken(data):
        console.print("\n".join(problems))
        sys.exit(1)


if __name__ == "__main__":
    main()
