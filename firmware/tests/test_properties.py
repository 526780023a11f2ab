# SPDX-License-Identifier: Apache-2.0
"""Whatever slaves, line, power and host do in whatever order: after every batch, cycle and tick the core is as the
reference (reference.py) says, and what must always hold does."""
from fake_line import DATA_EXCHANGE, OFFLINE, Master, Slave
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule
from reference import FN_CHANGE, FN_EXECUTE, FN_PARAMETER, FN_WRITE_ID1, Compare
from soak import EXTENDED_ID, IO, LEGAL, STANDARD_ID, ZERO_SELECTS

nibbles = st.integers(0, 15)
numbers = st.integers(1, 4)  # few numbers, so that pairs, clashes and re-use happen
indices = st.sampled_from([0, 1, 2, 3, 31, 33, 34, 63])


@st.composite
def slaves(draw):
    index = draw(indices)
    extended = index > 32 or draw(st.booleans())
    return Slave(index, io=draw(st.sampled_from(IO)), id1=draw(nibbles), id2=draw(nibbles),
                 id=EXTENDED_ID if extended else draw(st.sampled_from(STANDARD_ID)),
                 inputs=draw(st.integers(1, 15)), fault=draw(st.booleans()),
                 zero_select=draw(st.sampled_from(ZERO_SELECTS)) if extended else "0",
                 write_us=draw(st.sampled_from([0, 0, 20_000, 600_000])), memory_fails=draw(st.integers(0, 9)) == 9,
                 id1_protected=draw(st.integers(0, 9)) == 9,
                 old=not extended and draw(st.booleans()))  # EX-005: an A/B slave has RID1 and RID2


