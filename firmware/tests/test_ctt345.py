# SPDX-License-Identifier: Apache-2.0
"""Which engine a slave gets; combined transactions types 3, 4 and 5; safety slaves."""
import pytest
from ctt_line import ANSWER_LOST, LATE, OK, OUTCOMES, REQUEST_LOST, Ctt4, Line, Mux4, Mux8, choose
from hypothesis import given, settings
from hypothesis import strategies as st
from native_ctt import load

NONE, IN, OUT, TWO, X4, X8, FOUR, FIVE, SAFETY = range(9)
OV, TV = 0x10, 0x20
S7A7, S7AA, S7A8, S7A9 = 0x7FA7, 0xAFA7, 0x8FA7, 0x9FA7


def setup(*defines):
    env = load(*defines)
    env[1].fc_init()
    return env


def codes(io, id_, id2):
    return id2 << 12 | 0xF00 | id_ << 4 | io


def lists(ffi, *indices):
    words = [0, 0]
    for i in indices:
        words[i >> 5] |= 1 << (i & 31)
    return ffi.new("uint32_t[2]", words)


def members(words):
    return {i for i in range(64) if words[i >> 5] >> (i & 31) & 1}


# ---------------------------------------------------------------- kinds

def expected_kind(io, id_, id2):
    """the table of the profiles, written as a table"""
    if id_ == 0xB:
        return SAFETY
    exact = {(7, 5, 5): TWO, (7, 0xA, 5): TWO, (0xB, 0xA, 5): TWO, (7, 0xA, 7): X4, (7, 0xA, 0xA): X8,
             (7, 0xA, 8): FOUR, (7, 0xA, 9): FOUR, **{(6, 0, k): FIVE for k in (5, 6, 7, 0xA, 0xB, 0xC)}}
    if io == 7 and id_ in (1, 2, 3, 4) and (id_, id2) != (4, 0):
        return IN if id2 >= 8 else OUT
    return exact.get((io, id_, id2), NONE)


def test_kinds():
    """CT-001: all 65536 codes; ID1 never matters; S-7.4 with ID2 = 0 is plain."""
    lib = setup()[1]
    for word in range(65536):
        assert lib.fc_kind(word) == expected_kind(word & 15, word >> 4 & 15, word >> 12), hex(word)


def test_live_slaves():
    """CT-001, CT-040: which slaves are live; no engine for 0, 32, above 63, nor for a B index without ID code A."""
    ffi, lib = setup()
    for io, id_, id2, live in [(7, 3, 0xC, 1), (7, 4, 0, 0), (7, 5, 5, 1), (7, 0xA, 7, 1), (7, 0xA, 0xA, 1),
                               (7, 0xA, 8, 0), (6, 0, 0xA, 0), (0, 0xB, 0xF, 0), (0, 0, 0xF, 0)]:
        assert lib.fc_open(5, codes(io, id_, id2), 0) == live
        now = ffi.new("uint32_t[2]")
        lib.fc_live(now)
        assert members(now) == ({5} if live else set())
    for index in (0, 32, 64, 1000):
        assert lib.fc_open(index, codes(7, 3, 0xC), 0) == 0
        lib.fc_close(index)
    assert lib.fc_open(63, codes(7, 3, 0xE), 0) == 0
    assert lib.fc_open(63, S7AA, 0) == 1


def test_plain_and_other_kinds():
    """CT-001: a plain slave's nibbles pass; there is nothing to hold and no string."""
    lib = setup()[1]
    assert lib.fc_open(5, codes(0, 0, 0xF), 0) == 0
    assert lib.fc_first(5, 0b1010) == 0b0101
    assert lib.fc_call(5, 1, 0b0101, 3, 0b1100, 0) == 0b0011
    assert lib.fc_inputs(5, 9) == 9
    assert lib.fc_hold(5) == 1
    lib.fc_release(5, 0)
    assert lib.fc_string(5, 0, 0, 0) == -8
    lib.fc_open(5, S7A7, 0)
    assert lib.fc_hold(5) == 1 and lib.fc_string(5, 0, 0, 0) == -17


