# SPDX-License-Identifier: Apache-2.0
"""Combined transaction type 2: bits, messages, cyclic service; a line that loses, repeats or is late with any call."""
import pytest
from asi import ctt_table as table
from ctt_line import ANSWER_LOST, LATE, OK, REPEATED, REQUEST_LOST, Ctt2, Line, choose
from hypothesis import given, settings
from hypothesis import strategies as st
from native_ctt import load

OV, TV, STRING = 0x10, 0x20, 0x80
S755, S7A5, SBA5 = 0x5F57, 0x5FA7, 0x5FAB
GAP = table.CTT2_GAP_CALLS + 1
MESSAGE = 4
BUSY, ABORTED, NOT_ACTIVE, PROFILE, OVERFLOW, TRANSFER, DEVICE, ARG = -3, -4, -8, -17, -18, -23, -24, -1
ID_CALLS = GAP + 16 * 3 + 16 * 6  # less one: this slave begins its response in the last call of the request


def setup(*defines):
    env = load(*defines)
    env[1].fc_init()
    return env


def message(line, data):
    line.lib.fc_string_bytes()[0:len(data)] = data
    return line.lib.fc_string(line.index, MESSAGE, len(data), line.now)


def exchange(line, data, limit=9000, outcome=OK):
    """-> (status, response)"""
    assert message(line, data) == 0
    assert line.lib.fc_string_status() == BUSY and line.status & STRING
    line.until(lambda: not line.lib.fc_string_open(), limit, outcome)
    assert not line.status & STRING
    return line.lib.fc_string_status(), bytes(line.lib.fc_string_bytes()[0:line.lib.fc_string_length()])


def test_worked_bits_of_the_master():
    """CT-020, CT-021: W5, byte 10 to slave 5A with DO2 = 1 on the line: the first byte of reading the ID object."""
    line = Line(setup(), 5, S7A5, Ctt2(0, extended=True))
    assert line.live == 1
    line.run(GAP + 16)
    low, high0, one, high1 = 0b1100, 0b1101, 0b1110, 0b1111
    assert [sent for sent, _ in line.log] == [0b1111] * GAP + [low, high0] * 3 + [one, high1] + [low, high0] * 4


def test_worked_bits_of_the_slave():
    """CT-020, CT-024: W6, byte 50 as the slave sends it with data on DI2; the swapped slave uses the other line."""
    for swapped in (False, True):
        line = Line(setup(), 5, S7A5, Ctt2(0, extended=True, swapped=swapped)).run(GAP + 47 + 16)
        zero, one = ((0b0000, 0b0100), (0b1000, 0b1100)) if swapped else ((0b0000, 0b1000), (0b0100, 0b1100))
        expected = [n for b in "01010000" for n in (one if b == "1" else zero)]
        assert [answer for _, answer in line.log[GAP + 47:]] == expected


def test_identification():
    """CT-021, CT-020: after activation a gap, then the ID object with 16 calls a byte; nothing more to move for 00."""
    slave = Ctt2(0, extended=True)
    line = Line(setup(), 5, S7A5, slave)
    assert line.until(lambda: line.status, 1000) == ID_CALLS - 1 and line.status == TV
    line.run(100)
    assert slave.requests == [b"\x10\x00\x05"] and line.ai[:2] == [0, 0]


@pytest.mark.parametrize("config, words_in, bytes_out", [
    (0x01, [0xA1], 0), (0x02, [0xA1A2], 0), (0x03, [0xA1A2, 0xA3A4], 0), (0x10, [], 1), (0x22, [0xA1A2], 2),
    (0x33, [0xA1A2, 0xA3A4], 4), (0xBB, [0xA1A2, 0xA3A4], 4), (0x05, [0xA1A2, 0xA3A4, 0xA5A6, 0xA7A8], 0),
    (0x55, [0xA1A2, 0xA3A4, 0xA5A6, 0xA7A8], 8), (0x44, [0xA1A2, 0xA3A4, 0xA5A6], 6), (0x77, [], 0)])
