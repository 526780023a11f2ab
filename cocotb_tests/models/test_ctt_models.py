# SPDX-License-Identifier: Apache-2.0
"""Combined transactions of the slave model (SL-009): worked sequences, and small masters that lose and repeat calls.

The masters here follow the rules of the line as a master has them; they know nothing of the model but its nibbles.
"""
from contextlib import nullcontext
from unittest.mock import patch

import pytest
from asi import ctt_table as table
from asi.checks import ANSWER_BITS, classify
from asi.regmap import ErrorClass
from asi.telegram import encode_call, pulses, request_pulses, request_word, response_word
from hypothesis import given, settings
from hypothesis import strategies as st

from cocotb_tests.models import ctt
from cocotb_tests.models.faults import Faults
from cocotb_tests.models.slaves import Slave
from cocotb_tests.models.test_models import Bench

MS = 1_000_000
CYCLE_NS, REPEAT_NS = 5 * MS, 160_000
GOOD, NO_REQUEST, NO_ANSWER = "good", "request lost", "answer lost"
LOSSES = st.lists(st.sampled_from((GOOD, GOOD, GOOD, NO_REQUEST, NO_ANSWER)), max_size=200)
# never both attempts of a call without an answer
SINGLE_LOSSES = LOSSES.map(lambda steps: [s for step in steps for s in ((step,) if step == GOOD else (step, GOOD))])


def choices(**values):
    """The table with other choices."""
    return patch.multiple(table, **values) if values else nullcontext()


class Wire:
    """Calls to one engine: one per cycle, a failed one repeated once at once."""

    def __init__(self, engine, losses=(), period_ns=CYCLE_NS):
        self.engine, self.losses, self.period_ns = engine, list(losses), period_ns
        self.now = 0
        self.cycles = 0

    def call(self, nibble):
        """-> nibble of the answer, None when both attempts failed."""
        self.now += self.period_ns
        self.cycles += 1
        for attempt in range(2):
            loss = self.losses.pop(0) if self.losses else GOOD
            if loss != NO_REQUEST:
                answer = self.engine.exchange(nibble, self.now + attempt * REPEAT_NS)
                if loss == GOOD:
                    return answer
        return None


def replay(engine, rows, start_ns=0):
    """Worked sequence: rows of (call, answer) nibbles, one call per cycle."""
    for k, (call, answer) in enumerate(rows):
        assert engine.exchange(call, start_ns + k * CYCLE_NS) == answer, f"call {k + 1}"


# ---------------------------------------------------------------------------------------------- kinds
@pytest.mark.parametrize("codes, kind", [
    ("71E", ctt.Ctt1), ("72E", ctt.Ctt1), ("73C", ctt.Ctt1), ("735", ctt.Ctt1), ("730", ctt.Ctt1), ("74C", ctt.Ctt1),
    ("740", None), ("755", ctt.Ctt2), ("7A5", ctt.Ctt2), ("BA5", ctt.Ctt2), ("754", None), ("BA6", None), ("B55", None),
    ("7A7", ctt.Mux4), ("7AA", ctt.Mux8), ("3A7", None), ("7A8", None), ("7A9", None), ("60C", None), ("605", None),
    ("0BF", ctt.Safety), ("7B5", ctt.Safety), ("3BE", ctt.Safety), ("7FF", None), ("33C", None), ("7AE", None)])
def test_kinds(codes, kind):
    """CT-001, CT-040, SL-009: the kind follows from IO, ID and ID2; CTT4 is off, CTT5 and the rest are plain."""
    engine = ctt.make(*(int(c, 16) for c in codes))
    assert engine is None if kind is None else type(engine) is kind


def test_options_of_plain_slaves():
    """SL-009: what a kind does not have is refused, not ignored."""
    with pytest.raises(ValueError, match="S-7.F.F.*values"):
        ctt.make(7, 15, 15, values=(1,))
    with pytest.raises(TypeError):
        ctt.make(7, 3, 12, swapped=True)
    with pytest.raises(ValueError, match="7 words"):
        ctt.make(0, 11, 0, words=range(7))
    for triples in (2, 8):
        with pytest.raises(ValueError, match=f"{triples} triples"):
            ctt.make(7, 1, 8, triples=triples)
    with pytest.raises(ValueError, match="S-7.3 has 7"):
        ctt.make(7, 3, 8, triples=6)


# ---------------------------------------------------------------------------------------------- worked sequences
W1 = [(0b0110, 0b0000), (0b1101, 0b1000), (0b0100, 0b0100), (0b1011, 0b1100), (0b0010, 0b0011), (0b1001, 0b1010),
      (0b0000, 0b0001), (0b1110, 0b1000)]
W2 = [(0b0001, 0b0101), (0b1001, 0b1100), (0b0001, 0b0011), (0b1110, 0b1010), (0b0001, 0b0001), (0b1000, 0b1000),
      (0b0001, 0b0110)]
W8 = [(0b1111, 0b0000), (0b1110, 0b0111), (0b1010, 0b1011), (0b1101, 0b1100), (0b1001, 0b0000), (0b1110, 0b0111)]


@pytest.mark.parametrize("activated", [False, True])
def test_w1(activated):
    """SL-009, CT-010: worked sequence W1, an input value, also after the F of the activation."""
    engine = ctt.make(7, 3, 0xC, values=(0x1234,))
    if activated:
        engine.write_parameter(15, 0)
        engine.exchange(15, 0)
    replay(engine, W1, MS)


@pytest.mark.parametrize("activated", [False, True])
def test_w2(activated):
    """SL-009, CT-010: worked sequence W2, a value for channel 2; before its V the output stays what it was."""
    engine = ctt.make(7, 3, 5)
    if activated:
        engine.write_parameter(15, 0)
        assert engine.exchange(15, 0) == 0b1110                 # no step: it still wants triple 6
    replay(engine, W2[:-1], MS)
    assert engine.outputs == [None] * 4
    replay(engine, W2[-1:], MS + 6 * CYCLE_NS)
    assert engine.outputs == [None, 0x2710, None, None]


def test_w3():
    """SL-009, CT-014: worked sequence W3, a string of two sequences; numbers 7 .. 0, then 7 of the next one."""
    engine = ctt.make(7, 4, 0xC, strings={ctt.DIAGNOSIS: bytes((0x41, 0x42, 0, 0x43))})
    assert engine.write_parameter(0xD, 0) == 0xD
    answers = [engine.exchange((k & 1) << 3 | 7 - k, k * CYCLE_NS) for k in range(8)]
    assert [a & 7 for a in answers] == [0b010, 0, 0b010, 0b100, 0b001, 0, 0, 0b011]
    assert [a >> 3 for a in answers] == [k & 1 for k in range(8)]
    second = [engine.exchange((k & 1) << 3 | 7 - k, MS * 100 + k * CYCLE_NS) & 7 for k in range(8)]
    assert second == [0b010, 0, 0b110, 0, 0, 0, 0, 0b001]      # 43 00 01: padded, F = 0, V = 1


