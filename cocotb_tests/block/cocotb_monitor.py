# SPDX-License-Identifier: Apache-2.0
"""asi_monitor: pulse trains in, records out. Trains are lists of (clock, polarity) of the strobes."""
import random
import warnings
from dataclasses import dataclass
from fractions import Fraction

import cocotb
from asi import checks, telegram
from asi.monitor import BR01_CALL, Monitor
from asi.regmap import ErrorClass
from cocotb.task import bridge, resume
from cocotb.triggers import RisingEdge, Timer
from cocotb.utils import get_sim_time
from hypothesis import HealthCheck, Phase, assume, given, settings
from hypothesis import strategies as st
from hypothesis.errors import HypothesisSideeffectWarning

from cocotb_tests.block.hostport import Port
from cocotb_tests.block.phy_bench import now, start, to_clocks, until, wait
from cocotb_tests.models.faults import Faults

REQUEST_NS, ANSWER_NS, LENGTH_NS = 78_000, 36_000, 7_500
PAUSE_NS, BAD_PAUSE_NS, OPEN_NS = 8_375, 18_000, 12_000
SYNC_NS, ASYNC_NS, GAP_NS = 21_500, 33_500, 18_500


@dataclass(frozen=True)
class Record:
    """A record of the ring. data and deviation (clocks, late > 0) are None where they are not to be compared."""
    time: int            # 1/8 us
    request: bool
    error: ErrorClass
    data: int | None
    deviation: int | None = None
    lost: bool = False


class TB:
    def __init__(self, dut):
        self.dut, self.hz = dut, int(dut.ClkHz.value)
        self.strobe_delay = 750 * self.hz // 10**9 + 2
        self.tail = 0

    def clocks(self, ns):
        return ns * self.hz // 10**9

    def ns(self, clock):
        return Fraction(clock * 10**9, self.hz)

    def time(self, clock):
        """Time stamp of a pulse whose strobe comes in this clock."""
        return (clock - self.reset_clock - self.strobe_delay) * 8_000_000 // self.hz % 2**32

    async def start(self, enable=1):
        await start(self.dut, n_start_i=0, p_start_i=0, enable_i=enable, clear_i=0, tail_i=0)
        self.reset_clock = now() - 1                  # the clock before was the first without reset
        self.core = Port(self.dut, "core", self.dut.clk_i)
        await wait(self.clocks(BAD_PAUSE_NS) + 2)
        return self

    async def play(self, train, begin=None):
        """Strobes of a train -> clock of its time 0."""
        begin = now() + 1 if begin is None else begin
        by_clock = {}
        for clock, polarity in train:
            by_clock.setdefault(clock, set()).add(polarity)
        for clock, polarities in sorted(by_clock.items()):
            await until(begin + clock)
            self.dut.n_start_i.value, self.dut.p_start_i.value = int(-1 in polarities), int(1 in polarities)
            await wait(1)
            self.dut.n_start_i.value = self.dut.p_start_i.value = 0
        return begin

    async def read(self, free=True):
        """Records from tail to head through the core's port."""
        records = []
        position, head = self.tail, int(self.dut.head_o.value)
        await RisingEdge(self.dut.clk_i)
        while position != head:
            stamp, word = [(await self.core.access(2 * position + k))[0] for k in (0, 1)]
            assert word >> 26 == 0
            dev = word >> 16 & 255
            records.append(Record(stamp, bool(word >> 11 & 1), ErrorClass(word >> 12 & 15), word & 0x7FF,
                                  dev if word >> 24 & 1 else -dev, bool(word >> 25 & 1)))
            position = (position + 1) % 256
        if free:
            self.tail = position
            self.dut.tail_i.value = position
        await until_middle()
        return records

    async def hear(self, train, settle_ns=110_000):
        """Play a train, wait until everything is decided -> (clock of time 0, records)."""
        begin = await self.play(train)
        await wait(self.clocks(settle_ns))
        return begin, await self.read()

    def request(self, call, at=0):
        return shift(to_clocks(telegram.request_pulses(call), self.hz), at)

    def answer(self, nibble, at=0):
        return shift(to_clocks(telegram.response_pulses(nibble), self.hz), at)

    def call(self, call, nibble, delay_ns=SYNC_NS, at=0):
        return self.request(call, at) + self.answer(nibble, at + self.clocks(REQUEST_NS + delay_ns))

    def good(self, begin, train_at, request, data, deviation=0, lost=False):
        return Record(self.time(begin + train_at), request, ErrorClass.OK, data, deviation, lost)


