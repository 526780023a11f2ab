# SPDX-License-Identifier: Apache-2.0
import cocotb
from asi import regmap, telegram
from cocotb.triggers import ClockCycles, FallingEdge, RisingEdge, Timer
from cocotb.utils import get_sim_time

from cocotb_tests.block.cocotb_soc import LINK, TB, reg

BATCH, SLOT, STATE = (LINK + getattr(regmap, f"LINK_{n}") for n in ("BATCH", "SLOT", "SLOT_STATE"))
NO_RESPONSE, ABORTED = 1, 15
BATCH_DONE, CYCLE_DONE, APF_CHANGE, EFAULT_CHANGE, EXCHANGE_DONE = 2, 1, 8, 64, 128
APF_LATCH, EFAULT_LATCH, JABBER_LATCH = 1, 2, 4
OFFLINE, DETECTION, DATA_EXCHANGE = 0, 1, 3


def link(name):
    return LINK + getattr(regmap, f"LINK_{name}")


class MasterTB(TB):
    """asi_master with the probe program (soc_probe.c); logs the line and answers like a synchronous slave."""

    PERIOD_NS = 125                                                # 8 MHz
    INPUTS = ("rx_p_i", "rx_n_i", "apf_ni", "efault_i", "spi_miso_i")

    def __init__(self, dut):
        super().__init__(dut)
        self.trains, self.answers = [], {}                         # requests on the line; call -> answer nibble
        self.table = {tuple(telegram.request_pulses(call)): call for call in range(2048)}
        cocotb.start_soon(self._line())

    async def _line(self):
        first = -10**9
        while True:
            await self.dut.tx_man_o.value_change
            now = round(get_sim_time("ns"))
            if not int(self.dut.tx_en_o.value):
                continue
            if now - first > 78_000:
                first = now
                self.trains.append([])
            self.trains[-1].append((now - first, 1 if int(self.dut.tx_man_o.value) else -1))
            cocotb.start_soon(self._pulse(self.trains[-1][-1][1]))   # the chip hears itself
            if now - first == 78_000:
                call = self.table.get(tuple(self.trains[-1]))
                if call in self.answers:
                    cocotb.start_soon(self._answer(self.answers[call]))

    async def _pulse(self, polarity):
        pin = self.dut.rx_p_i if polarity > 0 else self.dut.rx_n_i
        pin.value = 1
        await Timer(1_500, "ns")
        pin.value = 0

    async def _answer(self, data):
        at = 0
        for t, polarity in telegram.response_pulses(data):
            await Timer(t + 21_500 - at, "ns")
            await self._pulse(polarity)
            at = t + 23_000

    def calls(self):
        """Requests so far; a train that is no legal telegram gives None."""
        return [self.table.get(tuple(train)) for train in self.trains]

    async def event(self, bit, limit=200):
        """Wait for an event and clear it."""
        for _ in range(limit):
            if await self.peek(reg("EVENT")) & bit:
                await self.poke(reg("EVENT"), bit)
                return
        raise AssertionError(f"event {bit} never came")

    async def power_up(self, line_en=True):
        self.dut.apf_ni.value = 1
        await self.start()
        await self.event(APF_CHANGE)
        await self.poke(reg("CTRL"), line_en << 3)


@cocotb.test(timeout_time=50, timeout_unit="ms")
async def power_fail(dut):
    """LT-010, LT-011, EX-021: APF until power was good; with APF a batch ends ABORTED and the line stays silent."""
    tb = MasterTB(dut)
    await tb.start()                                               # apf_ni is 0: no power
    await tb.poke(reg("CTRL"), 8)
    assert await tb.peek(reg("STATUS")) == 4
    call = telegram.encode_call("RDIO", 5)
    tb.answers[call] = 7

    async def batch():
        await tb.poke(BATCH, call)
        await tb.poke(reg("BATCH"), 1)
        await tb.event(BATCH_DONE)
        return await tb.peek(BATCH)
    assert await batch() >> 4 & 15 == ABORTED and tb.calls() == []
    dut.apf_ni.value = 1
    await tb.event(APF_CHANGE)
    assert await tb.peek(reg("STATUS")) == 0
    assert await batch() & 0xFF == 7 and tb.calls() == [call]
    dut.apf_ni.value = 0
    await tb.event(APF_CHANGE)
    assert await tb.peek(reg("STATUS")) == 4
    assert await batch() >> 4 & 15 == ABORTED and tb.calls() == [call]


