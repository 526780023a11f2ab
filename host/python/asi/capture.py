# SPDX-License-Identifier: Apache-2.0
"""Captures of an AS-i line (VCD, FST, CSV, sigrok session) as pulses. Times in ns.

read() finds out what a file is, picks the signals (DE-003) and pushes what it reads through a front end, which turns
levels or volts into pulses the way the receiver does. Nothing is kept but the present state, whatever the length.
Every fault of a file is a CaptureError: one line that names file, place and reason.
"""
import configparser
import math
import os
import re
import zipfile
import zlib
from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import count, islice, takewhile
from pathlib import Path
from typing import Any, BinaryIO

FILTER_NS = 750          # shorter pulses are ignored (RX-009)
MAN_PULSE_NS = 1_500      # raw pulse made of an edge of MAN
LOWEST_RATE_HZ = 2_000_000
LARGEST_V = 1_000.0      # more is no voltage of a line, but would spoil the DC part for long
ARM_V = 0.6              # the first pulse of a telegram must exceed this; the least legal one is 1.5 V
TELEGRAM_GAP_NS = 13_500  # two bit times and P_WIN_LATE: a telegram that lost one pulse still has no longer gap
BASE_NS = 1_000_000      # time constant of the DC removal
LOOK_NS = 500_000        # the first samples, whose median is the first guess of the DC part
LONGEST_LINE = 1 << 20
CHUNK = 1 << 16
LOOK_ROWS = 1000         # CSV rows looked at before decoding: sampled or changes, levels or volts
UNITS = {"s": 1e9, "ms": 1e6, "us": 1e3, "ns": 1.0, "ps": 1e-3, "fs": 1e-6}


class CaptureError(Exception):
    """A capture that cannot be read (further); the text is 'file: place: reason'."""


@dataclass(frozen=True)
class Options:
    """What the user says about a capture; every name may be a full name, its last part or (CSV) a column number."""
    p: str | None = None
    n: str | None = None
    man: tuple[str, ...] = ()
    analog: str | None = None
    invert: bool = False                # wires swapped; MAN: idle low
    columns: tuple[str, ...] = ()       # CSV without a header
    time_unit: str | None = None        # CSV
    arm_v: float = ARM_V


@dataclass
class Sink:
    """Where a capture goes. pulse(t_ns, polarity); begin(t_ns): the capture starts; phase(t_ns, number): phase_o.

    raw(t_ns, polarity, width_ns): what the comparators showed, before the filter, each pulse when it is over.
    Only for eye diagrams: end(t_ns, polarity): a comparator pulse ended; sample(t_ns, volts): without the DC part.
    """
    pulse: Callable[[float, int], None]
    begin: Callable[[float], None] = lambda t_ns: None
    phase: Callable[[float, int], None] = lambda t_ns, number: None
    end: Callable[[float, int], None] | None = None
    sample: Callable[[float, float], None] | None = None
    raw: Callable[[float, int, float], None] | None = None


@dataclass
class Info:
    """What was read so far: format, signals as they were chosen, last time."""
    format: str = ""
    kind: str = ""                      # pulses, man, analog
    signals: list[str] = field(default_factory=list)
    end_ns: float = 0
    notes: list[str] = field(default_factory=list)
    front: Any = None


# ---------------------------------------------------------------- front ends
class _Filter:
    """One level: a change counts when it lasted filter_ns, shorter ones never happened (as in asi_pulse_filter)."""

    def __init__(self, filter_ns: float):
        self.filter_ns = filter_ns
        self.state: int | None = None
        self.since: float | None = None     # start of a change that has not lasted long enough yet

    def due(self, t_ns: float) -> bool:
        return self.since is not None and t_ns - self.since >= self.filter_ns

    def flip(self) -> float:
        since, self.since, self.state = self.since, None, 1 - self.state
        return since

    def level(self, t_ns: float, level: int) -> None:
        if self.state is None:
            self.state = level              # in the middle of something: nobody knows when it began
        elif level == self.state:
            self.since = None
        elif self.since is None:
            self.since = t_ns


