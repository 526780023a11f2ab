# SPDX-License-Identifier: Apache-2.0
"""A fake of everything below the port: slaves as small objects, and the contract of asi_seq (docs/architecture.md).

No time, no pulses: one call in, one answer or error class out. Calls are decoded here a second time, on purpose.
"""
import random
from collections import Counter
from dataclasses import dataclass, field, replace

from native import load

OK, NO_RESPONSE, PARITY, ABORTED = 0, 1, 7, 15
OFFLINE, DETECTION, ACTIVATION, DATA_EXCHANGE = range(4)
FLAGS = ("config_ok", "lds0", "auto_address_assign", "auto_address_available", "configuration_active",
         "normal_operation_active", "apf", "offline_ready", "periphery_ok")
FAIL_CYCLES = 3
TICK_US = 1024
COMMANDS = {0x1C: "RES", 0x10: "RDIO", 0x11: "RDID", 0x12: "RID1", 0x13: "RID2", 0x1E: "RDST"}
SETTLE_US = 1_000_000


@dataclass
class Slave:
    """One slave; index = number + 32 * Sel. ID = A makes it an A/B slave, any other a standard one."""
    index: int
    io: int = 7
    id: int = 0
    id1: int = 15
    id2: int = 14
    inputs: int = 0
    present: bool = True
    old: bool = False          # specification 2.0: no RID1, RID2
    echo: int | None = None    # WPAR answer, None: as written
    deaf: int = 0              # so many calls from now on stay without answer
    mute: frozenset = frozenset()  # calls it never answers
    outputs: int = 15
    parameter: int = 15
    disabled: bool = True      # data exchange, until WPAR
    heard: Counter = field(default_factory=Counter)

    @property
    def extended(self):
        return self.id == 0xA

    @property
    def codes(self):
        ids = 0xFF00 if self.old else self.id2 << 12 | self.id1 << 8
        return ids | self.id << 4 | self.io

    def power_up(self):
        self.outputs, self.parameter, self.disabled = 15, 15, True

    def answer(self, call):
        """-> nibble or None. Acts like the call table."""
        control, number, info = call >> 10, call >> 5 & 31, call & 31
        sel = self.index >> 5
        if not self.present or number != self.index & 31:
            return None
        if not control:
            if self.index == 0 or self.extended and bool(info & 8) == bool(sel):
                return None
            name = "WPAR" if info & 16 else "DEXG"
        else:
            select = 8 if sel else 0
            name = COMMANDS.get(info ^ select)
            if name is None:
                return None
        self.heard[name] += 1
        if self.deaf:
            self.deaf -= 1
            return None
        if name in self.mute or self.old and name in ("RID1", "RID2") or name == "DEXG" and self.disabled:
            return None
        if name == "DEXG":
            self.outputs = info & (7 if self.extended else 15)
        elif name == "WPAR":
            self.parameter, self.disabled = info & (7 if self.extended else 15), False
        elif name == "RES":
            self.power_up()
        return {"DEXG": self.inputs, "WPAR": info & 15 if self.echo is None else self.echo, "RES": 6, "RDIO": self.io,
                "RDID": self.id, "RID1": self.id1, "RID2": self.id2, "RDST": 0}[name]


def projection(slaves=(), parameters=None):
    """-> (lps words, 64 codes, 64 parameters) that project these slaves."""
    lps, pcd, pp = 0, [0xFFFF] * 64, [15] * 64
    for s in slaves:
        lps |= 1 << s.index
        pcd[s.index] = s.codes
    for index, value in (parameters or {}).items():
        pp[index] = value
    return [lps & 0xFFFFFFFF, lps >> 32], pcd, pp