def test_w4():
    """SL-009, CT-003: worked sequence W4, a repeated call gets the same answer and no step is made."""
    replay(ctt.make(7, 3, 0xC, values=(0x1234,)), [*W1[:4], W1[3], *W1[4:]])
    engine = ctt.make(7, 3, 5)
    replay(engine, [row for row in W2 for _ in range(3)])
    assert engine.outputs[1] == 0x2710


def test_w5_w6():
    """SL-009, CT-020: worked sequences W5 and W6: the read of the ID object, 16 calls a byte each way, both maps."""
    for swapped in (False, True):
        engine = ctt.make(7, 0xA, 5, strings={0: bytes((1, 2, 3, 4, 0x22))}, swapped=swapped)
        calls = [clock | int(bit) << 1 | 4 for bit in f"{0x10_00_05:024b}" for clock in (0, 1)]
        assert calls[:8] == [0b100, 0b101] * 3 + [0b110, 0b111]
        answers = [engine.exchange(call, k * CYCLE_NS) for k, call in enumerate(calls)]
        assert answers[:-1] == [0b1100] * 47                    # idle until the last bit was there
        answers = answers[-1:] + [engine.exchange(0b111, MS * 1_000 + k * CYCLE_NS) for k in range(16)]
        bit = {0: [0, 0b0100], 1: [0b1000, 0b1100]} if swapped else {0: [0, 0b1000], 1: [0b0100, 0b1100]}
        assert answers[:16] == [a for b in (0, 1, 0, 1, 0, 0, 0, 0) for a in bit[b]]


def test_w7():
    """SL-009, CT-030: worked sequence W7: outputs 1010 switch at the falling edge of I2, together."""
    engine = ctt.make(7, 0xA, 7)
    engine.inputs = 0b0110
    replay(engine, [(0b001, 6), (0b101, 6)])
    assert engine.outputs[0] is None                            # no call with I2 = 1 came before the first one
    replay(engine, [(0b001, 6)])
    assert engine.outputs[0] == 0b1010
    replay(engine, [(0b011, 6)])
    assert engine.outputs[0] == 0b1010                          # I2 stayed 0: no edge


def test_w8():
    """SL-009, CT-031: worked sequence W8: eight inputs, and the eight outputs 0xA5 once pair 3 is there."""
    engine = ctt.make(7, 0xA, 0xA, values=(0x3C,))
    replay(engine, [(call & 7, answer) for call, answer in W8[:4]])
    assert engine.outputs[0] is None
    replay(engine, [(call & 7, answer) for call, answer in W8[4:]])
    assert engine.outputs[0] == 0xA5


@pytest.mark.parametrize("index, extended, nibble, word", [
    (8, False, 0b0110, 0x041B), (8, False, 0b1101, 0x0435), (9, False, 0b1110, 0x04BB), (5, True, 0b100, 0x02B1),
    (5, True, 0b110, 0x02BB), (5, True, 0b101, 0x02B7), (37, True, 0b101, 0x0295), (37, True, 0b001, 0x0287),
    (3, False, 0b1100, 0x01B1), (4, False, 0b1101, 0x0235)])
def test_words(index, extended, nibble, word):
    """TL-001, CA-001: requests of the worked sequences as 14-bit words."""
    assert request_word(encode_call("DEXG", index, nibble, extended)) == word


def test_answer_words():
    """TL-002: answers of W1, W2 and W9 as 7-bit words."""
    assert [response_word(a) for _, a in W1[:7]] == [0x01, 0x23, 0x13, 0x31, 0x0D, 0x29, 0x07]
    assert [response_word(a) for _, a in W2] == [0x15, 0x31, 0x0D, 0x29, 0x07, 0x23, 0x19]
    assert [response_word(a) for a in (0xC, 0xB, 0xA)] == [0x31, 0x2F, 0x29]


# ---------------------------------------------------------------------------------------------- CTT1 under losses
def pack(control, three):
    return control << 3 | three if table.CTT1_TOGGLE_POS else three << 1 | control


def line_number(t):
    return 7 - t if table.CTT1_COUNT_UP else t


def turned(three):
    return int(f"{three:03b}"[::-1], 2)


def on_line(three):
    return three if table.CTT1_MSB_LEFT else turned(three)


class Ctt1Master:
    """Lock step of a master: the same nibble until an answer with the expected control bit comes."""

    def __init__(self, wire):
        self.wire, self.control = wire, table.CTT1_START_TOGGLE

    def step(self, three):
        """-> the three bits of the accepted answer."""
        while True:
            answer = self.wire.call(pack(self.control, three) ^ 15 * table.CTT1_INVERT_OUT)
            if answer is None:
                continue
            control, got = (answer >> 3, answer & 7) if table.CTT1_TOGGLE_POS else (answer & 1, answer >> 1)
            assert control == self.control ^ table.CTT1_ECHO_INVERTED
            self.control ^= 1
            return got

    def read(self, triples):
        """One frame from the slave, as an integer."""
        frame = 0
        for t in reversed(range(triples)):
            frame = frame << 3 | on_line(self.step(line_number(t)))
        return frame

    def write(self, frame, triples):
        """One frame to the slave: the slave names each next triple."""
        t, steps = triples - 1, 0
        while t >= 0:
            wanted = line_number(self.step(on_line(frame >> 3 * t & 7)))
            t, steps = (-1 if t == 0 and wanted == triples - 1 else wanted), steps + 1
        return steps

    def read_string(self):
        """-> bytes, None when V = 0."""
        out = b""
        while True:
            frame = self.read(8)
            if not frame & 1:
                return None
            out += frame.to_bytes(3)
            if not frame & 2:
                return out

    def write_string(self, string):
        assert len(string) % 3 == 0
        for k in range(0, len(string), 3):
            last = k + 3 == len(string)
            self.write(int.from_bytes(string[k:k + 3]) & ~3 | (not last) << 1 | 1, 8)


