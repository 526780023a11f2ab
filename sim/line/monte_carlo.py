# SPDX-License-Identifier: Apache-2.0
"""Monte Carlo over all parameters at once. A sample is one installation with EXCHANGES exchanges on it.

Everything about sample n follows from (seed, population, n): a sample can be run again alone. Two populations:
    legal   every parameter inside its published limit or EK range, disturbances together below 30 % of the weakest
            legal pulse (0.45 V): telegrams should arrive
    stress  disturbances, jitter and pulse ratios far outside: telegrams fail, and the question is whether a failure can
            look like a good telegram
Requirements: AN-008 (docs/requirements.md).
"""
import math
from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np

from .exchange import Hop, Receiver, Repeater, Sender, Setup, exchange
from .front_end import Comparators, Disturbance
from .network import SLAVE, BandPass, Cable, Segment

POPULATIONS = ("legal", "stress")
EXCHANGES = 16
WEAKEST_V, IGNORED = 1.5, 0.30       # smallest legal pulse (3 Vpp); interference below this part of it is ignored


def _cable(rng: np.random.Generator) -> Cable:
    while True:                                   # 80..120 Ohm leaves about half of the draws
        cable = Cable(rng.uniform(20e-3, 90e-3), rng.uniform(0.4e-6, 1.3e-6), rng.uniform(30e-12, 80e-12),
                      rng.uniform(0, 5e-6))
        if 80 <= cable.impedance <= 120:
            return cable


def _segment(rng: np.random.Generator) -> Hop:
    """A random tree of up to 100 m; near end (master or repeater), power unit, far end and slaves anywhere on it."""
    count = int(rng.integers(2, 10))
    names = [f"n{k}" for k in range(count)]
    lengths = rng.dirichlet(np.ones(count - 1)) * rng.uniform(5, 100)
    cables = tuple((names[int(rng.integers(k))], names[k], max(0.1, float(lengths[k - 1]))) for k in range(1, count))
    total = sum(c[2] for c in cables)
    if total > 100:
        cables = tuple((a, b, m * 100 / total) for a, b, m in cables)
    near, far = names[int(rng.integers(count))], names[int(rng.integers(count))]
    loads = ((near, SLAVE), (far, SLAVE), *((names[int(rng.integers(count))], SLAVE)
                                            for _ in range(int(rng.integers(0, 62)))))
    return Hop(Segment(cables, names[int(rng.integers(count))], loads, _cable(rng), 100e-6 * rng.uniform(0.9, 1.1),
                       78 * rng.uniform(0.95, 1.05), section_m=10.0), near, far)


def draw(population: str, number: int, seed: int) -> tuple[Setup, np.random.Generator]:
    """The installation of a sample, and the generator its telegrams go on with."""
    rng = np.random.default_rng([seed, POPULATIONS.index(population), number])
    stress = population == "stress"

    def sender() -> Sender:
        return Sender(rng.uniform(0.055, 0.068), rng.uniform(-1000, 1000), rng.uniform(0, 1000 if stress else 100),
                      rng.uniform(0.4, 1.4) if stress else rng.uniform(0.9, 1.1))

    def receiver() -> Receiver:
        return Receiver(BandPass(7e3 * rng.uniform(0.8, 1.2), 1e6 * rng.uniform(0.8, 1.2)),
                        Comparators(rng.uniform(0.45, 0.55), rng.uniform(0.55, 0.65)))

    repeaters = int(rng.choice((0, 1, 2), p=(0.7, 0.15, 0.15)))
    hops = tuple(_segment(rng) for _ in range(repeaters + 1))
    # peak of all disturbances together, shared out by chance; white noise counts with 4 rms, a dip with what passes
    total = rng.uniform(0.2, 3.0) if stress else rng.uniform(0, IGNORED * WEAKEST_V)
    white, sine, burst, dip = rng.dirichlet((1, 1, 1, 1)) * total
    disturbance = Disturbance(white_v=white / 4, mains_v=rng.uniform(0, 1), sine_v=sine,
                              sine_hz=float(np.exp(rng.uniform(np.log(20e3), np.log(500e3)))), burst_v=burst,
                              burst_hz=rng.uniform(100e3, 600e3), burst_per_ms=rng.uniform(1, 20),
                              burst_decay_ns=rng.uniform(1e3, 5e3), dip_v=dip / 0.4, dip_ns=rng.uniform(10e3, 50e3))
    setup = Setup(hops, sender(), sender(), receiver(), receiver(),
                  tuple(Repeater(rng.uniform(2e3, 5e3), True, sender(), receiver()) for _ in range(repeaters)),
                  disturbance, ghost=rng.uniform(0, 1.2) if stress and rng.random() < 0.3 else 0.0)
    return setup, rng