def test_cyclic_values(config, words_in, bytes_out):
    """CT-021, CT-002: lengths from the I/O configuration byte; a single byte is the low half of its word."""
    data = bytes(range(0xA1, 0xA9))
    slave = Ctt2(config)
    slave.inputs_now = lambda: data[:slave.n_in]
    line = Line(setup(), 7, S755, slave)
    line.set_ao(0x1234, 0x5678, 0x9ABC, 0xDEF0)
    line.run(ID_CALLS)
    n_in, n_out = slave.n_in, slave.n_out
    calls = 16 * ((1 + n_in) * (n_in > 0) + (1 + n_out) * (n_out > 0))
    line.run(2 * calls + 1)
    assert line.ai == words_in + [0] * (4 - len(words_in))
    assert line.status & 15 == (1 << len(words_in)) - 1
    assert len(slave.requests) == 1 + 2 * ((n_in > 0) + (n_out > 0))
    put = bytes.fromhex("123456789ABCDEF0")[:bytes_out] if bytes_out != 1 else b"\x34"
    assert slave.puts == [put] * (2 if bytes_out else 0)
    assert line.status & (OV | TV) == (OV | TV if bytes_out else TV)


def test_values_beyond_two_words():
    """CT-021: an A slave has two words in the image; what more it moves is not shown, the neighbour's words stay."""
    slave = Ctt2(0x55, extended=True, inputs=lambda: bytes(range(1, 9)))
    line = Line(setup(), 5, S7A5, slave)
    line.set_ao(0x1111, 0x2222, 0x3333, 0x4444)
    line.run(ID_CALLS + 2 * 16 * 18)
    assert line.ai == [0x0102, 0x0304, 0, 0] and line.status & 15 == 3
    assert slave.puts[0] == bytes.fromhex("1111222200000000")


def test_outputs_of_one_moment():
    """CT-002, CT-021: AODI changes at every call; each put carries one moment."""
    slave = Ctt2(0x33)
    line = Line(setup(), 7, S755, slave).run(ID_CALLS)
    for n in range(16 * 10 * 3):
        line.set_ao(n & 0xFFFF, n & 0xFFFF)
        line.call()
    assert len(slave.puts) == 3 and all(p[:2] == p[2:] for p in slave.puts) and len(set(slave.puts)) == 3


@pytest.mark.parametrize("codes, index, in_mask, out_mask, rest", [
    (S755, 7, 0b0011, 0b1100, 0), (S7A5, 5, 0b0011, 0b0100, 0), (S7A5, 37, 0b0011, 0b0100, 0), (SBA5, 5, 0, 0, 0b0100)])
def test_parallel_bits(codes, index, in_mask, out_mask, rest):
    """CT-023: DI0, DI1, DO2 (7.5.5: DO3 too) are ordinary bits while messages run; B.A.5 has none."""
    slave = Ctt2(0x22, extended=codes != S755)
    line = Line(setup(), index, codes, slave)
    for n in range(300):
        line.outputs = n * 7 & 15
        slave.inputs = n * 5 & 3
        line.call()
        sent, answer = line.log[-1]
        wanted = ((line.outputs ^ 15) & out_mask) | rest
        line.run(1)
        assert slave.sent & (out_mask | rest) == wanted & (out_mask | rest)
        assert line.lib.fc_inputs(index, answer) == n * 5 & in_mask
    assert line.status & TV


@pytest.mark.parametrize("request_, response, status", [
    ("10 05 03", "50 0A 0B 0C", 0), ("11 05 02 01 02", "51", 0), ("12 00 04", "52 01 02 03 04", 0),
    ("13 09 00", "53", 0),
    ("1D 01 02 01 77", "5D 08 09", 0), ("10 05 00", "50", 0), ("10 05 03", "90 01", DEVICE),
    ("11 05 01 09", "91 02", DEVICE), ("12 05 03", "92 02 11 22", DEVICE), ("13 05 00", "93 03", DEVICE),
    ("1D 01 02 00", "9D 01 02 03 04 05", DEVICE)])
def test_messages(request_, response, status):
    """CT-021, CT-022: all codes and errors; error objects of unknown length end with the gap; values go on after."""
    request_, response = bytes.fromhex(request_), bytes.fromhex(response)
    slave = Ctt2(0x22, inputs=lambda: b"\xCA\xFE", answers={request_: response})
    line = Line(setup(), 7, S755, slave).run(ID_CALLS + 100)
    for _ in range(2):
        assert exchange(line, request_) == (status, response)
    line.run(200)
    assert line.ai[0] == 0xCAFE and line.status == TV | OV | 1