ALTERNATIVES = [{}, {"CTT1_COUNT_UP": 1}, {"CTT1_TOGGLE_POS": 0}, {"CTT1_MSB_LEFT": 0}, {"CTT1_ECHO_INVERTED": 1},
                {"CTT1_E_REVERSED": 1}, {"CTT1_START_TOGGLE": 1}, {"CTT1_INVERT_OUT": 1},
                {"CTT1_COUNT_UP": 1, "CTT1_TOGGLE_POS": 0, "CTT1_MSB_LEFT": 0, "CTT1_ECHO_INVERTED": 1,
                 "CTT1_E_REVERSED": 1, "CTT1_START_TOGGLE": 1, "CTT1_INVERT_OUT": 1}]
WORDS = st.lists(st.integers(0, 0xFFFF), min_size=4, max_size=4)


@given(st.sampled_from(ALTERNATIVES), st.integers(0, 3), WORDS, st.integers(0, 15), st.integers(0, 15),
       st.sampled_from([3, 4]), LOSSES)
@settings(max_examples=200, deadline=None, derandomize=True)
def test_ctt1_inputs(alternative, id2, words, invalid, overflow, id, losses):
    """SL-009, CT-003, CT-010: all channels in turn with V and O, 7 calls each, whatever calls and answers are lost."""
    with choices(**alternative):
        channels = (1, 2, 4, 4)[id2]
        engine = ctt.make(7, id, 8 | id2, values=words, invalid=invalid, overflow=overflow)
        engine.exchange(15, 0)                                  # activation
        wire = Wire(engine, losses)
        master = Ctt1Master(wire)
        for k in [*range(channels), *range(channels)]:
            frame = master.read(7)
            e = frame >> 18
            assert (turned(e) if table.CTT1_E_REVERSED else e) == k
            assert frame >> 2 & 0xFFFF == words[k]
            assert frame & 3 == (overflow >> k & 1) << 1 | (not invalid >> k & 1)
        assert wire.cycles == 14 * channels or losses


@given(st.sampled_from(ALTERNATIVES), st.integers(0, 3), WORDS, LOSSES)
@settings(max_examples=200, deadline=None, derandomize=True)
def test_ctt1_outputs(alternative, id2, words, losses):
    """SL-009, CT-003, CT-010, CT-013: each value comes complete to its channel, whatever calls and answers are lost."""
    with choices(**alternative):
        channels = (1, 2, 4, 4)[id2]
        engine = ctt.make(7, 3, id2)
        engine.write_parameter(0xE, 0)                          # P0 = 0: it does not drop them during a long loss
        engine.exchange(15, 0)
        wire = Wire(engine, losses)
        master = Ctt1Master(wire)
        for k in range(channels):
            e = turned(k) if table.CTT1_E_REVERSED else k
            steps = master.write(e << 18 | words[k] << 2 | 1, 7)
            assert steps == 7 + (k == 0 and table.CTT1_START_TOGGLE ^ table.CTT1_INVERT_OUT)
            assert engine.outputs == words[:k + 1] + [None] * (3 - k)
        assert wire.cycles <= 7 * channels + 1 or losses


def test_ctt1_value_is_taken_whole():
    """SL-009, CT-002: a change in the middle of a value is seen in the next one, never in part."""
    engine = ctt.make(7, 3, 0xC, values=(0x0FF0,))
    master = Ctt1Master(Wire(engine))
    for t in (6, 5, 4):
        master.step(t)
    engine.values[0] = 0xF00F
    assert [master.step(t) for t in (3, 2, 1, 0)] == [7, 7, 0, 1]       # D10.. of 0FF0
    assert master.read(7) == 0xF00F << 2 | 1
    for t in (6, 5, 4):
        master.step(t)
    engine.values[0] = 0x1111
    assert master.read(7) == 0x1111 << 2 | 1                    # broken off and begun again: a new one
    two = ctt.make(7, 3, 0xD, values=(0x0FF0, 0x1111))
    master = Ctt1Master(Wire(two))
    for t in (6, 5, 4):
        master.step(t)
    assert master.read(7) == 0x0FF0 << 2 | 1                    # ... of the same channel
    short = ctt.make(7, 1, 8, values=(0xE000,), triples=5)
    assert short.exchange(0b0100, 0) == 0b0000
    short.values[0] = 0
    assert short.exchange(0b0100, REPEAT_NS) == 0b0000          # the first triple repeated is no new value
    assert short.exchange(0b1011, CYCLE_NS) == 0b1111


def test_ctt1_outputs_that_are_not_taken():
    """SL-009, CT-010: V = 0, or a channel that is not there, changes no output."""
    engine = ctt.make(7, 3, 5)
    master = Ctt1Master(Wire(engine))
    master.write(1 << 18 | 5 << 2 | 1, 7)
    for frame in (1 << 18 | 6 << 2, 2 << 18 | 7 << 2 | 1, 7 << 18 | 8 << 2 | 1):
        master.write(frame, 7)
    assert engine.outputs == [None, 5, None, None]


def test_ctt1_before_the_first_triple():
    """SL-009, CT-011: triples asked for before the first one are 000, so that the value they end has V = 0."""
    engine = ctt.make(7, 3, 0xC, values=(0xFFFF,))
    assert [engine.exchange((t & 1) << 3 | t, k * CYCLE_NS) for k, t in enumerate((3, 2, 1, 0))] == [8, 0, 8, 0]
    assert engine.exchange(0b1110, CYCLE_NS * 9) == 0b1000
    assert engine.exchange(0b0101, CYCLE_NS * 10) == 0b0111
    assert engine.exchange(0b1111, CYCLE_NS * 11) == 0b1000     # there is no triple 7 in a value


@pytest.mark.parametrize("alternative", [{}, {"CTT1_COUNT_UP": 1}])
@pytest.mark.parametrize("triples", [3, 4, 5, 6, 7])
def test_ctt1_short_values(triples, alternative):
    """SL-009, CT-015: S-7.1 and S-7.2: E and channels as S-7.3, the value left-aligned in fewer triples."""
    with choices(CTT1_TRIPLES_71=triples, **alternative):
        left, e = 21 - 3 * triples, 3 * (triples - 1)
        engine = ctt.make(7, 1, 0xD, values=(0xA5C3, 0xFFFF))
        master = Ctt1Master(Wire(engine))
        for _ in range(2):
            assert master.read(triples) == 0xA5C3 >> left << 2 | 1
            assert master.read(triples) == 1 << e | 0xFFFF >> left << 2 | 1
        engine = ctt.make(7, 2, 1, triples=triples)
        engine.exchange(15, 0)
        wire = Wire(engine)
        assert Ctt1Master(wire).write(1 << e | 0xA5C3 >> left << 2 | 1, triples) == triples
        assert engine.outputs == [None, 0xA5C3 >> left << left, None, None]
        assert engine.write_parameter(table.CTT1_PAR_ID, 0) == table.CTT1_PAR_ID        # no strings here
        Ctt1Master(wire).write(0x1234 >> left << 2 | 1, triples)
        assert engine.outputs[0] == 0x1234 >> left << left


