# SPDX-License-Identifier: Apache-2.0
"""The native slaves and the native monitor (tb/), through the binding asi.native, against the specification."""
import pytest

from asi.native import CERTAIN, NativeError, Net
from asi.regmap import ErrorClass
from asi.telegram import encode_call, pulses, request_pulses, request_word, response_pulses

US, MS = 1_000, 1_000_000
AB = dict(id=0xA, id1=7, id2=0xE)
READY = 20 * MS  # every slave is past its power-up time


class Line:
    """A master that sends one request after the other; time only moves forward."""

    def __init__(self, seed=0, start=READY):
        self.net, self.t = Net(seed), start

    def wait(self, ns):
        self.t += ns

    def send(self, pulses):
        """Sends [(time, polarity)] now; -> answer pulses [(time from the last request pulse, polarity, width)]."""
        answer = [p for p in self.net.advance(self.t)]
        assert not answer
        for at, polarity in pulses:
            self.net.master_pulse(self.t + at, polarity)
        last = self.t + pulses[-1][0]
        self.t = last + 150 * US
        return [(p.t_ns - last, p.polarity, p.width_ns) for p in self.net.advance(self.t)]

    def raw(self, call):
        """-> (answer nibble, delay ns) or None without answer; anything but a clean answer fails."""
        answer = self.send(request_pulses(call))
        if not answer:
            return None
        train = [(t - answer[0][0], polarity) for t, polarity, _ in answer]
        nibbles = [n for n in range(16) if response_pulses(n) == train]
        assert nibbles and all(width == 1_500 for _, _, width in answer)
        return nibbles[0], answer[0][0]

    def call(self, name, index=0, data=0, extended=False):
        """-> answer nibble, None without answer."""
        answer = self.raw(encode_call(name, index, data, extended))
        return None if answer is None else answer[0]


def operating(line, index, par=0xF, **slave):
    """A slave that has had its WPAR. -> handle"""
    handle = line.net.add(index, **slave)
    line.net.advance(line.t)
    line.wait(READY)
    assert line.call("WPAR", index, par, extended=slave.get("id") == 0xA) is not None
    return handle


# ------------------------------------------------------------------------------------------ SL-001 .. SL-004
def test_reset_state():
    """SL-001: outputs and parameter F, asynchronous and data exchange blocked after power-up, until the first WPAR."""
    line = Line()
    s = line.net.add(5, io=7, inputs=0b0011)
    state = line.net.state(s)
    assert (state.outputs, state.parameter, state.dexg_disabled, state.synchronous) == (15, 15, True, False)
    assert line.call("DEXG", 5, 0b0101) is None
    assert line.net.state(s).outputs == 15
    assert line.call("WPAR", 5, 0b0110) == 0b0110
    assert line.call("DEXG", 5, 0b0101) == 0b0011
    state = line.net.state(s)
    assert (state.outputs, state.parameter, state.dexg_disabled, state.synchronous) == (0b0101, 0b0110, False, True)


def test_power_up_time():
    """SL-001: a slave is silent for 10 ms after power-up and answers then; connecting it later does the same."""
    line = Line(start=10 * MS - 1)
    line.net.add(5, io=7)
    assert line.call("RDIO", 5) is None
    assert line.call("RDIO", 5) == 7
    late = line.net.add(6, io=3, present=False)
    line.wait(READY)
    assert line.call("RDIO", 6) is None
    line.net.advance(line.t)
    line.net.set_present(late, True)
    line.wait(10 * MS - 1)
    assert line.call("RDIO", 6) is None
    assert line.call("RDIO", 6) == 3


def test_first_listened_request_may_begin_when_ready():
    """SL-001: a request that begins exactly when the power-up time ends is heard."""
    line = Line(start=10 * MS)
    line.net.add(5, io=7)
    assert line.call("RDIO", 5) == 7


def test_answer_times():
    """SL-002: 33.5 us when asynchronous, 21.5 us when synchronous, from the last request pulse to the first pulse."""
    line = Line()
    line.net.add(5, io=7)
    call = encode_call("RDIO", 5)
    assert line.raw(call) == (7, 33_500)
    assert line.raw(call) == (7, 21_500)


def test_answer_time_counts_from_the_real_last_pulse():
    """SL-002: a legal shift of the end pulse moves the answer with it."""
    line = Line()
    line.net.add(5, io=7)
    train = request_pulses(encode_call("RDIO", 5))
    for shift in (-875, 1_500):
        answer = line.send([*train[:-1], (train[-1][0] + shift, 1)])
        assert answer[0][0] in (33_500, 21_500)


