# SPDX-License-Identifier: Apache-2.0
"""The Python models against the rules of the line. No simulator."""
import pytest
from asi.checks import ANSWER_BITS, RequestCollector, classify, window
from asi.monitor import Monitor
from asi.regmap import ErrorClass
from asi.telegram import encode_call, pulses, request_pulses, request_word, response_pulses, response_word
from hypothesis import given, settings
from hypothesis import strategies as st

from cocotb_tests.models.faults import Faults
from cocotb_tests.models.line import Line
from cocotb_tests.models.slaves import (OUTPUT_ONLY, POWER_UP_NS, RESET_NS, WATCHDOG_NS, WRITE_NS, Slave, SlaveNetwork)

MS = 1_000_000
E3 = [(0, -1), (3_000, 1), (6_000, -1), (9_000, 1), (12_000, -1), (18_000, 1), (21_000, -1), (24_000, 1), (30_000, -1),
      (36_000, 1)]


class Bench:
    """A line with slaves, everything that was seen on it, and a master that only knows calls."""

    def __init__(self, *slaves, seed=0):
        self.line = Line()
        self.seen = []
        self.line.listen(self.seen.append)
        self.monitor = Monitor(self.line)
        self.net = SlaveNetwork(self.line, slaves, seed)
        self.line.advance(POWER_UP_NS)

    def request(self, train, wait_ns=150_000):
        """Send request pulses now, let wait_ns pass -> [(ns after the last request pulse, polarity)] of the answers."""
        start, before = self.line.now, len(self.seen)
        self.line.send(start, train, "master")
        self.line.advance(start + train[-1][0] + wait_ns)
        self.net.settle()
        return [(p.t_ns - start - train[-1][0], p.polarity) for p in self.seen[before:] if p.sender != "master"]

    def call(self, name, index=0, data=0, **options):
        """One good request -> (delay, nibble) of a good answer, None without any pulse."""
        got = self.request(request_pulses(encode_call(name, index, data, **options)))
        if not got:
            return None
        delay = got[0][0]
        error, word = classify([(t - delay, p) for t, p in got], ANSWER_BITS)
        assert error is ErrorClass.OK
        return delay, word >> 2

    def nibble(self, *args, **options):
        got = self.call(*args, **options)
        return None if got is None else got[1]

    def wait(self, ns):
        self.line.advance(self.line.now + ns)
        self.net.settle()

    def records(self):
        self.wait(MS)
        self.monitor.settle(self.line.now)
        return self.monitor.telegrams


def train(grid):
    """'-+-.+' of the worked examples, one character per 3 us, -> pulses."""
    return [(3_000 * k, 1 if c == "+" else -1) for k, c in enumerate(grid) if c != "."]


# ---------------------------------------------------------------------------------------------- line
def test_line_order_and_merging():
    """SL-008: of two senders equal polarities merge into one pulse, opposite ones are both seen, in order of start."""
    line, seen = Line(), []
    line.listen(lambda p: seen.append((p.t_ns, p.polarity)))
    line.pulse(1_000, -1, "b")
    line.pulse(0, -1, "a")          # still there at 1000: one pulse
    line.pulse(1_000, 1, "b")
    line.pulse(2_499, -1, "c")      # the merged pulse lasted until 2500, now until 3999
    line.pulse(4_000, -1, "d")
    line.advance(3_999)
    assert seen == [(0, -1), (1_000, 1)] and line.next_ns == 4_000
    line.advance(4_000)
    assert seen[2:] == [(4_000, -1)] and line.next_ns is None
    with pytest.raises(ValueError):
        line.pulse(3_999, 1)


def test_line_pulses_before_timers():
    """RX-003: a timer set for an instant runs after the pulses of that instant, so windows include their end."""
    line, seen = Line(), []
    line.at(5, seen.append, "timer")
    line.listen(lambda p: seen.append("pulse"))
    line.pulse(5, 1)
    line.advance(5)
    assert seen == ["pulse", "timer"]


# ---------------------------------------------------------------------------------------------- checks
@pytest.mark.parametrize("word, bits, grid", [
    (0x02A9, 14, "-+-+-+-.+.-.+.-.+.-.+.-+-.+"), (0x0295, 14, "-+-+-+-.+.-.+.-+-.+.-.+.-.+"),
    (0x0D, 7, "-+-+-.+-+.-.+"), (0x19, 7, "-+-.+-+.-+-.+"), (0x01, 7, "-+-+-+-+-+-.+"), (0x3D, 7, "-.+-+-+-+.-.+"),
    (0x065B, 14, "-+-+-.+-+.-+-.+.-.+-+.-.+-+"), (0x1FD7, 14, "-.+-+-+-+-+-+-+.-.+.-.+-+-+"),
    (0x02B7, 14, "-+-+-+-.+.-.+.-.+-+.-.+-+-+"), (0x001F, 14, "-+-+-+-+-+-+-+-+-.+-+-+-+-+"),
])
def test_worked_examples(word, bits, grid):
    """TL-006: the pulse trains of the worked examples are what the codec makes and what the checks take for good."""
    assert pulses(word, bits) == train(grid)
    assert classify(train(grid), bits) == (ErrorClass.OK, word)


