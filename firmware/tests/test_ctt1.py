# SPDX-License-Identifier: Apache-2.0
"""Combined transaction type 1: values, substitutes, strings; a line that loses, repeats or is late with any call."""
import pytest
from ctt_line import ANSWER_LOST, LATE, OK, OUTCOMES, REPEATED, REQUEST_LOST, Ctt1, Line, choose
from hypothesis import given, settings
from hypothesis import strategies as st
from native_ctt import load

OV, TV, TRANSPARENT, STRING = 0x10, 0x20, 0x40, 0x80
S73C, S73D, S73E, S735, S736, S74C, S744 = 0xCF37, 0xDF37, 0xEF37, 0x5F37, 0x6F37, 0xCF47, 0x4F47
STATUS = {"ok": 0, "arg": -1, "state": -2, "busy": -3, "aborted": -4, "not active": -8, "profile": -17, "overflow": -18,
          "transfer": -23}
ALTERNATIVES = [("TOGGLE_POS", 0), ("MSB_LEFT", 0), ("COUNT_UP", 1), ("ECHO_INVERTED", 1), ("E_REVERSED", 1),
                ("START_TOGGLE", 1), ("INVERT_OUT", 1)]


def setup(*defines):
    env = load(*defines)
    env[1].fc_init()
    return env


def feeder(values, overflow=0, valid=1):
    """each value once, then the last again"""
    queue = list(values)
    return lambda channel: (queue.pop(0) if len(queue) > 1 else queue[0], overflow, valid)


def test_worked_sequence_input():
    """CT-010, CT-002: W1, value 1234 nibble by nibble; the value appears with the last triple and not before."""
    line = Line(setup(), 8, S73C, Ctt1(feed=feeder([0x1234])))
    assert (line.live, line.ai[0], line.status) == (1, 0x7FFF, 0)
    for n in range(6):
        line.call()
        assert line.ai[0] == 0x7FFF and not line.status & 1, n
    line.call()
    assert line.log == [(0b0110, 0b0000), (0b1101, 0b1000), (0b0100, 0b0100), (0b1011, 0b1100), (0b0010, 0b0011),
                        (0b1001, 0b1010), (0b0000, 0b0001)]
    assert (line.ai[0], line.status, line.due) == (0x1234, TV | 1, 0b1110)


def test_worked_sequence_output():
    """CT-010, CT-013: W2, channel 2 of two, value 2710 nibble by nibble."""
    slave = Ctt1(output=True, channels=2)
    env = setup()
    env[1].fc_ao()[env[1].fc_word(9) + 1] = 0x2710
    line = Line(env, 9, S735, slave).run(7)  # channel 1 first, 0
    line.run(7)
    # 7 calls per value, so channel 2 has the other control bits
    assert [(a ^ 8, b ^ 8) for a, b in line.log[7:]] == [
        (0b0001, 0b0101), (0b1001, 0b1100), (0b0001, 0b0011), (0b1110, 0b1010), (0b0001, 0b0001), (0b1000, 0b1000),
        (0b0001, 0b0110)]
    assert slave.values_taken == {0: [0], 1: [0x2710]}
    assert line.status == OV | TV


def test_lost_answer_costs_one_call():
    """CT-003: W4, the answer of call 4 is lost: the nibble is sent again, 8 calls, the same value."""
    line = Line(setup(), 8, S73C, Ctt1(feed=feeder([0x1234]))).run(3).call(ANSWER_LOST).run(3)
    assert line.ai[0] == 0x7FFF
    line.call()
    assert line.log[3] == (0b1011, None) and line.log[4] == (0b1011, 0b1100)
    assert line.ai[0] == 0x1234 and len(line.log) == 8


def test_repetition_in_the_cycle_costs_nothing():
    """CT-003: the sequencer's repetition has the same nibble; still 7 calls a value."""
    line = Line(setup(), 8, S73C, Ctt1(feed=feeder([0x1234]))).run(7, REPEATED)
    assert line.ai[0] == 0x1234


