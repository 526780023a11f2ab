# SPDX-License-Identifier: Apache-2.0
"""Functions with telegrams and automatic addressing: the core over slaves with an address that can change.

A cycle of this fake has one extra slot, and 5 ms; all times are bus time, counted here.
"""
import os
from collections import Counter

import cffi
import pytest
from fake_line import ABORTED, DATA_EXCHANGE, FLAGS, NO_RESPONSE, OFFLINE, OK, SETTLE_US, TICK_US, Slave, projection
from native import BUILD, ROOT, SANITIZE, SOURCES, compile_native, load

from asi.telegram import decode_call, encode_call

WRITE_PARAMETER, CHANGE, EXECUTE, WRITE_ID1, READ_STRING, WRITE_STRING, DIAGNOSIS, READ_ID, MESSAGE, AUTO = (
    5, 20, 22, 24, 27, 28, 29, 30, 31, 32)
(ARG, STATE, BUSY, ABORT, SLAVE0, NOT_DETECTED, NOT_ACTIVE, USED, NO_ANSWER, DELETE, NO_ID1, BAD_ID1, ID1_TEMPORARY,
 SET_ADDRESS, ADDRESS_TEMPORARY, PROFILE, TOO_LONG, AUTO_CLEAR_MODE, POWER, IS_OFFLINE, TRANSFER, DEVICE) = (
    -1, -2, -3, -4, -6, -7, -8, -9, -10, -11, -12, -13, -14, -15, -16, -17, -18, -20, -21, -22, -23, -24)
ADDRESSED = 10
CYCLE_US, NVM_US, POLL_US, RESET_US = 5000, 500_000, 5000, 2000
EVER = 10**6


class Line:
    """The core, a sequencer with one extra slot, and slaves. `calls`: calls of jobs as (payload, error, data).

    fault(k, call, attempt): what happens to attempt 0, 1, 2 of the k-th job call: None, "deaf" (the slave does not
    hear it) or "mute" (the answer is lost).
    """

    def __init__(self, slaves=(), projected=(), protected=False, auto=False, parameters=None, library=None, time_us=0):
        self.ffi, self.lib = library or load()
        self.port = self.lib.fw_port_record()
        self.slaves = list(slaves)
        for s in self.slaves:
            s.clock = lambda: self.port.time_us
        lps, pcd, pp = projection(projected, parameters)
        self.lps = {i for i in range(64) if lps[i >> 5] >> (i & 31) & 1}
        self.pcd = pcd
        self.protected, self.auto, self.apf = protected, auto, False
        self.fault = lambda k, call, attempt: None
        self.calls, self.exchanges, self.lost_in = [], Counter(), []
        self.streak, self.in_work = [0] * 64, [0] * 64
        self.managements = self.batches = self.number = 0
        self.result = self.inclusion = (0, 0, 0)
        self.was_management = False
        start = self.ffi.new("fw_permanent *", {"lps": lps, "pcd": pcd, "pp": pp, "controls": {
            "protected_mode": protected, "auto_address": auto, "data_exchange": 1}})
        assert self.lib.fw_init(start) == 0
        self.port.time_us = time_us

    # ---- below the port
    def attempt(self, call, what=None):
        if not self.port.line or self.apf:
            return ABORTED, 0
        if what == "deaf":
            return NO_RESPONSE, 0
        answers = {a for s in self.slaves if (a := s.answer(call)) is not None}
        if what == "mute" or not answers:
            return NO_RESPONSE, 0
        return (OK, answers.pop()) if len(answers) == 1 else (7, 0)

    def run(self, request, job=False):
        error, data = NO_RESPONSE, 0
        for attempt in range(request.retries + 1):
            what = self.fault(len(self.calls), request.call, attempt) if job else None
            error, data = self.attempt(request.call, what)
            if error in (OK, ABORTED) or request.no_reply:
                break
        if request.no_reply:
            error = OK
        if job:
            self.calls.append((request.call, error, data))
        return data, error, request.tag

    def batch(self):
        if self.batches == self.port.batches:
            return False
        self.batches = self.port.batches
        results = [self.run(self.port.batch[k]) for k in range(self.port.batch_len)]
        self.port.idle = 1
        self.lib.fw_batch_done(results, len(results))
        return True

    def cycle(self):
        p, lost = self.port, []
        if not p.cycle and (p.idle or not p.line):  # one that is stopped runs to its end
            return False
        las = self.read()["las"]
        for i in range(1, 64):
            if p.active[i] and self.streak[i] < 3 and (i < 32 or not p.active[i - 32] or self.number & 1):
                if i < 32 and p.active[i + 32] and self.number & 1:
                    continue
                nibble = 7 | (8 if i < 32 else 0) if p.extended[i] else 15
                call = (i & 31) << 5 | nibble if not p.read_id else encode_call("RDID", i)
                self.exchanges[i] += 1
                error, data = self.attempt(call)
                if error != OK:
                    error, data = self.attempt(call)
                self.streak[i] = 0 if error == OK else self.streak[i] + 1
                if error == OK:
                    self.in_work[i] = data
                elif self.streak[i] == 3:
                    lost.append(i)
        if self.managements != p.managements and not (self.was_management and p.inclusion_valid):
            self.managements = p.managements
            call = p.management.call
            polled = decode_call(call)
            self.result = self.run(p.management, job=not (polled.name == "RDST" and polled.index in las))
            self.was_management = True
        else:
            self.was_management = False
            if p.inclusion_valid:
                self.inclusion = self.run(p.inclusion)
        self.number += 1
        p.time_us = (p.time_us + CYCLE_US) % 2**32
        if lost:
            bits = sum(1 << i for i in lost)
            self.lib.fw_slave_lost([bits & 0xFFFFFFFF, bits >> 32])
        self.lib.fw_cycle_done(self.result, self.inclusion, [0] * 8)
        if not p.cycle:
            p.idle = 1
        for i in range(64):
            p.forgotten[i] = 0
            if not p.active[i]:
                self.streak[i] = 0
        self.check()
        return True

    def step(self):
        if not self.batch() and not self.cycle():
            self.managements = self.port.managements  # withdrawn when the next cycle starts
            self.batches, self.port.idle = self.port.batches, 1
            self.tick()
        return self

    def tick(self, us=TICK_US):
        self.port.time_us = (self.port.time_us + us) % 2**32
        self.lib.fw_tick(us)
        self.check()

    def check(self):
        """Lists, codes and flags agree with each other all the time; the port is used as it may be."""
        s = self.read()
        assert self.port.violations == 0
        assert s["las"] <= s["lds"] and ("lds0" in s["flags"]) == (0 in s["lds"])
        assert {i for i in range(64) if s["cdi"][i] != 0xFFFF} <= s["lds"]
        good = s["lds"] == self.lps and all(s["cdi"][i] == self.pcd[i] for i in self.lps)
        assert ("config_ok" in s["flags"]) == good
        missing = self.lps - s["lds"]
        wrong = {i for i in s["lds"] - {0} if i not in self.lps or s["cdi"][i] != self.pcd[i]}
        assert ("auto_address_available" in s["flags"]) == (
            self.auto and self.protected and len(missing) == 1 and not wrong)

    # ---- the test
    def read(self):
        s = self.ffi.new("fw_state *")
        self.lib.fw_read(s)

        def members(words):
            return {i for i in range(64) if words[i >> 5] >> (i & 31) & 1}
        return {"phase": s.phase, "lds": members(s.lds), "las": members(s.las), "cdi": list(s.cdi), "pi": list(s.pi),
                "pecho": list(s.pecho), "flags": {n for k, n in enumerate(FLAGS) if s.flags >> k & 1}}

    def start(self):
        self.tick(SETTLE_US)
        return self.until(lambda: self.read()["phase"] == DATA_EXCHANGE)

    def until(self, condition, steps=3000):
        for _ in range(steps):
            if condition():
                return self
            self.step()
        raise AssertionError(f"not in {steps} steps: {self.read()}")

    def cycles(self, n):
        for _ in range(n):
            self.step()
        return self

    def rounds(self, n=4):
        """So many inclusion rounds and some calls of a candidate that is read."""
        return self.cycles(n * (2 * 66 + 20))

    def job(self):
        j = self.ffi.new("fw_job *")
        self.lib.fw_get_job(j)
        return j

    def begin(self, kind, index=0, value=0, data=b"", length=None):
        return self.lib.fw_start(kind, index, value, data or self.ffi.NULL, len(data) if length is None else length)

    def do(self, kind, index=0, value=0, data=b"", length=None):
        """Begin and run to the end. -> status"""
        del self.calls[:]
        status = self.begin(kind, index, value, data, length)
        assert status <= 0
        if status == 0:
            self.until(lambda: self.job().status != BUSY)
            return self.job().status
        return status

    def names(self):
        """Job calls as 'name index' with repeats folded."""
        out = []
        for call, _, _ in self.calls:
            text = name(call, {s.index & 31 for s in self.slaves if s.extended})
            if not out or out[-1] != text:
                out.append(text)
        return out

    def controls(self, **changes):
        c = self.ffi.new("fw_controls *")
        self.lib.fw_get_controls(c)
        for key, value in changes.items():
            setattr(c, key, value)
        return self.lib.fw_set_controls(c)

    def power(self, apf):
        self.apf = apf
        for s in self.slaves:
            s.power_up()
        self.lib.fw_power(apf)

    def events(self, kind):
        out = self.ffi.new("fw_log_entry[64]")
        n = self.lib.fw_log(out)
        return [(e.index, e.data) for e in out[max(0, 64 - n):64] if e.event == kind]

    def agree(self):
        """After some rounds lists and codes are those of the slaves, none lost; all that may be active are."""
        self.rounds()
        s = self.read()
        here = {x.index: x.codes for x in self.slaves if x.present}
        assert s["lds"] == set(here) and {i: s["cdi"][i] for i in here} == here
        allowed = {i for i in here if i and (not self.protected or i in self.lps and self.pcd[i] == here[i])}
        assert s["las"] == allowed
        return self


