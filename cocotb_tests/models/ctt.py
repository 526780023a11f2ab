# SPDX-License-Identifier: Apache-2.0
"""Combined transactions as a slave speaks them (SL-009): nibbles in, nibbles out, no pulses.

Written from the description of the line and rdl/ctt.toml alone; firmware and native slaves have readings of their own.
Nibbles are at line level: I3..I0 of a standard slave, I2..I0 of an A/B slave (its I3 selects); answers have four bits.
Times are ns of bus time at the request's last pulse; they must be real: a call within the hold time is a repetition.
The table is looked up at every use, so a test may change a choice.
"""
from asi import ctt_table as table

CHANNELS = 4
ID, DIAGNOSIS, PARAMETERS = 0, 1, 2     # kinds of strings of S-7.4; of CTT2: 0 the ID object, others by their index
SAFETY_WORDS = (0b0001, 0b0101, 0b0110, 0b1001, 0b1110, 0b1011, 0b1100, 0b0111)
MS = 1_000_000

# message codes of CTT2 and their standard errors
GET_CYCLIC, PUT_CYCLIC = 0x00, 0x01
READ, WRITE, DEVICE_READ, DEVICE_WRITE, EXCHANGE = 0x10, 0x11, 0x12, 0x13, 0x1D
GOOD, REFUSED = 0x40, 0x80              # added to the code in the response
ILLEGAL_INDEX, ILLEGAL_LENGTH, NOT_IMPLEMENTED, BUSY = 1, 2, 3, 4
CYCLIC_BYTES = (0, 1, 2, 4, 6, 8, 0, 0)  # by three bits of the I/O configuration byte
PLAIN_ID_OBJECT = bytes((0, 0, 0, 0, 0x22))  # vendor, device, one word each way


def make(io, id, id2, **options):
    """Engine for a slave with these codes, None when it exchanges plain nibbles (CT-001).

    options: values, strings, invalid, overflow; per kind triples (S-7.1, 7.2), swapped, busy (CTT2), words, closed
    (safety).
    ValueError for options of a plain slave, TypeError for one that its kind does not know.
    """
    engine = None
    if id == 0xB:
        engine = Safety
    elif io == 7 and id in (1, 2, 3, 4) and (id, id2) != (4, 0):
        return Ctt1(id, id2, **options)
    elif (io, id, id2) in ((7, 5, 5), (7, 0xA, 5), (0xB, 0xA, 5)):
        return Ctt2(io, **options)
    elif (io, id) == (7, 0xA):
        engine = {7: Mux4, 8: Ctt4, 9: Ctt4, 0xA: Mux8}.get(id2)
    if engine is Ctt4:
        engine = (lambda **o: Ctt4(id2, **o)) if table.CTT4_ENABLE else None
    if engine is None and options:
        raise ValueError(f"S-{io:X}.{id:X}.{id2:X} exchanges plain nibbles: no {', '.join(options)}")
    return engine and engine(**options)


def _hold_ns():
    return table.SAFETY_WORD_HOLD_US * 1_000


class Engine:
    """What all kinds have. values: input words by channel; outputs: as the host wrote them, None until received."""

    def __init__(self, values=(), strings=None, invalid=0, overflow=0):
        self.values = [*values, *(0,) * (CHANNELS - len(values))]
        self.outputs = [None] * CHANNELS
        self.invalid, self.overflow = invalid, overflow     # bit per channel: sends V = 0, O = 1
        self.strings = dict(strings or {})
        self.inputs = 0                                     # plain input nibble beside the transaction
        self.reset()

    def reset(self):
        """Reset of the slave: the dialogue and the outputs are gone; values and strings are the device's and stay."""
        self.outputs = [None] * CHANNELS

    def write_parameter(self, value, t_ns):
        """WPAR -> parameter as read back."""
        return value

    def update(self, t_ns):
        """Let time-outs up to t_ns happen."""

    def exchange(self, nibble, t_ns):
        """DEXG -> nibble of the answer."""
        self.update(t_ns)
        return self._exchange(nibble, t_ns)


# ---------------------------------------------------------------------------------------------- CTT1
def _reversed(three):
    return (three & 1) << 2 | three & 2 | three >> 2


