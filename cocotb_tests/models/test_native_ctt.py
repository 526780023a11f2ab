# SPDX-License-Identifier: Apache-2.0
"""Combined transactions as the native slaves speak them (tb/asi_ctt_slave.cpp): worked sequences, losses, limits."""
import pytest

from asi import ctt_table as table
from asi.native import CERTAIN, STRING_DIAGNOSIS, STRING_ID, STRING_PARAMETERS, NativeError
from asi.telegram import encode_call, pulses, request_pulses, request_word, response_pulses, response_word
from cocotb_tests.models.test_native_slaves import MS, US, Line

SHORT = 80 * US     # last pulse of a request to the next request: an immediate repetition begins well within 200 us
CYCLE = 1 * MS


class Master:
    """One slave, activated; a call per millisecond, unless `repeat`."""

    def __init__(self, index=8, **slave):
        self.line, self.index, self.extended = Line(), index, slave.get("id") == 0xA
        self.net = self.line.net
        self.slave = self.net.add(index, **slave)
        self.words = []         # (request, response) of every answered call
        self.parameter(0xF)
        self.activation = self.call(0xF)

    def raw(self, call, wait=CYCLE):
        """-> answer nibble, None without an answer."""
        line = self.line
        line.net.advance(line.t)
        for at, polarity in request_pulses(call):
            line.net.master_pulse(line.t + at, polarity)
        last = line.t + 78 * US
        answer = line.net.advance(last + SHORT)
        line.t = last + max(wait, SHORT)
        if not answer:
            return None
        train = [(p.t_ns - answer[0].t_ns, p.polarity) for p in answer]
        (nibble,) = [n for n in range(16) if response_pulses(n) == train]
        self.words.append((request_word(call), response_word(nibble)))
        return nibble

    def call(self, nibble, repeated=False):
        """DEXG of this nibble; repeated: a second one follows at once. -> answer of the last."""
        call = encode_call("DEXG", self.index, nibble, self.extended)
        if repeated:
            self.raw(call, SHORT)
        return self.raw(call)

    def lose_answer(self, nibble):
        """DEXG whose answer is lost, repeated at once. -> answer of the repetition."""
        self.net.set_faults(self.slave, p_no_answer=CERTAIN)
        call = encode_call("DEXG", self.index, nibble, self.extended)
        assert self.raw(call, SHORT) is None
        self.net.set_faults(self.slave)
        return self.raw(call)

    def lose_request(self, nibble):
        """DEXG with a wrong parity bit."""
        word = request_word(encode_call("DEXG", self.index, nibble, self.extended)) ^ 2
        for at, polarity in pulses(word, 14):
            self.net.master_pulse(self.line.t + at, polarity)
        self.line.t += CYCLE
        assert self.net.advance(self.line.t) == []

    def parameter(self, value):
        assert self.raw(encode_call("WPAR", self.index, value, self.extended)) is not None

    def play(self, rows):
        """rows: printed request and response words."""
        for request, response in rows:
            call = request >> 2 & 0x7FF
            assert request_word(call) == request
            answer = self.raw(call)
            assert answer is not None and response_word(answer) == response, f"{request:04X}"

    # CTT1, in lock-step: control bit and number, control bit and triple
    control = 0

    def ask(self, number):
        """-> triple of that number; the control bit alternates."""
        answer = self.call(self.control << 3 | number)
        assert answer >> 3 == self.control
        self.control ^= 1
        return answer & 7

    def read(self, first=6):
        """-> a frame, first triple to 0."""
        frame = 0
        for number in range(first, -1, -1):
            frame = frame << 3 | self.ask(number)
        return frame

    def read_value(self):
        """-> (channel, value, O, V)."""
        frame = self.read()
        return frame >> 18, frame >> 2 & 0xFFFF, frame >> 1 & 1, frame & 1

    def write(self, frame, first=6):
        """-> the numbers the slave has asked for."""
        return [self.ask(frame >> 3 * n & 7) for n in range(first, -1, -1)]

    def write_value(self, channel, value, o=0, v=1):
        return self.write(channel << 18 | value << 2 | o << 1 | v)

    def read_string(self, parameter):
        """-> all sequences; stops behind V = 0 too, as ([bytes], V)."""
        self.parameter(parameter)
        out = b""
        while True:
            sequence = self.read(7).to_bytes(3, "big")
            out += sequence
            if sequence[2] & 3 != 3:
                self.parameter(table.CTT1_PAR_DATA)
                return out

    # CTT2: a bit in two calls
    tail = []

    def levels(self, clock, data, repeated=False, lost=False):
        """One call with these levels, DO2 and DO3 = 1. -> answer nibble"""
        nibble = 12 | data << table.CTT2_DO_DATA | clock << table.CTT2_DO_CLOCK
        return self.lose_answer(nibble) if lost else self.call(nibble, repeated)

    def send(self, message, repeated=False, lost=False):
        """-> answers to all calls. The answer to the last one may be the first of a response."""
        answers = [self.levels(clock, byte >> bit & 1, repeated, lost)
                   for byte in bytes(message) for bit in range(7, -1, -1) for clock in (0, 1)]
        self.tail = answers[-1:]
        return answers

    def receive(self, calls, **options):
        """Idle calls -> whole bytes from the slave, with those that came since the last call of send()."""
        tail, self.tail = self.tail, []
        return self.decode(tail + [self.levels(1, 1, **options) for _ in range(calls)])

    @staticmethod
    def decode(answers):
        """Answers, the first after an idle level -> bytes taken at rising edges."""
        clocks = [1] + [a >> table.CTT2_DI_CLOCK & 1 for a in answers]
        bits = [a >> table.CTT2_DI_DATA & 1 for a, (old, new) in zip(answers, zip(clocks, clocks[1:])) if new > old]
        assert len(bits) % 8 == 0
        return bytes(int("".join(map(str, bits[i:i + 8])), 2) for i in range(0, len(bits), 8))

    def message(self, *message, answer=12, **options):
        """A message and, over enough calls, its answer."""
        self.send(message, **options)
        return self.receive(16 * answer + 4, **options)


