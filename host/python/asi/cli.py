# SPDX-License-Identifier: Apache-2.0
"""Command line: `python -m asi run PLANT`, `python -m asi check PLANT ...`,
`python -m asi decode FILE` and `python -m asi replay FILE`.

Exit codes: 0 everything as the plant expects, 1 an expectation was not met (decode: no telegram in the capture),
2 bad input (plant, capture, option), 3 the simulation failed, 130 stopped by Ctrl-C (the report so far is written).
"""
import csv
import fcntl
import json
import os
import sys
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from enum import Enum
from pathlib import Path
from typing import Annotated, Any, TextIO

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.text import Text

from asi import decode as decoding
from asi import html_report, report
from asi import replay as replaying
from asi.bench import BenchError, FlashError, FlashFile, name_waves, open_bench
from asi.capture import ARM_V, UNITS, CaptureError, Info, Options
from asi.eye import Eye
from asi.native import NativeError
from asi.plant import SETTLE_NS, Plant, PlantError, load_plant, parse_time
from asi.run import Runner
from asi.telegram import parse_numbers
from asi.telegram_log import HEADER, to_line
from asi.trace import Trace

OK, NOT_MET, BAD_INPUT, FAILED, INTERRUPTED = 0, 1, 2, 3, 130
EXIT_CODES = {"ok": OK, "expectation not met": NOT_MET, "failed": FAILED, "interrupted": INTERRUPTED}

FIRMWARE = Path("build/firmware")
QUICK_SETTLE_NS = 20_000_000  # P_PWR_SETTLE of asi_test.hex
DIFFERENCES_SHOWN = 20
SHORTEST_LOOK_NS = 100_000_000  # a run that ends this soon after the settle time shows little of the network

app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False,
                  help="Tools of the open AS-Interface master.")


def _time(text: str) -> int:
    try:
        return parse_time(text)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None


def _load(path: Path) -> Plant:
    try:
        return load_plant(path)
    except PlantError as error:
        for line in error.lines:
            typer.echo(line, err=True)
        raise typer.Exit(BAD_INPUT) from None


def _fail(text: str, code: int) -> typer.Exit:
    typer.echo(text, err=True)
    return typer.Exit(code)


