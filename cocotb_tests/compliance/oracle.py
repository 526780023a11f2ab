# SPDX-License-Identifier: Apache-2.0
"""What a master's line layer must make of a pulse train, written from the rules (docs/requirements.md) alone.

It shares no code with the receiver, the models or the decoder of this project. All times are whole clocks; a train is
a list of pulses (time, polarity) with polarity -1 or +1. It is slow and plain on purpose: it sees the whole train at
once, has no state machine and no counters, so it cannot make the mistakes of one.
"""
from dataclasses import dataclass

START, ALTERNATION, TIMING, NO_INFORMATION = "START", "ALTERNATION", "TIMING", "NO_INFORMATION"
END_BIT, PARITY, LENGTH, EARLY = "END_BIT", "PARITY", "LENGTH", "EARLY"
OK, NO_RESPONSE, BAD_MASTER, ABORTED = "OK", "NO_RESPONSE", "BAD_MASTER", "ABORTED"


class Ambiguous(ValueError):
    """The rules do not say what a receiver makes of this waveform: the case is not fit for a compliance suite."""


class Times:
    """The times of the rules in clocks."""

    def __init__(self, hz: int):
        self.hz = hz
        self.half, self.early, self.late, self.filter = self.us(3), self.us(0.875), self.us(1.5), self.us(0.75)
        self.request = self.us(78)         # first to last pulse of a request
        self.answer = self.us(36)
        self.length = self.us(7.5)         # from the end pulse's grid point to the end of the length window
        self.open, self.timeout, self.echo_max = self.us(12), self.us(66), self.us(3)
        self.gap_ok, self.gap_norsp, self.gap_err = self.us(18.5), self.us(6), self.us(24)
        self.babble, self.idle, self.bias = self.us(1000), self.us(60), self.us(12)
        # from a pulse on the pins to a decision that needs it: filter, two flip-flops, and a few clocks to act
        self.act = self.filter + 8

    def us(self, time: float) -> int:
        clocks = time * self.hz / 10**6
        if clocks != int(clocks):
            raise ValueError(f"{time} us is not a whole number of clocks at {self.hz} Hz")
        return int(clocks)


def request_word(call: int) -> str:
    """11-bit payload -> the 14 bits of a request, first bit first."""
    bits = f"{call:011b}"
    return "0" + bits + str(bits.count("1") % 2) + "1"


def answer_word(data: int) -> str:
    bits = f"{data:04b}"
    return "0" + bits + str(bits.count("1") % 2) + "1"


def train(word: str, half: int) -> list[tuple[int, int]]:
    """Bits -> pulses: bit k has its pulse at 2k half bits, - for 0 and + for 1; two equal bits have one between."""
    out = []
    for k, bit in enumerate(word):
        sign = 1 if bit == "1" else -1
        out.append((2 * k * half, sign))
        if word[k + 1:k + 2] == bit:
            out.append(((2 * k + 1) * half, -sign))
    return out


def filtered(times: Times, pins: list[tuple[int, int, int]]) -> list[tuple[int, int]]:
    """Pin pulses (time, polarity, width) -> pulses that count: on each pin, high for 750 ns or longer."""
    out = []
    for sign in (-1, 1):
        runs: list[list[int]] = []
        for time, _, width in sorted(p for p in pins if p[1] == sign):
            if runs and time <= runs[-1][1]:
                runs[-1][1] = max(runs[-1][1], time + width)
            else:
                runs.append([time, time + width])
        for (_, end), (begin, _) in zip(runs, runs[1:]):
            if begin - end < times.filter:
                raise Ambiguous(f"a pause of {begin - end} clocks on one pin: one pulse or two?")
        out += [(begin, sign) for begin, end in runs if end - begin >= times.filter]
    return sorted(out)


@dataclass(frozen=True)
class Verdict:
    """What one telegram is: class, payload (None: not complete), time of its end pulse (None: none)."""
    error: str
    payload: int | None
    end: int | None


