# SPDX-License-Identifier: Apache-2.0
"""One call on the line. The bench plays the slave: it drives pulses of 1 us on the comparator pins at given clocks, and
feeds the own transmission back when the block reads it (ReadBack). Tests of that: cocotb_xact_echo.py.

Every test works on the pins: `edge` is the clock of the first edge of a request, `last` that of its last one, 78 us
later.
"""
import cocotb
from asi import telegram
from asi.regmap import ErrorClass
from cocotb.queue import Queue
from cocotb.triggers import FallingEdge, RisingEdge, Timer, ValueChange
from cocotb.utils import get_sim_time
from cocotb_tests.block.phy_bench import PERIOD, now, start, to_clocks, until, wait, watch

OK, NONE, EARLY, ABORTED = ErrorClass.OK, ErrorClass.NO_RESPONSE, ErrorClass.EARLY, ErrorClass.ABORTED
CALL = telegram.encode_call("DEXG", 5, 0b1010)
SYNC, ASYNC, TIMEOUT = 21.5, 33.5, 66


class TB:
    def __init__(self, dut):
        self.dut, self.hz = dut, int(dut.ClkHz.value)
        self.queue = Queue()
        self.levels = {1: 0, -1: 0}
        self.busy = 0
        self.enables = []  # (clock, level) of tx_en_o
        self.read_back = bool(int(dut.ReadBack.value))
        self.echo = 0 if self.read_back else None  # clocks from an own edge to its pulse on the pins, None: no echo

    def us(self, time):
        clocks = time * self.hz / 10**6
        assert clocks == int(clocks), f"{time} us is not a whole number of clocks"
        return int(clocks)

    async def start(self, enable=1):
        dut = self.dut
        await start(dut, enable_i=enable, req_valid_i=0, req_call_i=0, req_sel_i=0, req_retries_i=0,
                    req_no_reply_i=0, rx_p_i=0, rx_n_i=0)
        self.started = now()
        self.results = watch(dut.res_valid_o, dut.res_last_o, dut.res_first_o, dut.res_data_o, dut.res_repeats_o)
        self.sent = watch(dut.sent_o, dut.repeat_o)
        cocotb.start_soon(self._requests())
        self.attempts = watch(dut.att_valid_o, dut.att_index_o, dut.att_class_o, dut.att_repeat_o, dut.att_final_o,
                              dut.att_delay_o, dut.att_dev_o, dut.att_dev_late_o)
        cocotb.start_soon(self._watch_enable())
        cocotb.start_soon(self._echo())
        return self

    async def _echo(self):
        man = self.dut.tx_man_o
        while True:
            await ValueChange(man)
            if self.echo is not None:
                cocotb.start_soon(self.pulse(now() + self.echo, 1 if man.value else -1))

    async def _requests(self):
        """Offer what is queued, the next one in the clock after the one before was taken."""
        dut = self.dut
        while True:
            if self.queue.empty():
                dut.req_valid_i.value = 0
            call, retries, no_reply, sel = await self.queue.get()
            dut.req_call_i.value, dut.req_retries_i.value, dut.req_no_reply_i.value = call, retries, no_reply
            dut.req_sel_i.value = sel
            dut.req_valid_i.value = 1
            while True:
                await RisingEdge(dut.sent_o)
                await Timer((now() + 1) * PERIOD - 1 - int(get_sim_time("ns")), "ns")
                taken = dut.sent_o.value == 1 and dut.req_ready_o.value == 1
                await until(now() + 1)
                if taken:
                    break

    async def _watch_enable(self):
        while True:
            await ValueChange(self.dut.tx_en_o)
            self.enables.append((now(), int(self.dut.tx_en_o.value)))

    def offer(self, call=CALL, retries=0, no_reply=0, sel=0):
        self.queue.put_nowait((call, retries, no_reply, sel))

    async def request(self):
        """-> clock of the first edge of the next request, checked: tx_en leads by 0 to 12 us."""
        if now() < self.busy:
            await until(self.busy)
        await FallingEdge(self.dut.tx_man_o)
        edge = now()
        self.busy = edge + self.us(81)  # falling edges until then belong to this request
        await until(edge)
        rise = [clock for clock, level in self.enables if level][-1]
        self.lead = edge - rise
        assert 0 <= self.lead <= self.us(12), f"tx_en leads by {self.lead}"
        return edge

    async def pulse(self, clock, polarity=-1, width=None):
        """One pulse on a comparator pin, from clock on; waits for its start only."""
        await until(clock)
        pin = self.dut.rx_p_i if polarity > 0 else self.dut.rx_n_i
        pin.value = 1
        self.levels[polarity] += 1

        async def fall():
            await wait(width or self.us(1))
            pin.value = 0
        cocotb.start_soon(fall())

    async def answer(self, clock, data=0, pulses=None):
        """An answer whose first pulse is at clock -> clock of its last pulse."""
        pulses = pulses or to_clocks(telegram.response_pulses(data), self.hz)
        for t, polarity in pulses:
            await self.pulse(clock + t, polarity)
        return clock + pulses[-1][0]

    async def good(self, edge, data=0, delay=SYNC):
        return await self.answer(edge + self.us(78) + self.us(delay), data)

    def bad_parity(self, data=0):
        return to_clocks(telegram.pulses(telegram.response_word(data) ^ 2, 7), self.hz)

    def result(self, last, first=None, data=None, repeats=0):
        """Exactly one result since the last call of this, with these fields -> its clock."""
        assert len(self.results) == 1, self.results
        clock, *fields = self.results.pop()
        assert fields[0] == last and fields[1] == (last if first is None else first) and fields[3] == repeats, fields
        assert data is None or fields[2] == data, fields
        return clock


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def first_request(dut):
    """LT-008, LT-009: the first request comes 60 us after enable (one clock to see it), or after the last foreign
    pulse."""
    tb = TB(dut)
    tb.offer()
    await tb.start(enable=0)
    await wait(tb.us(100))
    assert tb.sent == []
    dut.enable_i.value = 1
    enabled = now()
    edge = await tb.request()
    assert edge == enabled + tb.us(60) + 1 and tb.lead == tb.us(12)
    assert tb.sent == [(edge - 1, 0)]
    await until(edge + tb.us(82))
    dut.enable_i.value = 0
    await wait(1)
    dut.enable_i.value = 1
    tb.offer()
    for k in range(3):
        noise = now() + tb.us(40)
        await tb.pulse(noise, 1 if k == 1 else -1)
    assert await tb.request() == noise + tb.us(60) and tb.lead == tb.us(12)


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def good_answers(dut):
    """LT-004, LT-009, RX-013: sixteen synchronous answers back to back: 154 us per call without one clock of jitter."""
    tb = TB(dut)
    for data in range(17):
        tb.offer(telegram.encode_call("DEXG", data + 1, data & 15))
    await tb.start()
    previous = None
    for data in range(16):
        edge = await tb.request()
        assert previous is None or edge == previous + tb.us(154), edge - previous
        previous = edge
        last = await tb.good(edge, data)
        await until(last + tb.us(18.5) - 1)
        decided = tb.result(OK, data=data)
        # 43.5 us after the first pulse, filter and synchroniser later
        assert decided == last - tb.us(36) + tb.us(43.5) + tb.us(0.75) + 2
        assert tb.enables[-1][0] > decided, "bias before the decision"
    assert await tb.request() == previous + tb.us(154)


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def answer_delays(dut):
    """LT-002, LT-003, LT-004, RX-013: answers from 12 us to 66 us after the last request pulse, both inclusive, are
    taken; the gap starts at their last pulse."""
    tb = TB(dut)
    for _ in range(6):
        tb.offer()
    await tb.start()
    edge = await tb.request()
    for data, delay in enumerate((12, SYNC, ASYNC, 50, TIMEOUT)):
        last = await tb.good(edge, data, delay)
        edge = await tb.request()
        assert edge == last + tb.us(18.5)
        tb.result(OK, data=data)


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def moved_end_pulse(dut):
    """LT-004: the gap follows the end pulse where it was seen, at the early and at the late limit of its window."""
    tb = TB(dut)
    for _ in range(4):
        tb.offer()
    await tb.start()
    edge = await tb.request()
    for move in (-tb.us(0.875), 1, tb.us(1.5)):
        pulses = to_clocks(telegram.response_pulses(5), tb.hz)
        pulses[-1] = (pulses[-1][0] + move, 1)
        last = await tb.answer(edge + tb.us(78 + SYNC), pulses=pulses)
        edge = await tb.request()
        assert edge == last + tb.us(18.5)
        tb.result(OK, data=5)


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def silence(dut):
    """LT-003, LT-005, LT-009: no answer: 150 us per call, exactly; tx_en rises after the time-out was decided."""
    tb = TB(dut)
    for _ in range(4):
        tb.offer()
    await tb.start()
    edge = await tb.request()
    for _ in range(3):
        following = await tb.request()
        assert following == edge + tb.us(150)
        decided = tb.result(NONE)
        assert decided == edge + tb.us(78 + 66.75) + 2
        assert 0 < tb.lead < following - decided
        assert tb.enables[-2] == (edge + tb.us(81), 0), "tx_en drops after the last pulse"
        edge = following


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def late_answer(dut):
    """LT-003, LT-006, RX-011: one clock after 66 us it is NO_RESPONSE; the late telegram (also that of E12, at 70 us)
    is not taken for an answer and the next request waits for 24 us of quiet after its last pulse."""
    tb = TB(dut)
    for _ in range(3):
        tb.offer()
    await tb.start()
    edge = await tb.request()
    for delay in (tb.us(66) + 1, tb.us(70)):
        last = await tb.answer(edge + tb.us(78) + delay, 3)
        tb.result(NONE)
        edge = await tb.request()
        assert edge == last + tb.us(24)
        assert tb.results == []


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def early_pulse(dut):
    """LT-002, RX-012: until 4.5 us after the own last pulse everything is our own echo, with read-back until it was
    judged (7.5 us after its last pulse); from there to one clock before 12 us a pulse is EARLY."""
    tb = TB(dut)
    ours = ((1, OK), (tb.us(7.5) + 1, EARLY)) if tb.read_back else (
        (1, OK), (tb.us(4.5), OK), (tb.us(4.5) + 1, EARLY))
    for _ in range(6):
        tb.offer()
    await tb.start()
    edge = await tb.request()
    for delay, error in (*ours, (tb.us(12) - 1, EARLY)):
        last = edge + tb.us(78)
        await tb.pulse(last + delay, 1)
        if error == EARLY:
            edge = await tb.request()
            assert edge == last + delay + tb.us(24)
        else:
            last = await tb.good(edge, 9)
            edge = await tb.request()
            assert edge == last + tb.us(18.5)
        tb.result(error)
    # a whole answer that comes early: EARLY, then quiet counts from its last pulse
    last = await tb.good(edge, 9, 9)
    edge = await tb.request()
    assert edge == last + tb.us(24)
    tb.result(EARLY)


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def own_echo(dut):
    """RX-012: the receiver sees every own pulse, 0.5 us late, and still gives nothing but the slave's answer."""
    tb = TB(dut)
    for _ in range(3):
        tb.offer(telegram.encode_call("ADRA", 0, 7))  # E7, 26 pulses
    tb.echo = tb.us(0.5)
    await tb.start()
    edge = await tb.request()
    last = await tb.good(edge, 6)
    following = await tb.request()
    assert following == last + tb.us(18.5) and tb.levels == {1: 13 + 5, -1: 13 + 5}
    tb.result(OK, data=6)
    assert await tb.request() == following + tb.us(150)
    tb.result(NONE)


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def bad_answers(dut):
    """LT-006, RX-011: after a bad answer 24 us of quiet, from its last pulse; each class arrives in the result."""
    tb = TB(dut)
    cases = (
        ErrorClass.START, ErrorClass.ALTERNATION, ErrorClass.TIMING, ErrorClass.NO_INFORMATION, ErrorClass.END_BIT,
        ErrorClass.PARITY, ErrorClass.LENGTH)
    for _ in range(len(cases) + 1):
        tb.offer()
    await tb.start()
    edge = await tb.request()
    for error in cases:
        e3 = dict(to_clocks(telegram.response_pulses(3), tb.hz))
        at = {t: tb.us(t) for t in (3, 9, 21, 24)}
        if error == ErrorClass.START:
            e3[0] = 1
        elif error == ErrorClass.ALTERNATION:
            e3[at[9]] = -1
        elif error == ErrorClass.TIMING:
            e3[at[3] + tb.us(1.5) + 1] = e3.pop(at[3])
        elif error == ErrorClass.NO_INFORMATION:
            del e3[at[21]], e3[at[24]]
        elif error == ErrorClass.END_BIT:
            e3 = dict(to_clocks(telegram.pulses(telegram.response_word(3) & ~1, 7), tb.hz))
        elif error == ErrorClass.PARITY:
            e3 = dict(tb.bad_parity(3))
        else:
            e3[tb.us(39)] = -1
        last = await tb.answer(edge + tb.us(78 + SYNC), pulses=sorted(e3.items()))
        edge = await tb.request()
        assert edge == last + tb.us(24), error
        tb.result(error)


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def quiet_restarts(dut):
    """LT-006: every pulse restarts the 24 us, after a bad answer as well as after a good one or after a time-out; a
    pulse below 750 ns does not (RX-009)."""
    tb = TB(dut)
    for _ in range(6):
        tb.offer()
    await tb.start()
    edge = await tb.request()
    last = await tb.answer(edge + tb.us(78 + SYNC), pulses=tb.bad_parity())
    for _ in range(5):
        last += tb.us(22)
        await tb.pulse(last, 1)
    edge = await tb.request()
    assert edge == last + tb.us(24)
    last = await tb.answer(edge + tb.us(78 + SYNC), pulses=tb.bad_parity())
    await tb.pulse(last + tb.us(20), width=tb.us(0.75) - 1)
    edge = await tb.request()
    assert edge == last + tb.us(24)
    last = await tb.good(edge, 1)
    await tb.pulse(last + tb.us(15), 1)
    edge = await tb.request()
    assert edge == last + tb.us(15 + 24)
    await tb.pulse(edge + tb.us(78 + 70), 1)
    following = await tb.request()
    assert following == edge + tb.us(78 + 70 + 24)
    # one pulse instead of an answer: decided 43.5 us later, by then the line has been quiet long enough
    await tb.pulse(following + tb.us(78 + SYNC))
    edge = await tb.request()
    decision = following + tb.us(78 + SYNC + 43.5 + 0.75) + 2
    assert decision < edge <= decision + 3 and tb.lead <= 2
    assert [r[1] for r in tb.results] == [ErrorClass.PARITY, ErrorClass.PARITY, OK, NONE, ErrorClass.NO_INFORMATION]
    assert tb.results[-1][0] == decision


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def repetitions(dut):
    """LT-012: retries 0..3 with 0..4 failures: repetitions, both classes, data and the counting strobes; no new
    request needed."""
    tb = TB(dut)
    await tb.start()
    for retries in range(4):
        for failures in range(retries + 2):
            tb.sent.clear()
            tb.offer(CALL, retries)
            for attempt in range(min(failures, retries + 1)):
                edge = await tb.request()
                assert tb.results == []
                if attempt:  # the others stay without answer
                    await tb.answer(edge + tb.us(78 + SYNC), pulses=tb.bad_parity())
            if failures <= retries:
                await tb.good(await tb.request(), 12)
            await wait(tb.us(150))
            last = OK if failures <= retries else NONE if failures == 1 else ErrorClass.PARITY
            tb.result(last, first=NONE if failures else OK, repeats=min(failures, retries),
                      data=12 if last == OK else None)
            assert [repeat for _, repeat in tb.sent] == [0] + [1] * min(failures, retries)
            await wait(tb.us(200))
            assert dut.tx_en_o.value == 0 and tb.results == []


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def repetition_time(dut):
    """LT-004, LT-005, LT-006, LT-012: a repetition uses the same gaps; first edge to first edge stays below 200 us
    without an answer and with a bad one, synchronous or asynchronous. The same word goes out although another request
    waits."""
    tb = TB(dut)
    for _ in range(3):
        tb.offer(CALL, 1)
    tb.offer(0x7FF)
    await tb.start()
    for delay in (None, SYNC, ASYNC):
        edge = await tb.request()
        if delay:
            await tb.answer(edge + tb.us(78 + delay), pulses=tb.bad_parity())
        levels = []
        repeat = await tb.request()
        assert repeat - edge == (tb.us(78 + delay + 36 + 24) if delay else tb.us(150)) < tb.us(200)
        await until(repeat + tb.us(1.5))
        for _ in range(27):
            levels.append(int(dut.tx_man_o.value))
            await wait(tb.us(3))
        pulses = [(k * 3000, 1 if level else -1) for k, level in enumerate(levels) if level != ([1] + levels)[k]]
        assert pulses == telegram.request_pulses(CALL)
        await tb.good(repeat, 4)
    await tb.request()
    assert [r[1:] for r in tb.results] == [(OK, first, 4, 1) for first in (NONE, ErrorClass.PARITY, ErrorClass.PARITY)]


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def no_reply(dut):
    """LT-005: a broadcast: silence until the time-out is OK and not repeated; an answer that comes is judged as
    usual."""
    tb = TB(dut)
    for _ in range(4):
        tb.offer(telegram.encode_call("BR01"), 2 if tb.queue.empty() else 0, 1)
    await tb.start()
    edge = await tb.request()
    following = await tb.request()
    assert following == edge + tb.us(150)
    tb.result(OK, data=0)
    last = await tb.good(following, 7)
    edge = await tb.request()
    assert edge == last + tb.us(18.5)
    tb.result(OK, data=7)
    await tb.answer(edge + tb.us(78 + SYNC), pulses=tb.bad_parity())
    await tb.request()
    tb.result(ErrorClass.PARITY)


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def aborted(dut):
    """LT-011, LT-008: enable off at any moment of an open call: one ABORTED, no request starts, a request on the line
    is completed; on again: 60 us of quiet."""
    tb = TB(dut)
    await tb.start()
    # time after the first edge; 90: time before the answer; 110: within it; 146: after the time-out, before the
    # repetition
    for time, first, repeats in ((0, ABORTED, 0), (40, ABORTED, 0), (80, ABORTED, 0), (85, ABORTED, 0),
                                 (95, ABORTED, 0), (110, ABORTED, 0), (146, NONE, 0), (160, NONE, 1)):
        tb.offer(CALL, 3)
        tb.offer()
        edge = await tb.request()
        if time == 110:
            await tb.pulse(edge + tb.us(100))
        await until(edge + tb.us(time) + 1)
        assert tb.results == []
        dut.enable_i.value = 0
        stopped = now()
        sent = len(tb.sent)
        await wait(1)
        assert tb.result(ABORTED, first=first, repeats=repeats) == stopped
        await wait(tb.us(300))
        assert len(tb.sent) == sent and tb.results == []
        assert tb.enables[-1] == (edge + tb.us(81) + (tb.us(150) if repeats else 0), 0) or time == 146
        assert dut.tx_en_o.value == 0 and dut.tx_man_o.value == 1
        dut.enable_i.value = 1
        enabled = now()
        edge = await tb.request()
        assert edge == enabled + tb.us(60) + 1
        await tb.good(edge, 1)
        await wait(tb.us(100))
        tb.result(OK, data=1)


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def enable_back_early(dut):
    """LT-008, LT-011: enable off and on again while the own request is still on the line: the 60 us start after it."""
    tb = TB(dut)
    tb.offer()
    tb.offer()
    await tb.start()
    edge = await tb.request()
    await until(edge + tb.us(20))
    dut.enable_i.value = 0
    await wait(1)
    dut.enable_i.value = 1
    assert tb.result(ABORTED) == now() - 1
    assert await tb.request() == edge + tb.us(81 + 60) + 1


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def stopped_idle(dut):
    """LT-011: without an open call, enable off gives no result; a request offered meanwhile waits."""
    tb = TB(dut)
    await tb.start()
    await wait(tb.us(100))
    dut.enable_i.value = 0
    tb.offer()
    await wait(tb.us(500))
    assert tb.sent == [] and tb.results == [] and tb.enables == []


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def offered_later(dut):
    """LT-004, LT-009: a request offered within the gap starts when the gap ends, one offered after it when P_TX_BIAS
    has passed; a foreign pulse on the idle line still costs 24 us of quiet."""
    tb = TB(dut)
    await tb.start()
    tb.offer()
    edge = await tb.request()
    last = await tb.good(edge, 2)
    for offered, starts in ((10, 18.5), (18.375, 18.5), (18.5, 30.5), (100, 112)):
        await until(last + tb.us(offered))
        at = now()
        tb.offer()
        edge = await tb.request()
        # bias and edge come one clock after the request
        assert edge == last + tb.us(starts) + (starts > 18.5), (offered, edge - last)
        assert tb.lead == min(edge - at - 1, tb.us(12))
        last = await tb.good(edge, 2)
    await wait(tb.us(100))
    await tb.pulse(now(), 1)
    noise = now()
    await wait(tb.us(10))
    tb.offer()
    assert await tb.request() == noise + tb.us(24)
    assert [r[1] for r in tb.results] == [OK] * 5