ANALOG = dict(io=7, id=3)
STRINGS = dict(io=7, id=4, id2=0xC)
SERIAL = dict(io=7, id=0xA, id1=7, id2=5)
ID_OBJECT = bytes([0x01, 0x23, 0x45, 0x67, 0x22])


def test_kinds():
    """SL-009, CT-001: what a slave's codes make of it, by what it lets itself be told."""
    line = Line()

    def can(what, *args, **codes):
        slave = line.net.add(5, **codes)
        try:
            getattr(line.net, what)(slave, *args)
        except NativeError:
            return False
        return True

    for id_code in (1, 2, 3, 4):
        assert can("set_value", 0, 1, io=7, id=id_code, id2=0xE) and not can("value", 0, io=7, id=id_code, id2=0xE)
        assert [can("set_value", 3, 1, io=7, id=id_code, id2=id2) for id2 in (0xC, 0xD, 0xE)] == [False, False, True]
        assert can("value", 0, io=7, id=id_code, id2=4) and not can("set_value", 0, 1, io=7, id=id_code, id2=4)
        assert not can("set_value", 0, 1, io=6, id=id_code, id2=0xC)
    for id2, channels in ((0xC, 1), (0xD, 2), (0xE, 4), (0xF, 4), (8, 1)):
        assert [can("set_value", k, 1, io=7, id=3, id2=id2) for k in range(5)] == [k < channels for k in range(5)]
    assert not can("value", 0, io=7, id=4, id2=0)                           # S-7.4 in its 4I/4O mode
    assert [can("set_string", 0, b"abc", io=7, id=id_code, id2=0xC) for id_code in (1, 2, 3, 4)] == [False] * 3 + [True]
    for codes in (dict(io=7, id=5), dict(io=7, id=0xA), dict(io=0xB, id=0xA)):
        assert can("set_value", 3, 1, **codes, id2=5) and not can("set_value", 3, 1, **codes, id2=6)
    assert can("value", 0, io=7, id=0xA, id2=7) and not can("set_value", 0, 1, io=7, id=0xA, id2=7)
    assert can("set_value", 0, 255, io=7, id=0xA, id2=0xA) and not can("set_value", 0, 256, io=7, id=0xA, id2=0xA)
    assert can("set_safety", range(8), io=0, id=0xB) and not can("set_safety", range(8), io=0, id=0xA)
    assert not can("set_safety", [16] * 8, io=0, id=0xB) and not can("set_safety", range(7), io=0, id=0xB)
    for plain in (dict(io=6, id=0, id2=0xB), dict(io=7, id=0xA, id2=8), dict(io=7, id=0xA, id2=9), dict(io=7)):
        assert not can("value", 0, **plain)     # CTT5; CTT4 is off in the table


# ------------------------------------------------------------------------------------------ CTT1
W1 = [(0x041B, 0x01), (0x0435, 0x23), (0x0411, 0x13), (0x042D, 0x31), (0x0409, 0x0D), (0x0427, 0x29), (0x0403, 0x07)]
W2 = [(0x0487, 0x15), (0x04A5, 0x31), (0x0487, 0x0D), (0x04BB, 0x29), (0x0487, 0x07), (0x04A3, 0x23), (0x0487, 0x19)]