def judge(times: Times, pulses: list[tuple[int, int]], bits: int) -> Verdict:
    """Checks 1 to 7 on a telegram of so many bits; pulses: from its first one on, whatever follows included."""
    base = pulses[0][0]
    last = 2 * (bits - 1)

    def window(time):
        """Number n of the window that time is in, None: between two windows."""
        n = (time - base + times.early) // times.half
        return n if n * times.half + times.late >= time - base else None

    close = base + last * times.half + times.length
    pulses = [p for p in pulses if p[0] <= close]
    end = next((time for time, _ in pulses if window(time) == last), None)
    body = pulses if end is None else [p for p in pulses if p[0] <= end]
    after = [] if end is None else [p for p in pulses if p[0] > end]
    places = [window(time) for time, _ in body]
    signs = {n: sign for n, (_, sign) in zip(places, body)}
    word = [signs.get(2 * k) for k in range(bits)]
    payload = None if None in word else int("".join("1" if s > 0 else "0" for s in word[1:-2]), 2)
    checks = (
        (START, body[0][1] > 0),
        (ALTERNATION, any(a[1] == b[1] for a, b in zip(body, body[1:]))),
        (TIMING, any(n is None or n > last for n in places) or len(set(places)) < len(places)),
        (NO_INFORMATION, any(2 * k not in places for k in range(1, bits))),
        (END_BIT, word[-1] != 1),
        (PARITY, sum(s == 1 for s in word[1:-1]) % 2 == 1),
        (LENGTH, bool(after)),
    )
    return Verdict(next((name for name, failed in checks if failed), OK), payload, end)


@dataclass(frozen=True)
class Outcome:
    """One attempt; times from the own last edge. The next request may start from next_lo to next_hi."""
    error: str
    data: int | None      # of a good answer
    decided: int          # earliest time at which the class can be known
    next_lo: int
    next_hi: int


def attempt(times: Times, pins: list[tuple[int, int, int]], call: int, no_reply: bool) -> Outcome:
    """pins: all pulses at the receiver, (time from the own last edge, polarity, width), the own echo included."""
    pulses = [p for p in filtered(times, pins) if p[0] >= -times.request]
    # the own request: judged 7.5 us after its end pulse, at the latest 10.5 us after the own last edge
    heard_late = not pulses or pulses[0][0] > -times.request + times.echo_max
    if heard_late:
        judged, good = times.echo_max + times.length, False
    else:
        judged = pulses[0][0] + times.request + times.length
        own = judge(times, pulses, 14)
        good = own.error == OK and own.payload == call
    rest = [p for p in pulses if p[0] > judged]

    data, late = None, []
    if rest and rest[0][0] < times.open:
        error, decided, quiet, late = EARLY, rest[0][0], rest[0][0], rest[1:]
        start = (quiet + times.gap_err,) * 2
    elif rest and rest[0][0] <= times.timeout:
        verdict = judge(times, rest, 7)
        decided = rest[0][0] + times.answer + times.length
        error, data = verdict.error, verdict.payload
        late = [p for p in rest if p[0] > decided]
        if error == OK:
            start = (verdict.end + times.gap_ok,) * 2
        else:
            start = (max(p[0] for p in rest if p[0] <= decided) + times.gap_err,) * 2
            if start[0] < decided + times.act:  # quiet for long enough before it is decided: at once
                start = (max(start[0], decided), decided + times.act)
    else:
        error, decided, late = OK if no_reply else NO_RESPONSE, times.timeout, rest
        start = (times.timeout + times.gap_norsp,) * 2
    babble_from = decided if error not in (OK, NO_RESPONSE) else None
    for time, _ in late:
        if babble_from is None:
            babble_from = time
        if time < start[0]:
            if time > start[0] - times.us(1.25):
                raise Ambiguous(f"a pulse {start[0] - time} clocks before the next request: too late to hold it back")
            start = (time + times.gap_err,) * 2
        else:
            raise Ambiguous("a pulse after the next request has begun")
    if babble_from is not None and start[0] > babble_from + times.babble:
        start = (babble_from + times.babble, babble_from + times.babble + times.us(1) + times.act)
    if not good:
        error = BAD_MASTER
    return Outcome(error, data if error == OK else None, decided, *start)