def broken_requests():
    good = request_pulses(encode_call("RDIO", 5))
    word = request_word(encode_call("RDIO", 5))
    return {
        "start": [(t, -p) for t, p in good],
        "alternation": [*good[:3], (good[3][0], -good[3][1]), *good[4:]],
        "timing early": [*good[:4], (good[4][0] - 876, good[4][1]), *good[5:]],
        "timing late": [*good[:4], (good[4][0] + 1_501, good[4][1]), *good[5:]],
        "timing, boundary pulse": [(t + 1_501 * (t == 15_000), p) for t, p in good],
        "two in one window": sorted([*good, *((15_000 + d, p * dict(good)[15_000])
                                              for d, p in ((700, -1), (1_400, 1)))]),
        "no information": [p for p in good if p[0] not in (36_000, 33_000, 39_000)],
        "parity": pulses(word ^ 2, 14),
        "end bit": pulses(word ^ 1, 14),
        "length": [*good, (81_000, -1)],
        "length, last moment": [*good, (85_500, -1)],
        "cut off": good[:7],
        "one pulse": good[:1],
    }


@pytest.mark.parametrize("kind", broken_requests())
def test_bad_request(kind):
    """SL-003: a bad request is not answered and makes the slave asynchronous; one good request makes it synchronous."""
    line = Line()
    s = line.net.add(5, io=7)
    good = encode_call("RDIO", 5)
    line.raw(good)
    assert line.net.state(s).synchronous
    assert line.send(broken_requests()[kind]) == []
    assert not line.net.state(s).synchronous
    assert line.raw(good) == (7, 33_500)
    assert line.raw(good) == (7, 21_500)


def test_windows_of_a_request():
    """SL-003: every pulse of a request may start 0.875 us early or 1.5 us late."""
    line = Line()
    line.net.add(5, io=7)
    train = request_pulses(encode_call("RDIO", 5))
    for i in range(1, len(train)):
        for shift in (-875, 1_500):
            moved = [(t + (shift if i == k else 0), p) for k, (t, p) in enumerate(train)]
            assert line.send(moved), f"pulse {i} moved by {shift}"


def test_quiet_time_after_a_request():
    """SL-002, SL-003: 90 us after the first pulse (6 < 12 < 18 us quiet) a synchronous slave has taken the request, an
    asynchronous one sees a length error."""
    line = Line()
    train = request_pulses(encode_call("RDIO", 5))
    line.net.add(5, io=7)
    line.call("RDIO", 5)
    assert line.send([*train, (90_000, -1)])
    assert line.send([*train, (90_000, -1)]) == []  # the lone pulse was a bad request


def test_pause_after_a_bad_request():
    """SL-003: after a bad request more than 18 us of quiet are needed before the next one is heard."""
    for gap, answered in ((18_000, False), (18_001, True)):
        line = Line()
        line.net.add(5, io=7)
        bad = request_pulses(encode_call("RDIO", 5))[:3]
        good = request_pulses(encode_call("RDIO", 5))
        begin = bad[-1][0] + gap
        assert bool(line.send([*bad, *((t + begin, p) for t, p in good)])) is answered


def test_request_for_another_address():
    """SL-004: a good request for another address keeps a slave synchronous or makes it so."""
    line = Line()
    line.net.add(5, io=7)
    assert line.call("RDIO", 9) is None
    assert line.raw(encode_call("RDIO", 5)) == (7, 21_500)
    assert line.call("DEXG", 9, 3) is None
    assert line.raw(encode_call("RDIO", 5)) == (7, 21_500)


# ------------------------------------------------------------------------------------------ SL-005
@pytest.mark.parametrize("index", [5, 31, 37, 63])
def test_read_calls(index):
    """SL-005, CA-003, CA-004: RDIO, RDID, RID1, RID2, RDST of A and B slaves; the other half hears nothing."""
    line = Line()
    line.net.add(index, io=0xB, **AB)
    sel = index >> 5
    for name, answer in (("RDIO", 0xB), ("RDID", 0xA), ("RID1", 7 | sel << 3), ("RID2", 0xE), ("RDST", 0)):
        assert line.call(name, index) == answer
        assert line.call(name, index ^ 32) is None


def test_standard_slave_reads():
    """SL-005, CA-004: a standard slave answers the words with Sel = 0 only."""
    line = Line()
    line.net.add(9, io=1, id=2, id1=3, id2=4)
    for name, answer in (("RDIO", 1), ("RDID", 2), ("RID1", 3), ("RID2", 4), ("RDST", 0)):
        assert line.call(name, 9) == answer
        assert line.call(name, 9 + 32) is None


def test_calls_without_an_answer():
    """SL-005: PRGM, R1 and every reserved code are heard but not answered."""
    line = Line()
    line.net.add(9, io=1, id=2)
    line.net.add(0, io=1, id=2)
    known = {encode_call(name, 9) for name in ("RDIO", "RDID", "RID1", "RID2", "RDST", "RES", "DELA")}
    silent = [c for c in range(1 << 10 | 9 << 5, (1 << 10 | 9 << 5) + 32) if c not in known]
    assert len(silent) == 25
    for call in [*silent, encode_call("PRGM")]:
        assert line.raw(call) is None, f"{call:011b}"


