# SPDX-License-Identifier: Apache-2.0
"""Execution control a second time: the rules of docs/requirements.md as plain Python, and the comparison with the core.

Reference gets the stimuli of the core (results, reports, time, power, host) and says what must be seen then and which
calls must follow. What takes several calls is a generator that yields calls and receives answers (nibble or None), so
it has no step numbers, tags or bit lists to share a mistake with the firmware. So are the functions with telegrams
(5, 20, 22, 24) and automatic addressing. Slaves with combined transactions, and with them strings, are not part of it.
"""
import struct

from fake_line import (ACTIVATION, DATA_EXCHANGE, DETECTION, OFFLINE, OK, SETTLE_US, members)

from asi.telegram import encode_call

ARG, STATE, BUSY, ABORTED, PROTECTED, SLAVE0, NOT_DETECTED, NOT_ACTIVE, ADDRESS_USED, NO_ANSWER = range(-1, -11, -1)
DELETE, READ_ID1, WRITE_ID1, ID1_TEMPORARY, SET_ADDRESS, ADDRESS_TEMPORARY = range(-11, -17, -1)
AUTO_CLEAR, AUTO_CLEAR_MODE, POWER, IS_OFFLINE = -19, -20, -21, -22
FN_PARAMETER, FN_CHANGE, FN_EXECUTE, FN_WRITE_ID1, AUTOMATIC = 5, 20, 22, 24, 32
NVM_US, POLL_US, RESET_US, AUTO_US = 500_000, 5_000, 2_000, 1_000_000
RESCUES = 5      # P_RESCUE
# FN-022: what Execute_Command may send, as (number, I4..I0); RES, RDIO, RDID, RID1, RID2, RDST, R1 with both selects
EXECUTABLE = {(n, c ^ sel) for n in range(32) for c in (0x1C, 0x10, 0x11, 0x12, 0x13, 0x1E, 0x1F) for sel in (0, 8)} | {
    (0, c) for c in range(16)} | {(31, 0x15)}
BROADCAST = (31, 0x15)
SLAVES = frozenset(range(1, 32)) | frozenset(range(33, 64))
NOBODY = 0xFFFF
ATTEMPTS = 3     # P_CMD_RETRY + 1
ROUNDS = 3       # P_INCL_MISS
POLL_EVERY = 3   # P_RDST_EVERY
CAUSE_HOST, CAUSE_POWER, CAUSE_MODE, CAUSE_AUTO_CLEAR = 1, 2, 3, 4


class Job:
    """A function with telegrams. way: generator of its calls, as functions that make them, and of pauses in us."""

    def __init__(self, kind=0, index=0, value=0, way=None):
        self.kind, self.index, self.value, self.way = kind, index, value, way
        self.status, self.data = (BUSY if way else 0), 0
        self.call, self.called = None, False  # what comes next; whether it is under way
        self.since, self.pause = 0, 0


class Mover:
    """The slave whose address changes."""

    def __init__(self, codes, has_id2, at_zero):
        self.codes, self.has_id2, self.at_zero = codes, has_id2, at_zero
        self.ident, self.extended = codes >> 4 & 15, codes >> 4 & 15 == 0xA
        self.born = self.now = codes >> 8 & 15  # ID1 it came with; ID1 it has, None: nobody knows

    def reads(self, id1):
        self.now = id1
        self.codes = self.codes & 0xF0FF | id1 << 8