def test_seven_calls_a_value():
    """CT-003, CT-010: undisturbed, each value needs 7 calls, in and out, whatever the number of channels."""
    seen = []
    line = Line(setup(), 8, S73E, Ctt1(channels=4, feed=lambda channel: (seen.append(channel) or len(seen), 0, 1)))
    line.run(70)
    assert len(seen) == 10 and seen == [0, 1, 2, 3] * 2 + [0, 1]
    assert line.ai == [9, 10, 7, 8] and line.status == TV | 15
    slave = Ctt1(output=True, channels=4)
    line = Line(setup(), 8, S736, slave).run(70)
    assert [channel for channel, _ in slave.taken] == [0, 1, 2, 3] * 2 + [0, 1]


@pytest.mark.parametrize("id2, channels", [(0xC, 1), (0xD, 2), (0xE, 4), (0xF, 4)])
def test_channels(id2, channels):
    """CT-010: ID2 tells the number of channels; 11 is four. A channel beyond it is thrown away."""
    line = Line(setup(), 8, id2 << 12 | 0xF37, Ctt1(channels=8, feed=lambda channel: (0x1000 + channel, 0, 1))).run(56)
    assert line.ai[:channels] == [0x1000 + k for k in range(channels)]
    assert line.ai[channels:] == [0] * (4 - channels)
    assert line.status & 15 == (1 << channels) - 1


@pytest.mark.parametrize("codes, substitute", [(S73C, 0x7FFF), (0x8F37, 0), (S74C, 0x7FFF), (0x8F47, 0x7FFF)])
@pytest.mark.parametrize("overflow, valid", [(0, 0), (1, 1), (1, 0)])
def test_substitute_values(codes, substitute, overflow, valid):
    """CT-011, CT-005: before the first value, V = 0, O = 1, toggle error and out of LAS; transparent bits get 0."""
    state = {"o": 0, "v": 1}
    slave = Ctt1(feed=lambda channel: (0x5A5A, state["o"], state["v"]))
    line = Line(setup(), 8, codes, slave)
    transparent = TRANSPARENT if codes == 0x8F37 else 0
    assert (line.ai[0], line.status) == (substitute, transparent)
    line.run(7)
    assert (line.ai[0], line.status) == (0x5A5A, transparent | TV | 1)
    state.update(o=overflow, v=valid)
    line.run(7)
    assert (line.ai[0], line.status) == (substitute, transparent | TV)
    state.update(o=0, v=1)
    line.run(7)
    assert (line.ai[0], line.status) == (0x5A5A, transparent | TV | 1)
    line.lib.fc_close(8)
    assert (line.ai[0], line.status) == (substitute, 0)


def test_toggle_error():
    """CT-012, CT-011: wrong control bit for 1000 ms: substitute, TV = 0; then a fresh value."""
    slave = Ctt1(channels=2, feed=lambda channel: (0x1111 * (channel + 1), 0, 1))
    line = Line(setup(), 8, S73D, slave).run(14 + 3)
    true_call = slave.call
    slave.call = lambda nibble: true_call(nibble) ^ 8
    line.run(199)
    assert line.ai[:2] == [0x1111, 0x2222] and line.status == TV | 3
    before = line.due
    line.call()
    assert line.ai[:2] == [0x7FFF, 0x7FFF] and line.status == 0
    assert line.due == before  # the slave may have served it: only its answer shows that it may be left
    slave.call = true_call
    line.run(1 + 7)
    assert line.status & 3 in (1, 2)
    line.run(7)
    assert line.ai[:2] == [0x1111, 0x2222] and line.status == TV | 3


def test_toggle_error_of_outputs():
    """CT-012, CT-013: an output slave that does not answer: OV and TV go, and come back; no value is torn."""
    slave = Ctt1(output=True)
    line = Line(setup(), 9, 0x4F37, slave)
    line.set_ao(0x1234)
    line.run(7 + 7 + 3)
    assert line.status == OV | TV and slave.values_taken == {0: [0, 0x1234]}
    line.run(50, REQUEST_LOST)
    line.set_ao(0x4321)
    line.run(4)                         # 250 ms: the slave goes on where it was, with the value that had begun
    assert slave.values_taken[0][2:] == [0x1234] and line.status == OV | TV
    line.run(7 + 3)
    line.run(200, REQUEST_LOST)
    assert line.status == 0
    line.set_ao(0x5432)                 # 1 s: it has given the value up and asks for the first triple
    line.until(lambda: len(slave.taken) > 4, 7 + 2)
    assert slave.values_taken[0][3:] == [0x4321, 0x5432] and line.status == OV | TV


