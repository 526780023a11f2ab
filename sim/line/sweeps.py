# SPDX-License-Identifier: Apache-2.0
"""One parameter at a time, away from the nominal line until telegrams fail.

The nominal line: 100 m of straight cable with 31 slaves, master and power unit at one end, the observed slave at the
other, 60 mA, no disturbance, threshold 50 %. Both directions are counted apart: `request` at the far slave's receiver
(14 bits), `answer` at the master's (7 bits). Requirements: AN-009 (docs/requirements.md).
"""
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .exchange import Hop, Receiver, Repeater, Sender, Setup, exchange, receiver_amplitude
from .front_end import Comparators, Disturbance
from .network import SLAVE, Cable, Load, bus

NOMINAL = Setup((Hop(bus()),))
LEAST_VPP = 3.0                 # smallest legal signal at a receiver


@dataclass(frozen=True)
class Sweep:
    name: str
    title: str
    unit: str
    values: tuple[float, ...]              # from good to bad
    setup: Callable[[float], Setup]
    request_limit: float | None = None     # what must still work; None: no published limit
    answer_limit: float | None = None
    source: str = ""                       # of the limit


def at_vpp(setup: Setup, vpp: float) -> Setup:
    """With a lone pulse of half of vpp at the receiver in both directions (one segment)."""
    request, answer = receiver_amplitude(setup.hops[0])
    return replace(setup, master=replace(setup.master, amps=vpp / request),
                   slave=replace(setup.slave, amps=vpp / answer))


def _disturbed(vpp: float, **what: float) -> Setup:
    return replace(at_vpp(NOMINAL, vpp), disturbance=Disturbance(**what))


def _senders(**what: float) -> Setup:
    return replace(NOMINAL, master=Sender(**what), slave=Sender(**what))


def _threshold(ratio: float) -> Setup:
    rx = Receiver(comparators=Comparators(ratio=ratio))
    return replace(NOMINAL, master_rx=rx, slave_rx=rx)


def _line(**what: Any) -> Setup:
    return Setup((Hop(bus(**what)),))


def _repeaters(count: float, retimed: bool) -> Setup:
    return Setup((Hop(bus()),) * (int(count) + 1), repeaters=(Repeater(retimed=retimed),) * int(count))


def _extra_capacitance(nf: float) -> Setup:
    segment = bus()
    loads = (*segment.loads, ("far", Load(None, None, nf * 1e-9)))
    return Setup((Hop(replace(segment, loads=loads)),))


def _range(first: float, last: float, step: float) -> tuple[float, ...]:
    return tuple(round(float(v), 6) for v in np.arange(first, last + step / 2, step))


