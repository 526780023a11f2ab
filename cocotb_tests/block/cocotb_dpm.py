# SPDX-License-Identifier: Apache-2.0
import random

import cocotb
from asi import regmap
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, RisingEdge

from cocotb_tests.block.hostport import Port

# (byte enables, name): every legal byte, half-word and word
SIZES = (1, 2, 4, 8, 3, 12, 15)


class TB:
    """Both ports, and the memory as it must be: accesses take effect in the order of their readies."""

    def __init__(self, dut):
        self.dut, self.clk, self.mem = dut, dut.clk_i, {}
        Clock(dut.clk_i, 10, unit="ns", impl="gpi").start()
        self.core, self.host = Port(dut, "core", dut.clk_i), Port(dut, "host", dut.clk_i)
        dut.irq_set_i.value = 0
        dut.rst_i.value = 1

    async def reset(self):
        for _ in range(2):
            await RisingEdge(self.clk)
        self.dut.rst_i.value = 0
        await RisingEdge(self.clk)

    async def clocks(self, n):
        for _ in range(n):
            await RisingEdge(self.clk)

    async def do(self, port, op, more=False):
        """op: (word, we, be, wdata); a read is compared with the model. -> clocks until ready"""
        word, we, be, wdata = op
        expected = []

        def at_ready():
            old = self.mem.get(word, 0)
            if we:
                mask = sum(0xFF << 8 * b for b in range(4) if be >> b & 1)
                self.mem[word] = old & ~mask | wdata & mask
            expected.append(old)

        port.done = at_ready
        data, clocks = await port.access(word, we, be, wdata, more)
        if not we:
            assert data == expected[0], f"word {word:#x}: read {data:#010x}, must be {expected[0]:#010x}"
        return clocks

    async def fill(self, words):
        for word in words:
            await self.do(self.core, (word, 1, 15, random.getrandbits(32)))


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def sizes_at_every_offset(dut):
    """HW-006: byte, half-word and word from both sides, at every relative offset, leave their neighbours alone."""
    random.seed(1)
    tb = TB(dut)
    await tb.reset()
    await tb.fill(range(8, 12))
    met = 0
    for offset in range(-3, 4):                                    # host request this many clocks after the core's
        for core_be in SIZES:
            for host_be in SIZES:
                for kinds in ((1, 1), (1, 0), (0, 1)):
                    word = random.choice((9, 10))
                    ops = [(word if same else 19 - word, we, be, random.getrandbits(32)) for we, be, same in
                           zip(kinds, (core_be, host_be), (True, random.random() < 0.7))]

                    async def late(port, op, delay):
                        await tb.clocks(delay)
                        return await tb.do(port, op)
                    tasks = [cocotb.start_soon(late(tb.core, ops[0], max(0, -offset))),
                             cocotb.start_soon(late(tb.host, ops[1], max(0, offset)))]
                    waits = [await t for t in tasks]
                    met += waits[1] > 1
                    assert waits[0] <= 2 and waits[1] <= 2
                    await tb.clocks(1)
        for word in range(8, 12):                                  # neighbours too
            await tb.do(tb.host, (word, 0, 15, 0))
    assert met >= len(SIZES) ** 2, "the two sides never met"


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def random_traffic(dut):
    """HW-006: 2 x 1500 random accesses on 8 words, with and without pauses, read what was written last."""
    random.seed(2)
    tb = TB(dut)
    await tb.reset()
    words = (0, 1, 2, 0x7FF, 0x800, 0xFFD, 0xFFE, 0xFFF)
    await tb.fill(words)

    async def traffic(port):
        worst = 0
        for k in range(1500):
            pause = random.choice((0, 0, 1, 2, 5)) if k < 1499 else 1
            op = (random.choice(words), random.getrandbits(1), random.choice(SIZES), random.getrandbits(32))
            worst = max(worst, await tb.do(port, op, more=pause == 0))
            await tb.clocks(pause)
        return worst
    tasks = [cocotb.start_soon(traffic(p)) for p in (tb.core, tb.host)]
    worst = [await t for t in tasks]
    assert worst == [1, 2], worst                                  # the core never waits, the host one clock at most


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def nobody_starves(dut):
    """HW-006: with both sides always asking, each gets exactly every second clock."""
    tb = TB(dut)
    await tb.reset()
    await tb.fill(range(2))
    counts = {"core": 0, "host": 0}

    async def always(name, port):
        while True:
            await tb.do(port, (0, 0, 15, 0), more=True)
            counts[name] += 1
    for name, port in (("core", tb.core), ("host", tb.host)):
        cocotb.start_soon(always(name, port))
    await tb.clocks(20)
    before = dict(counts)
    await tb.clocks(200)
    assert {name: counts[name] - before[name] for name in counts} == {"core": 100, "host": 100}


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def interrupt_and_attention(dut):
    """HW-005, HW-002: host_irq_o from set to the acknowledge; HOST_SEQ raises attention, one clock per host write."""
    tb = TB(dut)
    await tb.reset()
    attn = []

    async def watch():
        while True:
            await FallingEdge(tb.clk)
            attn.append(int(dut.host_attn_o.value))
    cocotb.start_soon(watch())

    async def pulse_set():
        dut.irq_set_i.value = 1
        await tb.clocks(1)
        dut.irq_set_i.value = 0
    ack, seq = regmap.HOST_IRQ_ACK // 4, regmap.HOST_HOST_SEQ // 4

    async def irq():
        await FallingEdge(tb.clk)
        level = int(dut.host_irq_o.value)
        await RisingEdge(tb.clk)
        return level
    assert await irq() == 0
    await pulse_set()
    assert await irq() == 1
    for port, word, we in ((tb.host, ack, 0), (tb.core, ack, 1), (tb.host, ack - 1, 1), (tb.host, ack + 1, 1)):
        await tb.do(port, (word, we, 15, 0))                       # none of these acknowledges
        assert await irq() == 1
    await tb.do(tb.host, (ack, 1, 1, 0))
    assert await irq() == 0
    # set in the clock of the acknowledge is not lost; one clock before, it is acknowledged
    for early, level in ((0, 1), (1, 0)):
        await pulse_set()
        task = cocotb.start_soon(pulse_set()) if early else None
        await tb.clocks(early)
        if not early:
            cocotb.start_soon(pulse_set())
        await tb.do(tb.host, (ack, 1, 15, 0))
        if task:
            await task
        assert await irq() == level, early
        await tb.do(tb.host, (ack, 1, 15, 0))
    assert sum(attn) == 0
    await tb.do(tb.core, (seq, 1, 15, 5))
    await tb.do(tb.host, (seq, 0, 15, 5))
    assert sum(attn) == 0
    await tb.do(tb.host, (seq, 1, 15, 6))
    await tb.do(tb.host, (seq, 1, 1, 7))
    assert sum(attn) == 2


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def reset_clears_magic(dut):
    """HW-001: after a reset MAGIC reads 0 and everything else is as it was, whatever the ports do in it."""
    tb = TB(dut)
    await tb.reset()
    words = (regmap.HOST_MAGIC // 4, regmap.HOST_MAGIC // 4 + 1, 0xFFF)
    await tb.fill(words)
    dut.rst_i.value = 1
    await tb.reset()
    tb.mem[words[0]] = 0
    for word in words:
        await tb.do(tb.host, (word, 0, 15, 0))