def _payload(three):
    """Three bits of a payload triple between frame (left bit highest) and line, either way."""
    return three if table.CTT1_MSB_LEFT else _reversed(three)


def _number(t):
    """Number of triple t (0: the one with V) between frame and line, either way."""
    return 7 - t if table.CTT1_COUNT_UP else t


def _channel(e):
    """Channel between number and E triple, either way."""
    return _reversed(e) if table.CTT1_E_REVERSED else e


def _pack(control, three):
    return control << 3 | three if table.CTT1_TOGGLE_POS == 3 else three << 1 | control


def _unpack(nibble):
    """-> (control bit, three bits)"""
    return (nibble >> 3, nibble & 7) if table.CTT1_TOGGLE_POS == 3 else (nibble & 1, nibble >> 1)


class Sender:
    """The call names a triple, the answer carries it. A frame is taken whole when its first triple is asked for."""

    def __init__(self, triples, frame):
        """frame(k) -> bits of the k-th frame"""
        self._first, self._frame_of = triples - 1, frame
        self._k, self._frame, self._done = 0, None, False

    def step(self, new, three):
        """new: another control bit than in the call before -> three bits of the answer."""
        t = _number(three)
        if t == self._first and (new or self._frame is None):
            self._k += self._done                       # a frame that was broken off is sent again
            self._frame, self._done = self._frame_of(self._k), False
        if self._frame is None:
            return 0                                    # a call from before the dialogue: V = 0 whatever it asks for
        self._done |= t == 0
        return _payload(self._frame >> 3 * t & 7)


class Receiver:
    """The call carries a triple, the answer names the next one wanted."""

    def __init__(self, triples, take):
        """take(bits) is called with each complete frame"""
        self._first, self._take = triples - 1, take
        self.restart()

    def restart(self, lost=False):
        """Wants the first triple again. lost: the next one may be any triple of anything, it is not taken."""
        self._want, self._frame, self._lost = self._first, 0, lost

    def step(self, new, three):
        if new and self._lost:
            self._lost = False
        elif new:
            self._frame = self._frame << 3 | _payload(three)
            self._want -= 1
            if self._want < 0:
                frame = self._frame
                self.restart()
                self._take(frame)
        return _number(self._want)


