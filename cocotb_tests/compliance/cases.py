# SPDX-License-Identifier: Apache-2.0
"""The cases: what is driven on the receive pins and what must come of it.

A case is one call. For each of its attempts it gives the pulses at the receiver, in clocks from the own last edge,
and how the own request is heard (echo). What must happen comes from oracle.py; `want` is the class written by hand
where a case is simple enough to be sure, and test_compliance.py compares both. Numbers count inside a group and
are the same for every clock; sweeps from clock to clock have groups of their own.
"""
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from cocotb_tests.compliance import oracle
from cocotb_tests.compliance.oracle import (ALTERNATION, BAD_MASTER, EARLY, END_BIT, LENGTH, NO_INFORMATION,
                                            NO_RESPONSE, OK, PARITY, START, TIMING, Ambiguous, Times, answer_word,
                                            request_word, train)

Pins = list[tuple[int, int, int]]   # time, polarity, width
E1, ADRA7, DEXG31, BR01, RDID5 = 0x0AA, 0x007, 0x3EF, 0x7F5, 0x4B1
SYNC, ASYNC = 21.5, 33.5


@dataclass
class Step:
    """One attempt: what is driven, and the echo of the own request in clocks (None: pins hold what is heard of it)."""
    pins: Pins
    echo: int | None


@dataclass
class Case:
    ident: str
    title: str
    rules: tuple[str, ...]
    call: int
    steps: list[Step]
    retries: int = 0
    no_reply: bool = False
    want: str | None = None        # class of the last attempt, written by hand
    also: tuple[str, ...] = ()     # where the rules leave a choice: other classes that are as good
    needs: tuple[str, ...] = ()    # abilities of the device
    kind: str = "call"             # call, late, idle, abort: see runner.py
    at: int = 0                    # late: clocks after the gap; abort: from the own last edge
    margin: int | None = None      # clocks between a pulse and the limit that decides
    outcomes: list[oracle.Outcome] = field(default_factory=list)


@dataclass(frozen=True)
class Group:
    ident: str
    title: str
    rules: tuple[str, ...]
    make: Callable[["Maker"], None]


GROUPS: dict[str, Group] = {}


def group(ident: str, rules: str):
    """Register a group; the first line of the function's docstring is its title."""
    def decorate(make):
        GROUPS[ident] = Group(ident, make.__doc__.splitlines()[0], tuple(rules.split(", ")), make)
        return make
    return decorate


class Maker:
    """Collects the cases of one group."""

    def __init__(self, grp: Group, times: Times):
        self.group, self.times, self.us = grp, times, times.us
        self.cases: list[Case] = []

    def pins(self, pulses, base=0, width=None) -> Pins:
        return [(base + t, sign, width or self.us(1)) for t, sign in pulses]

    def word(self, bits: str) -> list[tuple[int, int]]:
        return train(bits, self.times.half)

    def answer(self, data: int, delay=SYNC) -> Pins:
        return self.pins(self.word(answer_word(data)), self.us(delay))

    def own(self, call: int, delay: int = 0) -> Pins:
        return self.pins(self.word(request_word(call)), delay - self.times.request)

    def add(self, title: str, *attempts, call=None, echo=0.0, rules="", **fields) -> None:
        """attempts: pins for each; echo: us, the same for all attempts, None: the pins hold it.

        Without `call` each case takes another one, with all bits in use.
        """
        number = len(self.cases) + 1
        call = (0x0AA + 0x2B5 * number) & 0x7FF if call is None else call
        delay = None if echo is None else self.us(echo)
        if echo == 0.0:
            delay = number % 3 * self.us(0.5)
        steps = [Step(list(pins), delay) for pins in attempts]
        case = Case(f"{self.group.ident}-{number:03}", title, tuple(rules.split(", ")) if rules else self.group.rules,
                    call, steps, **fields)
        for step in steps:
            heard = step.pins if case.kind != "idle" else []   # those of idle are over when the request starts
            heard = heard + (self.own(call, step.echo) if step.echo is not None else [])
            case.outcomes.append(oracle.attempt(self.times, heard, call, case.no_reply))
            times = [time for time, _ in oracle.filtered(self.times, heard)]
            if len(set(times)) < len(times):  # both comparators in one clock: no rule says which pulse comes first
                case.also = (ALTERNATION, TIMING, START)
        self.cases.append(case)

    def train(self, title: str, pulses, delay=SYNC, want=None, width=None, **fields) -> None:
        """A case that is one train after a good request; pulses: [(time from the first one, sign)]."""
        self.add(title, self.pins(sorted(pulses), self.us(delay), width), want=want, **fields)


def build(hz: int, groups=None) -> dict[str, list[Case]]:
    times = Times(hz)
    out = {}
    for ident in groups or GROUPS:
        maker = Maker(GROUPS[ident], times)
        maker.group.make(maker)
        out[ident] = maker.cases
    return out