def name(call, extended=()):
    if call >> 5 == 0 and not call >> 10:
        return f"ADRA {call & 31}"
    d = decode_call(call, lambda number: number in extended)
    select = 32 if d.index == 0 and d.name != "WID1" and call & 31 != encode_call(d.name, 0) & 31 else 0
    return d.name if d.index is None else f"WID1 {d.data}" if d.name == "WID1" else f"{d.name} {d.index + select}"


def std(index, **kw):
    return Slave(index, **kw)


def ab(index, **kw):
    return Slave(index, id=0xA, **{"id1": 7 | (8 if index > 31 else 0), **kw})


# ------------------------------------------------------------------------------------------ one call
def test_write_parameter():
    """FN-005, CA-002: one WPAR; PI is the value, PECHO and the answer what the slave gave."""
    m = Line([std(3, echo=9), ab(5), ab(37)]).start()
    for index, value, call in ((3, 10, encode_call("WPAR", 3, 10)), (5, 2, encode_call("WPAR", 5, 2, True)),
                               (37, 6, encode_call("WPAR", 37, 6))):
        assert m.do(WRITE_PARAMETER, index, value) == 0 and [c for c, _, _ in m.calls] == [call]
        s = m.read()
        assert s["pi"][index] == value and m.job().data == s["pecho"][index]
        assert next(x for x in m.slaves if x.index == index).parameter == value
    assert m.read()["pecho"][3] == 9 and m.slaves[0].parameter == 10


def test_write_parameter_unanswered():
    """FN-005: without an answer, after three attempts, PI stays."""
    m = Line([std(3), std(4)]).start()
    m.fault = lambda k, call, attempt: "deaf"
    assert m.do(WRITE_PARAMETER, 3, 1) == NO_ANSWER and m.read()["pi"][3] == 15 and m.job().kind == WRITE_PARAMETER
    m.fault = lambda k, call, attempt: "mute" if attempt < 2 else None
    assert m.do(WRITE_PARAMETER, 3, 1) == 0 and m.read()["pi"][3] == 1


def test_refusals_of_parameters():
    """FN-005, EX-025: ARG and NOT_ACTIVE; nothing is sent."""
    m = Line([std(3), ab(5), ab(37), std(9, mute=frozenset({"WPAR"}))]).start()
    for index, value in ((0, 1), (32, 1), (64, 1), (3, 16), (5, 8), (37, 8), (40, 8)):
        assert m.begin(WRITE_PARAMETER, index, value) == ARG
    assert m.begin(WRITE_PARAMETER, 9, 1) == NOT_ACTIVE and m.begin(WRITE_PARAMETER, 20, 1) == NOT_ACTIVE
    m.cycles(4)
    assert not m.calls
    for kind in (0, 1, 4, 6, 21, 23, 26, AUTO, 33):
        assert m.begin(kind, 3, 4) == ARG


def test_refusals_of_the_state():
    """FN-022, FN-032, FN-033: arguments first, then POWER, OFFLINE, STATE, BUSY, then the slave; nothing changes."""
    m = Line([std(3), std(0)])
    assert m.begin(CHANGE, 3, 3) == ARG and m.begin(CHANGE, 9, 4) == STATE
    m.start()
    assert m.begin(CHANGE, 9, 4) == NOT_DETECTED
    assert m.begin(EXECUTE, 3, 0x10) == 0 and m.begin(CHANGE, 9, 4) == BUSY and m.begin(CHANGE, 9, 9) == ARG
    m.until(lambda: m.job().status != BUSY)
    m.controls(offline=1)
    assert m.begin(CHANGE, 9, 4) == IS_OFFLINE
    m.power(True)
    assert m.begin(CHANGE, 9, 4) == POWER
    m.power(False)
    m.controls(offline=0)
    assert m.begin(CHANGE, 9, 4) == STATE and m.job().kind == EXECUTE
    m.until(lambda: m.read()["phase"] == DATA_EXCHANGE)
    m.controls(data_exchange=0)
    m.controls(data_exchange=1)
    assert m.begin(EXECUTE, 3, 0x10) == STATE  # all slaves are being activated anew


TABLE = {28: "RES", 20: "RES", 16: "RDIO", 24: "RDIO", 17: "RDID", 25: "RDID", 18: "RID1", 26: "RID1", 19: "RID2",
         27: "RID2", 30: "RDST", 22: "RDST", 31: "R1", 23: "R1"}


def test_execute_takes_the_legal_set_only():
    """FN-022, CA-003: of all numbers and codes exactly the table's are sent; DELA, ADRA, DEXG, WPAR, PRGM never."""
    m = Line([std(3)]).start()
    for number in range(33):
        for info in range(33):
            legal = number < 32 and (info in TABLE or number == 0 and info < 16 or number == 31 and info == 21)
            if not legal:
                assert m.begin(EXECUTE, number, info) == ARG, (number, info)
            elif number in (0, 7, 31) and (number, info) != (31, 21):
                assert m.do(EXECUTE, number, info) == NO_ANSWER
                assert [c for c, _, _ in m.calls] == [0x400 | number << 5 | info]
    m.cycles(3)
    assert m.read()["las"] == {3}


def test_execute_answers():
    """FN-022: the slave's answer is the data; A and B slaves through the code, address 0 with both selects; R1."""
    slaves = [std(3, io=5, id=2, id1=6, id2=9), ab(5, io=1, id1=3), ab(37, io=4, id1=11, fault=True),
              ab(0, zero_select="1", io=2)]
    m = Line(slaves).start()
    for number, info, data in ((3, 16, 5), (3, 17, 2), (3, 18, 6), (3, 19, 9), (5, 16, 1), (5, 24, 4), (5, 26, 11),
                               (5, 30, 0), (5, 22, 2), (5, 23, 2), (3, 31, 0), (0, 24, 2), (0, 13, 0)):
        assert m.do(EXECUTE, number, info) == 0 and m.job().data == data, (number, info)
    assert slaves[3].id1 == 13
    assert m.do(EXECUTE, 0, 16) == NO_ANSWER
    m.rounds(1)
    assert m.read()["cdi"][0] >> 8 & 15 == 13  # inclusion reads it again