def test_long_message():
    """CT-020, CT-022: 200 bytes cost 16 calls each, and the cyclic service pauses meanwhile."""
    request_ = bytes([0x10, 0x42, 200])
    response = b"\x50" + bytes(range(200))
    slave = Ctt2(0x22, answers={request_: response})
    line = Line(setup(), 7, S755, slave).run(ID_CALLS + 100)
    assert message(line, request_) == 0
    line.until(lambda: slave.requests[-1] != request_ and slave.levels_left() == 0, 100)
    assert line.until(lambda: not line.lib.fc_string_open(), 4000) <= 16 * (3 + 201) + 100
    assert bytes(line.lib.fc_string_bytes()[0:201]) == response
    assert slave.requests.count(b"\x00") + slave.requests.count(b"\x01\0\0") < 6


def test_refused_messages():
    """CT-022: a request without code or of a wrong length, another kind of string, a response that has no room."""
    line = Line(setup(), 7, S755, Ctt2(0x22))
    for data in (b"", b"\x10\x00", b"\x10\x00\x05\x06", b"\x11\x00\x02\x01", b"\x20\x00\x00", b"\x1D\x01\x02",
                 b"\x1D\x01\x02\x01", b"\x00\x00\x00"):
        assert message(line, data) == ARG
    assert message(line, b"\x10\x00\xE0") == OVERFLOW
    assert line.lib.fc_string(7, MESSAGE, 225, 0) == OVERFLOW
    assert line.lib.fc_string(7, 0, 3, 0) == PROFILE
    assert line.lib.fc_string(6, MESSAGE, 3, 0) == NOT_ACTIVE
    assert not line.status & STRING
    assert message(line, b"\x10\x00\x05") == 0
    assert message(line, b"\x10\x00\x05") == BUSY
    line.lib.fc_close(7)
    assert line.lib.fc_string_status() == ABORTED and line.status == 0


def test_response_time_out():
    """CT-022: no response for 10 s ends a message; no cyclic response takes the values away; both recover."""
    slave = Ctt2(0x02, inputs=lambda: b"\xCA\xFE")
    line = Line(setup(), 7, S755, slave).run(ID_CALLS + 100)
    status, _ = exchange(line, b"\x10\x05\x01")
    assert status == TRANSFER
    line.run(16 * 4 + GAP)
    assert line.ai[0] == 0xCAFE and line.status == TV | 1
    slave.inputs_now = lambda: None
    line.run(16 * 3 + 1990)
    assert line.status == TV | 1
    line.run(60)
    assert line.status == 0 and line.ai[0] == 0
    slave.inputs_now = lambda: b"\xBE\xEF"
    line.until(lambda: line.status == TV | 1, 3000)
    assert line.ai[0] == 0xBEEF


def test_clock_that_never_rests():
    """CT-022, FN-031, CT-005: a slave that moves its clock for ever leaves no gap to ask in: the values are invalid and
    an open message ends after the response time-out, at the latest; when the clock rests everything goes on."""
    class Restless(Ctt2):
        mad = False
        toggle = 0

        def call(self, nibble):
            answer = super().call(nibble)
            if self.mad:
                self.toggle ^= 1 << table.CTT2_DI_CLOCK
                answer = answer & 3 | self.toggle
            return answer
    slave = Restless(0x11, inputs=lambda: b"\x5A")
    line = Line(setup(), 7, S755, slave).run(ID_CALLS + 100)
    assert line.status & 1 and line.ai[0] == 0x5A
    slave.mad = True
    ten_seconds = table.CTT2_RESPONSE_MS // 5 + 400
    for _ in range(2):                                  # the second one begins in the gap that never comes
        assert message(line, b"\x10\x01\x02") == 0
        line.until(lambda: not line.lib.fc_string_open(), ten_seconds)
        assert line.lib.fc_string_status() == TRANSFER and not line.status & STRING
    assert not line.status & (1 | TV) and line.ai[0] == 0
    slave.mad = False
    slave.answers[b"\x10\x01\x02"] = b"\x50\x12\x34"
    line.run(40)
    assert exchange(line, b"\x10\x01\x02") == (0, b"\x50\x12\x34") and line.until(lambda: line.status & 1, 400) >= 0