async def until_middle():
    rest = (5 - int(get_sim_time("ns"))) % 10
    if rest:
        await Timer(rest, "ns")


def shift(train, clocks):
    return [(t + clocks, p) for t, p in train]


def same(got, want):
    """Records equal, fields that are None in `want` left out."""
    assert len(got) == len(want), f"{got}\ninstead of\n{want}"
    for a, b in zip(got, want):
        for name in ("time", "request", "error", "data", "deviation", "lost"):
            expected = getattr(b, name)
            assert expected is None or getattr(a, name) == expected, f"{name}: {a}\ninstead of {b}"


@cocotb.test(timeout_time=100, timeout_unit="ms")
async def good_calls(dut):
    """ST-006: requests and answers of good calls at every legal delay, back to back, and calls without answer: one
    record each, with payload, direction and the time of the first pulse to 1/8 us."""
    random.seed(1)
    tb = await TB(dut).start()
    train, want, at = [], [], 0
    for k in range(24):
        call, nibble = random.getrandbits(11), random.getrandbits(4)
        delay = (12_000, 66_000, SYNC_NS, ASYNC_NS, random.randrange(12, 66) * 1000 + 125)[k % 5]
        silent = k % 6 == 5
        train += tb.request(call, at) if silent else tb.call(call, nibble, delay, at)
        want.append((at, True, call))
        answer_at = at + tb.clocks(REQUEST_NS + delay)
        if not silent:
            want.append((answer_at, False, nibble))
        at = (at + tb.clocks(REQUEST_NS + 72_000) if silent else answer_at + tb.clocks(ANSWER_NS + GAP_NS)) + k % 4
    begin, records = await tb.hear(train)
    same(records, [tb.good(begin, *w) for w in want])


@cocotb.test(timeout_time=100, timeout_unit="ms")
async def deviations(dut):
    """ST-006, RX-015: the largest deviation of a record, early or late, to the clock, for requests and answers."""
    tb = await TB(dut).start()
    early, late = tb.clocks(875), tb.clocks(1500)
    for make, data in ((tb.request, 0x2A5), (tb.answer, 0x6)):
        for offset in (-early, -1, 0, 1, late):
            train = make(data)
            k = len(train) // 2
            train[k] = (train[k][0] + offset, train[k][1])
            begin, records = await tb.hear(train)
            same(records, [Record(tb.time(begin), make == tb.request, ErrorClass.OK, data, offset)])


@cocotb.test(timeout_time=100, timeout_unit="ms")
async def damaged_answers(dut):
    """ST-006, SL-008: every fault of the slave models, after a good request: the answer's record names it, an extra
    pulse where a request has one is still an answer with LENGTH, and the call after the error gap is recorded."""
    tb = await TB(dut).start()
    rand = random.Random(2)
    for fault, classes in (("parity", {ErrorClass.PARITY}), ("extra_pulse", {ErrorClass.LENGTH}),
                           ("missing_pulse", set(ErrorClass)), ("double_answer", set(ErrorClass)),
                           ("shifted_pulse", {ErrorClass.TIMING, ErrorClass.ALTERNATION})):
        for _ in range(3):
            nibble = rand.getrandbits(4)
            pulses = Faults(**{fault: 1.0}).answer(nibble, rand)
            at = tb.clocks(REQUEST_NS + SYNC_NS)
            again = at + tb.clocks(45_000 + 24_000)
            train = tb.request(0x155) + shift(to_clocks(pulses, tb.hz), at) + tb.call(0x155, nibble, at=again)
            begin, records = await tb.hear(train)
            error = checks.classify(pulses, 7)[0]
            assert error in classes - {ErrorClass.OK}, (fault, error)
            same(records, [tb.good(begin, 0, True, 0x155), Record(tb.time(begin + at), False, error, None),
                           tb.good(begin, again, True, 0x155),
                           tb.good(begin, again + tb.clocks(REQUEST_NS + SYNC_NS), False, nibble)])