def test_outputs_that_the_slave_does_not_take():
    """CT-013: a slave that goes on naming triples but never the first one: OV ends 3.5 s after its last value."""
    slave = Ctt1(output=True)
    line = Line(setup(), 9, 0x4F37, slave).run(7)
    assert line.status == OV | TV
    true_call = slave.call
    slave.call = lambda nibble: (true_call(nibble) & 8) | 3
    line.run(698)
    assert line.status == OV | TV
    line.run(2)
    assert line.status == TV
    slave.call = lambda nibble: (true_call(nibble) & 8) | 7  # no triple of a value: the first one is meant
    line.run(3)
    assert line.due & 7 == 0  # E again and again, as asked


def test_value_of_one_moment():
    """CT-013, CT-002: AODI changes while a value is on its way; the slave gets the old one, then the new one."""
    slave = Ctt1(output=True, channels=2)
    line = Line(setup(), 9, S735, slave).run(14)
    line.set_ao(0xAAAA, 0x5555)
    for n in range(70):
        line.set_ao(0xAAAA if n % 2 else 0x5555, 0x1234 if n % 3 else 0xFEDC)
        line.call()
    assert set(slave.values_taken[0]) <= {0, 0xAAAA, 0x5555} and set(slave.values_taken[1]) <= {0, 0x1234, 0xFEDC}
    assert len(slave.values_taken[0]) + len(slave.values_taken[1]) == 12


@pytest.mark.parametrize("name, value", ALTERNATIVES)
@pytest.mark.parametrize("output", [False, True])
def test_alternatives(monkeypatch, name, value, output):
    """CT-010, CT-014: the other choices of the table compile and work, each alone; strings too."""
    define = f"ASI_CTT1_{name}={value}"
    choose(monkeypatch, define)
    env = setup(define)
    # the line rests at F: where the first call has its control bit too, it is served as a repetition and made again
    late = name in ("START_TOGGLE", "INVERT_OUT")
    strings = {0xE: bytes([0x21, 0x80, 3, 4, 5, 1])}
    if output:
        slave = Ctt1(output=True, channels=2, strings=strings)
        line = Line(env, 9, 0x5F47, slave)
        line.set_ao(0x1234, 0xBEEF)
        line.run(7 * 4 + late)
        assert slave.values_taken == {0: [0x1234 if late else 0, 0x1234], 1: [0xBEEF, 0xBEEF]}
    else:
        slave = Ctt1(channels=2, feed=lambda channel: (0x1234 << channel, 0, 1), strings=strings)
        line = Line(env, 8, 0xDF47, slave)
        line.run(14 + late)
        assert line.ai[:2] == [0x1234, 0x2468]
    assert read_string(line, 0xE, 0) == strings[0xE]
    assert write_string(line, bytes(range(9)))
    assert slave.written == bytes([0, 1, 2 | 3, 3, 4, 7, 6, 7, 9])


@pytest.mark.parametrize("triples", range(3, 8))
@pytest.mark.parametrize("id_", [1, 2])
def test_shorter_values(id_, triples):
    """CT-015: S-7.1 and S-7.2 with 3 .. 7 triples a value, left-aligned, two channels, in and out; not transparent."""
    env = setup(f"ASI_CTT1_TRIPLES_7{id_}={triples}") if triples < 7 else setup()
    slave = Ctt1(channels=2, triples=triples, feed=lambda channel: (0xFEDC >> channel, 0, 1))
    line = Line(env, 3, 0x9F07 | id_ << 4, slave)
    line.run(triples - 1)
    assert line.ai[0] == 0x7FFF
    line.run(1 + triples)
    mask = 0xFFFF << 3 * (7 - triples) & 0xFFFF
    assert line.ai[:2] == [0xFEDC & mask, 0x7F6E & mask] and line.status == TV | 3
    slave = Ctt1(output=True, channels=2, triples=triples)
    line = Line(env, 3, 0x1F07 | id_ << 4, slave)
    line.set_ao(0x8421, 0xFFFF)
    line.run(3 * triples)
    assert slave.values_taken == {0: [0, 0x8421 & mask], 1: [mask]}


# ---------------------------------------------------------------- strings

