# SPDX-License-Identifier: Apache-2.0
"""asi_xact with read-back: the own request as it comes back from the line, and what is reported of each attempt.

A *train* is what the line returns of a request: [(clock after the own first edge, polarity)].
"""
import cocotb
from asi import telegram
from asi.regmap import ErrorClass
from cocotb_tests.block.cocotb_xact import ABORTED, ASYNC, CALL, EARLY, NONE, OK, SYNC, TB
from cocotb_tests.block.phy_bench import now, to_clocks, until, wait, watch

BAD, PARITY = ErrorClass.BAD_MASTER, ErrorClass.PARITY
OTHER = telegram.encode_call("WPAR", 21, 0b0110)
GAPS = {OK: 18.5, PARITY: 24}  # us from the last pulse of an answer


class EchoTB(TB):
    """Nothing comes back but what the test sends."""

    async def start(self, **kwargs):
        assert self.read_back
        self.echo = None
        return await super().start(**kwargs)

    def train(self, call=CALL):
        return to_clocks(telegram.request_pulses(call), self.hz)

    async def send(self, edge, pulses, shift=0):
        for t, polarity in pulses:
            await self.pulse(edge + t + shift, polarity)

    async def reply(self, edge, kind):
        """Answer OK or PARITY, or NONE: no answer -> clock at which the next request has to start."""
        if kind == NONE:
            return edge + self.us(150)
        pulses = self.bad_parity(6) if kind == PARITY else None
        return await self.answer(edge + self.us(78 + SYNC), 6, pulses) + self.us(GAPS[kind])

    def attempt(self, error, call=CALL, sel=0, repeat=0, final=1):
        """Exactly one attempt since the last call of this, with these fields -> (delay, deviation, late)."""
        assert len(self.attempts) == 1, self.attempts
        _, index, *fields, delay, deviation, late = self.attempts.pop()
        assert index == sel << 5 | call >> 5 & 31 and fields == [error, repeat, final], (index, fields)
        return delay, deviation, late


def moved(train, k, clocks):
    return [(t + clocks if n == k else t, p) for n, (t, p) in enumerate(train)]