def test_memory():
    """CT-002: all slaves together stay below 6 KB."""
    assert setup()[1].fc_size() < 6 * 1024


# ---------------------------------------------------------------- type 3

@pytest.mark.parametrize("index, first, second", [(5, 0b1101, 0b1001), (37, 0b0101, 0b0001)])
def test_worked_four_outputs(index, first, second):
    """CT-030: W7, outputs 1010 of slaves 5A and 5B; they switch after the second call."""
    slave = Mux4()
    line = Line(setup(), index, S7A7, slave, outputs=0b1010)
    line.run(1)
    assert line.log[0][0] == first and slave.switched == []
    line.run(3)
    assert [sent for sent, _ in line.log] == [first, second] * 2 and slave.switched == [0b1010] * 2
    assert line.status == OV | TV
    assert [line.lib.fc_inputs(index, n) for n in range(16)] == list(range(16))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.sampled_from((OK,) * 3 + OUTCOMES), st.integers(0, 15)), max_size=60))
def test_four_outputs_on_a_bad_line(steps):
    """CT-030, CT-003: the slave only ever sets outputs that the host had at one moment, whatever is lost or late."""
    slave = Mux4()
    line = Line(setup(), 5, S7A7, slave, outputs=0)
    had = {0}
    for outcome, outputs in steps:
        line.outputs = outputs
        had.add(outputs)
        line.call(outcome)
        assert set(slave.switched) <= had
    line.outputs = 9
    line.run(4)
    assert slave.switched[-1] == 9


def test_worked_eight_bits():
    """CT-031: W8, outputs A5, inputs 3C of slave 5A."""
    slave = Mux8(feed=lambda: 0x3C)
    line = Line(setup(), 5, S7AA, slave)
    line.set_ao(0xA5)
    line.run(6)
    assert line.log == [(0b1111, 0b0000), (0b1110, 0b0111), (0b1010, 0b1011), (0b1101, 0b1100), (0b1001, 0b0000),
                        (0b1110, 0b0111)]
    assert line.ai[0] == 0x3C and line.status == OV | TV | 1 and slave.taken == [0xA5]
    assert line.lib.fc_inputs(5, 0b0111) == 0xC


def test_eight_bits_rate_and_time_out():
    """CT-031, CT-005: 4 calls for all bits each way; 1000 ms without a whole round: transfer invalid; closed: 0."""
    count = [0]
    slave = Mux8(feed=lambda: count.__setitem__(0, count[0] + 1) or count[0])
    line = Line(setup(), 37, S7AA, slave).run(401)
    assert len(slave.taken) == 100 and line.ai[0] == 100
    line.run(198, REQUEST_LOST)
    assert line.status == OV | TV | 1
    line.run(1, REQUEST_LOST)
    assert line.status == 0 and line.ai[0] == 0
    line.run(8)
    assert line.status == OV | TV | 1 and line.ai[0] == count[0] - 1
    line.lib.fc_close(37)
    assert line.status == 0 and line.ai[0] == 0


def test_eight_bits_out_of_order():
    """CT-031: a slave that leaves a selector out: the byte is not shown."""
    slave = Mux8(feed=lambda: 0xFF)
    line = Line(setup(), 5, S7AA, slave)
    answers = iter([0b0000, 0b0101, 0b1101, 0b0010, 0b0110, 0b1010, 0b1110])
    slave.call = lambda nibble: next(answers)
    line.run(3)
    assert line.status == 0
    line.run(4)
    assert line.ai[0] == 0b10101010 and line.status & 1


def test_eight_bits_first_nibble_twice():
    """CT-031, CT-003: the very first nibble confirms selector 0; sent again by a late firmware it tears no byte."""
    slave = Mux8()
    line = Line(setup(), 5, S7AA, slave)
    line.set_ao(0xFF)
    line.call().call(LATE).run(8)
    assert slave.taken == [0, 0xFF]