def test_windows():
    """RX-003: n*3 us -0.875/+1.5 us, both ends included, a dead zone of 0.625 us between."""
    for n in (1, 2, 12, 26):
        mid = 3_000 * n
        assert [window(mid + d) for d in (-876, -875, 0, 1_500, 1_501)] == [None, n, n, n, None]
    assert [window(t) for t in (0, 1_500, 2_124, 2_125)] == [None, None, None, 1]


def without(train_, *times):
    return [p for p in train_ if p[0] not in times]


def moved(train_, time, by):
    return sorted((t + by * (t == time), p) for t, p in train_)


E12 = [
    ("drop +24", without(E3, 24_000), ErrorClass.ALTERNATION),      # no-information too: alternation is reported first
    ("-21 to 19.8", moved(E3, 21_000, -1_200), ErrorClass.TIMING),
    ("drop -21 +24", without(E3, 21_000, 24_000), ErrorClass.NO_INFORMATION),
    ("PB", pulses(0b0001111, 7), ErrorClass.PARITY),
    ("-39", E3 + [(39_000, -1)], ErrorClass.LENGTH),
    ("+ first", [(t, -p) for t, p in E3], ErrorClass.START),
    ("end bit", pulses(0b0001100, 7), ErrorClass.END_BIT),
    ("end missing", E3[:-1], ErrorClass.NO_INFORMATION),
    ("+39", E3 + [(39_000, 1)], ErrorClass.LENGTH),
    ("late edge", moved(E3, 36_000, 1_500), ErrorClass.OK),
    ("early edge", moved(E3, 36_000, -875), ErrorClass.OK),
    ("too late", moved(E3, 18_000, 1_501), ErrorClass.TIMING),
    ("too early", moved(E3, 18_000, -876), ErrorClass.TIMING),
    ("43.5 quiet end", E3 + [(43_500, -1)], ErrorClass.LENGTH),
    ("43.501 is after it", E3 + [(43_501, -1)], ErrorClass.OK),
    ("end pulse twice", E3 + [(37_000, -1)], ErrorClass.LENGTH),
    ("end pulse late by too much", moved(E3, 36_000, 1_501), ErrorClass.TIMING),
    ("three in a window", sorted(without(E3, 18_000) + [(17_200, 1), (18_000, -1), (19_000, 1)]), ErrorClass.TIMING),
]


@pytest.mark.parametrize("what, answer, error", E12, ids=[e[0] for e in E12])
def test_answer_classes(what, answer, error):
    """RX-001 .. RX-008, RX-011: the negative examples E12 and the limits of each window give their class."""
    assert classify(answer, ANSWER_BITS)[0] is error
    line = Line()
    monitor = Monitor(line)
    line.send(0, request_pulses(encode_call("DEXG", 5, 10)))
    line.send(78_000 + 21_500, answer)
    line.advance(MS)
    monitor.settle(MS)
    record, *rest = monitor.telegrams
    assert (record.error_class, record.call, record.delay_ns) == (error, encode_call("DEXG", 5, 10), 21_500)
    assert record.data == (3 if error is ErrorClass.OK else None)
    # the pulse at 43.501 us belongs to no telegram any more: it starts a bad request
    assert [r.request_ok for r in rest] == ([False] if what.startswith("43.501") else [])


@given(st.data())
@settings(max_examples=200, deadline=None, derandomize=True)
def test_reporting_order(data):
    """RX-008: whatever is done to an answer, the class is the first check in the reporting order that fails."""
    answer = response_pulses(data.draw(st.integers(0, 15)))
    for _ in range(data.draw(st.integers(0, 4))):
        k = data.draw(st.integers(0, len(answer) - 1))
        what = data.draw(st.sampled_from(["drop", "invert", "shift", "add"]))
        if what == "drop" and k:
            del answer[k]
        elif what == "invert":
            answer[k] = (answer[k][0], -answer[k][1])
        elif what == "shift" and k:
            answer[k] = (max(answer[k][0] + data.draw(st.integers(-3_000, 3_000)), 1), answer[k][1])
        elif what == "add":
            answer.append((data.draw(st.integers(1, 43_500)), data.draw(st.sampled_from([-1, 1]))))
        answer.sort(key=lambda p: (p[0], -p[1]))
    # the rules once more, each on its own and from the wording of the requirements
    near = {n: [p for p in answer if n * 3_000 - 875 <= p[0] <= n * 3_000 + 1_500] for n in range(1, 13)}
    end = answer.index(near[12][0]) if near[12] else len(answer) - 1
    telegram, after = answer[:end + 1], answer[end + 1:]
    bits = {n: near[n][0][1] > 0 for n in range(2, 13, 2) if near[n]}
    rules = [
        (ErrorClass.START, answer[0][1] != -1),
        (ErrorClass.ALTERNATION, any(a[1] == b[1] for a, b in zip(telegram, telegram[1:]))),
        (ErrorClass.TIMING, any(sum(p in near[n] for n in near) != 1 for p in telegram[1:])
         or any(len([p for p in near[n] if p in telegram]) > 1 for n in near)),
        (ErrorClass.NO_INFORMATION, len(bits) < 6),
        (ErrorClass.END_BIT, not bits.get(12)),
        (ErrorClass.PARITY, sum(bits[n] for n in bits if n < 12) & 1),
        (ErrorClass.LENGTH, after),
        (ErrorClass.OK, True),
    ]
    assert classify(answer, ANSWER_BITS)[0] is next(error for error, broken in rules if broken)