def test_w1_input_value():
    """SL-009, CT-010: W1, value 0x1234 from S-7.3.C at address 8, and the next value with the other control bit."""
    m = Master(8, **ANALOG, id2=0xC)
    m.net.set_value(m.slave, 0, 0x1234)
    m.play(W1)
    assert m.call(0b1110) == 0b1000


def test_w2_output_value():
    """SL-009, CT-010, CT-013: W2, value 0x2710 to channel 2 of S-7.3.5 at address 9."""
    m = Master(9, **ANALOG, id2=5)
    m.play(W2[:-1])
    assert m.net.value(m.slave, 1) is None
    m.play(W2[-1:])
    assert (m.net.value(m.slave, 0), m.net.value(m.slave, 1)) == (None, 0x2710)


def test_w3_string():
    """SL-009, CT-014: W3, the printed WPAR words, and a sequence 41 42 with F = V = 1."""
    m = Master(8, **STRINGS)
    m.net.set_string(m.slave, STRING_ID, b"\x41\x42\x00\x43\x44\x00")
    m.words.clear()
    for parameter in (0xF, 0xE, 0xD, 0xB, 0x7, 0xE):
        m.parameter(parameter)
    assert [request for request, _ in m.words] == [0x047D, 0x047B, 0x0477, 0x046F, 0x045F, 0x047B]
    assert [m.ask(t) for t in range(7, -1, -1)] == [0b010, 0, 0b010, 0b100, 1, 0, 0, 0b011]
    assert m.read(7) == 0x434401


def test_w4_lost_answer():
    """SL-009, CT-003: W4, the answer of W1 call 4 is lost: the same call gets the same answer, nothing moves twice."""
    m = Master(8, **ANALOG, id2=0xC)
    m.net.set_value(m.slave, 0, 0x1234)
    m.play(W1[:3])
    assert response_word(m.lose_answer(0b1011)) == 0x31
    m.play(W1[4:])


@pytest.mark.parametrize("id2, channels", [(0xC, 1), (0xD, 2), (0xE, 4), (0xF, 4), (8, 1), (0xA, 4)])
def test_input_channels(id2, channels):
    """SL-009, CT-010: all channels in turn, each with its own value, V and O."""
    m = Master(8, **ANALOG, id2=id2)
    values = [0x7FFF, 0x8000, 0x0000, 0xA55A][:channels]
    for channel, value in enumerate(values):
        m.net.set_value(m.slave, channel, value)
    m.net.set_invalid(m.slave, invalid=1 << channels - 1, overflow=1)
    for turn in range(2 * channels):
        channel = turn % channels
        assert m.read_value() == (channel, values[channel], channel == 0, channel != channels - 1)
    with pytest.raises(NativeError):
        m.net.set_invalid(m.slave, invalid=1 << channels)


def test_input_value_is_not_torn():
    """SL-009, CT-002: a value that changes while it is sent goes out as it was when its first triple went."""
    m = Master(8, **ANALOG, id2=0xC)
    m.net.set_value(m.slave, 0, 0x1111)
    first = [m.ask(n) for n in (6, 5, 4)]
    m.net.set_value(m.slave, 0, 0xEEEE)
    frame = 0
    for triple in first + [m.ask(n) for n in (3, 2, 1, 0)]:
        frame = frame << 3 | triple
    assert frame == 0x1111 << 2 | 1
    assert m.read_value() == (0, 0xEEEE, 0, 1)


def test_input_restart():
    """SL-009, CT-012: a master that gives up in the middle and asks for triple 6 again gets the same channel again."""
    m = Master(8, **ANALOG, id2=0xD)
    assert m.read_value()[0] == 0
    assert [m.ask(n) for n in (6, 5, 4)][0] == 1
    assert m.read_value()[0] == 1
    assert m.read_value()[0] == 0


@pytest.mark.parametrize("id_code, triples", [(1, table.CTT1_TRIPLES_71), (2, table.CTT1_TRIPLES_72)])
def test_shorter_values(id_code, triples):
    """SL-009, CT-015: S-7.1 and S-7.2 have the E triple and the channels of S-7.3; the table tells how many triples."""
    left, e = 21 - 3 * triples, 3 * (triples - 1)
    m = Master(8, io=7, id=id_code, id2=0xD)
    m.net.set_value(m.slave, 0, 0xABCD)
    m.net.set_value(m.slave, 1, 0xFFFF)
    for _ in range(2):
        assert m.read(triples - 1) == 0xABCD >> left << 2 | 1
        assert m.read(triples - 1) == 1 << e | 0xFFFF >> left << 2 | 1
    m = Master(8, io=7, id=id_code, id2=1)
    assert m.write(1 << e | 0xABCD >> left << 2 | 1, triples - 1) == [*range(triples - 2, -1, -1), triples - 1]
    assert m.net.value(m.slave, 1) == 0xABCD >> left << left and m.net.value(m.slave, 0) is None