def test_reset_slave():
    """SL-005, SL-001: RES answers 6, then the slave is silent for 1 ms, in reset state, asynchronous."""
    line = Line()
    s = operating(line, 5, io=7, par=3)
    line.call("DEXG", 5, 2)
    start = line.t
    assert line.call("RES", 5) == 6
    assert line.net.state(s).dexg_disabled and line.net.state(s).outputs == 15
    last = start + 78 * US
    line.t = last + 1 * MS - 1
    assert line.call("RDIO", 5) is None
    assert line.raw(encode_call("RDIO", 5)) == (7, 33_500)
    assert line.call("DEXG", 5, 2) is None


def test_reset_ends_after_1_ms():
    """SL-005: the first request a slave can hear after RES begins 1 ms after the last pulse of RES."""
    line = Line()
    operating(line, 5, io=7)
    start = line.t
    line.call("RES", 5)
    line.t = start + 78 * US + 1 * MS
    assert line.call("RDIO", 5) == 7


def test_broadcast_reset():
    """SL-005: BR01 resets every slave, address 31 and 0 and B slaves included, without any answer."""
    line = Line()
    slaves = [operating(line, index, io=7, **AB) for index in (5, 37, 31, 63)]
    zero = line.net.add(0, io=7)
    line.net.advance(line.t)
    line.wait(READY)
    assert line.call("RDIO", 0) == 7
    assert not any(line.net.state(s).dexg_disabled for s in slaves)
    assert line.call("BR01") is None
    for s in (*slaves, zero):
        assert line.net.state(s).dexg_disabled and not line.net.state(s).synchronous


def test_delete_address():
    """SL-005: DELA answers 0, the slave is at address 0 at once; power brings the old address back."""
    line = Line()
    s = line.net.add(5, io=7)
    line.call("RDIO", 5)
    assert line.call("DELA", 5) == 0
    assert line.net.state(s).address == 0
    assert (line.call("RDIO", 5), line.call("RDIO", 0), line.call("RDST", 0)) == (None, 7, 0)
    line.net.power(False)
    line.net.power(True)
    line.wait(READY)
    assert (line.call("RDIO", 5), line.call("RDIO", 0)) == (7, None)


def test_assign_address():
    """SL-005: ADRA answers 6, the address is there at once, S0 = 1 for 15 ms, and power does not take it back."""
    line = Line()
    s = line.net.add(0, io=7)
    line.call("RDIO", 0)
    accepted = line.t + (78 + 7.5) * US
    assert line.call("ADRA", data=12) == 6
    assert line.net.state(s).address == 12
    assert (line.call("RDIO", 0), line.call("RDIO", 12), line.call("RDST", 12)) == (None, 7, 1)
    line.t = int(accepted) + 15 * MS - 86 * US
    assert line.call("RDST", 12) == 1
    assert line.call("RDST", 12) == 0
    line.net.power(False)
    line.net.power(True)
    line.wait(READY)
    assert line.call("RDIO", 12) == 7


def test_assign_address_needs_address_0():
    """SL-005: a slave with an address does not hear ADRA."""
    line = Line()
    s = line.net.add(5, io=7)
    assert line.call("ADRA", data=12) is None
    assert line.net.state(s).address == 5


def test_power_fail_while_writing():
    """SL-005: power fail during the non-volatile write: address 0, IO and ID read F, S3; a new ADRA repairs it."""
    line = Line()
    line.net.add(0, io=7, id=1)
    line.call("ADRA", data=12)
    line.net.power(False)
    line.net.power(True)
    line.wait(READY)
    assert [line.call(name, 0) for name in ("RDIO", "RDID", "RDST")] == [15, 15, 8]
    assert line.call("ADRA", data=12) == 6
    line.wait(15 * MS)
    assert [line.call(name, 12) for name in ("RDIO", "RDID", "RDST")] == [7, 1, 0]


def test_write_id1():
    """SL-005: WID1 at address 0 answers 0 and stores ID1; for an A/B slave bit 3 is Sel, also of its next address."""
    line = Line()
    s = line.net.add(5, io=7, sel_at_zero=True, **AB)
    assert line.call("WID1", data=0xF) is None
    line.call("DELA", 5)
    assert line.call("WID1", data=0xF) == 0
    assert line.call("RDST", 32) == 1  # Sel = 1 now
    line.wait(15 * MS)
    assert (line.call("RDST", 32), line.call("RID1", 32), line.call("RID1", 0)) == (0, 0xF, None)
    assert line.call("ADRA", data=9) == 6
    assert line.net.state(s).address == 9 + 32
    assert line.call("RDIO", 9 + 32) == 7