@pytest.mark.parametrize("index", [3, 5, 37])
def test_reset_slave(index):
    """FN-022: RES: the slave leaves LAS, not LDS, and is activated at once with its parameter, 2 ms later."""
    m = Line([std(3, inputs=1), ab(5), ab(37)], parameters={index: 6}).start().cycles(4)
    slave = next(s for s in m.slaves if s.index == index)
    lds, seen = m.read()["lds"], []
    assert m.begin(EXECUTE, index & 31, encode_call("RES", index) & 31) == 0
    while m.job().status == BUSY:
        m.cycles(1)
        s = m.read()
        seen.append(index in s["las"])
        assert s["lds"] == lds and s["las"] | {index} == lds
    assert m.job().status == 0 and m.job().data == 6 and False in seen and seen[-1]
    assert not slave.disabled and slave.parameter == 6 and len(m.calls) == 3
    assert m.names()[1:] == [f"WPAR {index}", f"DEXG {index}"]
    m.agree()


def test_reset_of_a_slave_that_stays_silent():
    """FN-022: a reset slave that does not take its parameter is left to inclusion; the function is done."""
    m = Line([std(3), std(4)]).start()
    m.slaves[0].mute = frozenset({"WPAR"})
    assert m.do(EXECUTE, 3, 28) == 0 and m.job().data == 6
    assert m.read()["las"] == {4} and 3 in m.read()["lds"]
    m.slaves[0].mute = frozenset()
    m.agree()


def test_broadcast_reset():
    """FN-022: BR01 has no answer: OK; all of LAS is activated anew, not before 2 ms, and nobody leaves LDS."""
    slaves = [std(3), ab(5), ab(37), std(31)]
    m = Line(slaves, parameters={3: 4, 37: 2}).start().cycles(5)
    for s in slaves:
        s.heard.clear()
    assert m.do(EXECUTE, 31, 21) == 0 and m.names() == ["BR01"]
    at = m.port.time_us
    assert all(s.disabled for s in slaves)
    while slaves[0].heard["WPAR"] == 0:
        m.step()
    assert m.port.time_us - at >= RESET_US
    m.until(lambda: m.read()["las"] == {3, 5, 37, 31}, 60)
    assert m.read()["lds"] == {3, 5, 37, 31} and [s.parameter for s in slaves] == [4, 7, 2, 15]
    assert not m.events(5)  # nobody was lost
    m.agree()


def test_broadcast_reset_and_data_exchange():
    """FN-022, EX-024: data exchange that comes back meanwhile does not cut the pause after BR01 short."""
    m = Line([std(3), std(4)]).start().cycles(5)
    assert m.do(EXECUTE, 31, 21) == 0
    at = m.port.time_us
    m.slaves[0].heard.clear()
    assert m.controls(data_exchange=0) == 0 == m.controls(data_exchange=1)
    while m.slaves[0].heard["WPAR"] == 0:
        m.step()
    assert m.port.time_us - at >= RESET_US
    m.agree()


# ------------------------------------------------------------------------------------------ address change
def test_change_of_a_standard_slave():
    """FN-020, AD-002, AD-004, AD-005, AD-006, FN-032: call by call, one per management slot, while the others go on."""
    m = Line([std(3, io=1, id=2, inputs=5), std(4), ab(6)], parameters={9: 10}).start().cycles(10)
    m.slaves[0].write_us = 42_000
    del m.calls[:]
    before, number = m.exchanges[4], m.number
    assert m.begin(CHANGE, 3, 9) == 0
    states = []
    while m.job().status == BUSY:
        m.step()
        s = m.read()
        if not states or states[-1] != (sorted(s["lds"]), sorted(s["las"])):
            states.append((sorted(s["lds"]), sorted(s["las"])))
    assert m.job().status == 0 and m.slaves[0].index == 9 and m.slaves[0].memory == (9, 15)
    assert m.names() == ["DELA 3", "RID1 0", "ADRA 9", "RDST 9", "WPAR 9", "DEXG 9"]
    assert states == [([3, 4, 6], [3, 4, 6]), ([0, 4, 6], [4, 6]), ([4, 6, 9], [4, 6]), ([4, 6, 9], [4, 6, 9])]
    assert m.slaves[0].parameter == 10 and m.read()["cdi"][9] == m.slaves[0].codes and m.read()["cdi"][3] == 0xFFFF
    assert m.exchanges[4] - before == m.number - number  # every cycle
    # every 5 ms while it writes, but inclusion has every second slot, and status polls of the others go on
    assert [c for c, _, _ in m.calls].count(encode_call("RDST", 9)) in (3, 4, 5)
    assert m.events(ADDRESSED) == [(9, 3)]
    m.agree()


@pytest.mark.parametrize("zero_select", ["0", "1", "id1", "both"])
@pytest.mark.parametrize("old, new", [(5, 37), (37, 5), (5, 6), (37, 38), (5, 60), (0, 5), (0, 37)])
def test_change_of_an_ab_slave(old, new, zero_select):
    """AD-003, AD-007: WID1 only where the select changes, bit 3 only; whatever select it obeys at address 0."""
    moved = ab(old, id1=3 | (8 if old > 31 else 0), zero_select=zero_select, write_us=12_000)
    m = Line([moved, std(20)]).start().rounds(1)
    assert m.read()["lds"] == {old, 20}
    assert m.do(CHANGE, old, new) == 0
    s = m.slaves[0]
    assert s.index == new and s.id1 == 3 | (8 if new > 31 else 0) and s.memory == (new, s.id1)
    flips = (old > 31) != (new > 31)
    assert [n for n in m.names() if n.startswith("WID1")] == ([f"WID1 {s.id1}"] if flips else [])
    assert m.read()["las"] == {new, 20}
    m.agree()


def test_pair_on_one_number():
    """FN-020, EX-026: a B slave joins its A slave and leaves it again; data exchange of A goes on."""
    m = Line([ab(5), ab(40), std(20)]).start()
    assert m.do(CHANGE, 40, 37) == 0
    m.agree()
    assert m.read()["las"] == {5, 37, 20}
    assert m.do(CHANGE, 5, 41) == 0 and m.do(CHANGE, 37, 5) == 0
    assert m.agree().read()["las"] == {5, 41, 20}


def test_change_to_and_from_zero():
    """AD-002: new address 0 ends with the deleted address, which is volatile; then the slave gets its next one."""
    m = Line([std(3), std(4)]).start()
    assert m.do(CHANGE, 3, 0) == 0 and m.names() == ["DELA 3", "RID1 0"]
    assert m.read()["lds"] == {0, 4} and m.read()["cdi"][0] == m.slaves[0].codes and m.slaves[0].memory == (3, 15)
    m.rounds(1)
    assert m.read()["lds"] == {0, 4}
    assert m.do(CHANGE, 0, 12) == 0 and m.names()[:2] == ["RID1 0", "ADRA 12"]
    assert m.read()["lds"] == {4, 12} == m.read()["las"]
    m.agree()


def test_slaves_without_id1():
    """AD-002, EX-005, EX-028: a slave before 2.1 is found at address 0 by its ID code."""
    m = Line([std(3, old=True), std(4)]).start()
    assert m.do(CHANGE, 3, 7) == 0 and m.names()[:4] == ["DELA 3", "RID1 0", "RDID 0", "ADRA 7"]
    m.slaves[0].fault = True  # S1 means something else there
    assert "periphery_ok" in m.agree().read()["flags"]


