# SPDX-License-Identifier: Apache-2.0
"""A chip made of a few rules, for tests of the tools: it has the host window, makes telegrams, and obeys the lists.

It is no model of the master: detection takes no time, a lost slave is gone with the next cycle, a combined transaction
is one cycle, and a function is answered at once or after function_ns. `refuse` = {function code: asi_status_t}.
"""
from types import SimpleNamespace

from asi import regmap
from asi.eye import empty
from asi.combined import kind_of, word_at
from asi.plant import Faults
from asi.regmap import ErrorClass, Phase
from asi.status import LogEvent, Status
from asi.telegram import encode_call
from asi.window import INDICES, MAGIC

BOOT_NS = 1_000_000
CALL_NS = 154_000
MISSING_NS = 150_000


class FakeBench:
    clk_hz = 16_000_000

    def __init__(self, settle_ns=20_000_000, *, boots=True, commit_result=0, applies=True, extra_ns=0, sick=False,
                 break_at_ns=None, function_ns=0, refuse=None):
        self.settle_ns, self.boots, self.commit_result, self.applies = settle_ns, boots, commit_result, applies
        self.extra_ns, self.sick, self.break_at_ns = extra_ns, sick, break_at_ns
        self.now, self.good, self.low = 0, True, False
        self.slaves, self.log, self.closed = [], [], False
        self.memory = [0] * 4096
        self.cycle_times, self.started_ns = [], None
        self.writes = []
        self.sent = self.failed = self.cycles = 0
        self.function_ns, self.refuse, self.asked_ns = function_ns, refuse or {}, None
        self.parameters = {}
        self.seen = [set(), set()]          # LDS, LAS of the last cycle, for the event log

    # ------------------------------------------------ what the runner calls
    def time(self):
        return self.now

    def host_read(self, addr):
        if addr == regmap.HOST_IN_SEQ and self.sick:
            self.memory[addr // 4] += 1
        return self.memory[addr // 4]

    def host_write(self, addr, data, be=15):
        assert be == 15 and 0 <= data < 1 << 32
        self.writes.append((self.now, addr, data))
        self.memory[addr // 4] = data

    def telegrams(self):
        log, self.log = self.log, []
        return log

    def pulse_counts(self):
        return empty()

    def stats(self):
        times = self.cycle_times
        return SimpleNamespace(
            clocks=self.now * 16 // 1000, cycles=self.cycles, cycle_periods=len(times),
            cycle_min_ns=min(times, default=0), cycle_max_ns=max(times, default=0),
            cycle_sum_ns=sum(times), irq_count=self.cycles, irq_clocks_max=1234, irq_clocks_max_cycle=234,
            phase_ns=[self.settle_ns, 0, 0, sum(times), 0, 0, 0, 0])

    def add(self, slave):
        mine = {**vars(slave), "values": [*slave.values, *[0] * (4 - len(slave.values))]}
        self.slaves.append(SimpleNamespace(**mine, faults=Faults(), got=[None] * 4))
        return len(self.slaves) - 1

    def set_inputs(self, slave, nibble):
        self.slaves[slave].inputs = nibble

    def set_present(self, slave, present):
        self.slaves[slave].present = present

    def set_periphery_fault(self, slave, fault):
        self.slaves[slave].fault = fault

    def set_faults(self, slave, faults):
        self.slaves[slave].faults = faults

    def set_value(self, slave, channel, word):
        self.slaves[slave].values[channel] = word

    def get_value(self, slave, channel):
        return self.slaves[slave].got[channel]

    def set_invalid(self, slave, invalid, overflow):
        self.slaves[slave].invalid, self.slaves[slave].overflow = invalid, overflow

    def set_safety(self, slave, table, closed):
        self.slaves[slave].safety = SimpleNamespace(table=table, closed=closed)

    def power(self, good):
        self.good = good

    def apf(self, low):
        self.low = low

    def close(self):
        self.closed = True

    def run(self, until_ns):
        if self.break_at_ns is not None and until_ns >= self.break_at_ns:
            raise KeyboardInterrupt
        if self.boots and until_ns >= BOOT_NS:
            self._put(regmap.HOST_VERSION, 1 << 24 | 2 << 16 | 3)
            self._put(regmap.HOST_MAGIC, MAGIC)
        if self.applies and self._get(regmap.HOST_FW_SEQ) != self._get(regmap.HOST_HOST_SEQ):
            self._put(regmap.HOST_FW_RESULT, self.commit_result & 0xFFFF_FFFF)
            self._put(regmap.HOST_FW_SEQ, self._get(regmap.HOST_HOST_SEQ))
        if self._get(regmap.HOST_FN_DONE) != self._get(regmap.HOST_FN_SEQ):
            self.asked_ns = self.now if self.asked_ns is None else self.asked_ns
            if self.now - self.asked_ns >= self.function_ns:
                self._function()
                self.asked_ns = None
        while self.now < until_ns:
            if self.now < self.settle_ns or self.low or not self.good:
                self.now = until_ns
                self._publish(frozenset(), frozenset(), Phase.OFFLINE)
            else:
                self._cycle()
        return self.now

    # ------------------------------------------------ the rules
    def _get(self, addr):
        return self.memory[addr // 4]

    def _put(self, addr, word):
        self.memory[addr // 4] = word

    def _projected(self):
        lps = self._get(regmap.HOST_LPS_CFG) | self._get(regmap.HOST_LPS_CFG + 4) << 32
        words = [self._get(regmap.HOST_PCD + 4 * k) for k in range(32)]
        return {i: words[i // 2] >> 16 * (i % 2) & 0xFFFF for i in INDICES if lps >> i & 1}

    def _event(self, event, index=0, data=0):
        head = self._get(regmap.HOST_LOG_HEAD)
        self._put(regmap.HOST_LOG + 8 * (head % 64), self.now // 1000 & 0xFFFF_FFFF)
        self._put(regmap.HOST_LOG + 8 * (head % 64) + 4, int(event) | index << 8 | data << 16)
        self._put(regmap.HOST_LOG_HEAD, head + 1)

    def _function(self):
        read = self._get
        code, first, second = read(regmap.HOST_FN_CODE), read(regmap.HOST_FN_ARG), read(regmap.HOST_FN_ARG + 4)
        asked = b"".join(read(regmap.HOST_FN_STRING + 4 * k).to_bytes(4, "little") for k in range(56))
        asked = asked[:read(regmap.HOST_FN_LEN)]
        slave = next((s for s in self.slaves if s.present and s.index == first), None)
        status, data, string = self.refuse.get(code, 0), 0, b""
        if status == 0 and code in (5, 20, 27, 29, 30, 31) and slave is None:
            status = Status.NOT_ACTIVE
        elif status == 0 and code == 20 and any(s.present and s.index == second for s in self.slaves):
            status = Status.ADDRESS_USED
        elif status == 0 and code == 5 and kind_of(slave.codes.io, slave.codes.id, slave.codes.id2).strings:
            status = Status.PROFILE
        if status == 0:
            match code:
                case 5:
                    self.parameters[first] = data = second
                case 20:
                    slave.index = second
                    self._event(LogEvent.ADDRESSED, second, first)
                case 29 | 30 | 27:
                    string = slave.strings[{30: 0, 29: 1, 27: 2}[code]]
                case 31:
                    string = bytes([asked[0] + 0x40]) + slave.strings[asked[1]]
        for k in range(0, len(string), 4):
            self._put(regmap.HOST_FN_STRING + k, int.from_bytes(string[k:k + 4], "little"))
        for base, word in ((regmap.HOST_FN_LEN, len(string)), (regmap.HOST_FN_STATUS, status & 0xFFFF_FFFF),
                           (regmap.HOST_FN_DATA, data), (regmap.HOST_FN_DONE, read(regmap.HOST_FN_SEQ))):
            self._put(base, word)

    def _auto_address(self):
        """The one missing slave comes back as a slave 0 with its codes."""
        present = [s for s in self.slaves if s.present]
        new = next((s for s in present if s.index == 0), None)
        missing = self._projected().keys() - {s.index for s in present}
        wrong = [s for s in present if s.index and self._projected().get(s.index) != s.codes.word]
        allowed = self._get(regmap.HOST_HOST_CTRL) & 9 == 9
        if new and allowed and len(missing) == 1 and not missing & self.seen[1] and not wrong \
                and self._projected()[min(missing)] == new.codes.word:
            new.index, = missing
            self._event(LogEvent.ADDRESSED, new.index)

    def _combined(self, there, las):
        """16-bit values, marks, the safety view."""
        aidi, marks, safe = [0] * 128, [0] * 64, [0, 0]
        for index in las:
            slave = there[index]
            kind = kind_of(slave.codes.io, slave.codes.id, slave.codes.id2)
            if kind.inputs or kind.outputs:
                marks[index] = 0b110000
            for channel in range(kind.inputs):
                word = slave.values[channel]
                if kind.group:
                    count = slave.codes.id2 - 8
                    word = sum(there[index + k].inputs << 4 * (4 - count + k) for k in range(count))
                valid = not (slave.invalid | slave.overflow) >> channel & 1
                aidi[word_at(index, channel)] = word if valid else 0x7FFF
                marks[index] |= valid << channel
            if kind.heard and not kind.outputs:
                slave.got[0] = self._get(regmap.HOST_OUT_IMG + index // 8 * 4) >> 4 * (index % 8) & 15
            for channel in range(kind.outputs):
                word = word_at(index, channel)
                slave.got[channel] = self._get(regmap.HOST_AODI + word // 2 * 4) >> 16 * (word % 2) & 0xFFFF
            for k in range(2):
                if slave.safety is not None and slave.safety.closed >> k & 1:
                    safe[k] |= 1 << index
        for k in range(64):
            self._put(regmap.HOST_AIDI + 4 * k, aidi[2 * k] | aidi[2 * k + 1] << 16)
        for k in range(16):
            self._put(regmap.HOST_CTT_STATE + 4 * k, int.from_bytes(bytes(marks[4 * k:4 * k + 4]), "little"))
        for k, bits in enumerate(safe):
            self._put(regmap.HOST_SAFE_IN + 8 * k, bits & 0xFFFF_FFFF)
            self._put(regmap.HOST_SAFE_IN + 8 * k + 4, bits >> 32)

    def _cycle(self):
        self._auto_address()
        there = {s.index: s for s in self.slaves if s.present}
        projected = self._projected()
        protected = self._get(regmap.HOST_HOST_CTRL) & 1
        las = [i for i, s in sorted(there.items()) if i and (not protected or projected.get(i) == s.codes.word)]
        begin = self.now
        for index in las:
            slave = there[index]
            nibble = self._get(regmap.HOST_OUT_IMG + 4 * (index // 8)) >> 4 * (index % 8) & 15
            call = encode_call("DEXG", index, nibble ^ 15, slave.codes.extended)
            if slave.faults.no_answer:
                self._telegram(call, Phase.DATA_EXCHANGE, ErrorClass.NO_RESPONSE)
                self._telegram(call, Phase.DATA_EXCHANGE, ErrorClass.OK, slave.inputs, repeated=1)
            else:
                self._telegram(call, Phase.DATA_EXCHANGE, ErrorClass.OK, slave.inputs)
        self._telegram(encode_call("RDIO", 30), Phase.INCLUSION, ErrorClass.NO_RESPONSE)
        self.now += self.extra_ns
        if self.cycles:
            self.cycle_times.append(self.now - begin)
        self.cycles += 1
        self._publish(frozenset(there), frozenset(las), Phase.DATA_EXCHANGE, there)
        self._combined(there, las)
        for k, (now, came, went) in enumerate(((set(there), LogEvent.DETECTED, LogEvent.GONE),
                                               (set(las), LogEvent.ACTIVATED, LogEvent.DEACTIVATED))):
            for index in sorted(now - self.seen[k]):
                self._event(came, index, there[index].codes.word if k == 0 else 0)
            for index in sorted(self.seen[k] - now):
                self._event(went, index)
            self.seen[k] = now

    def _telegram(self, call, phase, error, data=0, repeated=0):
        self.sent += 1
        ok = error == ErrorClass.OK
        self.log.append(SimpleNamespace(t_ns=self.now, delay_ns=21_500 if ok else -1, call=call, error_class=int(error),
                                        data=data, phase=int(phase), repeated=repeated, request_ok=1))
        self.now += CALL_NS if ok else MISSING_NS

    def _publish(self, lds, las, phase, there=None):
        there = there or {}
        projected = self._projected()
        for base, indices in ((regmap.HOST_LDS, lds), (regmap.HOST_LAS, las), (regmap.HOST_LPS, projected)):
            bits = sum(1 << i for i in indices)
            self._put(base, bits & 0xFFFF_FFFF)
            self._put(base + 4, bits >> 32)
        config_ok = {i: s.codes.word for i, s in there.items()} == projected
        protected = self._get(regmap.HOST_HOST_CTRL) & 1
        missing, wrong = projected.keys() - there, [i for i in there if i and i not in projected]
        assign = protected and not wrong and self._get(regmap.HOST_HOST_CTRL) >> 3 & 1
        for k in range(16):
            pp = self._get(regmap.HOST_PP + 4 * k).to_bytes(4, "little")
            pi = bytes(self.parameters.get(4 * k + byte, pp[byte]) for byte in range(4))
            self._put(regmap.HOST_PI + 4 * k, int.from_bytes(pi, "little"))
        bits = (config_ok | (0 in lds) << 1 | assign << 2 | (assign and len(missing) == 1) << 3
                | (not protected) << 4 | (phase != Phase.OFFLINE) << 5
                | (self.low or not self.good) << 6 | (phase == Phase.OFFLINE) << 7 | 1 << 8)
        self._put(regmap.HOST_FLAGS, bits)
        self._put(regmap.HOST_PHASE, int(phase))
        codes = [0xFFFF] * 64
        image = [0] * 8
        for index, slave in there.items():
            codes[index] = slave.codes.word
            if index in las:
                image[index // 8] |= slave.inputs << 4 * (index % 8)
        for k in range(32):
            self._put(regmap.HOST_CDI + 4 * k, codes[2 * k] | codes[2 * k + 1] << 16)
        for k in range(8):
            self._put(regmap.HOST_IN_IMG + 4 * k, image[k])
        if not self.sick:
            self._put(regmap.HOST_IN_SEQ, self._get(regmap.HOST_IN_SEQ) + 2)
        for name, value in (("SENT", self.sent), ("CYCLES", self.cycles), ("FAILED", self.failed)):
            self._put(getattr(regmap, f"HOST_{name}"), value)