def test_select_at_address_0():
    """SL-010, CA-004: at address 0 an A/B slave obeys Sel = 0, or as an option its own Sel; ADRA and WID1 have none."""
    for own, id1, sel in ((False, 7, 0), (False, 0xF, 0), (True, 7, 0), (True, 0xF, 1)):
        line = Line()
        s = line.net.add(0, io=7, id=0xA, id1=id1, id2=0xE, sel_at_zero=own)
        for name, answer in (("RDIO", 7), ("RDID", 0xA), ("RID1", id1), ("RID2", 0xE), ("RDST", 0)):
            assert line.call(name, 32 * sel) == answer
            assert line.call(name, 32 - 32 * sel) is None
        assert line.call("ADRA", data=4) == 6
        assert line.net.state(s).address == (36 if id1 == 0xF else 4)
    with pytest.raises(NativeError):
        line.net.set_options(s, write_ns=-1)


@pytest.mark.parametrize("own", [False, True])
def test_change_of_an_ab_address(own):
    """SL-010, SL-005: 5B becomes 9A in the order of an address change, whichever Sel the slave obeys at address 0."""
    line = Line()
    s = line.net.add(37, io=7, id=0xA, id2=0xE, sel_at_zero=own, write_ns=40 * MS)
    at_zero = 32 if own else 0
    assert line.call("DELA", 37) == 0
    assert line.call("RID1", at_zero) == 0xF
    assert line.call("WID1", data=7) == 0
    assert line.call("RID1", 32) is None and line.call("RDST", 0) == 1
    line.wait(39 * MS)
    assert line.call("RDST", 0) == 1
    line.wait(1 * MS)
    assert (line.call("RDST", 0), line.call("RID1", 0)) == (0, 7)
    assert line.call("ADRA", data=9) == 6
    assert line.call("RDST", 9) == 1
    line.wait(40 * MS)
    assert (line.call("RDST", 9), line.call("RID1", 9), line.call("RDIO", 9 + 32)) == (0, 7, None)
    assert line.net.state(s).address == 9


def test_write_time():
    """SL-010: S0 is 1 exactly as long as the write takes that the slave was given."""
    for write_ns in (0, 1 * MS, 500 * MS):
        line = Line()
        line.net.add(0, io=7, write_ns=write_ns)
        line.call("RDIO", 0)
        accepted = line.t + (78 + 7.5) * US
        assert line.call("ADRA", data=12) == 6
        if write_ns:
            line.t = int(accepted) + write_ns - 86 * US
            assert line.call("RDST", 12) == 1
        assert line.call("RDST", 12) == 0


def test_write_that_fails():
    """SL-010: the write ends with S3 = 1; the new address works until power fails, then the old one is back; a good
    write clears S3."""
    line = Line()
    s = line.net.add(5, io=7, id=1, id1=3, write_fails=True)
    line.call("DELA", 5)
    assert line.call("WID1", data=6) == 0
    assert (line.call("RDST", 0), line.call("RID1", 0)) == (1, 6)
    line.wait(15 * MS)
    assert line.call("RDST", 0) == 8
    assert line.call("ADRA", data=12) == 6
    assert line.call("RDST", 12) == 9
    line.wait(15 * MS)
    assert [line.call(name, 12) for name in ("RDST", "RDIO", "RDID", "RID1")] == [8, 7, 1, 6]
    line.net.power(False)
    line.net.power(True)
    line.wait(READY)
    assert [line.call(name, 5) for name in ("RDST", "RDIO", "RDID", "RID1")] == [8, 7, 1, 3]
    line.net.set_options(s)
    line.call("DELA", 5)
    line.call("ADRA", data=12)
    line.wait(15 * MS)
    assert line.call("RDST", 12) == 0


def test_protected_id1():
    """SL-010: WID1 that changes the low three bits is neither answered nor done, one that changes Sel is."""
    line = Line()
    line.net.add(0, io=7, id1_locked=True, **AB)
    assert line.call("WID1", data=6) is None
    assert (line.call("RDST", 0), line.call("RID1", 0)) == (0, 7)
    assert line.call("WID1", data=0xF) == 0
    assert (line.call("RDST", 0), line.call("RID1", 0)) == (1, 0xF)


def test_slave_without_extended_codes():
    """SL-010: a slave older than 2.1 answers everything but RID1 and RID2."""
    line = Line()
    line.net.add(5, io=7, id=1, old=True)
    assert [line.call(name, 5) for name in ("RDIO", "RDID", "RID1", "RID2", "RDST", "WPAR")] == [7, 1, None, None, 0, 0]


def test_write_id1_is_not_an_address():
    """SL-005: WID1 stores ID1 only: a deleted address comes back with power, with the new Sel."""
    line = Line()
    s = line.net.add(5, io=7, **AB)
    line.call("DELA", 5)
    line.call("WID1", data=0xF)
    line.wait(15 * MS)
    line.net.advance(line.t)
    line.net.power(False)
    line.net.power(True)
    assert line.net.state(s).address == 5 + 32