class Comparators:
    """Levels of the two comparators -> pulses."""

    def __init__(self, sink: Sink, filter_ns: float, invert: bool = False):
        self._pulse, self._raw, self._end, self._sign = sink.pulse, sink.raw, sink.end, -1 if invert else 1
        self._p, self._n = _Filter(filter_ns), _Filter(filter_ns)
        self._rose: dict[int, float] = {}    # raw: polarity -> start of its pulse

    def levels(self, t_ns: float, p: int, n: int) -> None:
        self.settle(t_ns)
        if self._raw:
            for level, polarity in ((p, self._sign), (n, -self._sign)):
                if level and polarity not in self._rose:
                    self._rose[polarity] = t_ns
                elif not level and polarity in self._rose:
                    start = self._rose.pop(polarity)
                    self._raw(start, polarity, t_ns - start)
        self._p.level(t_ns, p)
        self._n.level(t_ns, n)

    def settle(self, t_ns: float) -> None:
        p, n = self._p, self._n
        found = []
        if p.due(t_ns):
            rises = not p.state
            since = p.flip()
            if rises:
                found.append((since, self._sign))
            elif self._end:
                self._end(since, self._sign)
        if n.due(t_ns):
            rises = not n.state
            since = n.flip()
            if rises:
                found.append((since, -self._sign))
            elif self._end:
                self._end(since, -self._sign)
        if len(found) == 2 and found[1][0] < found[0][0]:
            found.reverse()
        for since, polarity in found:
            self._pulse(since, polarity)


class Manchester:
    """MAN, idle high -> pulses: falling edge negative, rising positive (TL-005)."""

    def __init__(self, sink: Sink, filter_ns: float, invert: bool = False):
        self._pulse, self._raw, self._invert, self._man = sink.pulse, sink.raw, invert, _Filter(filter_ns)

    def level(self, t_ns: float, man: int) -> None:
        self.settle(t_ns)
        self._man.level(t_ns, man ^ self._invert)

    def settle(self, t_ns: float) -> None:
        if self._man.due(t_ns):
            since = self._man.flip()
            self._pulse(since, 1 if self._man.state else -1)
            if self._raw:
                self._raw(since, 1 if self._man.state else -1, MAN_PULSE_NS)