@contextmanager
def _only_run(out: Path) -> Iterator[None]:
    """Hold the output folder: two runs in one would mix their logs."""
    folder = os.open(out, os.O_RDONLY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    except BlockingIOError:
        raise _fail(f"{out}: another run writes there; give this one another folder with --out", BAD_INPUT) from None
    finally:
        os.close(folder)


@contextmanager
def _flash_file(path: Path | None) -> Iterator[FlashFile | None]:
    if path is None:
        yield None
        return
    try:
        file = FlashFile(path)
    except FlashError as error:
        raise _fail(str(error), BAD_INPUT) from None
    try:
        yield file
    finally:
        file.close()


def _write_back(file: FlashFile, content: bytes) -> None:
    try:
        file.write(content)
    except OSError as error:
        raise _fail(f"{file.path}: {error.strerror}", FAILED) from None


class _Lines:
    """Progress without a terminal: one line per tenth of the run."""

    def __init__(self, console: Console):
        self.console, self.tenth, self.started = console, 0, clock.monotonic()

    def __enter__(self) -> "_Lines":
        return self

    def __exit__(self, *exc: object) -> None:
        pass

    def __call__(self, now: int, end: int, cycles: int) -> None:
        tenth = min(10, 10 * now // max(end, 1))
        if tenth > self.tenth:
            self.tenth = tenth
            ratio = now / 1e9 / max(clock.monotonic() - self.started, 1e-6)
            self.console.print(f"{now / 1e6:.0f} of {end / 1e6:.0f} ms  {cycles} cycles  {ratio:.2f} x real time")


class _Bar:
    """Progress on a terminal: bus time, cycles, ratio to real time."""

    def __init__(self, console: Console):
        self.bar = Progress(TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[note]}"),
                            TimeElapsedColumn(), console=console, transient=True)
        self.task = self.bar.add_task("", total=1, note="")

    def __enter__(self) -> "_Bar":
        self.bar.__enter__()
        return self

    def __exit__(self, *exc: object) -> None:
        self.bar.__exit__(*exc)

    def __call__(self, now: int, end: int, cycles: int) -> None:
        spent = self.bar.tasks[0].elapsed or 0.0
        ratio = f"{now / 1e9 / spent:.2f} x real time" if spent > 0.1 else ""
        self.bar.update(self.task, completed=now, total=end, description=f"{now / 1e6:.0f} of {end / 1e6:.0f} ms",
                        note=f"{cycles} cycles  {ratio}")


@app.command()
def run(
    plant: Annotated[Path, typer.Argument(help="Plant file, e.g. sim/plants/packaging.toml.", show_default=False)],
    time: Annotated[int | None, typer.Option(
        "--time", "-t", parser=_time, metavar="TIME", show_default=False,
        help="Bus time to run, e.g. 1200ms; default: the plant's duration.")] = None,
    waves: Annotated[bool, typer.Option("--waves", help="Write a waveform (slow; see sim/views/asi.gtkw).")] = False,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for report, logs and waves.")] = Path("build/run"),
    log: Annotated[bool, typer.Option(help="Write telegrams.log and telegrams.jsonl.")] = True,
    html: Annotated[bool, typer.Option(help="Write report.html.")] = True,
    seed: Annotated[int | None, typer.Option(
        min=0, max=2**63 - 1, show_default=False, help="Random seed of the faults; default: the plant's.")] = None,
    quick: Annotated[bool | None, typer.Option(
        "--quick/--no-quick", show_default=False,
        help="Test firmware: waits 20 ms instead of 1 s after power-up; the plant's times move. "
             "Default: quick with --waves and where --time would end in the quiet second.")] = None,
    firmware: Annotated[Path | None, typer.Option(
        show_default=False, help="Another firmware image; say its settle time with --settle.")] = None,
    settle: Annotated[int | None, typer.Option(
        "--settle", parser=_time, metavar="TIME", show_default=False, help="Settle time of that image.")] = None,
    flash: Annotated[Path | None, typer.Option(
        show_default=False, metavar="FILE",
        help="Content of the flash: read before the run, written back after it; created erased when missing.")] = None,
) -> None:
    """Run a plant on the simulated master and report what happened."""
    described = _load(plant)
    chosen = quick is not None
    if quick is None:
        quick = firmware is None and (waves or (time is not None and time < SETTLE_NS + SHORTEST_LOOK_NS))
    settle_ns = settle if settle is not None else QUICK_SETTLE_NS if quick else SETTLE_NS
    described = described.with_settle(settle_ns)
    if seed is not None:
        described = replace(described, seed=seed)
    until_ns = described.duration_ns if time is None else time
    if until_ns == 0:
        raise _fail("--time: nothing to run", BAD_INPUT)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _fail(f"{out}: {error.strerror}", BAD_INPUT) from None
    with _only_run(out), _flash_file(flash) as storage:
        console = Console(highlight=False)
        if not console.is_terminal:
            console = Console(highlight=False, width=120)  # a file or a pipe has no width of its own
        console.print(Text(" ".join(described.description.split()), style="dim"))
        if quick and not chosen:
            console.print("note: the wait after power-up is 20 ms instead of 1 s in this run; "
                          "--no-quick, QUICK=0 keep it")
        if until_ns <= settle_ns:
            console.print(f"note: the line stays quiet until {report.ms(settle_ns)}, the wait after power-up")
        wave_path = out / "waves.part" if waves else None
        image = firmware or FIRMWARE / ("asi_test.hex" if quick else "asi.hex")
        files = ["report.json", *(["report.html"] if html else []),
                 *(["telegrams.log", "telegrams.jsonl"] if log else [])]
        try:
            bench = open_bench(image, wave_path, described.seed)
            if storage is not None:
                bench.attach_flash(storage.content)
        except BenchError as error:
            raise _fail(f"simulation: {error}", FAILED) from None
        try:
            for old in ("waves.fst", "waves.vcd", *([] if html else ["report.html"])):
                (out / old).unlink(missing_ok=True)  # never the waves or the page of another run beside this report
            with (_Bar if console.is_terminal else _Lines)(console) as progress:
                result = Runner(described, bench, out, until_ns, log=log, html=html, progress=progress).run()
            if storage is not None:
                _write_back(storage, bench.flash_content())
            bench.close()
            if wave_path is not None:
                files.append(name_waves(wave_path).name)
        except OSError as error:
            raise _fail(f"{out}: {error.strerror}", FAILED) from None
        report.show(result, console)
        console.print(Text(f"written: {', '.join(str(out / name) for name in files)}", style="dim"), soft_wrap=True)
        for check in result["checks"]:
            for difference in check["differences"]:
                typer.echo(f"not met: {check['name']} at {report.ms(check['at_ns'])}: {difference}", err=True)
        if result["error"]:
            typer.echo(f"simulation: {result['error']}", err=True)
        raise typer.Exit(EXIT_CODES[result["result"]])


@app.command()
def check(
    plants: Annotated[list[Path], typer.Argument(help="Plant files.", show_default=False)],
) -> None:
    """Check plant files without running them."""
    for path in plants:
        described = _load(path)
        typer.echo(f"{path}: {described.name}: {len(described.slaves)} slaves, {len(described.host.pcd)} projected, "
                   f"{report.ms(described.duration_ns)}")


# ---------------------------------------------------------------- decode
class Format(str, Enum):
    table, jsonl, csv, none = "table", "jsonl", "csv", "none"


def _writer(form: Format, out: TextIO) -> Callable[[dict[str, Any]], None]:
    """-> function that writes one telegram record."""
    if form == Format.table:
        out.write(HEADER)
        return lambda record: out.write(to_line(record) + "\n") and None
    if form == Format.jsonl:
        return lambda record: out.write(json.dumps(record, separators=(",", ":")) + "\n") and None
    if form == Format.csv:
        rows = csv.writer(out, lineterminator="\n")
        rows.writerow(decoding.FIELDS)
        return lambda record: rows.writerow([record[name] for name in decoding.FIELDS]) and None
    return lambda record: None


@contextmanager
def _output(path: Path | None) -> Iterator[TextIO]:
    if path is None:
        yield sys.stdout
        return
    try:
        file = open(path, "w", encoding="utf-8")
    except OSError as error:
        raise _fail(f"{path}: {error.strerror}", BAD_INPUT) from None
    with file:
        yield file


def _writable(*paths: Path | None) -> None:
    """What cannot be written is told before minutes of work, not after them; ends the program."""
    for path in filter(None, paths):
        new = not path.exists()
        try:
            open(path, "ab").close()
            if new:
                path.unlink()
        except OSError as error:
            raise _fail(f"{path}: {error.strerror}", BAD_INPUT) from None


def _numbers(text: str) -> frozenset[int]:
    try:
        return parse_numbers(text)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None


SignalP = Annotated[str | None, typer.Option("--p", metavar="SIGNAL", show_default=False,
                                             help="Positive comparator pulses; with --n.")]
SignalN = Annotated[str | None, typer.Option("--n", metavar="SIGNAL", show_default=False,
                                             help="Negative comparator pulses; with --p.")]
SignalMan = Annotated[list[str] | None, typer.Option(
    "--man", metavar="SIGNAL", show_default=False,
    help="Manchester level, idle high; twice for a pair of which one is idle.")]
SignalAnalog = Annotated[str | None, typer.Option("--analog", metavar="SIGNAL", show_default=False,
                                                  help="Voltage of the line.")]
Inverted = Annotated[bool, typer.Option("--invert", help="Wires swapped; Manchester level idle low.")]
Columns = Annotated[str | None, typer.Option(metavar="NAME,...", show_default=False,
                                             help="Column names of a CSV, instead of its header.")]
TimeUnit = Annotated[str | None, typer.Option(
    show_default=False, help="Time unit of a CSV: s, ms, us, ns; default: from the header, else s.")]
Arm = Annotated[float, typer.Option(metavar="VOLT", help="Least amplitude of a first analog pulse.")]


def _options(p: str | None, n: str | None, man: list[str] | None, analog: str | None, invert: bool,
             columns: str | None, time_unit: str | None, arm: float) -> Options:
    """The signals of a capture as the user said; a bad time unit ends the program."""
    if time_unit is not None and time_unit not in UNITS:
        raise _fail(f"--time-unit: '{time_unit}' is not one of {', '.join(UNITS)}", BAD_INPUT)
    return Options(p, n, tuple(man or ()), analog, invert,
                   tuple(c.strip() for c in columns.split(",")) if columns else (), time_unit, arm)


@app.command()
def decode(
    file: Annotated[Path, typer.Argument(help="Capture: VCD, FST, CSV or sigrok session (.sr).", show_default=False)],
    form: Annotated[Format, typer.Option("--format", "-f", help="What to write per telegram.")] = Format.table,
    out: Annotated[Path | None, typer.Option("--out", "-o", show_default=False,
                                             help="Where to; default: the terminal.")] = None,
    stats: Annotated[Path | None, typer.Option(
        "--stats", show_default=False, help="Write the statistics as JSON as well.")] = None,
    html: Annotated[Path | None, typer.Option(
        "--html", show_default=False, help="Write the report as one HTML page as well, with the eye.")] = None,
    p: SignalP = None, n: SignalN = None, man: SignalMan = None, analog: SignalAnalog = None, invert: Inverted = False,
    columns: Columns = None, time_unit: TimeUnit = None, arm: Arm = ARM_V,
    ab: Annotated[frozenset[int] | None, typer.Option(
        parser=_numbers, metavar="NUMBERS", show_default=False,
        help="Numbers with A/B addressing, e.g. 5,7,20-31; the others have none. Default: learned.")] = None,
    plant: Annotated[Path | None, typer.Option(
        show_default=False, help="Take the numbers with A/B addressing from a plant file.")] = None,
) -> None:
    """Decode the telegrams in a capture of the line."""
    if plant is not None and ab is not None:
        raise _fail("--ab and --plant: one of them", BAD_INPUT)
    known: Callable[[int], bool | None] = lambda number: None  # noqa: E731
    if plant is not None:
        known = _load(plant).extended
    elif ab is not None:
        known = ab.__contains__
    options = _options(p, n, man, analog, invert, columns, time_unit, arm)
    _writable(out, stats, html)
    info, code = Info(), OK
    trace, collected = (Trace(), Eye()) if html is not None else (None, None)
    with _output(out) as target:
        decoder = decoding.Decoder(_writer(form, target), decoding.Extended(known), each=trace and trace.add,
                                   eye=collected)
        try:
            decoding.decode(file, decoder, options, info)
        except CaptureError as error:
            target.flush()
            typer.echo(str(error), err=True)
            code = BAD_INPUT
        except KeyboardInterrupt:
            code = INTERRUPTED
        target.flush()
    result = decoder.statistics(file, info)
    if stats is not None:
        try:
            stats.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
        except OSError as error:
            raise _fail(f"{stats}: {error.strerror}", BAD_INPUT) from None
    if code == BAD_INPUT and not decoder.requests:
        raise typer.Exit(code)
    if html is not None:
        try:
            html_report.write(html_report.of_capture(result, trace, collected), html)
        except OSError as error:
            raise _fail(f"{html}: {error.strerror}", BAD_INPUT) from None
    if form in (Format.table, Format.none) or out is not None:
        console = Console(highlight=False)
        decoding.show(result, console if console.is_terminal else Console(highlight=False, width=120))
    else:  # the telegrams have the terminal for themselves
        for note in result["notes"]:
            typer.echo(f"note: {note}", err=True)
    if code == OK and not decoder.requests:
        code = NOT_MET
        typer.echo(f"{file}: no telegram", err=True)
    raise typer.Exit(code)


# ---------------------------------------------------------------- replay
@app.command()
def replay(
    file: Annotated[Path, typer.Argument(help="Capture: VCD, FST, CSV or sigrok session (.sr).", show_default=False)],
    p: SignalP = None, n: SignalN = None, man: SignalMan = None, analog: SignalAnalog = None, invert: Inverted = False,
    columns: Columns = None, time_unit: TimeUnit = None, arm: Arm = ARM_V,
    waves: Annotated[Path | None, typer.Option(
        "--waves", show_default=False, help="Write the chip's waveform (FST where the machine can, else VCD).")] = None,
    out: Annotated[Path | None, typer.Option(
        "--out", "-o", show_default=False, help="Write the chip's records as JSON lines.")] = None,
    firmware: Annotated[Path, typer.Option(help="Firmware image.")] = FIRMWARE / "asi_test.hex",
) -> None:
    """Feed a capture to the simulated chip, a passive monitor then, and compare what it saw with the decoder.

    Exit codes: 0 they agree, 1 they differ or there is no telegram, 2 bad capture or option, 3 the simulation
    failed, 130 stopped by Ctrl-C."""
    options, info = _options(p, n, man, analog, invert, columns, time_unit, arm), Info()
    _writable(out, waves)
    try:
        result = replaying.replay(file, firmware, options, waves, info)
    except CaptureError as error:
        raise _fail(str(error), BAD_INPUT) from None
    except (replaying.ReplayError, NativeError) as error:
        raise _fail(f"simulation: {error}", FAILED) from None
    if out is not None:
        try:
            with open(out, "w", encoding="utf-8") as target:
                for t_ns, record in result.records:
                    target.write(json.dumps(replaying.to_record(t_ns, record), separators=(",", ":")) + "\n")
        except OSError as error:
            raise _fail(f"{out}: {error.strerror}", FAILED) from None
    for difference in result.differences[:DIFFERENCES_SHOWN]:
        typer.echo(f"{difference.t_ns / 1e3:.3f} us: decoder: {replaying.describe(difference.decoder)}; "
                   f"chip: {replaying.describe(difference.chip)}")
    if len(result.differences) > DIFFERENCES_SHOWN:
        typer.echo(f"... {len(result.differences) - DIFFERENCES_SHOWN} more")
    if result.lost:
        typer.echo(f"{result.lost} telegrams found the ring full", err=True)
    typer.echo(f"{file}: {info.format}, {info.kind}: the chip recorded {len(result.records)} telegrams; "
               f"{result.calls} calls by the decoder, {len(result.differences)} differ")
    if not result.calls:
        raise _fail(f"{file}: no telegram", NOT_MET)
    raise typer.Exit(NOT_MET if result.differences or result.lost else OK)


def main() -> None:
    app(prog_name="asi")