@dataclass
class Sample:
    """What happened in one sample."""
    number: int
    repeaters: int
    disturbed_v: float                             # sum of the peaks
    classes: dict[str, dict[str, int]]             # direction -> class (OK, WRONG, or an error class) -> count
    early_ns: float                                # earliest and latest pulse of the accepted telegrams
    late_ns: float
    wrong: list[tuple[str, int, int]]              # direction, sent, accepted


def run_sample(population: str, number: int, seed: int, exchanges: int = EXCHANGES) -> Sample:
    setup, rng = draw(population, number, seed)
    d = setup.disturbance
    sample = Sample(number, len(setup.repeaters), 4 * d.white_v + d.sine_v + d.burst_v + 0.4 * d.dip_v,
                    {"request": Counter(), "answer": Counter()}, 0.0, 0.0, [])
    for _ in range(exchanges):
        for where, out in zip(sample.classes, exchange(setup, int(rng.integers(1 << 11)), int(rng.integers(16)), rng)):
            sample.classes[where]["WRONG" if out.wrong else out.error_class.name] += 1
            if out.wrong:
                sample.wrong.append((where, out.sent, out.data))
            if out.right and out.early_ns is not None:
                sample.early_ns, sample.late_ns = min(sample.early_ns, out.early_ns), max(sample.late_ns, out.late_ns)
    return sample


def run_samples(population: str, first: int, count: int, seed: int) -> list[Sample]:
    return [run_sample(population, number, seed) for number in range(first, first + count)]


def upper_bound(events: int, trials: int, confidence: float = 0.95) -> float:
    """One-sided Clopper-Pearson bound of a probability: events seen in trials."""
    if events >= trials:
        return 1.0

    def at_most(p: float) -> float:                # P(X <= events)
        logs = [math.lgamma(trials + 1) - math.lgamma(k + 1) - math.lgamma(trials - k + 1) + k * math.log(p)
                + (trials - k) * math.log1p(-p) for k in range(events + 1)]
        top = max(logs)
        return math.exp(top) * sum(math.exp(x - top) for x in logs)

    low, high = 0.0, 1.0
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (middle, high) if at_most(middle) > 1 - confidence else (low, middle)
    return high


def summary(samples: list[Sample]) -> dict[str, Any]:
    """Counts over samples, with 95 % upper bounds."""
    out: dict[str, Any] = {"samples": len(samples)}
    for where in ("request", "answer"):
        found = sum((Counter(s.classes[where]) for s in samples), Counter())
        telegrams, accepted = sum(found.values()), found["OK"] + found["WRONG"]
        failed = telegrams - found["OK"]
        out[where] = {"telegrams": telegrams, "accepted": accepted, "wrong": found["WRONG"], "failed": failed,
                      "classes": {k: v for k, v in sorted(found.items()) if k not in ("OK", "WRONG")},
                      "failed_bound": upper_bound(failed, telegrams) if failed < 2000 else None,
                      "wrong_bound": upper_bound(found["WRONG"], telegrams)}
    out["early_ns"] = min((s.early_ns for s in samples), default=0.0)
    out["late_ns"] = max((s.late_ns for s in samples), default=0.0)
    out["wrong"] = [{"sample": s.number, "direction": where, "sent": sent, "accepted": accepted}
                    for s in samples for where, sent, accepted in s.wrong]
    return out
