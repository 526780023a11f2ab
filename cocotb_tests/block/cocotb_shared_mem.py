# SPDX-License-Identifier: Apache-2.0
"""asi_shared_mem: random traffic of both sides, clock by clock against a model."""
import random
from dataclasses import dataclass

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, RisingEdge


@dataclass
class Access:
    addr: int = 0
    we: int = 0
    clear: int = 0
    be: int = 15
    wdata: int = 0


def merge(old, new, be):
    mask = sum(0xFF << 8 * b for b in range(4) if be >> b & 1)
    return old & ~mask | new & mask


class TB:
    def __init__(self, dut):
        self.dut, self.words = dut, int(dut.Words.value)
        Clock(dut.clk_i, 10, unit="ns", impl="gpi").start()
        self.core = self.eng = None      # the present Access of each side
        self.ready = False               # the model's core_ready_o
        self.rdata = None                # what rdata_o must be, None: nobody has read
        self.mem = {}
        self.waits = 0
        dut.rst_i.value = 1

    async def reset(self):
        self.drive()
        await RisingEdge(self.dut.clk_i)
        await RisingEdge(self.dut.clk_i)
        self.dut.rst_i.value = 0

    def drive(self):
        core, eng = self.core or Access(), self.eng or Access()
        self.dut.core_req_i.value = self.core is not None
        self.dut.core_we_i.value, self.dut.core_clear_i.value = core.we, core.clear
        self.dut.core_be_i.value = core.be
        self.dut.core_addr_i.value, self.dut.core_wdata_i.value = core.addr, core.wdata
        self.dut.eng_req_i.value = self.eng is not None
        self.dut.eng_we_i.value, self.dut.eng_addr_i.value, self.dut.eng_wdata_i.value = eng.we, eng.addr, eng.wdata

    async def clock(self):
        """One clock with the present accesses -> (the core's access ends, read data, clearing clock)."""
        self.drive()
        await FallingEdge(self.dut.clk_i)
        assert int(self.dut.core_ready_o.value) == self.ready
        if self.rdata is not None:
            assert int(self.dut.rdata_o.value) == self.rdata
        result = self.ready, self.rdata
        core, eng = self.core, self.eng
        clear = self.ready and core.clear and not core.we
        go = core is not None and not self.ready and eng is None
        self.waits = 0 if core is None or self.ready or go else self.waits + 1
        self.rdata = None
        if clear:                                     # nobody gets between the read and this
            self.mem[core.addr] = 0
        elif eng is not None and eng.we:
            self.mem[eng.addr] = eng.wdata
        elif eng is not None:
            self.rdata = self.mem.get(eng.addr)
        elif go and core.we:
            self.mem[core.addr] = merge(self.mem[core.addr], core.wdata, core.be)
        elif go:
            self.rdata = self.mem[core.addr]
        self.ready = go
        await RisingEdge(self.dut.clk_i)
        return (*result, clear)


@cocotb.test(timeout_time=10, timeout_unit="ms")
async def random_traffic(dut):
    """ST-004, LK-006: 6000 clocks of bursts of the engine and reads, writes and clearing reads of the core: both read
    what was written last, the engine is served in each clock but the one of a clear, the core in the first free one."""
    random.seed(4)
    tb = TB(dut)
    await tb.reset()
    addrs = [0, 1, tb.words // 2, tb.words - 1]
    for addr in addrs:
        tb.eng = Access(addr, 1, wdata=random.getrandbits(32))
        await tb.clock()
    tb.eng = None
    met = {"clear meets engine": 0, "byte write": 0, "core waits": 0}
    burst = 0
    for _ in range(6000):
        if tb.core is None and random.random() < 0.5:
            tb.core = Access(random.choice(addrs), random.random() < 0.3, random.random() < 0.5, random.getrandbits(4),
                             random.getrandbits(32))
            met["byte write"] += tb.core.we and tb.core.be not in (0, 15)
        first = burst == 0 and random.random() < 0.2
        if first:
            burst = random.randrange(2, 12)
            tb.eng = Access(random.choice(addrs))
        ended, _, clear = await tb.clock()
        met["core waits"] += tb.waits == 5
        if ended:
            tb.core = None
        if burst:
            burst -= 1
            met["clear meets engine"] += clear and first
            if not first:                             # the first read is made twice
                tb.eng = Access(random.choice(addrs), random.getrandbits(1), wdata=random.getrandbits(32))
            if not burst:
                tb.eng = None
    assert all(n > 20 for n in met.values()), met


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def clearing_read(dut):
    """ST-004: a clearing read gives the word and leaves 0, whatever its byte enables; a write with the clear line is a
    plain write; an engine that begins in each clock around it reads the word before or 0 after, nothing else."""
    tb = TB(dut)
    await tb.reset()
    for begin in range(-2, 4):                        # the engine's first clock, from the core's request
        tb.eng = Access(3, 1, wdata=0x12345678)
        await tb.clock()
        tb.eng = None
        tb.core, seen, got = None, [], None
        for clock in range(-2, 8):
            if clock == 0:
                tb.core = Access(3, 0, 1, be=0)
            tb.eng = Access(3) if begin <= clock < begin + 3 else None
            ended, rdata, _ = await tb.clock()
            if ended:
                got, tb.core = rdata, None
            elif rdata is not None:
                seen.append(rdata)
        assert got == 0x12345678 and tb.mem[3] == 0
        assert seen and seen in ([got] * len(seen), [0] * len(seen)), (begin, seen)
    tb.core = Access(3, 1, 1, 0b0110, 0xAABBCCDD)
    while not (await tb.clock())[0]:
        pass
    assert tb.mem[3] == 0x00BBCC00
    tb.core = Access(3)
    while not (got := await tb.clock())[0]:
        pass
    assert got[1] == 0x00BBCC00