def _moved(pulses, index, by):
    return [(t + by, s) if i == index else (t, s) for i, (t, s) in enumerate(pulses)]


def _flipped(pulses, *indices):
    return [(t, -s) if i in indices else (t, s) for i, (t, s) in enumerate(pulses)]


def _without(pulses, *indices):
    return [p for i, p in enumerate(pulses) if i not in indices]


def _with_window(m: Maker, n: int) -> Iterator[tuple[int, int]]:
    """(data, index of its pulse in window n) for the answers that have a pulse there."""
    for data in range(16):
        for index, (t, _) in enumerate(m.word(answer_word(data))):
            if t == n * m.times.half:
                yield data, index


def _edges(times: Times):
    """(name, inner limit relative to the grid, outward sign)"""
    return (("early", -times.early, -1), ("late", times.late, 1))


# --------------------------------------------------------------------------------------------- good answers
@group("C-ANS", "TL-002, TL-003, TL-005, RX-013, LT-002, LT-003, LT-004")
def good_answers(m):
    """All 16 answers at five response delays"""
    for delay in (SYNC, ASYNC, 12, 50, 66):
        for data in range(16):
            m.add(f"answer {data:X}, {delay} us", m.answer(data, delay), want=OK)


@group("C-ECD", "RX-012, RX-014, TL-006")
def echo_delays(m):
    """Own request heard with every delay from 0 to 1 us, clock by clock, and 1.5 to 3 us"""
    for delay in range(m.us(1) + 1):
        m.add(f"echo {delay} clocks", m.answer(delay & 15) + m.own(E1, delay), call=E1, echo=None, want=OK)
    for delay in (1.5, 2, 2.5, 3):
        m.add(f"echo {delay} us", m.answer(5) + m.own(ADRA7, m.us(delay)), call=ADRA7, echo=None, want=OK)


# --------------------------------------------------------------------------------------------- windows
@group("C-WIN", "RX-003, RX-008, RX-010")
def window_edges(m):
    """One pulse of an answer moved to both limits of its window, two clocks inside to two clocks outside"""
    for n in range(1, 13):
        data, index = list(_with_window(m, n))[n % 3]
        pulses = m.word(answer_word(data))
        for side, limit, out in _edges(m.times):
            for beyond in range(-2, 3):
                m.train(f"window {n} {side} limit {beyond:+} clocks (answer {data:X})",
                        _moved(pulses, index, limit + out * beyond), want=TIMING if beyond > 0 else OK,
                        margin=abs(beyond) if beyond <= 0 else beyond - 1)