def test_refusals_of_a_change():
    """AD-001, EX-025: each reason, without a telegram."""
    m = Line([std(3), ab(5), ab(38), std(7, io=6, id=0, id2=0xB), std(8, io=6, id=0, id2=6), std(9, io=6, id=0, id2=5),
              ab(41, present=False)]).start()
    cases = [(3, 3, ARG), (0, 0, ARG), (3, 32, ARG), (32, 3, ARG), (64, 3, ARG), (3, 64, ARG), (4, 10, NOT_DETECTED),
             (0, 10, NOT_DETECTED), (3, 5, USED), (3, 40, ARG), (3, 6, USED), (5, 35, USED), (38, 35, USED),
             (7, 2, USED), (7, 30, USED)]
    for old, new, status in cases:
        assert m.begin(CHANGE, old, new) == status, (old, new)
    m.slaves.append(std(0, clock=lambda: 0))
    m.rounds(1)
    assert m.begin(CHANGE, 3, 10) == SLAVE0 == m.begin(CHANGE, 3, 0)
    assert m.begin(CHANGE, 0, 5) == USED and not m.calls and not m.events(ADDRESSED)


def test_wide_slaves_move():
    """AD-001, AD-009: the addresses of a wide slave (combined transaction 5) may overlap its own old ones,
    nobody else's; ID2 above C is no wide slave."""
    def line(*others):
        return Line([std(10, io=6, id=0, id2=0xB), std(20, io=6, id=0, id2=0xD), *others]).start()
    for new, status in ((9, 0), (11, 0), (8, 0), (7, 0), (29, 0), (30, USED), (18, USED), (17, 0)):
        assert line().begin(CHANGE, 10, new) == status, new
    assert line(ab(45)).begin(CHANGE, 10, 11) == USED  # the B slave of a member's number
    assert line().begin(CHANGE, 20, 31) == 0


def test_change_and_auto_clear():
    """AD-001, EX-033: a projected slave would be missing at once and stop the line; others may move."""
    m = Line([std(3), std(4)], projected=[std(3)], protected=True).start()
    assert m.controls(auto_clear=1) == 0
    assert m.begin(CHANGE, 3, 9) == AUTO_CLEAR_MODE == m.begin(CHANGE, 3, 0) and m.do(CHANGE, 4, 9) == 0
    assert m.controls(auto_clear=2) == 0
    assert m.do(CHANGE, 3, 10) == 0 and m.read()["phase"] == DATA_EXCHANGE


def test_memory_that_does_not_last():
    """AD-005: S3, or S0 for longer than P_NVM: the address holds until power-up and the status says so."""
    m = Line([std(3, memory_fails=True), std(4)]).start()
    assert m.do(CHANGE, 3, 9) == ADDRESS_TEMPORARY and m.slaves[0].index == 9
    assert m.read()["las"] == {4, 9} and m.events(ADDRESSED) == [(9, 3 | -ADDRESS_TEMPORARY << 8)]
    m.agree()
    m = Line([std(3, write_us=NVM_US + 400_000), std(4)]).start()
    start = m.port.time_us
    assert m.do(CHANGE, 3, 9) == ADDRESS_TEMPORARY
    assert NVM_US <= m.port.time_us - start <= NVM_US + 12 * CYCLE_US
    m.agree()


def test_longest_memory_write():
    """AD-005: a write of almost P_NVM is waited for; also when the bus time wraps meanwhile."""
    m = Line([std(3, write_us=NVM_US - 20_000), std(4)], time_us=2**32 - 1_500_000).start()
    assert m.do(CHANGE, 3, 9) == 0 and m.read()["las"] == {4, 9} and m.port.time_us < 2**31


def test_silent_status():
    """AD-005: a slave that never tells its status has the address, but nobody knows for how long."""
    m = Line([std(3, mute=frozenset({"RDST"})), std(4)]).start()
    assert m.do(CHANGE, 3, 9) == ADDRESS_TEMPORARY and m.names()[-4:] == ["RDST 9", "RDID 9", "WPAR 9", "DEXG 9"]
    m.agree()


def test_id1_that_does_not_last():
    """AD-003, AD-004: the select cannot be stored: the slave keeps its old address, with its old ID1."""
    m = Line([ab(5, id1=2, memory_fails=True), std(4)]).start()
    assert m.do(CHANGE, 5, 37) == ID1_TEMPORARY and (m.slaves[0].index, m.slaves[0].id1) == (5, 2)
    m.agree()
    m = Line([ab(5, id1=2, mute=frozenset({"WID1"})), std(4)]).start()
    assert m.do(CHANGE, 5, 37) == BAD_ID1 and (m.slaves[0].index, m.slaves[0].id1) == (5, 2)
    m.agree()


def test_protected_mode_activates_what_is_projected():
    """AD-006, EX-009: after the change the slave is active only where its new address is projected so."""
    m = Line([std(3), std(4)], projected=[std(4), std(9)], protected=True).start()
    assert m.do(CHANGE, 3, 9) == 0 and m.read()["las"] == {4, 9} and "config_ok" in m.read()["flags"]
    assert m.do(CHANGE, 9, 11) == 0 and m.read()["las"] == {4} and 11 in m.read()["lds"]
    assert m.names()[-1] == "RDST 11"
    m.agree()


def test_change_without_data_exchange():
    """FN-020, EX-024: addresses can be changed while data exchange is inactive."""
    m = Line([std(3), std(4)]).start()
    m.controls(data_exchange=0)
    assert m.do(CHANGE, 3, 9) == 0
    m.agree()


SCENES = {
    "standard": (lambda: [std(3, id=1), std(4)], 3, 9),
    "a to b": (lambda: [ab(5, id1=2, zero_select="id1"), std(4)], 5, 41),
    "b to a": (lambda: [ab(41, id1=10), std(4)], 41, 41 - 32),
    "zero": (lambda: [ab(0, id1=1, zero_select="both"), std(4)], 0, 41),
    "to zero": (lambda: [std(3), std(4)], 3, 0),
}


def clean_length(scene):
    slaves, old, new = SCENES[scene]
    m = Line(slaves()).start().rounds(1)
    assert m.do(CHANGE, old, new) == 0
    return len(m.calls)


@pytest.mark.parametrize("kind", ["deaf", "mute"])
@pytest.mark.parametrize("scene", SCENES)
def test_failure_at_every_step(scene, kind):
    """AD-002, AD-003, AD-004, AD-005, AD-006: every call of the sequence fails once (one attempt), wholly (three) and
    for ever (this call and all equal ones), heard by the slave or not. The slave is always at its old or new address,
    in the lists there; only a call that never gets through may leave it at address 0, where it is shown."""
    slaves, old, new = SCENES[scene]
    outcomes = Counter()
    for step in range(clean_length(scene)):
        for how in ("once", "wholly", "for ever"):
            m = Line(slaves()).start().rounds(1)
            broken = set()

            def fault(k, call, attempt):
                if k == step:
                    broken.add(call)
                if how == "for ever":
                    return kind if call in broken else None
                return kind if k == step and (how == "wholly" or attempt == 0) else None
            before = (m.slaves[0].index, m.slaves[0].id1)
            m.fault = fault
            status = m.do(CHANGE, old, new)
            place = m.slaves[0].index
            outcomes[status] += 1
            where = (scene, step, how, m.names(), status, place)
            assert place in ({old, new} if how != "for ever" else {old, new, 0}), where
            if how == "once":
                assert status == 0, where
            if status in (0, ADDRESS_TEMPORARY):
                assert place == new, where
            elif place == old and how != "for ever":
                assert before == (place, m.slaves[0].id1), where
            s = m.read()
            assert place in s["lds"] or place == 0, where
            if place:
                assert 0 not in s["lds"], where
            m.fault = lambda k, call, attempt: None
            m.agree()  # found wherever it is
            assert m.begin(EXECUTE, 4, 16) == 0  # inclusion and functions are free again
    assert outcomes[0] and (len(outcomes) > 1 or scene == "to zero" and kind == "mute")