class Line(RuleBasedStateMachine):
    """EX-001 .. EX-029, EX-032, EX-033, EX-035 .. EX-038, FN-005, FN-020, FN-022, FN-024, FN-032, FN-033,
    AD-001 .. AD-009, CA-003, CA-006: what always holds."""

    @initialize(first=st.lists(slaves(), max_size=4, unique_by=lambda s: s.index), real=st.booleans())
    def power_up(self, first, real):
        for s in first:
            s.clock = self.clock
        self.m = Master(first, projected=[s for s in first if s.index] if real else [])
        self.compare = Compare(self.m)
        self.checked = 0
        self.version, self.shown = None, None
        self.m.settle()

    def clock(self):
        return self.m.port.time_us

    def find(self, index):
        return next((s for s in self.m.slaves if s.index == index), None)

    @rule(s=slaves())
    def appears(self, s):
        s.clock = self.clock
        if old := self.find(s.index):
            self.m.slaves.remove(old)
        self.m.slaves.append(s)

    @rule(index=indices)
    def vanishes(self, index):
        if s := self.find(index):
            self.m.slaves.remove(s)

    @rule(index=indices, codes=st.tuples(nibbles, nibbles))
    def changes_codes(self, index, codes):
        if s := self.find(index):
            s.io, s.id1 = codes

    @rule(index=indices)
    def resets(self, index):
        if s := self.find(index):
            s.power_up()

    @rule(index=indices, calls=st.sets(st.sampled_from(["RDIO", "RDID", "RID1", "RID2", "WPAR", "DEXG"]), max_size=2))
    def misbehaves(self, index, calls):
        if s := self.find(index):
            s.mute = frozenset(calls)

    @rule(level=st.sampled_from([0.0, 0.05, 0.3]))
    def noise(self, level):
        self.m.noise = level

    @rule(index=indices)
    def periphery(self, index):
        if s := self.find(index):
            s.fault = not s.fault

    @rule(apf=st.booleans())
    def power(self, apf):
        self.m.power(apf)

    @rule(change=st.one_of(
        st.tuples(st.sampled_from(["protected_mode", "offline", "data_exchange", "auto_address"]), st.booleans()),
        st.tuples(st.just("auto_clear"), st.integers(0, 4))))
    def control(self, change):
        self.m.control(**dict([change]))

    @rule(some=st.lists(slaves().filter(lambda s: s.index), max_size=3, unique_by=lambda s: s.index),
          real=st.booleans())
    def project(self, some, real):
        self.m.project([s for s in self.m.slaves if s.index] if real else some)

    @rule(call=st.one_of(
        st.tuples(st.just("set_pp"), indices, st.integers(0, 16)),
        st.tuples(st.just("set_pcd"), indices, st.integers(0, 0x10000)),
        st.tuples(st.just("set_lps"), st.sets(indices)), st.just(("store_configuration",)),
        st.just(("store_parameters",))))
    def function(self, call):
        self.compare.function(*call)

    @rule(call=st.one_of(
        st.tuples(st.just(FN_PARAMETER), indices, nibbles), st.tuples(st.just(FN_CHANGE), indices, indices),
        st.tuples(st.just(FN_CHANGE), indices, indices),
        st.tuples(st.just(FN_EXECUTE), st.integers(0, 3), st.integers(0, 31)),
        st.just((FN_EXECUTE, 31, 0x15)), st.tuples(st.just(FN_WRITE_ID1), st.just(0), nibbles)))
    def job(self, call):
        self.compare.start(*call)

    @rule()
    def job_ends(self):
        for _ in range(60):
            self.m.step()

    @rule(index=indices)
    def replaces(self, index):
        """The slave breaks down; one like it comes with address 0 (AD-008)."""
        if s := self.find(index):
            self.m.control(protected_mode=True, auto_address=True, auto_clear=0, offline=False)
            self.m.slaves = [x for x in self.m.slaves if x is s or x.index]
            s.power_up()
            s.index, s.memory = 0, None

    @rule(outputs=st.lists(nibbles, min_size=64, max_size=64))
    def outputs(self, outputs):
        self.m.host_outputs = outputs

    @rule(steps=st.integers(1, 90), late=st.booleans(), delay=st.integers(0, 3))
    def runs(self, steps, late, delay):
        self.m.delay = delay
        for _ in range(steps):
            if late:
                self.m.cycle(report=False)
            self.m.step()

    @invariant()
    def always(self):
        if hasattr(self, "m"):
            self.check()

    def check(self):
        m, s = self.m, self.m.read()
        lps, pcd, _, controls = m.permanent()
        assert m.port.violations == 0
        assert s["las"] <= s["lds"] and 0 not in s["las"] and not s["lds"] & {32}
        assert {i for i in range(64) if m.port.active[i]} == s["las"]
        assert all(m.port.extended[i] == (i > 32 or s["cdi"][i] >> 4 & 15 == 0xA) for i in s["las"])
        assert all(s["cdi"][i] == 0xFFFF for i in range(64) if i not in s["lds"])
        assert all(s["in"][i] == 0 for i in range(64) if i not in s["las"])
        assert s["flags"] == m.expected_flags(s), s
        if controls["protected_mode"]:
            assert all(i in lps and s["cdi"][i] == pcd[i] for i in s["las"])
        for i in s["las"]:  # EX-026
            assert i < 33 or i - 32 not in s["lds"] or s["cdi"][i - 32] >> 4 & 15 == 0xA
        if s["phase"] == OFFLINE:
            assert not s["lds"] and list(m.port.out) == [0xFFFFFFFF] * 8 and not m.port.line
        if m.apf or controls["offline"]:
            assert s["phase"] == OFFLINE
        assert ("normal_operation_active" in s["flags"]) == (s["phase"] == DATA_EXCHANGE)
        for call, _, _ in m.log[self.checked:]:
            assert m.lib.fw_call_is_legal(call) and call in LEGAL, hex(call)
        self.checked = len(m.log)
        shown = {k: s[k] for k in ("phase", "flags", "lds", "las", "lpf", "cdi", "pi", "pecho")}
        if self.shown is not None and shown != self.shown:  # what the window copies only on a new version
            assert s["version"] != self.version
            for k in ("cdi", "pi", "pecho"):
                assert all(i in s["changed"] for i in range(64) if shown[k][i] != self.shown[k][i])
            m.lib.fw_changes_taken()
        self.shown, self.version = shown, s["version"]

    def teardown(self):
        """EX-012, EX-013, EX-014: left alone, the lists end up as the line is."""
        if not hasattr(self, "m"):
            return
        m = self.m
        m.noise = 0.0
        for s in m.slaves:
            s.mute, s.present = frozenset(), True
        m.power(False)
        assert m.control(offline=False, auto_clear=0, protected_mode=False) == 0
        for _ in range(8):  # a new activation that is under way
            m.step()
        while self.compare.r.busy():  # its waits and tries are bounded
            m.step()
        standard = {s.index for s in m.slaves if s.index < 32 and not s.extended}
        m.slaves = list({s.index: s for s in m.slaves if s.index - 32 not in standard}.values())
        if m.slaves:
            m.until(lambda s: s["phase"] == DATA_EXCHANGE)
            for _ in range(5):
                m.rounds()
            s = m.read()
            assert s["lds"] == {x.index for x in m.slaves} and s["las"] == s["lds"] - {0}
            assert all(s["cdi"][x.index] == x.codes for x in m.slaves if x.index not in s["las"])


TestLine = Line.TestCase
TestLine.settings = settings(max_examples=60, stateful_step_count=30, deadline=None, derandomize=True,
                             report_multiple_bugs=False, phases=[Phase.generate],
                             suppress_health_check=list(HealthCheck))
