# SPDX-License-Identifier: Apache-2.0
"""asi_stats with its memory: attempts in, words out, against a model of the rules."""
import random
from types import SimpleNamespace

import cocotb
from asi.regmap import ErrorClass
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, RisingEdge

from cocotb_tests.block.hostport import Port

REPEAT_OK, REPEAT_FAILED, DELAY, DELAY_SUM, DEVIATION = 11, 12, 13, 14, 15
CLASSES = [c for c in ErrorClass if c is not ErrorClass.ABORTED]
BUSY = 17                                # most clocks of one attempt


class CorePort(Port):
    """Core port; the clear line goes with the address, as two windows of the memory map do."""

    def __init__(self, dut):
        super().__init__(dut, "core", dut.clk_i)
        self.clear = dut.core_clear_i
        self.clear.value = 0

    async def read(self, word, clear=False):
        self.clear.value = int(clear)
        return (await self.access(word))[0]

    async def write(self, word, value):
        self.clear.value = 0
        await self.access(word, we=1, wdata=value)


class Model:
    """ST-001 .. ST-003 once more: 64 times 16 words."""

    def __init__(self):
        self.words = [0] * 1024

    def attempt(self, a):
        if a.error is ErrorClass.ABORTED:
            return
        base = 16 * a.index
        counts = [a.error]
        if a.repeat and a.final:
            counts.append(REPEAT_OK if a.error is ErrorClass.OK else REPEAT_FAILED)
        for word in counts:
            self.words[base + word] = (self.words[base + word] + 1) % 2**32
        if a.error is ErrorClass.OK:
            low, high = self.words[base + DELAY] & 0xFFFF, self.words[base + DELAY] >> 16
            self.words[base + DELAY] = (min(low, a.delay) if low else a.delay) | max(high, a.delay) << 16
            self.words[base + DELAY_SUM] = (self.words[base + DELAY_SUM] + a.delay) % 2**32
            if a.dev > self.words[base + DEVIATION] & 0xFF:
                self.words[base + DEVIATION] = a.dev | a.late << 8


def attempt(index, error, repeat=0, final=1, delay=300, dev=3, late=1):
    return SimpleNamespace(index=index, error=error, repeat=repeat, final=final, delay=delay, dev=dev, late=late)


def any_attempt(index):
    return attempt(index, random.choice([ErrorClass.OK, random.choice(CLASSES)]), random.getrandbits(1),
                   random.getrandbits(1), random.randrange(96, 1600), random.choice((0, 1, random.randrange(256))),
                   random.getrandbits(1))


