# SPDX-License-Identifier: Apache-2.0
"""A chip made of a few rules, for tests of the tools: it has the host window, makes telegrams, and obeys the lists.

It is no model of the master: detection takes no time, a lost slave is gone with the next cycle.
"""
from types import SimpleNamespace

from asi import regmap
from asi.eye import empty
from asi.plant import Faults
from asi.regmap import ErrorClass, Phase
from asi.telegram import encode_call
from asi.window import INDICES, MAGIC

BOOT_NS = 1_000_000
CALL_NS = 154_000
MISSING_NS = 150_000


class FakeBench:
    clk_hz = 16_000_000

    def __init__(self, settle_ns=20_000_000, *, boots=True, commit_result=0, applies=True, extra_ns=0, sick=False,
                 break_at_ns=None):
        self.settle_ns, self.boots, self.commit_result, self.applies = settle_ns, boots, commit_result, applies
        self.extra_ns, self.sick, self.break_at_ns = extra_ns, sick, break_at_ns
        self.now, self.good, self.low = 0, True, False
        self.slaves, self.log, self.closed = [], [], False
        self.memory = [0] * 4096
        self.cycle_times, self.started_ns = [], None
        self.writes = []
        self.sent = self.failed = self.cycles = 0

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
        self.slaves.append(SimpleNamespace(**vars(slave), faults=Faults()))
        return len(self.slaves) - 1

    def set_inputs(self, slave, nibble):
        self.slaves[slave].inputs = nibble

    def set_present(self, slave, present):
        self.slaves[slave].present = present

    def set_periphery_fault(self, slave, fault):
        self.slaves[slave].fault = fault

    def set_faults(self, slave, faults):
        self.slaves[slave].faults = faults

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

    def _cycle(self):
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
        bits = (config_ok | (0 in lds) << 1 | (not protected) << 4 | (phase != Phase.OFFLINE) << 5
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