@pytest.mark.parametrize("define", ["ASI_CTT3_AA_OFFSET=1", "ASI_CTT3_AA_INVERTED=0", "ASI_CTT3_INVERT_OUT=0"])
def test_eight_bits_alternatives(monkeypatch, define):
    """CT-031: the other choices of the table compile and work."""
    choose(monkeypatch, define)
    slave = Mux8(feed=lambda: 0x3C)
    line = Line(setup(define), 5, S7AA, slave)
    line.set_ao(0xA5)
    line.run(12)
    assert line.ai[0] == 0x3C and slave.taken[-1] == 0xA5


@settings(max_examples=60, deadline=None)
@given(st.lists(st.sampled_from((OK,) * 3 + OUTCOMES), max_size=80))
def test_eight_bits_on_a_bad_line(outcomes):
    """CT-031, CT-002, CT-003: bytes both ways are of one moment, whatever is lost, repeated or late."""
    count = [0]

    def feed():
        count[0] += 1
        return count[0] * 0x35 & 0xFF
    slave = Mux8(feed=feed)
    line = Line(setup(), 5, S7AA, slave)
    gave, had = set(), {0}
    for n, outcome in enumerate(outcomes + [OK] * 10):
        value = n * 0x4D + 1 & 0xFF
        line.set_ao(value)
        had.add(value)
        line.call(outcome)
        gave |= {k * 0x35 & 0xFF for k in range(count[0] + 1)}
        assert not line.status & 1 or line.ai[0] in gave
        assert set(slave.taken) <= had
    assert slave.taken and line.status & 1


# ---------------------------------------------------------------- type 4

def test_type_4_is_off():
    """CT-040: plain bits, and the transfer is shown as invalid with the substitute value."""
    lib = setup()[1]
    assert lib.fc_open(5, S7A9, 0) == 0
    assert lib.fc_status()[5] == 0 and list(lib.fc_ai()[20:24]) == [0x7FFF, 0x7FFF, 0, 0]
    assert lib.fc_first(5, 0b0011) == 0b1100 and lib.fc_call(5, 1, 12, 5, 0b0101, 0) == 0b1010
    assert lib.fc_inputs(5, 5) == 5
    lib.fc_close(5)


@pytest.mark.parametrize("kind, values", [(S7A8, [0x1234]), (S7A9, [0x1234, 0xFEDC])])
def test_type_4_placeholder(kind, values):
    """CT-040, CT-003: the placeholder, on a bad line too; S-7.A.8 carries an output bit."""
    line = Line(setup("ASI_CTT4_ENABLE=1"), 5, kind, slave := Ctt4(values), outputs=0)
    assert line.ai[0] == 0x7FFF
    for outcome in (OK, LATE, REQUEST_LOST, OK, ANSWER_LOST, LATE, OK, OK):
        line.call(outcome)
    assert line.ai[0] == 0x1234
    line.run(8)
    assert line.ai[:len(values)] == values
    assert line.status == TV | (1 << len(values)) - 1 | (OV if len(values) == 1 else 0)
    assert line.lib.fc_inputs(5, 7) == 0
    if kind == S7A8:
        for output in (1, 0):
            line.outputs = output
            line.run(2)
            assert slave.outputs[0] == 1 - output
    line.run(201, REQUEST_LOST)
    assert line.status == 0 and line.ai[0] == 0x7FFF
    line.run(9)
    assert line.status & TV
    line.lib.fc_close(5)
    assert line.status == 0 and line.ai[0] == 0x7FFF


# ---------------------------------------------------------------- type 5, safety

