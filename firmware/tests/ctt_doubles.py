# SPDX-License-Identifier: Apache-2.0
"""Slaves of combined transactions at nibble level, and a line that loses calls: small, written apart from the firmware.

Constants come from rdl/ctt.toml by way of asi.ctt_table; `other` replaces some, as the firmware's -D does.
"""
from asi import ctt_table as table

OK, REQUEST_LOST, ANSWER_LOST, REPEATED, LATE = "ok", "request lost", "answer lost", "repeated", "late"
OUTCOMES = (OK, REQUEST_LOST, ANSWER_LOST, REPEATED, LATE)


class Line:
    """One live slave of the engine (index) and its double, a call at a time.

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
        answer = None
        if outcome != REQUEST_LOST:
            answer = self.slave.call(sent)
        if outcome == REPEATED:
            answer = self.slave.call(sent)
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


def bits(value, n):
    return [(value >> k) & 1 for k in reversed(range(n))]


class Ctt1:
    """Input or output slave with strings. feed(channel) -> (value, overflow, valid), asked for when a value begins."""
    extended = False

    def __init__(self, output=False, channels=1, triples=7, feed=None, strings=None, other=None):
        self.p = {k: getattr(table, k) for k in dir(table) if k.startswith("CTT1_")} | (other or {})
        self.output, self.channels, self.triples = output, channels, triples
        self.feed = feed or (lambda channel: (0, 0, 1))
        self.strings = strings or {}      # parameter -> bytes to read
        self.written = None               # bytes of a complete written string
        self.served = 1 - self.p["CTT1_START_TOGGLE"]
        self.reply = 0
        self.channel = 0
        self.values = {}                  # output: channel -> values taken
        self.taken = []
        self.mode = "value"
        self.enter(triples)

    def enter(self, n):
        self.n, self.want, self.frame = n, 0, []

    def wpar(self, parameter):
        """WPAR as the slave sees it: another mode begins with its first triple."""
        p = self.p
        if parameter == p["CTT1_PAR_DATA"]:
            self.mode = "value"
            self.enter(self.triples)
        else:
            self.mode = "write" if parameter == p["CTT1_PAR_WR"] else "read"
            self.text = self.strings.get(parameter, b"")
            self.position = 0
            self.buffer = b""
            self.enter(8)

    # -- nibble <-> control bit and three bits, left first
    def split(self, nibble):
        if self.p["CTT1_INVERT_OUT"]:
            nibble ^= 15
        b = bits(nibble, 4)
        return (b[3], b[:3]) if self.p["CTT1_TOGGLE_POS"] == 0 else (b[0], b[1:])

    def join(self, control, three):
        control ^= self.p["CTT1_ECHO_INVERTED"]
        b = [*three, control] if self.p["CTT1_TOGGLE_POS"] == 0 else [control, *three]
        return int("".join(map(str, b)), 2)

    def order(self, three):
        return three if self.p["CTT1_MSB_LEFT"] else three[::-1]

    def number(self, k):
        """number on the line of the k-th triple"""
        down = self.n - 1 - k
        return bits(7 - down if self.p["CTT1_COUNT_UP"] else down, 3)

    def call(self, nibble):
        control, three = self.split(nibble)
        if control != self.served:
            self.served = control
            if self.mode == "read" or (self.mode == "value" and not self.output):
                self.reply = self.join(control, self.order(self.give(three)))
            else:
                self.take(self.order(three))
                self.reply = self.join(control, self.number(self.want))
        return self.reply

    def give(self, number):
        wanted = [k for k in range(self.n) if self.number(k) == number]
        if not wanted:
            return [0, 0, 0]
        if wanted[0] == 0:
            if self.mode == "read":
                word = int.from_bytes(self.text[self.position:self.position + 3].ljust(3, b"\0"), "big")
                self.position += 3
                self.frame = bits(word, 24)
            else:
                value, overflow, valid = self.feed(self.channel)
                e = bits(self.channel, 3)
                data = bits(value, 16)[:3 * (self.n - 1) - 2]
                self.frame = (e[::-1] if self.p["CTT1_E_REVERSED"] else e) + data + [overflow, valid]
                self.channel = (self.channel + 1) % self.channels
            assert len(self.frame) == 3 * self.n
        return self.frame[3 * wanted[0]:3 * wanted[0] + 3] or [0, 0, 0]

    def take(self, three):
        self.frame = (self.frame if self.want else []) + three
        self.want += 1
        if self.want < self.n:
            return
        self.want = 0
        if self.mode == "write":
            word = int("".join(map(str, self.frame)), 2)
            self.buffer += word.to_bytes(3, "big")
            if not word & 2:
                self.written = self.buffer
            return
        e = self.frame[:3]
        channel = int("".join(map(str, e[::-1] if self.p["CTT1_E_REVERSED"] else e)), 2)
        data = self.frame[3:-2]
        value = int("".join(map(str, data)), 2) << (16 - len(data))
        if self.frame[-1]:
            self.values.setdefault(channel, []).append(value)
            self.taken.append(channel)


class Ctt2:
    """Serial slave. inputs() -> bytes for a get; answers {request: response}; response None: silence."""
    def __init__(self, config, inputs=None, answers=None, extended=False, swapped=False, other=None, delay=0):
        self.p = {k: getattr(table, k) for k in dir(table) if k.startswith("CTT2_")} | (other or {})
        self.extended, self.swapped = extended, swapped
        self.sizes = [0, 1, 2, 4, 6, 8]
        self.n_in, self.n_out = self.sizes[config & 7], self.sizes[config >> 4 & 7]
        self.inputs = inputs or (lambda: bytes(self.n_in))
        self.answers = {b"\x10\x00\x05": bytes([0x50, 1, 2, 3, 4, config])} | (answers or {})
        self.delay = delay
        self.digital = 0
        self.requests, self.puts = [], []
        self.clock = self.p["CTT2_IDLE"] & 1
        self.still = 0
        self.bits, self.levels = [], []
        self.outputs = None

    def call(self, nibble):
        p = self.p
        self.outputs = nibble & ~3 & (7 if self.extended else 15)
        clock, data = nibble >> p["CTT2_DO_CLOCK"] & 1, nibble >> p["CTT2_DO_DATA"] & 1
        if clock == self.clock:
            self.still += 1
            if self.still >= p["CTT2_GAP_CALLS"]:
                self.bits = []
        else:
            self.still = 0
            self.clock = clock
            if clock == (1 if p["CTT2_RISING_EDGE"] else 0):
                self.bits.append(data)
                if len(self.bits) % 8 == 0:
                    self.received()
        clock, data = self.levels.pop(0) if self.levels else (p["CTT2_IDLE"] & 1, p["CTT2_IDLE"] >> 1)
        at = (p["CTT2_DI_DATA"], p["CTT2_DI_CLOCK"]) if self.swapped else (p["CTT2_DI_CLOCK"], p["CTT2_DI_DATA"])
        return clock << at[0] | data << at[1] | self.digital & ~(1 << at[0] | 1 << at[1])

    def order(self, b):
        return b if self.p["CTT2_MSB_FIRST"] else b[::-1]

    def received(self):
        octets = [self.order(self.bits[k:k + 8]) for k in range(0, len(self.bits), 8)]
        message = bytes(int("".join(map(str, b)), 2) for b in octets)
        need = {0x00: 1, 0x01: 1 + self.n_out}.get(message[0], 3)
        if message[0] in (0x11, 0x13) and len(message) > 2:
            need = 3 + message[2]
        if message[0] == 0x1D:
            need = 4 + message[3] if len(message) > 3 else 4
        if len(message) < need:
            return
        self.bits = []
        self.requests.append(message)
        if message[0] == 1:
            self.puts.append(message[1:])
            return
        self.send(self.inputs() if message[0] == 0 else self.answers.get(message))

    def send(self, message):
        edge = 1 if self.p["CTT2_RISING_EDGE"] else 0
        idle = self.p["CTT2_IDLE"]
        self.levels = [(idle & 1, idle >> 1)] * self.delay if message else []
        for octet in message or b"":
            for bit in self.order(bits(octet, 8)):
                self.levels += [(1 - edge, bit), (edge, bit)]


class Ctt3x4:
    """S-7.A.7 after the edge detector of the field: four outputs at a call with I2 = 0 that follows one with I2 = 1."""
    extended = True

    def __init__(self):
        self.before, self.high, self.inputs, self.switched = 0, 0, 0, []

    def call(self, nibble):
        i2, pair = nibble >> 2 & 1, (nibble & 3) ^ (3 if table.CTT3_INVERT_OUT else 0)
        if i2:
            self.high = pair
        elif self.before:
            self.switched.append(self.high << 2 | pair)
        self.before = i2
        return self.inputs


class Ctt3x8:
    """S-7.A.A under the echo rule: takes the pair for the selector sent last if I2 confirms it, else says it again."""
    extended = True

    def __init__(self, feed=None, other=None):
        self.p = {"offset": table.CTT3_AA_OFFSET, "inverted": table.CTT3_AA_INVERTED} | (other or {})
        self.feed = feed or (lambda: 0)
        self.s, self.pairs, self.taken, self.octet = None, {}, [], 0

    def call(self, nibble):
        pair = (nibble & 3) ^ (3 if table.CTT3_INVERT_OUT else 0)
        if self.s is None:
            self.s = 0
            self.octet = self.feed()
        elif (nibble >> 2 & 1) == (self.s & 1) ^ self.p["inverted"]:
            self.pairs[(self.s + self.p["offset"]) & 3] = pair
            self.s = (self.s + 1) & 3
            if self.s == 0:
                self.taken.append(sum(v << 2 * k for k, v in self.pairs.items()))
                self.octet = self.feed()
        return self.s << 2 | self.octet >> 2 * self.s & 3


class Ctt4:
    """The placeholder: answers the nibble that the call names."""
    extended = True

    def __init__(self, values):
        self.values, self.extra = values, None

    def call(self, nibble):
        self.extra = nibble >> table.CTT4_CHANNEL_BIT & 1
        value = self.values[self.extra if len(self.values) > 1 else 0]
        return value >> 4 * (nibble & 3) & 15
