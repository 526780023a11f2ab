# SPDX-License-Identifier: Apache-2.0
import os
import random

import cocotb
from asi import regmap
from cocotb.clock import Clock
from cocotb.triggers import ClockCycles, FallingEdge, First, RisingEdge
from cocotb.utils import get_sim_time

from cocotb_tests.block.hostport import Port

RAM, DPM, REGS, LINK = 0x0000_8000, 0x4000_0000, 0x8000_0000, 0x8001_0000
STATS, STATS_CLEAR, RING = 0x8002_0000, 0x8002_1000, 0x8003_0000
MAIL = 0x3F00 // 4                                                 # mailbox of soc_probe.c, word in the host window
OP, ADDR, DATA, RESULT, IRQS, EVENTS, ALIVE = range(MAIL, MAIL + 7)
READ, WRITE, CALL, IRQ_ON, IRQ_OFF = {1: 1, 2: 2, 4: 3}, {1: 4, 2: 5, 4: 6}, 7, 8, 9
EVENT_BIT = {"cycle_done": 0, "batch_done": 1, "slave_lost": 2, "apf_change": 3, "tick": 4, "host_attn": 5,
             "efault_change": 6, "exchange_done": 7}


def reg(name):
    return REGS + getattr(regmap, f"REGS_{name}")


class TB:
    """The chip without its line, and the real core as a hand that does one access at a time (soc_probe.c)."""

    PERIOD_NS = 10
    INPUTS = ("seq_req_i", "seq_we_i", "seq_addr_i", "seq_wdata_i", "batch_busy_i", "cycle_busy_i", "apf_i", "efault_i",
              "cycle_done_i", "exchange_done_i", "batch_done_i", "slave_lost_i", "spi_miso_i")

    def __init__(self, dut):
        self.dut, self.clk = dut, dut.clk_i
        self.us = int(dut.ClkHz.value) // 1_000_000                # clocks per us
        Clock(dut.clk_i, self.PERIOD_NS, unit="ns", impl="gpi").start()
        self.host = Port(dut, "host", dut.clk_i)
        for name in self.INPUTS:
            getattr(dut, name).value = 0
        dut.rst_i.value = 1

    async def start(self):
        self.dut.rst_i.value = 1
        await ClockCycles(self.clk, 3)
        self.dut.rst_i.value = 0
        await RisingEdge(self.clk)
        await self.host_write(ALIVE, 0)                            # older than this test; the core is slower than this
        for _ in range(100):
            if await self.host_read(ALIVE) == 0x600DB007:
                return
            await ClockCycles(self.clk, 20)
        raise AssertionError("the core did not start")

    async def host_read(self, word):
        return (await self.host.access(word))[0]

    async def host_write(self, word, value):
        await self.host.access(word, 1, 15, value)

    async def begin(self, op, addr=0, data=0):
        await self.host_write(ADDR, addr)
        await self.host_write(DATA, data)
        await self.host_write(OP, op)

    async def finish(self, limit=400):
        for _ in range(limit):
            if await self.host_read(OP) == 0:
                return await self.host_read(RESULT)
            await ClockCycles(self.clk, 5)
        raise AssertionError("the core hangs in an access")

    async def do(self, op, addr=0, data=0):
        await self.begin(op, addr, data)
        return await self.finish()

    async def peek(self, addr, size=4):
        return await self.do(READ[size], addr)

    async def poke(self, addr, value, size=4):
        await self.do(WRITE[size], addr, value)

    async def pulse(self, name):
        pin = getattr(self.dut, f"{name}_i")
        pin.value = 1
        await RisingEdge(self.clk)
        pin.value = 0

    async def until(self, signal, level=1, limit=20000):
        """-> clocks until signal has level, sampled in mid-clock."""
        for n in range(limit):
            await FallingEdge(self.clk)
            if int(signal.value) == level:
                return n
        raise AssertionError(f"{signal._name} never {level}")


