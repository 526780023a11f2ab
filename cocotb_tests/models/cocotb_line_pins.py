# SPDX-License-Identifier: Apache-2.0
"""LinePins, slaves and monitor against the RTL of one call (asi_xact)."""
import random

import cocotb
from asi.monitor import Monitor
from asi.regmap import ErrorClass
from asi.telegram import encode_call, pulses, request_pulses, response_word
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, RisingEdge, Timer

from cocotb_tests.models.chip import MASTER, LinePins
from cocotb_tests.models.slaves import POWER_UP_NS, Slave, SlaveNetwork


class Bench:
    """asi_xact with a line on its pins and a monitor on the line."""

    async def start(self, dut):
        self.dut = dut
        self.period_ps = 10 ** 12 // int(dut.ClkHz.value)
        Clock(dut.clk_i, self.period_ps, unit="ps").start()
        dut.rst_i.value, dut.enable_i.value, dut.req_valid_i.value = 1, 0, 0
        dut.req_retries_i.value, dut.req_no_reply_i.value, dut.req_call_i.value, dut.req_sel_i.value = 0, 0, 0, 0
        self.pins = LinePins(dut)
        self.line, self.seen = self.pins.line, []
        self.monitor = Monitor(self.line)
        self.line.listen(self.seen.append)
        await FallingEdge(dut.clk_i)
        await FallingEdge(dut.clk_i)
        dut.rst_i.value, dut.enable_i.value = 0, 1
        return self

    async def call(self, call, retries=0):
        """Offer a call -> (last class, first class, data, repeats)."""
        dut = self.dut
        dut.req_call_i.value, dut.req_retries_i.value, dut.req_valid_i.value = call, retries, 1
        await RisingEdge(dut.sent_o)
        await RisingEdge(dut.clk_i)
        dut.req_valid_i.value = 0
        await RisingEdge(dut.res_valid_o)
        await FallingEdge(dut.clk_i)
        return (ErrorClass(int(dut.res_last_o.value)), ErrorClass(int(dut.res_first_o.value)),
                int(dut.res_data_o.value), int(dut.res_repeats_o.value))

    def starts(self):
        """First pulse of every request so far."""
        mine = [p.t_ns for p in self.seen if p.sender == MASTER]
        return [t for k, t in enumerate(mine) if k == 0 or t - mine[k - 1] > 10_000]


@cocotb.test(timeout_time=30, timeout_unit="ms")
async def pulses_and_gaps(dut):
    """TL-005, LT-004, LT-005, SL-002: the line carries the pulses of the codec; the gaps are exact."""
    bench = await Bench().start(dut)
    net = SlaveNetwork(bench.line, [Slave(5, inputs=3)])
    await Timer(POWER_UP_NS, "ns")
    for call in (encode_call("WPAR", 5, 6), encode_call("RDIO", 5), encode_call("RDIO", 9), encode_call("RDIO", 5)):
        result = await bench.call(call)
        assert result[0] is (ErrorClass.NO_RESPONSE if call >> 5 & 31 == 9 else ErrorClass.OK)
        first = bench.starts()[-1]
        assert [(p.t_ns - first, p.polarity) for p in bench.seen if p.t_ns >= first][:len(request_pulses(call))] \
            == request_pulses(call)
    starts = bench.starts()
    answer = lambda delay: 78_000 + delay + 36_000 + 18_500  # noqa: E731
    expected = [answer(33_500), answer(21_500), 150_000]
    assert [b - a for a, b in zip(starts, starts[1:])] == expected
    assert net.slaves[0].synchronous and [r.error_class for r in bench.monitor.telegrams[:3]] == [0, 0, 1]


@cocotb.test(timeout_time=200, timeout_unit="ms")
async def receiver_agrees_with_the_monitor(dut):
    """RX-001 .. RX-008, RX-011, LT-002, LT-003: whatever comes back, RTL and monitor give it the same class."""
    bench = await Bench().start(dut)
    rng = random.Random(1)
    call, request = encode_call("RDIO", 5), request_pulses(encode_call("RDIO", 5))
    count = {}
    for _ in range(300):
        answer = pulses(response_word(rng.randrange(16)) ^ rng.choice((0, 0, 0, 1, 2)), 7)
        for _ in range(rng.choice((0, 1, 1, 1, 2))):
            k = rng.randrange(1, len(answer))
            t, polarity = answer[k]
            match rng.choice(("drop", "invert", "shift", "add", "last", "first")):
                case "drop":
                    del answer[k]
                case "invert":
                    answer[k] = (t, -polarity)
                case "shift":
                    answer[k] = (t + rng.choice((-2_000, -1_000, -750, -250, 250, 1_250, 1_750, 2_000)), polarity)
                case "add":
                    answer.append((t + rng.choice((3_000, 4_500, 6_000)), -polarity))
                case "last":
                    answer.append((answer[-1][0] + rng.choice((3_000, 6_000, 9_000)), -answer[-1][1]))
                case "first":
                    answer[0] = (0, 1)
        delay = rng.choice((11_000, 13_000, 21_500, 21_500, 33_500, 65_000, 67_000))
        before = len(bench.monitor.telegrams)
        task = cocotb.start_soon(bench.call(call))
        await RisingEdge(dut.sent_o)
        end = bench.pins.now() + bench.period_ps / 1_000 + request[-1][0]
        answer = sorted(dict(answer).items())       # opposite pulses at one instant have no order: leave them out
        bench.line.send(end + delay, [(t - answer[0][0], p) for t, p in answer], "slave")
        last, _, data, _ = await task
        await Timer(200, "us")      # what comes late belongs to no call
        bench.monitor.settle(bench.pins.now())
        record = bench.monitor.telegrams[before]
        assert (record.error_class, record.call) == (last, call), f"{record.error_class!r} {last!r} {answer} {delay}"
        if last is ErrorClass.OK:
            assert record.data == data
        count[last] = count.get(last, 0) + 1
    assert set(count) >= set(ErrorClass) - {ErrorClass.ABORTED, ErrorClass.BAD_MASTER}, count