@pytest.mark.parametrize("loss", ["answer", "request", "repetition"])
def test_ctt1_losses(loss):
    """SL-009, CT-003: whichever call of a value is lost or repeated, in and out, the value arrives once and whole."""
    for lost in range(7):
        for id2 in (0xC, 4):
            m = Master(8, **ANALOG, id2=id2)
            if id2 == 0xC:
                m.net.set_value(m.slave, 0, 0xC35A)
            frame = 0xC35A << 2 | 1
            got = 0
            for n in range(6, -1, -1):
                nibble = m.control << 3 | (n if id2 == 0xC else frame >> 3 * n & 7)
                if n == lost and loss == "request":
                    m.lose_request(nibble)
                if n == lost and loss == "answer":
                    answer = m.lose_answer(nibble)
                else:
                    answer = m.call(nibble, n == lost and loss == "repetition")
                assert answer >> 3 == m.control
                assert id2 == 0xC or answer & 7 == (n - 1) % 7
                got = got << 3 | answer & 7
                m.control ^= 1
            assert got == frame if id2 == 0xC else m.net.value(m.slave) == 0xC35A


def test_activation_is_no_triple():
    """SL-009, CT-010: the F of the activation is answered and does not count, for inputs and outputs."""
    assert Master(8, **ANALOG, id2=0xC).activation == 0b1000
    m = Master(8, **ANALOG, id2=4)
    assert m.activation == 0b1110
    m.write_value(0, 5)
    assert m.net.value(m.slave) == 5


def test_output_channels():
    """SL-009, CT-013: values go where E says; V = 0 and channels that are not there change nothing."""
    m = Master(9, **ANALOG, id2=6)
    for channel in (2, 0, 3, 1):
        assert m.write_value(channel, 0x1000 + channel) == [5, 4, 3, 2, 1, 0, 6]
    m.write_value(1, 0xFFFF, v=0)
    m.write_value(4, 0xFFFF)
    m.write_value(7, 0xFFFF)
    assert [m.net.value(m.slave, k) for k in range(4)] == [0x1000, 0x1001, 0x1002, 0x1003]
    m.write_value(0, 0x8000, o=1)
    assert m.net.value(m.slave, 0) == 0x8000


@pytest.mark.parametrize("id_code, parameter, kept", [(3, 0xF, False), (3, 0xE, True), (4, 0xF, True)])
def test_supervised_outputs(id_code, parameter, kept):
    """SL-009: S-7.3 outputs with P0 = 1 are dropped 0.5 s after the last triple, not before."""
    m = Master(9, io=7, id=id_code, id2=4)
    m.parameter(parameter)
    m.write_value(0, 5)
    end = m.line.t + table.CTT1_SLAVE_TIMEOUT_MS * MS - CYCLE
    m.net.advance(end - 1)
    assert m.net.value(m.slave) == 5
    m.net.advance(end)
    assert m.net.value(m.slave) == (5 if kept else None)


def test_output_after_a_silence():
    """SL-009, CT-002, CT-012: after 0.5 s a broken-off value is not completed by another one: the slave asks for 6."""
    m = Master(9, **ANALOG, id2=4)
    assert m.write_value(0, 0x1111)[-1] == 6
    for begun in (3, 0):        # within a value and between two
        assert [m.ask(7) for _ in range(begun)] == [5, 4, 3][:begun]
        m.line.wait(table.CTT1_SLAVE_TIMEOUT_MS * MS)
        assert m.ask(0) == 6
        m.write_value(0, 0x2222 + begun)
        assert m.net.value(m.slave) == 0x2222 + begun


def test_reset_ends_a_value():
    """SL-009, SL-001: RES forgets outputs and half a value; what the plant side has set stays."""
    m = Master(9, **ANALOG, id2=4)
    m.write_value(0, 5)
    m.ask(0), m.ask(7)
    m.raw(encode_call("RES", 9))
    m.line.wait(2 * MS)
    assert m.net.value(m.slave) is None
    m.parameter(0xF)
    assert m.call(0xF) == 0b1110
    m.control = 0
    m.write_value(0, 6)
    assert m.net.value(m.slave) == 6
    m = Master(8, **ANALOG, id2=0xC)
    m.net.set_value(m.slave, 0, 77)
    m.raw(encode_call("RES", 8))
    m.line.wait(2 * MS)
    m.parameter(0xF)
    assert m.read_value() == (0, 77, 0, 1)


