# SPDX-License-Identifier: Apache-2.0
"""Replay of a capture: its pulses go to the pins of the Verilated chip, which records the telegrams as a passive
monitor (rtl/link/asi_monitor.sv); what it saw is compared with the decoder, which read the same capture (RP-001).

So a recording from a real line becomes a regression test of the receiver. Times in ns.
"""
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from asi.capture import CaptureError, Info, Options, Sink, read
from asi.monitor import BR01_CALL, PRGM_CALL, RX_TIMEOUT_NS, Monitor
from asi.native import Chip
from asi.regmap import ErrorClass
from asi.window import RING_TICK_NS, HostWindow, RingRecord

START_LIMIT_NS = 50_000_000     # firmware start and commit take some ms
STEP_NS = 10_000_000            # 130 telegrams at most: far less than the ring holds
SILENCE_NS = 1_000_000          # a longer silence of the capture is cut to this
AHEAD_NS = 1_000_000            # pulses are put on the line at least this long before they are due
LARGEST_NS = 2 ** 53            # a float is exact to the ns until here
SAME_NS = 1_500                 # two views of one telegram begin within this: window of the filter and of the stamp
REQUEST_NS, ANSWER_NS = 78_000, 36_000


class ReplayError(Exception):
    """The chip did not do its part."""


@dataclass
class Call:
    """One request with its answer, as one side saw it. error_class None: the request itself was bad."""
    t_ns: float
    word: int | None
    error_class: ErrorClass
    data: int | None
    request_ok: bool = True


@dataclass
class Difference:
    """decoder or chip None: only the other one saw it."""
    t_ns: float
    decoder: Call | None
    chip: Call | None


@dataclass
class Result:
    """What a replay brought. records: telegrams of the chip, times of the capture."""
    records: list[tuple[float, RingRecord]] = field(default_factory=list)
    calls: int = 0
    differences: list[Difference] = field(default_factory=list)
    lost: int = 0


def describe(call: Call | None) -> str:
    if call is None:
        return "nothing"
    if not call.request_ok:
        return f"bad telegram, {call.error_class.name}"
    answer = f" answer {call.data:04b}" if call.data is not None else ""
    return f"request {call.word:03X}, {call.error_class.name}{answer}"


def to_record(t_ns: float, record: RingRecord) -> dict[str, Any]:
    """One telegram as the chip recorded it, for JSON lines (docs/decode.md)."""
    return {"t_ns": round(t_ns), "request": record.request, "data": record.data, "class": record.error_class.name,
            "deviation_ns": record.deviation_ns, "lost": record.lost}


class _Feeder:
    """Pulses of the capture to the chip, silence cut; remembers how its time and the capture's belong together."""

    def __init__(self, chip: Chip, window: HostWindow, path: Path):
        self.chip, self.window, self._path = chip, window, path
        self.records: list[tuple[float, RingRecord]] = []
        self._from: list[float] = []    # chip time from which on ...
        self._offset: list[float] = []  # ... this is to be added to get the capture's time
        self._last = float("-inf")      # end of the last pulse, capture time
        self._wraps = self._stamp = 0
        self._done = chip.time_ns

    def pulse(self, t_ns: float, polarity: int, width_ns: float) -> None:
        width_ns = min(width_ns, SILENCE_NS)    # a line that is stuck says no more than silence does
        if not self._from:
            self._jump(t_ns)
        elif t_ns - self._last > SILENCE_NS:
            self._jump(t_ns)
        self._last = max(self._last, t_ns + width_ns)
        at = round(t_ns - self._offset[-1])
        if at - AHEAD_NS > self._done:
            self._run(at - AHEAD_NS)
        self.chip.net.inject(max(at, self.chip.time_ns), polarity, max(1, round(width_ns)))

    def _jump(self, t_ns: float) -> None:
        if abs(t_ns) > LARGEST_NS:
            raise CaptureError(f"{self._path}: at {t_ns:.16g} ns: beyond 104 days, where times are no longer exact")
        now = self.chip.time_ns if not self._from else round(self._last - self._offset[-1])
        start = now + SILENCE_NS + AHEAD_NS
        self._from.append(start - SILENCE_NS / 2)
        self._offset.append(t_ns - start)

    def _run(self, until: int) -> None:
        while self._done < until:
            self._done = min(self._done + STEP_NS, until)
            if self._done > self.chip.time_ns:
                self.chip.run(self._done)
            self._take()

    def _take(self) -> None:
        for record in self.window.monitored():
            if record.t_ns < self._stamp:
                self._wraps += RING_TICK_NS << 32
            self._stamp = record.t_ns
            at = record.t_ns + self._wraps
            part = max(0, bisect_right(self._from, at) - 1)
            self.records.append((at + self._offset[part], record))

    def finish(self) -> None:
        """Let the last telegram end."""
        if self._from:
            self._run(round(self._last - self._offset[-1]) + AHEAD_NS)


