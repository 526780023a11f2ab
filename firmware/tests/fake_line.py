# SPDX-License-Identifier: Apache-2.0
"""A fake of everything below the port: slaves as small objects, and the contract of asi_seq (docs/architecture.md).

No time, no pulses: one call in, one answer or error class out. Calls are decoded here a second time, on purpose.
"""
import random
import struct
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
    fault: bool = False        # S1
    write_us: int = 0          # its memory takes this long to write; S0 meanwhile
    memory_fails: bool = False  # what is written does not last: S3, and gone at the next power-up
    id1_protected: bool = False  # only bit 3 can be written
    zero_select: str = "0"        # select it obeys at address 0: "0", "1", "id1" (its bit 3), "both"
    clock: object = staticmethod(lambda: 0)  # -> us
    writing_until: int | None = None
    memory_bad: bool = False   # S3
    memory: tuple | None = None  # (index, id1) it starts with, once it was written

    @property
    def extended(self):
        return self.id == 0xA

    @property
    def codes(self):
        ids = 0xFF00 if self.old else self.id2 << 12 | self.id1 << 8
        return ids | self.id << 4 | self.io

    @property
    def status(self):
        writing = self.writing_until is not None and 0 < (self.writing_until - self.clock()) % 2**32 < 2**31
        return writing | self.fault << 1 | self.memory_bad << 3

    def power_up(self):
        """After RES, BR01 or with the supply: what is not in memory is forgotten."""
        self.outputs, self.parameter, self.disabled, self.writing_until = 15, 15, True, None
        if self.memory:
            self.index, self.id1 = self.memory

    def obeys(self, select):
        """select: the select a call carries, 0 or 8."""
        if self.index:
            return bool(select) == bool(self.index >> 5)
        return {"0": select == 0, "1": select == 8, "both": True,
                "id1": select == (self.id1 & 8 if self.extended else 0)}[self.zero_select]

    def store(self, index, id1):
        self.memory = self.memory or (self.index, self.id1)  # as it came
        self.writing_until, self.memory_bad = self.clock() + self.write_us, self.memory_fails
        self.index, self.id1 = index, id1
        if not self.memory_fails:
            self.memory = index or self.memory[0], id1

    def named(self, call):
        """-> mnemonic of the call when this slave listens to it, else None."""
        control, number, info = call >> 10, call >> 5 & 31, call & 31
        if call == 0x7F5:
            return "BR01"
        if number != self.index & 31:
            return None
        if not control:
            if self.index == 0:
                return "ADRA"
            if self.extended and bool(info & 8) == bool(self.index >> 5):
                return None
            return "WPAR" if info & 16 else "DEXG"
        if self.index == 0 and info < 16:
            return "WID1"
        for select in (0, 8):
            name = {**COMMANDS, 0x00: "DELA", 0x1F: "R1"}.get(info ^ select)
            if name and self.obeys(select):
                return name
        return None

    def answer(self, call):
        """-> nibble or None. Acts like the call table."""
        info = call & 31
        name = self.named(call) if self.present else None
        if name is None:
            return None
        self.heard[name] += 1
        if self.deaf:
            self.deaf -= 1
            return None
        if name in self.mute or self.old and name in ("RID1", "RID2") or name == "DEXG" and self.disabled:
            return None
        if name == "WID1" and self.id1_protected and (info ^ self.id1) & 7:
            return None
        answer = {"DEXG": self.inputs, "WPAR": info & 15 if self.echo is None else self.echo, "RES": 6, "RDIO": self.io,
                  "RDID": self.id, "RID1": self.id1, "RID2": self.id2, "RDST": self.status, "R1": self.status,
                  "DELA": 0, "WID1": 0, "ADRA": 6, "BR01": None}[name]
        if name == "DEXG":
            self.outputs = info & (7 if self.extended else 15)
        elif name == "WPAR":
            self.parameter, self.disabled = info & (7 if self.extended else 15), False
        elif name in ("RES", "BR01"):
            self.power_up()
        elif name == "DELA":
            self.memory = self.memory or (self.index, self.id1)
            self.index = 0
        elif name == "WID1":
            self.store(self.index, info & 15)
            if not self.memory_fails and self.memory[0]:  # a deleted address is still in memory, the select changes
                self.memory = (self.memory[0] & 31 | (self.id1 & 8) << 2 if self.extended else self.memory[0], self.id1)
        elif name == "ADRA" and info:
            self.store(info + (32 if self.extended and self.id1 & 8 else 0), self.id1)
        return answer