@pytest.mark.parametrize("direction", [0xC, 4])
def test_read_strings(direction):
    """SL-009, CT-014: ID, diagnosis and parameter strings of inputs and outputs, values before and after."""
    m = Master(8, io=7, id=4, id2=direction)
    texts = {STRING_ID: (0xE, b"\x20\x37\x07\x01\x01\x03\x10\x11\x01"), STRING_DIAGNOSIS: (0xD, b"\xAA\x55\x01"),
             STRING_PARAMETERS: (0xB, b"\x01\x02\x03\x03\x04\x01")}
    for kind, (_, text) in texts.items():
        m.net.set_string(m.slave, kind, text)
    for _ in range(2):
        for kind, (parameter, text) in texts.items():
            assert m.read_string(parameter) == text == m.net.string(m.slave, kind)
            if direction == 0xC:
                assert m.read_value() == (0, 0, 0, 1)
            else:
                m.write_value(0, 0x0FF0)
                assert m.net.value(m.slave) == 0x0FF0


def test_no_string():
    """SL-009, CT-014: a string the slave does not have goes out as V = 0."""
    m = Master(8, **STRINGS)
    assert m.read_string(0xD) == b"\0\0\0"


def test_longest_string():
    """SL-009, CT-014: 219 bytes in 73 sequences both ways; more is refused, a longer one from the master dropped."""
    m = Master(8, **STRINGS)
    text = bytes(range(219))
    m.net.set_string(m.slave, STRING_ID, text)
    got = m.read_string(0xE)
    assert len(got) == 219
    assert all(mine == other for k, (mine, other) in enumerate(zip(got, text)) if k % 3 < 2)
    with pytest.raises(NativeError):
        m.net.set_string(m.slave, STRING_ID, bytes(220))
    for sequences, byte in ((73, 73), (74, 73), (75, 73), (1, 1)):
        m.parameter(0x7)
        for k in range(sequences):
            m.write(k << 16 | sequences << 8 | (1 if k == sequences - 1 else 3), 7)
        m.parameter(0xF)
        assert m.net.string(m.slave, STRING_PARAMETERS)[1::3] == bytes([byte] * byte)


def test_write_string():
    """SL-009, CT-014: a written string is there when its last sequence is, and can be read back; V = 0 discards it."""
    m = Master(8, **STRINGS)
    m.parameter(0x7)
    assert m.write(0x010203, 7) == [6, 5, 4, 3, 2, 1, 0, 7]
    assert m.net.string(m.slave, STRING_PARAMETERS) == b""
    m.write(0x040501, 7)
    assert m.net.string(m.slave, STRING_PARAMETERS) == b"\1\2\3\4\5\1"
    m.write(0x070803, 7)
    m.write(0x090000, 7)
    m.write(0x0A0B01, 7)
    assert m.net.string(m.slave, STRING_PARAMETERS) == b"\x0A\x0B\1"
    m.write(0x0C0D03, 7)
    m.parameter(0xF)
    assert m.read_string(0xB) == b"\x0A\x0B\1"


# ------------------------------------------------------------------------------------------ CTT2
def test_w5_message_bits():
    """SL-009, CT-020: W5, the printed words of byte 10 to 5A are taken as that byte: 10 00 05 reads the ID object."""
    m = Master(5, **SERIAL)
    m.net.set_string(m.slave, 0, ID_OBJECT)
    m.words.clear()
    m.send([0x10])
    zero, one = (0x02B1, 0x02B7), (0x02BB, 0x02BD)
    assert [w for w, _ in m.words] == [*zero * 3, *one, *zero * 4]
    assert m.message(0, 5) == b"\x50" + ID_OBJECT


def test_w6_answer_bits():
    """SL-009, CT-020: W6, the byte 50 of the answer in the nibbles and words of the table's map."""
    m = Master(5, **SERIAL)
    m.net.set_string(m.slave, 0, ID_OBJECT)
    m.send([0x10, 0, 5])
    m.words = m.words[-1:]      # the answer to the last call is the first of the response
    m.receive(15)
    zero, one = (0x01, 0x23), (0x13, 0x31)
    assert [w for _, w in m.words] == [*zero, *one, *zero, *one, *zero * 4]


@pytest.mark.parametrize("codes", [dict(io=7, id=5, id2=5), SERIAL, dict(io=0xB, id=0xA, id1=7, id2=5)])
def test_ctt2_parallel_bits(codes):
    """SL-009, CT-023: DI0, DI1 and DO2 (7.5.5: DO3) stay ordinary bits while a message runs; B.A.5 has none."""
    m = Master(5, inputs=0b0010, **codes)
    m.net.set_string(m.slave, 0, ID_OBJECT)
    answers = m.send([0x10, 0, 5])
    assert {a >> 2 for a in answers[:-1]} == {3}                            # both lines idle
    if codes["io"] == 7:
        assert {a & 3 for a in answers} == {2}
    m.call(0b0111)
    assert m.net.state(m.slave).outputs == (0b0111 if codes["id"] == 5 else 0b1111)
    m.call(0b1011)
    assert m.net.state(m.slave).outputs == 0b1011


