# SPDX-License-Identifier: Apache-2.0
"""Faults of a slave's answers (SL-008). Each fault has a probability per answer; several may hit the same answer."""
from dataclasses import dataclass, fields
from random import Random

from asi.telegram import pulses, response_pulses, response_word

END_NS = 36_000                 # end pulse of an answer
EXTRA_NS = END_NS + 3_000       # where an extra pulse goes: into the quiet bit time after the answer


@dataclass
class Faults:
    """Probabilities 0..1 per answer, and two settings in ns.

    parity flips the parity bit; missing_pulse, shifted_pulse take a random pulse but never the first one, which is the
    time base; extra_pulse adds a negative pulse 3 us after the end; double_answer adds the inverted nibble at once, as
    a second slave on the same address would.
    """
    no_answer: float = 0.0
    parity: float = 0.0
    missing_pulse: float = 0.0
    shifted_pulse: float = 0.0
    extra_pulse: float = 0.0
    double_answer: float = 0.0
    shift_ns: int = 2_000
    delay_ns: int = 0

    def __post_init__(self):
        for field in fields(self)[:6]:
            if not 0.0 <= getattr(self, field.name) <= 1.0:
                raise ValueError(f"{field.name} is a probability, not {getattr(self, field.name)}")

    def answer(self, nibble: int, random: Random):
        """Pulses of the answer as [(ns after its nominal start, polarity)]; empty when there is none."""
        def hit(probability):
            return probability > 0.0 and random.random() < probability

        if hit(self.no_answer):
            return []
        out = pulses(response_word(nibble) ^ 2, 7) if hit(self.parity) else response_pulses(nibble)
        if hit(self.missing_pulse):
            del out[random.randrange(1, len(out))]
        if hit(self.shifted_pulse):
            k = random.randrange(1, len(out))
            out[k] = (out[k][0] + self.shift_ns, out[k][1])
        if hit(self.extra_pulse):
            out.append((EXTRA_NS, -1))
        if hit(self.double_answer):
            out += response_pulses(nibble ^ 15)
        return sorted((t + self.delay_ns, polarity) for t, polarity in out)