class Analog:
    """Volts -> comparator levels -> pulses.

    DC is removed by a slow mean that starts at the median of the first samples. The first pulse after a pause is
    followed to its peak; half of that is the threshold of both polarities until the next pause.
    """

    def __init__(self, sink: Sink, filter_ns: float, invert: bool = False, arm_v: float = ARM_V):
        self._out = Comparators(sink, filter_ns)
        self._sample = sink.sample
        self._sign, self._arm = -1.0 if invert else 1.0, arm_v
        self._first: list[tuple[float, float]] | None = []   # samples before the DC part is known
        self._base = 0.0
        self._last = (0.0, 0.0)
        self._threshold = 0.0                # 0: waiting for a first pulse
        self._head: list[tuple[float, float]] = []
        self._levels = (0, 0)
        self._active_ns = float("-inf")      # last time beyond the threshold

    def sample(self, t_ns: float, volts: float) -> None:
        volts = self._sign * min(LARGEST_V, max(-LARGEST_V, volts))
        if self._first is None:
            self._step(t_ns, volts)
            return
        self._first.append((t_ns, volts))
        if t_ns - self._first[0][0] >= LOOK_NS or len(self._first) >= CHUNK:
            self._start()

    def settle(self, t_ns: float) -> None:
        """The capture ends at t_ns."""
        if self._first:
            self._start()
        self._out.settle(t_ns)

    def _start(self) -> None:
        first, self._first = self._first, None
        self._base = sorted(volts for _, volts in first)[len(first) // 2]
        self._last = (first[0][0], 0.0)
        self._out.levels(first[0][0], 0, 0)
        for t_ns, volts in first:
            self._step(t_ns, volts)

    def _step(self, t_ns: float, volts: float) -> None:
        value = volts - self._base
        if self._sample:
            self._sample(t_ns, value)
        self._base += value * min(1.0, (t_ns - self._last[0]) / BASE_NS)
        if self._threshold:
            self._compare(t_ns, value)
            if t_ns - self._active_ns > TELEGRAM_GAP_NS:
                self._threshold = 0.0
        elif self._head:
            self._head.append((t_ns, value))
            peak = max((v for _, v in self._head), key=abs)
            if abs(value) < abs(peak) / 2 or value * peak < 0 or t_ns - self._head[1][0] > TELEGRAM_GAP_NS:
                # over: replay it with the threshold it has set; a positive one is judged by itself only
                self._threshold = abs(peak) / 2
                head, self._head = self._head, []
                self._last = head[0]
                for at, v in head[1:]:
                    self._compare(at, v)
                    self._last = (at, v)
                if peak > 0:
                    self._threshold = 0.0
                    self._set(t_ns, 0, 0)
        elif abs(value) > self._arm:
            self._head = [self._last, (t_ns, value)]
        self._last = (t_ns, value)

    def _compare(self, t_ns: float, value: float) -> None:
        p, n = int(value > self._threshold), int(value < -self._threshold)
        if p or n:
            self._active_ns = t_ns
        if (p, n) != self._levels:
            before_ns, before = self._last
            edge = math.copysign(self._threshold, value if p or n else before)
            part = (edge - before) / (value - before) if value != before else 1.0
            self._set(before_ns + (t_ns - before_ns) * min(1.0, max(0.0, part)), p, n)

    def _set(self, t_ns: float, p: int, n: int) -> None:
        self._levels = (p, n)
        self._out.levels(t_ns, p, n)


class _Front:
    """The front end for the chosen kind of signals; values(t_ns, [one value per signal, in the order chosen])."""

    def __init__(self, kind: str, options: Options, sink: Sink, sample_ns: float = 0.0):
        self.kind = kind
        filter_ns = max(0.0, FILTER_NS - sample_ns)  # a sampled pulse may look one sample shorter than it is
        if kind == "pulses":
            self._end = Comparators(sink, filter_ns, options.invert)
        elif kind == "man":
            self._end = Manchester(sink, filter_ns, options.invert)
        else:
            self._end = Analog(sink, filter_ns, options.invert, options.arm_v)
        self._idle = 0 if options.invert else 1

    def values(self, t_ns: float, values: Sequence[Any]) -> None:
        if self.kind == "pulses":
            self._end.levels(t_ns, values[0], values[1])
        elif self.kind == "man":  # of several MAN signals at most one is not idle
            self._end.level(t_ns, self._idle if all(v == self._idle for v in values) else 1 - self._idle)
        else:
            self._end.sample(t_ns, values[0])

    def idle(self) -> list[Any]:
        return [0, 0] if self.kind == "pulses" else [self._idle] * 8 if self.kind == "man" else [0.0]

    def settle(self, t_ns: float) -> None:
        self._end.settle(t_ns)


# ---------------------------------------------------------------- choice of signals
_P = re.compile(r"(as_?i_?)?(rx_?)?(p|pos)(_?pulse)?(_[io])?")
_N = re.compile(r"(as_?i_?)?(rx_?)?(n|neg)(_?pulse)?(_[io])?")
_RX_MAN = re.compile(r"(as_?i_?)?(rx_?)?man(chester)?(_[io])?")
_TX_MAN = re.compile(r"(as_?i_?)?tx_?man(_[io])?")
_ANALOG = re.compile(r"(as_?i[+-]?|u|v|volts?|voltage|line|u_?asi|v_?asi|analog.*|ch(annel)? ?[a0-9]?)"
                     r"( ?[\[(]v[\])])?")
_TIME = re.compile(r"(time|t|x|seconds?|timestamp)([ _]*[\[(]?(?P<unit>fs|ps|ns|us|ms|s)[\])]?)?")


def _leaf(name: str) -> str:
    return re.sub(r"\s*\[[\d:]+\]$", "", name.rsplit(".", 1)[-1]).strip().lower()


def _find(names: Sequence[str], wanted: str, where: str) -> int:
    """The signal a user means: full name, else last part, the outermost of several; CaptureError."""
    for full in (True, False):
        key = wanted.strip().lower()
        hits = [k for k, name in enumerate(names) if (name.lower() if full else _leaf(name)) == key]
        if hits:
            return min(hits, key=lambda k: names[k].count("."))
    there = ", ".join(names[:8]) + (" ..." if len(names) > 8 else "")
    raise CaptureError(f"{where}: no signal '{wanted}'; there are: {there or 'none'}")


def choose(names: Sequence[str], options: Options, where: str, analog: Callable[[int], bool]) -> tuple[str, list[int]]:
    """-> kind, numbers of the signals. analog(k): signal k has volts, not levels."""
    if (options.p is None) != (options.n is None):
        raise CaptureError(f"{where}: --p and --n come together")
    asked = [bool(options.p), bool(options.man), bool(options.analog)]
    if sum(asked) > 1:
        raise CaptureError(f"{where}: one of --p with --n, --man, --analog")
    if options.p:
        return "pulses", [_find(names, options.p, where), _find(names, options.n, where)]
    if options.man:
        return "man", [_find(names, name, where) for name in options.man[:8]]
    if options.analog:
        return "analog", [_find(names, options.analog, where)]

    def outermost(pattern: re.Pattern, want_analog: bool) -> int | None:
        hits = [k for k, name in enumerate(names) if pattern.fullmatch(_leaf(name)) and analog(k) == want_analog]
        return min(hits, key=lambda k: names[k].count("."), default=None)

    p, n = outermost(_P, False), outermost(_N, False)
    if p is not None and n is not None:
        return "pulses", [p, n]
    for pattern in (_RX_MAN, _TX_MAN):
        if (man := outermost(pattern, False)) is not None:
            return "man", [man]
    if (volts := outermost(_ANALOG, True)) is not None:
        return "analog", [volts]
    if len(names) == 1:
        return ("analog" if analog(0) else "man"), [0]
    there = ", ".join(names[:8]) + (" ..." if len(names) > 8 else "")
    raise CaptureError(f"{where}: cannot tell which signals are the line; say --p and --n, --man or --analog; "
                       f"there are: {there or 'none'}")


def _described(info: Info, names: Sequence[str], chosen: Sequence[int]) -> None:
    info.signals = [names[k] for k in chosen]
    if info.kind == "man" and all(_TX_MAN.fullmatch(_leaf(name)) for name in info.signals):
        info.notes.append(f"{', '.join(info.signals)}: the transmitter only, answers are not in these signals")


def _phase_signal(names: Sequence[str], chosen: Sequence[int]) -> int | None:
    """phase_o next to the first chosen signal: the chip's own captures have it."""
    scope = names[chosen[0]].rpartition(".")[0]
    return next((k for k, name in enumerate(names) if name.rpartition(".")[0] == scope and _leaf(name) == "phase_o"),
                None)


# ---------------------------------------------------------------- VCD
def _lines(file: BinaryIO, where: str) -> Iterator[tuple[int, bytes]]:
    for number in range(1, 1 << 62):
        line = file.readline(LONGEST_LINE)
        if not line:
            return
        if len(line) == LONGEST_LINE:
            raise CaptureError(f"{where}: line {number}: longer than {LONGEST_LINE} characters")
        yield number, line


def _vcd_header(lines: Iterator[tuple[int, bytes]], where: str) -> tuple[float, list[tuple[str, str, str]]]:
    """-> (ns per time step, [(full name, code, type)])."""
    step_ns, scopes, signals, command, number = None, [], [], None, 0
    for number, line in lines:
        for word in line.decode("utf-8", "replace").split():
            if command is None:
                if not word.startswith("$"):
                    raise CaptureError(f"{where}: line {number}: '{word[:20]}' where a VCD has a $ command")
                command, words = word, []
            elif word != "$end":
                words.append(word)
                continue
            if word != "$end":
                continue
            if command == "$timescale":
                match = re.fullmatch(r"(1|10|100)(s|ms|us|ns|ps|fs)", "".join(words))
                if not match:
                    raise CaptureError(f"{where}: line {number}: timescale '{' '.join(words)[:20]}'")
                step_ns = int(match[1]) * UNITS[match[2]]
            elif command == "$scope":
                scopes.append(words[1] if len(words) > 1 else "?")
            elif command == "$upscope":
                del scopes[-1:]
            elif command == "$var":
                if len(words) < 4:
                    raise CaptureError(f"{where}: line {number}: $var with {len(words)} words")
                signals.append((".".join([*scopes, words[3]]), words[2], words[0]))
            elif command == "$enddefinitions":
                if step_ns is None:
                    raise CaptureError(f"{where}: line {number}: no $timescale before the first value")
                return step_ns, signals
            command = None
    raise CaptureError(f"{where}: line {number}: ends before $enddefinitions")


def _read_vcd(path: Path, options: Options, sink: Sink, info: Info) -> None:
    where = str(path)
    with open(path, "rb") as file:
        lines = _lines(file, where)
        step_ns, signals = _vcd_header(lines, where)
        names = [name for name, _, _ in signals]
        info.kind, chosen = choose(names, options, where, lambda k: signals[k][2] in ("real", "realtime"))
        _described(info, names, chosen)
        front = info.front = _Front(info.kind, options, sink)
        values = front.idle()[:len(chosen)]
        slots: dict[bytes, list[int]] = {}
        for slot, k in enumerate(chosen):
            slots.setdefault(signals[k][1].encode(), []).append(slot)
        phase = _phase_signal(names, chosen)
        phase_code = None if phase is None else signals[phase][1].encode()
        now, changed, begun, skip = 0.0, False, False, False
        number = 0
        for number, line in lines:
            words = iter(line.split())
            for word in words:
                kind, text = word[:1], word[1:]
                if skip:                                        # inside $comment
                    skip = word != b"$end"
                    continue
                if kind == b"#":
                    if not text.isdigit() or len(text) > 18:
                        raise CaptureError(f"{where}: line {number}: time '{_shown(word)}'")
                    time = int(text) * step_ns
                    if begun and time < now:
                        raise CaptureError(f"{where}: line {number}: time goes back from {now:.0f} to {time:.0f} ns")
                    if changed:
                        front.values(now, values)
                        changed = False
                    now = info.end_ns = time
                    if not begun:
                        begun = True
                        sink.begin(now)
                    continue
                if kind == b"$":
                    skip = word == b"$comment"
                    continue
                if kind in b"bBrR":
                    code = next(words, None)
                    if code is None:
                        raise CaptureError(f"{where}: line {number}: '{_shown(word)}' without a signal")
                elif kind in b"01xXzZuUwWlLhH-":
                    code = text
                    text = kind
                elif kind in b"sS":
                    next(words, None)
                    continue
                else:
                    raise CaptureError(f"{where}: line {number}: '{_shown(word)}' is no value change")
                if code in slots:
                    value = _vcd_value(text, kind, info.kind)
                    if value is None and info.kind == "analog":
                        raise CaptureError(f"{where}: line {number}: '{_shown(word)}' is no voltage")
                    if value is not None:                       # x, z: as it was
                        for slot in slots[code]:
                            values[slot] = value
                        changed = True
                elif code == phase_code and text.isdigit():
                    sink.phase(now, int(text, 2) if set(text) <= set(b"01") else 0)
        if changed:
            front.values(now, values)


def _vcd_value(text: bytes, kind: bytes, want: str) -> float | int | None:
    if want == "analog":
        try:
            value = float(text)
        except ValueError:
            return None
        return value if math.isfinite(value) else None
    return {b"1": 1, b"h": 1, b"H": 1, b"0": 0, b"l": 0, b"L": 0}.get(text[-1:])


def _shown(word: bytes) -> str:
    return "".join(c if c.isprintable() else "?" for c in word[:20].decode("latin-1"))


# ---------------------------------------------------------------- FST
@contextmanager
def _silent() -> Iterator[None]:
    """The FST reader prints its panics to standard error by itself; here each becomes a CaptureError instead."""
    saved = os.dup(2)
    try:
        with open(os.devnull, "wb") as nowhere:
            os.dup2(nowhere.fileno(), 2)
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)