@cocotb.test(timeout_time=50, timeout_unit="ms")
async def earth_fault(dut):
    """LT-016, LT-017: an earth fault shows after P_EF (100 us here), as state, event and latch; calls go on with it. The
    power fail before is over and still latched."""
    tb = MasterTB(dut)
    dut.efault_i.value = 0
    await tb.power_up()
    assert await tb.peek(reg("LATCH")) == APF_LATCH and await tb.peek(reg("STATUS")) == 0
    await tb.poke(reg("LATCH"), 7)
    call = telegram.encode_call("RDIO", 5)
    tb.answers[call] = 7
    dut.efault_i.value = 1
    began = get_sim_time("ns")
    assert await tb.peek(reg("STATUS")) == 0
    await tb.event(EFAULT_CHANGE)
    assert get_sim_time("ns") - began >= 100_000
    assert await tb.peek(reg("STATUS")) == 8 and await tb.peek(reg("LATCH")) == EFAULT_LATCH
    await tb.poke(BATCH, call)
    await tb.poke(reg("BATCH"), 1)
    await tb.event(BATCH_DONE)
    assert await tb.peek(BATCH) & 0xFF == 7 and tb.calls() == [call]
    dut.efault_i.value = 0
    await tb.event(EFAULT_CHANGE)
    assert await tb.peek(reg("STATUS")) == 0 and await tb.peek(reg("LATCH")) == EFAULT_LATCH
    await tb.poke(reg("LATCH"), EFAULT_LATCH)
    assert await tb.peek(reg("LATCH")) == 0