def enter(line, parameter):
    line.until(lambda: line.lib.fc_hold(line.index), 20)
    line.slave.wpar(parameter)


def leave(line):
    line.slave.wpar(0xF)
    line.lib.fc_release(line.index, line.now)


def read_string(line, parameter, kind, limit=2000):
    enter(line, parameter)
    assert line.lib.fc_string(line.index, kind, 0, line.now) == 0
    assert line.status & STRING and line.lib.fc_string_status() == STATUS["busy"]
    line.until(lambda: not line.lib.fc_string_open(), limit)
    leave(line)
    return bytes(line.lib.fc_string_bytes()[0:line.lib.fc_string_length()])


def write_string(line, data, limit=2000):
    enter(line, 0x7)
    line.lib.fc_string_bytes()[0:len(data)] = data
    assert line.lib.fc_string(line.index, 3, len(data), line.now) == 0
    line.until(lambda: not line.lib.fc_string_open(), limit)
    leave(line)
    return line.lib.fc_string_status() == 0


def text(n):
    """n bytes as an S-7.4 slave has them: F in all sequences but the last, V in all"""
    data = bytearray((7 * k + 3) & 0xFF for k in range(n))
    for k in range(2, n, 3):
        data[k] = data[k] & 0xFC | (3 if k < n - 1 else 1)
    return bytes(data)


def test_worked_string():
    """CT-014: W3, bytes 41 42 03: triples 010 000 010 100 001 000 000 011, numbered 7 .. 0."""
    slave = Ctt1(strings={0xD: bytes([0x41, 0x42, 3, 0x43, 0x44, 1])})
    line = Line(setup(), 8, S74C, slave).run(7)
    enter(line, 0xD)
    start = len(line.log)
    assert line.lib.fc_string(8, 1, 0, line.now) == 0
    line.call().run(16)
    calls = line.log[start + 1:start + 9]
    assert [a & 7 for a, _ in calls] == [7, 6, 5, 4, 3, 2, 1, 0]
    assert [b & 7 for _, b in calls] == [0b010, 0b000, 0b010, 0b100, 0b001, 0b000, 0b000, 0b011]
    assert not line.lib.fc_string_open() and line.lib.fc_string_length() == 6
    leave(line)


@pytest.mark.parametrize("size", [3, 6, 9, 219])
@pytest.mark.parametrize("kind, parameter", [(0, 0xE), (1, 0xD), (2, 0xB)])
def test_read_strings(size, kind, parameter):
    """CT-014: ID, diagnosis and parameter string up to 219 bytes, 8 calls a sequence; values around it are whole."""
    slave = Ctt1(feed=feeder([0x1234]), strings={parameter: text(size)})
    line = Line(setup(), 8, S74C, slave).run(10)
    before = len(line.log)
    assert read_string(line, parameter, kind) == text(size)
    assert len(line.log) - before <= size // 3 * 8 + 3
    assert line.ai[0] == 0x1234 and not line.status & STRING
    line.run(8)
    assert line.ai[0] == 0x1234 and line.status == TV | 1


@pytest.mark.parametrize("size", [3, 6, 219])
@pytest.mark.parametrize("output", [False, True])
def test_write_strings(size, output):
    """CT-014: a parameter string to an input and an output slave; F and V are made by the master."""
    slave = Ctt1(output=output, feed=feeder([0x1234]))
    line = Line(setup(), 8, S744 if output else S74C, slave)
    line.set_ao(0x7007)
    line.run(10)
    assert write_string(line, bytes(range(size)))
    expected = bytearray(range(size))
    for k in range(2, size, 3):
        expected[k] = expected[k] & 0xFC | (3 if k < size - 1 else 1)
    assert slave.written == bytes(expected)
    line.run(16)
    if output:
        assert set(slave.values_taken[0]) == {0, 0x7007} and line.status == OV | TV
    else:
        assert line.ai[0] == 0x1234


def test_string_of_an_output_slave():
    """CT-014: strings are read from an output slave as well; its next value is whole."""
    slave = Ctt1(output=True, strings={0xE: text(9)})
    line = Line(setup(), 8, S744, slave)
    line.set_ao(0xC0DE)
    line.run(9)
    assert read_string(line, 0xE, 0) == text(9)
    line.run(16)
    assert set(slave.values_taken[0]) == {0, 0xC0DE}