def _read_fst(path: Path, options: Options, sink: Sink, info: Info) -> None:
    import pywellen  # only here: other formats need nothing beyond the standard library
    where = str(path)
    begun, last_phase = False, None
    try:
        with _silent():
            wave = pywellen.Waveform(where, stream_only=True)
            signals = list(wave.all_vars())
            scale = wave.timescale
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # a panic of the reader is no Exception
        raise CaptureError(f"{where}: {_one_line(error)}") from None
    if scale is None or str(scale.unit) not in UNITS:
        raise CaptureError(f"{where}: no timescale")
    step_ns = scale.factor * UNITS[str(scale.unit)]
    names = [var.full_name for var in signals]
    info.kind, chosen = choose(names, options, where, lambda k: bool(signals[k].is_real))
    _described(info, names, chosen)
    front = info.front = _Front(info.kind, options, sink)
    values = front.idle()[:len(chosen)]
    ids = [signals[k].signal_id for k in chosen]
    phase = _phase_signal(names, chosen)
    phase_id = None if phase is None else signals[phase].signal_id

    def step(time: int, present: Any, _changed: Any) -> None:
        nonlocal begun, last_phase
        now = info.end_ns = time * step_ns
        if not begun:
            begun = True
            sink.begin(now)
        if phase_id is not None and (number := present[phase_id]) != last_phase:
            last_phase = number
            sink.phase(now, number if isinstance(number, int) else 0)
        for slot, signal in enumerate(ids):
            value = present[signal]
            if isinstance(value, (int, float)):  # else x or z: as it was
                values[slot] = value if info.kind == "analog" else int(value) & 1
        front.values(now, values)

    wanted = [signals[k] for k in ([*chosen] if phase is None else [*chosen, phase])]
    try:
        with _silent():
            wave.stream_time_steps(step, wanted)
    except (KeyboardInterrupt, SystemExit, BrokenPipeError):
        raise
    except BaseException as error:
        raise CaptureError(f"{where}: at {info.end_ns:.0f} ns: {_one_line(error)}") from None


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__