@cocotb.test(timeout_time=100, timeout_unit="ms")
async def damaged_requests(dut):
    """ST-006, ST-008: each pulse of a request missing, or doubled: one record for what was one telegram, never two, its
    request bit by the pulses from 37.5 to 43.5 us; the answer and the next call are recorded."""
    tb = await TB(dut).start()
    call = 0b0_00001_10110
    pulses = telegram.request_pulses(call)
    for k in range(len(pulses)):
        for damage in ("missing", "doubled"):
            broken = list(pulses)
            if damage == "missing":
                del broken[k]
            else:
                broken.insert(k + 1, (pulses[k][0] + 1_000, -pulses[k][1]))
            first = broken[0][0]
            broken = [(t - first, p) for t, p in broken]
            train = shift(to_clocks(broken, tb.hz), 0)
            again = tb.clocks(REQUEST_NS + 72_000)
            begin, records = await tb.hear(train + tb.call(call, 9, at=again))
            error, request = expect_bad(broken, 0)
            if k == len(pulses) - 1 and damage == "doubled":   # behind the end pulse
                assert error is ErrorClass.LENGTH
            same(records, [Record(tb.time(begin), request, error, None), tb.good(begin, again, True, call),
                           tb.good(begin, again + tb.clocks(REQUEST_NS + SYNC_NS), False, 9)])


@cocotb.test(timeout_time=100, timeout_unit="ms")
async def early_answers(dut):
    """ST-006, LT-002: a telegram that begins before 12 us after a good request is EARLY, at 12 us it is an answer; a
    pulse after the decision but before the pause is over (P_PAUSE) belongs to nothing."""
    tb = await TB(dut).start()
    one = 10**9 / tb.hz
    for delay_ns, error in ((OPEN_NS, ErrorClass.OK), (OPEN_NS - one, ErrorClass.EARLY),
                            (PAUSE_NS, ErrorClass.EARLY)):
        at = tb.clocks(REQUEST_NS) + round(delay_ns * tb.hz / 10**9)
        begin, records = await tb.hear(tb.request(0x155) + tb.answer(6, at))
        same(records, [tb.good(begin, 0, True, 0x155), Record(tb.time(begin + at), False, error, None)])
    for delay_ns, error in ((PAUSE_NS - one, ErrorClass.OK), (LENGTH_NS + one, ErrorClass.OK),
                            (LENGTH_NS, ErrorClass.LENGTH), (3_000, ErrorClass.LENGTH)):
        at = tb.clocks(REQUEST_NS) + round(delay_ns * tb.hz / 10**9)
        begin, records = await tb.hear(tb.request(0x155) + tb.answer(6, at))
        same(records, [Record(tb.time(begin), True, error, None)])
    # the end pulse late: the decision comes 6 us after it, and the pause ends later
    late = tb.request(0x155)[:-1] + [(tb.clocks(REQUEST_NS + 1_500), 1)]
    begin, records = await tb.hear(late + tb.answer(6, tb.clocks(REQUEST_NS + 1_500 + 7_000)))
    same(records, [tb.good(begin, 0, True, 0x155, tb.clocks(1_500))])


@cocotb.test(timeout_time=100, timeout_unit="ms")
async def two_senders_and_babble(dut):
    """ST-006: two requests at once, and a line that never gets quiet, give one bad record; after 18 us of quiet the
    next telegram is recorded."""
    tb = await TB(dut).start()
    for offset_ns in (500, 1_500, 4_000, 30_000):
        train = sorted(set(tb.request(0x155)) | set(shift(tb.request(0x2AA), tb.clocks(offset_ns))))
        after = train[-1][0] + tb.clocks(BAD_PAUSE_NS)
        begin, records = await tb.hear(train + tb.request(0x0F0, after))
        same(records[1:], [tb.good(begin, after, True, 0x0F0)])
        assert records[0].error is not ErrorClass.OK and records[0].request
    random.seed(3)
    clock, train = 0, []
    while clock < tb.clocks(600_000):
        train.append((clock, random.choice((-1, 1))))
        clock += random.randrange(tb.clocks(750), tb.clocks(BAD_PAUSE_NS))
    after = train[-1][0] + tb.clocks(BAD_PAUSE_NS)
    begin, records = await tb.hear(train + tb.request(0x0F0, after))
    assert len(records) == 2 and records[0].error is not ErrorClass.OK
    same(records[1:], [tb.good(begin, after, True, 0x0F0)])