@pytest.mark.parametrize("option", [{}, {"repeated": True}, {"lost": True}])
def test_ctt2_messages(option):
    """SL-009, CT-021, CT-003: every code, good and refused; also when every call is repeated at once, or every answer
    lost and called for again: no clock level is skipped or doubled."""
    m = Master(5, **SERIAL)
    m.net.set_string(m.slave, 0, ID_OBJECT)
    m.net.set_string(m.slave, 3, b"abcd")
    for message, answer in (
            ((0x10, 0, 5), b"\x50" + ID_OBJECT), ((0x10, 3, 2), b"\x50ab"), ((0x12, 3, 4), b"\x52abcd"),
            ((0x10, 3, 5), b"\x90\x02"), ((0x10, 3, 0), b"\x90\x02"), ((0x10, 9, 1), b"\x90\x01"),
            ((0x12, 9, 1), b"\x92\x01"), ((0x11, 3, 4, *b"ABCD"), b"\x51"), ((0x10, 3, 4), b"\x50ABCD"),
            ((0x13, 3, 4, *b"efgh"), b"\x53"), ((0x11, 0, 5, 1, 2, 3, 4, 5), b"\x91\x01"),
            ((0x13, 9, 1, 9), b"\x93\x01"), ((0x11, 3, 5, 1, 2, 3, 4, 5), b"\x91\x02"),
            ((0x11, 3, 3, 1, 2, 3), b"\x91\x02"), ((0x1D, 3, 3, 4, *b"CBcd"), b"\x5DCBc"),
            ((0x1D, 3, 0, 4, *b"CBcd"), b"\x5D"), ((0x1D, 9, 1, 1, 0), b"\x9D\x01"), ((0x1D, 3, 5, 0), b"\x9D\x02"),
            ((0x14, 3), b"\x94\x03"), ((0x1F,), b"\x9F\x03"), ((0x3F,), b"\xBF\x03"), ((0x40,), b""),
            ((0x50,), b""), ((0x90, 2), b""), ((0xFF,), b""), ((0x02,), b"")):
        assert m.message(*message, answer=len(answer) + 1, **option) == answer, message
    assert m.net.string(m.slave, 3) == b"CBcd"


def test_ctt2_busy():
    """SL-009, CT-021: a busy slave refuses acyclic requests with error 4, so many as it was told, and works then."""
    m = Master(5, **SERIAL)
    m.net.set_string(m.slave, 0, ID_OBJECT)
    m.net.set_options(m.slave, busy=2)
    assert [m.message(0x10, 0, 5) for _ in range(3)] == [b"\x90\x04", b"\x90\x04", b"\x50" + ID_OBJECT]
    with pytest.raises(NativeError):
        m.net.set_options(m.net.add(6), busy=1)


def test_ctt2_swapped():
    """SL-009, CT-024: W6 in the swapped map: clock on DI2, data on DI3."""
    m = Master(5, **SERIAL)
    m.net.set_options(m.slave, di_swapped=True)
    m.send([0x10, 0])
    answers = m.send([5])[-1:] + [m.levels(1, 1) for _ in range(15)]
    zero, one = (0b0000, 0b0100), (0b1000, 0b1100)
    assert answers == [*zero, *one, *zero, *one, *zero * 4]


def test_ctt2_longest_messages():
    """SL-009, CT-021: 224 bytes with the header are a message, more is refused as too long."""
    for length, answer in ((221, b"\x51"), (222, b"\x91\x02"), (255, b"\x91\x02")):
        m = Master(5, **SERIAL)
        m.net.set_string(m.slave, 1, bytes(length))
        assert m.message(0x11, 1, length, *range(length), answer=2) == answer
        assert m.net.string(m.slave, 1) == (bytes(range(length)) if length == 221 else bytes(length))


@pytest.mark.parametrize("configuration, out_bytes, in_bytes", [
    (0x00, 0, 0), (0x11, 1, 1), (0x22, 2, 2), (0x33, 4, 4), (0x44, 6, 6), (0x55, 8, 8), (0x52, 8, 2), (0x05, 0, 8),
    (0xAA, 2, 2)])