class Master:
    """The core over a fake sequencer and slaves. Every call on the line is kept in .log as (call, error, data)."""

    def __init__(self, slaves=(), projected=(), parameters=None, seed=0):
        self.ffi, self.lib = load()
        self.port = self.lib.fw_port_record()
        self.slaves = list(slaves)
        self.log = []
        self.noise = 0.0
        self.random = random.Random(seed)
        self.projected = projection(projected, parameters)
        self.host_outputs = [0] * 64
        self.protected = self.offline = self.auto_address = self.apf = False
        self.data_exchange = True
        self.in_work = [0] * 64
        self.state_streak = [0] * 64
        self.cycle_number = 0
        self.batches_run = 0
        self.managements_run = 0
        self.incl_result = self.mgmt_result = (0, 0, 0)
        self.mgmt_last = False
        self.lib.fw_init(*self.projected)
        self.check = lambda: None

    # ---- the line
    def attempt(self, call):
        if not self.port.line or self.apf:
            return ABORTED, 0
        answers = [a for s in self.slaves if (a := s.answer(call)) is not None]
        if not answers:
            result = NO_RESPONSE, 0
        elif len(set(answers)) > 1 or self.noise and self.random.random() < self.noise:
            result = PARITY, 0
        else:
            result = OK, answers[0]
        self.log.append((call, *result))
        return result

    def run(self, request):
        answering = [s for s in self.slaves if replace(s, heard=Counter()).answer(request.call) is not None]
        for slave in answering:  # ST-001: the books are kept for the slave that answers
            assert request.sel == slave.index >> 5, (hex(request.call), slave.index)
        for _ in range(request.retries + 1):
            error, data = self.attempt(request.call)
            if error in (OK, ABORTED):
                break
        return data, error, request.tag

    # ---- the sequencer
    def batch(self):
        """Run the open batch and report it. False: there is none."""
        p = self.port
        if self.batches_run == p.batches:
            return False
        self.batches_run = p.batches
        results = [self.run(p.batch[k]) for k in range(p.batch_len)]
        p.idle = 1
        self.lib.fw_batch_done(results, len(results))
        self.check()
        return True

    def cycle(self, report=True):
        """One cycle; report=False: firmware is late and does not see it."""
        p, lost = self.port, []
        if not p.cycle:
            return False
        for index in range(64):
            if p.forgotten[index]:
                self.in_work[index] = p.forgotten[index] = 0
        out = list(p.out)
        for number in range(1, 32):
            a, b = (p.active[i] and self.state_streak[i] < FAIL_CYCLES for i in (number, number + 32))
            if not a and not b:
                continue
            index = number + 32 * bool(b and (not a or self.cycle_number & 1))
            nibble = out[index >> 3] >> 4 * (index & 7) & 15
            if p.extended[index]:
                nibble = nibble & 7 | (0 if index & 32 else 8)
            call = number << 5 | nibble
            error, data = self.attempt(call)
            if error != OK:
                error, data = self.attempt(call)
            if error == OK:
                self.in_work[index], self.state_streak[index] = data, 0
            else:
                self.state_streak[index] += 1
                if self.state_streak[index] == FAIL_CYCLES:
                    self.in_work[index] = 0
                    lost.append(index)
        pending = self.managements_run != p.managements
        if pending and (p.two_extra or not (self.mgmt_last and p.inclusion_valid)):
            self.managements_run = p.managements
            self.mgmt_result = self.run(p.management)
            self.mgmt_last = True
            slot_free = p.two_extra
        else:
            slot_free = True
        if slot_free and p.inclusion_valid:
            self.incl_result = self.run(p.inclusion)
            self.mgmt_last = False
        self.cycle_number += 1
        if lost:
            self.lose(lost)
        self.fresh_slots()
        if report:
            words = [sum(self.in_work[8 * w + k] << 4 * k for k in range(8)) for w in range(8)]
            self.lib.fw_set_outputs(self.words(self.host_outputs))
            self.lib.fw_cycle_done(self.mgmt_result, self.incl_result, words)
            self.fresh_slots()
            self.check()
        return True

    def lose(self, indices):
        bits = sum(1 << i for i in indices)
        return self.lib.fw_slave_lost([bits & 0xFFFFFFFF, bits >> 32])

    @staticmethod
    def words(nibbles):
        return [sum(nibbles[8 * w + k] << 4 * k for k in range(8)) for w in range(8)]

    def tick(self, us=TICK_US):
        self.drain()
        self.lib.fw_tick(us)
        self.check()

    def drain(self):
        """What a stop leaves behind: the rest of a batch or cycle ends as ABORTED and is reported, late."""
        p = self.port
        if p.line:
            return
        if self.batches_run != p.batches:
            self.batches_run = p.batches
            self.lib.fw_batch_done([(0, ABORTED, 0)] * p.batch_len, p.batch_len)
        self.managements_run = p.managements
        if not p.idle:
            p.idle = 1
            assert self.lib.fw_cycle_done(self.mgmt_result, self.incl_result, [0xFFFFFFFF] * 8) == -2
            self.in_work, self.state_streak = [0] * 64, [0] * 64

    def step(self):
        """Let the next thing happen: a batch, a cycle, or time. -> what it was"""
        if self.batch():
            return "batch"
        if self.cycle():
            return "cycle"
        self.tick()
        return "tick"

    def fresh_slots(self):
        """SLOT_STATE is written 0 before SLOT.active."""
        for i in range(64):
            if not self.port.active[i]:
                self.state_streak[i] = 0

    def settle(self):
        """Past P_PWR_SETTLE, still OFFLINE."""
        self.tick(SETTLE_US)

    def until(self, condition, steps=2000):
        for _ in range(steps):
            if condition(self.read()):
                return self
            self.step()
        raise AssertionError(f"not reached in {steps} steps: {self.read()}")

    def start(self):
        """Power-up to normal operation."""
        self.settle()
        return self.until(lambda s: s["phase"] == DATA_EXCHANGE)

    def cycles(self, n):
        for _ in range(n):
            assert self.cycle()
        return self

    def rounds(self, n=1):
        """n inclusion rounds: at most 63 candidates, 5 more calls with 2 repetitions each for those that answer."""
        return self.cycles(n * (63 + 15 * len(self.slaves)))

    # ---- host
    def protect(self, on=True):
        self.protected = on
        self.lib.fw_set_mode(on)

    def set_offline(self, on):
        self.offline = on
        self.lib.fw_set_offline(on)

    def set_data_exchange(self, on):
        self.data_exchange = on
        self.lib.fw_set_data_exchange(on)

    def set_auto_address(self, on):
        self.auto_address = on
        self.lib.fw_set_auto_address(on)

    def project(self, slaves=(), parameters=None):
        self.projected = projection(slaves, parameters)
        assert self.lib.fw_set_projection(*self.projected) == 0

    def power(self, apf):
        self.apf = apf
        if apf:
            for s in self.slaves:
                s.power_up()
        self.lib.fw_power(apf)

    # ---- what the host sees
    def read(self):
        s = self.ffi.new("fw_state *")
        self.lib.fw_read(s)

        def members(words):
            return {i for i in range(64) if words[i >> 5] >> (i & 31) & 1}
        return {"phase": s.phase, "flags": {n for k, n in enumerate(FLAGS) if s.flags >> k & 1}, "lds": members(s.lds),
                "las": members(s.las), "lpf": members(s.lpf), "changed": members(s.changed),
                "in": [s.inputs[i >> 3] >> 4 * (i & 7) & 15 for i in range(64)],
                "cdi": list(s.cdi), "pi": list(s.pi), "pecho": list(s.pecho), "version": s.version}

    def names(self, start=0):
        """Log from start as (mnemonic, index) without data."""
        return [name_of(c) for c, _, _ in self.log[start:]]

    def expected_flags(self, s):
        """The definitions of EX-011, EX-016 .. EX-022, from lists and codes alone."""
        lps = {i for i in range(64) if self.projected[0][i >> 5] >> (i & 31) & 1}
        pcd = self.projected[1]
        clash = {i for i in s["lds"] if i > 32 and i - 32 in s["lds"] and s["cdi"][i - 32] >> 4 & 15 != 0xA}
        good = s["lds"] - {0} <= lps and all(s["cdi"][i] == pcd[i] for i in s["lds"] - {0}) and not clash
        flags = set()
        if good and s["lds"] == lps:
            flags.add("config_ok")
        if 0 in s["lds"]:
            flags.add("lds0")
        if self.auto_address and self.protected and good:
            flags.add("auto_address_assign")
            if len(lps - s["lds"]) == 1:
                flags.add("auto_address_available")
        if not self.protected:
            flags.add("configuration_active")
        if s["phase"] == DATA_EXCHANGE:
            flags.add("normal_operation_active")
        if self.apf:
            flags.add("apf")
        if not s["lpf"]:
            flags.add("periphery_ok")
        return flags | s["flags"] & {"offline_ready"}


def name_of(call):
    """11-bit call -> (mnemonic, index); DEXG and WPAR: the plain number, whatever I3 says."""
    control, number, info = call >> 10, call >> 5 & 31, call & 31
    if not control:
        return "ADRA" if number == 0 else "WPAR" if info & 16 else "DEXG", number
    for sel in (0, 8):
        name = COMMANDS.get(info ^ sel)
        if name:
            return name, number + 4 * sel
    return "?", number
