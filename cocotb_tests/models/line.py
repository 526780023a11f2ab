# SPDX-License-Identifier: Apache-2.0
"""The two-wire line as a queue of events: senders put pulses, listeners get every pulse that appears.

Times are in ns of bus time (int; multiples of 0.5 as float where a clock of the DUT demands it, still exact).
"""
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count

PULSE_NS = 1_500     # width of a pulse at the comparators of a receiver


@dataclass(frozen=True, slots=True)
class Pulse:
    """A pulse: start, polarity -1 or +1, who sent it (any object), width."""
    t_ns: float
    polarity: int
    sender: object = None
    width_ns: float = PULSE_NS


class Line:
    """Event queue and wire. At one instant pulses come first, then the timers: windows are inclusive at their end."""

    def __init__(self):
        self.now = 0
        self.on_earlier = None          # called with the time when a new event becomes the first one
        self._queue = []
        self._order = count()
        self._listeners = []
        self.busy_until = {-1: -1, 1: -1}     # by polarity: end of the pulse on the wire

    def listen(self, listener):
        """listener(pulse) for every pulse on the wire, in the order of their starts."""
        self._listeners.append(listener)

    def at(self, t_ns, action, *args):
        """Run action(*args) at t_ns, after all pulses of that instant. ValueError if that is in the past."""
        self._push(t_ns, 1, action, args)

    def pulse(self, t_ns, polarity, sender=None, width_ns=PULSE_NS):
        """Put one pulse on the wire. ValueError if t_ns is in the past or polarity is not -1 or +1."""
        if polarity not in (-1, 1):
            raise ValueError(f"polarity {polarity}")
        self._push(t_ns, 0, self._start, (Pulse(t_ns, polarity, sender, width_ns),))

    def send(self, start_ns, pulses, sender=None):
        """Put a telegram on the wire: pulses = [(ns after start_ns, polarity)]."""
        for offset, polarity in pulses:
            self.pulse(start_ns + offset, polarity, sender)

    @property
    def next_ns(self):
        """Time of the next event, None when there is none."""
        return self._queue[0][0] if self._queue else None

    def advance(self, t_ns):
        """Run everything up to and including t_ns."""
        while self._queue and self._queue[0][0] <= t_ns:
            self.now, _, _, action, args = heappop(self._queue)
            action(*args)
        self.now = max(self.now, t_ns)

    def _push(self, t_ns, rank, action, args):
        if t_ns < self.now:
            raise ValueError(f"event at {t_ns} ns, but it is {self.now} ns already")
        first = not self._queue or t_ns < self._queue[0][0]
        heappush(self._queue, (t_ns, rank, next(self._order), action, args))
        if first and self.on_earlier:
            self.on_earlier(t_ns)

    def _start(self, pulse):
        # two senders at once: equal polarities look like one pulse to a comparator, opposite ones are both seen
        merged = pulse.t_ns <= self.busy_until[pulse.polarity]
        self.busy_until[pulse.polarity] = max(self.busy_until[pulse.polarity], pulse.t_ns + pulse.width_ns)
        if not merged:
            for listener in self._listeners:
                listener(pulse)