def test_string_errors():
    """CT-014, CT-003: V = 0 breaks a string off; more than 219 bytes overflow; refusals change nothing."""
    bad = bytearray(text(9))
    bad[5] &= 0xFE
    endless = bytes([1, 2, 3] * 80)
    line = Line(setup(), 8, S74C, Ctt1(feed=feeder([0x1234]), strings={0xE: bytes(bad), 0xD: endless})).run(8)
    lib = line.lib
    assert read_string(line, 0xE, 0) == text(9)[:3] and lib.fc_string_status() == STATUS["transfer"]
    assert len(read_string(line, 0xD, 1)) == 219 and lib.fc_string_status() == STATUS["overflow"]
    line.run(8)
    assert line.ai[0] == 0x1234
    # not held; another kind; too long; not whole sequences
    assert lib.fc_string(8, 0, 0, line.now) == STATUS["state"]
    assert lib.fc_string(8, 4, 3, line.now) == STATUS["profile"]
    assert lib.fc_string(9, 0, 0, line.now) == STATUS["not active"]
    assert lib.fc_string(64, 0, 0, line.now) == STATUS["not active"]
    enter(line, 7)
    assert [lib.fc_string(8, 3, n, line.now) for n in (0, 4, 222)] == [STATUS[s] for s in ("arg", "arg", "overflow")]
    assert lib.fc_string(8, 3, 3, line.now) == 0
    assert lib.fc_string(8, 3, 3, line.now) == STATUS["busy"]
    leave(line)  # given up
    assert lib.fc_string_status() == STATUS["aborted"] and not lib.fc_string_open()
    other = Line((line.ffi, lib), 9, S73C, Ctt1())
    assert lib.fc_string(9, 0, 0, other.now) == STATUS["profile"]
    lib.fc_close(9)


def test_string_timeout_and_close():
    """CT-014, CT-005: a slave silent for 1000 ms breaks the string off; a slave out of LAS aborts it."""
    slave = Ctt1(feed=feeder([0x1234]), strings={0xE: text(30)})
    line = Line(setup(), 8, S74C, slave).run(8)
    enter(line, 0xE)
    assert line.lib.fc_string(8, 0, 0, line.now) == 0
    line.run(20).run(200, REQUEST_LOST)
    assert not line.lib.fc_string_open() and line.lib.fc_string_status() == STATUS["transfer"]
    line.run(250, REQUEST_LOST)  # held: nothing more to break off
    leave(line)
    line.run(9)
    assert line.ai[0] == 0x1234 and line.status == TV | 1
    enter(line, 0xE)
    assert line.lib.fc_string(8, 0, 0, line.now) == 0
    line.run(10)
    line.lib.fc_close(8)
    assert not line.lib.fc_string_open() and line.lib.fc_string_status() == STATUS["aborted"]
    assert line.status == 0 and line.ai[0] == 0x7FFF


def test_slave_that_never_has_enough():
    """CT-014: a slave that wants the first triple for ever; the string ends."""
    slave = Ctt1()
    line = Line(setup(), 8, S74C, slave).run(8)
    enter(line, 7)
    true_call = slave.call
    slave.call = lambda nibble: (true_call(nibble) & 8) | 7
    line.lib.fc_string_bytes()[0:6] = bytes(6)
    assert line.lib.fc_string(8, 3, 6, line.now) == 0
    assert line.until(lambda: not line.lib.fc_string_open(), 100) < 60
    assert line.lib.fc_string_status() == STATUS["transfer"]


