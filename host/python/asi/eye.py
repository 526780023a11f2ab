# SPDX-License-Identifier: Apache-2.0
"""Eye diagrams: pulses and volts folded onto one bit time, grid point of the first pulse at 0. Times in ns.

Counts have the shape of asi_pulse_counts in tb/asi_tb.h: [sender 0 master, 1 slaves][0 negative, 1 positive][bin].
"""
from collections import Counter, deque
from collections.abc import Iterable
from typing import Any

from asi.checks import ANSWER_BITS, REQUEST_BITS, end_ns
from asi.telegram import BIT_NS

BINS = 240
BIN_NS = BIT_NS // BINS
FROM_NS = -1_000            # bin 0 begins here
VOLT = 0.1                  # height of a cell of the voltage eye
_KEEP_NS = 400_000          # how far back a telegram may begin when it is finished: request, time-out, answer
_WIDEST_NS = 3_000          # a pulse that lasts longer has no end


def fold(dt_ns: float) -> int:
    """ns from the first pulse -> bin."""
    return int((dt_ns - FROM_NS) % BIT_NS // BIN_NS)


def empty() -> dict[str, list]:
    return {name: [[[0] * BINS for _ in range(2)] for _ in range(2)] for name in ("starts", "ends")}


class Eye:
    """Collects while a capture is decoded: end() and sample() as they come, telegram() when one is finished."""

    def __init__(self) -> None:
        self.counts = empty()
        self.volts: list[Counter] = [Counter(), Counter()]  # per sender: (bin, volts / VOLT) -> samples
        self.has_ends = False
        self._ends: deque[tuple[float, int]] = deque()
        self._samples: deque[tuple[float, float]] = deque()

    def end(self, t_ns: float, polarity: int) -> None:
        """A pulse ended."""
        self.has_ends = True
        self._ends.append((t_ns, polarity))
        _forget(self._ends, t_ns)

    def sample(self, t_ns: float, volts: float) -> None:
        """A sample without its DC part."""
        self._samples.append((t_ns, volts))
        _forget(self._samples, t_ns)

    def telegram(self, sender: int, t0_ns: float, pulses: Iterable[tuple[float, int]]) -> None:
        """A request (0) or an answer (1): [(ns from its first pulse, polarity)]. The first pulse defines the grid."""
        starts, ends = self.counts["starts"][sender], self.counts["ends"][sender]
        late = [(t - t0_ns, polarity) for t, polarity in self._ends if t > t0_ns]
        for dt, polarity in list(pulses)[1:]:
            starts[polarity > 0][fold(dt)] += 1
            end = next((t for t, sign in late if sign == polarity and dt < t <= dt + _WIDEST_NS), None)
            if end is not None:
                ends[polarity > 0][fold(end)] += 1
        last = end_ns(ANSWER_BITS if sender else REQUEST_BITS) + _WIDEST_NS
        cells = self.volts[sender]
        for t_ns, volts in self._samples:
            if FROM_NS <= t_ns - t0_ns <= last:
                cells[fold(t_ns - t0_ns), round(volts / VOLT)] += 1

    def pulse_counts(self) -> dict[str, Any]:
        return self.counts


def _forget(queue: deque, t_ns: float) -> None:
    while queue[0][0] < t_ns - _KEEP_NS:
        queue.popleft()