@given(st.integers(0, 2047), st.data())
@settings(max_examples=200, deadline=None, derandomize=True)
def test_collector_agrees_with_classify(call, data):
    """RX-008, SL-003: following a request pulse by pulse finds a fault in exactly those classify() rejects."""
    request = request_pulses(call)
    k = data.draw(st.integers(1, len(request) - 1))
    what = data.draw(st.sampled_from(["good", "drop", "invert", "shift"]))
    if what == "drop":
        del request[k]
    elif what == "invert":
        request[k] = (request[k][0], -request[k][1])
    elif what == "shift":
        shift = data.draw(st.integers(-2_500, 2_500))
        request = sorted((t + shift * (j == k), p) for j, (t, p) in enumerate(request))
    collector = RequestCollector(0, request[0][1])
    good = all([collector.add(t, p) for t, p in request[1:]]) and collector.alive(100_000)
    error, word = classify(request, 14)
    assert good == (error is ErrorClass.OK)
    if good:
        assert collector.call == word >> 2 and request_word(collector.call) == word


# ---------------------------------------------------------------------------------------------- slaves
def test_power_up_state():
    """SL-001: after power-up outputs and parameter F, asynchronous, DEXG without answer until the first WPAR."""
    slave = Slave(5, io=7, inputs=3)
    bench = Bench(slave)
    assert (slave.outputs, slave.parameter, slave.synchronous, slave.dexg_disabled) == (15, 15, False, True)
    assert bench.call("DEXG", 5, 10) is None
    assert bench.nibble("WPAR", 5, 6) == 6
    assert bench.nibble("DEXG", 5, 10) == 3
    assert (slave.outputs, slave.parameter, slave.dexg_disabled) == (10, 6, False)


def test_power_up_time():
    """SL-001: a slave is silent for 10 ms after power-up or plugging in, whatever it knew before is gone."""
    slave = Slave(5)
    bench = Bench(slave)
    bench.call("WPAR", 5, 2)
    bench.net.power(False)
    bench.wait(MS)
    assert bench.call("RDIO", 5) is None
    bench.net.power(True)
    bench.wait(9 * MS)
    assert bench.call("RDIO", 5) is None
    bench.wait(MS)
    assert bench.nibble("RDIO", 5) == 7 and slave.parameter == 15 and slave.dexg_disabled
    bench.net.set_present(slave, False)
    assert bench.call("RDIO", 5) is None
    bench.net.set_present(slave, True)
    assert bench.call("RDIO", 5) is None
    bench.wait(10 * MS)
    assert bench.nibble("RDIO", 5) == 7


def test_answer_delays():
    """SL-002, RX-013: 33.5 us after the last request pulse while asynchronous, 21.5 us when synchronous."""
    bench = Bench(Slave(5))
    assert bench.call("RDIO", 5) == (33_500, 7)
    assert bench.call("RDIO", 5) == (21_500, 7)
    assert bench.call("WPAR", 5, 15) == (21_500, 15)


def test_delay_counts_from_the_real_end_pulse():
    """SL-002: the answer follows the end pulse as it was, not as it should have been."""
    bench = Bench(Slave(5))
    request = request_pulses(encode_call("RDIO", 5))
    request[-1] = (request[-1][0] + 1_000, 1)
    assert bench.request(request)[0] == (33_500, -1)


def test_answer_pulses():
    """TL-002, TL-005: the answer of slave 5 with inputs 0011 to E1 is E3."""
    bench = Bench(Slave(5, inputs=3))
    bench.call("WPAR", 5, 15)
    got = bench.request(train("-+-+-+-.+.-.+.-.+.-.+.-+-.+"))
    assert got == [(t + 21_500, p) for t, p in E3]


BAD = {
    "parity": pulses(request_word(encode_call("RDIO", 5)) ^ 2, 14),
    "end bit": pulses(request_word(encode_call("RDIO", 5)) ^ 1, 14),
    "missing": request_pulses(encode_call("RDIO", 5))[:4] + request_pulses(encode_call("RDIO", 5))[6:],
    "broken off": request_pulses(encode_call("RDIO", 5))[:7],
    "shifted": moved(request_pulses(encode_call("RDIO", 5)), 42_000, -1_200),
    "too long": request_pulses(encode_call("RDIO", 5)) + [(84_000, -1)],
    "quiet until 85.5": request_pulses(encode_call("RDIO", 5)) + [(85_500, -1)],
    "positive": [(0, 1)],
}


