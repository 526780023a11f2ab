# SPDX-License-Identifier: Apache-2.0
"""asi_vth behind synchroniser and filters: pulses on the comparator pins, edges of rx_vth_clear_o. Times in clocks."""
import random

import cocotb
from asi import telegram
from cocotb.triggers import ValueChange
from cocotb_tests.block.phy_bench import now, start, to_clocks, until, wait


class TB:
    def __init__(self, dut):
        self.dut, self.hz = dut, int(dut.ClkHz.value)
        self.pause, self.length = self.us(8.375), self.us(2)
        self.delay = self.us(0.75) + 2          # from a pulse on a pin to its strobe: filter and synchroniser
        self.levels = {1: 0, -1: 0}             # pulses on a pin at this moment
        self.edges = []                         # (clock, level) of rx_vth_clear_o

    def us(self, time):
        clocks = time * self.hz / 10**6
        assert clocks == int(clocks)
        return int(clocks)

    async def start(self):
        await start(self.dut, rx_p_i=0, rx_n_i=0)

        async def run():
            while True:
                await ValueChange(self.dut.rx_vth_clear_o)
                self.edges.append((now(), int(self.dut.rx_vth_clear_o.value)))
        cocotb.start_soon(run())
        await wait(self.us(20))                 # the clear after reset is over
        self.edges.clear()
        return self

    def pulse(self, at, polarity, us=1.5):
        """A comparator pulse that starts at clock `at`."""
        pin = self.dut.rx_p_i if polarity > 0 else self.dut.rx_n_i

        async def run():
            await until(at)
            self.levels[polarity] += 1
            pin.value = 1
            await wait(self.us(us))
            self.levels[polarity] -= 1
            pin.value = int(self.levels[polarity] > 0)
        cocotb.start_soon(run())

    def cleared_after(self, last):
        """The edges of one whole clear after a pulse at clock `last`."""
        rise = last + self.pause + self.delay + 1
        return [(rise, 1), (rise + self.length, 0)]


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def once_per_pause(dut):
    """LT-014: one clear per pause, to the clock: P_PAUSE after the strobe of the last pulse, P_VTH_CLEAR long, whatever
    the polarity."""
    tb = await TB(dut).start()
    for polarity in (-1, 1):
        last = now() + 1
        tb.pulse(last, polarity)
        await until(last + tb.us(500))
        assert tb.edges == tb.cleared_after(last)
        tb.edges.clear()


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def gap_lengths(dut):
    """LT-014: a gap of P_PAUSE between two pulses gives no clear; one clock more gives one, cut short by the strobe of
    the second pulse; the second pulse has its own."""
    tb = await TB(dut).start()
    for gap in (tb.us(3), tb.us(6), tb.us(7.5), tb.pause - 1, tb.pause, tb.pause + 1, tb.pause + 5,
                tb.pause + tb.length - 1, tb.pause + tb.length, tb.pause + tb.length + 1):
        tb.edges.clear()
        first = now() + 1
        tb.pulse(first, -1)
        tb.pulse(first + gap, 1)
        await until(first + gap + tb.us(15))
        rise = first + tb.pause + tb.delay + 1
        ended = min(rise + tb.length, first + gap + tb.delay + 1)     # by the strobe
        between = [(rise, 1), (ended, 0)] if gap > tb.pause else []
        assert tb.edges == between + tb.cleared_after(first + gap), gap


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def legal_telegrams(dut):
    """LT-014: never in a telegram, whichever telegram it is and wherever in their windows the pulses come; then
    once."""
    tb = await TB(dut).start()
    rng = random.Random(14)
    early, late = -tb.us(0.875), tb.us(1.5)
    trains = [telegram.response_pulses(data) for data in range(16)]
    trains += [telegram.request_pulses(rng.randrange(2048)) for _ in range(8)]
    widest = 0
    for train in trains:
        places = [(t, p) for t, p in to_clocks(train, tb.hz)]
        # on time; as far apart as the windows allow, both ways round; anywhere
        for shift in (lambda k: 0, lambda k: (early, late)[k % 2], lambda k: (late, early)[k % 2],
                      lambda k: rng.randint(early, late)):
            tb.edges.clear()
            first = now() + 1
            at = [first + (t + shift(k) if k else 0) for k, (t, _) in enumerate(places)]
            widest = max(widest, *(b - a for a, b in zip(at, at[1:])))
            for clock, (_, polarity) in zip(at, places):
                tb.pulse(clock, polarity, 0.75)
            await until(at[-1] + tb.us(13))
            assert tb.edges == tb.cleared_after(at[-1])
    assert widest == tb.pause                   # the longest legal gap was among them


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def before_the_answer(dut):
    """LT-014: the clear is over before the earliest answer, P_RX_OPEN after the last pulse of the request."""
    tb = await TB(dut).start()
    last = now() + 1
    tb.pulse(last, 1)
    tb.pulse(last + tb.us(12), -1)
    await until(last + tb.us(30))
    assert tb.edges == tb.cleared_after(last) + tb.cleared_after(last + tb.us(12))
    assert tb.edges[1][0] <= last + tb.us(12)


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def short_pulses(dut):
    """LT-014, RX-009: comparator pulses shorter than 750 ns neither start a pause nor end a clear."""
    tb = await TB(dut).start()
    last = now() + 1
    tb.pulse(last, -1)
    for k in range(1, 20):
        tb.pulse(last + k * tb.us(1), 1, 0.5)
    await until(last + tb.us(25))
    assert tb.edges == tb.cleared_after(last)


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def reset(dut):
    """LT-014: clear is 1 in reset, P_VTH_CLEAR longer, and only then; a pause that follows without a pulse has none."""
    tb = await TB(dut).start()
    tb.pulse(now() + 1, -1)
    await wait(tb.us(4))
    assert tb.edges == []
    dut.rst_i.value = 1
    began = now()
    await wait(tb.us(5))
    dut.rst_i.value = 0
    released = now()
    await wait(tb.us(40))
    assert tb.edges == [(began + 1, 1), (released + tb.length, 0)]