class Bus:
    """Plain slaves: images and lists of one cycle after the other."""
    def __init__(self, slaves):
        self.ffi, self.lib = setup()
        self.codes = [0xFFFF] * 64
        self.inputs = {}
        for index, word in slaves.items():
            self.codes[index] = word
            assert self.lib.fc_open(index, word, 0) == 0
        self.las = set(slaves)

    def cycle(self, failed=(), called=None, host=0):
        """host: nibble of all addresses. -> outputs of the addresses"""
        image = [0] * 8
        for i, n in self.inputs.items():
            image[i >> 3] |= n << 4 * (i & 7)
        self.image = self.ffi.new("uint32_t[8]", image)
        out = self.ffi.new("uint32_t[8]", [host * 0x11111111] * 8)
        self.lib.fc_cycle(lists(self.ffi, *self.las), lists(self.ffi, *(self.las if called is None else called)),
                          lists(self.ffi, *failed), self.ffi.new("uint16_t[64]", self.codes), self.image, out)
        return [out[i >> 3] >> 4 * (i & 7) & 15 for i in range(64)]

    def nibble(self, i):
        return self.image[i >> 3] >> 4 * (i & 7) & 15

    def incomplete(self):
        out = self.ffi.new("uint32_t[2]")
        self.lib.fc_incomplete(lists(self.ffi, *self.las), self.ffi.new("uint16_t[64]", self.codes), out)
        return members(out)

    def word(self, i):
        return self.lib.fc_ai()[4 * i]

    def leave(self, i):
        self.las.discard(i)
        self.lib.fc_close(i)


def five(*id2s, first=3):
    return {first + k: codes(6, 0, id2) for k, id2 in enumerate(id2s)}


def test_worked_group():
    """CT-050, CT-051: W9, three addresses, out 123, in ABC, left-aligned; other slaves' nibbles stay."""
    bus = Bus(five(0xB, 6, 5))
    bus.inputs = {3: 0xC, 4: 0xB, 5: 0xA}
    bus.lib.fc_ao()[12] = 0x1230
    out = bus.cycle(host=7)
    assert out[3:6] == [3, 2, 1] and out[:3] == [7] * 3 and out[6:] == [7] * 58
    assert bus.word(3) == 0xABC0 and bus.lib.fc_status()[3] == TV | OV | 1
    assert bus.incomplete() == set()


@pytest.mark.parametrize("id2s, inputs, outputs", [((0xA, 5), 0x3400, [7, 8]), ((0xB, 6, 5), 0x2340, [6, 7, 8]),
                                                   ((0xC, 7, 6, 5), 0x1234, [5, 6, 7, 8])])
@pytest.mark.parametrize("first", [1, 28])
def test_groups(id2s, inputs, outputs, first):
    """CT-050, CT-051: 2, 3 and 4 addresses, up to address 31."""
    n = len(id2s)
    bus = Bus(five(*id2s, first=first))
    nibbles = [4, 3, 2, 1] if n == 4 else [4, 3, 2] if n == 3 else [4, 3]
    bus.inputs = {first + k: v for k, v in enumerate(nibbles)}
    bus.lib.fc_ao()[4 * first] = 0x8765
    assert bus.cycle()[first:first + n] == outputs and bus.word(first) == inputs


def test_group_with_a_failed_call():
    """CT-050, CT-002: one member failed or was not called: the old value stays; then the new one."""
    bus = Bus(five(0xC, 7, 6, 5))
    bus.inputs = {3: 4, 4: 3, 5: 2, 6: 1}
    bus.cycle()
    bus.inputs = {3: 8, 4: 7, 5: 6, 6: 5}
    for missing in (3, 4, 5, 6):
        bus.cycle(failed={missing})
        assert bus.word(3) == 0x1234
        bus.cycle(called={3, 4, 5, 6} - {missing})
        assert bus.word(3) == 0x1234
    bus.cycle()
    assert bus.word(3) == 0x5678


@pytest.mark.parametrize("slaves, loose", [
    (five(0xB, 6), {3, 4}), (five(6, 5), {3, 4}), (five(0xB, 5, 6), {3, 4, 5}), (five(0xA, 5, 5), {5}),
    (five(0xC, 7, 6, 5, 0xA), {7}), (five(0xA, first=31), {31}), (five(0xC, 7, 6, first=29), {29, 30, 31}),
    (five(0xA, 5) | five(0xB, 6, 5, first=5), set())])