@cocotb.test(timeout_time=200, timeout_unit="ms")
async def enabled_in_mid_telegram(dut):
    """ST-006, ST-008: enabled at 40 places of a call: no fragment is recorded, only telegrams that began after 18 us of
    quiet; disabled or cleared in a telegram: no record of it, not counted as lost; both then record the next call."""
    tb = await TB(dut).start()
    at, length = tb.clocks(REQUEST_NS + SYNC_NS), tb.clocks(REQUEST_NS + SYNC_NS + ANSWER_NS)
    for pin in (dut.enable_i, dut.clear_i):
        for k in range(20):
            moment = length * k // 20 + k
            active, rest = (0, 1) if pin is dut.enable_i else (1, 0)
            begin = now() + 10

            async def switch():
                if pin is dut.enable_i:
                    pin.value = 0                          # off from before the telegram until `moment`
                await until(begin + moment)
                pin.value = active
                await wait(1)
                pin.value = rest
            task = cocotb.start_soon(switch())
            await tb.play(tb.call(0x155, 6), begin)
            await task
            await wait(tb.clocks(72_000))
            records = await tb.read()
            # quiet for 18 us only between the request and its answer; what was recorded before a clear is gone
            expect = [tb.good(begin, at, False, 6)] if moment < at else []
            same(records, expect)
            assert int(dut.lost_o.value) == 0
            begin, records = await tb.hear(tb.call(0x2AA, 9))
            same(records, [tb.good(begin, 0, True, 0x2AA), tb.good(begin, at, False, 9)])
    dut.enable_i.value = 0
    assert (await tb.hear(tb.call(0x2AA, 9)))[1] == []


@cocotb.test(timeout_time=400, timeout_unit="ms")
async def ring_full(dut):
    """ST-008: 255 records fit; the newest are lost and counted, the old ones stay; the record after them is marked, the
    one after that is not; lost stops at FFFF and a clear makes it 0."""
    tb = await TB(dut).start()
    step = tb.clocks(ANSWER_NS + 26_000)

    async def answers(first, n):
        train = [pulse for k in range(n) for pulse in tb.answer((first + k) % 16, k * step)]
        begin = await tb.play(train)
        await wait(tb.clocks(50_000))
        return [tb.good(begin, k * step, False, (first + k) % 16) for k in range(n)]
    want = await answers(0, 250)
    assert int(dut.lost_o.value) == 0
    want += (await answers(250, 8))[:5]
    assert int(dut.lost_o.value) == 3 and int(dut.head_o.value) == 255
    tb.dut.tail_i.value = tb.tail = 2                                 # two are taken: room for two
    more = await answers(7, 3)
    assert int(dut.lost_o.value) == 4 and int(dut.head_o.value) == 1
    same(await tb.read(), want[2:] + [Record(more[0].time, False, ErrorClass.OK, 7, 0, True), more[1]])
    more = await answers(3, 2)
    same(await tb.read(), [Record(more[0].time, False, ErrorClass.OK, 3, 0, True), more[1]])
    # saturation, from close below it
    tb.dut.tail_i.value = tb.tail = (int(dut.head_o.value) + 1) % 256
    dut.u_dut.lost_q.value = 0xFFFE
    await answers(0, 3)
    assert int(dut.lost_o.value) == 0xFFFF
    dut.clear_i.value = 1
    await wait(1)
    dut.clear_i.value = 0
    await wait(1)
    assert int(dut.lost_o.value) == 0 and int(dut.head_o.value) == tb.tail
    await wait(tb.clocks(BAD_PAUSE_NS))
    same(await tb.read(), [])
    same(await tb.read(), [])
    fresh = await answers(5, 1)
    same(await tb.read(), fresh)                                      # not marked