def test_ab_data_exchange():
    """SL-005, CA-001, CA-002: I3 selects A or B; three output and parameter bits; D3 is an input; others are deaf."""
    line = Line()
    a = operating(line, 5, io=8, inputs=0b1000, **AB)
    b = operating(line, 37, io=0, inputs=0b0111, **AB)
    assert line.call("DEXG", 5, 0b101, extended=True) == 0b1101  # outputs echo, D3 does not
    assert line.call("DEXG", 37, 0b010, extended=True) == 0b0111
    assert (line.net.state(a).outputs, line.net.state(b).outputs) == (0b1101, 0b1010)
    assert line.call("WPAR", 5, 0b011, extended=True) == 0b1011
    assert (line.net.state(a).parameter, line.net.state(b).parameter) == (0b1011, 0b1111)


# io code -> which of D3..D0 echo the output (the table of IO codes prints D0 first)
ECHO = {0: "IIII", 1: "IIIO", 2: "IIIB", 3: "IIOO", 4: "IIBB", 5: "IOOO", 6: "IBBB", 7: "BBBB", 8: "OOOO", 9: "OOOI",
        0xA: "OOOB", 0xB: "OOII", 0xC: "OOBB", 0xD: "OIII", 0xE: "OBBB", 0xF: "TTTT"}


@pytest.mark.parametrize("io", range(16))
def test_data_exchange_by_io_code(io):
    """SL-005: output-only bits of the answer echo the output, all others show the inputs."""
    line = Line()
    outputs, inputs = 0b0101, 0b0011
    operating(line, 5, io=io, inputs=inputs)
    expected = sum((outputs if kind == "O" else inputs) & 1 << bit for bit, kind in enumerate(ECHO[io]))
    assert line.call("DEXG", 5, outputs) == expected


def test_periphery_fault_and_inputs():
    """SL-005: RDST shows a peripheral fault in S1; inputs may change at any time."""
    line = Line()
    s = operating(line, 5, io=0, inputs=1)
    line.net.set_periphery_fault(s, True)
    line.net.set_inputs(s, 0xA)
    assert (line.call("RDST", 5), line.call("DEXG", 5, 15)) == (2, 0xA)


def test_counts():
    """SL-005: requests and answers are counted per slave, calls for others are not."""
    line = Line()
    s = operating(line, 5, io=0)
    for index in (5, 6, 5):
        line.call("DEXG", index, 1)
    line.net.set_faults(s, p_no_answer=CERTAIN)
    assert line.call("DEXG", 5, 1) is None
    assert line.net.state(s)[-2:] == (4, 3)


# ------------------------------------------------------------------------------------------ SL-006
@pytest.mark.parametrize("name", ["DEXG", "WPAR"])
def test_watchdog(name):
    """SL-006: reset 94.2 ms after the last DEXG or WPAR was taken, not before; 1 ms silent, then blocked."""
    line = Line()
    s = operating(line, 5, io=7, watchdog=True)
    taken = line.t + 78 * US + 7_501  # the slave's decision
    line.call(name, 5, 3)
    line.net.advance(taken + 94_200 * US - 1)
    assert not line.net.state(s).dexg_disabled
    line.net.advance(taken + 94_200 * US)
    assert line.net.state(s).dexg_disabled
    line.t = taken + 95_200 * US - 1
    assert line.call("RDIO", 5) is None
    assert line.raw(encode_call("RDIO", 5)) == (7, 33_500)
    assert line.call("DEXG", 5, 3) is None


def test_watchdog_only_when_enabled():
    """SL-006: without the watchdog nothing happens, and other calls do not feed one that is enabled."""
    line = Line()
    free, guarded = operating(line, 5, io=7), operating(line, 6, io=7, watchdog=True)
    for _ in range(10):
        line.wait(10 * MS)
        line.call("RDIO", 6)
    assert not line.net.state(free).dexg_disabled
    assert line.net.state(guarded).dexg_disabled


def test_watchdog_not_at_address_0():
    """SL-006: a slave at address 0 is not reset by the watchdog."""
    line = Line()
    s = operating(line, 5, io=7, watchdog=True)
    line.call("DELA", 5)
    line.wait(200 * MS)
    assert line.call("RDIO", 0) == 7
    assert not line.net.state(s).dexg_disabled


def test_watchdog_starts_with_the_address():
    """SL-006: time at address 0 does not count: 94.2 ms from the address assignment on."""
    line = Line()
    s = operating(line, 5, io=7, watchdog=True)
    line.call("DELA", 5)
    line.wait(90 * MS)
    line.call("ADRA", data=9)
    assigned = line.t
    line.net.advance(assigned + 93 * MS)
    assert not line.net.state(s).dexg_disabled
    line.net.advance(assigned + 95 * MS)
    assert line.net.state(s).dexg_disabled