@pytest.mark.parametrize("scene", ["standard", "a to b"])
@pytest.mark.parametrize("unplugged_for", [1, 12, EVER])
def test_slave_pulled_at_every_step(scene, unplugged_for):
    """AD-004: the slave is pulled before each call of the sequence, for a moment or for good: an error or success,
    never a hang; when it is back it is found wherever its memory says."""
    slaves, old, new = SCENES[scene]
    for step in range(clean_length(scene)):
        m = Line(slaves()).start().rounds(1)
        slave = m.slaves[0]

        def fault(k, call, attempt):
            if k >= step and slave.present and not getattr(m, "pulled", 0):
                m.pulled = m.number + 1
                slave.present = False
            elif not slave.present and m.number - m.pulled >= unplugged_for:
                slave.power_up()
                slave.present = True
        m.fault = fault
        status = m.do(CHANGE, old, new)
        assert status in (0, DELETE, NO_ID1, BAD_ID1, ID1_TEMPORARY, SET_ADDRESS, ADDRESS_TEMPORARY), status
        m.agree()
        slave.power_up()
        slave.present = True
        m.agree()


@pytest.mark.parametrize("how", ["offline", "power", "mode", "exchange"])
def test_abort_at_every_step(how):
    """FN-033: OFFLINE, power fail, a change of mode or a new activation in the middle: ABORTED, and nothing of the
    function is sent afterwards; the next start finds the slave."""
    scene = "a to b"
    slaves, old, new = SCENES[scene]
    for step in range(clean_length(scene) + 1):
        m = Line(slaves()).start().rounds(1)
        if how == "exchange":
            m.controls(data_exchange=0)
        del m.calls[:]
        assert m.begin(CHANGE, old, new) == 0
        m.until(lambda: len(m.calls) == step or m.job().status != BUSY)
        if m.job().status != BUSY:
            break
        if how == "offline":
            m.controls(offline=1)
        elif how == "power":
            m.power(True)
        elif how == "mode":
            m.protected = True
            if m.controls(protected_mode=1) == SLAVE0:
                assert 0 in m.read()["lds"]
                continue
        else:
            m.controls(data_exchange=1)
            m.until(lambda: m.job().status != BUSY, 50)
        assert m.job().status == ABORT and m.events(ADDRESSED)[-1] == (new, old | 4 << 8)
        sent = len(m.calls)
        m.cycles(3)
        if how == "offline":
            m.controls(offline=0)
        elif how == "power":
            m.power(False)
        m.until(lambda: m.read()["phase"] == DATA_EXCHANGE)
        m.agree()
        assert len(m.calls) <= sent + (how == "exchange")
        assert m.begin(EXECUTE, 4, 16) == 0


def at_call(m, name_, action):
    """Do something in the plant just before the first job call of this name. The call goes on as usual."""
    done = []

    def fault(k, call, attempt):
        if name(call, {s.index & 31 for s in m.slaves if s.extended}) == name_ and not done:
            done.append(action())
    m.fault = fault
    return done


class Odd(Slave):
    """Answers one call with a wrong nibble."""
    def answer(self, call):
        data = super().answer(call)
        return data if data is None or call >> 5 != self.odd else 1

    odd = None


def test_wrong_answers():
    """AD-002, AD-004: DELA not with 0, ADRA not with 6: the next call tells what happened."""
    m = Line([Odd(3), std(4)]).start()
    m.slaves[0].odd = 0x400 >> 5 | 3  # commands to 3, DELA among them
    m.until(lambda: m.begin(CHANGE, 3, 9) == 0)
    m.slaves[0].odd = 0x400 >> 5 | 3
    m.until(lambda: m.job().status != BUSY)
    assert m.job().status == 0 and m.slaves[0].index == 9
    m.slaves[0].odd = 0  # ADRA
    assert m.do(CHANGE, 9, 3) == 0 and "RDID 3" in m.names() and m.slaves[0].index == 3
    m.agree()


def test_other_slaves_come_in_the_way():
    """AD-002, AD-004, AD-005: a slave with another ID code shows up where the moved one is looked for: it is not taken
    for it, and both are found in the end."""
    m = Line([std(3, old=True), std(4), std(0, id=1, old=True, present=False)]).start()

    def fault(k, call, attempt):
        m.slaves[2].present = True
        return "deaf" if k == 0 else None
    m.fault = fault
    assert m.do(CHANGE, 3, 9) == DELETE and m.names()[:4] == ["DELA 3", "RID1 0", "RDID 0", "RDID 3"]
    assert m.read()["las"] >= {3, 4}
    m.agree()

    m = Line([std(3), std(4), std(9, id=1, present=False)]).start()
    at_call(m, "ADRA 9", lambda: (setattr(m.slaves[0], "deaf", 3), setattr(m.slaves[2], "present", True)))
    assert m.do(CHANGE, 3, 9) == SET_ADDRESS and m.slaves[0].index == 3 and m.names()[2:4] == ["ADRA 9", "RDID 9"]
    m.agree()

    m = Line([std(3, mute=frozenset({"RDST"})), std(4)]).start()
    at_call(m, "RDID 9", lambda: setattr(m.slaves[0], "id", 1))
    assert m.do(CHANGE, 3, 9) == SET_ADDRESS
    m.agree()


@pytest.mark.parametrize("call", ["WPAR 9", "DEXG 9"])
def test_projection_changes_during_a_change(call):
    """AD-006, EX-009: the new address is not projected any more when the slave there would be activated."""
    m = Line([std(3), std(4)], projected=[std(4), std(9)], protected=True).start()

    def unproject():
        m.lps = {4}
        assert m.lib.fw_set_projection([1 << 4, 0], m.pcd, [15] * 64) == 0
    assert not at_call(m, call, unproject)
    assert m.do(CHANGE, 3, 9) == 0 and m.read()["las"] == {4} and m.read()["lds"] == {4, 9}
    m.agree()


def test_write_id1_of_a_standard_slave_that_falls_silent():
    """FN-024, AD-007: no status, no ID1: there is no other select to try."""
    m = Line([std(0, id1=4, mute=frozenset({"RDST"})), std(4)]).start()
    assert m.do(WRITE_ID1, value=9) == ID1_TEMPORARY and m.slaves[0].id1 == 9
    m.agree()
    m.slaves[0].mute = frozenset()
    m.fault = lambda k, call, attempt: "mute" if k == 3 else None
    assert m.do(WRITE_ID1, value=2) == NO_ID1 and m.names()[-1] == "RID1 0" and m.slaves[0].id1 == 2
    m.agree()


def test_nobody_left_to_look_for():
    """FN-024, EX-012: with all 62 active and address 0 taken by the function inclusion has nobody to probe."""
    m = Line([ab(n + sel) for n in range(1, 32) for sel in (0, 32)] + [std(0, id1=4, write_us=30_000)]).start()
    m.until(lambda: len(m.read()["las"]) == 62)
    assert m.begin(WRITE_ID1, 0, 9) == 0
    silent = 0
    while m.job().status == BUSY:
        m.step()
        silent += not m.port.inclusion_valid
    assert m.job().status == 0 and silent > 3 and m.port.inclusion_valid
    m.slaves[5].present = False
    m.until(lambda: len(m.read()["lds"]) == 62)
    m.slaves[5].present = True
    m.until(lambda: len(m.read()["las"]) == 62)


def test_parameter_as_it_was():
    """FN-005: writing the parameter in use is a call like any other."""
    m = Line([std(3)]).start()
    assert m.do(WRITE_PARAMETER, 3, 15) == 0 and m.job().data == 15 and len(m.calls) == 1


def break_off(m, how):
    """What ends a job in the middle: OFFLINE, a power fail, or data exchange coming back."""
    if how == "offline":
        m.controls(offline=1)
        m.cycles(3)
        m.controls(offline=0)
    elif how == "power":
        m.power(True)
        m.cycles(3)
        m.power(False)
    elif how == "exchange":
        m.controls(data_exchange=1)


def left_behind(scene, how, heard, step, protected=False, auto=False):
    """A change broken off before call `step` of it, the last call before it with this fault, if any; the next start is
    over. -> line, or None: the change had ended before"""
    slaves, old, new = SCENES[scene]
    here = slaves()
    m = Line(here, projected=here if protected else (), protected=protected, auto=auto).start().rounds(1)
    m.fault = lambda k, call, attempt: heard if k >= step - 1 else None
    if how == "exchange":
        m.controls(data_exchange=0)
    del m.calls[:]
    assert m.begin(CHANGE, old, new) == 0
    m.until(lambda: len(m.calls) == step or m.job().status != BUSY)
    if m.job().status != BUSY:
        return None
    break_off(m, how)
    m.until(lambda: m.job().status != BUSY)
    assert m.job().status == ABORT
    m.fault = lambda k, call, attempt: None
    m.until(lambda: m.read()["phase"] == DATA_EXCHANGE)
    return m