# ---------------------------------------------------------------- CSV
def _cells(line: bytes, delimiter: str) -> list[str]:
    return [cell.strip().strip('"').strip() for cell in line.decode("utf-8-sig", "replace").split(delimiter)]


def _number(text: str, delimiter: str) -> float | None:
    try:
        value = float(text.replace(",", ".") if delimiter != "," else text)
    except ValueError:
        return None
    return value if math.isfinite(value) and "_" not in text else None


def _row(cells: list[str], delimiter: str) -> list[float] | None:
    row = [_number(cell, delimiter) for cell in cells]
    return None if None in row or len(row) < 2 else row


def _read_csv(path: Path, options: Options, sink: Sink, info: Info) -> None:
    where = str(path)
    with open(path, "rb") as file:
        lines = ((number, line) for number, line in _lines(file, where)
                 if line.strip() and not line.lstrip().startswith((b"#", b"//")))
        head: list[str] | None = None
        delimiter, row = ",", None
        for number, line in islice(lines, 100):
            for delimiter in (",", ";", "\t"):
                row = _row(_cells(line, delimiter), delimiter)
                if row is not None:
                    break
            if row is not None:
                break
            delimiter = max(",;\t", key=lambda d: line.count(d.encode()))
            if len(cells := _cells(line, delimiter)) > 1:
                head = cells
        if row is None:
            raise CaptureError(f"{where}: no VCD, FST or sigrok session, and no row of numbers as in a CSV")
        width = len(row)
        if options.columns:
            head = list(options.columns)
        if head is None:
            raise CaptureError(f"{where}: line {number}: no header; name the columns: --columns time,rx_p,rx_n")
        if len(head) != width:
            raise CaptureError(f"{where}: line {number}: {width} values under {len(head)} column names")

        def rows() -> Iterator[tuple[int, list[float]]]:
            yield number, row
            for at, line in lines:
                values = _row(_cells(line, delimiter), delimiter)
                if values is None or len(values) != width:
                    raise CaptureError(f"{where}: line {at}: not {width} numbers: '{_shown(line.strip())}'")
                yield at, values

        stream = rows()
        early, fault = [], None
        try:
            for entry in islice(stream, LOOK_ROWS):
                early.append(entry)
        except CaptureError as error:   # what is before the bad line is decoded first
            fault = error
        times = [k for k, name in enumerate(head) if _TIME.fullmatch(name.lower())]
        column = times[0] if times else 0
        unit = options.time_unit or (times and _TIME.fullmatch(head[column].lower())["unit"]) or "s"
        if unit not in UNITS:
            raise CaptureError(f"{where}: time unit '{unit}', one of {', '.join(UNITS)}")
        scale = UNITS[unit]
        others = [k for k in range(width) if k != column]
        analog = {k: any(entry[1][k] not in (0.0, 1.0) for entry in early) for k in others}
        names = [head[k] or f"column {k + 1}" for k in others]

        def by_number(name: str | None) -> str | None:
            """'3': the third column of the file, unless a column is called that."""
            if name is not None and name.isdecimal() and name not in names and int(name) - 1 in others:
                return names[others.index(int(name) - 1)]
            return name

        numbered = Options(by_number(options.p), by_number(options.n), tuple(map(by_number, options.man)),
                           by_number(options.analog))
        info.kind, chosen = choose(names, numbered, where, lambda k: analog[others[k]])
        _described(info, names, chosen)
        picked = [others[k] for k in chosen]
        steps = [(b[1][column] - a[1][column]) * scale for a, b in zip(early, early[1:])]
        even = bool(steps) and max(steps) - min(steps) <= 0.05 * max(steps) and len(steps) >= 16
        sample_ns = sum(steps) / len(steps) if even else 0.0
        slowest = 1e9 / LOWEST_RATE_HZ
        if sample_ns > slowest * 1.01 or (info.kind == "analog" and steps and min(steps) > slowest * 1.01):
            raise CaptureError(f"{where}: a sample every {sample_ns or min(steps):.0f} ns is too slow; "
                               f"at least {LOWEST_RATE_HZ / 1e6:g} MHz ({slowest:.0f} ns)")
        front = info.front = _Front(info.kind, options, sink, sample_ns)
        sink.begin(early[0][1][column] * scale)
        now = early[0][1][column] * scale

        def feed(entries: Iterator[tuple[int, list[float]]] | list[tuple[int, list[float]]]) -> None:
            nonlocal now
            before: list[Any] = []
            for at, values in entries:
                time = values[column] * scale
                if time < now:
                    raise CaptureError(f"{where}: line {at}: time goes back from {now:.0f} to {time:.0f} ns")
                now = info.end_ns = time
                if info.kind == "analog":
                    front.values(now, [values[picked[0]]])
                    continue
                levels = [int(values[k] > 0.5) for k in picked]
                if levels != before:
                    before = levels
                    front.values(now, levels)

        feed(early)
        if fault:
            raise fault
        feed(stream)