@cocotb.test(timeout_time=50, timeout_unit="ms")
async def memory_map(dut):
    """HW-006, HW-007, ST-004: the core starts; bytes, half-words, words in every memory of the map."""
    random.seed(3)
    tb = TB(dut)
    await tb.start()
    for base, last in ((RAM, 0x7FFC), (DPM, 0x3EFC), (LINK, 0x3FC), (STATS, 0xFFC), (RING, 0x7FC)):
        for offset in (0, last):
            model = bytearray(4)
            await tb.poke(base + offset, 0)
            for size, lane in ((4, 0), (2, 0), (2, 2), (1, 0), (1, 1), (1, 2), (1, 3)):
                value = random.getrandbits(8 * size)
                await tb.poke(base + offset + lane, value, size)
                model[lane:lane + size] = value.to_bytes(size, "little")
                assert await tb.peek(base + offset) == int.from_bytes(model, "little"), hex(base + offset)
            for size, lane in ((2, 0), (2, 2), (1, 0), (1, 1), (1, 2), (1, 3)):
                assert await tb.peek(base + offset + lane, size) == int.from_bytes(model[lane:lane + size], "little")
    await tb.poke(STATS + 0x440, 0xFFFF_FFFF)
    await tb.poke(STATS + 0x444, 0x5555_AAAA)
    assert [await tb.peek(STATS_CLEAR + 0x440), await tb.peek(STATS + 0x440)] == [0xFFFF_FFFF, 0]  # ST-004
    assert await tb.peek(STATS + 0x444) == 0x5555_AAAA
    await tb.poke(DPM + 4, 0x12345678)
    assert await tb.host_read(1) == 0x12345678
    await tb.host_write(0x3EF8 // 4, 0xCAFE_F00D)
    assert await tb.peek(DPM + 0x3EF8) == 0xCAFE_F00D


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def access_to_nothing(dut):
    """HW-006: reads outside the map give 0, writes there change nothing, neither hangs the core."""
    tb = TB(dut)
    await tb.start()
    places = (0x0001_0000, 0x0FFF_FFFC, 0x1000_0400, 0x2000_0000, 0x3FFF_FFFC, 0x4000_4000, 0x7FFF_FFFC, 0x8000_0040,
              0x8000_FFFC, 0x8001_0400, 0xFFFF_FFFC)
    known = {RAM: 0x11111111, DPM: 0x22222222, LINK: 0x33333333, reg("EVENT_EN"): 0x15}
    for addr, value in known.items():
        await tb.poke(addr, value)
    for addr in places:
        await tb.poke(addr, 0xFFFF_FFFF)
        assert await tb.peek(addr) == 0, hex(addr)
    for addr, value in known.items():
        assert await tb.peek(addr) == value, hex(addr)
    for place in (STATS + 0x2000, RING + 0x800):                   # behind the statistics and the monitor ring
        assert await tb.peek(place) == 0


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def new_code_is_fetched(dut):
    """HW-007: code written by the data side runs, also a few words ahead of the store itself."""
    tb = TB(dut)
    await tb.start()
    for value in (1, 2, 3):
        await tb.poke(RAM, 0x0005_0513 | value << 20)              # addi a0, a0, value
        await tb.poke(RAM + 4, 0x0000_8067)                        # ret
        assert await tb.do(CALL, RAM, 1000) == 1000 + value
    # a store into code that is about to run, beyond what the core's own pipeline holds
    far = 8                                                        # words from the store to its target
    nop = 0x0000_0013
    code = [
        0x0000_0297,                                               # auipc t0, 0
        0x0000_0337 | 0x06450 << 12,                               # lui t1, 0x6450
        0x5133_0313,                                               # addi t1, t1, 0x513: "addi a0, a0, 100" = 0x06450513
        0x0000_0023 | 5 << 15 | 6 << 20 | 2 << 12 | (4 * (3 + far) & 31) << 7 | (4 * (3 + far) >> 5) << 25,  # sw t1
        *[nop] * (far - 1),
        0x0015_0513,                                               # addi a0, a0, 1: overwritten by "addi a0, a0, 100"
        0x0000_8067,
    ]
    for k, word in enumerate(code):
        await tb.poke(RAM + 4 * k, word)
    assert await tb.do(CALL, RAM, 5) == 105


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def registers(dut):
    """LK-010, LK-014, LK-021, EX-011: registers drive the sequencer and show its state; a BATCH write is one start
    pulse."""
    tb = TB(dut)
    await tb.start()
    assert await tb.peek(reg("ID")) == 0x4153_0001
    pins = ("cycle_en", "two_extra", "out_hold", "line_en", "read_id")
    for bits in (1, 2, 4, 8, 16, 31, 0):
        await tb.poke(reg("CTRL"), bits | (bits * 259) << 16)
        assert [int(getattr(dut, f"{p}_o").value) for p in pins] == [bits >> k & 1 for k in range(5)]
        assert int(dut.min_cycle_us_o.value) == bits * 259
    for phase in range(6):
        await tb.poke(reg("EXEC"), phase)
        assert int(dut.exec_phase_o.value) == phase
    for k, pin in enumerate(("batch_busy", "cycle_busy", "apf", "efault")):
        getattr(dut, f"{pin}_i").value = 1
        assert await tb.peek(reg("STATUS")) == 1 << k
        getattr(dut, f"{pin}_i").value = 0
    starts = []

    async def watch():
        while True:
            await FallingEdge(tb.clk)
            if int(dut.batch_start_o.value):
                starts.append(int(dut.batch_len_o.value))
    cocotb.start_soon(watch())
    for length in (1, 64, 64):
        await tb.poke(reg("BATCH"), length)
    assert starts == [1, 64, 64]


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def events(dut):
    """LK-007, LK-019, LT-016, HW-002, EX-021: events are sticky, cleared one by one, and not lost in the clock of a
    clearing write."""
    tb = TB(dut)
    await tb.start()
    await tb.poke(reg("EVENT"), 0xFF)

    async def raise_(name):
        if name in ("apf_change", "efault_change"):
            pin = dut.apf_i if name == "apf_change" else dut.efault_i
            pin.value = 1 - int(pin.value)
            await RisingEdge(tb.clk)
        elif name == "host_attn":
            await tb.host_write(regmap.HOST_HOST_SEQ // 4, 1)
        else:
            await tb.pulse(name)
    names = [n for n in EVENT_BIT if n != "tick"]
    for name in names:
        await raise_(name)
        bit = 1 << EVENT_BIT[name]
        assert await tb.peek(reg("EVENT")) & ~16 == bit, name
        await tb.poke(reg("EVENT"), 0xEF ^ bit)
        assert await tb.peek(reg("EVENT")) & ~16 == bit, f"{name} cleared by another bit"
        await tb.poke(reg("EVENT"), bit)
        assert await tb.peek(reg("EVENT")) & ~16 == 0, name
    await raise_("apf_change")                                     # power back: an event again
    assert await tb.peek(reg("EVENT")) & ~16 == 8
    for name in ("cycle_done", "batch_done", "slave_lost", "exchange_done"):  # in the clock of the clearing write
        await tb.begin(WRITE[4], reg("EVENT"), 0xFF)
        while not (int(dut.regs_req.value) and int(dut.dwe.value)):
            await FallingEdge(tb.clk)
        await tb.pulse(name)
        await tb.finish()
        assert await tb.peek(reg("EVENT")) & ~16 == 1 << EVENT_BIT[name], f"{name} lost"


@cocotb.test(timeout_time=50, timeout_unit="ms")
async def time_and_tick(dut):
    """LK-014, EX-003: TIME counts microseconds, the tick comes every 1024 us, exact to the clock."""
    tb = TB(dut)
    await tb.start()
    await tb.until(dut.tick_us_o)
    assert await tb.until(dut.tick_us_o) == tb.us - 1
    before = int(dut.time_q.value)
    await ClockCycles(tb.clk, 50 * tb.us)
    await FallingEdge(tb.clk)
    assert int(dut.time_q.value) == before + 50
    for _ in range(3):
        await tb.begin(READ[4], reg("TIME"))
        await tb.until(dut.regs_req)
        now = int(dut.time_q.value)
        assert await tb.finish() == now > before
    await tb.poke(reg("EVENT_EN"), 16)
    await tb.do(IRQ_ON)
    clocks = []
    for _ in range(3):
        await tb.until(dut.irq, 0)
        await tb.until(dut.irq, 1, 1100 * tb.us)
        clocks.append(get_sim_time("ns") // 10)
        assert int(dut.time_q.value) % 1024 == 0
    assert [b - a for a, b in zip(clocks, clocks[1:])] == [1024 * tb.us] * 2


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def wait_sleeps(dut):
    """HW-004, LK-007: a read of WAIT is held until a masked event is pending; other events do not end it."""
    tb = TB(dut)
    await tb.start()
    await tb.poke(reg("EVENT_EN"), 0b000101)
    await tb.poke(reg("EVENT"), 0x3F)
    for name, others in (("cycle_done", ("batch_done",)), ("slave_lost", ("batch_done", "batch_done"))):
        await tb.begin(READ[4], reg("WAIT"))
        await tb.until(dut.core_wait_o)
        for other in others:
            await tb.pulse(other)
            await ClockCycles(tb.clk, 50)
            assert int(dut.core_wait_o.value) == 1, "an event that is not enabled ended the sleep"
        assert await tb.host_read(OP) == READ[4]                   # the host window answers while the core sleeps
        await tb.pulse(name)
        assert await tb.until(dut.core_wait_o, 0) <= 2
        assert await tb.finish() == 1 << EVENT_BIT[name]
        await tb.poke(reg("EVENT"), 0x3F)
    await tb.pulse("cycle_done")                                   # pending already: no wait
    await tb.begin(READ[4], reg("WAIT"))
    seen = First(RisingEdge(dut.core_wait_o), ClockCycles(tb.clk, 200))
    await seen
    assert int(dut.core_wait_o.value) == 0
    assert await tb.finish() == 1


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def interrupt(dut):
    """LK-007, LK-019: an enabled event interrupts the core once, a masked one when it is enabled; WAIT and interrupt go
    together."""
    tb = TB(dut)
    await tb.start()
    await tb.poke(reg("EVENT_EN"), 1)
    await tb.poke(reg("EVENT"), 0x3F)
    await tb.do(IRQ_ON)
    for n in range(1, 4):
        await tb.pulse("cycle_done")
        await ClockCycles(tb.clk, 300)
        assert await tb.host_read(IRQS) == n
    assert await tb.host_read(EVENTS) & ~16 == 1
    await tb.pulse("exchange_done")                                # not enabled yet
    await ClockCycles(tb.clk, 300)
    assert await tb.host_read(IRQS) == 3
    await tb.poke(reg("EVENT_EN"), 0x81)
    await ClockCycles(tb.clk, 300)
    assert await tb.host_read(IRQS) == 4
    assert await tb.host_read(EVENTS) & ~16 == 0x81
    await tb.pulse("batch_done")
    await ClockCycles(tb.clk, 300)
    assert await tb.host_read(IRQS) == 4
    await tb.begin(READ[4], reg("WAIT"))                           # asleep; the event ends the read and interrupts
    await tb.until(dut.core_wait_o)
    await tb.pulse("cycle_done")
    await tb.finish()
    assert await tb.host_read(IRQS) == 5
    await tb.do(IRQ_OFF)
    await tb.pulse("cycle_done")
    await ClockCycles(tb.clk, 300)
    assert await tb.host_read(IRQS) == 5 and await tb.peek(reg("EVENT")) & 1 == 1


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def host_interrupt(dut):
    """HW-005: HOST_IRQ raises host_irq_o until the host acknowledges."""
    tb = TB(dut)
    await tb.start()
    assert int(dut.host_irq_o.value) == 0
    for _ in range(2):
        await tb.poke(reg("HOST_IRQ"), 1)
        assert int(dut.host_irq_o.value) == 1
        await tb.host_write(regmap.HOST_IRQ_ACK // 4, 0)
        assert int(dut.host_irq_o.value) == 0


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def sequencer_owns_the_link_ram(dut):
    """LK-013: the sequencer gets a word each clock whatever the core does; the core's access waits and is right."""
    random.seed(4)
    tb = TB(dut)
    await tb.start()
    model = {}

    async def seq(addr, wdata=None):
        dut.seq_req_i.value, dut.seq_addr_i.value = 1, addr
        dut.seq_we_i.value = wdata is not None
        dut.seq_wdata_i.value = wdata or 0
        await RisingEdge(tb.clk)
        if wdata is not None:
            model[addr] = wdata
    for addr in range(128, 160):
        await seq(addr, random.getrandbits(32))
    dut.seq_req_i.value = 0
    for op, value in ((WRITE[1], 0xA5), (READ[4], 0)):
        await tb.begin(op, LINK + 4 * 10 + (op == WRITE[1]), value)
        await tb.until(dut.link_req)
        for k in range(40):                                        # every clock taken: reads and writes back to back
            addr = random.randrange(128, 160)
            if random.getrandbits(1):
                await seq(addr, random.getrandbits(32))
            else:
                await seq(addr)
                expected = model[addr]
                await FallingEdge(tb.clk)
                assert int(dut.seq_rdata_o.value) == expected
            assert int(dut.link_ready.value) == 0, "the core took a clock of the sequencer"
        dut.seq_req_i.value = 0
        result = await tb.finish()
    assert result >> 8 & 0xFF == 0xA5
    for addr, value in model.items():
        assert await tb.peek(LINK + 4 * addr) == value


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def flash(dut):
    """HW-007: SPI mode 0: both bytes right, eight clocks, select follows SPI_CTRL, SCK never above 16 MHz."""
    tb = TB(dut)
    await tb.start()
    assert int(dut.spi_cs_no.value) == 1 and int(dut.spi_sck_o.value) == 0
    await tb.poke(reg("SPI_CTRL"), 1)
    assert int(dut.spi_cs_no.value) == 0
    log = {"mosi": [], "edges": []}

    async def slave(answer):
        """Mode 0: data out before the first rising and after each falling edge, data in at the rising edge."""
        now, sck = 0, 0
        dut.spi_miso_i.value = answer >> 7
        while len(log["edges"]) < 16:
            await FallingEdge(tb.clk)
            now += 1
            level = int(dut.spi_sck_o.value)
            if level and not sck:
                log["mosi"].append(int(dut.spi_mosi_o.value))
            if level != sck:
                log["edges"].append(now)
            if sck and not level and len(log["edges"]) < 16:
                dut.spi_miso_i.value = answer >> (7 - len(log["edges"]) // 2) & 1
            sck = level
    half = -(-tb.us // 32)
    for out, back in ((0x03, 0xFF), (0xA5, 0x3C), (0x80, 0x01), (0x00, 0x80)):
        log["mosi"].clear()
        log["edges"].clear()
        task = cocotb.start_soon(slave(back))
        await tb.begin(WRITE[4], reg("SPI_DATA"), out)
        await tb.until(dut.spi_busy)
        await tb.finish()
        await task
        assert await tb.peek(reg("SPI_CTRL")) == 1
        assert int("".join(map(str, log["mosi"])), 2) == out
        assert {b - a for a, b in zip(log["edges"], log["edges"][1:])} == {half}
        assert await tb.peek(reg("SPI_DATA")) == back
    assert tb.us / (2 * half) <= 16
    await tb.poke(reg("SPI_CTRL"), 0)
    assert int(dut.spi_cs_no.value) == 1


@cocotb.test(timeout_time=10, timeout_unit="ms", skip=os.environ.get("BOOT") != "rom")
async def boot_rom(dut):
    """HW-007: with BootFromFlash the core starts in the boot ROM, reads constants from it and can jump to RAM."""
    tb = TB(dut)
    await tb.start()                                               # 'alive' came from the ROM through the data side
    words = [int(w, 16) for w in open(os.environ["PROBE_HEX"]).read().split()]
    for k in (0, len(words) - 1):
        assert await tb.peek(0x1000_0000 + 4 * k) == words[k]
    await tb.poke(0x1000_0000, ~words[0] & 0xFFFF_FFFF)
    assert await tb.peek(0x1000_0000) == words[0], "the boot ROM was written"
    await tb.poke(RAM, 0x00A5_0513)                                # addi a0, a0, 10
    await tb.poke(RAM + 4, 0x0000_8067)                            # ret
    assert await tb.do(CALL, RAM, 7) == 17