@cocotb.test(timeout_time=100, timeout_unit="ms")
async def read_while_it_writes(dut):
    """ST-006, ST-008: the core reads the ring all the time and moves the tail record by record: nothing is lost, no
    record is torn."""
    random.seed(6)
    tb = await TB(dut).start()
    want, got, running = [], [], [True]

    async def reader():
        while running[0] or int(dut.head_o.value) != tb.tail:
            got.extend(await tb.read())
    task = cocotb.start_soon(reader())
    for _ in range(60):
        call, nibble = random.getrandbits(11), random.getrandbits(4)
        begin = await tb.play(tb.call(call, nibble))
        want += [tb.good(begin, 0, True, call), tb.good(begin, tb.clocks(REQUEST_NS + SYNC_NS), False, nibble)]
        await wait(tb.clocks(GAP_NS))
    await wait(tb.clocks(20_000))
    running[0] = False
    await task
    same(got, want)


# ------------------------------------------------------------------ against the library
def expect_bad(pulses, start_ns):
    """(class, request) of the bad telegram that begins at start_ns and has no good request before it. From its pulses:
    a hole of 18 us ends it, 43.5 us decide if no pulse has come between 37.5 and then, else 85.5 us."""
    rel = [(t - start_ns, p) for t, p in pulses if t >= start_ns]
    kept = [rel[0]]
    for pulse in rel[1:]:
        if pulse[0] - kept[-1][0] >= BAD_PAUSE_NS:
            break
        kept.append(pulse)
    hole_ns = kept[-1][0] + BAD_PAUSE_NS                               # quiet until here
    request = hole_ns > ANSWER_NS + LENGTH_NS and any(
        ANSWER_NS + 1_500 < t <= ANSWER_NS + LENGTH_NS for t, _ in kept)
    long = any(ANSWER_NS + 1_500 < t <= ANSWER_NS + LENGTH_NS for t, _ in kept)
    if request or long or hole_ns <= ANSWER_NS + LENGTH_NS:
        return checks.classify(kept, 14)[0], request or long
    return checks.classify(kept, 7)[0], False


def expect(tb, train):
    """Records for a train (clock, polarity) that the monitor of the library, fed with the same pulses, stands for."""
    pulses = sorted((tb.ns(t), p) for t, p in train)
    monitor = Monitor()
    for t, p in pulses:
        monitor.pulse(t, p)
    monitor.settle(pulses[-1][0] + 200_000)

    def clock(ns):
        return round(ns * tb.hz / 10**9)

    def dev(ns):
        return None if ns is None else clock(ns)
    out = []
    for t in monitor.telegrams:
        if not t.request_ok:
            if t.lone_answer is not None:
                out.append((clock(t.t_ns), False, ErrorClass.OK, t.lone_answer, None))
            else:
                error, request = expect_bad(pulses, t.t_ns)
                if request:
                    assert error == t.error_class
                out.append((clock(t.t_ns), request, error, None, None))
            continue
        request = (clock(t.t_ns), True, ErrorClass.OK, t.call, dev(t.request_dev_ns))
        if t.delay_ns < 0:
            assert t.error_class in (ErrorClass.NO_RESPONSE, ErrorClass.OK)
            out.append(request)
            continue
        # the last pulse of the request: that of its last window
        end = max(p for p, _ in pulses if checks.window(p - t.t_ns) == 26)
        begins = t.delay_ns + min(p for p, _ in pulses if checks.window(p - t.t_ns) == 26)
        if t.error_class is ErrorClass.EARLY and begins - t.t_ns <= REQUEST_NS + LENGTH_NS:
            out.append(request[:2] + (ErrorClass.LENGTH, None, None))
        elif t.error_class is ErrorClass.EARLY and t.delay_ns < PAUSE_NS:
            out.append(request)
        else:
            later = [p for p, _ in pulses if p - begins > ANSWER_NS + LENGTH_NS]
            last = max(p for p, _ in pulses if p - begins <= ANSWER_NS + LENGTH_NS)
            assume(t.error_class is not ErrorClass.OK or not later or later[0] - last >= PAUSE_NS)  # see the header
            out.append(request)
            out.append((clock(begins), False, t.error_class, t.data, dev(t.answer_dev_ns)))
        assert end - t.t_ns < REQUEST_NS + LENGTH_NS
    return out