class Ctt1(Engine):
    """S-7.1 .. S-7.4: values of 16 bits with channel, overflow and valid, a triple per call; S-7.4 has strings.

    S-7.1 and S-7.2 have no strings and may have fewer triples: the value is left-aligned in what is there.
    """

    def __init__(self, id, id2, triples=None, **common):
        self.is_input = bool(id2 & 8)
        if id in (1, 2):
            self.triples = triples or (table.CTT1_TRIPLES_71 if id == 1 else table.CTT1_TRIPLES_72)
            if not 3 <= self.triples <= table.CTT1_VALUE_TRIPLES:
                raise ValueError(f"{self.triples} triples, not 3 .. {table.CTT1_VALUE_TRIPLES}")
        elif triples is not None:
            raise ValueError(f"triples: S-7.{id} has {table.CTT1_VALUE_TRIPLES}")
        else:
            self.triples = table.CTT1_VALUE_TRIPLES
        self.channels = (1, 2, 4, 4)[id2 & 3]
        self._unused = 3 * (table.CTT1_VALUE_TRIPLES - self.triples)    # low bits that a short frame does not carry
        self._has_strings, self._supervises = id == 4, id == 3 and not self.is_input
        super().__init__(**common)

    def reset(self):
        super().reset()
        self._control = _unpack(15 ^ 15 * table.CTT1_INVERT_OUT)[0]     # the line rests at F, and activation sends it
        self._step_ns = None                                            # last step of a receiver
        self._parameter = 15
        self._set_mode(table.CTT1_PAR_DATA)

    def _set_mode(self, mode):
        """A new dialogue; the control bit goes on alternating."""
        self._mode, self._written = mode, b""
        kinds = {table.CTT1_PAR_ID: ID, table.CTT1_PAR_DIAG: DIAGNOSIS, table.CTT1_PAR_RD: PARAMETERS}
        if mode == table.CTT1_PAR_WR:
            self._dialogue = Receiver(table.CTT1_SEQUENCE_TRIPLES, self._take_sequence)
        elif mode in kinds:
            frames = self._sequences(self.strings.get(kinds[mode], b""))
            self._dialogue = Sender(table.CTT1_SEQUENCE_TRIPLES, lambda k: frames[k % len(frames)])
        elif self.is_input:
            self._dialogue = Sender(self.triples, self._value)
        else:
            self._dialogue = Receiver(self.triples, self._take_value)

    def write_parameter(self, value, t_ns):
        self.update(t_ns)
        self._parameter = value
        if self._has_strings:
            modes = (table.CTT1_PAR_ID, table.CTT1_PAR_DIAG, table.CTT1_PAR_RD, table.CTT1_PAR_WR)
            mode = value if value in modes else table.CTT1_PAR_DATA
            if mode != self._mode:                                      # a repeated WPAR disturbs nothing
                self._set_mode(mode)
        return value

    def update(self, t_ns):
        """After such a silence the master may have begun anew, without a way to say so."""
        if self._step_ns is None or t_ns - self._step_ns < table.CTT1_SLAVE_TIMEOUT_MS * MS:
            return
        self._step_ns = None
        if isinstance(self._dialogue, Receiver):
            self._dialogue.restart(lost=True)
        if self._supervises and self._parameter & 1:
            self.outputs = [None] * CHANNELS

    def _exchange(self, nibble, t_ns):
        control, three = _unpack(nibble ^ 15 * table.CTT1_INVERT_OUT)
        new, self._control = control != self._control, control
        if new:
            self._step_ns = t_ns
        return _pack(control ^ table.CTT1_ECHO_INVERTED, self._dialogue.step(new, three))

    # ------------------------------------------------------------------ frames
    def _value(self, k):
        """Frame of the next channel: E1..E3, D16.., O, V."""
        channel = k % self.channels
        data = self.values[channel] & 0xFFFF
        good, over = not self.invalid >> channel & 1, self.overflow >> channel & 1
        return _channel(channel) << 3 * (self.triples - 1) | data >> self._unused << 2 | over << 1 | good

    def _take_value(self, frame):
        channel = _channel(frame >> 3 * (self.triples - 1))
        if frame & 1 and channel < self.channels:                       # V
            data = frame >> 2 & 0xFFFF >> self._unused
            self.outputs[channel] = data << self._unused

    @staticmethod
    def _sequences(string):
        """Frames of 24 bits, F in all but the last. A string that is not there is one sequence with V = 0."""
        parts = [string[k:k + 3].ljust(3, b"\0") for k in range(0, len(string), 3)]
        frames = [int.from_bytes(part) & ~3 | (k + 1 < len(parts)) << 1 | 1 for k, part in enumerate(parts)]
        return frames or [0]

    def _take_sequence(self, frame):
        if not frame & 1:
            self._written = b""                                         # nobody can be told: the old string stays
            return
        # a string that is too long is dropped to its end, not taken from there on
        self._written = self._written[:table.CTT1_STRING_BYTES] + frame.to_bytes(3)
        if not frame & 2:
            if len(self._written) <= table.CTT1_STRING_BYTES:
                self.strings[PARAMETERS] = self._written
            self._written = b""