def test_slave_that_wants_triples_again():
    """CT-014, CT-003: a writing slave names the triples: any of the sequence again, the first one only for the next."""
    slave = Ctt1()
    line = Line(setup(), 8, S74C, slave).run(8)
    enter(line, 7)
    wants = iter([6, 5, 4, 3, 2, 1, 0, 3, 2, 1, 0, 7, 6, 5, 4, 3, 2, 7, 6, 5, 4, 3, 2, 1, 0, 5])
    slave.call = lambda nibble: (nibble & 8) | next(wants)
    line.lib.fc_string_bytes()[0:6] = bytes([0xFA, 0xC6, 0x88, 0x12, 0x34, 0x57])
    assert line.lib.fc_string(8, 3, 6, line.now) == 0
    slave.served_before = len(line.log) + 1
    true_call, slave.call = slave.call, lambda nibble: nibble & 8  # the nibble that was held
    line.call()
    slave.call = true_call
    line.until(lambda: not line.lib.fc_string_open(), 40)
    assert line.lib.fc_string_status() == 0 and next(wants, None) is None
    one, two = 0xFAC688 | 3, 0x123457 & ~2 | 1
    order = [(one, t) for t in (7, 6, 5, 4, 3, 2, 1, 0, 3, 2, 1, 0)] + [(two, t) for t in (7, 6, 5, 4, 3, 2)]
    order += [(two, t) for t in (7, 6, 5, 4, 3, 2, 1, 0)]
    assert [sent & 7 for sent, _ in line.log[slave.served_before:]] == [f >> 3 * t & 7 for f, t in order]


def test_order_of_hold_and_string():
    """CT-014: held but not yet quiet: no string; no second hold while a string is open; then the release counts."""
    slave = Ctt1(feed=feeder([0x1234]), strings={0xE: text(6)})
    line = Line(setup(), 8, S74C, slave).run(9)
    lib = line.lib
    assert not lib.fc_hold(8) and lib.fc_string(8, 0, 0, line.now) == STATUS["state"]
    enter(line, 0xE)
    assert lib.fc_string(8, 0, 0, line.now) == 0 and not lib.fc_hold(8)
    other = Line((line.ffi, lib), 9, S74C, Ctt1())  # another slave comes and goes meanwhile
    lib.fc_close(9)
    assert other.live and lib.fc_string_open()
    line.until(lambda: not lib.fc_string_open(), 40)
    before = line.due
    line.run(5)
    assert line.due == before and line.status & STRING and lib.fc_hold(8)
    assert lib.fc_string(8, 0, 0, line.now) == 0  # and once more
    line.until(lambda: not lib.fc_string_open(), 40)
    leave(line)
    line.run(9)
    assert line.ai[0] == 0x1234
    assert [lib.fc_inputs(8, n) for n in range(16)] == [0] * 16


def test_output_slave_that_names_no_triple_while_held():
    """CT-013, CT-014: a held output slave that wants triple 7 of a value gets the first one when it is released."""
    slave = Ctt1(output=True)
    line = Line(setup(), 8, S744, slave).run(7)
    true_call = slave.call
    assert not line.lib.fc_hold(8)
    slave.call = lambda nibble: (true_call(nibble) & 8) | 7
    line.call()
    assert line.lib.fc_hold(8)
    line.set_ao(0xE000)
    line.lib.fc_release(8, line.now)
    line.call(LATE)
    assert line.due & 7 == 0  # E


@pytest.mark.parametrize("output", [False, True])
def test_hold_without_string(output):
    """CT-002, CT-014: held and released, at any triple, with or without an answer meanwhile: no torn value."""
    for calls in range(8):
        for wait in range(3):
            fed = []
            slave = Ctt1(output, 2, feed=lambda channel: (fed.append(0x1111 * len(fed)) or fed[-1], 0, 1))
            line = Line(setup(), 8, 0x5F47 if output else 0xDF47, slave)
            line.set_ao(0x1234, 0x5678)
            line.run(7 + calls)
            assert not line.lib.fc_hold(8) and line.status & STRING
            line.run(wait)
            assert bool(line.lib.fc_hold(8)) == (wait > 0)
            line.lib.fc_release(8, line.now)
            line.lib.fc_release(8, line.now)  # nothing more happens
            for _ in range(30):
                line.call()
                assert output or (line.ai[0] in fed + [0x7FFF] and line.ai[1] in fed + [0x7FFF])
            assert not output or set(slave.taken) <= {(0, 0), (0, 0x1234), (1, 0), (1, 0x5678)}


# ---------------------------------------------------------------- any disturbance

weighted = st.sampled_from((OK,) * 4 + OUTCOMES)


