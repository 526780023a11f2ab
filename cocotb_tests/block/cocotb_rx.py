# SPDX-License-Identifier: Apache-2.0
"""Receiver. A telegram is a list of (clock after the first pulse, polarity); classify() is the rules once more, in
Python."""
import random

import cocotb
from asi import telegram
from asi.regmap import ErrorClass
from cocotb_tests.block.phy_bench import now, start, to_clocks, until, wait, watch


class Grid:
    """The receiver's times in clocks."""

    def __init__(self, dut):
        self.hz = int(dut.ClkHz.value)
        self.bits = int(dut.Bits.value)
        self.half, self.early, self.late = (ns * self.hz // 10**9 for ns in (3000, 875, 1500))
        self.end = 2 * (self.bits - 1)                              # window of the end pulse
        self.decision = (self.end + 2) * self.half + self.late      # 43.5 us in a response

    def pulses(self, payload):
        word = telegram.request_word(payload) if self.bits == 14 else telegram.response_word(payload)
        return to_clocks(telegram.pulses(word, self.bits), self.hz)

    def window(self, clock):
        """-> n of the window that holds clock, None in the dead zone"""
        n, phase = divmod(clock + self.early, self.half)
        return n if phase <= self.early + self.late else None

    def classify(self, pulses):
        """RX-001 .. RX-008 -> (ErrorClass, payload or None)"""
        heard = [p for p in pulses if p[0] <= self.decision]
        windows = [self.window(t) for t, _ in heard]
        ends = [k for k, n in enumerate(windows) if n == self.end]
        body = heard[:ends[0] + 1] if ends else heard  # after the end pulse only the length counts
        inner = windows[1:len(body)]
        bits = {n: int(p > 0) for n, (_, p) in zip([0, *inner], body)}
        if body[0][1] > 0:
            return ErrorClass.START, None
        if any(a[1] == b[1] for a, b in zip(body, body[1:])):
            return ErrorClass.ALTERNATION, None
        if any(n is None or not 1 <= n <= self.end for n in inner) or len(set(inner)) != len(inner):
            return ErrorClass.TIMING, None
        if any(2 * n not in bits for n in range(1, self.bits)):
            return ErrorClass.NO_INFORMATION, None
        if not bits[self.end]:
            return ErrorClass.END_BIT, None
        if sum(bits[2 * n] for n in range(1, self.bits - 1)) % 2:
            return ErrorClass.PARITY, None
        if len(heard) > len(body):
            return ErrorClass.LENGTH, None
        return ErrorClass.OK, sum(bits[2 * n] << (self.bits - 3 - n) for n in range(1, self.bits - 2))

    def deviation(self, pulses):
        """RX-015 -> (largest distance from the grid up to the end pulse, late); half way between two points is late."""
        best = 0
        for t, _ in pulses:
            if t > self.decision:
                break
            offset = t % self.half
            offset -= self.half if offset > self.half // 2 else 0
            best = offset if abs(offset) > abs(best) else best
            if self.window(t) == self.end:
                break
        return abs(best), int(best > 0)


class TB:
    def __init__(self, dut):
        self.dut, self.grid = dut, Grid(dut)

    async def start(self):
        await start(self.dut, n_start_i=0, p_start_i=0, en_i=1)
        self.first = watch(self.dut.first_o)
        self.done = watch(self.dut.done_o, self.dut.class_o, self.dut.data_o, self.dut.dev_o, self.dut.dev_late_o)
        return self

    async def pulses(self, pulses):
        """Strobes of one telegram -> clock of the first one."""
        await wait(1)
        first = now()
        for clock, polarity in pulses:
            await until(first + clock)
            pin = self.dut.p_start_i if polarity > 0 else self.dut.n_start_i
            pin.value = 1
            await wait(1)
            pin.value = 0
        return first

    async def receive(self, pulses):
        """One telegram in, one decision out, at its time -> (class, data)."""
        self.first.clear()
        self.done.clear()
        first = await self.pulses(pulses)
        await until(max(now(), first + self.grid.decision + 2))
        assert self.first == [(first,)], f"first pulse: {self.first}, {pulses}"
        assert len(self.done) == 1 and self.done[0][0] == first + self.grid.decision, f"{self.done}, {first}, {pulses}"
        assert self.done[0][3:] == self.grid.deviation(pulses), f"{self.done}, {self.grid.deviation(pulses)}, {pulses}"
        return ErrorClass(self.done[0][1]), self.done[0][2]

    async def expect(self, pulses, error, data=None):
        """The class asked for, from the receiver and from classify() alike."""
        pulses = sorted(pulses)
        model = self.grid.classify(pulses)
        assert model[0] == error, f"model says {model}, test {error}: {pulses}"
        seen = await self.receive(pulses)
        assert seen[0] == error, f"{seen[0]} instead of {error}: {pulses}"
        assert data is None or seen[1] == data, f"data {seen[1]:#x} instead of {data:#x}: {pulses}"

    def e3(self):
        """E3, answer 0011: -0 +3 -6 +9 -12 +18 -21 +24 -30 +36, as {time in us: polarity}"""
        train = {0: -1, 3: 1, 6: -1, 9: 1, 12: -1, 18: 1, 21: -1, 24: 1, 30: -1, 36: 1}
        assert self.clocks(train) == self.grid.pulses(0b0011)
        return train

    def word(self, word):
        """Pulses of a 7-bit word, legal or not."""
        return to_clocks(telegram.pulses(word, 7), self.grid.hz)

    def clocks(self, train):
        return sorted((round(t * self.grid.hz / 10**6), p) for t, p in train.items())


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def good(dut):
    """TL-002, TL-006, RX-005, RX-006, RX-007: every good telegram (E3, E4, E5 among the answers) gives OK and its
    payload."""
    tb = await TB(dut).start()
    for payload in range(16) if tb.grid.bits == 7 else range(0, 2048, 37):
        await tb.expect(tb.grid.pulses(payload), ErrorClass.OK, payload)


@cocotb.test(timeout_time=100, timeout_unit="ms")
async def windows(dut):
    """RX-003, RX-010: each window n, one pulse moved clock by clock from dead zone to dead zone: legal exactly from
    -0.875 us to +1.5 us of the grid of the first pulse."""
    tb = await TB(dut).start()
    grid = tb.grid
    for n in range(1, grid.end + 1):
        payload = next(p for p in range(2 ** (grid.bits - 3)) if any(t == n * grid.half for t, _ in grid.pulses(p)))
        pulses = grid.pulses(payload)
        position = [t for t, _ in pulses].index(n * grid.half)
        for offset in range(-(grid.half - grid.late - 1), grid.half - grid.early):
            moved = list(pulses)
            moved[position] = (n * grid.half + offset, pulses[position][1])
            if -grid.early <= offset <= grid.late:
                await tb.expect(moved, ErrorClass.OK, payload)
            else:
                await tb.expect(moved, ErrorClass.TIMING)


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def drifting_grid(dut):
    """RX-010: pulses that drift are judged against the first one only; all at the early or all at the late limit is
    legal."""
    tb = await TB(dut).start()
    pulses = tb.grid.pulses(0b0110)
    for limit in (-tb.grid.early, tb.grid.late):
        await tb.expect([pulses[0]] + [(t + limit, p) for t, p in pulses[1:]], ErrorClass.OK, 0b0110)
    # spaced exactly 3 us from each other, but the later ones are out of the grid of the first
    late = tb.grid.late + 1
    shifted = [(t + (late if k > 3 else 0), p) for k, (t, p) in enumerate(pulses)]
    await tb.expect(shifted, ErrorClass.TIMING)


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def deviation(dut):
    """RX-015: each pulse in turn early and late by one clock, by the limit of its window and by one clock more; the
    largest one counts, with its sign, and of two equal ones the first; no pulse after the end pulse does."""
    tb = await TB(dut).start()
    grid = tb.grid
    pulses = grid.pulses(5)
    seen = set()

    async def expect(moves, deviation, late, *after):
        moved = [(t + moves.get(k, 0), p) for k, (t, p) in enumerate(pulses)] + list(after)
        assert grid.deviation(moved) == (deviation, late), (moves, grid.deviation(moved))
        seen.add((await tb.receive(moved))[0])
    await expect({}, 0, 0)
    for k in range(1, len(pulses)):
        for move in (1, grid.late, grid.late - 1):
            await expect({k: move}, move, 1)
        await expect({k: grid.late + 1}, grid.half - grid.late - 1, 0)  # nearer to the next grid point
        for move in (1, grid.early - 1, grid.early, grid.early + 1):
            await expect({k: -move}, move, 0)
    assert seen == {ErrorClass.OK, ErrorClass.TIMING}
    await expect({1: 2, 2: -3, 3: 1}, 3, 0)
    await expect({1: -2, 2: 3, 3: -1}, 3, 1)
    await expect({1: 2, 2: -2}, 2, 1)
    await expect({1: -2, 2: 2}, 2, 0)
    await expect({len(pulses) - 1: -1}, 1, 0, (grid.end * grid.half + grid.late, 1))
    # without an end pulse every pulse counts, one in the last clock included
    lost = [*pulses[:-1], (grid.decision, 1)]
    assert grid.deviation(lost) == (grid.late, 1)
    await tb.receive(lost)


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def start_error(dut):
    """RX-001: a telegram that begins with a positive pulse is a start error, alone and with everything else inverted
    too."""
    tb = await TB(dut).start()
    e3 = tb.e3()
    await tb.expect(tb.clocks({**e3, 0: 1}), ErrorClass.START)
    await tb.expect(tb.clocks({t: -p for t, p in e3.items()}), ErrorClass.START)
    await tb.expect([(0, 1)], ErrorClass.START)


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def alternation_error(dut):
    """RX-002: two neighbours of one polarity, at each place of the telegram."""
    tb = await TB(dut).start()
    e3 = tb.e3()
    for t in list(e3)[1:-1]:
        await tb.expect(tb.clocks({**e3, t: -e3[t]}), ErrorClass.ALTERNATION)
    await tb.expect(tb.clocks({t: p for t, p in e3.items() if t != 3}), ErrorClass.ALTERNATION)


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def timing_error(dut):
    """RX-003: a pulse in a dead zone, a second pulse in one window, both polarities at once."""
    tb = await TB(dut).start()
    grid, e3 = tb.grid, tb.e3()
    await tb.expect(tb.clocks({**{t: p for t, p in e3.items() if t != 21}, 19.75: -1}), ErrorClass.TIMING)
    # alternation holds, but window 1 holds three pulses
    await tb.expect(tb.clocks({**e3, 3.5: -1, 4.25: 1}), ErrorClass.TIMING)
    # a pulse right behind the first one, inside the tolerance of window 0; the missing one keeps the alternation
    await tb.expect(tb.clocks({**{t: p for t, p in e3.items() if t != 3}, 1: 1}), ErrorClass.TIMING)
    # both strobes in one clock: one of them is one too many
    pulses = tb.clocks(e3)
    tb.done.clear()
    first = now()
    for clock, polarity in pulses:
        await until(first + clock)
        dut.n_start_i.value, dut.p_start_i.value = int(polarity < 0 or clock == 6 * grid.half), int(polarity > 0)
        await wait(1)
        dut.n_start_i.value, dut.p_start_i.value = 0, 0
    await until(first + grid.decision + 2)
    assert [d[1] for d in tb.done] == [ErrorClass.TIMING]


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def no_information_error(dut):
    """RX-004: an empty bit window, for each bit; alternation is kept by dropping a neighbour too."""
    tb = await TB(dut).start()
    grid = tb.grid
    for n in range(2, grid.end + 1, 2):
        found = 0
        for payload in range(16):
            pulses = grid.pulses(payload)
            position = [t for t, _ in pulses].index(n * grid.half)
            # two neighbours of opposite polarity go, so the rest still alternates; the other one must not be a bit
            # pulse
            for other in (position - 1, position + 1):
                if 0 < other < len(pulses) and pulses[other][0] // grid.half % 2:
                    await tb.expect([p for k, p in enumerate(pulses) if k not in (position, other)],
                                    ErrorClass.NO_INFORMATION)
                    found += 1
        assert found or n == grid.end, n
    await tb.expect([p for p in grid.pulses(3) if p[0] < grid.end * grid.half], ErrorClass.NO_INFORMATION)
    await tb.expect([(0, -1)], ErrorClass.NO_INFORMATION)


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def end_bit_error(dut):
    """RX-006: a telegram whose last bit is 0 but is legal otherwise."""
    tb = await TB(dut).start()
    for payload in range(16):
        await tb.expect(tb.word(telegram.response_word(payload) & ~1), ErrorClass.END_BIT)


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def parity_error(dut):
    """RX-005: the wrong parity bit, for every payload, and one wrong data bit."""
    tb = await TB(dut).start()
    for payload in range(16):
        for bit in (2, 4, 32):
            await tb.expect(tb.word(telegram.response_word(payload) ^ bit), ErrorClass.PARITY)


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def length_error(dut):
    """RX-007: a pulse of either polarity after the end pulse, from the next clock to 43.5 us inclusive; one clock
    later it is no part of the telegram. The end pulse may come early or late."""
    tb = await TB(dut).start()
    grid = tb.grid
    pulses = grid.pulses(0b0011)
    end = pulses[-1][0]
    for polarity in (-1, 1):
        for extra in (end + 2, end + grid.late, end + grid.late + 1, end + grid.half, grid.decision - 1, grid.decision):
            await tb.expect([*pulses, (extra, polarity)], ErrorClass.LENGTH)
        for moved in (end - grid.early, end + grid.late):
            await tb.expect([*pulses[:-1], (moved, 1), (grid.decision, polarity)], ErrorClass.LENGTH)
    # the pulse one clock after the window: the decision stands, and the pulse is the first of the next telegram
    tb.done.clear()
    tb.first.clear()
    first = await tb.pulses([*pulses, (grid.decision + 1, -1)])
    await until(first + 2 * grid.decision + 3)
    assert [d[1] for d in tb.done] == [ErrorClass.OK, ErrorClass.NO_INFORMATION]
    assert [f[0] for f in tb.first] == [first, first + grid.decision + 1]


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def examples_e12(dut):
    """RX-011, RX-008: the negative examples E12, each made from E3."""
    tb = await TB(dut).start()
    e3 = tb.e3()

    def without(*times):
        return {t: p for t, p in e3.items() if t not in times}
    await tb.expect(tb.clocks(without(24)), ErrorClass.ALTERNATION)  # and no information, which ranks lower
    await tb.expect(tb.clocks({**without(21), 19.8: -1}), ErrorClass.TIMING)
    await tb.expect(tb.clocks(without(21, 24)), ErrorClass.NO_INFORMATION)
    await tb.expect(tb.word(0b0001111), ErrorClass.PARITY)
    await tb.expect(tb.clocks({**e3, 39: -1}), ErrorClass.LENGTH)
    await tb.expect(tb.clocks({**e3, 0: 1}), ErrorClass.START)


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def reporting_order(dut):
    """RX-008: of two faults in one telegram the one earlier in the order is reported, wherever they happen."""
    tb = await TB(dut).start()
    e3 = tb.e3()
    us = tb.clocks
    positive = {0: 1}
    # a fault of each rank that leaves room for the lower ones; the length fault comes last in time, the parity fault
    # first
    await tb.expect(us({**e3, **positive, 19.75: -1}), ErrorClass.START)                                # + timing
    await tb.expect(us({**e3, **positive, 39: -1}), ErrorClass.START)                                   # + length
    await tb.expect(us({**e3, 9: -1, 19.75: -1}), ErrorClass.ALTERNATION)                               # + timing
    await tb.expect(us({t: p for t, p in e3.items() if t != 36}), ErrorClass.NO_INFORMATION)
    no_bit = {t: p for t, p in e3.items() if t not in (21, 24)}
    await tb.expect(us({**{t: p for t, p in no_bit.items() if t != 3}, 4.75: 1}), ErrorClass.TIMING)  # + no information
    await tb.expect(us({**no_bit, 39: -1}), ErrorClass.NO_INFORMATION)                                  # + length
    end0 = tb.word(telegram.response_word(3) & ~1)
    odd_end0 = tb.word(telegram.response_word(3) ^ 3)
    await tb.expect(odd_end0, ErrorClass.END_BIT)                                                       # + parity
    await tb.expect([*end0, (13 * tb.grid.half, 1)], ErrorClass.END_BIT)                                # + length
    odd = tb.word(telegram.response_word(3) ^ 2)
    await tb.expect([*odd, (13 * tb.grid.half, -1)], ErrorClass.PARITY)                                 # + length


@cocotb.test(timeout_time=100, timeout_unit="ms")
async def random_faults(dut):
    """RX-001 .. RX-008: telegrams with up to four random faults get the class the rules give; every class occurs."""
    tb = await TB(dut).start()
    grid, rng = tb.grid, random.Random(1)
    count = {error: 0 for error in ErrorClass}
    for _ in range(1000):
        payload = rng.randrange(2 ** (grid.bits - 3))
        word = telegram.request_word(payload) if grid.bits == 14 else telegram.response_word(payload)
        if rng.random() < 0.3:
            word ^= 1 << rng.randrange(grid.bits)
        pulses = to_clocks(telegram.pulses(word, grid.bits), grid.hz)
        for _ in range(rng.choice((0, 1, 1, 2, 3))):
            kind, k = rng.randrange(5), rng.randrange(1, len(pulses)) if len(pulses) > 1 else 0
            t, p = pulses[k]
            if kind == 0 and k:
                del pulses[k]
            elif kind == 1 and k:
                pulses[k] = (t + rng.randint(-grid.half, grid.half), p)
            elif kind == 2:
                pulses[k] = (t, -p)
            elif kind == 3:
                pulses.append((rng.randint(1, grid.decision), rng.choice((-1, 1))))
            elif len(pulses) > 2 and k > 1:
                del pulses[k - 1:k + 1]
        pulses = sorted(dict((max(t, 1) if t else 0, p) for t, p in pulses).items())
        # strobes of one comparator have at least a clock between them
        pulses = [p for k, p in enumerate(pulses) if k == 0 or p[0] > pulses[k - 1][0] + 1]
        error, data = grid.classify(pulses)
        count[error] += 1
        await tb.expect(pulses, error, data)
    missing = [e.name for e in list(ErrorClass)[2:9] if count[e] < 5] if grid.bits == 7 else []
    assert not missing, f"these never came: {missing}, {count}"
    dut._log.info("classes: %s", {e.name: n for e, n in count.items() if n})


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def disabled(dut):
    """RX-012: with en_i low nothing is received, and a telegram that was begun is dropped without a decision."""
    tb = await TB(dut).start()
    dut.en_i.value = 0
    await tb.pulses(tb.grid.pulses(5))
    await wait(tb.grid.decision)
    assert tb.first == [] and tb.done == []
    dut.en_i.value = 1
    await tb.pulses(tb.grid.pulses(5)[:4])
    dut.en_i.value = 0
    await wait(1)
    dut.en_i.value = 1
    await wait(tb.grid.decision)
    assert tb.done == []
    await tb.expect(tb.grid.pulses(5), ErrorClass.OK, 5)