@pytest.mark.parametrize("name", BAD)
def test_bad_request(name):
    """SL-003: a bad request is not answered and makes every slave asynchronous; one good one is enough to return."""
    slave, other = Slave(5), Slave(7)
    bench = Bench(slave, other)
    assert bench.call("RDIO", 5)[0] == 33_500 and slave.synchronous and other.synchronous
    assert bench.request(BAD[name]) == []
    assert not slave.synchronous and not other.synchronous
    assert bench.call("RDIO", 7) == (33_500, 7)
    assert bench.call("RDIO", 5) == (21_500, 7)


def test_other_addresses():
    """SL-003, SL-004: a good request for another address, even an empty one, makes and keeps a slave synchronous."""
    slave = Slave(5)
    bench = Bench(slave)
    assert bench.call("RDIO", 9) is None and slave.synchronous
    assert bench.call("DEXG", 31, 0) is None and slave.synchronous
    assert bench.call("RDIO", 5) == (21_500, 7)


def test_asynchronous_needs_more_quiet():
    """SL-003: a pulse 18 us after the request disturbs only slaves that are not synchronous."""
    late = (78_000 + 18_000, -1)
    request = request_pulses(encode_call("RDIO", 5)) + [late]
    bench = Bench(Slave(5))
    assert bench.request(request) == []
    bench.call("RDIO", 5)
    got = bench.request(request)
    assert got == [(t + 21_500 - 18_000, p) for t, p in response_pulses(7)]     # counted from the disturbing pulse


def test_new_request_needs_a_pause():
    """SL-003: after a bad request 18 us of quiet make the next pulse a start again; less does not."""
    for gap, expected in ((17_999, []), (18_000, [(33_500, -1)])):
        bench = Bench(Slave(5))
        broken = request_pulses(encode_call("RDIO", 5))[:5]
        start = broken[-1][0] + gap
        again = [(start + t, p) for t, p in request_pulses(encode_call("RDIO", 5))]
        assert bench.request(broken + again)[:1] == expected


COMMANDS = [("RDIO", 3), ("RDID", 0xA), ("RID1", None), ("RID2", 0xE), ("RDST", 0), ("RES", 6), ("DELA", 0)]


@pytest.mark.parametrize("index", [5, 37])
@pytest.mark.parametrize("name, answer", COMMANDS)
def test_commands_of_ab_slaves(index, name, answer):
    """SL-005, CA-003, CA-004: the commands reach the A or the B slave of a number by the select bit alone."""
    a, b = Slave(5, io=3, id=0xA, id1=7, id2=0xE), Slave(37, io=3, id=0xA, id1=7, id2=0xE)
    bench = Bench(a, b)
    if name == "RID1":
        answer = 0xF if index == 37 else 7
    assert bench.nibble(name, index) == answer
    called, other = (b, a) if index == 37 else (a, b)
    assert (called.answers, other.answers, other.requests) == (1, 0, 0)


def test_standard_slave_ignores_sel_1():
    """SL-005, EX-006: the commands with Sel = 1 do not exist for a standard slave."""
    bench = Bench(Slave(5))
    assert [bench.call(name, 37) for name, _ in COMMANDS] == [None] * len(COMMANDS)


def test_ab_data():
    """SL-005, CA-001, CA-002: A/B slaves take three bits, I3 selects, D3 and P3 keep 1, D3 is an input."""
    a, b = Slave(5, io=8, id=0xA, inputs=8), Slave(37, io=7, id=0xA, inputs=5)
    bench = Bench(a, b)
    assert bench.nibble("WPAR", 5, 2, extended=True) == 0b1010
    assert bench.nibble("WPAR", 37, 1) == 0b1001
    assert bench.nibble("DEXG", 5, 5, extended=True) == 0b1101     # three outputs echoed, D3 = input 1
    assert (a.outputs, b.outputs, a.parameter, b.parameter) == (0b1101, 15, 0b1010, 0b1001)
    assert bench.nibble("DEXG", 37, 2) == 5 and b.outputs == 0b1010 and a.outputs == 0b1101


IO_TEXT = dict(enumerate("IIII IIIO IIIB IIOO IIBB IOOO IBBB BBBB OOOO OOOI OOOB OOII OOBB OIII OBBB TTTT".split()))


@pytest.mark.parametrize("io", range(16))
def test_io_codes(io):
    """SL-005: output-only ports echo the output bit, all others answer the input; D0 is the first letter."""
    bench = Bench(Slave(5, io=io, inputs=0b0110))
    bench.call("WPAR", 5, 15)
    outputs = sum(1 << bit for bit, kind in enumerate(IO_TEXT[io]) if kind == "O")
    assert OUTPUT_ONLY[io] == outputs
    for out in (0b1010, 0b0101):
        assert bench.nibble("DEXG", 5, out) == out & outputs | 0b0110 & ~outputs & 15


