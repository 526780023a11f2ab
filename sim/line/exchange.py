# SPDX-License-Identifier: Apache-2.0
"""Request and answer through the line: senders, segments, repeaters, front ends and the real receiver RTL.

The request goes from the master through every segment to the slave's receiver (14 bits), the answer back to the
master's (7 bits). The slave's receiver is the chip's own asi_rx with 14 bits: the rules are the same, no other one is
at hand. What asi_xact adds is modelled: listening starts P_TX_MASK after the last request pulse, a pulse before
P_RX_OPEN is EARLY, none until P_RX_TIMEOUT is NO_RESPONSE. The answer is sent whether or not the request was
understood, so that the two directions count apart. Requirements: AN-005..AN-007, AN-010 (docs/requirements.md).
"""
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from asi.regmap import ErrorClass
from asi.telegram import HALF_BIT_NS, pulses, request_word, response_word

from .front_end import CLOCK_NS, Comparators, Disturbance
from .network import BandPass, Line, Segment, point_to_point, superpose
from .rtl import receive

LEAD_NS = 12_000.0           # pause in front of a request
SYNC_NS = 21_500.0           # last request pulse to first answer pulse, synchronous slave
MASK_NS, OPEN_NS, TIMEOUT_NS = 4_500.0, 12_000.0, 66_000.0   # P_TX_MASK, P_RX_OPEN, P_RX_TIMEOUT
REQUEST_CLOCKS = 1856        # 116 us: pause, request, decision, and 12 us for a receiver that began too late
ANSWER_LEAD_NS = 24_000.0    # the last request pulse is in the window
ANSWER_CLOCKS = 1408         # 88 us
AMPS = 0.06

Train = list[tuple[float, int]]
Edit = Callable[[Train], Sequence[tuple[float, int, float]]]   # pulses -> pulses with a gain each: faults


@dataclass(frozen=True)
class Sender:
    amps: float = AMPS            # swing of an edge (55..68 mA, EK)
    ppm: float = 0.0              # clock error
    jitter_ns: float = 0.0        # each edge, evenly within +- this
    later_gain: float = 1.0       # swing of all pulses after the first, relative to it

    def train(self, word: int, bits: int, start_ns: float, rng: np.random.Generator) -> Train:
        slow = 1 - self.ppm * 1e-6            # a fast clock makes short telegrams
        return [(start_ns + t * slow + self.jitter_ns * (2 * rng.random() - 1), p) for t, p in pulses(word, bits)]


@dataclass(frozen=True)
class Receiver:
    band: BandPass = field(default_factory=BandPass)
    comparators: Comparators = field(default_factory=Comparators)


@dataclass(frozen=True)
class Repeater:
    """Sends what its receiver accepts into the next segment. EK: no data sheet tells delay or re-timing in full."""
    delay_ns: float = 3_500.0     # pulse in to pulse out
    retimed: bool = True          # pulses leave on the 3 us grid of the first one; False: just as late as they came
    sender: Sender = field(default_factory=Sender)
    receiver: Receiver = field(default_factory=Receiver)

    def resend(self, seen: Train) -> Train:
        if not seen:
            return []
        first = seen[0][0]
        if self.retimed:
            seen = [(first + HALF_BIT_NS * round((t - first) / HALF_BIT_NS), p) for t, p in seen]
        return [(t + self.delay_ns, p) for t, p in seen]


@dataclass(frozen=True)
class Hop:
    """One segment on the way: the sender nearer to the master sits at `near`, the other one at `far`."""
    segment: Segment
    near: str = "master"
    far: str = "far"


@dataclass(frozen=True)
class Setup:
    """An installation and what disturbs it. One repeater between each two hops."""
    hops: tuple[Hop, ...] = (Hop(point_to_point()),)
    master: Sender = field(default_factory=Sender)
    slave: Sender = field(default_factory=Sender)
    master_rx: Receiver = field(default_factory=Receiver)
    slave_rx: Receiver = field(default_factory=Receiver)
    repeaters: tuple[Repeater, ...] = ()
    disturbance: Disturbance = field(default_factory=Disturbance)
    ghost: float = 0.0            # one foreign pulse inside the telegram, relative to its amplitude
    edit: Edit | None = None      # faults of the observed telegram (tests)


class Outcome(NamedTuple):
    """What became of one telegram at its final receiver."""
    error_class: ErrorClass
    sent: int
    data: int | None              # of an accepted telegram
    early_ns: float | None        # earliest and latest pulse against the grid of the first one; None: pulses miss
    late_ns: float | None
    volts: np.ndarray             # at the comparators, one value per receiver clock
    levels: np.ndarray

    @property
    def right(self) -> bool:
        return self.error_class == ErrorClass.OK and self.data == self.sent

    @property
    def wrong(self) -> bool:
        """Accepted, but not what was sent: an undetected error."""
        return self.error_class == ErrorClass.OK and self.data != self.sent


@lru_cache(maxsize=16)
def responses(hop: Hop, near: BandPass, far: BandPass) -> np.ndarray:
    """[receiver near/far, sender near/far, step] in V per A behind the band passes."""
    line = Line(hop.segment, (hop.near, hop.far), (hop.near, hop.far))
    return line.through((near, far)).edge_responses()


