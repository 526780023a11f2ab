# SPDX-License-Identifier: Apache-2.0
import cocotb
from cocotb.triggers import ValueChange
from cocotb_tests.block.phy_bench import now, start, until, wait, watch


class TB:
    """The transmitter's side of asi_tx_guard. pins: every change of (tx_man_o, tx_en_o) with its clock."""

    def __init__(self, dut):
        self.dut = dut
        self.limit = 300 * int(dut.ClkHz.value) // 10**6

    async def start(self):
        dut = self.dut
        await start(dut, man_i=1, en_i=0)
        self.events, self.enable, self.man = watch(dut.jabber_o), self._edges(dut.tx_en_o), self._edges(dut.tx_man_o)
        return self

    def _edges(self, signal):
        seen = []

        async def run():
            while True:
                await ValueChange(signal)
                seen.append((now(), int(signal.value)))
        cocotb.start_soon(run())
        return seen

    async def on(self, clocks):
        """The sender is on for so many clocks -> clock in which that began."""
        began = now()
        self.dut.en_i.value = 1
        await wait(clocks)
        self.dut.en_i.value = 0
        return began


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def exact(dut):
    """LT-013: a sender on for P_JABBER passes, one clock more is cut, exactly after P_JABBER, with one event."""
    tb = await TB(dut).start()
    for length in (1, tb.limit - 1, tb.limit):
        began = await tb.on(length)
        await wait(3)
        assert tb.enable == [(began, 1), (began + length, 0)] and tb.events == []
        tb.enable.clear()
    for length in (tb.limit + 1, 3 * tb.limit):
        began = await tb.on(length)
        await wait(3)
        assert tb.enable == [(began, 1), (began + tb.limit, 0)]
        assert tb.events == [(began + tb.limit,)]
        tb.enable.clear()
        tb.events.clear()
    assert tb.man == []


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def transparent(dut):
    """LT-013: until the cut MAN and enable pass without a clock of delay; while cut MAN rests high whatever comes."""
    tb = await TB(dut).start()
    dut.en_i.value = 1
    began, driven = now(), []
    while now() < began + 2 * tb.limit:
        level = 1 - int(dut.man_i.value)
        dut.man_i.value = level
        driven.append((now(), level))
        await wait(37)
    cut = began + tb.limit
    expected = [edge for edge in driven if edge[0] < cut]
    if expected[-1][1] == 0:
        expected.append((cut, 1))
    assert len(driven) > len(expected) > 10 and tb.man == expected and tb.enable == [(began, 1), (cut, 0)]
    await until(now())
    dut.man_i.value, dut.en_i.value = 1, 0
    await wait(2)
    assert (dut.tx_man_o.value, dut.tx_en_o.value) == (1, 0)


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def recovers(dut):
    """LT-013: one clock of letting go is enough: the next time on has the whole P_JABBER; times do not add up."""
    tb = await TB(dut).start()
    for length in (tb.limit + 50, tb.limit - 1, tb.limit - 1, tb.limit, tb.limit + 1):
        tb.enable.clear()
        tb.events.clear()
        began = await tb.on(length)
        await wait(1)
        assert tb.enable == [(began, 1), (began + min(length, tb.limit), 0)], length
        assert len(tb.events) == (length > tb.limit), length


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def requests(dut):
    """LT-013: requests back to back, each with bias and 81 us, are never cut; a sender without pause is."""
    tb = await TB(dut).start()
    hz = int(dut.ClkHz.value)
    for _ in range(10):
        await tb.on(93 * hz // 10**6)
        await wait(20 * hz // 10**6)
    assert tb.events == [] and len(tb.enable) == 20
    await tb.on(4 * 93 * hz // 10**6)
    await wait(1)
    assert len(tb.events) == 1


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def reset(dut):
    """LT-013: reset forgets the time and ends a cut."""
    tb = await TB(dut).start()
    dut.en_i.value = 1
    await wait(tb.limit + 5)
    assert dut.tx_en_o.value == 0
    dut.rst_i.value = 1
    await wait(1)
    dut.rst_i.value = 0
    assert dut.tx_en_o.value == 1
    await wait(tb.limit - 1)
    assert dut.tx_en_o.value == 1
    await wait(1)
    assert dut.tx_en_o.value == 0