@pytest.mark.parametrize("p0, id, dropped", [(1, 3, True), (0, 3, False), (1, 4, False)])
def test_ctt1_supervision(p0, id, dropped):
    """SL-009, CT-013: without a step for 500 ms an output of S-7.3 with P0 = 1 drops; a broken value is given up."""
    engine = ctt.make(7, id, 4 if id == 3 else 1)
    engine.write_parameter(14 | p0 if id == 3 else 15, 0)
    wire = Wire(engine)
    master = Ctt1Master(wire)
    master.write(7 << 2 | 1, 7)
    master.step(0)
    last = wire.now
    for k in range(99):                                         # the same control bit: calls, but no dialogue
        engine.exchange(0b1000 if master.control == 0 else 0, last + (k + 1) * CYCLE_NS)
    assert engine.outputs[0] == 7
    engine.update(last + 500 * MS - 1)
    assert engine.outputs[0] == 7
    engine.update(last + 500 * MS)
    assert engine.outputs[0] == (None if dropped else 7)
    wire.now = last + 500 * MS
    assert engine.exchange(0b1000 if master.control == 0 else 0, wire.now) & 7 == 6     # names what it wants
    assert master.step(5) == 6                                  # not taken: the middle of a value, for all it knows
    assert master.write(9 << 2 | 1, 7) == 7 and engine.outputs[0] == 9