@group("C-JIT", "RX-003, RX-010, LT-004")
def jitter(m):
    """All pulses of an answer moved inside their windows; drift, which a resynchronising receiver would accept"""
    t = m.times
    for data in (0, 5, 10, 15, 9):
        pulses = m.word(answer_word(data))
        for name, moves in (("all late", (t.late,)), ("all early", (-t.early,)), ("late, early", (t.late, -t.early)),
                            ("early, late", (-t.early, t.late)), ("late, on time", (t.late, 0)),
                            ("on time, early", (0, -t.early))):
            m.train(f"{name}, answer {data:X}", [p if i == 0 else (p[0] + moves[i % len(moves)], p[1])
                                                 for i, p in enumerate(pulses)], want=OK)
        for name, end in (("slow", t.late), ("fast", -t.early), ("too slow", t.late + 1), ("too fast", -t.early - 1)):
            m.train(f"drift, {name}, answer {data:X}", [(p[0] + end * p[0] // t.answer, p[1]) for p in pulses],
                    want=TIMING if "too" in name else OK)


# --------------------------------------------------------------------------------------------- checks 1 to 7
@group("C-STA", "RX-001, RX-008")
def start(m):
    """Start: first pulse positive: whole answers inverted, first pulse missing, a positive pulse before the answer"""
    t = m.times
    for data in range(16):
        pulses = m.word(answer_word(data))
        m.train(f"answer {data:X} inverted", [(time, -s) for time, s in pulses], want=START)
        if pulses[1][1] > 0:
            m.train(f"answer {data:X} without its first pulse", [(time - pulses[1][0], s) for time, s in pulses[1:]],
                    want=START)
        m.train(f"answer {data:X} with a positive first pulse", _flipped(pulses, 0), want=START)
    for lead in (1.5, 1.75, 2, 2.5, 3, 4, 6, 9):
        m.add(f"a positive pulse {lead} us before an answer",
              m.pins([(0, 1)], m.us(SYNC)) + m.answer(6, SYNC + lead), want=START)
    m.add("a single positive pulse", m.pins([(0, 1)], t.us(SYNC)), want=START)
    m.add("a positive pulse at the opening of the window", m.pins([(0, 1)], t.open), want=START)
    m.add("a positive pulse at the time-out", m.pins([(0, 1)], t.timeout), want=START)


@group("C-ALT", "RX-002, RX-008")
def alternation(m):
    """Alternation: polarity of each pulse turned, alone, with all that follow, with its neighbour"""
    for data in range(16):
        pulses = m.word(answer_word(data))
        for index in range(1, len(pulses)):
            m.train(f"answer {data:X}, pulse {index + 1} turned", _flipped(pulses, index), want=ALTERNATION)
    for data in (0, 5, 14):
        pulses = m.word(answer_word(data))
        for index in range(1, len(pulses)):
            m.train(f"answer {data:X}, pulse {index + 1} turned and late by a clock",
                    _moved(_flipped(pulses, index), index, 1), want=ALTERNATION)
    for data in (0, 7, 15):
        pulses = m.word(answer_word(data))
        for index in range(1, len(pulses)):
            m.train(f"answer {data:X}, pulses from {index + 1} on turned",
                    _flipped(pulses, *range(index, len(pulses))), want=ALTERNATION)
            if index + 1 < len(pulses):
                m.train(f"answer {data:X}, pulses {index + 1} and {index + 2} turned",
                        _flipped(pulses, index, index + 1), want=ALTERNATION)


@group("C-TIM", "RX-003, RX-008")
def timing(m):
    """Timing: a pulse of each window moved into the dead zones beside it; swapped order of failed checks"""
    t = m.times
    middle = (t.half - t.early + t.late) // 2  # of the dead zone after a window
    for n in range(1, 13):
        for data, index in list(_with_window(m, n))[:4]:
            pulses = m.word(answer_word(data))
            m.train(f"window {n}, answer {data:X}: late in the dead zone", _moved(pulses, index, middle), want=TIMING)
            m.train(f"window {n}, answer {data:X}: early in the dead zone", _moved(pulses, index, middle - t.half),
                    want=TIMING)
    pulses = m.word(answer_word(3))
    m.train("E12: -21 at 19.8 us", _moved(pulses, 6, -m.us(1.25)), want=TIMING, rules="RX-003, RX-011")
    m.train("positive end pulse 1.625 us late, parity wrong", _moved(m.word("0011011"), 9, m.us(1.625)),
            want=TIMING)
    m.train("timing before no-information: -21 early, +24 missing",
            _without(_moved(pulses, 5, -m.us(1.25)), 6, 7), want=TIMING)


@group("C-INF", "RX-004, RX-008, RX-011")
def no_information(m):
    """No information: each window without its pulse, with and without a break in the alternation; broken-off answers"""
    for data in range(16):
        pulses = m.word(answer_word(data))
        for index in range(1, len(pulses)):
            m.train(f"answer {data:X} without pulse {index + 1}", _without(pulses, index))
        for index in range(1, len(pulses) - 1):
            m.train(f"answer {data:X} without pulses {index + 1} and {index + 2}", _without(pulses, index, index + 1))
    for data in (0, 15):
        pulses = m.word(answer_word(data))
        for count in range(1, len(pulses)):
            m.train(f"answer {data:X} breaks off after pulse {count}", pulses[:count], want=NO_INFORMATION)
    pulses = m.word(answer_word(3))
    m.train("E12: +24 missing", _without(pulses, 7), want=ALTERNATION, rules="RX-002, RX-011")
    m.train("E12: -21 and +24 missing", _without(pulses, 6, 7), want=NO_INFORMATION, rules="RX-004, RX-011")


@group("C-PAR", "RX-005, RX-008, TL-003")
def parity(m):
    """Parity: every answer with a wrong parity bit, and with every single bit turned"""
    for data in range(16):
        word = answer_word(data)
        for k in range(1, 6):
            bits = word[:k] + "10"[int(word[k])] + word[k + 1:]
            m.train(f"answer {data:X}, bit {k} turned", m.word(bits), want=PARITY)


@group("C-END", "RX-006, RX-008")
def end_bit(m):
    """End bit: every answer, right and wrong parity, with a negative end pulse"""
    for data in range(16):
        word = answer_word(data)
        m.train(f"answer {data:X}, end bit 0", m.word(word[:6] + "0"), want=END_BIT)
        m.train(f"answer {data:X}, end bit 0, parity wrong", m.word(word[:5] + "10"[int(word[5])] + "0"), want=END_BIT)


@group("C-LEN", "RX-007, RX-008")
def length(m):
    """Length: every answer with one, two and many pulses after its end; longer telegrams; earlier checks come first"""
    for data in range(16):
        pulses = m.word(answer_word(data))
        m.train(f"answer {data:X} and -39", [*pulses, (m.us(39), -1)], want=LENGTH)
        m.train(f"answer {data:X} and -42", [*pulses, (m.us(42), -1)], want=LENGTH)
        m.train(f"answer {data:X} and +42", [*pulses, (m.us(42), 1)], want=LENGTH)
        m.train(f"answer {data:X}, parity wrong, and -39", [*m.word(answer_word(data)[:5] + "10"[int(
            answer_word(data)[5])] + "1"), (m.us(39), -1)], want=PARITY)
        m.train(f"answer {data:X}, end bit 0, and +39", [*m.word(answer_word(data)[:6] + "0"), (m.us(39), 1)],
                want=END_BIT)
    for bits in range(8, 15):
        m.train(f"a telegram of {bits} bits", m.word("00110101010101"[:bits]))
    for more in range(1, 5):
        m.train(f"{more} pulses after the end", [*m.word(answer_word(6)), *((m.us(37.5 + 1.875 * k), -1 if k % 2 else 1)
                                                                           for k in range(1, more + 1))], want=LENGTH)


@group("C-LNC", "RX-007")
def length_clocks(m):
    """Length: a pulse after the end at every clock until two clocks after the window"""
    t = m.times
    pulses = m.word(answer_word(5))
    for at in range(t.answer + m.us(1.75), t.answer + t.length + 3):
        for sign in (-1, 1):
            beyond = at - t.answer - t.length
            m.train(f"{'+' if sign > 0 else '-'} {at} clocks", [*pulses, (at, sign)], want=OK if beyond > 0 else LENGTH,
                    margin=-beyond if beyond <= 0 else beyond - 1)
    for at in range(1, m.us(1.75)):
        m.train(f"- {at} clocks after the end pulse", [*pulses, (t.answer + at, -1)], want=LENGTH)


# --------------------------------------------------------------------------------------------- extra pulses
@group("C-EXT", "RX-003, RX-002, RX-008")
def extra_pulses(m):
    """A pulse too many in every dead zone, both polarities; pairs, which keep the alternation; two in one window"""
    t = m.times
    zone = t.half - t.early - t.late - 1   # clocks in a dead zone
    for n in range(0, 12):
        for part, where in (("first", 1), ("middle", zone // 2 + 1), ("last", zone)):
            for sign in (-1, 1):
                for data in (3, 12):
                    pulses = m.word(answer_word(data))
                    extra = (n * t.half + t.late + where, sign)
                    try:
                        m.train(f"answer {data:X}, {part} clock of the dead zone after window {n}, "
                                f"{'+' if sign > 0 else '-'}", [*pulses, extra], width=t.filter)
                    except Ambiguous:
                        continue
    for n in range(1, 12):   # window n gets the pulse of window n + 1 as well: alternation holds
        found = [(data, index) for data, index in _with_window(m, n) if n % 2 == 0 and data % 5 == n % 5 % 4]
        for data, index in found or list(_with_window(m, n))[:1]:
            pulses = m.word(answer_word(data))
            if index + 1 == len(pulses):
                continue
            moved = _moved(pulses, index + 1, n * t.half + m.us(1.125) - pulses[index + 1][0])
            moved = _moved(moved, index, -m.us(0.75))
            m.train(f"two pulses in window {n}, answer {data:X}", moved, width=t.filter)
    for n in range(1, 12):   # a pair more: one fits into a dead zone, the other comes in the next window
        for data, index in list(_with_window(m, n))[1:2]:
            pulses = m.word(answer_word(data))
            sign = pulses[index][1]
            pair = [(n * t.half + m.us(1.25), -sign), (n * t.half + m.us(2.5), sign)]
            try:
                m.train(f"a pair more after window {n}, answer {data:X}", [*pulses, *pair], width=t.filter)
            except Ambiguous:
                continue


@group("C-BOT", "RX-003, RX-008")
def both_lines(m):
    """Both comparators at once: never a good answer; which check names it is open"""
    for data in (0, 3, 6, 15):
        pulses = m.word(answer_word(data))
        for index, (time, sign) in enumerate(pulses):
            m.train(f"answer {data:X}, both lines at pulse {index + 1}", [*pulses, (time, -sign)])


# --------------------------------------------------------------------------------------------- filter
@group("C-FLT", "RX-009")
def glitches(m):
    """Pulses around the filter's 750 ns: on a quiet line, inside answers, as whole answers, on both lines"""
    t = m.times
    widths = [(w, f"{w - t.filter:+} clocks") for w in range(t.filter - 2, t.filter + 3)]
    for width, name in widths:
        margin = t.filter - 1 - width if width < t.filter else width - t.filter
        for data in (0, 5, 9, 15):
            m.train(f"answer {data:X} of pulses of 750 ns {name}", m.word(answer_word(data)), width=width,
                    want=OK if width >= t.filter else NO_RESPONSE, margin=margin)
        for sign in (-1, 1):
            m.add(f"{'+' if sign > 0 else '-'} 750 ns {name} while nothing answers",
                  [(t.us(30), sign, width)], margin=margin,
                  want=NO_RESPONSE if width < t.filter else START if sign > 0 else NO_INFORMATION)
            m.add(f"{'+' if sign > 0 else '-'} 750 ns {name} before the window opens", [(t.us(9), sign, width),
                  *m.answer(7)], margin=margin, want=OK if width < t.filter else EARLY)
            m.add(f"{'+' if sign > 0 else '-'} 750 ns {name} in the gap",
                  [*m.answer(7), (t.us(SYNC + 46), sign, width)], margin=margin, want=OK)
            m.add(f"{'+' if sign > 0 else '-'} 750 ns {name} in the length window",
                  [*m.answer(7), (t.us(SYNC + 40), sign, width)], margin=margin,
                  want=OK if width < t.filter else LENGTH)
            m.add(f"{'+' if sign > 0 else '-'} 750 ns {name} between the request and its length limit",
                  [(t.us(4), sign, width), *m.answer(7)], margin=margin, want=OK if width < t.filter else BAD_MASTER)
    for width in (1, 2, t.filter // 2, t.filter - 1):
        for n in range(1, 12):
            data = next(d for d in range(16) if all(time != n * t.half for time, _ in m.word(answer_word(d)))) \
                if any(all(time != n * t.half for time, _ in m.word(answer_word(d))) for d in range(16)) else None
            where = n * t.half if data is not None else n * t.half + m.us(1.5)
            for sign in (-1, 1):
                pins = m.answer(data if data is not None else 6)
                glitch = (m.us(SYNC) + where, sign, width)
                try:
                    m.add(f"glitch {'+' if sign > 0 else '-'} of {width} clocks at window {n}", [*pins, glitch],
                          want=OK)
                except Ambiguous:
                    continue
    for width in (t.filter - 1, t.filter):
        m.add(f"both lines {width} clocks while nothing answers", [(t.us(30), -1, width), (t.us(30), 1, width)],
              want=NO_RESPONSE if width < t.filter else None)
    for width in (1.25, 1.5, 2, 2.25):
        m.train(f"answer 4 of pulses of {width} us", m.word(answer_word(4)), width=m.us(width), want=OK)
    for width in (0.75, 0.875, 1.5, 2, 2.25):
        m.add(f"own request heard as pulses of {width} us",
              m.answer(4) + m.pins(m.word(request_word(ADRA7)), -t.request, m.us(width)), call=ADRA7, echo=None,
              want=OK)


# --------------------------------------------------------------------------------------------- response window
@group("C-OPN", "LT-002, LT-006, RX-012")
def window_opens(m):
    """Pulses and answers around the opening of the response window and the end of the read-back, clock by clock"""
    t = m.times
    for beyond in range(-2, 3):
        margin = beyond if beyond >= 0 else -beyond - 1
        m.add(f"answer at 12 us {beyond:+} clocks", m.pins(m.word(answer_word(9)), t.open + beyond),
              want=EARLY if beyond < 0 else OK, margin=margin)
        m.add(f"- at 12 us {beyond:+} clocks", m.pins([(t.open + beyond, -1)]),
              want=EARLY if beyond < 0 else NO_INFORMATION, margin=margin)
        m.add(f"+ at 12 us {beyond:+} clocks", m.pins([(t.open + beyond, 1)]), want=EARLY if beyond < 0 else START,
              margin=margin)
        for sign in (-1, 1):
            for delay in (0, 0.5, 1):
                m.add(f"{'+' if sign > 0 else '-'} at 7.5 us {beyond:+} clocks, echo {delay} us",
                      m.pins([(t.length + m.us(delay) + beyond, sign)]) + m.answer(2) + m.own(E1, m.us(delay)), call=E1,
                      echo=None, want=EARLY if beyond > 0 else BAD_MASTER, needs=("read_back",),
                      margin=beyond - 1 if beyond > 0 else -beyond)
    for at in (9, 9.5, 10, 10.5, 11, 11.5):
        for sign in (-1, 1):
            m.add(f"{'+' if sign > 0 else '-'} at {at} us and an answer", m.pins([(m.us(at), sign)]) + m.answer(2),
                  want=EARLY)
        m.add(f"answer at {at} us", m.answer(4, at), want=EARLY)


@group("C-TMO", "LT-003, LT-005, LT-006, RX-011, RX-013")
def time_out(m):
    """Answers and pulses around the time-out, clock by clock; silence; late answers and what follows them"""
    t = m.times
    m.add("silence", [], want=NO_RESPONSE)
    for beyond in range(-2, 3):
        margin = -beyond if beyond <= 0 else beyond - 1
        for data in (0, 15):
            m.add(f"answer {data:X} at 66 us {beyond:+} clocks", m.pins(m.word(answer_word(data)), t.timeout + beyond),
                  want=NO_RESPONSE if beyond > 0 else OK, margin=margin)
        m.add(f"+ at 66 us {beyond:+} clocks", m.pins([(t.timeout + beyond, 1)]),
              want=NO_RESPONSE if beyond > 0 else START, margin=margin)
        m.add(f"- at 66 us {beyond:+} clocks", m.pins([(t.timeout + beyond, -1)]),
              want=NO_RESPONSE if beyond > 0 else NO_INFORMATION, margin=margin)
    m.add("E12: answer 3 at 70 us", m.answer(3, 70), want=NO_RESPONSE)
    for at in (66.5, 67, 68, 69, 70, 70.5):
        for sign in (-1, 1):
            m.add(f"{'+' if sign > 0 else '-'} at {at} us", m.pins([(m.us(at), sign)]), want=NO_RESPONSE)
    for at in (12, 15, 21.25, 21.75, 25, 30, 33.25, 33.75, 40, 45, 55, 60, 63, 65):
        m.add(f"answer D at {at} us", m.answer(13, at), want=OK)


# --------------------------------------------------------------------------------------------- two slaves
@group("C-TWO", "RX-002, RX-003, RX-008")
def two_slaves(m):
    """Two answers at once: the same and different data, together and shifted by 1 clock to 12 us"""
    t = m.times
    for shift in (0, 1, 2, t.us(0.25), t.us(0.5), t.us(0.75), t.us(1), t.us(1.5), t.us(1.75), t.us(2), t.us(3), t.us(6),
                  t.us(12)):
        for one, two in ((5, 5), (0, 0), (15, 15), (0, 15), (3, 12), (6, 9), (1, 2), (7, 8), (10, 5), (15, 0)):
            try:
                m.add(f"answers {one:X} and {two:X}, the second {shift} clocks later",
                      m.answer(one) + m.pins(m.word(answer_word(two)), t.us(SYNC) + shift))
            except Ambiguous:
                continue


# --------------------------------------------------------------------------------------------- own request read back
@group("C-OWN", "RX-014, RX-002, RX-004, RX-007")
def read_back(m):
    """Own request: pulses missing or turned, each bit another, a pulse more, no echo, late echo; faults in pairs"""
    t = m.times

    def damaged(title, own, answer=(), call=E1, want=BAD_MASTER, width=None, **fields):
        m.add(title, m.pins(own, -t.request, width) + list(answer), call=call, echo=None, want=want,
              needs=("read_back",), **fields)
    for call in (E1, ADRA7):
        pulses = m.word(request_word(call))
        for index in range(len(pulses)):
            damaged(f"{call:03X}: pulse {index + 1} missing", _without(pulses, index), m.answer(index & 15), call)
            damaged(f"{call:03X}: pulse {index + 1} turned", _flipped(pulses, index), call=call)
            damaged(f"{call:03X}: pulse {index + 1} turned and late by a clock",
                    _moved(_flipped(pulses, index), index, 1), call=call)
    for index in range(1, 20, 3):
        damaged(f"pulses from {index + 1} on missing", m.word(request_word(RDID5))[:index], m.answer(1), RDID5)
    for bit in range(11):
        other = E1 ^ 1 << bit
        damaged(f"another request: payload bit {bit}", m.word(request_word(other)), m.answer(bit))
        word = request_word(E1)
        damaged(f"payload bit {bit} turned, parity kept", m.word(request_word(other)[:12] + word[12:]), m.answer(bit))
    word = request_word(E1)
    damaged("parity bit turned", m.word(word[:12] + "11"), m.answer(1))
    damaged("end bit 0", m.word(word[:13] + "0"), m.answer(1))
    damaged("start bit 1", m.word("1" + word[1:]), m.answer(1))
    damaged("turned as a whole", [(time, -s) for time, s in m.word(word)], m.answer(1))
    for at in (80, 81, 82.5, 84, 85.5):
        for sign in (-1, 1):
            damaged(f"{'+' if sign > 0 else '-'} {at - 78} us after its end", [*m.word(word), (m.us(at), sign)],
                    m.answer(3))
    for n in range(0, 26, 3):
        before = [sign for time, sign in m.word(word) if time <= n * t.half][-1]
        damaged(f"a pulse more in the dead zone after window {n}",
                [*m.word(word), (n * t.half + m.us(1.75), before)], m.answer(n & 15), width=t.filter)
    damaged("nothing heard, silence", [])
    damaged("nothing heard, answer", [], m.answer(6))
    damaged("nothing heard, parity error", [], m.pins(m.word("0011011"), m.us(SYNC)))
    damaged("nothing heard, early pulse", [], m.pins([(m.us(11), -1)]))
    for beyond in range(-2, 3):
        damaged(f"echo after 3 us {beyond:+} clocks", [(time + t.echo_max + beyond, s) for time, s in m.word(word)],
                m.answer(6), want=BAD_MASTER if beyond > 0 else OK, margin=-beyond if beyond <= 0 else beyond - 1)
    damaged("bad, silence: time-out and its gap", _without(m.word(word), 4))
    damaged("bad, answer with an error: gap of an error", _without(m.word(word), 4), m.pins(m.word("0011011"),
                                                                                          m.us(SYNC)))
    damaged("bad, early pulse: gap of an error", _without(m.word(word), 4), m.pins([(m.us(10), 1)]))
    damaged("bad, answer too late", _without(m.word(word), 4), m.answer(2, 70))
    # what one check alone can see: nothing else is wrong with these
    for call in (E1, ADRA7):
        pulses = m.word(request_word(call))
        for index in range(1, len(pulses) - 1):
            time, before = pulses[index][0], pulses[index][0] - pulses[index - 1][0]
            damaged(f"{call:03X}: pulses {index + 1} and {index + 2} missing", _without(pulses, index, index + 1),
                    m.answer(index & 15), call)
            if time // t.half % 2:
                for by in (-1, 1):
                    damaged(f"{call:03X}: boundary pulse {index + 1} missing, the next one moved by {by:+} clock",
                            _without(_moved(pulses, index + 1, by), index), m.answer(index & 15), call)
            if before == 2 * t.half and pulses[index + 1][0] - time == t.half:
                early = m.us(-4.25)
                damaged(f"{call:03X}: pulses {index + 1} and {index + 2} early, in the dead zones of one bit before",
                        _moved(_moved(pulses, index, early), index + 1, early), m.answer(index & 15), call,
                        width=t.filter)


@group("C-OWW", "RX-003, RX-014")
def read_back_windows(m):
    """Own request: each of its pulses at both limits of its window, one clock inside to one clock outside"""
    t = m.times
    covered = {}
    for call in (ADRA7, E1, DEXG31, RDID5, 0x555, 0x7F5):
        for index, (time, _) in enumerate(m.word(request_word(call))):
            covered.setdefault(time // t.half, (call, index))
    for n in range(1, 27):
        call, index = covered[n]
        pulses = m.word(request_word(call))
        for side, limit, out in _edges(t):
            for beyond in (-1, 0, 1):
                m.add(f"{call:03X} window {n} {side} limit {beyond:+} clocks",
                      m.pins(_moved(pulses, index, limit + out * beyond), -t.request) + m.answer(n & 15), call=call,
                      echo=None, want=BAD_MASTER if beyond > 0 else OK, needs=("read_back",),
                      margin=abs(beyond) if beyond <= 0 else 0)


# --------------------------------------------------------------------------------------------- gaps
@group("C-GAP", "LT-004, LT-005, LT-006, LT-009")
def gaps(m):
    """Gaps: end pulse at its limits; after each class; restarted by pulses at many places, also after their end"""
    t = m.times
    for data in (0, 1, 6, 15):
        for move in (-t.early, -1, 1, t.late):
            pulses = m.word(answer_word(data))
            m.train(f"answer {data:X}, end pulse moved by {move} clocks", _moved(pulses, len(pulses) - 1, move),
                    want=OK)
    kinds = (("good", m.answer(5), SYNC + 36), ("parity", m.pins(m.word("0010001"), m.us(SYNC)), SYNC + 36),
             ("silence", [], 53.5), ("early", m.pins([(m.us(10), -1)]), 10),
             ("length", m.answer(5) + m.pins([(m.us(SYNC + 40), -1)]), SYNC + 40),
             ("one pulse", m.pins([(m.us(SYNC), -1)]), SYNC + 20), ("late", m.answer(3, 70), 70 + 36))
    for name, pins, last in kinds:
        for after in (10, 12, 14, 16, 16.5, 17):
            for sign in (-1, 1):
                m.add(f"{name}, {'+' if sign > 0 else '-'} {after} us later",
                      pins + m.pins([(m.us(last + after), sign)]))
        m.add(f"{name}, then four pulses 20 us apart",
              pins + m.pins([(m.us(last + 14 + 20 * k), 1 if k % 2 else -1) for k in range(4)]))
        m.add(f"{name}, then an answer of somebody", pins + m.answer(8, last + 15))
    for after in (20, 22, 23):
        m.add(f"parity, - {after} us later", [*m.pins(m.word("0010001"), m.us(SYNC)),
                                             (m.us(SYNC + 36 + after - 1), -1, m.us(1))])


@group("C-LAT", "LT-009")
def late_requests(m):
    """Requests offered after the gap: the whole lead of tx_en"""
    m.add("offered in the gap", m.answer(1), want=OK)
    for at in (0.5, 1, 5, 20, 100, 333):
        for pins in ([], m.answer(1), m.pins(m.word("0010001"), m.us(SYNC))):
            m.add(f"offered {at} us after the gap", pins, kind="late", at=m.us(at))


@group("C-BAB", "LT-007")
def babble(m):
    """A line that never gets quiet: the next request comes after 1 ms"""
    for period in (5, 10, 15, 20, 22):
        for name, first in (("from the answer on", SYNC), ("from before the window on", 10)):
            decided = first + 43.5 if first == SYNC else first
            count = int((decided + 1000 - 2 - first) / period) + 1   # none in the clocks before the next request
            pulses = [(m.us(first + period * k), 1 if k % 2 else -1) for k in range(count)]
            m.add(f"a pulse each {period} us {name}", m.pins(pulses))


@group("C-IDL", "LT-008")
def idle(m):
    """First request after a stop: 60 us of quiet, restarted by pulses"""
    for noise in ((), (10,), (59,), (10, 50), (30, 60, 90), (5, 25, 45, 65), (58, 116)):
        for sign in (-1, 1):
            m.add(f"pulses {noise} us after the start", [(m.us(at), sign * (1 if k % 2 else -1), m.us(1))
                                                         for k, at in enumerate(noise)], kind="idle", want=NO_RESPONSE)


@group("C-ABO", "LT-011")
def abort(m):
    """Stop while a call is open: ABORTED, and the request on the line is completed"""
    for at in (-77, -60, -40, -20, -3, 0, 2, 5, 9, 12, 20, 22, 30, 50, 57, 63):
        m.add(f"stop {at} us after the own last edge", m.answer(5), kind="abort", at=m.us(at), needs=("abort",))


# --------------------------------------------------------------------------------------------- repetitions, broadcasts
def _failures(m):
    """(class, pins) for each class that a repetition can follow, and good answers"""
    word = answer_word(5)
    own = m.pins(m.word(word), m.us(SYNC))
    return {
        NO_RESPONSE: [], START: m.pins([(0, 1)], m.us(SYNC)),
        ALTERNATION: m.pins(_flipped(m.word(word), 3), m.us(SYNC)),
        TIMING: m.pins(_moved(m.word(word), 3, m.us(1.75)), m.us(SYNC)), NO_INFORMATION: own[:4],
        END_BIT: m.pins(m.word(word[:6] + "0"), m.us(SYNC)), PARITY: m.pins(m.word(word[:5] + "11"), m.us(SYNC)),
        LENGTH: own + m.pins([(m.us(SYNC + 39), -1)]), EARLY: m.pins([(m.us(11), -1)]),
    }


@group("C-REP", "LT-006, LT-012, RX-008")
def repetitions(m):
    """Repetitions: each class first, then each class or a good answer; 0 to 3 repetitions; all fail"""
    failures = _failures(m)
    for name, pins in failures.items():
        m.add(f"{name}, no repetition", pins, retries=0, want=name)
        for retries in (1, 2, 3):
            m.add(f"{name}, then good, {retries} allowed", pins, m.answer(9), retries=retries, want=OK,
                  needs=("retries",))
        m.add(f"{name} four times", pins, pins, pins, pins, retries=3, want=name, needs=("retries",))
        for second, more in failures.items():
            m.add(f"{name}, then {second}", pins, more, retries=1, want=second, needs=("retries",))
    for retries in (2, 3):
        chain = [failures[PARITY], failures[NO_RESPONSE], failures[LENGTH]][:retries]
        m.add(f"{retries} failures, then good", *chain, m.answer(3), retries=retries, want=OK, needs=("retries",))
    for retries in range(4):
        m.add(f"good at once, {retries} allowed", m.answer(12), retries=retries, want=OK)


@group("C-BRC", "RX-008, LT-005, LT-006")
def broadcasts(m):
    """Calls without an answer: silence is success; an answer or a disturbance is judged as always"""
    for call in (BR01, 0x400, E1, 0x7FF, 0x000):
        m.add("silence", [], call=call, no_reply=True, want=OK)
        m.add("silence, repetitions allowed", [], call=call, no_reply=True, retries=2, want=OK)
        m.add("an answer", m.answer(6), call=call, no_reply=True, want=OK)
        for name, pins in _failures(m).items():
            if name != NO_RESPONSE:
                m.add(f"{name}", pins, call=call, no_reply=True, want=name)
        m.add("disturbed, then silence", m.pins([(m.us(30), 1)]), [], call=call, no_reply=True, retries=1, want=OK,
              needs=("retries",))


# --------------------------------------------------------------------------------------------- all requests
@group("C-REQ", "TL-001, TL-003, TL-004, TL-005, LT-001, LT-005, RX-014")
def requests(m):
    """All 2048 payloads: the pulse grid on tx_man, and the echo is good"""
    for number in range(2048):
        call = number * 0x2B5 & 0x7FF   # odd factor: every payload once, neighbours differ in many bits
        m.add(f"payload {call:03X}", [], call=call, want=NO_RESPONSE)
