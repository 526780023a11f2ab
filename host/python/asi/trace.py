# SPDX-License-Identifier: Apache-2.0
"""What the HTML report keeps of the telegrams of a run or a capture. Times in ns.

Bounded: when there are more than LIMIT telegrams, plain ones (good DEXG calls, and unanswered probes) stay only in
every 2nd, 4th, 8th ... slice of SLICE_NS, so that what stays are whole cycles. Errors, repetitions, all other calls,
and CONTEXT telegrams on both sides of each of these always stay; CONTEXT is given up when even that is more than LIMIT.
"""
import base64
import struct
from collections import Counter, deque
from typing import Any

from asi.decode import Cycles
from asi.regmap import ErrorClass, Phase
from asi.telegram_log import Span

LIMIT = 60_000              # telegrams in a page: 1.8 MB
SLICE_NS = 20_000_000
CONTEXT = 8
ROW = struct.Struct("<dihhHBBBB")   # t_ns, delay_ns, request and answer deviation, call, class, answer, phase, flags
NO_DEVIATION, NO_DELAY, NONE = -32768, -1, 255
REPEATED, REQUEST_OK, KEPT, PROBE = 1, 2, 4, 8      # flags
SILENCE_NS = 10_000_000     # a longer one ends a phase on the time line
LOST_AFTER = 6              # failed DEXG in a row: the master does not call the slave any more (LK-004)
MOST_EVENTS = 2_000         # events of one kind that are listed; the others are counted

_CYCLIC = ("DATA_EXCHANGE", "MANAGEMENT", "INCLUSION")
_LOOKING = ("DETECTION", "INCLUSION")
CYCLIC = "CYCLES"           # the three phases of a running cycle, as one phase of the time line


def is_probe(record: dict[str, Any]) -> bool:
    """Nobody answered a call that only asks whether somebody is there: no error."""
    if record["class"] != "NO_RESPONSE":
        return False
    return record["phase"] in _LOOKING if record["phase"] else record["call"] == "RDIO"


class CycleTimes(Span):
    """Cycle times, and how many there were per whole microsecond."""

    def __init__(self) -> None:
        super().__init__()
        self.per_us: Counter = Counter()

    def add(self, value: float) -> None:
        super().add(value)
        self.per_us[round(value / 1000)] += 1