@pytest.mark.parametrize("how", ["offline", "power", "exchange"])
@pytest.mark.parametrize("scene", ["standard", "a to b", "b to a"])
def test_a_slave_left_behind_can_be_addressed(scene, how):
    """FN-033, AD-001, AD-002, AD-007, EX-032: OFFLINE, power fail or a new activation leave the slave at its old
    address, its new one or 0: there it is found in either mode, LDS.0 shows it, the change to protected mode is
    refused, and function 20 brings it back."""
    old, places = SCENES[scene][1], Counter()
    for protected in (False, True):
        for heard in (None, "mute", "deaf"):
            for step in range(1, 2 if heard == "deaf" else clean_length(scene) + 1):
                m = left_behind(scene, how, heard, step, protected)
                if m is None:
                    break
                slave = m.slaves[0]
                m.until(lambda: {s.index for s in m.slaves} == m.read()["lds"], 400)
                places[slave.index] += 1
                where = (protected, heard, step, slave.index)
                assert ("lds0" in m.read()["flags"]) == (slave.index == 0), where
                if slave.index == 0 and not protected:
                    assert m.controls(protected_mode=1) == SLAVE0, where
                if slave.index != old:
                    assert m.do(CHANGE, slave.index, old) == 0, where
                m.until(lambda: m.read()["las"] == m.read()["lds"] == {s.index for s in m.slaves}, 400)
                assert old in m.read()["las"] and ("config_ok" in m.read()["flags"]) == protected, where
                if not protected:
                    m.protected = True
                    m.lps, m.pcd = {s.index for s in m.slaves}, m.read()["cdi"]
                    assert m.lib.fw_store_configuration() == 0 and m.controls(protected_mode=1) == 0, where
                    m.until(lambda: "config_ok" in m.read()["flags"] and old in m.read()["las"], 400)
    assert places[old] and (places[0] or how == "power")  # what was deleted is not lost with the supply


@pytest.mark.parametrize("scene", ["standard", "a to b"])
def test_a_slave_left_behind_at_the_next_power_up(scene):
    """AD-001, EX-002, EX-032, FN-020: the master itself starts anew in protected mode with the slave at 0: the others
    are active, the slave is shown, and function 20 brings it back."""
    m = left_behind(scene, "offline", None, 2, protected=True)
    assert m.slaves[0].index == 0
    old = SCENES[scene][1]
    gone = Line(m.slaves)
    gone.lps, gone.pcd, gone.protected = m.lps, m.pcd, True
    lps = sum(1 << i for i in m.lps)
    start = {"lps": [lps & 0xFFFFFFFF, lps >> 32], "pcd": m.pcd, "pp": [15] * 64,
             "controls": {"protected_mode": 1, "data_exchange": 1}}
    assert gone.lib.fw_init(gone.ffi.new("fw_permanent *", start)) == 0
    gone.port.time_us = 0
    gone.start()
    assert gone.agree().read()["las"] == gone.lps - {old} and "lds0" in gone.read()["flags"]
    assert gone.do(CHANGE, 0, old) == 0
    assert "config_ok" in gone.agree().read()["flags"]


def test_a_slave_left_behind_and_automatic_addressing():
    """AD-008, FN-033: with automatic addressing the slave left at 0 is the missing one and gets its address back."""
    for scene in ("standard", "a to b", "b to a"):
        m = left_behind(scene, "offline", None, 2, protected=True, auto=True)
        m.until(lambda: SCENES[scene][1] in m.read()["las"], 400)
        assert "config_ok" in m.agree().read()["flags"]


def test_deleted_address_and_automatic_addressing():
    """AD-002, AD-008: a projected slave that the host sends to 0 is the missing one: automatic addressing brings it back."""
    m = Line([std(3), std(4)], projected=[std(3), std(4)], protected=True, auto=True).start()
    assert m.do(CHANGE, 3, 0) == 0
    m.until(lambda: m.read()["las"] == {3, 4}, 400)
    assert m.events(ADDRESSED) == [(0, 3), (3, 0)]
    m.agree()


# ------------------------------------------------------------------------------------------ ID1 at address 0
def test_write_id1():
    """FN-024: written, waited for, read back, shown in CDI; nothing else."""
    m = Line([std(0, id1=4, write_us=18_000), std(4)]).start()
    assert m.do(WRITE_ID1, value=9) == 0 and m.job().data == 9
    assert m.names() == ["RID1 0", "WID1 9", "RDST 0", "RID1 0"] and m.slaves[0].memory == (0, 9)
    assert m.read()["cdi"][0] == m.slaves[0].codes and m.read()["lds"] == {0, 4}
    m.agree()


@pytest.mark.parametrize("zero_select", ["0", "1", "id1", "both"])
def test_write_id1_of_an_ab_slave(zero_select):
    """FN-024, AD-007: 0..7; bit 3 belongs to the address and stays."""
    m = Line([ab(0, id1=12, zero_select=zero_select), std(4)]).start().rounds(1)
    assert m.begin(WRITE_ID1, 0, 8) == ARG and m.begin(WRITE_ID1, 0, 16) == ARG and m.begin(WRITE_ID1, 1, 2) == ARG
    assert m.do(WRITE_ID1, value=3) == 0 and m.slaves[0].id1 == 11
    m.agree()


def test_write_id1_that_fails():
    """FN-024: no slave 0, ID1 protected, not stored, not readable: each has its status."""
    m = Line([std(4)]).start()
    assert m.begin(WRITE_ID1, 0, 3) == NOT_DETECTED
    for kw, status in (({"id1_protected": True}, BAD_ID1), ({"memory_fails": True}, ID1_TEMPORARY),
                       ({"old": True}, NO_ID1), ({"write_us": NVM_US + 50_000}, ID1_TEMPORARY)):
        m = Line([std(0, id1=4, **kw), std(4)]).start()
        assert m.do(WRITE_ID1, value=1) == status, kw
        m.agree()
    m = Line([std(0, id1=4, id1_protected=True), std(4)]).start()
    assert m.do(WRITE_ID1, value=12) == 0  # its low bits stay


# ------------------------------------------------------------------------------------------ address 0 with both selects
@pytest.mark.parametrize("others", [0, 1])
@pytest.mark.parametrize("zero_select", ["0", "1", "id1"])
def test_zero_is_found_with_either_select(zero_select, others):
    """AD-007, EX-004, EX-017: detection and inclusion read address 0 with Sel = 0, then with Sel = 1."""
    m = Line([ab(0, id1=9, zero_select=zero_select)] + [std(4)] * others).start()
    assert 0 in m.read()["lds"] and m.read()["cdi"][0] == m.slaves[0].codes
    m.agree()
    if others:
        m.slaves[0].present = False
        m.rounds(4)
        assert m.read()["lds"] == {4}
        m.slaves[0].present = True
        m.rounds(1)
        m.agree()


# ------------------------------------------------------------------------------------------ automatic addressing
def replaced(kind=ab, at=37, fresh=None, others=(4,), more_projected=(), **kw):
    """A line in protected mode whose slave at `at` is missing, and the new one at address 0, not yet plugged."""
    gone = kind(at, io=1, id2=3, **({"id1": 9} if kind is ab and at > 31 else {"id1": 1}))
    new = fresh or kind(0, io=1, id2=3, id1=1, write_us=100_000, zero_select="id1" if kind is ab else "0")
    new.present = False
    rest = [std(i) for i in others]
    m = Line([new, *rest], projected=[gone, *rest, *more_projected], protected=True, **{"auto": True, **kw}).start()
    m.rounds(1)
    return m, new


