# SPDX-License-Identifier: Apache-2.0
"""asi_seq against a small independent model of its rules: every request, every link RAM word.

Times are in clocks of 8 MHz (125 ns). A call takes CALL clocks per attempt unless a test says otherwise: shorter than a
real one, longer than the search for the next slot. GAP is the shortest real gap, 6 us after a time-out.
"""
import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import ClockCycles, FallingEdge, RisingEdge

OK, NO_RESPONSE, PARITY, ABORTED = 0, 1, 7, 15
DEXG, MGMT, INCL = 3, 4, 5                 # phase_e while the call is on the line
STATE, BATCH, OUT_IMG, OUT_SNAP, IN_WORK, IN_IMG = 0x40, 0x80, 0xC0, 0xC8, 0xD0, 0xD8
MGMT_REQ, MGMT_RES, INCL_REQ, INCL_RES, SENT, REPEATED, FAILED, CYCLES = range(0xE0, 0xE8)
VALID = 1 << 31
ACTIVE, EXTENDED, LIVE = 1, 2, 4           # SLOT
EXCHANGE = "exchange_done"
CALL, GAP, US = 350, 48, 8
OFFER_MAX = 36                             # longest time from a result to the next offer, any path


def request(call, tag=0, retries=0, no_reply=0, valid=0):
    return call | no_reply << 11 | retries << 12 | tag << 16 | valid << 31


