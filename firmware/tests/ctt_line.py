# SPDX-License-Identifier: Apache-2.0
"""A line that loses calls, with one slave of cocotb_tests/models/ctt.py on it, for the tests of the engines.

The slaves here are the models with probes: what they took, when they ask for a value, and answers that a good slave
would not give. Nibbles are at line level, as the models want them.
"""
from asi import ctt_table as table

from cocotb_tests.models import ctt

OK, REQUEST_LOST, ANSWER_LOST, REPEATED, LATE = "ok", "request lost", "answer lost", "repeated", "late"
OUTCOMES = (OK, REQUEST_LOST, ANSWER_LOST, REPEATED, LATE)
REPEAT_NS = 160_000     # a call to its immediate repetition


def choose(monkeypatch, *defines):
    """The table of the slaves as these constants of the firmware ("ASI_CTT1_COUNT_UP=1")."""
    for define in defines:
        name, value = define.removeprefix("ASI_").split("=")
        monkeypatch.setattr(table, name, int(value))


class Line:
    """One live slave of the engine (index) and its model, a call at a time.

    Outcomes: the request is lost; the answer is lost; the answer is lost and the sequencer's repetition is answered;
    the firmware is late, so the next call carries the old nibble again.
    """
    def __init__(self, env, index, codes, slave, us_per_call=5000, outputs=0):
        self.ffi, self.lib = env
        self.index, self.slave, self.us, self.outputs = index, slave, us_per_call, outputs
        self.now = 0
        self.live = self.lib.fc_open(index, codes, self.now)
        self.slot = self.due = self.lib.fc_first(index, outputs)
        self.log = []
        self.word = self.lib.fc_word(index)

    def on_line(self, nibble):
        """A/B slaves: I3 is ~Sel."""
        if not self.slave.extended:
            return nibble
        return (nibble & 7) | (0 if self.index > 32 else 8)

    def call(self, outcome=OK):
        if outcome != LATE:
            self.slot = self.due
        sent = self.on_line(self.slot)
        self.slave.now_ns += 1_000 * self.us    # never wraps, unlike the time of the firmware
        answer = None
        if outcome != REQUEST_LOST:
            answer = self.slave.call(sent)
        if outcome == REPEATED:
            self.slave.now_ns += REPEAT_NS
            answer = self.slave.call(sent)
            self.slave.now_ns -= REPEAT_NS
        ok = outcome not in (REQUEST_LOST, ANSWER_LOST)
        self.now += self.us
        self.log.append((sent, answer if ok else None))
        self.due = self.lib.fc_call(self.index, ok, sent, answer if ok else 0, self.outputs, self.now & 0xFFFFFFFF)
        assert 0 <= self.due <= 15
        return self

    def run(self, calls, outcome=OK):
        for _ in range(calls):
            self.call(outcome)
        return self

    def until(self, condition, limit, outcome=OK):
        """-> calls made until the condition holds"""
        for n in range(limit):
            if condition():
                return n
            self.call(outcome)
        raise AssertionError(f"not within {limit} calls; status {self.status:#04x}")

    @property
    def status(self):
        return self.lib.fc_status()[self.index]

    @property
    def ai(self):
        return [self.lib.fc_ai()[self.word + k] for k in range(4)]

    def set_ao(self, *values):
        for k, value in enumerate(values):
            self.lib.fc_ao()[self.word + k] = value


class Probe:
    """What the slaves have in common. call(nibble) -> answer; a test may put another function there."""
    extended = False

    def __init__(self, *args, **options):
        self.now_ns = 0
        super().__init__(*args, **options)

    def call(self, nibble):
        return self.exchange(nibble & 7 if self.extended else nibble, self.now_ns)