@pytest.mark.parametrize("kind, at", [(std, 9), (ab, 9), (ab, 37)])
def test_automatic_addressing(kind, at):
    """AD-008, AD-010, EX-019: the new slave gets the missing address by itself and is active within 1.0 s, its
    memory write of 100 ms included."""
    m, new = replaced(kind, at)
    assert "auto_address_available" in m.read()["flags"] and "config_ok" not in m.read()["flags"]
    new.present = True
    start = m.port.time_us
    m.until(lambda: at in m.read()["las"], 200)
    assert m.port.time_us - start <= 1_000_000
    assert new.index == at and new.memory[0] == at and "config_ok" in m.read()["flags"]
    assert "auto_address_available" not in m.read()["flags"] and m.read()["lds"] == {4, at}
    assert m.events(ADDRESSED) == [(at, 0)] and m.job().kind == 0  # the host's job is another one
    m.agree()


def test_automatic_addressing_compares_codes():
    """AD-008, AD-009: other IO, ID, ID2, or ID1 beside the select: nothing is sent to the slave but reading calls."""
    good = {"io": 1, "id2": 3, "id1": 1}
    for wrong in ({"io": 2}, {"id2": 4}, {"id1": 2}, {"id1": 10}):
        m, new = replaced(fresh=ab(0, **{**good, **wrong}))
        new.present = True
        m.rounds(2)
        assert new.index == 0 and not m.calls and 0 in m.read()["lds"], wrong
    m, new = replaced(fresh=std(0, **good))
    new.present = True
    m.rounds(2)
    assert new.index == 0 and not m.calls
    m, new = replaced(fresh=ab(0, **{**good, "id1": 9}))  # the select does not count
    new.present = True
    m.until(lambda: 37 in m.read()["las"], 300)


@pytest.mark.parametrize("reason", ["two missing", "extra", "wrong", "configuration", "disabled", "overlap"])
def test_automatic_addressing_keeps_away(reason):
    """AD-009, EX-018: not with two missing slaves, an extra or wrong one, in configuration mode, without enable, or
    where a wide slave (combined transaction 5) would take the address of another one."""
    kw = {"two missing": {"more_projected": [std(20)]}, "disabled": {"auto": False}}.get(reason, {})
    m, new = replaced(std, 9, **kw)
    if reason == "extra":
        m.slaves.append(std(21, clock=lambda: 0))
    elif reason == "wrong":
        m.slaves[1].io = 2
        m.slaves[1].present = False
        m.cycles(5)
        m.slaves[1].present = True
    elif reason == "configuration":
        m.auto = m.protected = False
        m.controls(auto_address=0, protected_mode=0)
        m.auto = True
        m.controls(auto_address=1)
    elif reason == "overlap":
        wide = {"io": 6, "id": 0, "id2": 0xA, "id1": 15}
        m = Line([std(0, present=False, **wide), std(10)], projected=[std(9, **wide), std(10)], protected=True,
                 auto=True).start()
        new = m.slaves[0]
    m.rounds(1)
    new.present = True
    m.rounds(2)
    assert new.index == 0 and not [c for c in m.names() if c.startswith(("ADRA", "WID1"))]
    assert 0 in m.read()["lds"] or reason == "configuration"


def test_failed_automatic_addressing_waits():
    """AD-009: after a failure the next attempt comes P_AUTO_WAIT later, or at once when slave 0 was gone meanwhile."""
    m, new = replaced(std, 9)
    new.mute = frozenset({"ADRA"})
    new.present = True
    m.until(lambda: m.events(ADDRESSED))
    assert m.events(ADDRESSED) == [(9, -SET_ADDRESS << 8)] and 0 in m.read()["lds"]
    first = m.port.time_us
    m.until(lambda: len(m.events(ADDRESSED)) == 2)
    assert 1_000_000 <= m.port.time_us - first <= 1_200_000
    new.present = False
    m.until(lambda: 0 not in m.read()["lds"])
    new.mute, new.present = frozenset(), True
    start = m.port.time_us
    m.until(lambda: 9 in m.read()["las"])
    assert m.port.time_us - start < 1_000_000
    m.agree()


@pytest.mark.parametrize("how", ["offline", "power", "exchange"])
def test_aborted_automatic_addressing(how):
    """AD-009, AD-010, FN-033: OFFLINE or a new activation in the middle is no failure of slave 0: no P_AUTO_WAIT."""
    m, new = replaced(std, 9)
    m.controls(data_exchange=how != "exchange")
    new.present = True
    m.until(lambda: m.names() == ["RID1 0"])
    break_off(m, how)
    start = m.port.time_us
    m.until(lambda: 9 in m.read()["las"])
    assert m.port.time_us - start < 700_000 and m.events(ADDRESSED) == [(9, -ABORT << 8), (9, 0)]
    m.agree()


@pytest.mark.parametrize("step", range(7))
@pytest.mark.parametrize("kind", ["deaf", "mute"])
def test_automatic_addressing_with_failures(step, kind):
    """AD-008, AD-009, AD-004: whichever call fails wholly, the slave ends where it is missing, at the second attempt at
    the latest; its ID1 is never left changed in between."""
    m, new = replaced()
    m.fault = lambda k, call, attempt: kind if k == step else None
    new.present = True
    m.until(lambda: 37 in m.read()["las"])
    assert new.index == 37 and len(m.events(ADDRESSED)) <= 2
    m.agree()


def test_host_function_waits_for_automatic_addressing():
    """FN-032: BUSY while a slave is addressed automatically; what the host's last function brought stays readable."""
    m, new = replaced(std, 9)
    assert m.do(EXECUTE, 4, 16) == 0 and m.job().data == 7
    new.present = True
    m.until(lambda: any(c.startswith("ADRA") for c in m.names()))
    assert m.begin(EXECUTE, 4, 17) == BUSY
    j = m.job()
    assert (j.kind, j.status, j.data) == (EXECUTE, 0, 7)
    m.until(lambda: 9 in m.read()["las"])
    assert m.do(EXECUTE, 4, 17) == 0


# ------------------------------------------------------------------------------------------ strings
@pytest.fixture(scope="session")
def fake_strings():
    """The core with a fake in place of the combined transactions: what begins and ends a string is what counts here."""
    sources = [p for p in SOURCES if not p.name.startswith("asi_ctt")] + [ROOT / "firmware/tests/fake_ctt.c"]
    ffi = cffi.FFI()
    text = (ROOT / "firmware/tests/native.h").read_text()
    ffi.cdef(text.split("/* cffi begin */")[1].split("/* cffi end */")[0])
    ffi.cdef("extern int fake_refuse; extern unsigned fake_kind;"
             "extern int fake_holds; void fake_end(int status, unsigned length); int fake_open(void);")
    counting = os.environ.get("FW_COVERAGE") == "1"
    name, flags = ("libasi_strings_branches.so", ["-O0", "--coverage", "-DFW_GCOV"]) if counting else (
        "libasi_strings.so", ["-O1", *SANITIZE])
    library = ffi.dlopen(str(compile_native(BUILD / name, sources, ["-fPIC", "-shared", *flags])))
    yield ffi, library
    library.fw_counters_write()


def strings_line(library, **kw):
    library[1].fake_refuse = 0
    return Line([std(3, id=4, id2=12), std(4), std(7, id=5, id2=5), ab(5)], library=library, **kw).start()


@pytest.mark.parametrize("function, parameter, kind", [(READ_STRING, 11, 2), (WRITE_STRING, 7, 3), (DIAGNOSIS, 13, 1),
                                                       (READ_ID, 14, 0)])
