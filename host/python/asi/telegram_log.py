# SPDX-License-Identifier: Apache-2.0
"""Telegram log (PL-003): one readable line and one JSON line per request on the line, written as they come.

Formats: docs/telegram_log.md. The same pass counts calls per address, so nothing is kept but counters.
A telegram is any object with the fields of asi_telegram (tb/asi_tb.h).
"""
import json
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from asi.plant import address_name
from asi.regmap import ErrorClass, Phase
from asi.telegram import decode_call

HEADER = (f"# {'bus time us':>13}  {'call':<4} {'addr':<4} {'data':<5}    {'answer':<6}  {'delay us':>8}  "
          f"{'class':<14} {'phase':<13} remark\n")
_DATA_CALLS = {"DEXG": 4, "WPAR": 4, "WID1": 4, "ADRA": 5}


@dataclass
class Span:
    """Least, mean, largest of a time."""
    count: int = 0
    least: float = 0
    largest: float = 0
    total: float = 0

    def add(self, value: float) -> None:
        self.least = min(self.least, value) if self.count else value
        self.largest = max(self.largest, value) if self.count else value
        self.count += 1
        self.total += value

    def as_dict(self) -> dict[str, Any]:
        return {"count": self.count, "min_ns": round(self.least) if self.count else None,
                "mean_ns": round(self.total / self.count) if self.count else None,
                "max_ns": round(self.largest) if self.count else None}


def wider(before: float | None, new: float | None) -> float | None:
    """The one of two distances that is farther from 0; None: not measured."""
    return new if before is None or (new is not None and abs(new) > abs(before)) else before


@dataclass
class Tally:
    """Requests of one address: on the line, of these immediate repetitions, of these without a valid answer.

    deviation_ns: of the pulses of good answers, the largest distance from the 3 us grid, with its sign.
    """
    requests: int = 0
    repeated: int = 0
    failed: int = 0
    answers: int = 0
    classes: Counter = field(default_factory=Counter)
    delay: Span = field(default_factory=Span)
    deviation_ns: float | None = None

    def add(self, other: "Tally") -> None:
        """Take in what another address did."""
        self.requests += other.requests
        self.repeated += other.repeated
        self.failed += other.failed
        self.answers += other.answers
        self.classes += other.classes
        if other.delay.count:
            mine = self.delay
            mine.least = min(mine.least, other.delay.least) if mine.count else other.delay.least
            mine.largest = max(mine.largest, other.delay.largest)
            mine.count += other.delay.count
            mine.total += other.delay.total
        self.deviation_ns = wider(self.deviation_ns, other.deviation_ns)


@dataclass
class Counts:
    """Everything counted from the telegrams; times in ns of bus time, None: not seen yet."""
    total: Tally = field(default_factory=Tally)
    by_index: dict[int, Tally] = field(default_factory=dict)
    by_call: Counter = field(default_factory=Counter)
    by_class: Counter = field(default_factory=Counter)
    broken_requests: int = 0
    first_ns: int | None = None
    first_cycle_ns: int | None = None


def to_record(telegram: Any, extended: Callable[[int], bool] = lambda number: False) -> dict[str, Any]:
    """Telegram -> the fields of one JSON line. extended(number): that number is used with A/B addressing."""
    call = decode_call(telegram.call, extended)
    number = telegram.call >> 5 & 31
    width = _DATA_CALLS.get(call.name)
    if width == 4 and number and extended(number):
        width = 3
    answered = telegram.error_class == ErrorClass.OK and telegram.delay_ns >= 0
    return {
        "t_ns": telegram.t_ns,
        "call": call.name,
        "address": None if call.index is None else address_name(call.index, extended(number)),
        "index": call.index,
        "data": None if call.data is None or width is None else f"{call.data:0{width}b}",
        "answer": f"{telegram.data:04b}" if answered else None,
        "delay_ns": telegram.delay_ns if telegram.delay_ns >= 0 else None,
        "class": _name(ErrorClass, telegram.error_class),
        "phase": None if telegram.phase is None else _name(Phase, telegram.phase),
        "repeated": bool(telegram.repeated),
        "request_ok": bool(telegram.request_ok),
        "word": telegram.call,
    }


def to_line(record: dict[str, Any]) -> str:
    """JSON record -> the readable line, without the end of line."""
    delay = "" if record["delay_ns"] is None else f"{record['delay_ns'] / 1000:.3f}"
    remark = " ".join(["repeated"] * record["repeated"] + ["bad request"] * (not record["request_ok"]))
    return (f"{record['t_ns'] / 1000:15.3f}  {record['call']:<4} {record['address'] or 'all':<4} "
            f"{record['data'] or '':<5} -> {record['answer'] or '-':<6}  {delay:>8}  {record['class']:<14} "
            f"{record['phase'] or '-':<13} {remark}").rstrip()


def _name(enum: type, value: int) -> str:
    try:
        return enum(value).name
    except ValueError:  # a number the map does not know is shown, not hidden
        return f"UNKNOWN_{value}"


class TelegramLog:
    """Counts telegrams and, with a folder, writes telegrams.log and telegrams.jsonl into it. A context manager.

    each(record, telegram): called for every telegram.
    """

    def __init__(self, folder: Path | None, extended: Callable[[int], bool],
                 each: Callable[[dict[str, Any], Any], None] | None = None):
        self.counts = Counts()
        self._each = each
        self._extended = extended
        self._text = self._json = None
        if folder is not None:
            self._text = open(folder / "telegrams.log", "w", encoding="utf-8")
            self._json = open(folder / "telegrams.jsonl", "w", encoding="utf-8")
            self._text.write(HEADER)

    def __enter__(self) -> "TelegramLog":
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def close(self) -> None:
        for file in (self._text, self._json):
            if file is not None:
                file.close()

    def add(self, telegrams: Iterable[Any]) -> int:
        """Count and write; -> how many."""
        number = 0
        for number, telegram in enumerate(telegrams, 1):
            record = to_record(telegram, self._extended)
            self._count(record, telegram)
            if self._each is not None:
                self._each(record, telegram)
            if self._text is not None:
                self._text.write(to_line(record) + "\n")
                self._json.write(json.dumps(record, separators=(",", ":")) + "\n")
        return number

    def _count(self, record: dict[str, Any], telegram: Any) -> None:
        counts, failed = self.counts, record["class"] != ErrorClass.OK.name
        tallies = [counts.total]
        if record["index"] is not None:
            tally = counts.by_index.setdefault(record["index"], Tally())
            tallies.append(tally)
            tally.classes[record["class"]] += 1
            if record["answer"] is not None:
                tally.answers += 1
                tally.delay.add(record["delay_ns"])
                tally.deviation_ns = wider(tally.deviation_ns, getattr(telegram, "answer_dev_ns", None))
        for tally in tallies:
            tally.requests += 1
            tally.repeated += record["repeated"]
            tally.failed += failed
        counts.by_call[record["call"]] += 1
        counts.by_class[record["class"]] += 1
        counts.broken_requests += not record["request_ok"]
        if counts.first_ns is None:
            counts.first_ns = record["t_ns"]
        if counts.first_cycle_ns is None and record["phase"] == Phase.DATA_EXCHANGE.name:
            counts.first_cycle_ns = record["t_ns"]