# ---------------------------------------------------------------------------------------------- CTT2
class Ctt2(Engine):
    """S-7.5.5, S-7.A.5, S-B.A.5: bytes in series, each direction with its own clock, messages over them.

    The objects are strings[index]; object 0 is the ID object, its fifth byte the I/O configuration.
    swapped: clock on DI2 and data on DI3. busy: that many acyclic requests get the error "busy" first.
    A call repeated within the hold time with the same nibble is the master's immediate repetition: our answer was
    lost, and going on would skip a clock level. Losing both answers does skip one; the gap clears that up.
    """

    def __init__(self, io, swapped=False, busy=0, **common):
        self.swapped, self.busy, self.device_error = swapped, busy, b""
        self._parallel = 0b0011 if io == 7 else 0
        super().__init__(**common)
        self.strings.setdefault(0, PLAIN_ID_OBJECT)

    def reset(self):
        super().reset()
        self._clock = self._idle[0]         # of the master
        self._still = 0                     # calls without an edge
        self._bits, self._message = "", b""
        self._levels = []                   # (clock, data) still to be sent
        self._now = self._idle
        self._last = None                   # (nibble, ns) of the last answered call

    @property
    def _idle(self):
        return table.CTT2_IDLE & 1, table.CTT2_IDLE >> 1

    def _exchange(self, nibble, t_ns):
        repeated = self._last and self._last[0] == nibble and t_ns - self._last[1] < _hold_ns()
        self._last = nibble, t_ns
        if not repeated:
            self._receive(nibble >> table.CTT2_DO_CLOCK & 1, nibble >> table.CTT2_DO_DATA & 1)
            self._now = self._levels.pop(0) if self._levels else self._idle
        clock, data = reversed(self._now) if self.swapped else self._now
        return self.inputs & self._parallel | clock << table.CTT2_DI_CLOCK | data << table.CTT2_DI_DATA

    # ------------------------------------------------------------------ bits
    def _receive(self, clock, data):
        edge, self._clock = clock != self._clock, clock
        self._still = 0 if edge else self._still + 1
        if edge and clock == table.CTT2_RISING_EDGE:
            self._bits += str(data)
            if len(self._bits) == 8:
                bits = self._bits if table.CTT2_MSB_FIRST else self._bits[::-1]
                self._bits = ""
                self._message += bytes((int(bits, 2),))
                self._examine()
        if self._still == table.CTT2_GAP_CALLS:
            if self._message and READ <= self._message[0] < GOOD and self._needs() is None:
                self._refuse(NOT_IMPLEMENTED)       # of an unknown length: the gap is its end; from 40 on: a response
            self._bits, self._message = "", b""

    def _send(self, message):
        bits = "".join(f"{byte:08b}" if table.CTT2_MSB_FIRST else f"{byte:08b}"[::-1] for byte in message)
        active = table.CTT2_RISING_EDGE
        self._levels = [(clock, int(bit)) for bit in bits for clock in (1 - active, active)]

    # ------------------------------------------------------------------ messages
    def _cyclic_bytes(self):
        """-> bytes of inputs, of outputs, from the I/O configuration byte."""
        configuration = self.strings[0][4] if len(self.strings[0]) > 4 else 0
        return CYCLIC_BYTES[configuration & 7], CYCLIC_BYTES[configuration >> 4 & 7]

    def _needs(self):
        """Length of the message that has begun, as far as its bytes tell; None: a code nobody knows."""
        message = self._message
        match message[0]:
            case 0x00:
                return 1
            case 0x01:
                return 1 + self._cyclic_bytes()[1]
            case 0x10 | 0x12:
                return 3
            case 0x11 | 0x13:
                return 3 + message[2] if len(message) > 2 else 4
            case 0x1D:
                return 4 + message[3] if len(message) > 3 else 5
        return None

    def _examine(self):
        needs = self._needs()
        if needs is None or len(self._message) < needs:
            return
        message = self._message
        if message[0] == GET_CYCLIC:
            self._send(self._cyclic_inputs())
        elif message[0] == PUT_CYCLIC:
            self._cyclic_outputs(message[1:])
        else:
            self._acyclic(message)
        self._message = b""

    def _cyclic_inputs(self):
        size = self._cyclic_bytes()[0]
        if size == 1:
            return bytes((self.values[0] & 0xFF,))
        return b"".join((value & 0xFFFF).to_bytes(2) for value in self.values[:size // 2])

    def _cyclic_outputs(self, data):
        words = [data[0]] if len(data) == 1 else [int.from_bytes(data[k:k + 2]) for k in range(0, len(data), 2)]
        self.outputs[:len(words)] = words

    def _acyclic(self, message):
        code, index, *lengths = message[:4]
        if self.busy:
            self.busy -= 1
            return self._refuse(BUSY)
        if index not in self.strings or (index == 0 and code not in (READ, DEVICE_READ)):
            return self._refuse(ILLEGAL_INDEX)
        old = self.strings[index]
        read = lengths[0] if code in (READ, DEVICE_READ, EXCHANGE) else 0
        new = message[4:] if code == EXCHANGE else message[3:] if code in (WRITE, DEVICE_WRITE) else None
        too_long = read > len(old) or read >= table.CTT2_MESSAGE_BYTES or len(message) > table.CTT2_MESSAGE_BYTES
        if too_long or (new is not None and len(new) != len(old)) or (new is None and read == 0):
            return self._refuse(ILLEGAL_LENGTH)
        if new is not None:
            self.strings[index] = new
        return self._send(bytes((code + GOOD,)) + self.strings[index][:read])

    def _refuse(self, error):
        code = self._message[0]
        self._send(bytes((code + REFUSED, error)) + self.device_error * (code in (DEVICE_READ, DEVICE_WRITE)))


# ---------------------------------------------------------------------------------------------- CTT3
def _pair(nibble):
    """Payload I1 I0 of a call, host level."""
    return nibble & 3 ^ 3 * table.CTT3_INVERT_OUT


class Mux4(Engine):
    """S-7.A.7: outputs 3, 2 in a call with I2 = 1, then 1, 0 with I2 = 0, set together at that falling edge."""

    def reset(self):
        super().reset()
        self._upper = None              # after reset a call with I2 = 0 is no falling edge

    def _exchange(self, nibble, t_ns):
        if nibble & 4:
            self._upper = _pair(nibble)
        elif self._upper is not None:
            self.outputs[0] = self._upper << 2 | _pair(nibble)
            self._upper = None
        return self.inputs


class Mux8(Engine):
    """S-7.A.A: the answer says which pair it carries; the next call confirms it with I2 and carries an output pair."""

    def reset(self):
        super().reset()
        self._selector = None           # in the last answer
        self._pairs = {}

    def _exchange(self, nibble, t_ns):
        s = self._selector
        if s is None:
            self._select(0)
        elif nibble >> 2 & 1 == s & 1 ^ table.CTT3_AA_INVERTED:
            self._take(s + table.CTT3_AA_OFFSET & 3, _pair(nibble))
            self._select(s + 1 & 3)
        return self._selector << 2 | self._bits >> 2 * self._selector & 3

    def _select(self, s):
        self._selector = s
        if s == 0:
            self._bits = self.values[0] & 0xFF      # one sample for the four pairs

    def _take(self, number, pair):
        self._pairs[number] = pair
        if number == 3 and len(self._pairs) == 4:       # with an offset the first round has no pair 0
            self.outputs[0] = sum(pair << 2 * k for k, pair in self._pairs.items())


# ---------------------------------------------------------------------------------------------- CTT4, safety
class Ctt4(Engine):
    """Placeholder for S-7.A.8 (16 bits and one output) and S-7.A.9 (two times 16 bits): the call numbers a nibble."""

    def __init__(self, id2, **common):
        self._two = id2 == 9
        super().__init__(**common)

    def reset(self):
        super().reset()
        self._last = None
        self._words = [0, 0]

    def _exchange(self, nibble, t_ns):
        number, extra = nibble & 3, nibble >> table.CTT4_CHANNEL_BIT & 1
        channel = extra if self._two else 0
        if not self._two:
            self.outputs[0] = extra
        first = number == table.CTT4_NIBBLES - 1
        if first and self._last != (number, channel):               # a repetition keeps the word it began
            self._words[channel] = self.values[channel] & 0xFFFF
        self._last = number, channel
        return self._words[channel] >> 4 * number & 15


class Safety(Engine):
    """S-x.B: the next of eight words at every call. closed: bits 0, 1 = channel 1, 2; an open one has its bits at 0."""

    def __init__(self, words=SAFETY_WORDS, closed=3, **common):
        if len(words) != 8:
            raise ValueError(f"{len(words)} words, not 8")
        self.words, self.closed = tuple(words), closed
        super().__init__(**common)

    def reset(self):
        super().reset()
        self._k, self._answered_ns = 0, None

    def _exchange(self, nibble, t_ns):
        if self._answered_ns is not None and t_ns - self._answered_ns >= _hold_ns():
            self._k = (self._k + 1) % 8
        self._answered_ns = t_ns
        return self.words[self._k] & (3 * (self.closed & 1) | 12 * (self.closed >> 1 & 1))