def test_watchdog_without_a_master():
    """SL-006: a slave that nobody serves is reset 94.2 ms after each of its starts, and silent for 1 ms each time."""
    for number in (1, 2, 7):
        line = Line(start=0)
        line.net.add(5, io=7, watchdog=True)
        ready = 10 * MS + number * 95_200 * US
        line.t = ready - 500 * US
        assert line.call("RDIO", 5) is None
        line.t = ready - 1
        assert line.call("RDIO", 5) is None
        assert line.raw(encode_call("RDIO", 5)) == (7, 33_500)
        line.t = ready + 94_200 * US - 100 * US  # taken 14 us before the next reset
        assert line.raw(encode_call("RDIO", 5)) == (7, 21_500)
        assert line.call("RDIO", 5) is None


# ------------------------------------------------------------------------------------------ SL-008
def test_two_slaves_on_one_address():
    """SL-008: both answer; equal pulses merge, opposite ones both appear, and the monitor sees a bad answer."""
    line = Line()
    line.net.add(5, io=7)
    line.net.add(5, io=7)
    assert line.raw(encode_call("RDIO", 5)) == (7, 33_500)
    line = Line()
    line.net.add(5, io=0)
    line.net.add(5, io=15)
    answer = line.send(request_pulses(encode_call("RDIO", 5)))
    base = answer[0][0]
    assert {(t - base, p) for t, p, _ in answer} == set(response_pulses(0)) | set(response_pulses(15))
    assert line.net.log()[-1].error_class in (ErrorClass.ALTERNATION, ErrorClass.TIMING)


def test_overlapping_pulses_merge():
    """SL-008: two answers half a microsecond apart look like one with longer pulses."""
    line = Line()
    line.net.add(5, io=7)
    late = line.net.add(5, io=7)
    line.net.set_faults(late, delay_ns=500)
    answer = line.send(request_pulses(encode_call("RDIO", 5)))
    assert [(t - 33_500, p) for t, p, _ in answer] == response_pulses(7)
    assert {w for _, _, w in answer} == {2_000}


@pytest.mark.parametrize("fault, classes", [
    (dict(p_no_answer=CERTAIN), {ErrorClass.NO_RESPONSE}),
    (dict(p_parity=CERTAIN), {ErrorClass.PARITY}),
    (dict(p_missing_pulse=CERTAIN), {ErrorClass.START, ErrorClass.ALTERNATION, ErrorClass.NO_INFORMATION}),
    (dict(p_shifted_pulse=CERTAIN, shift_ns=2_000), {ErrorClass.TIMING}),
    # 2 us early is 1 us late in the window before: a second pulse there, or this bit's pulse is missing
    (dict(p_shifted_pulse=CERTAIN, shift_ns=-2_000), {ErrorClass.TIMING, ErrorClass.NO_INFORMATION}),
    (dict(p_shifted_pulse=CERTAIN, shift_ns=500), {ErrorClass.OK}),
    (dict(p_shifted_pulse=CERTAIN, shift_ns=-500), {ErrorClass.OK}),
    (dict(p_extra_pulse=CERTAIN), {ErrorClass.LENGTH}),
    (dict(delay_ns=44_500), {ErrorClass.OK}),
    (dict(delay_ns=44_501), {ErrorClass.NO_RESPONSE}),
    (dict(delay_ns=-9_500), {ErrorClass.OK}),
    (dict(delay_ns=-9_501), {ErrorClass.EARLY}),
])
def test_faults(fault, classes):
    """SL-008, RX-011: each fault, when certain, gives its error class in the monitor, and no other."""
    line = Line()
    s = line.net.add(5, io=9)
    line.call("RDIO", 5)
    line.net.log()
    line.net.set_faults(s, **fault)
    for _ in range(40):
        line.send(request_pulses(encode_call("RDIO", 5)))
    log = line.net.log()
    assert len(log) == 40 and {t.error_class for t in log} <= classes
    if fault.get("p_missing_pulse"):
        assert len({t.error_class for t in log}) > 1  # every pulse gets its turn
    line.net.set_faults(s)
    line.wait(MS)
    assert line.call("RDIO", 5) == 9


def noisy(seed, streams=1):
    line = Line(seed)
    for i in range(streams):
        s = line.net.add(5 + i, io=7)
        line.net.set_faults(s, p_no_answer=6_000, p_parity=6_000, p_missing_pulse=6_000, p_extra_pulse=6_000)
    for n in range(100 * streams):
        line.send(request_pulses(encode_call("RDIO", 5 + n % streams)))
    return [[(t.error_class, t.data, t.delay_ns) for t in line.net.log() if t.call >> 5 & 31 == 5 + i]
            for i in range(streams)]


def test_faults_are_reproducible():
    """SL-008: one seed, one history; another seed, another one; a slave's stream does not depend on the others."""
    first = noisy(1)[0]
    assert first == noisy(1)[0] != noisy(2)[0]
    assert 10 < sum(c != ErrorClass.OK for c, *_ in first) < 60  # about 32 of 100
    two = noisy(1, streams=2)
    assert two[0] == first != two[1]