class Ctt1(Probe, ctt.Ctt1):
    """Input or output slave with strings. feed(channel) -> (value, overflow, valid), asked for when a value begins.

    strings: by the parameter that selects them, sent as they are, F and V included.
    """
    def __init__(self, output=False, channels=1, triples=7, feed=None, strings=None):
        self.feed = feed or (lambda channel: (0, 0, 1))
        self.taken = []                   # output: (channel, value)
        kinds = {table.CTT1_PAR_ID: ctt.ID, table.CTT1_PAR_DIAG: ctt.DIAGNOSIS, table.CTT1_PAR_RD: ctt.PARAMETERS}
        code = {1: 0, 2: 1, 4: 2}.get(channels, 3) | (0 if output else 8)
        super().__init__(4 if triples == 7 else 1, code, None if triples == 7 else triples,
                         strings={kinds[parameter]: text for parameter, text in (strings or {}).items()})
        self.channels, self.values = channels, [0] * 8  # more than the codes tell, too

    @property
    def values_taken(self):
        """Channel -> values in their order."""
        return {channel: [v for c, v in self.taken if c == channel] for channel, _ in self.taken}

    @property
    def written(self):
        return self.strings.get(ctt.PARAMETERS)

    def wpar(self, parameter):
        self.write_parameter(parameter, self.now_ns)

    def _value(self, k):
        channel = k % self.channels
        self.values[channel], overflow, valid = self.feed(channel)
        self.invalid, self.overflow = (1 - valid) << channel, overflow << channel
        return super()._value(k)

    def _take_value(self, frame):
        before, self.outputs = self.outputs, [None] * ctt.CHANNELS
        super()._take_value(frame)
        self.taken += [(k, value) for k, value in enumerate(self.outputs) if value is not None]
        self.outputs = [old if new is None else new for old, new in zip(before, self.outputs)]

    @staticmethod
    def _sequences(string):
        return [int.from_bytes(string[k:k + 3]) for k in range(0, len(string), 3)] or [0]


class Ctt2(Probe, ctt.Ctt2):
    """Serial slave. inputs_now() -> bytes for a get, None: silence; answers: {request: response}, else silence.

    config: bytes that it moves; delay: calls before a response begins.
    """
    def __init__(self, config, inputs=None, answers=None, extended=False, swapped=False, delay=0):
        self.extended, self.delay = extended, delay
        self.answers = {b"\x10\x00\x05": bytes([0x50, 1, 2, 3, 4, config])} | (answers or {})
        self.requests, self.puts, self.sent = [], [], None
        super().__init__(7, swapped, strings={0: bytes([1, 2, 3, 4, config])})
        self.n_in, self.n_out = self._cyclic_bytes()
        self.inputs_now = inputs or (lambda: bytes(self.n_in))

    def call(self, nibble):
        self.sent = nibble & (7 if self.extended else 15)
        return super().call(nibble)

    def levels_left(self):
        return len(self._levels)

    def _cyclic_inputs(self):
        self.requests.append(self._message)
        return self.inputs_now()

    def _cyclic_outputs(self, data):
        self.requests.append(self._message)
        self.puts.append(data)

    def _acyclic(self, message):
        self.requests.append(message)
        self._send(self.answers.get(message))

    def _refuse(self, error):
        self.requests.append(self._message)     # what nobody sent: a request that the line has changed
        super()._refuse(error)

    def _send(self, message):
        super()._send(message or b"")
        self._levels = [self._idle] * (self.delay if message else 0) + self._levels


class Mux4(Probe, ctt.Mux4):
    """S-7.A.7; switched: all outputs it has set, in their order."""
    extended = True

    def __init__(self):
        self.switched = []
        super().__init__()

    def _exchange(self, nibble, t_ns):
        self.outputs[0] = None
        answer = super()._exchange(nibble, t_ns)
        self.switched += [self.outputs[0]] * (self.outputs[0] is not None)
        return answer


class Mux8(Probe, ctt.Mux8):
    """S-7.A.A; feed() -> the byte of the next round; taken: all bytes received."""
    extended = True

    def __init__(self, feed=None):
        self.feed, self.taken = feed or (lambda: 0), []
        super().__init__()

    def _select(self, s):
        if s == 0:
            self.values[0] = self.feed()
        super()._select(s)

    def _take(self, number, pair):
        self.outputs[0] = None
        super()._take(number, pair)
        self.taken += [self.outputs[0]] * (self.outputs[0] is not None)


class Ctt4(Probe, ctt.Ctt4):
    """The placeholder."""
    extended = True

    def __init__(self, values):
        super().__init__(9 if len(values) > 1 else 8, values=values)