class Reference:
    """One line. Sets of indices, lists by index; .batch, .probe, .management: calls that must be asked for now."""

    def __init__(self, lps, pcd, pp, protected_mode, data_exchange, auto_address, auto_clear):
        self.lps, self.pcd, self.pp = set(lps), list(pcd), list(pp)
        self.protected, self.exchange = bool(protected_mode), bool(data_exchange)
        self.auto_address, self.auto_clear = bool(auto_address), auto_clear
        self.zero_sel = False  # the select that a slave at address 0 answers
        self.offline = self.apf = self.cleared = self.ready = self.again = self.reading = False
        self.power_up, self.settle = True, SETTLE_US
        self.phase = OFFLINE
        self.lds, self.las, self.lpf, self.no_id2, self.wrong = set(), set(), set(), set(), set()
        self.cdi, self.pi, self.pecho = [NOBODY] * 64, list(pp), [15] * 64
        self.inputs, self.missed, self.outputs = [0] * 64, [0] * 64, [0] * 64
        self.batch = self.probe = self.management = None
        self.probes = self.managements = 0  # how many there were: names a call
        self.polled, self.since_poll = 0, 0
        self.batches = self.search = None  # generators
        self.job, self.automatic = Job(), Job()  # the host's; automatic addressing
        self.owner = None  # whose call is .management: a Job, or None for a poll
        self.no_reply = False
        self.held, self.at = set(), 63  # inclusion keeps away from these; where it is
        self.failed = None  # when automatic addressing failed with this slave 0
        self.again_since, self.again_pause = 0, 0
        self.addressed = []  # what was logged as ADDRESSED
        self.changed_slaves, self.changed_us, self.causes, self.offline_us = set(), 0, 1, 0
        self.now = 0

    # ---- rules
    def extended(self, i):
        return i > 32 or self.cdi[i] >> 4 & 15 == 0xA

    def clashes(self, i):
        """EX-026"""
        return i > 32 and i - 32 in self.lds and not self.extended(i - 32)

    def as_projected(self, i):
        return i in self.lps and self.cdi[i] == self.pcd[i] and not self.clashes(i)

    def allowed(self, i):
        """EX-008, EX-009"""
        return i != 0 and not self.clashes(i) and (not self.protected or self.as_projected(i))

    def wrong_slaves(self):
        """EX-016: missing, extra and wrong slaves, slave 0"""
        return (self.lps - self.lds) | {i for i in self.lds if not self.as_projected(i)}

    def flags(self):
        """EX-011, EX-016 .. EX-022"""
        wrong, missing = self.wrong_slaves(), self.lps - self.lds
        assign = self.auto_address and self.protected and not wrong - missing - {0}
        return {name for name, holds in dict(
            config_ok=not wrong, lds0=0 in self.lds, auto_address_assign=assign,
            auto_address_available=assign and len(missing) == 1, configuration_active=not self.protected,
            normal_operation_active=self.phase == DATA_EXCHANGE, apf=self.apf, offline_ready=self.ready,
            periphery_ok=not self.lpf).items() if holds}

    def enter_lds(self, i, codes, has_id2):
        """EX-004, EX-013, EX-026, EX-028"""
        self.lds.add(i)
        self.cdi[i] = codes
        self.missed[i] = 0
        (self.no_id2.discard if has_id2 else self.no_id2.add)(i)
        if 0 < i < 32 and not self.extended(i):
            self.leave_las(i + 32)

    def leave_las(self, i):
        """EX-015, EX-027, CA-006"""
        self.las.discard(i)
        self.lpf.discard(i)
        self.inputs[i] = 0

    def leave_lds(self, i):
        self.leave_las(i)
        self.lds.discard(i)
        self.cdi[i], self.missed[i] = NOBODY, 0

    # ---- phases
    def stop(self, cause):
        """EX-001, EX-037"""
        self.causes = self.causes & 0xFFFF | 1 << cause | cause << 16
        self.offline_us = self.now
        if self.phase != OFFLINE:
            self.abort()
            for i in list(self.lds):
                self.leave_lds(i)
            self.phase, self.again = OFFLINE, False
            self.batch = self.probe = self.management = self.batches = self.search = None

    def next_batch(self, answers=None):
        """Let the generator of batches go on; its end is the next phase."""
        while True:
            try:
                self.batch = self.batches.send(answers)
                return
            except StopIteration:
                answers = None
            if self.phase == DETECTION:  # EX-008
                self.phase = ACTIVATION
                self.batches = self.activate(sorted(i for i in self.lds if self.allowed(i)))
            else:
                self.batch = self.batches = None
                self.phase, self.since_poll, self.wrong = DATA_EXCHANGE, 0, set()
                self.held = set()
                self.search = self.include(63)
                self.ask(next(self.search))
                return

    def detect(self):
        """EX-004 .. EX-007"""
        while not self.lds:
            who, self.zero_sel = list(range(32)), False
            for sel in (0, 32):
                silent = set(range(32)) if not sel else set()
                extended = set()
                io, ident = {}, {}
                if who:
                    answers = yield [encode_call("RDIO", i) for i in who]
                    io = {i: a for i, a in zip(who, answers) if a is not None}
                    silent -= set(io)
                if io:
                    answers = yield [encode_call("RDID", i) for i in io]
                    ident = {i: a for i, a in zip(io, answers) if a is not None}
                    extended = {i for i, a in ident.items() if a == 0xA and 0 < i < 32}
                if ident:
                    answers = yield [encode_call(name, i) for i in ident for name in ("RID1", "RID2")]
                    for i, id1, id2 in zip(ident, answers[::2], answers[1::2]):
                        if ident[i] != 0xA or None not in (id1, id2):
                            self.zero_sel = self.zero_sel or i == 32  # AD-007: address 0 with Sel = 1
                            self.enter_lds(0 if i == 32 else i, codes_of(io[i], ident[i], id1, id2), id2 is not None)
                who = sorted(32 + n for n in silent | extended)

    def activate(self, who):
        """EX-008: batches of at most 64 calls"""
        for part in (who[k:k + 32] for k in range(0, len(who), 32)):
            answers = yield [call for i in part for call in (self.wpar(i), self.dexg(i))]
            for i, echo, answer in zip(part, answers[::2], answers[1::2]):
                if echo is not None:
                    self.pecho[i] = echo
                    if answer is not None and self.allowed(i):
                        self.las.add(i)

    def wpar(self, i):
        return encode_call("WPAR", i, self.pi[i], self.extended(i))

    def dexg(self, i):
        return encode_call("DEXG", i, 15, self.extended(i))

    # ---- normal operation
    def ask(self, call):
        self.probe = call
        self.probes += call is not None

    def hold(self, held):
        """FN-020: inclusion keeps away from these addresses; what it does there is given up."""
        self.held = held
        if self.probe is None or self.at in held:
            self.search = self.include(self.at)
            self.ask(next(self.search))

    def include(self, i):
        """EX-010, EX-012, EX-013, EX-014, EX-017, AD-007"""
        def attempts(make):
            for _ in range(ATTEMPTS):
                answer = yield make()
                if answer is not None:
                    return answer
            return None

        def codes_from(i):
            at = 32 if i == 0 and self.zero_sel else i
            ident = yield from attempts(lambda: encode_call("RDID", at))
            if ident is None:
                return None
            id1 = yield from attempts(lambda: encode_call("RID1", at))
            if id1 is None and ident == 0xA:
                return None
            id2 = yield from attempts(lambda: encode_call("RID2", at))
            return None if id2 is None and ident == 0xA else (ident, id1, id2)

        while True:
            self.reading = False
            free = (SLAVES - self.las | {0}) - self.held
            if not free:
                yield None
            self.at = i = next(k % 64 for k in range(i + 1, i + 65) if k % 64 in free)
            if i == 0:  # AD-007
                self.zero_sel = self.zero_sel and 0 in self.lds
            io = yield encode_call("RDIO", 32 if i == 0 and self.zero_sel else i)
            if i == 0 and io is None:
                self.zero_sel = not self.zero_sel
                io = yield encode_call("RDIO", 32 if self.zero_sel else 0)
            codes = None
            if io is not None:
                self.reading = True
                codes = yield from codes_from(i)
            if codes is None:
                if i in self.lds:
                    self.missed[i] += 1
                    if self.missed[i] == ROUNDS:
                        self.leave_lds(i)
                continue
            self.enter_lds(i, codes_of(io, *codes), codes[2] is not None)
            if self.allowed(i):
                echo = yield from attempts(lambda i=i: self.wpar(i))
                if echo is not None and self.allowed(i):
                    self.pecho[i] = echo
                    if (yield from attempts(lambda i=i: self.dexg(i))) is not None and self.allowed(i):
                        self.las.add(i)

    def poll(self):
        """EX-027"""
        self.since_poll += 1
        if self.since_poll < POLL_EVERY or self.management is not None or self.reading or not self.las:
            return
        self.polled = next(k % 64 for k in range(self.polled + 1, self.polled + 65) if k % 64 in self.las)
        self.since_poll = 0
        self.manage(encode_call("RDST", self.polled), None)

    def manage(self, call, owner, no_reply=False):
        self.management, self.owner, self.no_reply = call, owner, no_reply
        self.managements += 1

    # ---- functions with telegrams
    def busy(self):
        return BUSY in (self.job.status, self.automatic.status)

    def refusal(self, kind, index, value):
        """FN-005, FN-020, FN-022, FN-024, FN-032: arguments, then the state of the line, then the slave"""
        extended = 0 <= index < 64 and self.extended(index)
        good = {FN_PARAMETER: index in SLAVES and value <= (7 if extended else 15),
                FN_CHANGE: index != value and {index, value} <= SLAVES | {0},
                FN_EXECUTE: (index, value) in EXECUTABLE,
                FN_WRITE_ID1: index == 0 and value <= (7 if extended else 15)}.get(kind, False)
        if not good:
            return ARG
        if self.apf:
            return POWER
        if self.offline:
            return IS_OFFLINE
        if self.phase != DATA_EXCHANGE or self.again:
            return STATE
        if self.busy():
            return BUSY
        if kind == FN_PARAMETER and index not in self.las:
            return NOT_ACTIVE
        if kind == FN_WRITE_ID1 and 0 not in self.lds:
            return NOT_DETECTED
        return self.cannot_move(index, value) if kind == FN_CHANGE else 0

    def cannot_move(self, old, new):
        """AD-001"""
        if old not in self.lds:
            return NOT_DETECTED
        if new > 31 and not self.extended(old):
            return ARG
        if old and 0 in self.lds:
            return SLAVE0
        if new in self.lds:
            return ADDRESS_USED
        if self.auto_clear & 1 and old in self.lps:
            return AUTO_CLEAR_MODE
        pair = new ^ 32
        if new and pair != old and pair in self.lds and not (self.extended(old) and self.extended(pair)):
            return ADDRESS_USED
        return 0

    def start(self, kind, index, value):
        status = self.refusal(kind, index, value)
        if status == 0:
            self.job = Job(kind, index, value)
            self.begin(self.job)
            self.next_call()
        return status

    def begin(self, job):
        job.status = BUSY
        job.way = {FN_PARAMETER: self.write_parameter, FN_EXECUTE: self.execute}.get(job.kind, self.addressing)(job)
        if job.kind in (FN_CHANGE, AUTOMATIC):
            self.hold({0, job.index, job.value})
        elif job.kind == FN_WRITE_ID1:
            self.hold({0})
        self.drive(job, None)

    def drive(self, job, answer):
        """Let it go on to its next call, or to its end."""
        job.called = False
        try:
            job.call, job.pause = job.way.send(answer), 0
            if isinstance(job.call, int):
                job.since, job.pause = self.now, job.call
                job.call = next(job.way)
        except StopIteration as end:
            self.finish(job, end.value)

    def next_call(self):
        """FN-032: one call per management slot"""
        job = next((j for j in (self.job, self.automatic) if j.status == BUSY), None)
        if job is None or job.called or self.management is not None or self.again:
            return
        if (self.now - job.since) % 2**32 >= job.pause:
            job.called = True
            self.manage(job.call(), job, job.kind == FN_EXECUTE and (job.index, job.value) == BROADCAST)

    def finish(self, job, status):
        job.status = status
        if self.held:
            self.hold(set())
        if job.kind == AUTOMATIC:
            self.failed = self.now if status else None
        if job.kind in (FN_CHANGE, AUTOMATIC):
            self.addressed.append((job.value, job.index | -status << 8))

    def abort(self):
        """FN-033"""
        self.held = set()
        for job in (self.job, self.automatic):
            if job.status == BUSY:
                self.finish(job, ABORTED)
        self.failed = None  # AD-009: the line was not at fault, and slave 0 is looked for anew

    def anew(self, pause):
        """EX-024, FN-022: activate all of LAS once the cycle has ended, not before the pause is over"""
        if not self.again or pause:
            self.again, self.again_since, self.again_pause = True, self.now, pause

    def write_parameter(self, job):
        """FN-005"""
        answer = yield lambda: encode_call("WPAR", job.index, job.value, self.extended(job.index))
        if answer is None:
            return NO_ANSWER
        self.pi[job.index], self.pecho[job.index], job.data = job.value, answer, answer
        return 0

    def execute(self, job):
        """FN-022"""
        answer = yield lambda: 0x400 | job.index << 5 | job.value
        if (job.index, job.value) == BROADCAST:
            self.anew(RESET_US)
            return 0
        if answer is None:
            return NO_ANSWER
        job.data = answer
        reset = job.index + (32 if job.value == 0x14 else 0)
        if job.value in (0x1C, 0x14) and answer == 6 and reset in self.las:
            self.hold({reset})
            self.leave_las(reset)
            if self.allowed(reset):
                yield RESET_US
                yield from self.activate_one(reset)
        return 0

    def activate_one(self, i):
        """AD-006, FN-022: WPAR, DEXG, where the slave may be active and is not"""
        if i in self.las or not self.allowed(i):
            return
        echo = yield lambda: self.wpar(i)
        if echo is None or not self.allowed(i):
            return
        self.pecho[i] = echo
        answer = yield lambda: self.dexg(i)
        if answer is not None and self.allowed(i) and i in self.lds:
            self.las.add(i)

    def zero(self, name):
        """AD-007"""
        return lambda: encode_call(name, 32 if self.zero_sel else 0)

    def either(self, name, slave):
        """Ask an A/B slave at address 0 with the one select, then with the other."""
        answer = yield self.zero(name)
        if answer is None and slave.extended:
            self.zero_sel = not self.zero_sel
            answer = yield self.zero(name)
        return answer

    def appears(self, i, slave):
        self.enter_lds(i, slave.codes, slave.has_id2)

    def addressing(self, job):
        """FN-020, FN-024, AD-002 .. AD-008"""
        old, new = job.index, 0 if job.kind == FN_WRITE_ID1 else job.value
        slave = Mover(self.cdi[old], old not in self.no_id2, old == 0)

        def falls_to_zero():
            slave.at_zero = True
            self.leave_lds(old)
            self.appears(0, slave)
        if old:
            answer = yield lambda: encode_call("DELA", old)
            if answer == 0:
                falls_to_zero()
            self.zero_sel = False
        id1 = yield from self.either("RID1", slave)
        found = id1 is not None
        if found:
            slave.reads(id1)
            slave.born = id1
        elif not slave.extended:  # a slave before 2.1
            ident = yield self.zero("RDID")
            found = ident == slave.ident and job.kind != FN_WRITE_ID1
        if job.kind == FN_WRITE_ID1:
            if not found:
                return READ_ID1
            value = job.value | (slave.born & 8 if slave.extended else 0)
            error = yield from self.change_id1(slave, value, False, job)
            return error
        error, look = 0, False
        if found and not slave.at_zero:  # only the answer to DELA was lost
            falls_to_zero()
        elif not found and old == 0:
            return READ_ID1
        elif not found:
            error, look = (READ_ID1, False) if slave.at_zero else (DELETE, True)
        if found:
            id1 = slave.born if new == 0 or not slave.extended else slave.born & 7 | (8 if new > 31 else 0)
            error = yield from self.way_to(new, slave, id1, False, False)
            if error in (0, ADDRESS_TEMPORARY):
                if new:
                    yield from self.activate_one(new)
                return error
        for attempt in range(RESCUES):  # AD-004
            if attempt:
                yield POLL_US
            failed = yield from self.way_to(old, slave, slave.born, True, look)
            if failed in (0, ADDRESS_TEMPORARY):
                if old:
                    yield from self.activate_one(old)
                break
            look = False
        return error

    def way_to(self, target, slave, id1, rescue, look):
        """From address 0 to the target. look: it may be there. -> 0, ADDRESS_TEMPORARY, or what failed"""
        took = None
        if not look:
            if slave.now != id1:
                error = yield from self.change_id1(slave, id1, rescue, None)
                if error:
                    return error
            if target == 0:
                return 0
            took = yield lambda: encode_call("ADRA", 0, target & 31)
        if took != 6:
            ident = yield lambda: encode_call("RDID", target)
            if ident != slave.ident:
                return SET_ADDRESS
        if slave.at_zero:
            self.leave_lds(0)
        self.appears(target, slave)
        began, answered = self.now, False
        while True:
            status = yield lambda: encode_call("RDST", target)
            answered = answered or status is not None
            if status is not None and not status & 1:
                return ADDRESS_TEMPORARY if status & 8 else 0
            if (self.now - began) % 2**32 >= NVM_US:
                break
            yield POLL_US
        if not answered:
            ident = yield lambda: encode_call("RDID", target)
            if ident != slave.ident:
                self.leave_lds(target)
                return SET_ADDRESS
        return ADDRESS_TEMPORARY

    def change_id1(self, slave, id1, content, job):
        """AD-003, FN-024. content: with an ID1 that does not last. -> 0 or error"""
        yield lambda: encode_call("WID1", 0, id1)  # no answer looks like a refusal: read back
        slave.now, began = None, self.now
        while True:
            status = yield self.zero("RDST")
            if status is None and slave.extended:
                self.zero_sel = not self.zero_sel
            ready = status is not None and not status & 1
            if ready or (self.now - began) % 2**32 >= NVM_US:
                break
            yield POLL_US
        if not content and not (ready and not status & 8):
            return ID1_TEMPORARY
        read = yield from self.either("RID1", slave)
        if read is None:
            return READ_ID1
        slave.reads(read)
        self.appears(0, slave)
        if job:
            job.data = read
        return 0 if read == id1 else WRITE_ID1

    def address_automatically(self):
        """AD-008, AD-009"""
        if self.busy():
            return
        if 0 not in self.lds or self.failed is not None and (self.now - self.failed) % 2**32 >= AUTO_US:
            self.failed = None
        if self.failed is not None or self.again or 0 not in self.lds or "auto_address_available" not in self.flags():
            return
        missing, = self.lps - self.lds
        same = 0xF7FF if self.extended(0) else 0xFFFF
        if not (self.cdi[0] ^ self.pcd[missing]) & same and self.cannot_move(0, missing) == 0:
            self.automatic = Job(AUTOMATIC, 0, missing)
            self.begin(self.automatic)

    # ---- stimuli; results: nibble or None. -> status
    def keep_history(self):
        """EX-036: after each stimulus. A slave that becomes wrong breaks Config_OK, also when it is broken already."""
        if self.phase == DATA_EXCHANGE:
            news = self.wrong_slaves() - self.wrong
            self.wrong = self.wrong_slaves()
            if news:
                self.changed_slaves, self.changed_us = news, self.now

    def tick(self, us, idle):
        """EX-003, EX-024"""
        if self.again and idle and (self.now - self.again_since) % 2**32 >= self.again_pause:
            self.again = False
            self.abort()
            who = sorted(self.las)
            for i in who:
                self.leave_las(i)
            self.phase, self.probe, self.management, self.search = ACTIVATION, None, None, None
            self.batches = self.activate(who)
            self.next_batch()
        if self.phase != OFFLINE:
            return
        if not self.apf:
            self.settle = max(0, self.settle - us)
        if not idle:
            return
        if not self.ready:
            self.ready = True
        elif not self.offline and not self.apf and not self.settle:
            if self.power_up:  # EX-002
                self.power_up, self.pi = False, list(self.pp)
            self.ready, self.phase = False, DETECTION
            self.batches = self.detect()
            self.next_batch()

    def power(self, apf):
        """EX-021"""
        if apf == self.apf:
            return
        self.apf = apf
        if apf:
            if self.power_up:
                self.settle = SETTLE_US
            self.stop(CAUSE_POWER)

    def batch_done(self, results):
        if self.batch is None or len(results) != len(self.batch):
            return STATE
        self.batch = None
        self.next_batch(results)
        return 0

    def slave_lost(self, lost):
        """EX-015"""
        gone = lost & self.las
        for i in gone:
            self.leave_lds(i)
        return 0 if gone else STATE

    def cycle_done(self, management, probe, inputs, outputs):
        """management, probe: (which one, answer), results as they stand; an older one is no news."""
        if self.phase != DATA_EXCHANGE:
            return STATE
        before = set(self.las)
        if self.probe is not None and probe[0] == self.probes:
            self.ask(self.search.send(probe[1]))
            self.keep_history()
        if self.management is not None and management[0] == self.managements:
            self.management = None
            if self.owner:
                self.drive(self.owner, management[1])
                self.next_call()
            elif management[1] is not None and self.polled in self.las:
                fault = management[1] & 2 and self.polled not in self.no_id2  # EX-028
                (self.lpf.add if fault else self.lpf.discard)(self.polled)
        self.address_automatically()
        self.next_call()
        self.poll()
        for i in self.las:
            self.inputs[i] = inputs[i] if self.exchange and i in before else 0
        self.outputs = outputs
        self.keep_history()
        missing = self.auto_clear & 1 and self.lps - self.lds
        if missing or self.auto_clear & 2 and self.lpf:  # EX-033
            self.cleared = self.offline = True
            self.stop(CAUSE_AUTO_CLEAR)
        return 0

    def set_controls(self, c):
        """FN-017, FN-018, FN-019, FN-021, EX-023, EX-024, EX-032, EX-033"""
        protected, exchange, auto_address = (bool(c[k]) for k in ("protected_mode", "data_exchange", "auto_address"))
        if c["auto_clear"] > 3:
            return ARG
        if c["auto_clear"] and (auto_address or not protected):
            return AUTO_CLEAR_MODE
        if protected and not self.protected and 0 in self.lds:
            return SLAVE0
        if self.cleared and c["offline"] and exchange != self.exchange:
            return AUTO_CLEAR
        mode_changes, host_stops = protected != self.protected, c["offline"] and not self.offline
        begins = exchange and not self.exchange
        self.protected, self.exchange, self.auto_address = protected, exchange, auto_address
        self.auto_clear, self.offline = c["auto_clear"], bool(c["offline"])
        self.cleared = self.cleared and self.offline
        if mode_changes:
            self.stop(CAUSE_MODE)
        if host_stops:
            self.stop(CAUSE_HOST)
        if begins and self.phase == DATA_EXCHANGE:
            self.anew(0)
        return 0

    def permanent_changed(self):
        """EX-009"""
        if self.protected:
            for i in [i for i in self.las if not self.allowed(i)]:
                self.leave_las(i)
        return 0

    def set_projection(self, lps, pcd, pp):
        if not lps <= SLAVES or max(pp) > 15:
            return ARG
        self.lps, self.pcd, self.pp = set(lps), list(pcd), list(pp)
        return self.permanent_changed()

    def set_pp(self, i, value):
        """FN-003"""
        if i not in SLAVES or value > 15:
            return ARG
        self.pp[i] = value
        return self.permanent_changed()

    def set_pcd(self, i, codes):
        """FN-008"""
        if i not in SLAVES or codes > 0xFFFF:
            return ARG
        if self.protected:
            return PROTECTED
        self.pcd[i] = codes
        return 0

    def set_lps(self, lps):
        """FN-012"""
        if not lps <= SLAVES:
            return ARG
        if self.protected:
            return PROTECTED
        self.lps = set(lps)
        return 0

    def store_configuration(self):
        """FN-010"""
        if self.protected:
            return PROTECTED
        self.lps, self.pcd = set(self.las), [NOBODY, *self.cdi[1:]]
        self.pp = [self.pp[i] if i in self.lps else 15 for i in range(64)]
        return 0

    def store_parameters(self):
        """FN-007"""
        self.pp = list(self.pi)
        return 0