def damages(tb):
    """Name -> train that is not the request CALL."""
    train, half = tb.train(), tb.us(3)
    last, times = len(train) - 1, [t for t, _ in train]
    places = {"first": 0, "second": 1, "middle": len(train) // 2, "next to last": last - 1, "last": last}
    cases = {"nothing": [], "only the first": train[:1],
             "all swapped": [(t, -p) for t, p in train],
             "positive end pulse twice": [*train, (times[-1] + tb.us(2), 1)],
             "one window early": [(t - half, p) for t, p in train[1:]],
             "length, at its limit": [*train, (tb.us(78 + 7.5), -1)],
             "length, soon": [*train, (tb.us(78 + 3), -1)]}
    for name, k in places.items():
        cases[f"{name} missing"] = [p for n, p in enumerate(train) if n != k]
        cases[f"{name} swapped"] = [(t, -p if n == k else p) for n, (t, p) in enumerate(train)]
    for name in ("second", "middle", "last"):
        cases[f"{name} too late"] = moved(train, places[name], tb.us(1.5) + 1)
        cases[f"{name} too early"] = moved(train, places[name], -tb.us(0.875) - 1)
    empty = [k * half for k in range(1, 26) if k * half not in times]
    assert empty
    for t in (empty[0], empty[-1]):  # there is a pulse in every second window, so one of two alternates with neither
        cases[f"extra at {t}"] = sorted([*train, (t, 1)])
    # another comparator in the window of a pulse, and a pair that keeps the alternation
    cases["extra in a window"] = sorted([*train, (times[4] + tb.us(1), -train[4][1])])
    cases["extra pair"] = sorted([*train, *((times[4] + tb.us(t), sign * train[4][1]) for t, sign in ((0.75, -1),
                                                                                                      (1.875, 1)))])
    cases["both missing"] = [p for n, p in enumerate(train) if n not in (6, 7)]
    # legal requests that differ in one payload bit, and so in parity too, or in two
    for bit in range(11):
        cases[f"payload bit {bit}"] = tb.train(CALL ^ 1 << bit)
    cases["payload, same parity"] = tb.train(CALL ^ 0b11)
    cases["another call"] = tb.train(OTHER)
    return cases


@cocotb.test(timeout_time=100, timeout_unit="ms")
async def damaged(dut):
    """RX-014, LT-004, LT-005, LT-006: each kind of damage to the own request, with a good answer, a bad one and none:
    BAD_MASTER, and the gap is that of what was heard."""
    tb = EchoTB(dut)
    await tb.start()
    cases = damages(tb)
    assert len(cases) == len({tuple(train) for train in cases.values()}) and tb.train() not in cases.values()
    tb.offer()
    edge = await tb.request()
    for name, train in cases.items():
        for kind in (OK, PARITY, NONE):
            tb.offer()
            await tb.send(edge, train)
            expected = await tb.reply(edge, kind)
            before = edge
            edge = await tb.request()
            assert edge == expected, (name, kind, edge - before, expected - before)
            tb.result(BAD)
            tb.attempt(BAD)


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def intact(dut):
    """RX-014: what comes back as sent is good: at once, 3 us (P_ECHO_MAX) late, with each pulse at the limits of its
    window; one clock later than 3 us it is bad. The calls E1, E2, E6 .. E11 and words of each parity."""
    tb = EchoTB(dut)
    await tb.start()
    calls = [telegram.encode_call(*c) for c in (
        ("DEXG", 5, 10), ("WPAR", 31, 0), ("ADRA", 0, 7), ("RDIO", 17), ("RDID", 37), ("RES", 9), ("DELA", 1))]
    calls += [0, 0x7FF, 0x555, 0x2AA]
    cases = [(call, tb.train(call), OK) for call in calls]
    train = tb.train()
    for shift in (0, 1, tb.us(1), tb.us(3) - 1, tb.us(3)):
        cases.append((CALL, [(t + shift, p) for t, p in train], OK))
    for shift in (tb.us(3) + 1, tb.us(3.5)):
        cases.append((CALL, [(t + shift, p) for t, p in train], BAD))
    for k in (1, len(train) // 2, len(train) - 1):
        cases += [(CALL, moved(train, k, move), OK) for move in (tb.us(1.5), -tb.us(0.875))]
    for call, train, error in cases:
        for kind in (OK, NONE):
            await until(now() + tb.us(100))
            tb.offer(call)
            edge = await tb.request()
            await tb.send(edge, train)
            expected = await tb.reply(edge, kind)
            await until(expected)
            seen = error if error == BAD else kind
            tb.result(seen, data=6 if seen == OK else None)
            tb.attempt(seen, call)


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def noise_before(dut):
    """RX-014: a pulse that began one clock before the own first edge is not part of the request; in the clock of the
    edge it is."""
    tb = EchoTB(dut)
    await tb.start()
    for _ in range(4):
        tb.offer()
    edge, error = await tb.request(), OK
    for early in (1, tb.us(0.5), 0):
        await tb.send(edge, tb.train())
        following = await tb.reply(edge, OK)
        cocotb.start_soon(tb.pulse(following - early, 1))
        edge = await tb.request()
        assert edge == following
        tb.result(error)
        error = OK if early else BAD
    await tb.send(edge, tb.train())
    await until(await tb.reply(edge, OK))
    tb.result(error)


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def early(dut):
    """RX-014, LT-002, LT-006: a pulse between the decision over the own request and 12 us is EARLY after a good one and
    ends a BAD_MASTER attempt at once; either way 24 us of quiet follow. The decision moves with the echo."""
    tb = EchoTB(dut)
    await tb.start()
    tb.offer()
    edge = await tb.request()
    for shift in (0, tb.us(1), tb.us(3)):
        for good in (True, False):
            for late in (0, 1, tb.us(12) - tb.us(7.5) - shift - 1):
                train = tb.train() if good else tb.train(OTHER)
                tb.offer()
                await tb.send(edge, train, shift)
                extra = edge + tb.us(78 + 7.5) + shift + late
                await tb.pulse(extra, 1)
                following = await tb.request()
                # at the very limit it belongs to the request, which is followed by silence
                assert following == (extra + tb.us(24) if late else edge + tb.us(150)), (shift, good, late)
                edge = following
                tb.result(EARLY if good and late else BAD)
                tb.attempt(EARLY if good and late else BAD)
    # without an echo, or with one that is too late, the decision comes at 10.5 us
    for train in ([], [(t + tb.us(3) + 1, p) for t, p in tb.train()]):
        for late in (0, 1):
            tb.offer()
            await tb.send(edge, train)
            extra = edge + tb.us(78 + 10.5) + late
            await tb.pulse(extra, 1)
            following = await tb.request()
            assert following == (extra + tb.us(24) if late else edge + tb.us(150)), late
            edge = following
            tb.result(BAD)


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def repeated(dut):
    """RX-014, LT-012: a request that came back bad is repeated like any failure; the good answer to it is not taken,
    and each repetition is judged anew. One report per attempt."""
    tb = EchoTB(dut)
    await tb.start()
    for pattern, answers in (([BAD, OK], [OK, OK]), ([BAD, BAD], [OK, OK]), ([BAD, NONE], [NONE, NONE]),
                             ([NONE, BAD, OK], [NONE, NONE, OK]), ([PARITY, BAD, BAD, OK], [PARITY, PARITY, OK, OK]),
                             ([BAD, PARITY, BAD, BAD], [OK, PARITY, OK, NONE])):
        tb.offer(CALL, len(pattern) - 1, sel=1)
        for k, (error, kind) in enumerate(zip(pattern, answers)):
            edge = await tb.request()
            assert tb.results == []
            await tb.send(edge, tb.train(OTHER if error == BAD else CALL))
            expected = await tb.reply(edge, kind)
            await until(expected - 1)
            tb.attempt(error, sel=1, repeat=int(k > 0), final=int(k == len(pattern) - 1))
        first = pattern[0]
        tb.result(pattern[-1], first=first, repeats=len(pattern) - 1, data=6 if pattern[-1] == OK else None)
        await wait(tb.us(300))
        assert tb.results == [] and tb.attempts == []


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def broadcast(dut):
    """RX-014, ST-003: a broadcast that came back bad is BAD_MASTER and repeated; silence after a good one is success.
    Broadcasts are never reported as attempts."""
    tb = EchoTB(dut)
    await tb.start()
    call = telegram.encode_call("BR01")
    tb.offer(call, 2, no_reply=1)
    for train in (tb.train(OTHER), [], tb.train(call)):
        assert tb.results == []
        edge = await tb.request()
        await tb.send(edge, train)
    await wait(tb.us(150))
    tb.result(OK, first=BAD, repeats=2)
    tb.offer(call, 0, no_reply=1)
    await tb.request()
    await wait(tb.us(150))
    tb.result(BAD)
    assert tb.attempts == []


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def attempts(dut):
    """ST-001, RX-014: one report for each attempt, with its class, in the clock of the decision; the index is that of
    the request (number + 32 * Sel)."""
    tb = EchoTB(dut)
    await tb.start()
    for error in (OK, NONE, EARLY, ErrorClass.START, ErrorClass.ALTERNATION, ErrorClass.TIMING,
                  ErrorClass.NO_INFORMATION, ErrorClass.END_BIT, PARITY, ErrorClass.LENGTH, BAD):
        number, sel = 3 * error & 31, error & 1
        call = telegram.encode_call("RDIO", number)
        tb.offer(call, sel=sel)
        edge = await tb.request()
        await tb.send(edge, [] if error == BAD else tb.train(call))
        pulses = to_clocks(telegram.response_pulses(3), tb.hz)   # 0 3 6 9 12 18 21 24 30 36
        pulses = {
            NONE: [], EARLY: [(tb.us(10 - SYNC), 1)], ErrorClass.START: [(0, 1), *pulses[1:]],
            ErrorClass.ALTERNATION: pulses[:4] + pulses[5:], ErrorClass.TIMING: moved(pulses, 1, tb.us(1.5) + 1),
            ErrorClass.NO_INFORMATION: pulses[:6] + pulses[8:],
            ErrorClass.END_BIT: to_clocks(telegram.pulses(telegram.response_word(3) & ~1, 7), tb.hz),
            PARITY: tb.bad_parity(3), ErrorClass.LENGTH: [*pulses, (tb.us(39), -1)]}.get(error, pulses)
        if pulses:
            await tb.answer(edge + tb.us(78 + SYNC), pulses=pulses)
        await until(edge + tb.us(300))
        clock = tb.attempts[0][0]
        tb.attempt(error, call, sel)
        assert tb.result(error) == clock


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def aborted(dut):
    """ST-003, LT-011: an attempt that is cut off is not reported, wherever that happens, the clock of its decision
    included; those before it were."""
    tb = EchoTB(dut)
    await tb.start()
    delay = tb.us(0.75) + 2
    decided = (78 + SYNC + 43.5) * tb.hz / 10**6 + delay
    for clocks, reported in ((tb.us(20), 0), (tb.us(82), 0), (tb.us(87), 0), (tb.us(95), 0), (tb.us(110), 0),
                             (int(decided), 0), (int(decided) + 1, 1)):
        tb.offer(CALL, 1)
        edge = await tb.request()
        stop = edge + clocks

        async def cut(stop=stop):
            await until(stop)
            dut.enable_i.value = 0
        cocotb.start_soon(cut())
        await tb.send(edge, tb.train())
        await tb.answer(edge + tb.us(78 + SYNC), pulses=tb.bad_parity())
        await wait(tb.us(100))
        assert len(tb.attempts) == reported, clocks
        if reported:
            tb.attempt(PARITY, final=0)
        assert tb.result(ABORTED, first=PARITY if reported else ABORTED) == stop
        dut.enable_i.value = 1


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def measured(dut):
    """ST-002, RX-015: delay from the own last edge to the first answer pulse, on the pins and to the clock, from the
    first legal clock to the last; the largest deviation of the answer with its sign, at its limits and one clock
    inside. The echo, however late or bent, does not enter."""
    tb = EchoTB(dut)
    await tb.start()
    early, late = tb.us(0.875), tb.us(1.5)
    cases = [(delay, {}, 0, 0) for delay in (tb.us(12), tb.us(12) + 1, tb.us(SYNC), tb.us(SYNC) + 3, tb.us(ASYNC),
                                             tb.us(66) - 1, tb.us(66))]
    for k in (1, 4, 9):
        cases += [(tb.us(SYNC), {k: move}, abs(move), int(move > 0)) for move in (1, late, late - 1, -1, -early,
                                                                                 1 - early)]
    cases += [(tb.us(ASYNC), {2: 2, 5: -3}, 3, 0), (tb.us(ASYNC), {2: -2, 5: 3}, 3, 1)]
    for n, (delay, moves, deviation, is_late) in enumerate(cases):
        tb.offer()
        edge = await tb.request()
        train = [(t + (n % 4) * tb.us(1), p) for t, p in tb.train()]
        await tb.send(edge, moved(train, 5, late - n % 5))
        pulses = [(t + moves.get(k, 0), p) for k, (t, p) in enumerate(to_clocks(telegram.response_pulses(3), tb.hz))]
        last = await tb.answer(edge + tb.us(78) + delay, pulses=pulses)
        await until(last + tb.us(30))
        assert tb.attempt(OK) == (delay, deviation, is_late), (delay, moves)
        tb.result(OK, data=3)


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def strobes(dut):
    """RX-009: pulse_n_o and pulse_p_o show each accepted pulse of either comparator, whoever sends it, 750 ns and
    two clocks after its start."""
    tb = EchoTB(dut)
    await tb.start()
    seen = {-1: watch(dut.pulse_n_o), 1: watch(dut.pulse_p_o)}
    tb.offer()
    edge = await tb.request()
    sent = [(edge + t, p) for t, p in tb.train()]
    await tb.send(edge, tb.train())
    start = edge + tb.us(78 + SYNC)
    await tb.answer(start, 5)
    sent += [(start + t, p) for t, p in to_clocks(telegram.response_pulses(5), tb.hz)]
    await wait(tb.us(20))
    await tb.pulse(now(), -1, width=tb.us(0.75) - 1)
    await wait(tb.us(20))
    delay = tb.us(0.75) + 2
    for polarity, hits in seen.items():
        assert hits == [(t + delay,) for t, p in sent if p == polarity]