def test_presence_and_power():
    """SL-008, SL-001: a slave that is not there or has no power does not answer and comes back through power-up."""
    line = Line()
    s = operating(line, 5, io=7, par=3)
    line.net.set_present(s, False)
    assert line.call("RDIO", 5) is None and not line.net.state(s).present
    line.net.advance(line.t)
    line.net.set_present(s, True)
    line.wait(READY)
    assert line.call("RDIO", 5) == 7
    assert line.net.state(s).parameter == 15
    line.net.power(False)
    assert line.call("RDIO", 5) is None
    line.net.power(True)
    assert line.call("RDIO", 5) is None
    line.wait(READY)
    assert line.call("RDIO", 5) == 7


def test_refused_arguments():
    """SL-005: what cannot be is refused and changes nothing: addresses, handles, time going back."""
    net = Net()
    for bad in (dict(address=32, id=10), dict(address=64), dict(address=33, id=7)):
        with pytest.raises(NativeError):
            net.add(**bad)
    assert net.add(31) == 0
    for bad in (lambda: net.state(1), lambda: net.set_inputs(0, 16), lambda: net.set_faults(-1)):
        with pytest.raises(NativeError):
            bad()
    net.advance(1_000)
    for bad in (lambda: net.advance(999), lambda: net.master_pulse(999, -1), lambda: net.master_pulse(1_000, 0)):
        with pytest.raises(NativeError):
            bad()


# ------------------------------------------------------------------------------------------ worked examples, monitor
EXAMPLES = [  # the worked examples E1 to E11: call, printed request word, printed grid (one character per 3 us)
    (encode_call("DEXG", 5, 0b1010), 0x02A9, "-+-+-+-.+.-.+.-.+.-.+.-+-.+"),
    (encode_call("DEXG", 5, 0b0101), 0x0295, "-+-+-+-.+.-.+.-+-.+.-.+.-.+"),
    (encode_call("WPAR", 12, 0b0110), 0x065B, "-+-+-.+-+.-+-.+.-.+-+.-.+-+"),
    (encode_call("BR01"), 0x1FD7, "-.+-+-+-+-+-+-+.-.+.-.+-+-+"),
    (encode_call("DEXG", 5, 0b101, extended=True), 0x02B7, "-+-+-+-.+.-.+.-.+-+.-.+-+-+"),
    (encode_call("DEXG", 37, 0b101, extended=True), 0x0295, "-+-+-+-.+.-.+.-+-.+.-.+.-.+"),
    (encode_call("DELA", 37), 0x12A1, None), (encode_call("RES", 37), 0x12D3, None),
    (encode_call("RDIO", 5), 0x12C1, None), (encode_call("RDST", 37), 0x12D9, None),
    (encode_call("WID1", data=7), 0x101D, None), (encode_call("ADRA", data=7), 0x001F, None),
]


@pytest.mark.parametrize("call, word, grid", EXAMPLES)
def test_worked_requests(call, word, grid):
    """TL-001, TL-003, TL-006: listener and monitor read the printed pulse trains as the printed words."""
    assert request_word(call) == word
    train = request_pulses(call)
    if grid:
        train = [(3_000 * i, {"-": -1, "+": 1}[c]) for i, c in enumerate(grid) if c != "."]
    line = Line()
    slaves = {i: line.net.add(i, io=7, **(AB if i in (37,) else {})) for i in (0, 5, 12, 37)}
    line.send(request_pulses(encode_call("RDIO", 1)))
    line.net.log()
    line.send(train)
    (record,) = line.net.log()
    assert (record.call, record.request_ok) == (call, 1)
    assert all(line.net.state(s).synchronous or word in (0x1FD7, 0x12D3) for s in slaves.values())


@pytest.mark.parametrize("nibble, grid", [(0b0011, "-+-+-.+-+.-.+"), (0b0110, "-+-.+-+.-+-.+"), (0, "-+-+-+-+-+-.+"),
                                          (15, "-.+-+-+-+.-.+")])
def test_worked_answers(nibble, grid):
    """TL-002, TL-006: E3, E4, E5 as a slave sends them."""
    line = Line()
    line.net.add(5, io=nibble)
    answer = line.send(request_pulses(encode_call("RDIO", 5)))
    expected = [(3_000 * i, {"-": -1, "+": 1}[c]) for i, c in enumerate(grid) if c != "."]
    assert [(t - 33_500, p) for t, p, _ in answer] == expected


E3 = response_pulses(0b0011)
FLIPPED = [(0, -1), (3, 1), (6, -1), (9, 1), (12, -1), (18, 1), (21, -1), (24, 1), (27, -1), (30, 1), (33, -1), (36, 1)]


def without(*times):
    return [p for p in E3 if p[0] not in times]


def shifted(time, to):
    return [(to if t == time else t, p) for t, p in E3]