def codes_of(io, ident, id1, id2):
    """EX-005: what is missing is F."""
    return io | ident << 4 | (15 if id1 is None else id1) << 8 | (15 if id2 is None else id2) << 12


class Compare:
    """A watch of fake_line.Master: tells the reference what the core is told, and compares after each stimulus."""

    def __init__(self, master):
        self.m = master
        lps, pcd, pp, c = master.permanent()
        self.r = Reference(lps, pcd, pp, c["protected_mode"], c["data_exchange"], c["auto_address"], c["auto_clear"])
        self.status = 0
        self.ran_management = self.ran_probe = -1
        self.batches, self.managements, self.head = 0, 0, 0
        self.before = None
        self.ring = master.ffi.new("fw_log_entry[64]")
        self.job = master.ffi.new("fw_job *")
        master.watch = self

    def stimulus(self):
        r = self.r
        r.now = self.m.port.time_us
        self.before = r.phase, set(r.lds), set(r.las)
        del r.addressed[:]

    @staticmethod
    def nibble(result):
        return result[0] if result[1] == OK else None

    def runs_management(self):
        self.ran_management = self.r.managements

    def runs_inclusion(self):
        self.ran_probe = self.r.probes

    def tick(self, us):
        self.stimulus()
        self.status = self.r.tick(us, bool(self.m.port.idle)) or 0

    def power(self, apf):
        self.stimulus()
        self.status = self.r.power(apf) or 0

    def batch_done(self, results):
        self.stimulus()
        self.status = self.r.batch_done([self.nibble(x) for x in results])

    def slave_lost(self, lost):
        self.stimulus()
        self.status = self.r.slave_lost(lost)

    def cycle_done(self, management, inclusion, inputs, outputs):
        self.stimulus()
        self.status = self.r.cycle_done((self.ran_management, self.nibble(management)),
                                        (self.ran_probe, self.nibble(inclusion)), inputs, outputs)

    def set_controls(self, controls):
        self.stimulus()
        self.status = self.r.set_controls(controls)

    def set_projection(self, lps, pcd, pp):
        self.stimulus()
        self.status = self.r.set_projection(members(lps), pcd, pp)

    def start(self, kind, index, value):
        """Begin a function with telegrams. -> status"""
        self.stimulus()
        self.status = self.r.start(kind, index, value)
        status = self.m.lib.fw_start(kind, index, value, self.m.ffi.NULL, 0)
        self.after("start", status)
        return status

    def function(self, name, *args):
        """A function without telegrams: fw_<name> of the core and the same of the reference. -> status"""
        self.stimulus()
        self.status = getattr(self.r, name)(*args)
        plain = [[sum(1 << i & 0xFFFFFFFF for i in a if i < 32), sum(1 << i - 32 for i in a if i > 31)]
                 if isinstance(a, (set, frozenset)) else a for a in args]
        status = getattr(self.m.lib, "fw_" + name)(*plain) or 0
        self.m.fresh_slots()
        self.after(name, status)
        return status

    def after(self, kind, status):
        """Everything the core shows and asks for is as the reference says."""
        m, r, p = self.m, self.r, self.m.port
        r.keep_history()
        s = m.read()
        assert status == self.status, (kind, status, self.status)
        shown = dict(phase=r.phase, lds=r.lds, las=r.las, lpf=r.lpf, cdi=r.cdi, pi=r.pi, pecho=r.pecho, flags=r.flags(),
                     changed_slaves=r.changed_slaves, changed_us=r.changed_us, offline_causes=r.causes,
                     offline_us=r.offline_us)
        for name, value in shown.items():
            assert s[name] == value, (kind, name, s[name], value)
        wrong = [(i, s["in"][i], r.inputs[i]) for i in range(64) if s["in"][i] != r.inputs[i]]
        assert s["in"] == r.inputs, (kind, wrong)
        assert p.violations == 0, kind
        m.lib.fw_get_job(self.job)
        job = self.job
        assert (job.kind, job.index, job.value, job.status) == (r.job.kind, r.job.index, r.job.value, r.job.status), (
            kind, job.kind, job.index, job.value, job.status, vars(r.job))
        if job.status == 0:
            assert job.data == r.job.data, (kind, vars(r.job))
        self.calls(kind)
        self.events()
        if kind not in ("cycle", "batch", "tick", "lost", "power"):
            lps, pcd, pp, c = m.permanent()
            assert (lps, pcd, pp) == (r.lps, r.pcd, r.pp), kind
            assert c == dict(protected_mode=r.protected, offline=r.offline, data_exchange=r.exchange,
                             auto_address=r.auto_address, auto_clear=r.auto_clear), kind

    def calls(self, kind):
        """EX-029: batch, slots, management and inclusion call, and how the cycle runs."""
        m, r, p = self.m, self.r, self.m.port
        if r.batch is not None and p.batches != self.batches:
            assert [p.batch[k].call for k in range(p.batch_len)] == r.batch, kind
            assert all(p.batch[k].retries == 2 for k in range(p.batch_len))
        assert (r.batch is not None) == (p.batches != m.batches_run and bool(p.line)), kind
        self.batches = p.batches
        assert bytes(m.ffi.buffer(p.active)) == bytes(i in r.las for i in range(64)), kind
        for i in r.las:
            assert bool(p.extended[i]) == r.extended(i), (kind, i)
        running = r.phase == DATA_EXCHANGE
        assert bool(p.line) == (r.phase != OFFLINE), kind
        assert bool(p.cycle) == (running and not r.again), kind
        assert bool(p.inclusion_valid) == (running and r.probe is not None), kind
        if running and r.probe is not None:
            assert p.inclusion.call == r.probe and p.inclusion.retries == 0, (kind, hex(p.inclusion.call), hex(r.probe))
        if running:
            if not r.again:
                assert bool(p.read_id) == (not r.exchange) and not p.two_extra
                assert p.min_cycle_us == (0 if r.las else 1000), kind
        assert p.managements == r.managements, (kind, p.managements, r.managements)
        if r.management is not None:
            assert p.management.call == r.management, (kind, hex(p.management.call), hex(r.management))
            assert p.management.no_reply == r.no_reply and p.management.retries == (0 if r.no_reply else 2), kind
        if kind == "cycle" and self.status == 0:
            for i in range(64):
                bits = (7 if r.extended(i) else 15) if i in r.las else 0
                line = p.out[i >> 3] >> 4 * (i & 7) & 15
                assert line == 15 if not bits else line & bits == ~r.outputs[i] & bits, (kind, i)

    def events(self):
        """EX-038: what came and went in normal operation stands in the log."""
        head = self.m.lib.fw_log(self.ring)
        if head == self.head:
            assert not self.r.addressed
            assert self.before[0] != self.r.phase or self.before[1:] == (self.r.lds, self.r.las) or \
                self.r.phase != DATA_EXCHANGE
            return
        new = list(struct.iter_unpack("=IBBH", bytes(self.m.ffi.buffer(self.ring))))[64 - (head - self.head):]
        assert 0 < head - self.head <= 64
        self.head = head
        assert [(i, data) for _, event, i, data in new if event == 10] == self.r.addressed, new
        if self.before[0] == self.r.phase == DATA_EXCHANGE:
            _, lds, las = self.before
            for time_us, event, index, _ in new:
                assert time_us == self.r.now
                change = {4: lds.add, 5: lds.discard, 6: las.add, 7: las.discard}.get(event)
                if change:
                    change(index)
            assert (lds, las) == (self.r.lds, self.r.las), new