def test_reset():
    """SL-001, SL-005: RES answers 6, then defaults, 1 ms of silence, asynchronous, DEXG blocked."""
    slave = Slave(5)
    bench = Bench(slave)
    bench.call("WPAR", 5, 3)
    bench.call("DEXG", 5, 2)
    assert bench.call("RES", 5) == (21_500, 6)
    assert (slave.outputs, slave.parameter, slave.dexg_disabled, slave.synchronous) == (15, 15, True, False)
    assert bench.call("RDIO", 5) is None
    bench.wait(RESET_NS)
    assert bench.call("RDIO", 5) == (33_500, 7)
    assert bench.call("DEXG", 5, 2) is None


def test_broadcast_reset():
    """SL-005: BR01 resets everybody, standard, A and B, and nobody answers."""
    slaves = [Slave(5), Slave(38, id=0xA), Slave(31), Slave(0)]
    bench = Bench(*slaves)
    bench.call("WPAR", 31, 0)
    bench.call("WPAR", 5, 0)
    assert bench.call("BR01") is None
    assert [s.parameter for s in slaves] == [15] * 4
    assert bench.call("RDIO", 31) is None
    bench.wait(RESET_NS)
    assert [bench.nibble("RDIO", s.address) for s in slaves] == [7] * 4


def test_delete_address_is_volatile():
    """SL-005: DELA moves the slave to 0 at once; a reset brings the old address back."""
    slave = Slave(5)
    bench = Bench(slave)
    assert bench.nibble("DELA", 5) == 0 and slave.address == 0
    assert bench.call("RDIO", 5) is None and bench.nibble("RDIO", 0) == 7 and bench.nibble("RDST", 0) == 0
    assert bench.nibble("RES", 0) == 6
    bench.wait(RESET_NS)
    assert bench.nibble("RDIO", 5) == 7 and bench.call("RDIO", 0) is None


def test_address_assignment():
    """SL-005: ADRA is taken at address 0 only, answers 6, holds at once; S0 = 1 for 15 ms; then it survives power."""
    slave, other = Slave(0), Slave(5)
    bench = Bench(slave, other)
    assert bench.nibble("ADRA", data=7) == 6 and slave.address == 7 and other.address == 5
    assert bench.call("ADRA", data=9) is None
    assert bench.nibble("RDST", 7) == 1
    bench.wait(WRITE_NS)
    assert bench.nibble("RDST", 7) == 0
    bench.net.power(False)
    bench.net.power(True)
    bench.wait(POWER_UP_NS)
    assert bench.nibble("RDID", 7) == 0xF and slave.address == 7


def test_power_fail_while_writing():
    """SL-005: power lost during the write: address 0, IO and ID read F, S3 = 1; a write that goes well repairs it."""
    slave = Slave(0, io=3, id=0xA, id1=0xF)
    bench = Bench(slave)
    bench.call("ADRA", data=7)
    bench.wait(5 * MS)
    bench.net.power(False)
    bench.net.power(True)
    bench.wait(POWER_UP_NS)
    assert [bench.nibble(name) for name in ("RDIO", "RDID", "RDST")] == [15, 15, 8]
    bench.call("ADRA", data=7)
    assert [bench.nibble(name, 7) for name in ("RDST", "RDID")] == [9, 15]
    bench.net.power(False)
    bench.net.power(True)
    bench.wait(POWER_UP_NS)
    bench.call("ADRA", data=7)
    bench.wait(WRITE_NS)
    assert [bench.nibble(name, 39) for name in ("RDIO", "RDID", "RDST")] == [3, 10, 0]


def test_write_id1():
    """SL-005: WID1 at address 0 answers 0, sets ID1 and with it the select bit of an A/B slave; S0 = 1 meanwhile."""
    slave = Slave(0, id=0xA, id1=7)
    bench = Bench(slave)
    assert bench.nibble("WID1", data=0xF) == 0 and slave.id1 == 15
    assert bench.nibble("RDST", 0) == 1
    bench.wait(WRITE_NS)
    assert bench.nibble("RDST", 0) == 0
    assert bench.nibble("ADRA", data=4) == 6 and slave.address == 36
    assert bench.nibble("RID1", 36) == 15
    assert bench.call("WID1", data=3) is None


SEL_1_AT_0 = {"RDIO": 0b11000, "RDID": 0b11001, "RID1": 0b11010, "RID2": 0b11011, "RDST": 0b10110, "RES": 0b10100}


@pytest.mark.parametrize("sel_at_zero", [False, True])
@pytest.mark.parametrize("name", SEL_1_AT_0)
def test_select_at_address_0(name, sel_at_zero):
    """SL-010, AD-007: at address 0 an A/B slave obeys Sel = 0, or with the option the select of its ID1 bit 3."""
    slave = Slave(44, id=0xA, sel_at_zero=sel_at_zero)
    bench = Bench(slave)
    assert bench.nibble("DELA", 44) == 0 and slave.address == 0 and slave.id1 == 15
    answered = [bool(bench.request(request_pulses(encode_call(name, 0)))),
                bool(bench.request(request_pulses(1 << 10 | SEL_1_AT_0[name])))]
    assert answered == [not sel_at_zero, sel_at_zero]