def test_ctt2_cyclic(configuration, out_bytes, in_bytes):
    """SL-009, CT-021: 00 gets the input bytes, 01 takes the output bytes, as long as the configuration byte says."""
    m = Master(5, **SERIAL)
    m.net.set_string(m.slave, 0, ID_OBJECT[:4] + bytes([configuration]))
    words = [0x1234, 0xABCD, 0x00FF, 0x8001]
    for k, word in enumerate(words):
        m.net.set_value(m.slave, k, word)
    image = b"".join(w.to_bytes(2, "big") for w in words)
    expected = image[1:2] if in_bytes == 1 else image[:in_bytes]
    assert m.message(0x00, answer=8) == expected
    out = bytes([0x5A, 0xA5, 1, 2, 3, 4, 5, 6][:out_bytes])
    assert m.message(0x01, *out, answer=1) == b""
    got = [m.net.value(m.slave, k) for k in range(4)]
    if out_bytes == 1:
        assert got == [0x5A, None, None, None]
    else:
        assert got == [int.from_bytes(out[2 * k:2 * k + 2], "big") if 2 * k < out_bytes else None for k in range(4)]
    assert m.message(0x10, 0, 5) == b"\x50" + ID_OBJECT[:4] + bytes([configuration])    # in step behind it


def test_ctt2_gap():
    """SL-009, CT-020: 8 calls without an edge clear half a message, 7 do not."""
    for quiet, rest in ((7, (0, 5)), (8, (0x10, 0, 5))):
        m = Master(5, **SERIAL)
        m.net.set_string(m.slave, 0, ID_OBJECT)
        m.send([0x10])
        assert m.receive(quiet) == b""
        assert m.message(*rest) == b"\x50" + ID_OBJECT
    m.levels(0, 0), m.levels(1, 0), m.levels(0, 1)      # two bits, no byte
    m.receive(10)
    assert m.message(0x10, 0, 5) == b"\x50" + ID_OBJECT


def test_ctt2_lost_request():
    """SL-009, CT-003: a call the slave did not get and that is sent again does not count, in both directions."""
    m = Master(5, **SERIAL)
    m.net.set_string(m.slave, 0, ID_OBJECT)
    for byte in (0x10, 0, 5):
        for bit in range(7, -1, -1):
            for clock in (0, 1):
                nibble = 12 | (byte >> bit & 1) << 1 | clock
                m.lose_request(nibble)
                m.call(nibble)
    answers = [0]       # the response has begun
    for _ in range(16 * 6 + 2):
        m.lose_request(0xF)
        answers.append(m.call(0xF))
    assert m.decode(answers) == b"\x50" + ID_OBJECT


def test_ctt2_new_request_replaces_the_answer():
    """SL-009, CT-021: both directions have their own clock: a request while an answer runs is taken and answered."""
    m = Master(5, **SERIAL)
    m.net.set_string(m.slave, 0, ID_OBJECT)
    m.net.set_string(m.slave, 1, b"xy")
    m.send([0x10, 0, 5])
    first = m.tail
    running = first + m.send([0x10, 1, 2])[:-1]
    assert m.decode(running) == b"\x50" + ID_OBJECT[:2]
    assert m.receive(60) == b"\x50xy"


# ------------------------------------------------------------------------------------------ CTT3, CTT4, CTT5
def test_w7_four_outputs():
    """SL-009, CT-030: W7, 5A and 5B: outputs 3, 2 with I2 = 1, then 1, 0 with I2 = 0, all four together."""
    for index, words in ((5, (0x02B7, 0x02A5)), (37, (0x0295, 0x0287))):
        m = Master(index, io=7, id=0xA, id1=7 | index >> 5 << 3, id2=7, inputs=0b1001)
        for expected in (None, 0b1010):
            m.play([(words[0], response_word(0b1001))])
            assert m.net.value(m.slave) == expected
            m.play([(words[1], response_word(0b1001))])
            assert m.net.value(m.slave) == 0b1010


def test_four_outputs_need_a_falling_edge():
    """SL-009, CT-030, CT-003: only I2 = 0 behind I2 = 1 sets outputs; repeated calls change nothing."""
    m = Master(5, io=7, id=0xA, id1=7, id2=7)
    m.raw(encode_call("RES", 5))
    m.line.wait(2 * MS)
    m.parameter(7)
    m.call(0b000)
    assert m.net.value(m.slave) is None                 # the detector starts at 0
    m.call(0b110)
    assert m.lose_answer(0b001) == 0
    assert m.net.value(m.slave) == 0b0110               # inverted on the line
    m.call(0b011)
    assert m.net.value(m.slave) == 0b0110
    m.call(0b111, repeated=True)
    assert m.net.value(m.slave) == 0b0110
    m.call(0b000, repeated=True)
    assert m.net.value(m.slave) == 0b0011


W8 = [(0x02BD, 0x01), (0x02BB, 0x1F), (0x02A9, 0x2F), (0x02B7, 0x31), (0x02A5, 0x01), (0x02BB, 0x1F)]