class TB:
    def __init__(self, dut):
        self.dut, self.model = dut, Model()
        Clock(dut.clk_i, 10, unit="ns", impl="gpi").start()
        self.core = CorePort(dut)
        dut.att_valid_i.value = 0
        self.idle()

    def idle(self):
        """Garbage on the attempt inputs: they count in the clock of att_valid_i only."""
        for pin, bits in ((self.dut.att_index_i, 6), (self.dut.att_class_i, 4), (self.dut.att_delay_i, 16),
                          (self.dut.att_dev_i, 8), (self.dut.att_repeat_i, 1), (self.dut.att_final_i, 1),
                          (self.dut.att_dev_late_i, 1)):
            pin.value = random.getrandbits(bits)

    async def clocks(self, n):
        for _ in range(n):
            await RisingEdge(self.dut.clk_i)

    async def reset(self):
        self.dut.rst_i.value = 1
        await self.clocks(2)
        self.dut.rst_i.value = 0
        self.model = Model()

    async def start(self):
        await self.reset()
        await self.clocks(1026)
        return self

    async def send(self, a, wait=BUSY + 2):
        d = self.dut
        d.att_valid_i.value, d.att_index_i.value, d.att_class_i.value = 1, a.index, a.error
        d.att_repeat_i.value, d.att_final_i.value, d.att_delay_i.value = a.repeat, a.final, a.delay
        d.att_dev_i.value, d.att_dev_late_i.value = a.dev, a.late
        await self.clocks(1)
        d.att_valid_i.value = 0
        self.idle()
        self.model.attempt(a)
        await self.clocks(wait)

    async def check(self, words=range(1024)):
        for word in words:
            got = await self.core.read(word)
            want = self.model.words[word]
            assert got == want, f"word {word % 16} of index {word // 16}: {got:#x}, not {want:#x}"


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def zero_after_reset(dut):
    """ST-005: whatever was there and whenever reset comes, all 1024 words are 0 after 1024 clocks, and a core that asks
    at once gets 0."""
    random.seed(1)
    tb = await TB(dut).start()
    for word in range(0, 1024, 7):
        await tb.core.write(word, random.getrandbits(32))
    await tb.send(attempt(9, ErrorClass.OK, 1, delay=0xFFFF, dev=0xFF), wait=5)   # reset in the middle of an update
    await tb.reset()
    begin = cocotb.utils.get_sim_time("ns")
    for _ in range(1024):                              # the engine holds the port all the time
        await FallingEdge(dut.clk_i)
        assert dut.mem_req_o.value == 1
    await RisingEdge(dut.clk_i)
    await tb.check()
    assert cocotb.utils.get_sim_time("ns") - begin < 4 * 1024 * 10


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def one_word_per_class(dut):
    """ST-001, ST-003: an attempt counts once, in the word of its class and index, A and B apart; ABORTED nowhere; all
    other words stay."""
    random.seed(2)
    tb = await TB(dut).start()
    for error in ErrorClass:
        for index in (0, 1, 31, 33, 63, random.randrange(64)):
            for repeat, final in ((0, 0), (0, 1), (1, 0), (1, 1)):
                await tb.send(attempt(index, error, repeat, final))
    await tb.check()
    assert sum(tb.model.words[16 * 33 + c] for c in CLASSES) >= 4 * len(CLASSES)


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def delays_and_deviations(dut):
    """ST-002: smallest, largest, sum of the delays and the largest deviation with its sign: edges of each comparison,
    then 200 random attempts."""
    random.seed(3)
    tb = await TB(dut).start()
    for delay in (500, 500, 499, 501, 498, 0x100, 0xFFFF, 1, 0xFF00):
        await tb.send(attempt(5, ErrorClass.OK, delay=delay, dev=0))
        await tb.check(range(80, 96))
    for dev, late in ((0, 1), (4, 0), (4, 1), (3, 1), (5, 1), (5, 0), (255, 0), (255, 1)):
        await tb.send(attempt(37, ErrorClass.OK, dev=dev, late=late))
        await tb.check(range(16 * 37, 16 * 38))
    for error in CLASSES[1:]:                          # failures leave these words alone
        await tb.send(attempt(5, error, delay=2, dev=255))
    for _ in range(200):
        await tb.send(any_attempt(random.choice((5, 6, 37, 38))))
    await tb.check()


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def carries_and_wrap(dut):
    """ST-001, ST-002: 32 bits: a carry goes into the upper half; counters and the sum wrap."""
    tb = await TB(dut).start()
    for value in (0xFFFF, 0x1FFFF, 0xFFFFFFFF, 0x7FFFFFFF):
        for word in (ErrorClass.OK, ErrorClass.PARITY, REPEAT_OK, REPEAT_FAILED, DELAY_SUM):
            tb.model.words[16 * 7 + word] = value
            await tb.core.write(16 * 7 + word, value)
        for error in (ErrorClass.OK, ErrorClass.PARITY):
            await tb.send(attempt(7, error, 1, 1, delay=1))
        await tb.check(range(16 * 7, 16 * 8))


@cocotb.test(timeout_time=50, timeout_unit="ms")
async def nothing_lost_nothing_doubled(dut):
    """ST-004: 700 attempts, one every 20 clocks and more, while the core reads and clears the same words without a
    pause: what it took and what is left is what happened, and it never sees a part of an attempt's counts."""
    random.seed(5)
    tb = await TB(dut).start()
    indices = (2, 34)
    sent, running = [], [True]
    taken = [0] * 1024                                 # sums of the clearing reads
    delays = {index: [] for index in indices}          # the DELAY words that came
    worst = [0]

    async def reader():
        while running[0]:
            word = 16 * random.choice(indices) + random.choice((0, 0, 7, 11, 12, 13, 14))
            clear = random.random() < 0.6
            tb.core.clear.value = int(clear)
            value, clocks = await tb.core.access(word)
            worst[0] = max(worst[0], clocks)
            if clear and word % 16 == DELAY:
                delays[word // 16].append(value)
            elif clear:
                taken[word] += value
            await tb.clocks(random.choice((0, 0, 1, 3, 17)))
    task = cocotb.start_soon(reader())
    for _ in range(700):
        a = any_attempt(random.choice(indices))
        a.error = random.choice((ErrorClass.OK, ErrorClass.PARITY))
        sent.append(a)
        await tb.send(a, wait=19 + random.choice((0, 1, 2, 5, 30)))
    running[0] = False
    await task
    assert worst[0] <= BUSY + 2, worst
    for index in indices:
        base = 16 * index
        for word in (0, 7, 11, 12, 14):
            taken[base + word] = (taken[base + word] + await tb.core.read(base + word, clear=True)) % 2**32
            assert await tb.core.read(base + word) == 0
            assert taken[base + word] == tb.model.words[base + word], (index, word)
        delays[index].append(await tb.core.read(base + DELAY, clear=True))
        seen = [d for d in delays[index] if d]
        good = [a.delay for a in sent if a.index == index and a.error is ErrorClass.OK]
        assert min(d & 0xFFFF for d in seen) == min(good) and max(d >> 16 for d in seen) == max(good)
        assert len(seen) > 20
    await tb.check(word for word in range(1024) if word // 16 not in indices)