def monitor_chip(chip: Chip) -> HostWindow:
    """Start the firmware and make the chip a passive monitor. ReplayError when it does not answer."""
    window = HostWindow(chip)

    def wait(condition: Any) -> None:
        while not condition():
            if chip.time_ns > START_LIMIT_NS:
                raise ReplayError(f"the firmware did not start within {START_LIMIT_NS // 1_000_000} ms")
            chip.run(chip.time_ns + 100_000)
    wait(window.ready)
    sequence = window.set_control(monitor=True)
    wait(lambda: window.result(sequence) is not None)
    if window.result(sequence) != 0:
        raise ReplayError(f"the firmware refused monitor mode: {window.result(sequence)}")
    return window


def calls_of_chip(records: list[tuple[float, RingRecord]]) -> Iterator[Call]:
    """Requests and answers of the ring as calls, paired as the master would: an answer belongs to the good request
    before it when it begins until P_RX_TIMEOUT after that request's last pulse."""
    open_call: Call | None = None
    for t_ns, record in records:
        if open_call:
            end = open_call.t_ns + REQUEST_NS + RX_TIMEOUT_NS + SAME_NS
            if not record.request and t_ns <= end:
                open_call.error_class = record.error_class
                open_call.data = record.data & 15 if record.error_class == ErrorClass.OK else None
                yield open_call
                open_call = None
                continue
            yield open_call
            open_call = None
        if record.request and record.error_class == ErrorClass.OK:
            silent = record.data in (BR01_CALL, PRGM_CALL)
            open_call = Call(t_ns, record.data, ErrorClass.OK if silent else ErrorClass.NO_RESPONSE, None)
        else:
            yield Call(t_ns, None, record.error_class, None, request_ok=False)
    if open_call:
        yield open_call


def _agree(decoder: Call, chip: Call) -> bool:
    """The same call: request and answer, or both say that this was no good request (which check failed first depends
    on whether one expects a request or an answer)."""
    if not decoder.request_ok or not chip.request_ok:
        return decoder.request_ok == chip.request_ok
    return (decoder.word, decoder.error_class, decoder.data) == (chip.word, chip.error_class, chip.data)


def compare(decoder: list[Call], chip: list[Call]) -> list[Difference]:
    """Both sides in order of time; telegrams that begin within SAME_NS are the same."""
    out, i, j = [], 0, 0
    while i < len(decoder) or j < len(chip):
        if j == len(chip) or (i < len(decoder) and decoder[i].t_ns < chip[j].t_ns - SAME_NS):
            out.append(Difference(decoder[i].t_ns, decoder[i], None))
            i += 1
        elif i == len(decoder) or chip[j].t_ns < decoder[i].t_ns - SAME_NS:
            out.append(Difference(chip[j].t_ns, None, chip[j]))
            j += 1
        else:
            if not _agree(decoder[i], chip[j]):
                out.append(Difference(decoder[i].t_ns, decoder[i], chip[j]))
            i, j = i + 1, j + 1
    return out


def replay(path: Path, firmware: Path, options: Options = Options(), waves: Path | None = None,
           info: Info | None = None) -> Result:
    """Feed the capture to the chip and compare. CaptureError, ReplayError, NativeError as they come."""
    calls: list[Call] = []
    monitor = Monitor(sink=lambda t: calls.append(Call(t.t_ns, t.call if t.request_ok else None, t.error_class, t.data,
                                                       t.request_ok)))
    result, info = Result(), info or Info()
    with Chip(firmware, waves=waves) as chip:
        window = monitor_chip(chip)
        feeder = _Feeder(chip, window, path)
        read(path, options, Sink(monitor.pulse, raw=feeder.pulse), info)
        feeder.finish()
        result.lost = window.monitor_lost()
        result.records = feeder.records
    monitor.settle(info.end_ns)
    chip_calls = list(calls_of_chip(result.records))
    # a telegram that the capture's end cuts off is one for the chip (the silence after it comes), none for the decoder
    last = info.end_ns - REQUEST_NS - RX_TIMEOUT_NS - ANSWER_NS
    if monitor.open:    # may be longer: a line that babbles to the end
        last = min(last, monitor.open[0].t_ns - SAME_NS)
    result.calls = len(calls)
    result.differences = [d for d in compare(calls, chip_calls) if d.decoder is not None or d.t_ns < last]
    return result
