# SPDX-License-Identifier: Apache-2.0
"""One segment of the line as a linear network: cable tree, loads, data decoupling.

The network is a tree of cables between named nodes. A cable is cut into lumped pi sections; a node has capacitance and
conductance, a section resistance and inductance. States are node voltages and inductor currents, scaled by sqrt(C) and
sqrt(L) so that the matrix is well conditioned. The only non-zero time of a sender's current is its edge (EDGE_S), so
one *edge response* per sender and receiver, on a grid of STEP_S, holds all there is to know; everything on the line is
a sum of shifted edge responses. Discretisation: exact for the network, the current linear within a step (first-order
hold). Requirements: AN-001..AN-003 (docs/requirements.md).
"""
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

EDGE_S = 3e-6                   # T: duration of a sender's current edge
STEPS_PER_CLOCK = 8             # of the 16 MHz receiver clock
CLOCK_S = 62.5e-9
STEP_S = CLOCK_S / STEPS_PER_CLOCK   # 7.8125 ns
RESPONSE_CLOCKS = 2048          # an edge is followed for 128 us, longer than any telegram

DECOUPLING_H = 100e-6           # data decoupling: 50 uH in each leg ... (EK)
DECOUPLING_OHM = 78.0           # ... with 39 Ohm in parallel in each leg (EK)
SLAVE_OHM, SLAVE_H, SLAVE_F = 13.5e3, 13e-3, 30e-12  # load of an extended-address slave IC
SECTION_M = 5.0                 # longest lumped section: 30 ns, a hundredth of an edge
SEGMENT_M = 100.0               # longest segment, stubs included
FLOOR_F = 10e-12                # of every named node (EK: terminals)


@dataclass(frozen=True)
class Cable:
    """Constants per metre (EK ranges: R' < 90 mOhm, C' < 80 pF, L' 0.4..1.3 uH, G' <= 5 uS)."""
    r: float = 50e-3
    l: float = 0.6e-6           # noqa: E741 - the field's letter
    c: float = 60e-12
    g: float = 1e-6

    @property
    def impedance(self) -> float:
        """Ohm, at 167 kHz."""
        s = 2j * np.pi * 166_667
        return abs(np.sqrt((self.r + s * self.l) / (self.g + s * self.c)))


@dataclass(frozen=True)
class Load:
    """R, L, C in parallel between the wires; None: not there."""
    ohm: float | None = SLAVE_OHM
    henry: float | None = SLAVE_H
    farad: float = SLAVE_F


SLAVE = Load()


@dataclass(frozen=True)
class Segment:
    """A tree of cables with the power unit at one node. cables: (node, node, metres); loads: (node, Load)."""
    cables: tuple[tuple[str, str, float], ...]
    power: str
    loads: tuple[tuple[str, Load], ...] = ()
    cable: Cable = field(default_factory=Cable)
    decoupling_h: float = DECOUPLING_H
    decoupling_ohm: float = DECOUPLING_OHM
    section_m: float = SECTION_M
    longest_m: float = SEGMENT_M      # more only to see where it breaks

    @property
    def length(self) -> float:
        return sum(metres for _, _, metres in self.cables)

    @property
    def nodes(self) -> list[str]:
        return list(dict.fromkeys(node for a, b, _ in self.cables for node in (a, b)))

    def checked(self) -> "Segment":
        """Itself; ValueError when it is no tree, too long or uses unknown nodes."""
        nodes = self.nodes
        if len(nodes) != len(self.cables) + 1:
            raise ValueError("the cables are no tree")
        reached, grown = {nodes[0]}, True
        while grown:
            more = {n for a, b, _ in self.cables if (a in reached) != (b in reached) for n in (a, b)} - reached
            reached, grown = reached | more, bool(more)
        if len(reached) != len(nodes):
            raise ValueError("the cables are no tree")
        if self.length > self.longest_m + 1e-9 or any(metres <= 0 for _, _, metres in self.cables):
            raise ValueError(f"{self.length:.1f} m of cable: at most {self.longest_m:.0f} m, and no cable of 0 m")
        for node in (self.power, *(node for node, _ in self.loads)):
            if node not in nodes:
                raise ValueError(f"no cable ends at '{node}'")
        return self

    def distance(self, a: str, b: str) -> float:
        """Metres of cable from node a to node b."""
        far, todo = {a: 0.0}, [a]
        while todo:
            here = todo.pop()
            for p, q, metres in self.cables:
                for this, other in ((p, q), (q, p)):
                    if this == here and other not in far:
                        far[other] = far[here] + metres
                        todo.append(other)
        return far[b]


@dataclass(frozen=True)
class BandPass:
    """Front end filter of a receiver: one pole of high pass (DC removal), two equal poles of low pass. EK."""
    high_hz: float = 7e3
    low_hz: float = 1e6

    def gain(self, hz: np.ndarray | float) -> np.ndarray:
        """Complex gain at frequencies in Hz."""
        s = 1j * np.asarray(hz, float)
        return s / (s + self.high_hz) / (1 + s / self.low_hz) ** 2