def test_select_at_address_0_follows_id1():
    """SL-010: WID1 that changes the select counts from then on; calls without a select reach the slave anyway."""
    slave = Slave(0, id=0xA, id1=7, sel_at_zero=True)
    bench = Bench(slave)
    assert bench.nibble("RDST", 0) == 0
    assert bench.nibble("WID1", data=0xF) == 0
    assert bench.call("RDST", 0) is None
    assert bench.request(request_pulses(1 << 10 | SEL_1_AT_0["RDST"]))
    assert bench.nibble("WID1", data=7) == 0 and bench.nibble("RDST", 0) == 1
    bench.call("WID1", data=0xF)
    assert bench.nibble("ADRA", data=4) == 6 and slave.address == 36
    standard = Slave(0, id1=15, sel_at_zero=True)
    assert Bench(standard).nibble("RDIO", 0) == 7               # no A/B slave: no select


@pytest.mark.parametrize("write_ns", [0, 2 * MS, 500 * MS])
def test_write_time(write_ns):
    """SL-010: S0 = 1 exactly as long as the option says, for ADRA and for WID1."""
    slave = Slave(0, write_ns=write_ns)
    bench = Bench(slave)
    for name, data in (("WID1", 3), ("ADRA", 7)):
        assert bench.nibble(name, data=data) is not None
        start = bench.line.now - 150_000                        # last pulse of that request
        if write_ns:
            assert slave.status(start + write_ns - 1) == 1
        assert slave.status(start + write_ns) == 0
        bench.wait(write_ns)
    assert bench.nibble("RDST", 7) == 0 and bench.nibble("RID1", 7) == 3


def test_watchdog_waits_for_a_long_write():
    """SL-010, SL-006: the watchdog waits for the end of a write that takes longer than itself."""
    slave = Slave(0, watchdog=True, write_ns=300 * MS)
    bench = Bench(slave)
    bench.call("ADRA", data=5)
    bench.call("WPAR", 5, 1)
    bench.wait(290 * MS)
    assert slave.parameter == 1
    bench.wait(20 * MS)
    assert slave.parameter == 15 and slave.address == 5


def test_failing_write():
    """SL-010: a write that fails: S0 while it runs, then S3, the new address until a reset, then the old one."""
    slave = Slave(0, id=0xA, id1=7, write_fails=True)
    bench = Bench(slave)
    assert bench.nibble("WID1", data=0xD) == 0 and bench.nibble("RDST", 0) == 1
    bench.wait(WRITE_NS)
    assert bench.nibble("RDST", 0) == 8 and bench.nibble("RID1", 0) == 0xD
    assert bench.nibble("ADRA", data=7) == 6 and bench.nibble("RDST", 39) == 9
    bench.wait(WRITE_NS)
    assert bench.nibble("RDST", 39) == 8
    assert bench.nibble("RES", 39) == 6
    bench.wait(RESET_NS)
    assert [bench.nibble(name, 0) for name in ("RDST", "RID1", "RDIO")] == [8, 7, 7]    # S3 stays, the codes are good
    slave.write_fails = False
    assert bench.nibble("ADRA", data=7) == 6 and bench.nibble("RDST", 7) == 9
    bench.wait(WRITE_NS)
    assert bench.nibble("RDST", 7) == 0
    slave.write_fails = True
    bench.call("DELA", 7)
    bench.call("ADRA", data=9)
    bench.wait(WRITE_NS)
    assert bench.nibble("RDST", 9) == 8
    bench.net.power(False)
    bench.net.power(True)
    bench.wait(POWER_UP_NS)
    assert bench.call("RDIO", 9) is None and bench.nibble("RDST", 7) == 8


def test_locked_id1():
    """SL-010: protected ID1: only its select bit can be changed; anything else is neither answered nor done."""
    slave = Slave(0, id=0xA, id1=5, id1_locked=True)
    bench = Bench(slave)
    for id1 in range(16):
        assert bench.nibble("WID1", data=id1) == (0 if id1 & 7 == 5 else None)
        assert slave.id1 & 7 == 5
    assert slave.id1 == 13
    bench.wait(WRITE_NS)
    bench.call("RES", 0)
    bench.wait(RESET_NS)
    assert bench.nibble("RID1", 0) == 13


@pytest.mark.parametrize("index, id", [(5, 0xF), (0, 0xF), (37, 0xA)])
def test_old_slave(index, id):
    """SL-010, EX-005: a slave older than 2.1 answers everything but RID1 and RID2."""
    bench = Bench(Slave(index, io=3, id=id, old=True))
    answers = {name: bench.nibble(name, index) for name in ("RDIO", "RDID", "RID1", "RID2", "RDST")}
    assert answers == {"RDIO": 3, "RDID": id, "RID1": None, "RID2": None, "RDST": 0}


def test_status_bits():
    """SL-005: S1 shows the peripheral fault."""
    slave = Slave(5)
    bench = Bench(slave)
    slave.periphery_fault = True
    assert bench.nibble("RDST", 5) == 2


def test_production_and_reserved_calls():
    """SL-005: PRGM and the reserved R1 are good requests without answer or effect."""
    slave, zero = Slave(5), Slave(0)
    bench = Bench(slave, zero)
    assert bench.call("PRGM") is None and bench.call("R1", 5) is None and slave.synchronous and zero.synchronous
    assert bench.nibble("RDIO", 5) == 7