# ---------------------------------------------------------------------------------------------- CTT1 strings
@given(st.sampled_from(ALTERNATIVES), st.binary(min_size=1, max_size=219), st.sampled_from([0xC, 4]), LOSSES)
@settings(max_examples=60, deadline=None, derandomize=True)
def test_ctt1_read_string(alternative, string, id2, losses):
    """SL-009, CT-014: strings come complete with F and V, from input and output slaves; then values go on."""
    with choices(**alternative):
        engine = ctt.make(7, 4, id2, values=(0x1234,), strings={ctt.ID: string})
        engine.exchange(15, 0)
        master = Ctt1Master(Wire(engine, losses))
        engine.write_parameter(table.CTT1_PAR_ID, 0)
        engine.write_parameter(table.CTT1_PAR_ID, 0)            # its answer was lost
        got = master.read_string()
        sequences = -(-len(string) // 3)
        assert len(got) == 3 * sequences
        padded = string.ljust(3 * sequences, b"\0")
        for k in range(sequences):
            assert got[3 * k:3 * k + 2] == padded[3 * k:3 * k + 2]
            assert got[3 * k + 2] == padded[3 * k + 2] & 0xFC | (k + 1 < sequences) << 1 | 1
        assert master.read_string() == got                      # it begins again
        engine.write_parameter(table.CTT1_PAR_DATA, 0)
        if id2 & 8:
            assert master.read(7) == 0x1234 << 2 | 1
        else:
            master.write(0x4321 << 2 | 1, 7)
            assert engine.outputs[0] == 0x4321


@given(st.sampled_from(ALTERNATIVES), st.integers(1, 73), st.sampled_from([0xC, 4]), LOSSES)
@settings(max_examples=60, deadline=None, derandomize=True)
def test_ctt1_write_string(alternative, sequences, id2, losses):
    """SL-009, CT-014: a parameter string is taken when its last sequence is there, and can be read back."""
    with choices(**alternative):
        old = bytes((1, 2, 1))
        engine = ctt.make(7, 4, id2, strings={ctt.PARAMETERS: old})
        engine.exchange(15, 0)
        master = Ctt1Master(Wire(engine, losses))
        string = bytes(k * 37 & 0xFF for k in range(3 * sequences))
        engine.write_parameter(table.CTT1_PAR_WR, 0)
        master.write_string(string)
        stored = engine.strings[ctt.PARAMETERS]
        assert [b for k, b in enumerate(stored) if k % 3 < 2] == [b for k, b in enumerate(string) if k % 3 < 2]
        engine.write_parameter(table.CTT1_PAR_DATA, 0)
        engine.write_parameter(table.CTT1_PAR_RD, 0)
        assert master.read_string() == stored


def test_ctt1_strings_refused():
    """SL-009, CT-014: no string: V = 0; V = 0 or too long in writing: the old one stays; S-7.3 has no strings."""
    engine = ctt.make(7, 4, 0xC, strings={ctt.PARAMETERS: b"old"})
    master = Ctt1Master(Wire(engine))
    engine.write_parameter(0xD, 0)
    assert master.read_string() is None
    engine.write_parameter(0x7, 0)
    master.write(0x414203, 8)
    master.write(0x414200, 8)
    master.write(0x414200, 8)
    assert engine.strings[ctt.PARAMETERS] == b"old"
    master.write_string(bytes(222))
    assert engine.strings[ctt.PARAMETERS] == b"old"
    engine.write_parameter(15, 0)
    engine.write_parameter(0x7, 0)
    master.write_string(bytes(219))
    assert len(engine.strings[ctt.PARAMETERS]) == 219
    plain = ctt.make(7, 3, 0xC, values=(0x1234,))
    for k, row in enumerate(W1):
        assert plain.write_parameter((0xE, 0xD, 0xB, 0x7)[k & 3], 0) == (0xE, 0xD, 0xB, 0x7)[k & 3]
        assert plain.exchange(row[0], k * CYCLE_NS) == row[1]


def test_ctt1_write_string_after_a_silence():
    """SL-009, CT-014: half a second of silence costs the sequence that was running, not the string."""
    engine = ctt.make(7, 4, 4)
    wire = Wire(engine)
    master = Ctt1Master(wire)
    engine.write_parameter(0x7, 0)
    master.write(0x414203, 8)
    for three in (2, 0, 6):
        master.step(three)
    wire.now += 500 * MS
    assert master.step(0) == 7
    master.write(0x434401, 8)
    assert engine.strings[ctt.PARAMETERS] == bytes.fromhex("414203434401")


def test_ctt1_values_survive_a_parameter():
    """SL-009, CT-014: WPAR F in the middle of a value does not disturb it."""
    engine = ctt.make(7, 4, 0xC, values=(0x1234,))
    for k, row in enumerate(W1):
        engine.write_parameter(15, 0)
        assert engine.exchange(row[0], k * CYCLE_NS) == row[1]


def test_stray_calls_before_a_string():
    """SL-009, CT-014: calls of the value that reach the slave after WPAR do not eat a sequence of the string."""
    engine = ctt.make(7, 4, 0xC, values=(0x1234,), strings={0: b"abcdef"})
    master = Ctt1Master(Wire(engine))
    for t in (6, 5):
        master.step(t)
    engine.write_parameter(0xE, 0)
    assert [master.step(t) for t in (4, 3, 2, 1, 0)] == [0] * 5
    assert master.read_string() == bytes((0x61, 0x62, 0x63, 0x64, 0x65, 0x65))


# ---------------------------------------------------------------------------------------------- CTT2
class Ctt2Master:
    """Bytes in series: advances only after an answered call, receives in every call."""

    def __init__(self, wire, swapped=False):
        self.wire = wire
        self.clock_bit, self.data_bit = (2, 3) if swapped else (3, 2)
        self.clock = table.CTT2_IDLE & 1
        self.bits = ""
        self.extra = 0                                          # DO2

    def call(self, clock, data):
        nibble = clock << table.CTT2_DO_CLOCK | data << table.CTT2_DO_DATA | self.extra
        while (answer := self.wire.call(nibble)) is None:
            pass
        now, self.parallel = answer >> self.clock_bit & 1, answer & 3
        if now != self.clock and now == table.CTT2_RISING_EDGE:
            self.bits += str(answer >> self.data_bit & 1)
        self.clock = now

    def idle(self, calls):
        for _ in range(calls):
            self.call(table.CTT2_IDLE & 1, table.CTT2_IDLE >> 1)

    def send(self, message):
        active = table.CTT2_RISING_EDGE
        self.bits = ""
        for byte in message:
            for k in range(8):
                bit = byte >> (7 - k if table.CTT2_MSB_FIRST else k) & 1
                self.call(1 - active, bit)
                self.call(active, bit)

    def ask(self, message, length):
        """Send a message and wait for that many bytes -> bytes received, and what follows until the line is idle."""
        self.send(message)
        self.idle(16 * length + 8)
        return self.received()

    def received(self):
        assert len(self.bits) % 8 == 0
        octets = [self.bits[k:k + 8] for k in range(0, len(self.bits), 8)]
        return bytes(int(o if table.CTT2_MSB_FIRST else o[::-1], 2) for o in octets)


OBJECTS = {0: bytes((0x12, 0x34, 0x56, 0x78, 0x22, 7)), 5: b"hello", 9: bytes(220)}
CTT2 = [(7, 5, 5), (7, 0xA, 5), (0xB, 0xA, 5)]
CTT2_CHOICES = [{}, {"CTT2_MSB_FIRST": 0}, {"CTT2_RISING_EDGE": 0}, {"CTT2_IDLE": 0}, {"CTT2_IDLE": 1},
                {"CTT2_DI_DATA": 3, "CTT2_DI_CLOCK": 2}]


@pytest.mark.parametrize("message, response", [
    ("10 00 05", "50 12 34 56 78 22"), ("10 00 06", "50 12 34 56 78 22 07"), ("10 00 07", "90 02"),
    ("10 00 00", "90 02"), ("10 05 05", "50 68 65 6C 6C 6F"), ("10 04 01", "90 01"), ("12 05 01", "52 68"),
    ("12 04 01", "92 01"), ("11 05 05 41 42 43 44 45", "51"), ("11 05 04 41 42 43 44", "91 02"),
    ("11 00 05 41 42 43 44 45", "91 01"), ("11 05 00", "91 02"), ("13 05 05 41 42 43 44 45", "53"),
    ("13 06 01 00", "93 01"), ("1D 05 02 05 41 42 43 44 45", "5D 41 42"), ("1D 05 06 05 41 42 43 44 45", "9D 02"),
    ("1D 05 00 05 41 42 43 44 45", "5D"), ("1D 05 05 00", "9D 02"), ("1D 08 01 01 00", "9D 01"),
    ("00", "AB CD"), ("01 12 34", ""), ("1F 01 02 03", "9F 03"), ("3F", "BF 03"),
    ("40", ""), ("77 01", ""), ("90 02", ""), ("FF", ""), ("05 05", "")])
@pytest.mark.parametrize("codes", CTT2)
def test_ctt2_messages(codes, message, response):
    """SL-009, CT-021: every code of the table with its good response and its errors; unknown codes end with a gap, and
    what looks like a response (40 and above) has none."""
    engine = ctt.make(*codes, values=(0xABCD,), strings=OBJECTS)
    master = Ctt2Master(Wire(engine))
    assert master.ask(bytes.fromhex(message), 8) == bytes.fromhex(response)
    assert master.ask(bytes.fromhex("10 00 05"), 6) == bytes.fromhex("50 12 34 56 78 22")   # ready for the next one


def test_ctt2_objects():
    """SL-009, CT-021: written objects read back; a busy slave says so; device errors follow the standard one."""
    engine = ctt.make(7, 5, 5, strings=OBJECTS, busy=1)
    engine.device_error = b"\x42"
    master = Ctt2Master(Wire(engine))
    assert master.ask(bytes.fromhex("11 05 05 01 02 03 04 05"), 2) == b"\x91\x04"
    assert engine.strings[5] == b"hello"
    assert master.ask(bytes.fromhex("11 05 05 01 02 03 04 05"), 2) == b"\x51"
    assert master.ask(bytes.fromhex("10 05 03"), 4) == bytes.fromhex("50 01 02 03")
    assert master.ask(bytes.fromhex("12 07 01"), 3) == bytes.fromhex("92 01 42")
    assert master.ask(bytes.fromhex("10 07 01"), 3) == bytes.fromhex("90 01")
    assert len(master.ask(bytes.fromhex("10 09 DC"), 221)) == 221
    assert OBJECTS[5] == b"hello"                               # the caller's dictionary is not ours


@pytest.mark.parametrize("configuration, inputs, outputs", [
    (0x00, "", 0), (0x11, "22", 1), (0x22, "11 22", 2), (0x23, "11 22 33 44", 2), (0x32, "11 22", 4),
    (0x44, "11 22 33 44 55 66", 6), (0xDD, "11 22 33 44 55 66 77 88", 8), (0x76, "", 0)])
def test_ctt2_cyclic(configuration, inputs, outputs):
    """SL-009, CT-021: cyclic inputs and outputs are as long as the configuration byte says; code 01 has no answer."""
    engine = ctt.make(7, 5, 5, values=(0x1122, 0x3344, 0x5566, 0x7788), strings={0: bytes((0, 0, 0, 0, configuration))})
    master = Ctt2Master(Wire(engine))
    assert master.ask(b"\0", 9) == bytes.fromhex(inputs)
    data = bytes(range(0xA1, 0xA1 + outputs))
    master.send(b"\1" + data[:-1])
    assert engine.outputs == [None] * 4 or not outputs
    master.send(data[-1:])
    words = [0xA1] if outputs == 1 else [0xA1A2, 0xA3A4, 0xA5A6, 0xA7A8][:outputs // 2]
    assert engine.outputs == words + [None] * (4 - len(words))
    master.idle(20)
    assert master.received() == b""


@given(st.sampled_from(CTT2_CHOICES), st.sampled_from(CTT2), st.booleans(), SINGLE_LOSSES)
@settings(max_examples=60, deadline=None, derandomize=True)
def test_ctt2_losses(alternative, codes, swapped, losses):
    """SL-009, CT-003, CT-020: a call or answer lost and repeated at once costs no clock level in either direction."""
    with choices(**alternative):
        engine = ctt.make(*codes, strings=OBJECTS, swapped=swapped)
        wire = Wire(engine, losses)
        master = Ctt2Master(wire, swapped != (table.CTT2_DI_DATA == 3))
        master.clock = table.CTT2_IDLE & 1
        assert master.ask(bytes.fromhex("11 05 03 41 42 43"), 2) == b"\x91\x02"
        assert master.ask(bytes.fromhex("11 05 05 41 42 43 44 45"), 2) == b"\x51"
        assert master.ask(bytes.fromhex("10 05 05"), 6) == b"\x50ABCDE"
        calls = 16 * (6 + 8 + 3) + (16 * 2 + 8) * 2 + 16 * 6 + 8
        assert wire.cycles == calls                             # none lost altogether, none needed twice


def test_ctt2_rate():
    """SL-009, CT-020: 16 calls a byte: the response begins in the call that completes the request."""
    engine = ctt.make(7, 0xA, 5, strings=OBJECTS)
    master = Ctt2Master(Wire(engine))
    master.send(bytes.fromhex("10 00 05"))
    master.idle(16 * 6 - 1)
    assert master.received() == bytes.fromhex("50 12 34 56 78 22") and master.wire.cycles == 16 * 9 - 1


def test_ctt2_gap():
    """SL-009, CT-020: 8 calls without an edge clear the receiver, 7 do not; repetitions are no calls of their own."""
    for still, good in ((7, True), (8, False)):
        engine = ctt.make(7, 5, 5, strings=OBJECTS)
        master = Ctt2Master(Wire(engine))
        master.send(b"\x10")
        master.call(0, 0)
        for _ in range(still):
            master.call(0, 0)
        master.call(1, 0)                                       # first bit of 00 05
        for k in range(15):
            bit = 0x0005 >> 14 - k & 1
            master.call(0, bit)
            master.call(1, bit)
        master.idle(16 * 6)
        assert (master.bits[:8] == f"{0x50:08b}") == good, still
    engine = ctt.make(7, 5, 5, strings=OBJECTS)
    wire = Wire(engine)
    master = Ctt2Master(wire)
    master.send(b"\x10")
    wire.losses = [NO_ANSWER, GOOD] * 7
    master.idle(7)
    master.send(b"\0\5")
    master.idle(16 * 6)
    assert master.received() == bytes.fromhex("50 12 34 56 78 22")


def test_ctt2_repetition_by_time():
    """SL-009, CT-003: the same nibble within 224 us of an answered call is a repetition, any other a call."""
    engine = ctt.make(7, 0xA, 5, strings=OBJECTS)
    master = Ctt2Master(Wire(engine))
    master.send(bytes.fromhex("10 05 05"))
    t = master.wire.now
    assert engine.exchange(0b011, t + 223_999) == 0b0000        # first level of the response again
    assert engine.exchange(0b011, t + 223_999 + 224_000) == 0b1000
    assert engine.exchange(0b001, t + 448_000) == 0b0100        # another nibble: no repetition, however soon


def test_ctt2_parallel_bits():
    """SL-009, CT-023: DI0 and DI1 stay inputs of the slave, DO2 does not disturb; S-B.A.5 has none."""
    for codes, parallel in zip(CTT2, (2, 2, 0)):
        engine = ctt.make(*codes, strings=OBJECTS)
        engine.inputs = 0b1110
        master = Ctt2Master(Wire(engine))
        master.extra = 4
        assert master.ask(bytes.fromhex("10 05 05"), 6) == b"\x50hello"
        assert master.parallel == parallel


def test_ctt2_new_request_during_a_response():
    """SL-009, CT-022: a new request ends the response that is still running."""
    engine = ctt.make(7, 5, 5, strings=OBJECTS)
    master = Ctt2Master(Wire(engine))
    master.send(bytes.fromhex("10 09 DC"))
    master.idle(41)
    master.send(bytes.fromhex("10 05 05"))
    master.bits = master.bits[-1:] if master.clock else ""
    master.idle(16 * 6 + 20)
    assert master.bits[-48:] == "".join(f"{b:08b}" for b in b"\x50hello")


# ---------------------------------------------------------------------------------------------- CTT3
@given(st.lists(st.integers(0, 15), min_size=1, max_size=20), LOSSES, st.sampled_from([0, 1]))
@settings(max_examples=100, deadline=None, derandomize=True)
def test_mux4_losses(words, losses, inverted):
    """SL-009, CT-003, CT-030: four outputs change together, whatever calls and answers are lost and repeated."""
    with choices(CTT3_INVERT_OUT=inverted):
        engine = ctt.make(7, 0xA, 7)
        wire = Wire(engine, losses)

        def send(nibble):
            while wire.call(nibble) is None:
                pass
        previous = None
        for word in words:
            send(4 | word >> 2 ^ 3 * inverted)
            assert engine.outputs[0] == previous
            send(word & 3 ^ 3 * inverted)
            assert engine.outputs[0] == word
            previous = word


@given(st.lists(st.tuples(st.integers(0, 255), st.integers(0, 255)), min_size=1, max_size=8), LOSSES,
       st.sampled_from([{}, {"CTT3_AA_OFFSET": 1}, {"CTT3_AA_INVERTED": 0}, {"CTT3_INVERT_OUT": 0}]))
@settings(max_examples=100, deadline=None, derandomize=True)
def test_mux8_losses(words, losses, alternative):
    """SL-009, CT-003, CT-031: bytes both ways are consistent, whatever calls and answers are lost and repeated."""
    with choices(**alternative):
        engine = ctt.make(7, 0xA, 0xA, values=(words[0][1],))
        # the first call, repeated, is taken for a confirmation of s = 0: here it arrives
        wire = Wire(engine, [GOOD, *losses])
        s, pairs, got, latched, taken = None, {}, [], None, []
        expected = [words[0][1]]
        for out, value in words:
            for _ in range(4):
                if s is None:
                    nibble = 7
                else:
                    number = s + table.CTT3_AA_OFFSET & 3
                    latched = out if number == 0 else latched
                    confirm = s & 1 ^ table.CTT3_AA_INVERTED
                    nibble = confirm << 2 | ((latched or 0) >> 2 * number & 3) ^ 3 * table.CTT3_INVERT_OUT
                    if number == 3 and latched is not None:
                        taken.append(latched)
                while (answer := wire.call(nibble)) is None:
                    pass
                s = answer >> 2
                pairs[s] = answer & 3
                if s == 3:
                    got.append(sum(p << 2 * k for k, p in pairs.items()))
                if s == 1:
                    engine.values[0] = value                    # in the middle of a round: for the next one
                    expected.append(value)
        assert got == expected[:len(got)] and len(got) == len(words)
        assert engine.outputs[0] == (taken[-1] if taken else None)


# ---------------------------------------------------------------------------------------------- CTT4, safety, reset
def test_ctt4_placeholder():
    """SL-009, CT-040: only when the table enables it: nibbles 3 .. 0 of a word taken at 3, once per repetition."""
    with choices(CTT4_ENABLE=1):
        one, two = ctt.make(7, 0xA, 8, values=(0x1234,)), ctt.make(7, 0xA, 9, values=(0x1234, 0xABCD))
    assert [one.exchange(4 | n, 0) for n in (3, 2)] == [1, 2] and one.outputs[0] == 1
    one.values[0] = 0xFFFF
    assert [one.exchange(n, 0) for n in (1, 0, 3)] == [3, 4, 0xF] and one.outputs[0] == 0
    one.values[0] = 0
    assert [one.exchange(n, 0) for n in (3, 2)] == [0xF, 0xF]
    assert [two.exchange(n, 0) for n in (3, 7, 2, 6, 1, 5, 0, 4)] == [1, 0xA, 2, 0xB, 3, 0xC, 4, 0xD]
    with pytest.raises(ValueError):
        ctt.make(7, 0xA, 8, values=(1,))


def test_safety():
    """SL-009, CT-060: eight words in turn; a word stays for 224 us after an answered call; open channels are 0."""
    engine = ctt.make(0, 0xB, 0)
    words = [engine.exchange(15, k * MS) for k in range(9)]
    assert words == [0b0001, 0b0101, 0b0110, 0b1001, 0b1110, 0b1011, 0b1100, 0b0111, 0b0001]
    t = 8 * MS
    assert engine.exchange(15, t + 160_000) == 0b0001
    assert engine.exchange(15, t + 383_999) == 0b0001           # counted from the last answer
    assert engine.exchange(15, t + 383_999 + 224_000) == 0b0101
    for closed, mask in ((3, 15), (2, 12), (1, 3), (0, 0)):
        engine.reset()
        engine.closed = closed
        assert [engine.exchange(15, k * MS) for k in range(8)] == [w & mask for w in words[:8]]
    own = ctt.make(7, 0xB, 15, words=range(1, 9), closed=2)
    assert own.exchange(15, 0) == 0 and own.exchange(15, MS) == 0 and own.exchange(0, 2 * MS) == 0
    assert own.exchange(0, 3 * MS) == 4


@pytest.mark.parametrize("codes, calls", [
    ((7, 3, 0xC), [0b0110, 0b1101, 0b0100]), ((7, 3, 4), [0, 8, 0, 8, 0, 8, 1, 8, 0]),
    ((7, 5, 5), [0, 1, 0]), ((7, 0xA, 7), [7, 0, 7]), ((7, 0xA, 0xA), [7, 4, 0, 5, 1, 4]), ((0, 0xB, 0), [15, 15])])
def test_reset(codes, calls):
    """SL-009, SL-001: after a reset an engine is as new: the same calls, the same answers, no outputs."""
    engine = ctt.make(*codes, values=(0x1234,))
    first = [engine.exchange(c, k * MS) for k, c in enumerate(calls)]
    engine.reset()
    assert engine.outputs == [None] * 4
    assert [engine.exchange(c, 900 * MS + k * MS) for k, c in enumerate(calls)] == first


# ---------------------------------------------------------------------------------------------- on the line
class LineBench(Bench):
    """A bench that speaks in the words of the worked sequences."""

    def word(self, request):
        """14-bit request -> 7-bit response, None without an answer."""
        got = self.request(pulses(request, 14))
        if not got:
            return None
        error, word = classify([(t - got[0][0], p) for t, p in got], ANSWER_BITS)
        assert error is ErrorClass.OK
        return word

    def words(self, *requests):
        return [self.word(request) for request in requests]

    def activate(self, index, extended=False):
        """WPAR F, then DEXG F, as a master does."""
        assert self.nibble("WPAR", index, 15, extended=extended) == 15
        assert self.nibble("DEXG", index, 15, extended=extended) is not None


def test_w1_w4_on_the_line():
    """SL-009, CT-010: W1 with the repeated call of W4, as words of a slave that was activated."""
    bench = LineBench(Slave(8, id=3, id2=0xC, values=(0x1234,)))
    bench.activate(8)
    assert bench.words(0x041B, 0x0435, 0x0411, 0x042D, 0x042D, 0x0409, 0x0427, 0x0403, 0x0439) == [
        0x01, 0x23, 0x13, 0x31, 0x31, 0x0D, 0x29, 0x07, 0x23]


def test_w2_on_the_line():
    """SL-009, CT-010: W2 as words, to the second channel of an output slave."""
    slave = Slave(9, id=3, id2=5)
    bench = LineBench(slave)
    bench.activate(9)
    assert bench.words(0x0487, 0x04A5, 0x0487, 0x04BB, 0x0487, 0x04A3, 0x0487) == [
        0x15, 0x31, 0x0D, 0x29, 0x07, 0x23, 0x19]
    assert slave.ctt.outputs == [None, 0x2710, None, None]
    bench.call("RES", 9)
    assert slave.ctt.outputs == [None] * 4                      # a reset drops them


def test_w3_on_the_line():
    """SL-009, CT-014: the parameter calls of W3 choose the string; WPAR F brings values back."""
    slave = Slave(8, id=4, id2=0xC, values=(0x1234,), strings={ctt.ID: b"AB", ctt.DIAGNOSIS: b"CD"})
    bench = LineBench(slave)
    bench.activate(8)
    triples = [encode_call("DEXG", 8, (k & 1) << 3 | 7 - k) for k in range(8)]

    def read():
        return sum((bench.word(request_word(call)) >> 2 & 7) << 3 * (7 - k) for k, call in enumerate(triples))
    assert bench.words(0x047B) == [response_word(0xE)] and read() == 0x414201
    assert bench.words(0x0477) == [response_word(0xD)] and read() == 0x434401
    assert bench.words(0x046F) == [response_word(0xB)] and read() == 0
    assert bench.words(0x047D) == [response_word(0xF)]
    assert bench.words(0x041B, 0x0435, 0x0411, 0x042D) == [0x01, 0x23, 0x13, 0x31]


def test_w5_w6_on_the_line():
    """SL-009, CT-020, CT-023: 5A gets a byte with DO2 = 1 and answers an unknown index; 5B has its own conversation."""
    a, b = Slave(5, id=0xA, id2=5, inputs=0, strings=OBJECTS), Slave(37, id=0xA, id2=5, inputs=3, strings=OBJECTS)
    bench = LineBench(a, b)
    bench.activate(5, extended=True)
    bench.activate(37)
    zero, one = (0x02B1, 0x02B7), (0x02BB, 0x02BD)
    sent = [w for bit in "00010000" "00110000" "00000001" for w in (one if bit == "1" else zero)]
    assert set(bench.words(*sent[:-1])) == {0x31}               # idle: clock and data 1
    assert bench.words(sent[-1]) == [0x13]                      # first bit of 90 01
    bits = {0: (0x01, 0x23), 1: (0x13, 0x31)}
    assert bench.words(*[0x02BD] * 31) == [
        w for bit in f"{0x9001:016b}" for w in bits[int(bit)]][1:]
    assert bench.nibble("DEXG", 37, 3) == 0b1111 and a.outputs == 15 and b.outputs == 0b1011


def test_w7_on_the_line():
    """SL-009, CT-030: W7: 5A and 5B change their four outputs, each at its own falling edge of I2."""
    a, b = Slave(5, id=0xA, id2=7, inputs=9), Slave(37, id=0xA, id2=7, inputs=6)
    bench = LineBench(a, b)
    bench.activate(5, extended=True)
    bench.activate(37)
    assert bench.words(0x02B7, 0x0295, 0x02A5) == [response_word(9), response_word(6), response_word(9)]
    assert (a.ctt.outputs[0], b.ctt.outputs[0]) == (0b1010, None)
    assert bench.words(0x0287) == [response_word(6)] and b.ctt.outputs[0] == 0b1010


def test_w8_on_the_line():
    """SL-009, CT-031: W8 as words. DEXG F of the activation is the call before the first answer."""
    slave = Slave(5, id=0xA, id2=0xA, values=(0x3C,))
    bench = LineBench(slave)
    assert bench.nibble("WPAR", 5, 15, extended=True) == 15
    assert bench.words(0x02BD, 0x02BB, 0x02A9, 0x02B7, 0x02A5, 0x02BB) == [0x01, 0x1F, 0x2F, 0x31, 0x01, 0x1F]
    assert slave.ctt.outputs[0] == 0xA5


def test_w9_on_the_line():
    """SL-009, CT-050: W9: three addresses of a CTT5 slave are three plain slaves to the line."""
    slaves = [Slave(number, io=6, id=0, id2=id2, inputs=value)
              for number, id2, value in ((3, 0xB, 0xC), (4, 6, 0xB), (5, 5, 0xA))]
    bench = LineBench(*slaves)
    for number in (3, 4, 5):
        bench.activate(number)
    assert bench.words(0x01B1, 0x0235, 0x02BB) == [0x31, 0x2F, 0x29]
    assert [s.outputs for s in slaves] == [0b1100, 0b1101, 0b1110] and slaves[0].ctt is None


def test_safety_on_the_line():
    """SL-009, CT-060: a repetition within 224 us gets the same word, the next cycle the next one; not before WPAR."""
    bench = LineBench(Slave(5, io=0, id=0xB))
    call = request_pulses(encode_call("DEXG", 5, 15))
    assert bench.request(call) == []
    bench.nibble("WPAR", 5, 15)

    def word(wait_ns):
        got = bench.request(call, wait_ns)
        return classify([(t - got[0][0], p) for t, p in got], ANSWER_BITS)[1] >> 2
    # from last pulse to last pulse: 78 us and the wait
    assert [word(w) for w in (82_000, 145_999, 146_000, MS, MS)] == [1, 1, 1, 5, 6]


def test_answers_lost_on_the_line():
    """SL-009, SL-008, CT-003: an answer that is disturbed on the line costs a repetition and nothing else."""
    slave = Slave(8, id=3, id2=0xC, values=(0x1234,), faults=Faults(parity=0.4))
    bench = LineBench(slave, seed=3)
    call, calls = 0, 0
    bench.nibble = None                                         # answers are judged below
    while not slave.parameter == 15 or slave.dexg_disabled:
        bench.request(request_pulses(encode_call("WPAR", 8, 15)))
    frame, control = 0, 0
    for t in (6, 5, 4, 3, 2, 1, 0):
        call = request_pulses(encode_call("DEXG", 8, control << 3 | t))
        while True:
            calls += 1
            got = bench.request(call)
            error, word = classify([(ns - got[0][0], p) for ns, p in got], ANSWER_BITS)
            if error is ErrorClass.OK:
                break
        assert word >> 5 & 1 == control
        frame, control = frame << 3 | word >> 2 & 7, control ^ 1
    assert frame == 0x1234 << 2 | 1 and calls > 7


def test_spoilt_memory_ends_the_transaction():
    """SL-009, SL-005: with IO and ID lost the slave is a plain one."""
    slave = Slave(0, id=3, id2=0xC, values=(0x1234,))
    bench = LineBench(slave)
    bench.call("ADRA", data=5)
    bench.net.power(False)
    bench.net.power(True)
    bench.wait(MS * 20)
    assert slave.ctt is None and bench.nibble("RDID", 0) == 15
    with pytest.raises(ValueError):
        Slave(5, values=(1,))


def test_supervision_on_the_line():
    """SL-009, CT-013: the outputs of S-7.3 drop when nobody calls for half a second."""
    slave = Slave(9, id=3, id2=4)
    bench = LineBench(slave)
    bench.activate(9)
    for nibble in (0, 8, 0, 8, 0, 8, 1):
        bench.nibble("DEXG", 9, nibble)
    assert slave.ctt.outputs[0] == 0
    bench.wait(499 * MS)
    assert slave.ctt.outputs[0] == 0
    bench.wait(MS)
    assert slave.ctt.outputs[0] is None
