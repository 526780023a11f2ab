# SPDX-License-Identifier: Apache-2.0
"""Combined transactions of the slave model (SL-009): worked sequences, and small masters that lose and repeat calls.

The masters here follow the rules of the line as a master has them; they know nothing of the model but its nibbles.
"""
from unittest.mock import patch

import pytest
from asi import ctt_table as table
from asi.telegram import encode_call, request_pulses, request_word, response_word
from hypothesis import given, settings
from hypothesis import strategies as st

from cocotb_tests.models import ctt

MS = 1_000_000
CYCLE_NS, REPEAT_NS = 5 * MS, 160_000
GOOD, NO_REQUEST, NO_ANSWER = "good", "request lost", "answer lost"
LOSSES = st.lists(st.sampled_from((GOOD, GOOD, GOOD, NO_REQUEST, NO_ANSWER)), max_size=200)
# never both attempts of a call without an answer
SINGLE_LOSSES = LOSSES.map(lambda steps: [s for step in steps for s in ((step,) if step == GOOD else (step, GOOD))])


def choices(**values):
    """The table with other choices."""
    return patch.multiple(table, **values)


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
    with pytest.raises(ValueError, match="8 triples"):
        ctt.make(7, 1, 8, triples=8)


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