@pytest.mark.parametrize("answer, expected", [
    (E3, ErrorClass.OK),
    (without(24_000), ErrorClass.ALTERNATION),  # no information as well; alternation is reported first
    (shifted(21_000, 19_800), ErrorClass.TIMING),
    (without(21_000, 24_000), ErrorClass.NO_INFORMATION),
    ([(1_000 * t, p) for t, p in FLIPPED], ErrorClass.PARITY),
    ([*E3, (39_000, -1)], ErrorClass.LENGTH),
    ([*E3, (39_000, 1)], ErrorClass.LENGTH),
    ([*E3, (43_500, -1)], ErrorClass.LENGTH),
    ([*E3, (43_501, -1)], ErrorClass.OK),
    ([(t, -p) for t, p in E3], ErrorClass.START),
    (E3[:-1], ErrorClass.NO_INFORMATION),
    ([*E3[:-2], (33_000, 1), (36_000, -1)], ErrorClass.ALTERNATION),
    ([*E3[:-2], (36_000, -1)], ErrorClass.NO_INFORMATION),
    ([(t, p) for t, p in E3[:-1]] + [(33_000, 1), (36_000, -1)], ErrorClass.END_BIT),
    (shifted(36_000, 35_125), ErrorClass.OK),
    (shifted(36_000, 35_124), ErrorClass.TIMING),
    (shifted(36_000, 37_500), ErrorClass.OK),
    (shifted(36_000, 37_501), ErrorClass.TIMING),
    (shifted(3_000, 4_501), ErrorClass.TIMING),
    ([*E3[:-1], (38_500, 1)], ErrorClass.TIMING),  # too late for an end pulse
    ([*E3, (9_000, -1)], ErrorClass.TIMING),  # two senders at once
    ([(0, 1)], ErrorClass.START),
    ([(0, -1)], ErrorClass.NO_INFORMATION),
])
def test_monitor_classes(answer, expected):
    """RX-001..RX-008, RX-010, RX-011: the monitor's classes for answers built pulse by pulse, E12 among them."""
    line = Line()
    begin = line.t + 78_000 + 21_500
    for t, polarity in answer:
        line.net.inject(begin + t, polarity)
    line.send(request_pulses(encode_call("RDIO", 5)))
    (record,) = line.net.log()
    assert (record.error_class, record.delay_ns, record.request_ok) == (expected, 21_500, 1)
    assert record.data == (0b0011 if expected == ErrorClass.OK else 0)


@pytest.mark.parametrize("delay, expected", [(11_999, ErrorClass.EARLY), (12_000, ErrorClass.OK),
                                             (66_000, ErrorClass.OK), (66_001, ErrorClass.NO_RESPONSE),
                                             (70_000, ErrorClass.NO_RESPONSE)])
def test_monitor_response_window(delay, expected):
    """LT-002, LT-003, RX-011, RX-013: answers from 12 to 66 us after the last request pulse count."""
    line = Line()
    for t, polarity in E3:
        line.net.inject(line.t + 78_000 + delay + t, polarity)
    line.send(request_pulses(encode_call("RDIO", 5)))
    (record,) = line.net.log()
    assert record.error_class == expected
    assert record.delay_ns == (-1 if expected == ErrorClass.NO_RESPONSE else delay)


def test_monitor_requests():
    """RX-011: a bad request is marked, a broadcast needs no answer, times and repetitions are recorded."""
    line = Line()
    t0 = line.t
    for pulses in (request_pulses(encode_call("RDIO", 5)), request_pulses(encode_call("RDIO", 5))[:-1],
                   request_pulses(encode_call("BR01"))):
        line.send(pulses)
    bad, cut, broadcast = line.net.log()
    assert (bad.t_ns, bad.request_ok, bad.error_class) == (t0, 1, ErrorClass.NO_RESPONSE)
    assert (cut.t_ns, cut.request_ok) == (t0 + 228_000, 0)
    assert (broadcast.request_ok, broadcast.error_class, broadcast.call) == (1, ErrorClass.OK, encode_call("BR01"))


def test_monitor_repetitions():
    """LT-012: the same call within 220 us of a failed one is a repetition; after a good one or later it is not."""
    line = Line()
    train = request_pulses(encode_call("RDIO", 5))
    starts = [READY + t * US for t in (0, 150, 300, 520, 741, 891)]
    for start in starts:
        for t, polarity in train:
            line.net.master_pulse(start + t, polarity)
    line.net.advance(READY + 2 * MS)
    assert [t.repeated for t in line.net.log()] == [0, 1, 1, 1, 0, 1]
    line = Line()
    line.net.add(5, io=7)
    for _ in range(2):
        for t, polarity in train:
            line.net.master_pulse(line.t + t, polarity)
        line.t += 158 * US
    line.net.advance(line.t)
    first, second = line.net.log()
    assert (first.error_class, second.error_class, second.repeated) == (ErrorClass.OK, ErrorClass.OK, 0)