@st.composite
def damaged_trains(draw):
    """Calls, some of them damaged, as [(ns, polarity)]; times are multiples of 125 ns, gaps legal unless damage says
    otherwise."""
    pulses, at = [], 0
    for _ in range(draw(st.integers(1, 4))):
        call = draw(st.sampled_from([0x155, 0x000, 0x7FF, BR01_CALL]) | st.integers(0, 2047))
        kind = draw(st.sampled_from(["call", "call", "silent", "lone answer", "noise"]))
        part = []
        if kind in ("call", "silent"):
            part += telegram.request_pulses(call)
        if kind in ("call", "lone answer"):
            delay = draw(st.sampled_from([SYNC_NS, ASYNC_NS, 12_000, 66_000, 66_125, 11_875, 7_625, 9_000])
                         | st.integers(60, 560).map(lambda k: 125 * k))
            begin = REQUEST_NS + delay if kind == "call" else 0
            part += [(begin + t, p) for t, p in telegram.response_pulses(draw(st.integers(0, 15)))]
        if kind == "noise":
            part = [(0, draw(st.sampled_from([-1, 1])))]
        for _ in range(draw(st.integers(0, 2))):                      # damage
            action = draw(st.sampled_from(["drop", "shift", "add", "flip", "cut"]))
            k = draw(st.integers(0, len(part) - 1)) if part else 0
            if action == "drop" and len(part) > 1:
                del part[k]
            elif action == "shift" and part:
                part[k] = (max(0, part[k][0] + 125 * draw(st.integers(-24, 24))), part[k][1])
            elif action == "add":
                part.append((125 * draw(st.integers(0, 1400)), draw(st.sampled_from([-1, 1]))))
            elif action == "flip" and part:
                part[k] = (part[k][0], -part[k][1])
            elif action == "cut" and len(part) > 1:
                part = part[:max(1, k)]
        part.sort()
        pulses += [(at + t, p) for t, p in part]
        gap = draw(st.sampled_from([GAP_NS, 24_000, 72_000, 18_000, 17_875])
                   | st.integers(64, 800).map(lambda k: 125 * k))
        at = pulses[-1][0] + gap
    # one pulse per clock: two senders' opposite pulses at one instant are one event for the receiver
    return sorted({t: p for t, p in pulses}.items())


@cocotb.test(timeout_time=2000, timeout_unit="ms")
async def as_the_library(dut):
    """ST-006: on Hypothesis' trains of good and damaged requests, answers and noise the records are those of the
    library's monitor, with the differences that the module's header names."""
    warnings.simplefilter("ignore", HypothesisSideeffectWarning)      # its pytest plug-in never starts in here
    tb = await TB(dut).start()
    seen = {}

    @resume
    async def hear(train):
        return await tb.hear(train, 130_000)

    @settings(max_examples=250, deadline=None, derandomize=True, database=None,
              suppress_health_check=list(HealthCheck), phases=[Phase.generate, Phase.shrink])
    @given(damaged_trains())
    def compare(train_ns):
        train = to_clocks(train_ns, tb.hz)
        begin, records = hear(train)
        want = [Record(tb.time(begin + t), *rest) for t, *rest in expect(tb, train)]
        for record in want:
            seen[record.error, record.request] = seen.get((record.error, record.request), 0) + 1
        same(records, want)
    await bridge(compare)()
    missing = [e for e in ErrorClass if e not in (ErrorClass.NO_RESPONSE, ErrorClass.BAD_MASTER, ErrorClass.ABORTED)
               and not any(key[0] is e for key in seen)]
    assert not missing, f"{missing} never came: {seen}"
    assert (ErrorClass.OK, True) in seen and (ErrorClass.OK, False) in seen