def test_watchdog():
    """SL-006: 94.2 ms without DEXG or WPAR reset the slave; each of the two, and nothing else, restarts the time."""
    slave, without_watchdog, zero = Slave(5, watchdog=True), Slave(6), Slave(0, watchdog=True)
    bench = Bench(slave, without_watchdog, zero)
    for index in (5, 6):
        bench.call("WPAR", index, 2)
    bench.wait(90 * MS)
    bench.call("DEXG", 5, 1)
    start = bench.line.now - 150_000       # last pulse of that request
    bench.line.advance(start + WATCHDOG_NS - 2 * MS)
    bench.call("RDIO", 5)
    bench.line.advance(start + WATCHDOG_NS - 1)
    bench.net.settle()
    assert (slave.parameter, slave.outputs) == (2, 1)
    bench.line.advance(start + WATCHDOG_NS)
    bench.net.settle()
    assert (slave.parameter, slave.outputs, slave.dexg_disabled) == (15, 15, True)
    assert (without_watchdog.parameter, zero.synchronous) == (2, True)
    assert bench.call("RDIO", 5) is None
    bench.wait(RESET_NS)
    assert bench.call("RDIO", 5) == (33_500, 7)


def test_watchdog_waits_for_the_memory():
    """SL-006: the watchdog does not reset while the memory is written."""
    slave = Slave(0, watchdog=True)
    bench = Bench(slave)
    bench.call("ADRA", data=5)
    bench.wait(89 * MS)
    bench.call("DELA", 5)
    bench.call("ADRA", data=6)
    bench.wait(80 * MS)
    assert slave.address == 6
    bench.call("WPAR", 6, 1)
    bench.call("DELA", 6)
    bench.wait(200 * MS)                    # address 0: no watchdog
    assert (slave.address, slave.parameter) == (0, 1)
    bench.call("WID1", data=3)
    bench.wait(10 * MS)
    assert slave.parameter == 1


def test_slave_arguments():
    """SL-005: an address that cannot exist is refused."""
    for address, id_ in ((32, 15), (64, 15), (37, 15), (-1, 15)):
        with pytest.raises(ValueError):
            Slave(address, id=id_)
    assert Slave(37, id=0xA, id1=0).id1 == 8 and Slave(5, id=0xA, id1=15).id1 == 7


# ---------------------------------------------------------------------------------------------- faults
FAULTS = {
    "no_answer": {ErrorClass.NO_RESPONSE}, "parity": {ErrorClass.PARITY}, "extra_pulse": {ErrorClass.LENGTH},
    "missing_pulse": {ErrorClass.ALTERNATION, ErrorClass.NO_INFORMATION}, "shifted_pulse": {ErrorClass.TIMING,
                                                                                           ErrorClass.LENGTH,
                                                                                           ErrorClass.NO_INFORMATION,
                                                                                           ErrorClass.ALTERNATION},
    "double_answer": {ErrorClass.ALTERNATION},
}


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("inputs", [0, 3, 9, 15])
def test_faults(fault, inputs):
    """SL-008, RX-011: every kind of fault breaks every answer, in a class that belongs to it."""
    bench = Bench(Slave(5, inputs=inputs, faults=Faults(**{fault: 1.0}, shift_ns=2_000)), seed=inputs)
    for _ in range(10):
        bench.request(request_pulses(encode_call("RID2", 5)))
    records = bench.records()
    assert len(records) == 10 and {r.error_class for r in records} <= FAULTS[fault]
    assert [r.repeated for r in records] == [True and k > 0 and records[k].t_ns - records[k - 1].t_ns <= 220_000
                                             for k in range(10)]


def test_shift_inside_the_window():
    """SL-008: half a microsecond is inside the window, two are not."""
    for shift, good in ((-500, True), (500, True), (-2_000, False)):
        bench = Bench(Slave(5, faults=Faults(shifted_pulse=1.0, shift_ns=shift)))
        bench.request(request_pulses(encode_call("RDIO", 5)))
        assert (bench.records()[0].error_class is ErrorClass.OK) == good


def test_delay_fault():
    """SL-008, LT-003: an answer delayed past the time-out is no answer; its pulses are a bad request to the monitor."""
    slave = Slave(5, faults=Faults(delay_ns=70_000 - 33_500))
    bench = Bench(slave)
    bench.request(request_pulses(encode_call("RDIO", 5)))
    assert [(r.error_class, r.request_ok) for r in bench.records()] == [
        (ErrorClass.NO_RESPONSE, True), (ErrorClass.NO_INFORMATION, False)]
    slave.faults.delay_ns = 66_000 - 21_500
    assert bench.request(request_pulses(encode_call("RDIO", 5)))[0][0] == 66_000
    assert bench.records()[-1].error_class is ErrorClass.OK and bench.records()[-1].delay_ns == 66_000