@cocotb.test(timeout_time=50, timeout_unit="ms")
async def front_end(dut):
    """LT-014, LT-015: the differentiated tx_dac_o of the chip is the request; the held amplitude is dropped once after
    it and once after the answer, never inside."""
    tb = MasterTB(dut)
    await tb.power_up()
    call = telegram.encode_call("WPAR", 12, 0b0110)
    tb.answers[call] = 7
    codes, clears = [], []

    async def watch_pins():
        at = began = round(get_sim_time("ns"))
        while True:
            await FallingEdge(tb.clk)
            at += tb.PERIOD_NS
            codes.append(int(dut.tx_dac_o.value))
            if int(dut.rx_vth_clear_o.value):
                clears.append((at - began) // tb.PERIOD_NS)
    await FallingEdge(tb.clk)
    cocotb.start_soon(watch_pins())
    await tb.poke(BATCH, call)
    await tb.poke(reg("BATCH"), 1)
    await tb.event(BATCH_DONE)
    await Timer(50, "us")
    assert await tb.peek(BATCH) & 0xFF == 7 and tb.calls() == [call]
    slope = [a - b for a, b in zip(codes, codes[1:])]              # rising current = negative pulse
    first = next(k for k, v in enumerate(slope) if v < -1) - 1     # the first step is one code, like those of the bias
    pulses = [(half * 3_000, 1 if total > 0 else -1) for half in range(27)
              if abs(total := sum(slope[first + 24 * half:first + 24 * half + 24])) > 200]
    assert pulses == telegram.request_pulses(call)
    assert codes[first] == 12 and max(codes) == 255 and codes[0] == codes[-1] == 0
    runs = [k for k in clears if k - 1 not in clears]
    assert len(clears) == 2 * 16 and len(runs) == 2                # 2 us each
    last = first + 78 * 8                                          # of the request, answered 21.5 us later
    # P_PAUSE and the delay of the strobe; exact to the clock in cocotb_vth, here the pulses change on clock edges
    assert abs(runs[0] - (last + 67 + 8 + 1)) <= 1 and abs(runs[1] - runs[0] - (21_500 + 36_000) // 125) <= 1


@cocotb.test(timeout_time=50, timeout_unit="ms")
async def jabber(dut):
    """LT-013, LT-017: a request during which the sender's time ends is cut at the pins, latched until it is cleared,
    and the next one passes. The time is set by hand: the chip itself never sends for so long."""
    tb = MasterTB(dut)
    await tb.power_up()
    await tb.poke(reg("LATCH"), 7)
    call = telegram.encode_call("RDIO", 5)
    tb.answers[call] = 7
    await tb.poke(BATCH, call)
    await tb.poke(reg("BATCH"), 1)
    await RisingEdge(dut.tx_en_o)
    await FallingEdge(dut.tx_man_o)
    await Timer(20, "us")
    await FallingEdge(tb.clk)
    assert int(dut.tx_en_o.value) == 1
    dut.u_tx_guard.cnt_q.value = 2**12 - 1                         # one clock to go
    await FallingEdge(tb.clk)
    await FallingEdge(tb.clk)
    for _ in range(300):
        assert (int(dut.tx_man_o.value), int(dut.tx_en_o.value)) == (1, 0)
        await FallingEdge(tb.clk)
    assert int(dut.tx_dac_o.value) == 0
    await tb.event(BATCH_DONE)
    assert await tb.peek(BATCH) >> 4 & 15 != 0 and await tb.peek(reg("LATCH")) == JABBER_LATCH
    await tb.poke(reg("LATCH"), JABBER_LATCH)
    tb.trains.clear()
    await tb.poke(BATCH, call)
    await tb.poke(reg("BATCH"), 1)
    await tb.event(BATCH_DONE)
    assert await tb.peek(BATCH) & 0xFF == 7 and tb.calls() == [call] and await tb.peek(reg("LATCH")) == 0


@cocotb.test(timeout_time=50, timeout_unit="ms")
async def batch_on_the_line(dut):
    """LK-010, TL-006: requests written by the core leave as pulses, answers and classes come back, one event."""
    tb = MasterTB(dut)
    await tb.power_up()
    calls = [telegram.encode_call("RDIO", 5), telegram.encode_call("RDID", 37), telegram.encode_call("WPAR", 5, 0xA)]
    tb.answers = {calls[0]: 0x7, calls[2]: 0x5}
    for k, call in enumerate(calls):
        await tb.poke(BATCH + 4 * k, call | 1 << regmap.REQUEST_RETRIES_LSB)
    await tb.poke(reg("EXEC"), DETECTION)
    await tb.poke(reg("BATCH"), len(calls))
    assert await tb.peek(reg("STATUS")) & 1 and int(dut.phase_o.value) == DETECTION
    await tb.event(BATCH_DONE)
    assert await tb.peek(reg("STATUS")) == 0
    results = [await tb.peek(BATCH + 4 * k) & 0x3FFF for k in range(3)]
    assert results == [0x0007, 1 << 12 | NO_RESPONSE << 8 | NO_RESPONSE << 4 | results[1] & 15, 0x0005]
    assert tb.calls() == [calls[0], calls[1], calls[1], calls[2]]


@cocotb.test(timeout_time=50, timeout_unit="ms")
async def cycle_on_the_line(dut):
    """LK-001, LK-007, LK-012, LK-014: a cycle calls the active slots, publishes inputs, keeps its period."""
    tb = MasterTB(dut)
    await tb.power_up()
    for word in range(0x200, 0x3A0, 4):                            # no extra requests, images and counters 0
        await tb.poke(LINK + word, 0)
    calls = {5: telegram.encode_call("DEXG", 5, 3), 9: telegram.encode_call("DEXG", 9, 12)}
    for index, call in calls.items():
        await tb.poke(STATE + 4 * index, 0)
        await tb.poke(SLOT + 4 * index, 1)
        word = link("OUT_IMG") + 4 * (index // 8)
        await tb.poke(word, await tb.peek(word) | (call & 15) << 4 * (index % 8))
    tb.answers = {calls[5]: 0xB, calls[9]: 0x6}
    syncs, phases = [], set()

    async def watch_sync():
        while True:
            await RisingEdge(dut.sync_o)
            syncs.append(round(get_sim_time("ns")) // tb.PERIOD_NS)
            phases.add(int(dut.phase_o.value))
            await FallingEdge(tb.clk)
            await FallingEdge(tb.clk)
            assert int(dut.sync_o.value) == 0
    cocotb.start_soon(watch_sync())
    await tb.poke(reg("CTRL"), 8 | 1 | 1000 << 16)                 # cycles of 1000 us
    for _ in range(4):
        await tb.event(CYCLE_DONE)
    assert await tb.peek(link("IN_IMG")) == 0xB << 20 and await tb.peek(link("IN_IMG") + 4) == 6 << 4
    await tb.poke(reg("CTRL"), 8)
    await ClockCycles(tb.clk, 8 * 1000)
    assert await tb.peek(reg("STATUS")) == 0 and int(dut.phase_o.value) == OFFLINE
    cycles = await tb.peek(link("CYCLES"))
    assert cycles >= 4 and len(syncs) == cycles and phases == {DATA_EXCHANGE}
    assert tb.calls() == [calls[5], calls[9]] * cycles
    assert await tb.peek(link("SENT")) == 2 * cycles
    periods = [b - a for a, b in zip(syncs, syncs[1:])]
    assert min(periods) >= 1000 * tb.us, periods
    assert max(periods[1:]) - min(periods[1:]) <= 1, periods       # the first cycle starts from rest


@cocotb.test(timeout_time=50, timeout_unit="ms")
async def exchange_on_the_line(dut):
    """LK-018, LK-019, LK-020, LK-021: the core takes exchange_done while the extra call is on the line, reads what each
    slave got and answered, writes the next live nibble, and the next call has it. With read_id the slots get RDID."""
    tb = MasterTB(dut)
    await tb.power_up()
    for word in range(0x200, 0x3A0, 4):
        await tb.poke(LINK + word, 0)
    for index, slot in ((5, 0b101), (9, 0), (41, 0b011)):           # 5 live, 9B
        await tb.poke(STATE + 4 * index, 0)
        await tb.poke(SLOT + 4 * index, slot)
    for index, data, code in ((5, 0xB, 5), (41, 0x6, 9)):
        tb.answers |= {telegram.encode_call("DEXG", index, k): data for k in range(16)}
        tb.answers[telegram.encode_call("RDID", index)] = code
    extra = telegram.encode_call("RDIO", 20)                        # nobody there
    await tb.poke(link("INCL_REQ"), extra | 1 << 31)
    await tb.poke(reg("EVENT"), EXCHANGE_DONE)
    await tb.poke(reg("CTRL"), 8 | 1)
    expected = []
    for k in range(6):
        await tb.event(EXCHANGE_DONE)
        await tb.poke(link("OUT_IMG"), (k + 7 & 15) << 20)          # index 5
        states = [await tb.peek(STATE + 4 * index) for index in (5, 41)]
        assert len(tb.trains) == 3 * (k + 1), "the core was too late"
        sent = 0 if k == 0 else k + 6
        assert states == [0xB | sent << 20 | (k + 1) << 28, 6 | (k + 1) << 28]
        expected += [telegram.encode_call("DEXG", 5, sent), telegram.encode_call("DEXG", 41, 0), extra]
        if k == 5:
            await tb.poke(reg("CTRL"), 8 | 1 | 16)
    await tb.event(EXCHANGE_DONE)
    await tb.poke(reg("CTRL"), 8 | 16)
    await tb.poke(reg("EVENT"), CYCLE_DONE)
    assert [await tb.peek(STATE + 4 * index) for index in (5, 41)] == [5 | 1 << 20 | 7 << 28, 9 | 9 << 20 | 7 << 28]
    await tb.event(CYCLE_DONE)
    assert tb.calls() == expected + [telegram.encode_call("RDID", 5), telegram.encode_call("RDID", 41), extra]