@settings(max_examples=60, deadline=None)
@given(st.lists(weighted, max_size=120), st.sampled_from([1, 2, 4]))
def test_inputs_on_a_bad_line(outcomes, channels):
    """CT-002, CT-003, CT-004: whatever is lost, repeated or late: the slave's values are shown, all in order."""
    given_values = {}
    count = [0]

    def feed(channel):
        count[0] += 1
        value = (count[0] * 0x9E37) & 0xFFFF
        given_values.setdefault(channel, []).append(value)
        return value, 0, 1
    line = Line(setup(), 8, {1: S73C, 2: S73D, 4: S73E}[channels], Ctt1(channels=channels, feed=feed))
    shown = {}
    for outcome in outcomes + [OK] * (7 * channels + 7):
        line.call(outcome)
        for k in range(channels):
            if line.status & 1 << k and shown.setdefault(k, [None])[-1] != line.ai[k]:
                shown[k].append(line.ai[k])
    for k in range(channels):
        assert shown[k][1:] == given_values[k][:len(shown[k]) - 1]
        assert len(given_values[k]) - (len(shown[k]) - 1) <= 1  # none is left out


@settings(max_examples=60, deadline=None)
@given(st.lists(weighted, max_size=120), st.sampled_from([1, 2, 4]))
def test_outputs_on_a_bad_line(outcomes, channels):
    """CT-002, CT-003, CT-013: every value that the slave takes is one that AODI had, for that channel, and in order."""
    slave = Ctt1(output=True, channels=channels)
    line = Line(setup(), 8, {1: 0x4F37, 2: S735, 4: S736}[channels], slave)
    for n, outcome in enumerate(outcomes + [OK] * 7 * (channels + 1)):
        line.set_ao(*(((n + 1) * 97 & 0xFFF) << 4 | k + 1 for k in range(channels)))
        line.call(outcome)
    assert [k for k, _ in slave.taken] == [n % channels for n in range(len(slave.taken))]
    assert len(slave.taken) >= channels + 1
    for k, values in slave.values_taken.items():
        steps = [v >> 4 for v in values if v]
        assert all(v & 15 == k + 1 for v in values if v)
        assert len(set(steps)) == len(steps)


@settings(max_examples=40, deadline=None)
@given(st.lists(weighted, max_size=80), st.integers(1, 5), st.booleans(), st.booleans())
def test_strings_on_a_bad_line(outcomes, sequences, output, write):
    """CT-014, CT-003: a string arrives whole, or ends with an error; the values before and after are whole too."""
    slave = Ctt1(output=output, feed=lambda channel: (0x1234, 0, 1), strings={0xE: text(3 * sequences)})
    line = Line(setup(), 8, S744 if output else S74C, slave)
    line.set_ao(0x1234)
    line.run(9)
    disturbed = iter(outcomes)
    for _ in range(100):
        if line.lib.fc_hold(8):
            break
        line.call(next(disturbed, OK))
    slave.wpar(7 if write else 0xE)
    line.lib.fc_string_bytes()[0:3 * sequences] = text(3 * sequences) if write else bytes(3 * sequences)
    assert line.lib.fc_string(8, 3 if write else 0, 3 * sequences if write else 0, line.now) == 0
    for _ in range(400):
        if not line.lib.fc_string_open():
            break
        line.call(next(disturbed, OK))
    assert line.lib.fc_string_status() == 0
    if write:
        assert slave.written == text(3 * sequences)
    else:
        assert bytes(line.lib.fc_string_bytes()[0:line.lib.fc_string_length()]) == text(3 * sequences)
    leave(line)
    for outcome in outcomes + [OK] * 30:
        line.call(outcome)
        assert line.ai[0] in (0, 0x7FFF, 0x1234)
    assert not output or set(slave.values_taken[0]) <= {0, 0x1234}
    assert line.status & TV


def test_late_for_ever_and_clock_wrap():
    """CT-003, CT-012: only old nibbles on the line: nothing moves; the bus time may wrap without a false time-out."""
    line = Line(setup(), 8, S73C, Ctt1(feed=feeder([0x1234])))
    line.now = 0xFFFFFFFF - 60000
    line.lib.fc_close(8)
    assert line.lib.fc_open(8, S73C, line.now)
    line.lib.fc_first(8, 0)
    line.run(6).run(5, LATE)
    assert line.ai[0] == 0x7FFF
    line.run(1)
    assert line.ai[0] == 0x1234
    line.run(20)
    assert line.status == TV | 1