class Trace:
    """Telegrams (add), what happened beside them (event), and what follows from both."""

    def __init__(self, limit: int = LIMIT):
        self.total = 0
        self.every = 1              # plain telegrams stay in slices whose number is a multiple of this
        self.context = CONTEXT
        self.last: dict[int, tuple[str | None, str]] = {}   # index -> last data and answer of an answered DEXG
        self.phases: list[list[Any]] = []                   # [begin, end, name]
        self.events: list[tuple[float, str, str]] = []      # time, kind, text
        self.left_out: Counter = Counter()                  # events of a kind that are not listed
        self.cycle_times = CycleTimes()
        self._cycles = Cycles()
        self._cycles.span = self.cycle_times
        self._limit = limit
        self._rows: list[bytes] = []
        self._before: deque[bytes] = deque(maxlen=CONTEXT)  # left out, but perhaps next to something that stays
        self._after = 0
        self._calls: dict[tuple, int] = {}
        self._listed: Counter = Counter()
        self._streak: dict[int, int] = {}                   # failed DEXG in a row; LOST_AFTER: lost

    @property
    def shown(self) -> int:
        return len(self._rows)

    def add(self, record: dict[str, Any], telegram: Any) -> None:
        """The next telegram: its log record, and what the monitor gave (for the deviations of its pulses)."""
        self.total += 1
        name, t_ns = record["call"], record["t_ns"]
        probe = is_probe(record)
        plain = record["request_ok"] and not record["repeated"] and (
            probe or (name == "DEXG" and record["class"] == "OK"))
        request_dev, answer_dev = (getattr(telegram, key, None) for key in ("request_dev_ns", "answer_dev_ns"))
        word = record["word"]
        key = (name, record["address"], record["index"], record["data"], word if record["request_ok"] else None)
        row = ROW.pack(
            t_ns, NO_DELAY if record["delay_ns"] is None else record["delay_ns"],
            NO_DEVIATION if request_dev is None else round(request_dev),
            NO_DEVIATION if answer_dev is None else round(answer_dev),
            self._calls.setdefault(key, len(self._calls)), _CLASS.get(record["class"], NONE),
            NONE if record["answer"] is None else int(record["answer"], 2), _PHASE.get(record["phase"], NONE),
            REPEATED * record["repeated"] | REQUEST_OK * record["request_ok"] | KEPT * (not plain) | PROBE * probe)
        if not plain:
            self._rows += self._before
            self._before.clear()
            self._rows.append(row)
            self._after = self.context
        elif self._after or self.every == 1 or int(t_ns // SLICE_NS) % self.every == 0:
            self._rows.append(row)
            self._before.clear()
            self._after = max(0, self._after - 1)
        elif self.context:
            self._before.append(row)
        if len(self._rows) > self._limit:
            self._thin()
        self._follow(record, name, t_ns)

    def event(self, t_ns: float, kind: str, text: str) -> None:
        self._listed[kind] += 1
        if self._listed[kind] <= MOST_EVENTS:
            self.events.append((t_ns, kind, text))
        else:
            self.left_out[kind] += 1

    def _follow(self, record: dict[str, Any], name: str, t_ns: float) -> None:
        """Phases, cycles and slaves that come and go."""
        phase = CYCLIC if record["phase"] in _CYCLIC else record["phase"]
        last = self.phases[-1] if self.phases else None
        if last is None or last[2] != phase or t_ns - last[1] > SILENCE_NS:
            self.phases.append([t_ns, t_ns, phase])
            if phase is not None:
                self.event(t_ns, "phase", phase)
        else:
            last[1] = t_ns
        if not record["request_ok"]:
            return
        self._cycles.add(t_ns, name, record["word"] >> 5 & 31, record["repeated"])
        if name != "DEXG":
            return
        index = record["index"]
        if record["answer"] is not None:
            self.last[index] = record["data"], record["answer"]
            if self._streak.get(index, LOST_AFTER) >= LOST_AFTER:
                self.event(t_ns, "slave", f"{record['address']} exchanges data")
            self._streak[index] = 0
        elif index in self._streak:
            self._streak[index] += 1
            if self._streak[index] == LOST_AFTER:
                self.event(t_ns, "slave", f"{record['address']} does not answer: {LOST_AFTER} failed requests in a row")

    def _thin(self) -> None:
        while True:
            self.every *= 2
            near = 0
            stay = bytearray(len(self._rows))
            for order in (range(len(self._rows)), range(len(self._rows) - 1, -1, -1)):
                near = 0
                for k in order:
                    near = self.context + 1 if self._rows[k][-1] & KEPT else max(0, near - 1)
                    if near or int(ROW.unpack_from(self._rows[k])[0] // SLICE_NS) % self.every == 0:
                        stay[k] = 1
            self._rows = [row for row, stays in zip(self._rows, stay) if stays]
            if len(self._rows) <= self._limit * 3 // 4:
                return
            if self.every >= 1024:
                if not self.context:  # nothing but errors: they stay, however many
                    self._limit = 2 * len(self._rows)
                    return
                self.context = 0
                self._before.clear()

    # ------------------------------------------------------------------ for the page
    def note(self) -> str | None:
        """What was left out, in words; None: nothing."""
        parts = []
        if self.shown < self.total:
            near = f" and {self.context} telegrams on both sides of each" if self.context else ""
            parts.append(f"Long recording: {self.shown} of {self.total} telegrams are in this page. Good DEXG calls "
                         f"and "
                         f"unanswered probes were kept in every {_nth(self.every)} slice of {SLICE_NS // 10**6} ms; "
                         f"all "
                         f"errors, repetitions and other calls{near} are there. Tables and histograms count "
                         f"everything.")
        for kind, count in self.left_out.items():
            parts.append(f"{count} more events of the kind \"{kind}\" are not listed.")
        return " ".join(parts) or None

    def data(self) -> dict[str, Any]:
        """All the time line needs, ready for JSON."""
        return {
            "row_bytes": ROW.size, "rows": base64.b64encode(b"".join(self._rows)).decode("ascii"),
            "calls": [list(key) for key in self._calls], "total": self.total, "shown": self.shown,
            "classes": {int(c): c.name for c in ErrorClass}, "phase_names": {int(p): p.name for p in Phase},
            "phases": self.phases, "events": self.sorted_events(), "every": self.every, "slice_ns": SLICE_NS,
        }

    def sorted_events(self) -> list[tuple[float, str, str]]:
        return sorted(self.events, key=lambda event: event[0])


def _nth(number: int) -> str:
    return f"{number}{'nd' if number == 2 else 'th'}"


_CLASS = {c.name: int(c) for c in ErrorClass}
_PHASE = {p.name: int(p) for p in Phase}
