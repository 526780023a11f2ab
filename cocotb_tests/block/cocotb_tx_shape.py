# SPDX-License-Identifier: Apache-2.0
"""asi_tx_shape against the formula of the edge, i(t)/I0 = t/T - sin(2 pi t/T)/(2 pi), T = 3 us, computed here again."""
from math import floor, pi, sin

import cocotb
from asi import telegram
from cocotb.triggers import RisingEdge, Timer
from cocotb_tests.block.phy_bench import now, start, until, wait

STEPS = 24


def share(k):
    """i/I0 after step k of an edge; 0 before, 1 behind it"""
    x = min(max(k / STEPS, 0), 1)
    return x - sin(2 * pi * x) / (2 * pi)


class TB:
    def __init__(self, dut):
        self.dut = dut
        self.bias = int(dut.TxBias.value)
        self.swing = 255 - self.bias
        self.step = int(dut.ClkHz.value) // 8_000_000      # clocks
        self.edge = STEPS * self.step
        self.codes = {}                                    # clock -> code that begins with it

    async def start(self):
        await start(self.dut, man_i=1, en_i=0)

        async def run():
            while True:
                await RisingEdge(self.dut.clk_i)
                clock = now()
                await Timer(1, "ns")
                self.codes[clock] = int(self.dut.dac_o.value)
        self.codes[now()] = int(self.dut.dac_o.value)
        cocotb.start_soon(run())
        return self

    async def lead(self):
        """Enable on, and the whole bias ramp."""
        self.dut.en_i.value = 1
        await wait((2 * self.bias + 2) * self.step)
        assert self.codes[now()] == self.bias

    async def send(self, call, lead=True):
        """One request as asi_tx sends it -> clock of its first edge. Enable falls 3 us after the last edge."""
        if lead:
            await self.lead()
        self.dut.en_i.value = 1
        first = now()
        for t, polarity in telegram.request_pulses(call):
            await until(first + t // 125 * self.step)
            self.dut.man_i.value = int(polarity > 0)
        await until(first + 27 * self.edge)
        self.dut.en_i.value = 0
        return first

    def code(self, k):
        """Code after step k of a rising edge; halves are rounded up."""
        return self.bias + floor(self.swing * share(k) + 0.5)

    def of(self, first, clocks):
        return [self.codes[first + k] for k in range(clocks)]


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def edge_table(dut):
    """LT-015: both edges, every code of the formula, each for 125 ns, one clock behind the pin; full scale is 255."""
    tb = await TB(dut).start()
    await tb.lead()
    for turns in (1, 2):                                   # 10 us apart: then the phase of the steps is a new one
        for man in (0, 1):
            await wait(10 * 8 * tb.step + turns)
            dut.man_i.value = man
            at = now()
            await wait(tb.edge + 8 * tb.step)
            rising = [tb.code(k) for k in range(1, STEPS + 1)]
            falling = [tb.code(k) for k in range(STEPS - 1, -1, -1)]
            steps = falling if man else rising
            assert tb.codes[at] == (255 if man else tb.bias)
            assert tb.of(at + 1, tb.edge) == [c for c in steps for _ in range(tb.step)]
            assert set(tb.of(at + 1 + tb.edge, 7 * tb.step)) == {steps[-1]}
            assert rising[-1] == 255 and falling[-1] == tb.bias


@cocotb.test(timeout_time=2, timeout_unit="ms")
async def whole_requests(dut):
    """LT-015, TL-004: the code of whole requests is the sum of the formula's edges, in every clock within half a code;
    contiguous edges join; rest, bias and full scale are where they belong."""
    tb = await TB(dut).start()
    for name, index in (("DEXG", 5), ("ADRA", 0), ("BR01", None), ("WPAR", 44)):
        call = telegram.encode_call(name, *((index, 7) if name in ("DEXG", "WPAR", "ADRA") else ()))
        first = await tb.send(call)
        await until(first + 27 * tb.edge + (2 * tb.bias + 6) * tb.step)
        for clock in range(27 * tb.edge):
            current = 0.0
            for t, polarity in telegram.request_pulses(call):
                done = (clock - t // 125 * tb.step) // tb.step + 1      # steps of this edge
                current -= polarity * share(done)
            code = tb.bias + tb.swing * current
            assert abs(tb.codes[first + 1 + clock] - code) <= 0.5001, (name, clock)
        assert tb.codes[now()] == 0
        assert max(tb.codes[k] for k in range(first, now())) == 255


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def differentiated(dut):
    """LT-015, TL-005: differentiated, as the line does it, the code is the pulse train of the request: sin^2 pulses of
    3 us, contiguous where it says so, alternating, the first negative, nothing in between."""
    tb = await TB(dut).start()
    call = telegram.encode_call("DEXG", 5, 0b1010)
    first = await tb.send(call)
    await until(first + 28 * tb.edge)
    # rising current = negative pulse; one sample per step
    codes = tb.of(first + 1 - tb.step, 27 * tb.edge + tb.step)[::tb.step]
    slope = [a - b for a, b in zip(codes, codes[1:])]
    pulses = {t // 3_000: polarity for t, polarity in telegram.request_pulses(call)}
    found = []
    for half in range(27):
        part = slope[half * STEPS:(half + 1) * STEPS]
        if not any(part):
            continue
        found.append((half, 1 if sum(part) > 0 else -1))
        assert abs(sum(part)) == tb.swing and all(abs(v) <= 1 or (v > 0) == (sum(part) > 0) for v in part)
        for k, value in enumerate(part):
            pulse = tb.swing / STEPS * 2 * sin(pi * (k + 0.5) / STEPS) ** 2       # its mean over the step, nearly
            assert abs(abs(value) - pulse) <= 1.2, (half, k)
        assert max(map(abs, part)) <= tb.swing * 2 / STEPS + 1
    assert found == sorted(pulses.items())
    assert found[0] == (0, -1) and all(a[1] == -b[1] for a, b in zip(found, found[1:]))


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def bias_ramp(dut):
    """LT-015: enable raises the bias by one code per 250 ns, up to TxBias; letting go takes it back to 0 in the same
    way."""
    tb = await TB(dut).start()
    for level in (1, 0, 1, 0):
        dut.en_i.value = level
        at = now()
        await wait(2 * tb.bias * tb.step + 6 * tb.step)
        codes = tb.of(at, now() - at)
        ends = (0, tb.bias) if level else (tb.bias, 0)
        assert (codes[0], codes[-1]) == ends
        changes = [k for k in range(1, len(codes)) if codes[k] != codes[k - 1]]
        assert all(codes[k] - codes[k - 1] == (1 if level else -1) for k in changes)
        assert all(b - a == 2 * tb.step for a, b in zip(changes, changes[1:]))
        assert len(changes) == tb.bias
        assert changes == [] or changes[-1] <= (2 * tb.bias + 1) * tb.step   # 12 codes: within 3.4 us, the least lead


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def without_lead(dut):
    """LT-015: a request without any lead begins on time: the ramp runs under its edge, no step is larger than the
    table's plus one."""
    tb = await TB(dut).start()
    first = await tb.send(telegram.encode_call("DEXG", 5, 3), lead=False)
    await wait((2 * tb.bias + 30) * tb.step)
    codes = tb.of(first, now() - first)
    largest = max(tb.code(k) - tb.code(k - 1) for k in range(1, STEPS + 1))
    assert max(abs(a - b) for a, b in zip(codes, codes[1:])) <= largest + 1
    half = STEPS // 2
    assert codes[half * tb.step] >= tb.code(half) - tb.bias and codes[-1] == 0 and max(codes) == 255


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def cut_off(dut):
    """LT-013, LT-015: a sender that is cut off anywhere in an edge goes back to 0 without a jump, within 3 us for the
    edge and 250 ns per code of the bias."""
    tb = await TB(dut).start()
    for steps in (1, 7, 12, 20, 24, 40):
        await tb.lead()
        dut.man_i.value = 0
        await wait(steps * tb.step)
        dut.man_i.value, dut.en_i.value = 1, 0             # what asi_tx_guard makes of the pins
        at = now()
        await wait((max(STEPS, 2 * tb.bias) + 3) * tb.step)
        codes = tb.of(at, now() - at)
        assert codes[0] == tb.code(steps) and codes[-1] == 0
        assert all(0 <= a - b <= 23 for a, b in zip(codes, codes[1:])), steps


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def sender_off(dut):
    """LT-015: without enable there is no current, whatever MAN does; reset takes a running edge to 0."""
    tb = await TB(dut).start()
    began = now()
    for k in range(40):
        dut.man_i.value = k % 2
        await wait(7)
    assert set(tb.of(began, now() - began)) == {0}
    await tb.lead()
    dut.man_i.value = 0
    await wait(30 * tb.step)
    assert tb.codes[now()] == 255
    dut.rst_i.value = 1
    await wait(1)
    assert tb.codes[now()] == 0
