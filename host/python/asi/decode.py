# SPDX-License-Identifier: Apache-2.0
"""Telegram decoder: pulses of a capture -> telegram records and statistics (docs/decode.md). Times in ns."""
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from asi.capture import Info, Options, Sink, read
from asi.monitor import RX_TIMEOUT_NS, Monitor, Telegram
from asi.regmap import ErrorClass
from asi.telegram import address_name, decode_call, line_order
from asi.telegram_log import Span, to_record, wider

if TYPE_CHECKING:  # rich only where something is shown: the decoder itself runs on the standard library (DE-014)
    from rich.console import Console, Group

SCHEMA = "asi-decode 1"
FIELDS = ("t_ns", "call", "address", "index", "data", "answer", "delay_ns", "class", "phase", "repeated", "request_ok",
          "word")
ALTERNATIONS = 8            # DEXG calls in a row whose I3 alternates: nothing but an A/B pair does that
START_NS = 1_000_000        # later than this after the start a bad request is one, not a rest of something
CYCLE_SILENCE_NS = 10_000_000  # a longer silence is no part of a cycle
EXTRA_CALLS = 2             # in one cycle, beside DEXG
CYCLE_CALLS = 70            # so many calls without the lowest address: it is no longer called
_SEL_CALLS = ("RDIO", "RDID", "RID1", "RID2", "RDST", "RES", "DELA", "R1")


class Extended:
    """Which numbers use A/B addressing, learned from the calls (DE-006). Known numbers are never changed."""

    def __init__(self, known: Callable[[int], bool | None] = lambda number: None):
        self._known = known
        self._learned: dict[int, bool] = {}
        self._i3: dict[int, tuple[int, int]] = {}    # number -> last I3, DEXG calls in a row with the other one

    def __call__(self, number: int) -> bool:
        known = self._known(number)
        return self._learned.get(number, False) if known is None else known

    def learn(self, telegram: Telegram) -> None:
        if not telegram.request_ok:
            return
        number = telegram.call >> 5 & 31
        call = decode_call(telegram.call)
        answered = telegram.error_class == ErrorClass.OK and telegram.data is not None
        if not number:
            return
        if answered and call.name == "RDID":
            self._learned[number] = telegram.data == 0xA
        elif answered and call.name in _SEL_CALLS and call.index >= 32:
            self._learned[number] = True
        elif call.name == "DEXG" and not telegram.repeated and number not in self._learned:
            i3 = telegram.call >> 3 & 1
            last, times = self._i3.get(number, (i3, 0))
            self._i3[number] = (i3, times + 1 if i3 != last else 0)
            if self._i3[number][1] >= ALTERNATIONS - 1:
                self._learned[number] = True


@dataclass
class SlaveCounts:
    """What one address did. deviation_ns: of the pulses of good answers, the largest with its sign."""
    requests: int = 0
    repeated: int = 0
    answers: int = 0
    classes: Counter = field(default_factory=Counter)
    delay: Span = field(default_factory=Span)
    deviation_ns: float | None = None


class Cycles:
    """Cycle times: from one DEXG to the lowest number to the next one (DE-007)."""

    def __init__(self) -> None:
        self.span = Span()
        self._lowest: int | None = None
        self._start: float | None = None
        self._extra = self._calls = 0
        self._last_ns = 0.0

    def add(self, t_ns: float, name: str, number: int, repeated: bool) -> None:
        if t_ns - self._last_ns > CYCLE_SILENCE_NS:
            self._start = None
        self._last_ns = t_ns
        if repeated:
            return
        self._calls += 1
        if name != "DEXG":
            self._extra += 1
        elif self._lowest is None or number < self._lowest or self._calls > CYCLE_CALLS:
            self._lowest, self._start, self._calls = number, None, 0  # its first call may be an activation
        elif number == self._lowest:
            if self._start is not None and self._extra <= EXTRA_CALLS:
                self.span.add(t_ns - self._start)
            self._start, self._extra, self._calls = t_ns, 0, 0