def test_broken_message_is_tried_again():
    """CT-020, CT-003: a lost answer makes the slave's message short: a gap, then again; twice the values stay."""
    slave = Ctt2(0x02, inputs=lambda: b"\xCA\xFE")
    line = Line(setup(), 7, S755, slave).run(ID_CALLS + 48)
    for n in range(3):
        line.until(lambda: slave.levels_left() == 20, 100)
        line.call(ANSWER_LOST).run(19 + GAP)
        assert (line.status, line.ai[0]) == ((1, 0xCAFE) if n < 2 else (0, 0))
    line.until(lambda: line.status == TV | 1, 100)
    assert line.ai[0] == 0xCAFE


def test_broken_error_response():
    """CT-022, CT-003: an error response of unknown length that lost a bit is no whole number of bytes: TRANSFER."""
    request_ = b"\x12\x05\x01"
    slave = Ctt2(0, answers={request_: b"\x92\x02\x11"})
    line = Line(setup(), 7, S755, slave).run(ID_CALLS)
    assert message(line, request_) == 0
    line.until(lambda: slave.levels_left() == 9, 200)
    line.call(ANSWER_LOST).until(lambda: not line.lib.fc_string_open(), 100)
    assert line.lib.fc_string_status() == TRANSFER
    assert exchange(line, request_) == (DEVICE, b"\x92\x02\x11")


def test_two_slaves_one_message():
    """CT-022: a message belongs to one slave; the cyclic service of the other one goes on, and it may even leave."""
    env = setup()
    one = Line(env, 7, S755, Ctt2(0x02, inputs=lambda: b"\x11\x22"))
    two = Line(env, 9, S755, other := Ctt2(0x02, inputs=lambda: b"\x33\x44"))
    assert message(one, b"\x10\x00\x05") == 0
    for _ in range(ID_CALLS + 60):
        two.call()
    assert two.ai[0] == 0x3344 and b"\x10\x00\x05" in other.requests and env[1].fc_string_open()
    env[1].fc_close(9)
    one.until(lambda: not env[1].fc_string_open(), 500)
    assert env[1].fc_string_status() == 0 and env[1].fc_string_length() == 6


def test_busy_slave():
    """CT-021: a slave that is busy when its ID object is read is asked again, and its lines are not swapped."""
    slave = Ctt2(0x02, inputs=lambda: b"\xCA\xFE")
    good = slave.answers[b"\x10\x00\x05"]
    slave.answers[b"\x10\x00\x05"] = b"\x90\x04"
    line = Line(setup(), 7, S755, slave).run(3000)
    assert line.status == 0 and len(slave.requests) > 20
    slave.answers[b"\x10\x00\x05"] = good
    line.until(lambda: line.status == TV | 1, 400)


def test_wrong_answers():
    """CT-021, CT-022: a response to something else, or an error response without end, is a broken transfer."""
    slave = Ctt2(0, answers={b"\x10\x05\x01": b"\x51\x00", b"\x12\x05\x01": b"\x92" + bytes(240),
                             b"\x12\x06\x01": b"\x92"})
    line = Line(setup(), 7, S755, slave).run(ID_CALLS)
    for request_ in slave.answers.keys() - {b"\x10\x00\x05"}:
        assert exchange(line, request_)[0] == TRANSFER, request_
    assert exchange(line, b"\x10\x00\x05")[0] == 0


@pytest.mark.parametrize("swapped", [False, True])
def test_swapped_lines(swapped):
    """CT-024: after 5 s without the ID object data and clock are swapped; known again after the slave came back."""
    slave = Ctt2(0x02, inputs=lambda: b"\xCA\xFE", swapped=swapped)
    line = Line(setup(), 7, S755, slave)
    line.run(990)
    assert bool(line.status & TV) != swapped
    line.until(lambda: line.status == TV | 1, 400)
    assert line.ai[0] == 0xCAFE
    line.lib.fc_close(7)
    assert line.ai[0] == 0 and line.status == 0
    slave = Ctt2(0x02, inputs=lambda: b"\xBE\xEF", swapped=swapped)
    again = Line((line.ffi, line.lib), 7, S755, slave).run(ID_CALLS + 48)
    assert again.ai[0] == 0xBEEF