# ---------------------------------------------------------------- sigrok session
def _rate(text: str) -> float:
    match = re.fullmatch(r"\s*([\d.]+)\s*([kMG]?)(Hz)?\s*", text, re.I)
    return float(match[1]) * {"": 1, "k": 1e3, "m": 1e6, "g": 1e9}[match[2].lower()] if match else 0.0


def _chunks(session: zipfile.ZipFile, stem: str) -> Iterator[bytes]:
    """The parts of one capture file, in pieces: 'logic-1', or 'logic-1-1', 'logic-1-2' ... as long as there are."""
    there = set(session.namelist())
    names = (f"{stem}-{number}" for number in count(1))
    for name in [stem] if stem in there else takewhile(there.__contains__, names):
        with session.open(name) as part:
            while piece := part.read(CHUNK):
                yield piece


def _whole(chunks: Iterator[bytes], size: int) -> Iterator[bytes]:
    """The same bytes in pieces that are multiples of size; a rest at the end is dropped."""
    rest = b""
    for piece in chunks:
        piece = rest + piece
        keep = len(piece) - len(piece) % size
        rest = piece[keep:]
        if keep:
            yield piece[:keep]


def _read_sr(path: Path, options: Options, sink: Sink, info: Info) -> None:
    where = str(path)
    try:
        with zipfile.ZipFile(path) as session:
            _read_session(session, where, options, sink, info)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, KeyError, ValueError,
            configparser.Error, OverflowError) as error:
        raise CaptureError(f"{where}: damaged sigrok session: {_one_line(error)}") from None