def projection(slaves=(), parameters=None):
    """-> (lps words, 64 codes, 64 parameters) that project these slaves."""
    lps, pcd, pp = 0, [0xFFFF] * 64, [15] * 64
    for s in slaves:
        lps |= 1 << s.index
        pcd[s.index] = s.codes
    for index, value in (parameters or {}).items():
        pp[index] = value
    return [lps & 0xFFFFFFFF, lps >> 32], pcd, pp


CONTROLS = ("protected_mode", "offline", "data_exchange", "auto_address", "auto_clear")
STATE = struct.Struct("=iI2I2I2I2I8I64H64B64B2I2I2I3I")
GOOD_US, SILENT_US = 154, 150  # bus time of a call with and without answer


def mask(indices):
    return sum(1 << i for i in indices)


def members(words):
    """Two list words -> set of indices."""
    bits = words[0] | words[1] << 32
    return {i for i in range(64) if bits >> i & 1} if bits else set()


def words_of(nibbles):
    return [sum(nibbles[8 * w + k] << 4 * k for k in range(8)) for w in range(8)]


PeripheralSlave = Slave  # one that reports faults: they all do


class NoWatch:
    """Nobody looks: a watch is told each stimulus before the core is, and may check what came of it."""

    def __getattr__(self, name):
        return lambda *_: None