def test_incomplete_groups(slaves, loose):
    """CT-052: members without their whole group are plain slaves and named."""
    bus = Bus(slaves)
    bus.inputs = {i: 9 for i in slaves}
    out = bus.cycle(host=6)
    assert bus.incomplete() == loose
    for i in loose:
        assert out[i] == 6 and bus.word(i) == 0 and bus.lib.fc_status()[i] == 0
    for i in slaves.keys() - loose:
        assert out[i] == 0


def test_group_falls_apart():
    """CT-050, CT-052, CT-005: a member leaves: no value at once, without another cycle; also when only LAS says so."""
    bus = Bus(five(0xB, 6, 5) | five(0xA, 5, first=8))
    bus.inputs = {i: 9 for i in bus.las}
    bus.cycle()
    assert bus.word(3) == 0x9990 and bus.word(8) == 0x9900
    bus.leave(5)
    assert bus.word(3) == 0 and bus.lib.fc_status()[3] == 0 and bus.incomplete() == {3, 4}
    bus.las.discard(9)
    bus.cycle()
    assert bus.word(8) == 0 and bus.lib.fc_status()[8] == 0
    bus.las.add(9)
    bus.cycle()
    assert bus.word(8) == 0x9900
    for i in (3, 4, 8, 9):
        bus.leave(i)
    assert bus.word(8) == 0 and bus.incomplete() == set()
    assert bus.cycle(host=5) == [5] * 64


def safe(bus, channel):
    out = bus.ffi.new("uint32_t[2]")
    bus.lib.fc_safe_in(channel, out)
    return members(out)


TABLE = [0b0001, 0b0101, 0b0110, 0b1001, 0b1110, 0b1011, 0b1100, 0b0111]


def test_safety_slave():
    """CT-060: words pass as they are; a failed call gives 0 in that cycle; the view looks at the last 8 polls."""
    bus = Bus({4: codes(0, 0xB, 0xF), 9: codes(7, 0xB, 0)})
    assert safe(bus, 0) == safe(bus, 1) == set()
    for n in range(24):
        bus.inputs = {4: TABLE[n % 8], 9: TABLE[n % 8] & 3}
        bus.cycle()
        assert bus.nibble(4) == TABLE[n % 8]
    assert safe(bus, 0) == {4, 9} and safe(bus, 1) == {4}
    bus.cycle(failed={4})
    assert bus.nibble(4) == 0 and bus.nibble(9) == TABLE[7] & 3
    assert safe(bus, 0) == {4, 9}
    # channel 1 of slave 4 opens: closed for 7 polls more (one failed), then open; polls that were not made do not count
    bus.inputs = {4: 0b0100, 9: 1}
    for n in range(6):
        bus.cycle()
    bus.cycle(called={9})
    assert safe(bus, 0) == {4, 9}
    bus.cycle()
    assert safe(bus, 0) == {9} and safe(bus, 1) == {4}
    bus.inputs = {4: 0b0101, 9: 1}
    bus.cycle()
    assert safe(bus, 0) == {4, 9}


def test_safety_slave_leaves():
    """CT-060, CT-005: out of LAS: open in the view at once, and again after it comes back until a word shows a 1."""
    bus = Bus({4: codes(0, 0xB, 0xF)})
    bus.inputs = {4: 15}
    bus.cycle()
    assert safe(bus, 0) == safe(bus, 1) == {4}
    bus.leave(4)
    assert safe(bus, 0) == safe(bus, 1) == set()
    bus.lib.fc_open(4, codes(0, 0xB, 0xF), 0)
    bus.las.add(4)
    bus.inputs = {}
    bus.cycle()
    assert safe(bus, 0) == set()


def test_changes_are_named():
    """CT-002, CT-005: the index is in `changed` when, and only when, its value or status changed."""
    line = Line(setup(), 5, S7AA, Mux8(feed=lambda: 0x3C))
    changed = line.ffi.new("uint32_t[2]")
    line.run(4)
    line.lib.fc_changed(changed)
    assert members(changed) == {5}
    line.run(8)
    line.lib.fc_changed(changed)
    assert members(changed) == set()
    line.lib.fc_close(5)
    line.lib.fc_changed(changed)
    assert members(changed) == {5}