@cocotb.test(timeout_time=20, timeout_unit="ms")
async def babble(dut):
    """LT-007: a line that never gets quiet delays a request by 1 ms from the decision on, not more; the start after
    offline and a request that is offered to a babbling line as well."""
    tb = TB(dut)
    tb.offer(CALL, 1)
    await tb.start(enable=0)

    async def noise():
        while True:
            await tb.pulse(now() + tb.us(4), 1)
    noise_task = cocotb.start_soon(noise())
    dut.enable_i.value = 1
    enabled = now()
    edge = await tb.request()
    assert tb.us(1000) - 1 <= edge - enabled <= tb.us(1000)
    repeat = await tb.request()
    # the attempt ends with the first pulse after the mask, or after the judgement of the own request
    mask = 7.5 if tb.read_back else 4.5
    wait_time = repeat - edge - tb.us(78)
    assert tb.us(1000 + mask) <= wait_time <= tb.us(1000 + mask + 4 + 0.75) + 3, wait_time
    assert tb.results == []
    await wait(tb.us(100))
    tb.result(ErrorClass.BAD_MASTER if tb.read_back else EARLY, repeats=1)
    await wait(tb.us(2500))
    tb.offer()
    offered = now()
    assert await tb.request() - offered <= tb.us(1000)
    noise_task.cancel()


@cocotb.test(timeout_time=40, timeout_unit="ms")
async def babble_interrupted(dut):
    """LT-007, LT-008: enable off for one clock ends the wait of a babbling line, whenever it comes: the next request
    has its 1 ms again. One clock near the end of the wait was once enough to start it at once."""
    tb = TB(dut)
    await tb.start(enable=0)

    async def noise():
        while True:
            await tb.pulse(now() + tb.us(5), 1)
    noise_task = cocotb.start_soon(noise())
    for early in range(6):
        dut.enable_i.value = 1
        await wait(tb.us(1000) - early)
        dut.enable_i.value = 0
        await wait(1)
        tb.sent.clear()
        dut.enable_i.value = 1
        dut.req_valid_i.value = 1
        enabled = now()
        await wait(tb.us(900))
        assert tb.sent == [], (early, tb.sent[0][0] - enabled)
        dut.req_valid_i.value = 0
        dut.enable_i.value = 0
        await wait(4)
    noise_task.cancel()