def nibble(ram, base, index):
    return ram[base + index // 8] >> 4 * (index % 8) & 15


class Model:
    """The rules of the cycle on a link RAM of its own. A cycle is a generator of requests; results are sent in. It
    also yields EXCHANGE, where exchange_done is due, with every word as it must be then."""

    def __init__(self, fail_cycles, dexg_retry):
        self.ram, self.odd, self.was_mgmt, self.lost = [0] * 256, 0, False, 0
        self.fail_cycles, self.dexg_retry = fail_cycles, dexg_retry
        self.read_id = lambda: False

    def count(self, result):
        last, _, _, repeats = result
        self.ram[SENT] += repeats + 1
        self.ram[REPEATED] += repeats
        self.ram[FAILED] += last not in (OK, ABORTED)

    def callable(self, index):
        return self.ram[index] & 1 and (self.ram[STATE + index] >> 16 & 7) < self.fail_cycles

    def set_input(self, index, value):
        word = IN_WORK + index // 8
        self.ram[word] = self.ram[word] & ~(15 << 4 * (index % 8)) | value << 4 * (index % 8)

    def slot_call(self, index):
        """-> the request word of a slot, as of now."""
        number, b = index & 31, index >> 5
        if self.read_id():
            return 1 << 10 | number << 5 | 0b10001 ^ b << 3
        out = nibble(self.ram, OUT_IMG if self.ram[index] & LIVE else OUT_SNAP, index)
        return number << 5 | (out & 7 | (1 - b) << 3 if self.ram[index] & EXTENDED else out)

    def book_slot(self, index, call, result):
        last, first, data, repeats = result
        old = self.ram[STATE + index]
        value, streak, sent, calls = old & 15, old >> 16 & 7, old >> 20 & 15, old >> 28
        if last != ABORTED:
            sent, calls = call & 15, calls + 1 & 15
        if last == OK:
            value, streak = data, 0
            self.set_input(index, data)
        elif last != ABORTED:
            streak += 1
            if streak == self.fail_cycles:
                self.set_input(index, 0)
                self.lost += 1
        self.ram[STATE + index] = (value | last << 4 | first << 8 | repeats << 12 | streak << 16 | sent << 20 |
                                   calls << 28)
        self.count(result)

    def book(self, word, tag, result):
        last, first, data, repeats = result
        self.ram[word] = (data if last == OK else 0) | last << 4 | first << 8 | repeats << 12 | tag << 16
        self.count(result)

    def extra(self, phase, word):
        req = self.ram[word]
        result = yield phase, req & 0x7FF, req >> 12 & 3, req >> 11 & 1
        self.book(word + 1, req >> 16 & 255, result)
        return result[0] == ABORTED

    def cycle(self, hold, two_extra):
        """Yields (phase, call, retries, no_reply), takes (last, first, data, repeats); ends early when aborted."""
        ram = self.ram
        if not hold:
            ram[OUT_SNAP:OUT_SNAP + 8] = ram[OUT_IMG:OUT_IMG + 8]
        called = False
        for number in range(1, 32):
            a, b = number, number + 32
            if self.callable(a) and self.callable(b):
                index = b if self.odd else a
            elif self.callable(a) or self.callable(b):
                index = a if self.callable(a) else b
            else:
                continue
            call, called = self.slot_call(index), True
            result = yield DEXG, call, self.dexg_retry, 0
            self.book_slot(index, call, result)
            if result[0] == ABORTED:
                return
        if called:
            yield EXCHANGE
        pending = (ram[MGMT_REQ] ^ ram[MGMT_RES]) >> 16 & 255 != 0
        if two_extra:
            self.was_mgmt = pending
            if pending and (yield from self.extra(MGMT, MGMT_REQ)):
                return
            self.was_mgmt = False
            if ram[INCL_REQ] & VALID and (yield from self.extra(INCL, INCL_REQ)):
                return
        elif pending and not (self.was_mgmt and ram[INCL_REQ] & VALID):
            self.was_mgmt = True
            if (yield from self.extra(MGMT, MGMT_REQ)):
                return
        else:
            self.was_mgmt = False
            if ram[INCL_REQ] & VALID and (yield from self.extra(INCL, INCL_REQ)):
                return
        ram[IN_IMG:IN_IMG + 8] = ram[IN_WORK:IN_WORK + 8]
        ram[CYCLES] += 1
        self.odd ^= 1


class TB:
    """Clock, link RAM and answers. `answer(call)` -> (last, first, data, repeats) decides; `calls` is the record."""

    def __init__(self, dut):
        self.dut = dut
        self.model = Model(int(dut.FailCycles.value), int(dut.DexgRetry.value))
        self.words = [dut.ram[k] for k in range(256)]
        self.model.read_id = lambda: int(dut.read_id_i.value)
        self.answer = lambda call: (OK, OK, call >> 5 & 15, 0)
        self.on_call = lambda count: None
        self.length = lambda call: CALL
        self.calls, self.gen, self.pending_result, self.exchanged = [], None, None, False
        self.judged = self.strict = True   # judged: compare with the model; strict: no offer may be late
        self.checked = self.published = self.dropped = 0  # dropped: cycles begun, but ended without publication
        Clock(dut.clk_i, 125, unit="ns").start()

    async def start(self):
        dut = self.dut
        for pin in (dut.cycle_en_i, dut.two_extra_i, dut.out_hold_i, dut.read_id_i, dut.batch_start_i, dut.batch_len_i,
                    dut.min_cycle_us_i, dut.core_req_i, dut.core_addr_i, dut.core_wdata_i, dut.rsp_last_i,
                    dut.rsp_first_i, dut.rsp_data_i, dut.rsp_repeats_i):
            pin.value = 0
        dut.enable_i.value = 1
        dut.rsp_clocks_i.value = dut.again_clocks_i.value = CALL
        dut.gap_clocks_i.value = GAP
        dut.rst_i.value = 1
        for word in self.words:
            word.value = 0
        await ClockCycles(dut.clk_i, 3)
        dut.rst_i.value = 0
        await FallingEdge(dut.clk_i)
        cocotb.start_soon(self._serve())
        cocotb.start_soon(self._publish())
        cocotb.start_soon(self._exchange())

    def poke(self, word, value):
        """Firmware writes, at once."""
        self.words[word].value = value
        self.model.ram[word] = value

    def peek(self, word):
        return int(self.words[word].value)

    def compare(self, words):
        for k in words:
            assert self.peek(k) == self.model.ram[k], f"word {k:#x}: {self.peek(k):#x}, model {self.model.ram[k]:#x}"
        self.checked += len(words)

    def _result(self):
        dut, data = self.dut, self.pending_result
        self.pending_result = None
        return int(dut.res_last_o.value), int(dut.res_first_o.value), data, int(dut.res_repeats_o.value)

    def _advance(self):
        """Model: book the last result, -> the next request of this cycle, EXCHANGE or None."""
        self.exchanged = False
        if self.gen is None:
            self.gen = self.model.cycle(int(self.dut.out_hold_i.value), int(self.dut.two_extra_i.value))
            step = lambda: next(self.gen)  # noqa: E731
        else:
            result = self._result()
            step = lambda: self.gen.send(result)  # noqa: E731
        try:
            return step()
        except StopIteration:
            self.gen = None
            return None

    async def _serve(self):
        dut = self.dut
        while True:
            await dut.acc_count_o.value_change
            call = int(dut.call_o.value)
            got = (int(dut.phase_o.value), call, int(dut.retries_o.value), int(dut.no_reply_o.value))
            late = int(dut.late_o.value)
            self.calls.append((int(dut.acc_time_o.value), *got, late))
            last, first, data, repeats = self.answer(call)
            dut.rsp_last_i.value, dut.rsp_first_i.value = last, first
            dut.rsp_data_i.value, dut.rsp_repeats_i.value = data, repeats
            dut.rsp_clocks_i.value = dut.again_clocks_i.value = self.length(call)
            if self.judged and int(dut.cycle_busy_o.value):
                fresh = self.gen is None
                expected = self._advance()
                assert got == expected, f"call {len(self.calls)}: {got}, model {expected}"
                if self.strict and not fresh:
                    assert late == 0, f"call {len(self.calls)}: offered {late} clocks after the gap"
                    self.compare(range(OUT_IMG, SENT))  # SLOT_STATE: at the end of the cycle
            self.pending_result = data
            self.on_call(len(self.calls))

    async def _exchange(self):
        """At each exchange_done: the model must be there too, with every word but those of the next snapshot."""
        dut = self.dut
        while True:
            await dut.exchange_count_o.value_change
            if not self.judged:
                continue
            assert not int(dut.req_valid_o.value) and self.pending_result is not None, "exchange_done: a call is open"
            step = self._advance() if self.gen else "no cycle"
            assert step == EXCHANGE, f"exchange_done, model expects {step}"
            self.exchanged = True
            self.compare([k for k in range(256) if not OUT_SNAP <= k < IN_WORK])

    async def _publish(self):
        """At each cycle_done: the model must have reached the same end; every word is compared."""
        dut = self.dut
        while True:
            await dut.cycle_count_o.value_change
            self.published += 1
            if not self.judged:
                continue
            left = self._advance()
            assert left is None, f"cycle_done, model expects {left}"
            self.compare([k for k in range(256) if not OUT_SNAP <= k < IN_WORK])  # the snapshot: with each call
            assert int(dut.cycle_count_o.value) == self.peek(CYCLES) & 0xFFFF
            assert int(dut.lost_count_o.value) == self.model.lost

    async def cycles(self, count, stop=True):
        """Run count more cycles; with stop=True the sequencer is idle afterwards."""
        dut, goal = self.dut, self.published + count
        if not int(dut.cycle_busy_o.value):
            dut.cycle_en_i.value = 1
        while stop and self.published < goal - 1:
            await dut.cycle_count_o.value_change
            await FallingEdge(dut.clk_i)
        if stop:
            while int(dut.begun_count_o.value) == int(dut.cycle_count_o.value) + self.dropped:
                await RisingEdge(dut.clk_i)
            dut.cycle_en_i.value = 0
        while self.published < goal:
            await dut.cycle_count_o.value_change
            await FallingEdge(dut.clk_i)  # _publish has counted by now
        if stop:
            await self.idle()

    async def idle(self):
        self.dut.cycle_en_i.value = 0
        while int(self.dut.cycle_busy_o.value) or int(self.dut.batch_busy_o.value):
            await FallingEdge(self.dut.clk_i)

    async def batch(self, entries):
        """-> result words"""
        dut, first = self.dut, int(self.dut.batch_count_o.value)
        await FallingEdge(dut.clk_i)
        for k, word in enumerate(entries):
            self.poke(BATCH + k, word)
        dut.batch_start_i.value = 1
        await FallingEdge(dut.clk_i)
        dut.batch_start_i.value = 0
        dut.batch_len_i.value = len(entries)  # as from a register: one clock after the pulse
        while int(dut.batch_count_o.value) == first:
            await FallingEdge(dut.clk_i)
        assert int(dut.batch_count_o.value) == first + 1 and not int(dut.batch_busy_o.value)
        results = [self.peek(BATCH + k) for k in range(len(entries))]
        for k, word in enumerate(results):
            self.model.ram[BATCH + k] = word
        for k in (SENT, REPEATED, FAILED):
            self.model.ram[k] = self.peek(k)
        return results

    def numbers(self, first=0):
        """Called numbers, one list per cycle, from call `first`."""
        out, last = [], 99
        for _, phase, call, *_ in self.calls[first:]:
            if phase == DEXG:
                number = call >> 5
                if number <= last:
                    out.append([])
                out[-1].append(number)
                last = number
            else:
                last = 99
        return out


@cocotb.test(timeout_time=60, timeout_unit="ms")
async def rising_order(dut):
    """LK-001: each cycle calls every active number once, in rising order; 0 and index 32 are never called."""
    tb = TB(dut)
    await tb.start()
    for index in (0, 32, 31, 1, 17, 2, 30):
        tb.poke(index, 1)
    await tb.cycles(3)
    assert tb.numbers() == [[1, 2, 17, 30, 31]] * 3
    for index in range(64):
        tb.poke(index, 0)
    tb.poke(31, 1)
    await tb.cycles(2)
    assert [c >> 5 for _, _, c, *_ in tb.calls[15:]] == [31, 31]


@cocotb.test(timeout_time=60, timeout_unit="ms")
async def turns(dut):
    """LK-002, CA-001, CA-004: A in even, B in odd cycles when both are active, with I3 = ~Sel; a single one always."""
    tb = TB(dut)
    await tb.start()
    for index in (5, 37, 9, 42):
        tb.poke(index, 3)
    for k in range(8):
        tb.poke(OUT_IMG + k, 0x76543210 if k < 4 else 0x0)
    await tb.cycles(4)
    calls = [c for _, _, c, *_ in tb.calls]
    a5, b5 = 5 << 5 | 13, 5 << 5 | 0  # image nibble of 5 is 5 with bit 3 = 1; of 5B 0 with bit 3 = 0
    assert calls == [a5, 9 << 5 | 9, 10 << 5, b5, 9 << 5 | 9, 10 << 5] * 2
    tb.poke(5, 0)
    await tb.cycles(2)
    assert [c for _, _, c, *_ in tb.calls[12:]] == [b5, 9 << 5 | 9, 10 << 5] * 2


@cocotb.test(timeout_time=60, timeout_unit="ms")
async def lost_slave(dut):
    """LK-003, LK-004, LK-005: DexgRetry repetitions, FailCycles cycles, then no call; the input is kept, then 0."""
    tb = TB(dut)
    fail, retry = tb.model.fail_cycles, tb.model.dexg_retry
    await tb.start()
    tb.poke(4, 1)
    tb.poke(20, 1)
    dead = set()
    tb.answer = lambda call: (NO_RESPONSE, PARITY, 15, retry) if call >> 5 in dead else (OK, OK, 0xA, 0)
    await tb.cycles(2)
    assert all(c[3] == retry for c in tb.calls)
    assert nibble([tb.peek(k) for k in range(256)], IN_IMG, 20) == 0xA
    dead.add(20)
    sent, first = tb.peek(SENT), len(tb.calls)
    for k in range(fail):
        await tb.cycles(1)
        expected = 0 if k == fail - 1 else 0xA
        assert nibble([tb.peek(k) for k in range(256)], IN_IMG, 20) == expected
        assert tb.peek(STATE + 20) == (0xA | NO_RESPONSE << 4 | PARITY << 8 | retry << 12 | (k + 1) << 16 |
                                       (k + 3) << 28)
    assert int(dut.lost_count_o.value) == 1
    await tb.cycles(3)
    assert sum(c[2] >> 5 == 20 for c in tb.calls[first:]) == fail
    assert tb.peek(SENT) - sent == fail * (1 + retry) + fail + 3  # the dead slave: 6 requests by default
    assert tb.peek(FAILED) == fail and tb.peek(REPEATED) == fail * retry
    # a good answer clears the count: one cycle short of the limit is never lost
    tb.poke(STATE + 20, 0)
    for _ in range(2):
        dead.add(20)
        await tb.cycles(fail - 1) if fail > 1 else None
        dead.clear()
        await tb.cycles(1)
    assert int(dut.lost_count_o.value) == 1


@cocotb.test(timeout_time=60, timeout_unit="ms")
async def only_slave_lost(dut):
    """LK-004, LK-015: the only slave is lost at the end of a cycle: it is not called once more, although the search
    found it."""
    tb = TB(dut)
    fail = tb.model.fail_cycles
    await tb.start()
    tb.poke(7, 1)
    tb.answer = lambda call: (NO_RESPONSE, NO_RESPONSE, 0, 0)
    await tb.cycles(fail + 2)
    assert len(tb.calls) == fail
    # the same with both of a number: each is called FailCycles times
    tb.poke(7, 3)
    tb.poke(39, 3)
    tb.poke(STATE + 7, 0)
    await tb.cycles(2 * fail + 3)
    assert len(tb.calls) == 3 * fail and int(dut.lost_count_o.value) == 3


# one slave in each word of the images, in the order of calls
SPREAD = (1, 34, 8, 41, 16, 50, 24, 58)


async def core_write(dut, word, value):
    """One write of the core through the arbiter."""
    dut.core_req_i.value, dut.core_addr_i.value, dut.core_wdata_i.value = 1, word, value
    while True:
        await FallingEdge(dut.clk_i)
        if int(dut.core_ack_o.value):
            break
    await RisingEdge(dut.clk_i)
    dut.core_req_i.value = 0


def outputs_per_cycle(tb):
    """Output nibbles as called, one tuple per complete cycle of SPREAD."""
    nibbles = [c[2] & 15 for c in tb.calls]
    return [tuple(nibbles[k:k + 8]) for k in range(0, len(nibbles) - 7, 8)]


@cocotb.test(timeout_time=120, timeout_unit="ms")
async def snapshot_under_hold(dut):
    """LK-006: a core that rewrites OUT_IMG under out_hold never gets two of its images into one cycle."""
    tb = TB(dut)
    await tb.start()
    tb.judged = False
    for index in SPREAD:
        tb.poke(index, 1)
    rng = random.Random(6)
    dut.cycle_en_i.value = 1

    async def core():
        generation = 0
        while True:
            generation = (generation + 1) % 16
            dut.out_hold_i.value = 1
            await RisingEdge(dut.clk_i)
            for k in rng.sample(range(8), 8):
                await core_write(dut, OUT_IMG + k, 0x11111111 * generation)
                await ClockCycles(dut.clk_i, rng.randrange(1, 900 if rng.random() < 0.3 else 6))
            dut.out_hold_i.value = 0
            await ClockCycles(dut.clk_i, rng.randrange(1, 4000))
    cocotb.start_soon(core())
    await tb.cycles(150)
    seen = outputs_per_cycle(tb)
    assert all(len(set(cycle)) == 1 for cycle in seen)
    assert len(seen) == 150 and len({cycle[0] for cycle in seen}) > 8


@cocotb.test(timeout_time=120, timeout_unit="ms")
async def snapshot_is_one_moment(dut):
    """LK-006: without out_hold the outputs of a cycle are the words of one moment, first nibble included."""
    tb = TB(dut)
    await tb.start()
    tb.judged = False
    for index in SPREAD:
        tb.poke(index, 1)
    rng = random.Random(66)
    image, moments = [0] * 8, {(0,) * 8}
    dut.cycle_en_i.value = 1

    async def core():  # writes as fast as it can around the end of each cycle
        while True:
            await dut.res_count_o.value_change
            if int(dut.res_count_o.value) % 8:
                continue
            await ClockCycles(dut.clk_i, rng.randrange(1, 30))
            for _ in range(25):
                k, value = rng.randrange(8), rng.randrange(16)
                await core_write(dut, OUT_IMG + k, 0x11111111 * value)
                image[k] = value
                moments.add(tuple(image[index // 8] for index in SPREAD))
    cocotb.start_soon(core())
    await tb.cycles(60)
    seen = outputs_per_cycle(tb)
    assert len(seen) == 60 and len(set(seen)) > 40
    assert all(cycle in moments for cycle in seen)


@cocotb.test(timeout_time=120, timeout_unit="ms")
async def published_together(dut):
    """LK-007: IN_IMG changes only in one uninterrupted go at the end of a cycle, with one event per cycle."""
    tb = TB(dut)
    await tb.start()
    rng = random.Random(7)
    for index in SPREAD:
        tb.poke(index, 1)
    tb.answer = lambda call: (OK, OK, rng.randrange(16), 0)
    images = []

    async def watch():  # what a core that reads in every free clock sees
        dut.core_req_i.value, dut.core_addr_i.value = 1, 0xFF  # harmless writes: the acknowledge marks free clocks
        while True:
            await FallingEdge(dut.clk_i)
            if int(dut.core_ack_o.value):
                image = tuple(tb.peek(IN_IMG + k) for k in range(8))
                if not images or images[-1] != image:
                    images.append(image)
    cocotb.start_soon(watch())
    await tb.cycles(6)
    assert len(images) == 7 and int(dut.cycle_count_o.value) == 6


@cocotb.test(timeout_time=60, timeout_unit="ms")
async def live_outputs(dut):
    """LK-018, LK-006, CA-001, CA-004: OUT_IMG changes in every call: live slots follow it, the others keep the
    snapshot, also the cycle's first slot, A and B of one number, and under out_hold."""
    tb = TB(dut)
    await tb.start()
    for index, slot in {1: ACTIVE | LIVE, 8: ACTIVE, 9: ACTIVE | LIVE, 20: ACTIVE | EXTENDED | LIVE,
                        52: ACTIVE | EXTENDED, 63: ACTIVE | EXTENDED | LIVE}.items():
        tb.poke(index, slot)

    def image(value):
        for k in range(8):
            tb.poke(OUT_IMG + k, 0x11111111 * value)
    # call k of a cycle writes 8 + k: not the first one, next to it the snapshot is taken
    tb.on_call = lambda count: image(8 + (count - 1) % 5) if (count - 1) % 5 else None
    image(1)
    await tb.cycles(2)
    image(2)
    dut.out_hold_i.value = 1
    await tb.cycles(2)
    assert tb.numbers() == [[1, 8, 9, 20, 31]] * 4
    nibbles = [c[2] & 15 for c in tb.calls]
    assert nibbles[0:5] == [1, 1, 9, 8 | 10 & 7, 11 & 7]            # 20: A, I3 = 1; 31B: I3 = 0
    assert nibbles[5:10] == [12, 12, 9, 12 & 7, 11 & 7]             # 20B is not live
    assert nibbles[10:15] == [2, 12, 9, 8 | 10 & 7, 11 & 7]         # out_hold: only the live ones are new
    assert nibbles[15:20] == [12, 12, 9, 12 & 7, 11 & 7]


@cocotb.test(timeout_time=60, timeout_unit="ms")
async def live_moment(dut):
    """LK-018: the core writes a live nibble at any clock around the end of the call before: what is written by the
    clock after the result is sent; from then to the offer the core has to wait, and what it writes is for the next
    call."""
    tb = TB(dut)
    await tb.start()
    tb.judged = False
    for number in (3, 4, 5):
        tb.poke(number, ACTIVE | LIVE)
    dut.cycle_en_i.value = 1
    outcome = {}  # clock of the write after the result -> sent at once
    for delay in range(CALL - 8, CALL + 24):
        value = delay % 15 + 1
        while not tb.calls or tb.calls[-1][2] >> 5 != 3:
            await dut.acc_count_o.value_change
            await FallingEdge(dut.clk_i)
        calls = len(tb.calls)
        await ClockCycles(dut.clk_i, delay)
        dut.core_req_i.value, dut.core_addr_i.value, dut.core_wdata_i.value = 1, OUT_IMG, 0x11111111 * value
        await FallingEdge(dut.clk_i)
        while not int(dut.core_ack_o.value):
            await FallingEdge(dut.clk_i)
        clock = int(dut.since.value)
        await RisingEdge(dut.clk_i)
        dut.core_req_i.value = 0
        while len(tb.calls) < calls + 2:
            await dut.acc_count_o.value_change
            await FallingEdge(dut.clk_i)
        assert [c[2] >> 5 for c in tb.calls[calls:calls + 2]] == [4, 5]
        outcome.setdefault(min(clock, 99), set()).add(tb.calls[calls][2] & 15 == value)
        assert tb.calls[calls + 1][2] & 15 == value
    assert {c for c, now in outcome.items() if now == {True}} == {1, 99}, outcome        # 99: before the result
    assert {c for c, now in outcome.items() if now == {False}} >= {9, 14}, outcome
    assert not set(outcome) & set(range(2, 9)), outcome             # the clocks of the books
    await tb.idle()


@cocotb.test(timeout_time=60, timeout_unit="ms")
async def exchange_event(dut):
    """LK-019: exchange_done once a cycle, after the last DEXG is booked, good or failed, and before the extra slots;
    not in a cycle without a slot. When, and with which words: checked at each event."""
    tb = TB(dut)
    await tb.start()
    count = lambda: int(dut.exchange_count_o.value)  # noqa: E731
    at = []

    async def watch():
        while True:
            await dut.exchange_count_o.value_change
            at.append((tb.calls[-1][1], tb.calls[-1][2] >> 5, int(dut.since.value)))
    cocotb.start_soon(watch())
    tb.poke(INCL_REQ, request(0x410, valid=1))
    await tb.cycles(2)
    assert count() == 0 and len(tb.calls) == 2                      # inclusion only
    tb.poke(6, ACTIVE)
    tb.poke(30, ACTIVE)
    fail = set()
    tb.answer = lambda call: (NO_RESPONSE, NO_RESPONSE, 0, 1) if call >> 5 in fail else (OK, OK, 3, 0)
    await tb.cycles(2)
    fail.add(30)                                                    # the last one fails, and is lost
    await tb.cycles(tb.model.fail_cycles + 2)
    fail.add(6)                                                     # the only one
    await tb.cycles(tb.model.fail_cycles)
    events = count()
    assert events == 2 * tb.model.fail_cycles + 4
    await tb.cycles(2)
    assert count() == events                                        # nobody is left
    dut.two_extra_i.value = 1
    tb.poke(STATE + 6, 0)
    tb.poke(MGMT_REQ, request(0x500, tag=7))
    await tb.cycles(1)
    assert [c[1] for c in tb.calls[-3:]] == [DEXG, MGMT, INCL] and count() == events + 1
    tb.poke(INCL_REQ, 0)
    await tb.cycles(1)                                              # no extra slot
    assert count() == events + 2
    assert {(phase, clock) for phase, _, clock in at} == {(DEXG, 8)}  # 8 clocks after the result


@cocotb.test(timeout_time=60, timeout_unit="ms")
async def sent_and_calls(dut):
    """LK-020: SLOT_STATE.sent is the information of the last call, repeated ones too, calls counts finished calls
    modulo 16, failed ones too, A and B apart; results of other calls have neither."""
    tb = TB(dut)
    await tb.start()
    tb.poke(6, ACTIVE | EXTENDED | LIVE)
    tb.poke(38, ACTIVE | EXTENDED | LIVE)
    tb.poke(31, ACTIVE)
    tb.poke(STATE + 31, 0xE << 28)                                  # the sequencer counts on from what is there
    tb.answer = lambda call: (NO_RESPONSE, PARITY, 0, 1) if call >> 5 == 31 and len(tb.calls) % 2 else (OK, OK, 9, 0)
    state = lambda index: (tb.peek(STATE + index) >> 20 & 15, tb.peek(STATE + index) >> 28)  # noqa: E731
    for k in range(1, 37):
        tb.poke(OUT_IMG, 0x11111111 * (k % 16))
        tb.poke(OUT_IMG + 3, 0xF0000000 - (k % 16 << 28))
        tb.poke(OUT_IMG + 4, 0x11111111 * (k // 2 % 16))
        tb.poke(STATE + 31, tb.model.ram[STATE + 31] & ~0x70000)        # never lost
        await tb.cycles(1)
        assert state(31) == (15 - k % 16, (14 + k) % 16)
        assert state(6 + 32 * (1 - k % 2)) == ((8 | k & 7) if k % 2 else k // 2 & 7, (k + 1) // 2 % 16)
    tb.poke(MGMT_REQ, request(0x4FF, tag=0xFF))
    tb.poke(INCL_REQ, request(0x4FF, tag=0xFF, valid=1))
    dut.two_extra_i.value = 1
    await tb.cycles(1)
    assert [tb.peek(k) >> 24 for k in (MGMT_RES, INCL_RES)] == [0, 0]
    assert [r >> 24 for r in await tb.batch([request(0x4FF, tag=0xFF)])] == [0]


@cocotb.test(timeout_time=60, timeout_unit="ms")
async def read_id(dut):
    """LK-021, CA-003, CA-004, LK-003, LK-004: with read_id slots are called with RDID (10001, for B slaves 11001), in
    the same order and turns, with the same repetitions and removal; a change counts from the next offer on."""
    tb = TB(dut)
    await tb.start()
    rdid, rdid_b = 0x411, 0x419
    tb.poke(2, ACTIVE | LIVE)
    tb.poke(7, ACTIVE | EXTENDED)
    tb.poke(39, ACTIVE | EXTENDED | LIVE)
    tb.poke(44, ACTIVE | EXTENDED)
    for k in range(8):
        tb.poke(OUT_IMG + k, 0xEEEEEEEE)
    dut.read_id_i.value = 1
    tb.answer = lambda call: (OK, OK, 0xA, 0)
    await tb.cycles(2)
    assert [c[2] for c in tb.calls] == [rdid | 2 << 5, rdid | 7 << 5, rdid_b | 12 << 5,
                                        rdid | 2 << 5, rdid_b | 7 << 5, rdid_b | 12 << 5]
    assert {c[1:2] + c[3:5] for c in tb.calls} == {(DEXG, tb.model.dexg_retry, 0)}
    assert tb.peek(STATE + 2) == 0xA | 1 << 20 | 2 << 28 and tb.peek(STATE + 44) == 0xA | 9 << 20 | 2 << 28
    # removal
    tb.answer = lambda call: (NO_RESPONSE, NO_RESPONSE, 0, 1) if call >> 5 & 31 == 2 else (OK, OK, 0xA, 0)
    first = len(tb.calls)
    await tb.cycles(tb.model.fail_cycles + 2)
    assert sum(c[2] >> 5 & 31 == 2 for c in tb.calls[first:]) == tb.model.fail_cycles and tb.model.lost == 1
    # in the middle of a cycle
    tb.poke(STATE + 2, 0)
    tb.answer = lambda call: (OK, OK, 0xA, 0)
    tb.on_call = lambda count: setattr(dut.read_id_i, "value", 0) if tb.calls[-1][2] >> 5 == 7 | 32 else None
    first = len(tb.calls)
    await tb.cycles(2)
    assert [c[2] >> 10 for c in tb.calls[first:]] == [1, 1, 0, 0, 0, 0]


@cocotb.test(timeout_time=120, timeout_unit="ms")
async def one_extra_slot(dut):
    """LK-008: one extra slot: management when pending, but never twice in a row while an inclusion request is valid;
    tags wrap; a late firmware only repeats the probe."""
    tb = TB(dut)
    await tb.start()
    tb.poke(3, 1)
    extras = lambda: [c[1] for c in tb.calls if c[1] != DEXG]  # noqa: E731
    await tb.cycles(2)
    assert extras() == []
    tb.poke(INCL_REQ, request(0x410, tag=0x55, retries=1, valid=1))
    await tb.cycles(3)                      # unchanged: the same probe again
    assert extras() == [INCL] * 3 and {c[2] for c in tb.calls if c[1] == INCL} == {0x410}
    assert tb.peek(INCL_RES) >> 16 == 0x55

    def always_pending(_):
        if tb.calls[-1][1] == DEXG:         # firmware takes the result and asks again, with the next tag
            tag = (tb.peek(MGMT_RES) >> 16) + 1 & 255
            tb.poke(MGMT_REQ, request(0x400 | tag, tag=tag, retries=2))
    tb.on_call = always_pending
    await tb.cycles(6)
    assert extras()[3:] == [MGMT, INCL] * 3
    tb.poke(INCL_REQ, 0)
    before = len(extras())
    await tb.cycles(258)                    # management only: the tag wraps, each request runs once
    mgmt = [c for c in tb.calls if c[1] == MGMT][3:]
    assert extras()[before:] == [MGMT] * 258 and all(c[3] == 2 for c in mgmt)
    assert [c[2] for c in mgmt] == [0x400 | (4 + k) & 255 for k in range(258)]
    tb.on_call = lambda count: None
    await tb.cycles(3)
    assert len(extras()) == before + 258    # nothing new: nothing sent


@cocotb.test(timeout_time=120, timeout_unit="ms")
async def two_extra_slots(dut):
    """LK-009: with two extra slots management and inclusion both run in each cycle, in this order."""
    tb = TB(dut)
    await tb.start()
    dut.two_extra_i.value = 1
    tb.poke(3, 1)
    tb.poke(INCL_REQ, request(0x7FF, tag=1, no_reply=1, valid=1))
    for tag in (1, 2, 3, 4):
        tb.poke(MGMT_REQ, request(0x500 + tag, tag=tag))
        await tb.cycles(1)
    assert [c[1] for c in tb.calls] == [DEXG, MGMT, INCL] * 4
    assert all(c[4] for c in tb.calls if c[1] == INCL)
    await tb.cycles(1)
    tb.poke(INCL_REQ, 0)
    tb.poke(MGMT_REQ, request(0x505, tag=5))
    await tb.cycles(2)
    assert [c[1] for c in tb.calls[12:]] == [DEXG, INCL, DEXG, MGMT, DEXG]


@cocotb.test(timeout_time=120, timeout_unit="ms")
async def batches(dut):
    """LK-010: 1, 64 and 0 requests, back to back, each with its retries and its result in its place."""
    tb = TB(dut)
    await tb.start()
    rng = random.Random(10)
    given = []

    def answer(call):
        last = rng.choice((OK, OK, NO_RESPONSE, PARITY))
        given.append((last, rng.choice((OK, PARITY)), rng.randrange(16), rng.randrange(4)))
        return given[-1]
    tb.answer = answer
    for length in (1, 64, 2, 33):
        given.clear()
        entries = [request(rng.randrange(2048), rng.randrange(256), rng.randrange(4), rng.randrange(2))
                   for _ in range(length)]
        counters, first = [tb.peek(k) for k in (SENT, REPEATED, FAILED)], len(tb.calls)
        results = await tb.batch(entries)
        calls = tb.calls[first:]
        assert [(c[2] | c[4] << 11 | c[3] << 12) for c in calls] == [e & 0x3FFF for e in entries]
        assert results == [(d if last == OK else 0) | last << 4 | f << 8 | r << 12 | e & 0xFF0000
                           for (last, f, d, r), e in zip(given, entries)]
        assert all(c[5] == 0 for c in calls[1:]), "a gap was stretched"
        repeats = sum(g[3] for g in given)
        assert [tb.peek(k) for k in (SENT, REPEATED, FAILED)] == [
            counters[0] + length + repeats, counters[1] + repeats, counters[2] + sum(g[0] != OK for g in given)]
    count = len(tb.calls)
    assert await tb.batch([]) == [] and len(tb.calls) == count
    assert int(dut.sync_count_o.value) == 0 and int(dut.cycle_count_o.value) == 0
    # during a cycle a start is ignored
    tb.poke(5, 1)
    await tb.cycles(1, stop=False)
    dut.batch_start_i.value = 1
    await FallingEdge(dut.clk_i)
    dut.batch_start_i.value = 0
    await tb.cycles(2)
    assert int(dut.batch_count_o.value) == 5


def real_length(call):
    """Clocks from the first edge to the result: request 78 us, synchronous answer 21.5 us later, window 43.5 us."""
    return 143 * US


@cocotb.test(timeout_time=120, timeout_unit="ms")
async def full_network(dut):
    """LK-011, LK-012, LK-013: 31 synchronous slaves and one extra call with real times: 32 * 154 us, equal cycles."""
    tb = TB(dut)
    await tb.start()
    for number in range(1, 32):
        tb.poke(number, 1)
    tb.poke(INCL_REQ, request(0x410, valid=1))
    tb.length = real_length
    dut.gap_clocks_i.value = 11 * US - 3  # P_GAP_OK, minus the stand-in's own clocks, so that a call takes 154 us
    starts = []

    async def watch():
        while True:
            await dut.sync_count_o.value_change
            starts.append(int(dut.sync_time_o.value))
    cocotb.start_soon(watch())
    await tb.cycles(6)
    periods = [b - a for a, b in zip(starts, starts[1:])]
    gaps = {b[0] - a[0] for a, b in zip(tb.calls, tb.calls[1:])}
    assert gaps == {154 * US}, gaps
    assert set(periods) == {32 * 154 * US} and max(periods) <= 4950 * US


@cocotb.test(timeout_time=150, timeout_unit="ms")
async def gaps_never_stretched(dut):
    """LK-013, LK-012: with the shortest gap no offer is late, calls are equal to the clock, for any plant."""
    tb = TB(dut)
    await tb.start()
    plants = [(1,), (31,), (63,), (1, 33), (1, 31), (15, 16, 48), (33, 34, 63), tuple(range(1, 32)),
              tuple(range(1, 32)) + tuple(range(33, 64)), ()]
    for plant in plants:
        for incl in (0, 1):
            if not plant and not incl:
                continue
            for index in range(64):
                tb.poke(index, 3 if index in plant else 0)
            tb.poke(INCL_REQ, request(0x410, valid=incl))
            first = len(tb.calls)
            await tb.cycles(5)
            times = [c[0] for c in tb.calls[first:]]
            steps = {b - a for a, b in zip(times, times[1:])}
            assert len(steps) == 1, f"{plant}, inclusion {incl}: {steps}"
    assert int(dut.offer_max_o.value) <= OFFER_MAX, int(dut.offer_max_o.value)
    dut._log.info("longest time from a result to the next offer: %d clocks", int(dut.offer_max_o.value))


@cocotb.test(timeout_time=150, timeout_unit="ms")
async def shortest_cycle(dut):
    """LK-014, LK-012: cycles are not shorter than min_cycle_us, nor more than 3 us longer, and equal to the clock."""
    tb = TB(dut)
    await tb.start()
    tb.poke(3, 1)
    starts = []

    async def watch():
        while True:
            await dut.sync_count_o.value_change
            starts.append(int(dut.sync_time_o.value))
    cocotb.start_soon(watch())
    for us in (500, 1, 63, 1000, 8191):
        dut.min_cycle_us_i.value = us
        tb.strict = False  # the wait is on purpose
        starts.clear()
        await tb.cycles(4)
        periods = [b - a for a, b in zip(starts, starts[1:])]
        assert len(periods) == 3 and len(set(periods[1:])) == 1, periods
        assert all(p >= us * US for p in periods), (us, periods)
        if us >= 100:
            assert all(p <= (us + 3) * US for p in periods), (us, periods)
    # waiting ends at once when the cycle is switched off
    await tb.cycles(1, stop=False)
    dut.cycle_en_i.value = 0
    await ClockCycles(dut.clk_i, 4)
    assert not int(dut.cycle_busy_o.value)


@cocotb.test(timeout_time=120, timeout_unit="ms")
async def empty_cycles(dut):
    """LK-014: a cycle without slot and extra request sends nothing and takes 150 us at least."""
    tb = TB(dut)
    await tb.start()
    times = []
    await tb.cycles(1, stop=False)
    for _ in range(4):
        await tb.cycles(1, stop=False)
        times.append(int(dut.time_o.value))
    periods = [b - a for a, b in zip(times, times[1:])]
    assert all(150 * US <= p <= 250 * US for p in periods), periods
    assert not tb.calls and not int(dut.sync_count_o.value)
    tb.poke(9, 1)
    await tb.cycles(3)
    assert [c[2] >> 5 for c in tb.calls][:2] == [9, 9]
    assert int(dut.sync_count_o.value) == len(tb.calls)


@cocotb.test(timeout_time=150, timeout_unit="ms")
async def slots_change_live(dut):
    """LK-001, LK-015: a slot switched on or off at any moment counts at the latest one cycle later; nothing
    else changes."""
    tb = TB(dut)
    await tb.start()
    tb.judged = False
    rng = random.Random(1)
    for index in (2, 9):
        tb.poke(index, 1)
    dut.cycle_en_i.value = 1
    for _ in range(60):
        number = rng.choice((1, 5, 20, 31))
        await ClockCycles(dut.clk_i, rng.randrange(1, 1500))
        on = not tb.peek(number)
        tb.words[number].value = int(on)
        await tb.cycles(2, stop=False)      # the present one, and the one whose first slot is already searched
        first = len(tb.calls) + 1
        await tb.cycles(2, stop=False)
        cycles = tb.numbers(first)[1:]
        assert cycles and all((number in c) == on for c in cycles[:1]), (number, on, cycles)
        assert all(2 in c and 9 in c for c in cycles[:1])
    await tb.idle()


def random_plant(rng, tb):
    for number in range(1, 32):
        kind = rng.choice("-----SABXX" if rng.random() < 0.9 else "X")
        tb.poke(number, {"-": 0, "S": 1, "A": 3, "B": 2, "X": 3}[kind])
        tb.poke(number + 32, {"-": 2, "S": 0, "A": 0, "B": 3, "X": 3}[kind])
        for index in (number, number + 32):
            if rng.random() < 0.5:
                tb.poke(STATE + index, rng.randrange(16) | rng.randrange(16) << 20 | rng.randrange(16) << 28)
            if rng.random() < 0.4:
                tb.poke(index, tb.peek(index) | LIVE)


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def random_plants(dut):
    """LK-001, LK-002, LK-003, LK-004, LK-005, LK-007, LK-008, LK-009, LK-013, LK-018, LK-019, LK-020, LK-021: hundreds
    of cycles of random plants, live slots, failures, outputs, management and inclusion requests, DEXG and RDID against
    the model."""
    tb = TB(dut)
    await tb.start()
    for seed in range(8):
        rng = random.Random(100 + seed)
        rate = rng.choice((0.02, 0.2, 0.6))
        tb.strict = True
        random_plant(rng, tb)
        dut.two_extra_i.value = seed % 2

        def answer(call, rng=rng, rate=rate):
            repeats = rng.choice((0, 0, 0, 0, 1, 2, 3))
            if rng.random() < rate:
                return rng.randrange(1, 10), rng.randrange(1, 10), rng.randrange(16), repeats
            return OK, rng.randrange(10) if repeats else OK, rng.randrange(16), repeats

        def on_call(count, rng=rng):
            if rng.random() < 0.2 and tb.calls[-1][1] == DEXG and int(dut.cycle_busy_o.value):
                if rng.random() < 0.5:
                    tb.poke(MGMT_REQ, rng.getrandbits(24))
                else:
                    tb.poke(INCL_REQ, rng.getrandbits(24) | rng.randrange(2) << 31)
            if count > 2 and tb.calls[-1][1] == tb.calls[-2][1] == DEXG and tb.calls[-1][2] >> 5 > tb.calls[-2][2] >> 5:
                tb.poke(OUT_IMG + rng.randrange(8), rng.getrandbits(32))  # not in the first call, next to the snapshot
            if rng.random() < 0.03:
                dut.read_id_i.value = 1 - int(dut.read_id_i.value)
        tb.answer, tb.on_call = answer, on_call
        for _ in range(3):
            await tb.cycles(12)
            for _ in range(6):
                index = rng.randrange(1, 32) + 32 * rng.randrange(2)
                tb.poke(STATE + index, 0)
                tb.poke(index, tb.peek(index) ^ 1)
            dut.out_hold_i.value = rng.randrange(2)
    assert tb.published == 288 and tb.model.lost > 20 and len(tb.calls) > 1500
    exchanges, rdid = int(dut.exchange_count_o.value), sum(c[1] == DEXG and c[2] >> 10 for c in tb.calls)
    assert exchanges > 150 and rdid > 200
    assert int(dut.offer_max_o.value) <= OFFER_MAX
    dut._log.info("%d cycles, %d of them with a slot, %d calls, %d RDID in slots, %d words compared", tb.published,
                  exchanges, len(tb.calls), rdid, tb.checked)


KEPT = 0xF0F7000F  # of SLOT_STATE, what an aborted call leaves alone: data, streak, sent, calls


@cocotb.test(timeout_time=400, timeout_unit="ms")
async def stop_in_a_cycle(dut):
    """LK-013, LK-004, LK-019, LK-020, LT-011: enable_i drops at every clock around and inside a cycle: it ends without
    publication, after an abort without exchange_done; streaks stay, an aborted call is not counted, nothing new is
    offered; afterwards cycles go on as before."""
    tb = TB(dut)
    tb.strict = False
    await tb.start()
    for index in (1, 33, 20):
        tb.poke(index, 3)
    tb.answer = lambda call: (NO_RESPONSE, NO_RESPONSE, 0, 0) if call >> 5 == 20 else (OK, OK, 5, 0)
    tb.poke(INCL_REQ, request(0x410, tag=9, valid=1))
    await tb.cycles(1)
    tag, kinds = 0, set()
    offsets = [*range(0, 40), *range(40, 1760, 9), *range(355, 420), *range(755, 830, 2), *range(1150, 1270),
               *range(1550, 1680)]
    for offset in offsets:
        tag = (tag + 1) % 256
        tb.poke(MGMT_REQ, request(0x400, tag=tag))
        tb.poke(STATE + 20, tb.model.ram[STATE + 20] & 0xFFFF)  # never lost here
        dut.two_extra_i.value = offset & 1
        before, calls = int(dut.cycle_count_o.value), len(tb.calls)
        exchanges = int(dut.exchange_count_o.value)
        dut.cycle_en_i.value = 1
        await ClockCycles(dut.clk_i, 1 + offset)
        await FallingEdge(dut.clk_i)
        dut.enable_i.value = 0
        busy = 0
        while int(dut.cycle_busy_o.value):
            await FallingEdge(dut.clk_i)
            assert not int(dut.req_valid_o.value)
            busy += 1
            assert busy < 400
        await ClockCycles(dut.clk_i, 20)
        assert not int(dut.cycle_busy_o.value)
        done = int(dut.cycle_count_o.value) - before
        assert tb.peek(CYCLES) == int(dut.cycle_count_o.value)
        if tb.gen is not None:  # the open cycle: an accepted call came back, or one that was only offered was withdrawn
            expected, ram = None, tb.model.ram
            saved = ram[CYCLES], ram[IN_IMG:MGMT_REQ], tb.model.odd
            if tb.pending_result is not None or tb.exchanged:
                expected = tb._advance()
            ram[CYCLES], ram[IN_IMG:MGMT_REQ], tb.model.odd = saved  # stopped after the last call: not published
            for word in (STATE + 1, STATE + 33, STATE + 20, MGMT_RES, INCL_RES):
                if tb.peek(word) != tb.model.ram[word]:
                    assert expected and tb.peek(word) >> 4 & 0x3FF == ABORTED << 4 | ABORTED, f"word {word:#x}"
                    if word < BATCH:
                        assert (tb.peek(word) ^ tb.model.ram[word]) & KEPT == 0, "streak, data, sent or calls changed"
                    tb.model.ram[word] = tb.peek(word)
                    kinds.add("withdrawn")
            tb.gen = None
            kinds.add("open")
            kinds.add("exchanged" if int(dut.exchange_count_o.value) > exchanges else "not exchanged")
        elif tb.peek(STATE + 1) != tb.model.ram[STATE + 1] or tb.peek(STATE + 33) != tb.model.ram[STATE + 33]:
            for word in (STATE + 1, STATE + 33):   # the first request of a cycle was withdrawn
                assert (tb.peek(word) ^ tb.model.ram[word]) & KEPT == 0
                tb.model.ram[word] = tb.peek(word)
            kinds.add("first")
        tb.model.was_mgmt = bool(dut.u_dut.was_mgmt_q.value)
        tb.model.ram[OUT_SNAP:IN_WORK] = [tb.peek(k) for k in range(OUT_SNAP, IN_WORK)]
        kinds.add(f"done{done}")
        tb.dropped = int(dut.begun_count_o.value) - int(dut.cycle_count_o.value)
        tb.compare([k for k in range(256) if not OUT_SNAP <= k < IN_WORK])
        dut.cycle_en_i.value = 0
        dut.enable_i.value = 1
        await ClockCycles(dut.clk_i, GAP)
    assert kinds >= {"open", "withdrawn", "first", "done0", "done1", "exchanged", "not exchanged"}, kinds
    await tb.cycles(4)


@cocotb.test(timeout_time=400, timeout_unit="ms")
async def stop_in_a_batch(dut):
    """LK-010, LT-011: enable_i drops at any clock of a batch: the remaining entries are ABORTED, then batch_done;
    ABORTED is no failure."""
    tb = TB(dut)
    await tb.start()
    tb.answer = lambda call: (OK, OK, call & 15, 0)
    entries = [request(0x400 + k, tag=0x20 + k) for k in range(4)]
    seen = set()
    for offset in [*range(0, 30), *range(340, 440), 1000, 1400, *range(1560, 1640)]:
        async def stop(offset=offset):
            await ClockCycles(dut.clk_i, offset + 1)
            await FallingEdge(dut.clk_i)
            dut.enable_i.value = 0
        task = cocotb.start_soon(stop())
        results = await tb.batch(entries)
        good = sum(r >> 4 & 15 == OK for r in results)
        assert results == [e & 0xFF0000 | (k if k < good else 0xFF0) for k, e in enumerate(entries)], results
        seen.add(good)
        await task
        dut.enable_i.value = 1
        await ClockCycles(dut.clk_i, GAP)
    assert seen == {0, 1, 2, 3, 4} and tb.peek(FAILED) == 0
    # a batch that starts while the line is off comes back at once
    dut.enable_i.value = 0
    assert await tb.batch(entries) == [e & 0xFF0000 | 0xFF0 for e in entries]


@cocotb.test(timeout_time=60, timeout_unit="ms")
async def stop_before_publication(dut):
    """LK-007, LT-011: enable_i drops after the last answer: before the copy begins nothing is published, no event, no
    CYCLES + 1; a copy that has begun is completed with its event."""
    tb = TB(dut)
    await tb.start()
    tb.judged = False
    tb.poke(40, 3)
    tb.answer = lambda call: (OK, OK, len(tb.calls) & 15, 0)
    for delay, published in ((0, 0), (1, 0), (3, 0), (5, 0), (14, 1), (25, 1)):
        before = tb.peek(CYCLES), tb.peek(IN_IMG + 5)
        dut.cycle_en_i.value = 1
        await dut.res_count_o.value_change
        await ClockCycles(dut.clk_i, delay)
        await FallingEdge(dut.clk_i)
        dut.enable_i.value = 0
        await tb.idle()
        dut.enable_i.value = 1
        assert tb.peek(STATE + 40) & 15 == len(tb.calls) & 15 == tb.peek(IN_WORK + 5)  # the answer itself is booked
        assert tb.peek(CYCLES) == int(dut.cycle_count_o.value) == before[0] + published, delay
        assert tb.peek(IN_IMG + 5) == (len(tb.calls) & 15 if published else before[1]), delay
        await ClockCycles(dut.clk_i, GAP)