class Master:
    """The core over a fake sequencer and slaves. Every attempt on the line is kept in .log as (call, error, data).

    Order of the real chip: when the report of a cycle arrives, the next one is already on the line, so its outputs were
    taken before. .delay: DEXG calls of that next cycle which come before the report, 0 by default.
    """

    def __init__(self, slaves=(), projected=(), parameters=None, seed=0, **controls):
        self.ffi, self.lib = load()
        self.port = self.lib.fw_port_record()
        self._state = self.ffi.new("fw_state *")
        self.slaves = list(slaves)
        self.log = []
        self.noise = 0.0
        self.random = random.Random(seed)
        self.projected = projection(projected, parameters)
        self.host_outputs = [0] * 64
        self.apf = False
        self.delay, self.pending = 0, None
        self.in_work = [0] * 64
        self.state_streak = [0] * 64
        self.cycle_number = 0
        self.batches_run = self.managements_run = self.inclusions = 0
        self.incl_result = self.mgmt_result = (0, 0, 0)
        self.mgmt_last = self.open = False
        self.snap = None
        self.books = [[0, 0, 0] for _ in range(64)]  # attempts: good, silent, garbled
        lps, pcd, pp = self.projected
        wanted = dict(data_exchange=True, protected_mode=False, auto_address=False, auto_clear=0) | controls
        permanent = dict(lps=lps, pcd=pcd, pp=pp, controls=wanted)
        self.init_status = self.lib.fw_init(self.ffi.new("fw_permanent *", permanent))
        self.watch = NoWatch()

    # ---- the line
    def attempt(self, call, index=0):
        if not self.port.line or self.apf:
            return ABORTED, 0
        number, broadcast = call >> 5 & 31, call == 0x7F5
        answers = [a for s in self.slaves
                   if (broadcast or s.index & 31 == number) and (a := s.answer(call)) is not None]
        if not answers:
            result = NO_RESPONSE, 0
        elif len(set(answers)) > 1 or self.noise and self.random.random() < self.noise:
            result = PARITY, 0
        else:
            result = OK, answers[0]
        self.port.time_us = self.port.time_us + (SILENT_US if result[0] == NO_RESPONSE else GOOD_US) & 0xFFFFFFFF
        self.books[index][min(result[0], 2)] += 1
        self.log.append((call, *result))
        return result

    def run(self, request):
        """-> (data, error, tag)"""
        call, tag, index = request.call, request.tag, (request.call >> 5 & 31) + 32 * request.sel
        if request.no_reply:
            error, data = self.attempt(call, index)
            return data, ABORTED if error == ABORTED else OK, tag
        if call >> 10 and call >> 5 & 31:  # ST-001: the books are kept for the slave that answers
            for s in self.slaves:
                if s.index & 31 == call >> 5 & 31 and request.sel != s.index >> 5:
                    assert replace(s, heard=Counter()).answer(call) is None, (hex(call), s.index)
        for _ in range(request.retries + 1):
            error, data = self.attempt(call, index)
            if error in (OK, ABORTED):
                break
        return data, error, tag

    # ---- the sequencer
    def batch(self):
        """Run the open batch and report it. False: there is none."""
        p = self.port
        if self.batches_run == p.batches:
            return False
        self.batches_run, self.managements_run = p.batches, p.managements
        results = [self.run(p.batch[k]) for k in range(p.batch_len)]
        p.idle = 1
        self.watch.batch_done(results)
        status = self.lib.fw_batch_done(results, len(results))
        self.watch.after("batch", status)
        return True

    def cycle(self, report=True):
        """One cycle, and its report when the next one has begun. report=False: firmware is late and does not see it."""
        p, called, lost = self.port, 0, []
        if p.idle or not p.line or self.batches_run != p.batches:
            return False
        if not self.open:  # the HAL's part at the start
            self.open, self.in_work, self.snap, self.pending = True, [0] * 64, None, None
        began = p.time_us
        if self.snap is None:
            self.snap = list(p.out)
        for index in range(64):
            if p.forgotten[index]:
                self.in_work[index] = p.forgotten[index] = 0
        for number in range(1, 32):
            a, b = (p.active[i] and self.state_streak[i] < FAIL_CYCLES for i in (number, number + 32))
            if not a and not b:
                continue
            if self.pending and called >= self.delay:
                self.deliver()
            index = number + 32 * bool(b and (not a or self.cycle_number & 1))
            if p.active[index]:  # the report may have switched it off
                self.exchange(index, lost)
                called += 1
        if self.pending:
            self.deliver()
        if lost:
            self.lose([i for i in lost if p.active[i] and self.state_streak[i] == FAIL_CYCLES])
        if called:
            self.lib.fw_exchange_done()
        pending = self.managements_run != p.managements
        free = True
        if pending and (p.two_extra or not (self.mgmt_last and p.inclusion_valid)):
            self.managements_run = p.managements
            self.watch.runs_management()
            self.mgmt_result = self.run(p.management)
            self.mgmt_last, free = True, p.two_extra
        if free:
            self.mgmt_last = False
            if p.inclusion_valid:
                self.inclusions += 1
                self.watch.runs_inclusion()
                self.incl_result = self.run(p.inclusion)
        self.cycle_number += 1
        if p.min_cycle_us and (p.time_us - began & 0xFFFFFFFF) < p.min_cycle_us:
            p.time_us = began + p.min_cycle_us & 0xFFFFFFFF
        stopped = not p.cycle
        if report or stopped:
            self.pending = self.mgmt_result, self.incl_result, list(self.in_work)
        if not stopped:
            self.snap = list(p.out)
        else:
            p.idle, self.open, self.managements_run = 1, False, p.managements
        if self.pending and (stopped or not self.delay):
            self.deliver()
        return True

    def exchange(self, index, lost):
        """One slot: DEXG, or RDID while data exchange is inactive, with one repetition, and its books."""
        p, number = self.port, index & 31
        nibble = p.live_nibble[index] if p.live[index] else self.snap[index >> 3] >> 4 * (index & 7) & 15
        if p.extended[index]:
            nibble = nibble & 7 | (0 if index & 32 else 8)
        call = 0x400 | number << 5 | 0x11 ^ (index >> 5 << 3) if p.read_id else number << 5 | nibble
        error, data = self.attempt(call, index)
        if error not in (OK, ABORTED):
            error, data = self.attempt(call, index)
        if error == ABORTED:
            return
        p.slot_error[index], p.slot_sent[index] = error, call & 15
        p.slot_calls[index] = p.slot_calls[index] + 1 & 15
        if error == OK:
            self.in_work[index] = p.slot_data[index] = data
            self.state_streak[index] = 0
        else:
            self.state_streak[index] += 1
            if self.state_streak[index] == FAIL_CYCLES:
                self.in_work[index] = 0
                lost.append(index)

    def deliver(self):
        """The report of the last cycle reaches the core."""
        (management, inclusion, inputs), self.pending = self.pending, None
        self.lib.fw_set_outputs(words_of(self.host_outputs))
        self.watch.cycle_done(management, inclusion, inputs, list(self.host_outputs))
        status = self.lib.fw_cycle_done(management, inclusion, words_of(inputs))
        self.fresh_slots()
        self.watch.after("cycle", status)

    def lose(self, indices):
        bits = mask(indices)
        self.watch.slave_lost(set(indices))
        status = self.lib.fw_slave_lost([bits & 0xFFFFFFFF, bits >> 32])
        self.fresh_slots()
        self.watch.after("lost", status)
        return status

    def tick(self, us=TICK_US):
        self.drain()
        self.port.time_us = self.port.time_us + us & 0xFFFFFFFF
        self.watch.tick(us)
        self.lib.fw_tick(us)
        self.fresh_slots()
        self.watch.after("tick", 0)

    def drain(self):
        """What a stop leaves behind: the rest of a batch or cycle ends as ABORTED and is reported, late."""
        p = self.port
        if p.line:
            return
        self.managements_run = p.managements
        if self.batches_run != p.batches:
            self.batches_run = p.batches
            assert self.lib.fw_batch_done([(0, ABORTED, 0)] * p.batch_len, p.batch_len) == -2
            p.idle = 1
        if not p.idle:
            p.idle = 1
            assert self.lib.fw_cycle_done(self.mgmt_result, self.incl_result, [0xFFFFFFFF] * 8) == -2
        self.open, self.pending = False, None

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
        """n inclusion rounds: at most 63 candidates, 5 more calls with 2 repetitions each for those that answer; a
        status poll takes one slot in three."""
        return self.cycles(n * (63 + 15 * len(self.slaves)) * 3 // 2)

    def probes(self, n):
        """Until n more calls were made in inclusion slots."""
        for _ in range(n):
            before = self.inclusions
            while self.inclusions == before:
                self.cycles(1)
        return self

    # ---- host
    def controls(self):
        c = self.ffi.new("fw_controls *")
        self.lib.fw_get_controls(c)
        return {name: getattr(c, name) for name in CONTROLS}

    def control(self, **changes):
        """Change some of protected_mode, offline, data_exchange, auto_address, auto_clear. -> status"""
        wanted = self.controls() | changes
        self.watch.set_controls(wanted)
        status = self.lib.fw_set_controls(self.ffi.new("fw_controls *", wanted))
        self.fresh_slots()
        self.watch.after("controls", status)
        return status

    def protect(self, on=True):
        assert self.control(protected_mode=on) == 0

    def set_offline(self, on):
        assert self.control(offline=on) == 0

    def set_data_exchange(self, on):
        assert self.control(data_exchange=on) == 0

    def set_auto_address(self, on):
        assert self.control(auto_address=on) == 0

    def project(self, slaves=(), parameters=None):
        self.projected = projection(slaves, parameters)
        self.watch.set_projection(*self.projected)
        status = self.lib.fw_set_projection(*self.projected)
        self.fresh_slots()
        self.watch.after("projection", status)
        assert status == 0

    def permanent(self):
        """-> (LPS as a set, PCD, PP, controls)"""
        p = self.ffi.new("fw_permanent *")
        self.lib.fw_get_permanent(p)
        return members(p.lps), list(p.pcd), list(p.pp), {name: getattr(p.controls, name) for name in CONTROLS}

    def power(self, apf):
        self.apf = apf
        if apf:
            for s in self.slaves:
                s.power_up()
        self.watch.power(apf)
        self.lib.fw_power(apf)
        self.fresh_slots()
        self.watch.after("power", 0)

    # ---- what the host sees
    def read(self):
        self.lib.fw_read(self._state)
        v = STATE.unpack(self.ffi.buffer(self._state, STATE.size))
        inputs = v[10:18]
        return {"phase": v[0], "flags": {n for k, n in enumerate(FLAGS) if v[1] >> k & 1}, "lds": members(v[2:4]),
                "las": members(v[4:6]), "lpf": members(v[6:8]), "changed": members(v[8:10]),
                "in": [inputs[i >> 3] >> 4 * (i & 7) & 15 for i in range(64)], "cdi": list(v[18:82]),
                "pi": list(v[82:146]), "pecho": list(v[146:210]), "version": v[210], "permanent_version": v[211],
                "suspects": members(v[212:214]), "changed_slaves": members(v[214:216]), "changed_us": v[216],
                "offline_causes": v[217], "offline_us": v[218]}

    def events(self):
        """-> (events logged so far, the last 64 as (time, event, index, data), oldest first)"""
        ring = self.ffi.new("fw_log_entry[64]")
        head = self.lib.fw_log(ring)
        return head, [(e.time_us, e.event, e.index, e.data) for e in ring][max(0, 64 - head):]

    def names(self, start=0):
        """Log from start as (mnemonic, index) without data and without status polls."""
        return [n for n in (name_of(c) for c, _, _ in self.log[start:]) if n[0] != "RDST"]

    def expected_flags(self, s):
        """The definitions of EX-011, EX-016 .. EX-022, from lists and codes alone."""
        lps, pcd, _, controls = self.permanent()
        clash = {i for i in s["lds"] if i > 32 and i - 32 in s["lds"] and s["cdi"][i - 32] >> 4 & 15 != 0xA}
        good = s["lds"] - {0} <= lps and all(s["cdi"][i] == pcd[i] for i in s["lds"] - {0}) and not clash
        flags = set()
        if good and s["lds"] == lps:
            flags.add("config_ok")
        if 0 in s["lds"]:
            flags.add("lds0")
        if controls["auto_address"] and controls["protected_mode"] and good:
            flags.add("auto_address_assign")
            if len(lps - s["lds"]) == 1:
                flags.add("auto_address_available")
        if not controls["protected_mode"]:
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