def _read_session(session: zipfile.ZipFile, where: str, options: Options, sink: Sink, info: Info) -> None:
    if "metadata" not in session.namelist():
        raise CaptureError(f"{where}: a zip file without 'metadata' is no sigrok session")
    metadata = configparser.ConfigParser(interpolation=None, strict=False)
    metadata.optionxform = str
    with session.open("metadata") as file:
        metadata.read_string(file.read(LONGEST_LINE).decode("utf-8", "replace"))
    device = next((metadata[name] for name in metadata.sections() if name.startswith("device")), None)
    if device is None:
        raise CaptureError(f"{where}: metadata: no [device 1]")
    rate = _rate(device.get("samplerate", ""))
    if not math.isfinite(rate) or rate < LOWEST_RATE_HZ:
        raise CaptureError(f"{where}: metadata: sample rate '{device.get('samplerate', 'missing')}' is not at least "
                           f"{LOWEST_RATE_HZ / 1e6:g} MHz")
    probes = sorted((int(key[5:]), name) for key, name in device.items() if re.fullmatch(r"probe\d{1,3}", key))
    analogs = sorted((int(key[6:]), name) for key, name in device.items() if re.fullmatch(r"analog\d{1,3}", key))
    channels = [(number, name, False) for number, name in probes] + [(n, name, True) for n, name in analogs]
    names = [name for _, name, _ in channels]
    info.kind, chosen = choose(names, options, where, lambda k: channels[k][2])
    _described(info, names, chosen)
    if any(channels[k][2] != (info.kind == "analog") for k in chosen):
        raise CaptureError(f"{where}: {', '.join(info.signals)}: {'levels' if info.kind == 'analog' else 'volts'}"
                           f" where {'volts' if info.kind == 'analog' else 'levels'} are needed")
    front = info.front = _Front(info.kind, options, sink, 1e9 / rate)
    sink.begin(0.0)
    done = 0
    if info.kind == "analog":
        number = channels[chosen[0]][0]
        for piece in _whole(_chunks(session, f"analog-1-{number}"), 4):
            for volts in array("f", piece):
                if not math.isfinite(volts):
                    raise CaptureError(f"{where}: sample {done} is no voltage")
                info.end_ns = done * 1e9 / rate
                front.values(info.end_ns, [volts])
                done += 1
    else:
        size = int(device.get("unitsize", "1"))
        bits = [channels[k][0] - 1 for k in chosen]
        if not 1 <= size <= 16 or not 0 <= min(bits) <= max(bits) < 8 * size:
            raise CaptureError(f"{where}: metadata: unit size {size} for probe {max(bits) + 1}")
        tables = [bytes((value >> (bit & 7) & 1) << slot for value in range(256)) for slot, bit in enumerate(bits)]
        last = -1
        for piece in _whole(_chunks(session, device.get("capturefile", "logic-1")), size):
            length = len(piece) // size
            merged = 0
            for bit, table in zip(bits, tables):  # one number per sample, without a loop over the samples
                merged |= int.from_bytes(piece[bit >> 3::size].translate(table), "little")
            for run in re.finditer(rb"(.)\1*", merged.to_bytes(length, "little"), re.S):
                value = run[1][0]
                if value != last:
                    last = value
                    front.values((done + run.start()) * 1e9 / rate, [value >> slot & 1 for slot in range(len(bits))])
            done += length
            info.end_ns = done * 1e9 / rate
    if not done:
        raise CaptureError(f"{where}: no samples")