def edge_current(t: np.ndarray | float) -> np.ndarray:
    """Current of a rising edge at t seconds after its start, for 1 A of swing: t/T - sin(2 pi t/T)/(2 pi)."""
    x = np.clip(np.asarray(t, float) / EDGE_S, 0.0, 1.0)
    return x - np.sin(2 * np.pi * x) / (2 * np.pi)


def expm(a: np.ndarray) -> np.ndarray:
    """exp(a): scaling by powers of two until the norm is below 1/4, Taylor to the 10th power, squaring back."""
    squarings = max(0, int(np.ceil(np.log2(max(np.linalg.norm(a, np.inf), 1e-300) * 4))))
    a = a / 2.0 ** squarings
    term, total = np.eye(len(a)), np.eye(len(a))
    for k in range(1, 11):
        term = term @ a / k
        total = total + term
    for _ in range(squarings):
        total = total @ total
    return total


class Line:
    """The matrices of a segment: x' = A x + B i, v = C x, for currents drawn at the senders (A) and node voltages (V).

    senders, receivers: node names, one column of B or row of C each.
    """

    def __init__(self, segment: Segment, senders: Sequence[str], receivers: Sequence[str]):
        segment.checked()
        index = {node: k for k, node in enumerate(segment.nodes)}
        farad, siemens = [FLOOR_F] * len(index), [0.0] * len(index)
        branches: list[tuple[int, int, float, float]] = []       # node, node, Ohm, H
        cable = segment.cable
        for a, b, metres in segment.cables:
            count = max(1, int(np.ceil(metres / segment.section_m - 1e-9)))
            part = metres / count
            here = index[a]
            for k in range(count):
                there = index[b] if k == count - 1 else len(farad)
                if there == len(farad):
                    farad.append(0.0)
                    siemens.append(0.0)
                for node in (here, there):
                    farad[node] += cable.c * part / 2
                    siemens[node] += cable.g * part / 2
                branches.append((here, there, cable.r * part, cable.l * part))
                here = there
        shunts: dict[int, float] = {index[segment.power]: 1 / segment.decoupling_h}   # node -> 1/H
        siemens[index[segment.power]] += 1 / segment.decoupling_ohm
        for name, load in segment.loads:
            node = index[name]
            farad[node] += load.farad
            siemens[node] += 1 / load.ohm if load.ohm else 0.0
            if load.henry:
                shunts[node] = shunts.get(node, 0.0) + 1 / load.henry
        n, nb = len(farad), len(branches)
        size = n + nb + len(shunts)
        k = np.zeros((size, size))                     # M x' = K x, M = diag(C, L)
        mass = np.ones(size)
        mass[:n] = farad
        k[range(n), range(n)] = -np.asarray(siemens)
        for j, (a, b, ohm, henry) in enumerate(branches, n):
            mass[j] = henry
            k[j, j] = -ohm
            k[j, a], k[a, j], k[j, b], k[b, j] = 1, -1, -1, 1
        for j, (node, per_henry) in enumerate(shunts.items(), n + nb):
            mass[j] = 1 / per_henry
            k[j, node], k[node, j] = 1, -1
        scale = 1 / np.sqrt(mass)
        self.a = k * scale[:, None] * scale[None, :]
        self.b = np.zeros((size, len(senders)))
        for j, name in enumerate(senders):
            self.b[index[name], j] = -scale[index[name]]        # a sender draws its current: a rise is a negative pulse
        self.c = np.zeros((len(receivers), size))
        for j, name in enumerate(receivers):
            self.c[j, index[name]] = scale[index[name]]
        self.physical = size      # the first states store energy: 1/2 |x|^2 is in J

    def through(self, bands: Sequence[BandPass]) -> "Line":
        """With a front end behind every receiver: the outputs are what their comparators see."""
        n, m = len(self.a), len(self.c)
        if len(bands) != m:
            raise ValueError(f"{len(bands)} band passes for {m} receivers")
        high = np.diag([2 * np.pi * band.high_hz for band in bands])
        low = np.diag([2 * np.pi * band.low_hz for band in bands])
        a = np.zeros((n + 3 * m, n + 3 * m))
        a[:n, :n] = self.a
        h, p, q = (slice(n + j * m, n + (j + 1) * m) for j in range(3))  # high pass, first and second low pass
        a[h, :n], a[h, h] = high @ self.c, -high
        a[p, :n], a[p, h], a[p, p] = low @ self.c, -low, -low
        a[q, p], a[q, q] = low, -low
        other = object.__new__(Line)
        other.a, other.physical = a, self.physical
        other.b = np.vstack([self.b, np.zeros((3 * m, self.b.shape[1]))])
        other.c = np.zeros((m, n + 3 * m))
        other.c[:, q] = np.eye(m)
        return other

    def discrete(self, step: float = STEP_S) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Ad, G1, G2 of x[k+1] = Ad x[k] + G1 u[k] + G2 (u[k+1] - u[k]), exact for u linear within a step (s)."""
        n, m = self.b.shape
        big = np.zeros((n + 2 * m, n + 2 * m))
        big[:n, :n] = self.a * step
        big[:n, n:n + m] = self.b * step
        big[n:n + m, n + m:] = np.eye(m)
        e = expm(big)
        return e[:n, :n], e[:n, n:n + m], e[:n, n + m:]

    def edge_responses(self, clocks: int = RESPONSE_CLOCKS) -> np.ndarray:
        """[receiver, sender, step] in V per A: voltage from the start of a rising edge on, clocks * STEPS_PER_CLOCK
        steps of STEP_S."""
        ad, g1, g2 = self.discrete()
        n, m = self.b.shape
        edge_steps = round(EDGE_S / STEP_S)
        current = edge_current(np.arange(edge_steps + 1) * STEP_S)
        steps = clocks * STEPS_PER_CLOCK
        head = np.empty((edge_steps, len(self.c), m))
        x = np.zeros((n, m))
        for k in range(edge_steps):
            head[k] = self.c @ x
            x = ad @ x + g1 * current[k] + g2 * (current[k + 1] - current[k])
        # from here on the current is 1: y[k] = [C 0] F^k [x 1], by 128 small steps (rows) and giant steps (columns)
        f = np.zeros((n + m, n + m))
        f[:n, :n], f[:n, n:], f[n:, n:] = ad, g1, np.eye(m)
        small = 128
        rows = np.zeros((small, len(self.c), n + m))
        rows[0, :, :n] = self.c
        for k in range(1, small):
            rows[k] = rows[k - 1] @ f
        giant = f
        for _ in range(7):
            giant = giant @ giant
        count = -(-(steps - edge_steps) // small)
        columns = np.empty((count, n + m, m))
        columns[0] = np.vstack([x, np.eye(m)])
        for k in range(1, count):
            columns[k] = giant @ columns[k - 1]
        tail = rows.reshape(-1, n + m) @ columns.transpose(1, 0, 2).reshape(n + m, -1)
        tail = tail.reshape(small, len(self.c), count, m).transpose(2, 0, 1, 3).reshape(-1, len(self.c), m)
        return np.concatenate([head, tail])[:steps].transpose(1, 2, 0).copy()


def superpose(response: np.ndarray, pulses: Sequence[tuple[float, int]], amps: float | Sequence[float], start_ns: float,
              clocks: int) -> np.ndarray:
    """Voltage at each receiver clock from start_ns on, for the edges of one sender.

    response: one row of edge_responses. pulses: (time in ns, polarity: -1 = rising current). amps: swing, one value or
    one per pulse. Edge times are rounded to STEP_S (at most 3.9 ns off).
    """
    out = np.zeros(clocks)
    swing = np.broadcast_to(np.asarray(amps, float), (len(pulses),))
    for (t_ns, polarity), amp in zip(pulses, swing):
        late = round((t_ns - start_ns) * 1e-9 / STEP_S)     # steps from the first clock to the edge
        first = max(0, -(-late // STEPS_PER_CLOCK))         # first clock that sees it
        piece = response[first * STEPS_PER_CLOCK - late::STEPS_PER_CLOCK][:max(0, clocks - first)]
        out[first:first + len(piece)] -= polarity * amp * piece
    return out


# ---------------------------------------------------------------- the networks of the cross-check and of the sweeps
def point_to_point(metres: float = 10.0, slaves: int = 1, **changes) -> Segment:
    """Power unit and master at 'master', all slaves at 'far'."""
    loads = (("master", SLAVE), *(("far", SLAVE) for _ in range(slaves)))
    return Segment((("master", "far", metres),), "master", loads, **changes)


def bus(metres: float = 100.0, slaves: int = 31, **changes) -> Segment:
    """A straight line with slaves evenly along it; 'far' is its end."""
    names = ["master", *(f"n{k}" for k in range(1, slaves)), "far"] if slaves else ["master", "far"]
    part = metres / max(1, slaves)
    cables = tuple((a, b, part) for a, b in zip(names, names[1:]))
    return Segment(cables, "master", tuple((name, SLAVE) for name in names), **changes)


def tree(**changes) -> Segment:
    """100 m with a trunk, long and short stubs; the power unit is not where the master is."""
    cables = (("master", "a", 12.0), ("a", "power", 8.0), ("a", "b", 20.0), ("b", "s1", 15.0), ("b", "c", 10.0),
              ("c", "s2", 3.0), ("c", "far", 30.0), ("a", "s3", 2.0))
    loads = tuple((node, SLAVE) for node in ("master", "s1", "s1", "s2", "s3", "far", "far", "b", "c"))
    return Segment(cables, "power", loads, **changes)