def test_swapped_and_back_and_no_message():
    """CT-024, CT-022: a dead slave: both ways are tried in turn, and a message that waits ends with an error."""
    slave = Ctt2(0x02, inputs=lambda: b"\xCA\xFE")
    true_call, slave.call = slave.call, lambda nibble: 12
    line = Line(setup(), 7, S755, slave)
    assert exchange(line, b"\x10\x05\x01")[0] == TRANSFER and len(line.log) == 1000
    line.run(1000)
    slave.call = true_call
    line.run(GAP + GAP + ID_CALLS + 48)
    assert line.ai[0] == 0xCAFE


@pytest.mark.parametrize("name, value", [("MSB_FIRST", 0), ("RISING_EDGE", 0), ("IDLE", 2), ("IDLE", 0),
                                         ("GAP_CALLS", 12)])
def test_alternatives(monkeypatch, name, value):
    """CT-020: the other choices of the table compile and work, each alone."""
    choose(monkeypatch, f"ASI_CTT2_{name}={value}")
    slave = Ctt2(0x22, inputs=lambda: b"\xCA\xFE", answers={b"\x12\x05\x01": b"\x92\x01\x02"})
    line = Line(setup(f"ASI_CTT2_{name}={value}"), 7, S755, slave)
    line.set_ao(0x8421)
    line.run(ID_CALLS + 16 * 12 + 30)
    assert line.ai[0] == 0xCAFE and slave.puts[0] == b"\x84\x21" and line.status == OV | TV | 1
    assert exchange(line, b"\x12\x05\x01") == (DEVICE, b"\x92\x01\x02")


def test_slow_slave():
    """CT-021: a response may begin late; the silence before it is no gap."""
    slave = Ctt2(0x02, inputs=lambda: b"\xCA\xFE", delay=50)
    line = Line(setup(), 7, S755, slave).run(ID_CALLS + 50 + 48 + 50)
    assert line.ai[0] == 0xCAFE and line.status == TV | 1


@settings(max_examples=40, deadline=None)
@given(st.lists(st.sampled_from((OK,) * 12 + (REQUEST_LOST, ANSWER_LOST, REPEATED, LATE)), max_size=700), st.booleans())
def test_bad_line(outcomes, extended):
    """CT-002, CT-003, CT-020: any loss, repetition or late nibble: values shown and puts are ones that were given."""
    count = [0]

    def inputs():
        count[0] += 1
        return bytes([count[0] & 0xFF, ~count[0] & 0xFF] * 2)
    slave = Ctt2(0x33, inputs=inputs, extended=extended)
    line = Line(setup(), 7, S7A5 if extended else S755, slave)
    for n, outcome in enumerate(outcomes):
        line.set_ao(n, ~n & 0xFFFF)
        line.call(outcome)
        if line.status & 1:
            word = line.ai[0]
            assert word >> 8 == ~word & 0xFF and line.ai[1] == word and 1 <= word >> 8 <= count[0] & 0xFF
    for put in slave.puts:
        assert int.from_bytes(put[:2], "big") ^ int.from_bytes(put[2:], "big") == 0xFFFF
    assert set(slave.requests) <= {b"\x10\x00\x05", b"\x00"} | {b"\x01" + p for p in slave.puts}
    line.set_ao(0x1234, 0x5678)
    line.run(900)
    assert line.status == OV | TV | 3 and slave.puts[-1] == b"\x12\x34\x56\x78"


@settings(max_examples=30, deadline=None)
@given(st.lists(st.sampled_from((OK,) * 12 + (REQUEST_LOST, ANSWER_LOST, REPEATED, LATE)), max_size=300))
def test_messages_on_a_bad_line(outcomes):
    """CT-022, CT-003: a message arrives whole or ends with an error; the request is never changed."""
    request_, response = b"\x1D\x05\x04\x02\xA5\x5A", b"\x5D\x11\x22\x33\x44"
    slave = Ctt2(0x22, answers={request_: response})
    line = Line(setup(), 7, S755, slave).run(ID_CALLS + 30)
    assert message(line, request_) == 0
    disturbed = iter(outcomes)
    line.until(lambda: line.call(next(disturbed, OK)) and not line.lib.fc_string_open(), 6000)
    assert slave.requests.count(request_) == 1
    if line.lib.fc_string_status() == 0:
        assert bytes(line.lib.fc_string_bytes()[0:line.lib.fc_string_length()]) == response
    else:
        assert line.lib.fc_string_status() == TRANSFER