# ---------------------------------------------------------------- entry

def _format(path: Path) -> str:
    with open(path, "rb") as file:
        start = file.read(256)
    if not start:
        raise CaptureError(f"{path}: empty")
    if start[:4] == b"PK\x03\x04":
        return "sigrok session"
    if start[:9] == (b"\0" + (329).to_bytes(8, "big")) or start[:1] == b"\xfe" or path.suffix.lower() == ".fst":
        return "FST"
    if start.lstrip()[:1] == b"$" or path.suffix.lower() == ".vcd":
        return "VCD"
    return "CSV"


def read(path: Path, options: Options, sink: Sink, info: Info) -> None:
    """Read a capture and push its pulses; info is filled in on the way. CaptureError names file, place and reason."""
    if not math.isfinite(options.arm_v) or options.arm_v <= 0:
        raise CaptureError(f"{path}: {options.arm_v} V is no least amplitude")
    try:
        info.format = _format(path)
        {"VCD": _read_vcd, "FST": _read_fst, "CSV": _read_csv, "sigrok session": _read_sr}[info.format](
            path, options, sink, info)
    except BrokenPipeError:
        raise
    except OSError as error:
        raise CaptureError(f"{path}: {error.strerror or error}") from None
    finally:
        if info.front:
            info.front.settle(info.end_ns)