def test_strings(fake_strings, function, parameter, kind):
    """FN-027, FN-028, FN-029, FN-030, FN-032: parameter of the mode, string, parameter F; the bytes are there."""
    m = strings_line(fake_strings)
    data = bytes(range(100, 139)) if function == WRITE_STRING else b""
    del m.calls[:]
    assert m.begin(function, 3, 0, data) == 0
    m.until(lambda: m.lib.fake_open(), 20)
    assert m.slaves[0].parameter == parameter and m.lib.fake_kind == kind and m.names() == ["WPAR 3"]
    m.cycles(40)
    assert m.job().status == BUSY and m.begin(EXECUTE, 4, 16) == BUSY
    m.lib.fake_end(0, len(data) or 33)
    m.until(lambda: m.job().status != BUSY, 20)
    assert m.job().status == 0 and m.slaves[0].parameter == 15 and m.read()["pi"][3] == 15
    buffer = m.ffi.new("uint8_t[224]")
    if function != WRITE_STRING:
        assert m.job().length == 33 == m.lib.fw_string(buffer, 224) and bytes(buffer)[:33] == bytes(range(33))
    else:
        assert m.job().length == 0


def test_message(fake_strings):
    """FN-031: a CTT2 message goes without a parameter call; a refusal of the engine is one of the function."""
    m = strings_line(fake_strings)
    del m.calls[:]
    m.lib.fake_refuse = TOO_LONG
    before = (m.job().kind, m.job().status)
    assert m.begin(MESSAGE, 7, 0, b"\x10\x01") == TOO_LONG and (m.job().kind, m.job().status) == before
    m.lib.fake_refuse = 0
    assert m.begin(MESSAGE, 7, 0, b"\x10\x01") == 0
    m.cycles(5)
    m.lib.fake_end(0, 3)
    m.cycles(2)
    assert m.job().status == 0 and m.job().length == 3 and not m.calls
    assert m.begin(MESSAGE, 7, 0, b"\x10\x01") == 0
    m.lib.fake_end(DEVICE, 2)  # the slave's error response is for the host
    m.cycles(2)
    assert m.job().status == DEVICE and m.job().length == 2
    assert m.begin(MESSAGE, 7, 0, b"\x10\x01") == 0
    m.lib.fake_end(TRANSFER, 2)
    m.cycles(2)
    assert m.job().status == TRANSFER and m.job().length == 0


def test_refusals_of_strings(fake_strings):
    """FN-005, FN-027, FN-028, FN-031: not active, no such service, too long; its parameter is the master's."""
    m = strings_line(fake_strings, parameters={3: 4})
    assert m.slaves[0].parameter == 15 and m.begin(WRITE_PARAMETER, 3, 4) == PROFILE
    assert m.begin(READ_STRING, 20) == NOT_ACTIVE and m.begin(READ_STRING, 0) == ARG == m.begin(READ_STRING, 32)
    assert m.begin(WRITE_STRING, 3) == ARG == m.begin(WRITE_STRING, 0, 0, b"abc")
    for index in (4, 5, 7):
        assert m.begin(READ_STRING, index) == PROFILE and m.begin(WRITE_STRING, index, 0, b"abc") == PROFILE
    assert m.begin(MESSAGE, 3, 0, b"a") == PROFILE
    assert m.begin(WRITE_STRING, 3, 0, length=220) == TOO_LONG and m.begin(MESSAGE, 7, 0, length=225) == TOO_LONG
    m.cycles(4)
    assert m.slaves[0].parameter == 15


@pytest.mark.parametrize("status", [TRANSFER, TOO_LONG])
def test_string_that_breaks(fake_strings, status):
    """FN-027: the engine's error is that of the function, and the parameter is F again."""
    m = strings_line(fake_strings)
    assert m.begin(READ_STRING, 3) == 0
    m.until(lambda: m.lib.fake_open(), 20)
    m.lib.fake_end(status, 7)
    m.until(lambda: m.job().status != BUSY, 20)
    assert m.job().status == status and m.job().length == 0 and m.slaves[0].parameter == 15


def test_string_refused_by_the_engine(fake_strings):
    """FN-027: the parameter is F again when the engine refuses, or the slave did not answer its parameter."""
    m = strings_line(fake_strings)
    m.lib.fake_refuse = PROFILE
    assert m.do(READ_STRING, 3) == PROFILE and m.slaves[0].parameter == 15
    m.lib.fake_refuse = 0
    m.fault = lambda k, call, attempt: "mute" if k == 0 else None
    assert m.do(READ_STRING, 3) == NO_ANSWER and m.slaves[0].parameter == 15
    m.agree()


def test_string_parameter_that_stays(fake_strings):
    """FN-027: a slave that does not take parameter F any more is activated anew."""
    m = strings_line(fake_strings)
    assert m.begin(READ_ID, 3) == 0
    m.until(lambda: m.lib.fake_open(), 20)
    m.lib.fake_end(0, 9)
    m.fault = lambda k, call, attempt: "deaf"
    m.until(lambda: m.job().status != BUSY)
    assert m.job().status == 0 and 3 not in m.read()["las"] and 3 in m.read()["lds"]
    m.agree()
    assert m.slaves[0].parameter == 15


def test_string_waits_for_the_value_under_way(fake_strings):
    """FN-027: the string begins when the engine lets go of the cyclic value, and fails when it never does."""
    m = strings_line(fake_strings)
    m.lib.fake_holds = 6
    del m.calls[:]
    assert m.begin(READ_ID, 3) == 0
    m.cycles(2)
    assert not m.calls and m.job().status == BUSY
    m.until(lambda: m.lib.fake_open(), 20)
    m.lib.fake_end(0, 1)
    m.until(lambda: m.job().status != BUSY, 20)
    m.lib.fake_holds = EVER
    start = m.port.time_us
    del m.calls[:]
    assert m.begin(READ_ID, 3) == 0
    m.until(lambda: m.job().status != BUSY)
    assert m.job().status == TRANSFER and not m.calls and m.port.time_us - start > 100_000
    m.lib.fake_holds = 0


def test_string_end_of_a_lost_slave(fake_strings):
    """FN-027, CT-005: the slave is gone when the string is over: nothing is left to be set right."""
    m = strings_line(fake_strings)
    assert m.begin(READ_ID, 3) == 0
    m.until(lambda: m.lib.fake_open(), 20)
    m.lib.fake_end(0, 9)

    def fault(k, call, attempt):
        m.slaves[0].present = False
        m.lib.fw_slave_lost([1 << 3, 0])
        return "deaf"
    m.fault = fault
    m.until(lambda: m.job().status != BUSY)
    assert m.job().status == 0 and 3 not in m.read()["lds"]
    m.agree()


def test_string_of_a_lost_slave(fake_strings):
    """FN-027, FN-033, CT-005: the slave leaves LAS, or the line goes offline: the function ends."""
    m = strings_line(fake_strings)
    assert m.begin(READ_ID, 3) == 0
    m.until(lambda: m.lib.fake_open(), 20)
    m.slaves[0].present = False
    m.until(lambda: m.job().status != BUSY, 20)
    assert m.job().status == ABORT
    m.slaves[0].present = True
    m.agree()
    assert m.begin(READ_ID, 3) == 0
    m.until(lambda: m.lib.fake_open(), 20)
    m.controls(offline=1)
    assert m.job().status == ABORT and not m.lib.fake_open() and m.read()["phase"] == OFFLINE


@pytest.mark.parametrize("function, index", [(READ_ID, 3), (WRITE_STRING, 3), (MESSAGE, 7)])
@pytest.mark.parametrize("when", [0, 1, 2, 5])
def test_string_and_data_exchange(fake_strings, function, index, when):
    """FN-019, FN-027, FN-028, FN-031, FN-032: the bytes move with the data: without it strings are refused, and one
    that is under way ends as ABORTED in a few cycles, so that it does not stand in the way of other functions."""
    m = strings_line(fake_strings)
    assert m.begin(function, index, 0, b"abc") == 0
    m.cycles(when)
    m.controls(data_exchange=0)
    m.until(lambda: m.job().status != BUSY, 10)
    assert m.job().status == ABORT and m.job().length == 0 and not m.lib.fake_open() and m.slaves[0].parameter == 15
    assert m.begin(function, index, 0, b"abc") == STATE and m.do(EXECUTE, 4, 16) == 0
    m.controls(data_exchange=1)
    m.agree()
    assert m.begin(function, index, 0, b"abc") == 0