class Decoder:
    """Pulses in, records out: emit(record) per request, fields as in docs/telegram_log.md. Counts on the way.

    each(record, telegram): like emit, with the monitor's telegram. eye: asi.eye.Eye to fill.
    """

    def __init__(self, emit: Callable[[dict[str, Any]], None], extended: Extended | None = None, *,
                 each: Callable[[dict[str, Any], Telegram], None] | None = None, eye: Any = None):
        self.extended = extended or Extended()
        self.slaves: dict[int, SlaveCounts] = {}
        self.cycles = Cycles()
        self.calls: Counter = Counter()
        self.classes: Counter = Counter()
        self.requests = self.repeated = self.failed = self.bad_requests = self.positive_starts = 0
        self.request_deviation_ns: float | None = None
        self.first_ns: float | None = None
        self.last_ns = self.begin_ns = self._pulse_ns = 0.0
        self.notes: list[str] = []
        self._emit, self._each, self._eye = emit, each, eye
        self._sync_ns = float("inf")    # from here on a telegram that begins is a request
        self._phases: deque[tuple[float, int]] = deque()
        self._phase: int | None = None
        self._now = 0.0
        self._monitor = Monitor(phase=self._phase_now, sink=self._finished, listen=eye and eye.telegram)

    def sink(self) -> Sink:
        eye = self._eye
        return Sink(self._pulse, self._begin, self._phase_changed, eye and eye.end, eye and eye.sample)

    # ------------------------------------------------------------------ from the capture
    def _begin(self, t_ns: float) -> None:
        self.begin_ns = self._pulse_ns = t_ns

    def _phase_changed(self, t_ns: float, number: int) -> None:
        self._phases.append((t_ns, number))

    def _phase_now(self) -> int | None:
        while self._phases and self._phases[0][0] <= self._now:
            self._phase = self._phases.popleft()[1]
        return self._phase

    def _pulse(self, t_ns: float, polarity: int) -> None:
        if t_ns < self._sync_ns and t_ns - self._pulse_ns > RX_TIMEOUT_NS:
            self._sync_ns = t_ns
        self._now = self._pulse_ns = t_ns
        if len(self._phases) > 1:   # a silent line: only the last phase matters
            self._phase_now()
        self._monitor.pulse(t_ns, polarity)

    @property
    def due_ns(self) -> float | None:
        """Silence beyond this time finishes what is on the line; None between two telegrams."""
        return self._monitor.due_ns

    def settle(self, t_ns: float) -> None:
        """The line was silent until t_ns: finish what that finishes. For live captures; files need it at no time."""
        self._monitor.settle(t_ns)

    def end(self, t_ns: float) -> None:
        """The capture ends: what is not finished is named, not counted."""
        self._monitor.settle(t_ns)
        if self._monitor.open:
            record, lack = self._monitor.open
            name = self._name(record) if record.call is not None else "telegram"
            self.notes.append(f"end of the capture: {name} at {record.t_ns / 1e3:.3f} us: {lack}; not counted")

    def _name(self, telegram: Telegram) -> str:
        call = decode_call(telegram.call, self.extended)
        return f"{call.name} {address_name(call.index, self.extended(call.index & 31))}" if call.index is not None \
            else call.name

    # ------------------------------------------------------------------ one telegram
    def _finished(self, telegram: Telegram) -> None:
        if telegram.request_ok:
            self._sync_ns = min(self._sync_ns, telegram.t_ns)
        elif telegram.t_ns < self._sync_ns and telegram.t_ns - self.begin_ns < START_NS:
            what = ("rest of a telegram" if telegram.lone_answer is None else
                    f"an answer {telegram.lone_answer:04b} without its request")
            self.notes.append(f"start of the capture: {what} at {telegram.t_ns / 1e3:.3f} us; not counted")
            return
        self.extended.learn(telegram)
        record = self._record(telegram)
        self._count(telegram, record)
        if self._each:
            self._each(record, telegram)
        self._emit(record)

    def _record(self, telegram: Telegram) -> dict[str, Any]:
        if telegram.request_ok:
            data = telegram.data or 0
            delay = round(telegram.delay_ns) if telegram.delay_ns >= 0 else -1
            answered = telegram.data is not None
            record = to_record(Telegram(round(telegram.t_ns), telegram.call, delay, telegram.error_class, data,
                                        telegram.phase, telegram.repeated), self.extended)
            if not answered:
                record["answer"] = None
            return record
        phase = to_record(Telegram(0, 0, phase=telegram.phase, data=0))["phase"]
        return {"t_ns": round(telegram.t_ns), "call": "?", "address": None, "index": None, "data": None,
                "answer": None, "delay_ns": None, "class": telegram.error_class.name, "phase": phase,
                "repeated": False, "request_ok": False, "word": None}

    def _count(self, telegram: Telegram, record: dict[str, Any]) -> None:
        self.requests += 1
        self.first_ns = telegram.t_ns if self.first_ns is None else self.first_ns
        self.last_ns = telegram.t_ns
        if not telegram.request_ok:
            self.bad_requests += 1
            self.positive_starts += telegram.error_class == ErrorClass.START
            return
        ok = telegram.error_class == ErrorClass.OK
        self.repeated += telegram.repeated
        self.failed += not ok
        self.calls[record["call"]] += 1
        self.classes[record["class"]] += 1
        self.request_deviation_ns = wider(self.request_deviation_ns, telegram.request_dev_ns)
        self.cycles.add(telegram.t_ns, record["call"], telegram.call >> 5 & 31, telegram.repeated)
        if record["index"] is None:
            return
        slave = self.slaves.setdefault(record["index"], SlaveCounts())
        slave.requests += 1
        slave.repeated += telegram.repeated
        slave.classes[record["class"]] += 1
        if telegram.data is not None:
            slave.answers += 1
            slave.delay.add(telegram.delay_ns)
            slave.deviation_ns = wider(slave.deviation_ns, telegram.answer_dev_ns)

    # ------------------------------------------------------------------ statistics
    def statistics(self, path: Path, info: Info) -> dict[str, Any]:
        """Everything counted, as one plain dict (docs/decode.md)."""
        notes = [*info.notes, *self.notes]
        if self.positive_starts > self.requests / 2:
            notes.append("most telegrams begin with a positive pulse: are the two wires swapped? try --invert")
        span_ns = (self.last_ns - self.first_ns) if self.requests > 1 else 0
        return {
            "schema": SCHEMA, "file": str(path), "format": info.format, "kind": info.kind, "signals": info.signals,
            "begin_ns": _whole(self.begin_ns), "end_ns": _whole(info.end_ns),
            "telegrams": {
                "requests": self.requests, "repeated": self.repeated, "failed": self.failed,
                "bad_requests": self.bad_requests,
                "per_second": round((self.requests - 1) * 1e9 / span_ns, 1) if span_ns > 0 else None,
                "by_call": dict(sorted(self.calls.items())), "by_class": dict(sorted(self.classes.items())),
            },
            "cycles": self.cycles.span.as_dict(),
            "request_deviation_ns": _whole(self.request_deviation_ns),
            "slaves": [self._slave(index) for index in sorted(self.slaves, key=line_order)],
            "notes": notes,
        }

    def _slave(self, index: int) -> dict[str, Any]:
        slave = self.slaves[index]
        delay = slave.delay.as_dict()
        return {"address": address_name(index, self.extended(index & 31)), "index": index, "requests": slave.requests,
                "repeated": slave.repeated, "answers": slave.answers, "by_class": dict(sorted(slave.classes.items())),
                "delay_min_ns": delay["min_ns"], "delay_mean_ns": delay["mean_ns"], "delay_max_ns": delay["max_ns"],
                "deviation_ns": _whole(slave.deviation_ns)}