class _Way:
    """One exchange in progress: keeps what each segment has carried so far."""

    def __init__(self, setup: Setup, rng: np.random.Generator):
        if len(setup.repeaters) != len(setup.hops) - 1:
            raise ValueError("one repeater between each two segments, please")
        self.setup, self.rng = setup, rng
        self.requests: list[tuple[Train, np.ndarray]] = []       # per segment: pulses and their swings, from `near`
        self.ends: list[float] = []                              # per segment: last request pulse

    def _ends(self, k: int) -> tuple[Receiver, Receiver, Sender, Sender]:
        s = self.setup
        receivers = [s.master_rx, *(r.receiver for r in s.repeaters), s.slave_rx]
        senders = [s.master, *(r.sender for r in s.repeaters), s.slave]
        near_rx, far_rx, near_tx, far_tx = receivers[k], receivers[k + 1], senders[k], senders[k + 1]
        return near_rx, far_rx, near_tx, far_tx

    def _swings(self, train: Train, sender: Sender, observed: bool) -> tuple[Train, np.ndarray]:
        swings = np.full(len(train), sender.amps)
        swings[1:] *= sender.later_gain
        if observed and self.setup.edit:
            edited = self.setup.edit(train)
            train, swings = [(t, p) for t, p, _ in edited], sender.amps * np.array([gain for _, _, gain in edited])
        if observed and self.setup.ghost and train:
            at = self.rng.uniform(train[0][0] + HALF_BIT_NS, train[-1][0] + HALF_BIT_NS)
            train = [*train, (at, int(self.rng.choice((-1, 1))))]
            swings = np.append(swings, self.setup.ghost * sender.amps)
        return train, swings

    def _levels(self, volts: np.ndarray, rx: Receiver) -> tuple[np.ndarray, np.ndarray]:
        volts = volts + self.setup.disturbance.volts(len(volts), rx.band, self.rng)
        return volts, rx.comparators.levels(volts)

    def request(self, call: int) -> Outcome:
        s = self.setup
        word = request_word(call)
        # where the sender's edges fall within the receiver's clock is chance
        train = s.master.train(word, 14, LEAD_NS + CLOCK_NS * self.rng.random(), self.rng)
        for k, hop in enumerate(s.hops):
            near_rx, far_rx, near_tx, _ = self._ends(k)
            last = k == len(s.hops) - 1
            sent, swings = self._swings(train, near_tx, k == 0)
            self.requests.append((sent, swings))
            self.ends.append(train[-1][0] if train else LEAD_NS + 78_000.0)
            start = (train[0][0] if train else LEAD_NS) - LEAD_NS
            volts = superpose(responses(hop, near_rx.band, far_rx.band)[1, 0], sent, swings, start, REQUEST_CLOCKS)
            volts, levels = self._levels(volts, far_rx)
            got = receive(levels, 0, 14)
            if not last:
                train = s.repeaters[k].resend([(start + CLOCK_NS * c, p) for c, p in got.pulses])
        error = ErrorClass.NO_RESPONSE if got.error_class is None else ErrorClass(got.error_class)
        return Outcome(error, call, got.data, *_deviation(got.pulses, word, 14), volts, levels)

    def answer(self, data: int) -> Outcome:
        s = self.setup
        word = response_word(data)
        ends = self.ends
        train = s.slave.train(word, 7, ends[-1] + SYNC_NS + CLOCK_NS * self.rng.random(), self.rng)
        for k in reversed(range(len(s.hops))):
            near_rx, far_rx, _, far_tx = self._ends(k)
            sent, swings = self._swings(train, far_tx, k == len(s.hops) - 1)
            own, own_swings = self.requests[k]
            start = (train[0][0] if train else ends[k] + SYNC_NS) - ANSWER_LEAD_NS
            r = responses(s.hops[k], near_rx.band, far_rx.band)
            volts = superpose(r[0, 1], sent, swings, start, ANSWER_CLOCKS) + \
                superpose(r[0, 0], own, own_swings, start, ANSWER_CLOCKS)
            volts, levels = self._levels(volts, near_rx)
            listen = max(0, round((ends[k] + MASK_NS - start) / CLOCK_NS))
            got = receive(levels, listen, 7)
            heard = [(c, p) for c, p in got.pulses if c >= listen]
            if k:
                train = s.repeaters[k - 1].resend([(start + CLOCK_NS * c, p) for c, p in heard])
        if got.error_class is None or start + CLOCK_NS * got.first > ends[0] + TIMEOUT_NS:
            error = ErrorClass.NO_RESPONSE
        elif start + CLOCK_NS * got.first < ends[0] + OPEN_NS:
            error = ErrorClass.EARLY
        else:
            error = ErrorClass(got.error_class)
        taken = got.data if error == ErrorClass.OK else None
        return Outcome(error, data, taken, *_deviation(heard, word, 7), volts, levels)


def _deviation(seen: Train, word: int, bits: int) -> tuple[float | None, float | None]:
    nominal = pulses(word, bits)
    if [p for _, p in seen] != [p for _, p in nominal]:
        return None, None
    off = [(c - seen[0][0]) * CLOCK_NS - t for (c, _), (t, _) in zip(seen, nominal)]
    return min(off), max(off)


def exchange(setup: Setup, call: int, data: int, rng: np.random.Generator) -> tuple[Outcome, Outcome]:
    """One request (11-bit call) and its answer (nibble): what the slave's and the master's receiver made of them."""
    way = _Way(setup, rng)
    return way.request(call), way.answer(data)


def receiver_amplitude(hop: Hop, rx: Receiver = Receiver()) -> tuple[float, float]:
    """V peak-peak on the line per A of swing, for a lone edge (twice its peak): request at `far`, answer at `near`."""
    line = Line(hop.segment, (hop.near, hop.far), (hop.near, hop.far)).edge_responses(512)
    return float(-2 * line[1, 0].min()), float(-2 * line[0, 1].min())