PPM = (0, 1000, 2000, 4000, 6000, 8000, 10000, 12000, 14000, 16000, 18000, 20000, 25000, 30000, 35000, 40000, 45000)
SWEEPS = (
    Sweep("amplitude", "amplitude at the receiver", "Vpp",
          (8, 6, 5, 4, 3, 2.5, 2.2, 2, 1.9, 1.8, 1.7, 1.6, 1.5, 1.4, 1.3, 1.2, 1.1, 1),
          lambda v: at_vpp(NOMINAL, v), 3, 3, "3..8 Vpp, receiver ICs"),
    Sweep("later", "pulses after the first, relative to it", "%", _range(100, 30, -5),
          lambda v: _senders(later_gain=v / 100), 80, 60, "must detect, field rule"),
    Sweep("ghost", "foreign pulse inside the telegram, relative to its amplitude", "%", _range(0, 100, 5),
          lambda v: replace(NOMINAL, ghost=v / 100), 30, 30, "must ignore, field rule"),
    Sweep("threshold_up", "threshold, upwards", "%", _range(50, 95, 5), lambda v: _threshold(v / 100), 55, 55,
          "receiver ICs"),
    Sweep("threshold_down", "threshold, downwards", "%", _range(50, 5, -5), lambda v: _threshold(v / 100), 45, 45,
          "receiver ICs"),
    Sweep("white_3v", "white noise at 3 Vpp, rms behind the band pass", "V", _range(0, 0.4, 0.02),
          lambda v: _disturbed(3, white_v=v)),
    Sweep("white_5v", "white noise at 5 Vpp, rms behind the band pass", "V", _range(0, 0.4, 0.02),
          lambda v: _disturbed(5, white_v=v)),
    Sweep("sine_3v", "100 kHz sine at 3 Vpp, amplitude on the line", "V", _range(0, 1.2, 0.06),
          lambda v: _disturbed(3, sine_v=v)),
    Sweep("sine_5v", "100 kHz sine at 5 Vpp, amplitude on the line", "V", _range(0, 1.5, 0.075),
          lambda v: _disturbed(5, sine_v=v)),
    Sweep("mains", "50 Hz at 3 Vpp, amplitude on the line", "V", (0, 1, 2, 5, 10, 15, 20, 30, 40, 50, 60, 80, 100),
          lambda v: _disturbed(3, mains_v=v)),
    Sweep("burst", "300 kHz bursts at 3 Vpp, one per telegram, peak on the line", "V", _range(0, 3, 0.15),
          lambda v: _disturbed(3, burst_v=v, burst_per_ms=10)),
    Sweep("dip", "DC dip at 3 Vpp, time constant 20 us", "V", _range(0, 5, 0.25), lambda v: _disturbed(3, dip_v=v)),
    Sweep("fast", "clock of the sender, fast", "ppm", PPM, lambda v: _senders(ppm=v), 1000, 1000, "P_CLK_PPM (EK)"),
    Sweep("slow", "clock of the sender, slow", "ppm", PPM, lambda v: _senders(ppm=-v), 1000, 1000, "P_CLK_PPM (EK)"),
    Sweep("jitter", "jitter of each edge, +-", "ns", _range(0, 1300, 50), lambda v: _senders(jitter_ns=v)),
    Sweep("length", "length of the line", "m",
          (10, 50, 100, 125, 150, 175, 200, 225, 250, 275, 300, 350, 400, 450, 500),
          lambda v: _line(metres=v, longest_m=500), 100, 100, "one segment"),
    Sweep("slaves", "slaves on 100 m", "", (1, 16, 31, 62, 93, 124, 186, 248, 310),
          lambda v: Setup((Hop(replace(bus(), loads=(("master", SLAVE), *(
              (f"n{1 + k % 30}" if k else "far", SLAVE) for k in range(int(v)))))),)), 62, 62, "62 slaves"),
    Sweep("cable_l", "inductance of the cable, C' 60 pF/m", "uH/m", _range(0.4, 4, 0.3),
          lambda v: _line(cable=Cable(l=v * 1e-6)), 1.3, 1.3, "EK range"),
    Sweep("capacitance", "extra capacitance at the far end", "nF",
          (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 15, 20, 25, 30, 40),
          _extra_capacitance),
    Sweep("damping", "resistance across the decoupling", "Ohm", (78, 100, 150, 200, 300, 400, 600, 1000, 2000, 10000),
          lambda v: _line(decoupling_ohm=v)),
    Sweep("repeaters", "repeaters in series, re-timed", "", (0, 1, 2, 3, 4), lambda v: _repeaters(v, True), 2, 2,
          "at most 2"),
    Sweep("repeaters_raw", "repeaters in series, not re-timed", "", (0, 1, 2, 3, 4), lambda v: _repeaters(v, False)),
)
BY_NAME = {sweep.name: sweep for sweep in SWEEPS}


def run_point(name: str, value: float, telegrams: int, seed: int) -> dict[str, Any]:
    """Exchanges at one value: per direction the classes, undetected errors, and the earliest and latest pulse (ns)."""
    sweep = BY_NAME[name]
    rng = np.random.default_rng([seed, sorted(BY_NAME).index(name), sweep.values.index(value)])
    setup = sweep.setup(value)
    result: dict[str, Any] = {"value": value}
    counts = {"request": Counter(), "answer": Counter()}
    wrong, off = Counter(), {"request": [], "answer": []}
    for k in range(telegrams):
        for where, outcome in zip(counts, exchange(setup, int(rng.integers(1 << 11)), k % 16, rng)):
            counts[where]["WRONG" if outcome.wrong else outcome.error_class.name] += 1
            wrong[where] += outcome.wrong
            if outcome.early_ns is not None:
                off[where] += [outcome.early_ns, outcome.late_ns]
    for where, found in counts.items():
        result[where] = {"telegrams": telegrams, "failed": telegrams - found["OK"], "wrong": wrong[where],
                         "classes": {k: v for k, v in found.items() if k != "OK"},
                         "early_ns": min(off[where], default=None), "late_ns": max(off[where], default=None)}
    return result


def first_error(sweep: Sweep, points: list[dict[str, Any]], where: str) -> tuple[float | None, float | None]:
    """-> (last value without an error, first value with one); None: there is none."""
    good = None
    for point in points:
        if point[where]["failed"]:
            return good, point["value"]
        good = point["value"]
    return good, None


def keeps_limit(sweep: Sweep, points: list[dict[str, Any]], where: str) -> bool | None:
    """True: no error up to and at the limit; None: there is no limit."""
    limit = sweep.request_limit if where == "request" else sweep.answer_limit
    if limit is None:
        return None
    rising = sweep.values[-1] > sweep.values[0]
    return not any(p[where]["failed"] for p in points if (p["value"] <= limit if rising else p["value"] >= limit))