def eight(**options):
    """S-7.A.A that has not been called since its reset."""
    m = Master(5, io=7, id=0xA, id1=7, id2=0xA, **options)
    m.raw(encode_call("RES", 5))
    m.line.wait(2 * MS)
    m.parameter(7)
    return m


def test_w8_eight_outputs():
    """SL-009, CT-031: W8, outputs A5 and inputs 3C of 5A, packet by packet."""
    m = eight()
    m.net.set_value(m.slave, 0, 0x3C)
    m.play(W8[:4])
    assert m.net.value(m.slave) is None
    m.play(W8[4:])
    assert m.net.value(m.slave) == 0xA5


def test_eight_inputs_are_of_one_byte():
    """SL-009, CT-002, CT-031: an input byte that changes within a round is sent in the next one."""
    m = eight()
    m.net.set_value(m.slave, 0, 0x00)
    answers = [m.call(0b111)]
    m.net.set_value(m.slave, 0, 0xFF)
    for _ in range(7):
        answers.append(m.call((~answers[-1] >> 2 & 1) << 2 | 3))
    assert [a >> 2 for a in answers] == [0, 1, 2, 3] * 2
    assert [a & 3 for a in answers] == [0] * 4 + [3] * 4


def test_eight_outputs_losses():
    """SL-009, CT-031, CT-003: a repeated call confirms nothing more, a wrong receipt gets the packet again."""
    for lost in range(1, 5):
        m = eight()
        m.net.set_value(m.slave, 0, 0x3C)
        for k, (request, response) in enumerate(W8):
            nibble = request >> 2 & 7
            if k == lost:
                assert response_word(m.lose_answer(nibble)) == response
            else:
                m.play([(request, response)])
        assert m.net.value(m.slave) == 0xA5
    m = eight()
    m.call(0b111)
    assert m.call(0b011) >> 2 == 0      # packet 0 is confirmed by I2 = 1
    assert m.call(0b111) >> 2 == 1


def test_ctt4_is_plain():
    """SL-009, CT-040: with CTT4 off in the table such slaves exchange plain nibbles."""
    assert not table.CTT4_ENABLE
    for id2 in (8, 9):
        m = Master(5, io=7, id=0xA, id1=7, id2=id2, inputs=0b1001)
        assert [m.call(n) for n in range(8)] == [0b1001] * 8


def test_w9_group():
    """SL-009, CT-050: W9, the members of a CTT5 group are plain 4I/4O slaves."""
    line = Line()
    for address, id2, nibble in ((3, 0xB, 0xC), (4, 6, 0xB), (5, 5, 0xA)):
        line.net.add(address, io=6, id=0, id2=id2, inputs=nibble)
    line.wait(20 * MS)
    for address, request, response, out in ((3, 0x01B1, 0x31, 12), (4, 0x0235, 0x2F, 13), (5, 0x02BB, 0x29, 14)):
        assert line.call("WPAR", address, 15) == 15
        assert request_word(encode_call("DEXG", address, out)) == request
        assert response_word(line.raw(request >> 2 & 0x7FF)[0]) == response
        assert line.net.state(address - 3).outputs == out


# ------------------------------------------------------------------------------------------ safety
WORDS = [0b0001, 0b0101, 0b0110, 0b1001, 0b1110, 0b1011, 0b1100, 0b0111]


def test_safety_words():
    """SL-009, CT-060: one word per call in a ring of eight; each open channel forces its two bits to 0."""
    own = [3, 5, 6, 9, 10, 12, 7, 14]
    for words in (WORDS, own):
        m = Master(8, io=0, id=0xB)
        if words is own:
            m.net.set_safety(m.slave, own)
        got = [m.call(0xF) for _ in range(16)]
        assert got == (words[1:] + words[:1]) * 2       # the activation had the first
        for closed, mask in ((0, 0), (1, 3), (2, 12), (3, 15)):
            m.net.set_safety(m.slave, words, closed)
            assert [m.call(0xF) for _ in range(8)] == [w & mask for w in words[1:] + words[:1]]


def test_safety_word_is_held():
    """SL-009, CT-060, CT-003: a word stays for 224 us after an answered call, also an answer nobody heard."""
    m = Master(8, io=7, id=0xB)
    call = encode_call("DEXG", 8, 0xF)
    assert m.raw(call, 145 * US) == m.raw(call, 145 * US) == WORDS[1]       # last pulse to last pulse: 223 us
    assert m.raw(call, 146 * US) == WORDS[1]
    assert m.raw(call) == WORDS[2]
    assert m.lose_answer(0xF) == WORDS[3]
    m.lose_request(0xF)
    assert m.call(0xF) == WORDS[4]