def test_fault_rate_and_seed():
    """SL-008: a probability is a rate per answer; equal seeds give equal runs, the streams of slaves are their own."""
    def run(seed, *others):
        bench = Bench(Slave(5, faults=Faults(no_answer=0.25)), *others, seed=seed)
        return [bench.call("RDIO", 5) is None for _ in range(200)]
    first = run(1)
    assert 30 <= sum(first) <= 70
    assert first == run(1) == run(1, Slave(6, faults=Faults(parity=0.5))) and first != run(2)
    with pytest.raises(ValueError):
        Faults(parity=1.5)


def test_two_slaves_on_one_address():
    """SL-008: equal answers merge to a good one; different ones break the alternation."""
    bench = Bench(Slave(5, io=7), Slave(5, io=7, id2=3))
    assert bench.nibble("RDIO", 5) == 7
    assert len(bench.request(request_pulses(encode_call("RID2", 5)))) > 12
    assert bench.records()[-1].error_class is ErrorClass.ALTERNATION


# ---------------------------------------------------------------------------------------------- monitor
def test_monitor_early():
    """LT-002: a pulse before 12 us after the request is EARLY, one at 12 us begins an answer."""
    for delay, error in ((11_999, ErrorClass.EARLY), (12_000, ErrorClass.OK)):
        monitor = Monitor()
        for t, p in request_pulses(encode_call("RDIO", 5)) + [(78_000 + delay + t, p) for t, p in E3]:
            monitor.pulse(t, p)
        monitor.settle(MS)
        assert [(r.error_class, r.delay_ns) for r in monitor.telegrams] == [(error, delay)]


def test_monitor_timeout():
    """LT-003: the first pulse may come until 66 us after the request, both included."""
    for delay, errors in ((66_000, [ErrorClass.OK]), (66_001, [ErrorClass.NO_RESPONSE, ErrorClass.NO_INFORMATION])):
        monitor = Monitor()
        for t, p in request_pulses(encode_call("RDIO", 5)) + [(78_000 + delay + t, p) for t, p in E3]:
            monitor.pulse(t, p)
        monitor.settle(MS)
        assert [r.error_class for r in monitor.telegrams] == errors


def test_monitor_follows_a_conversation():
    """TL-003, CA-001: good and bad calls in a row give one record each, with phase, repetition and data."""
    phases = iter([1, 1, 3, 3])
    bench = Bench(Slave(5, inputs=3))
    bench.monitor._phase = lambda: next(phases)
    bench.call("WPAR", 5, 15)
    for _ in range(2):
        bench.request(request_pulses(encode_call("DEXG", 9, 1)), 72_000)
    bench.call("DEXG", 5, 2)
    records = bench.records()
    assert [(r.call, r.data, r.error_class, r.repeated, r.phase) for r in records] == [
        (encode_call("WPAR", 5, 15), 15, ErrorClass.OK, False, 1),
        (encode_call("DEXG", 9, 1), None, ErrorClass.NO_RESPONSE, False, 1),
        (encode_call("DEXG", 9, 1), None, ErrorClass.NO_RESPONSE, True, 3),
        (encode_call("DEXG", 5, 2), 3, ErrorClass.OK, False, 3)]
    assert records[2].t_ns - records[1].t_ns == 150_000


def test_monitor_broadcast():
    """SL-005: no answer to a broadcast is no error, an answer is still judged."""
    bench = Bench(Slave(5))
    bench.call("BR01")
    assert [(r.error_class, r.data) for r in bench.records()] == [(ErrorClass.OK, None)]


@pytest.mark.parametrize("name, error", [
    ("parity", ErrorClass.PARITY), ("end bit", ErrorClass.END_BIT), ("missing", ErrorClass.NO_INFORMATION),
    ("broken off", ErrorClass.NO_INFORMATION), ("shifted", ErrorClass.TIMING), ("positive", ErrorClass.START)])
def test_monitor_bad_requests(name, error):
    """RX-008: a request that is no legal telegram is recorded with the check it fails; the next one is seen again."""
    bench = Bench()
    bench.request(BAD[name])
    bench.request(request_pulses(encode_call("RDIO", 5)))
    first, second = bench.records()
    assert (first.request_ok, first.error_class, first.call) == (False, error, None)
    assert (second.request_ok, second.call) == (True, encode_call("RDIO", 5))


def test_monitor_waits_for_quiet_after_a_bad_answer():
    """LT-006: pulses after a bad answer belong to it until 18 us of quiet."""
    monitor = Monitor()
    request = request_pulses(encode_call("RDIO", 5))
    babble = [(78_000 + 21_500 + 3_000 * k, 1 if k % 2 else -1) for k in range(40)]
    start = babble[-1][0] + 24_000
    for t, p in request + babble + [(start + t, p) for t, p in request]:
        monitor.pulse(t, p)
    monitor.settle(MS)
    first, second = monitor.telegrams
    assert (first.error_class, second.t_ns, second.call) == (ErrorClass.END_BIT, start, encode_call("RDIO", 5))


def test_request_words():
    """TL-001, TL-002: words of the examples E1 and E3."""
    assert request_word(encode_call("DEXG", 5, 10)) == 0x02A9 and response_word(3) == 0x0D