def _whole(value: float | None) -> int | None:
    return None if value is None else round(value)


def decode(path: Path, decoder: Decoder, options: Options = Options(), info: Info | None = None) -> Info:
    """Decode a whole capture; CaptureError (asi.capture) where it cannot be read further, with all before it done."""
    info = info or Info()
    try:
        read(path, options, decoder.sink(), info)
    finally:
        decoder.end(info.end_ns)
    return info


# ---------------------------------------------------------------- the terminal
def _us(time_ns: float | None) -> str:
    return "-" if time_ns is None else f"{time_ns / 1e3:.3f}"


def render(statistics: dict[str, Any]) -> "Group":
    """The statistics for a person; uses nothing but the dict."""
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text
    table = Table(box=None, header_style="bold", padding=(0, 1))
    for name in ("addr", "requests", "answers", "repeated", "delay us min", "mean", "max", "deviation us"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("errors")
    silent = [row for row in statistics["slaves"] if set(row["by_class"]) == {"NO_RESPONSE"}]
    for row in statistics["slaves"]:
        if row in silent:
            continue
        errors = ", ".join(f"{name} {count}" for name, count in row["by_class"].items() if name != "OK")
        table.add_row(row["address"], str(row["requests"]), str(row["answers"]), str(row["repeated"]),
                      _us(row["delay_min_ns"]), _us(row["delay_mean_ns"]), _us(row["delay_max_ns"]),
                      _us(row["deviation_ns"]), Text(errors, style="red"))
    if silent:
        table.add_row("other", str(sum(row["requests"] for row in silent)), "0",
                      str(sum(row["repeated"] for row in silent)), "-", "-", "-", "-",
                      f"{len(silent)} address{'es' * (len(silent) > 1)} without any answer")
    telegrams, cycles = statistics["telegrams"], statistics["cycles"]
    foot = Table.grid(padding=(0, 2))
    foot.add_column(style="dim")
    foot.add_column()
    rate = "" if telegrams["per_second"] is None else f"; {telegrams['per_second']:.1f} per second"
    rows = [
        ("capture", f"{statistics['format']}, {statistics['kind']}: {', '.join(statistics['signals'])}; "
                    f"{_us(statistics['begin_ns'])} to {_us(statistics['end_ns'])} us"),
        ("telegrams", f"{telegrams['requests']} requests, {telegrams['repeated']} repeated, {telegrams['failed']} "
                      f"without a valid answer, {telegrams['bad_requests']} bad requests{rate}"),
        ("calls", ", ".join(f"{name} {count}" for name, count in telegrams["by_call"].items()) or "none"),
        ("answers", ", ".join(f"{name} {count}" for name, count in telegrams["by_class"].items()) or "none"),
        ("cycle", "none seen" if not cycles["count"] else
         f"min {_us(cycles['min_ns'])} us, mean {_us(cycles['mean_ns'])} us, max {_us(cycles['max_ns'])} us; "
         f"{cycles['count']} cycles"),
        ("request pulses", "none good" if statistics["request_deviation_ns"] is None else
         f"at most {_us(statistics['request_deviation_ns'])} us off the grid"),
        *(("note", note) for note in statistics["notes"]),
    ]
    for name, value in rows:
        foot.add_row(name, Text(value))
    return Group(Text(""), *([table, Text("")] if statistics["slaves"] else []), foot)


def show(statistics: dict[str, Any], console: "Console") -> None:
    console.print(render(statistics))
