# SPDX-License-Identifier: Apache-2.0
"""The two slave models side by side: same requests, same answers, same times (SL-007).

Each was written from the specification alone. Where a time is a free choice (how long a reset, a write or a power-up
takes) the scenarios keep clear of the limit itself by CLEAR_NS.
"""
import pytest
from asi.native import Net
from asi.telegram import encode_call, pulses, request_pulses, request_word
from hypothesis import given, settings
from hypothesis import strategies as st

from cocotb_tests.models.line import Line
from cocotb_tests.models.slaves import POWER_UP_NS, RESET_NS, WATCHDOG_NS, WRITE_NS, Slave, SlaveNetwork

MS = 1_000_000
CLEAR_NS = 200_000      # one transaction and some reserve


class Pair:
    """The same slaves in both models; every step goes to both and compares what they send and what they show."""

    def __init__(self, *configs):
        self.line, self.net, self.native = Line(), None, Net(0)
        self.seen = []
        self.line.listen(lambda p: p.sender != "master" and self.seen.append((p.t_ns, p.polarity)))
        self.slaves = [Slave(**config) for config in configs]
        self.net = SlaveNetwork(self.line, self.slaves)
        for config in configs:
            self.native.add(**config)
        self.log = []

    def request(self, train, wait_ns=150_000):
        """A train of master pulses now, then wait_ns -> the answer pulses, the same from both models."""
        start = self.line.now
        self.line.send(start, train, "master")
        for t, polarity in train:
            self.native.master_pulse(start + t, polarity)
        self.log.append((start, train))
        return self.wait(train[-1][0] + wait_ns)

    def call(self, name, index=0, data=0, **options):
        return self.request(request_pulses(encode_call(name, index, data, **options)))

    def wait(self, ns):
        self.seen.clear()
        end = self.line.now + ns
        self.line.advance(end)
        self.net.settle()
        native = sorted((p.t_ns, p.polarity) for p in self.native.advance(end))
        self.seen.sort()                # opposite pulses at one instant have no order
        assert self.seen == native, self.story()
        for k, slave in enumerate(self.slaves):
            mine = (slave.address, slave.outputs, slave.parameter, slave.dexg_disabled, slave.synchronous,
                    slave.present, slave.status(end), slave.answers)
            other = self.native.state(k)
            theirs = (*other[:7], other.answers)
            absent = not slave.present and not other.present
            assert absent or mine == theirs, f"slave {k}: {mine} {theirs} {self.story()}"
        return list(self.seen)

    def each(self, python, native):
        """One setting, made in both."""
        python(self.net)
        native(self.native)
        self.log.append((self.line.now, "set"))

    def story(self):
        return " | ".join(f"{t}: {what if isinstance(what, str) else ''.join('-.+'[p + 1] for _, p in what)}"
                          for t, what in self.log[-4:])

    # settings
    def present(self, k, on):
        self.each(lambda net: net.set_present(self.slaves[k], on), lambda net: net.set_present(k, on))

    def power(self, good):
        self.each(lambda net: net.power(good), lambda net: net.power(good))

    def inputs(self, k, nibble):
        self.each(lambda net: setattr(self.slaves[k], "inputs", nibble), lambda net: net.set_inputs(k, nibble))

    def periphery(self, k, fault):
        self.each(lambda net: setattr(self.slaves[k], "periphery_fault", fault),
                  lambda net: net.set_periphery_fault(k, fault))

    def delay(self, k, ns):
        self.each(lambda net: setattr(self.slaves[k].faults, "delay_ns", ns),
                  lambda net: net.set_faults(k, delay_ns=ns))


def mixed():
    """Standard, A, B, a pair, one at 0, one that is not plugged in."""
    return Pair(dict(address=1, io=7, inputs=5), dict(address=2, io=8), dict(address=3, io=3, inputs=0b0110),
                dict(address=5, io=7, id=0xA, id1=7, id2=7, inputs=9),
                dict(address=37, io=3, id=0xA, id1=0xF, inputs=6),
                dict(address=40, io=0, id=0xA, id1=0xF, id2=0, inputs=3), dict(address=0, io=1, id=0),
                dict(address=31, io=0xB, inputs=0xA), dict(address=9, io=7, present=False))


EVERY_CALL = [(name, index, data) for index in (1, 2, 5, 37, 40, 0, 31, 9, 17)
              for name, data in (("RDIO", 0), ("RDID", 0), ("RID1", 0), ("RID2", 0), ("RDST", 0), ("WPAR", 6),
                                 ("DEXG", 9), ("RES", 0), ("R1", 0)) if index or name not in ("DEXG", "WPAR")]


def test_every_call():
    """SL-007, SL-005: every call to every kind of slave, before and after activation."""
    pair = mixed()
    pair.wait(POWER_UP_NS + CLEAR_NS)
    answered = 0
    for _ in range(2):
        for name, index, data in EVERY_CALL:
            answered += bool(pair.call(name, index, data))
        pair.wait(RESET_NS + CLEAR_NS)
    assert answered > 2 * 40


@pytest.mark.parametrize("io", range(16))
def test_io_codes(io):
    """SL-007, SL-005: answers to DEXG for each IO code, standard and A/B."""
    pair = Pair(dict(address=1, io=io, inputs=0b0110), dict(address=2, io=io, id=0xA, id1=7, inputs=0b1010),
                dict(address=34, io=io, id=0xA, id1=15, inputs=0b0011))
    pair.wait(POWER_UP_NS + CLEAR_NS)
    for index in (1, 2, 34):
        pair.call("WPAR", index, 7, extended=index != 1)
    for data in range(16):
        for index in (1, 2, 34):
            assert pair.call("DEXG", index, data, extended=index != 1)


def test_life():
    """SL-007, SL-001, SL-005, SL-006: address changes, ID1, resets, supply, plugging, on both sides of each limit."""
    pair = mixed()
    pair.wait(POWER_UP_NS - CLEAR_NS)
    assert not pair.call("RDIO", 1)
    pair.wait(2 * CLEAR_NS)
    assert pair.call("RDIO", 1)
    pair.call("DELA", 37)
    pair.request(request_pulses(1 << 10 | 0b11010))                 # RID1 at 0 with Sel = 1
    pair.call("WID1", data=3)
    assert pair.call("ADRA", data=12) and pair.call("RDST", 12) and pair.call("RDST", 44) == []
    pair.wait(WRITE_NS - CLEAR_NS - 500_000)
    pair.call("RDST", 12)
    pair.wait(2 * CLEAR_NS + 500_000)
    pair.call("RDST", 12)
    pair.call("WPAR", 12, 0, extended=True)
    pair.call("DEXG", 12, 0, extended=True)
    pair.call("RES", 12)
    pair.wait(RESET_NS - 2 * CLEAR_NS)
    assert pair.call("RDID", 12) == []
    pair.wait(2 * CLEAR_NS)
    assert pair.call("RDID", 12)
    pair.call("BR01")
    pair.wait(RESET_NS + CLEAR_NS)
    pair.power(False)
    pair.wait(2 * MS)
    assert pair.call("RDIO", 1) == []
    pair.power(True)
    pair.wait(POWER_UP_NS + CLEAR_NS)
    assert pair.call("RID1", 12)
    pair.present(8, True)
    pair.wait(POWER_UP_NS + CLEAR_NS)
    assert pair.call("RDIO", 9)
    pair.present(8, False)
    assert pair.call("RDIO", 9) == []
    pair.call("DELA", 1)
    pair.call("DELA", 12)
    pair.call("RES", 0)
    pair.wait(RESET_NS + CLEAR_NS)
    assert pair.call("RDIO", 1)
    pair.periphery(0, True)
    pair.call("RDST", 1)
    pair.delay(0, 5_000)
    assert pair.call("RDST", 1)


def test_power_fail_while_writing():
    """SL-007, SL-005: a spoilt memory looks the same in both models."""
    pair = Pair(dict(address=0, io=3, id=5))
    pair.wait(POWER_UP_NS + CLEAR_NS)
    pair.call("ADRA", data=7)
    pair.wait(2 * MS)
    pair.power(False)
    pair.wait(MS)
    pair.power(True)
    pair.wait(POWER_UP_NS + CLEAR_NS)
    for name in ("RDIO", "RDID", "RDST", "RID1"):
        assert pair.call(name, 0)


def test_watchdog():
    """SL-007, SL-006: both models reset after 94.2 ms, not for RDIO's sake, and not at address 0."""
    pair = Pair(dict(address=3, io=7, watchdog=True), dict(address=0, io=7, watchdog=True), dict(address=4, io=7))
    pair.wait(POWER_UP_NS + CLEAR_NS)
    for last in ("WPAR", "DEXG"):
        pair.call("WPAR", 3, 2)
        pair.call(last, 3, 2)
        pair.wait(WATCHDOG_NS - 4 * CLEAR_NS)
        assert pair.call("RDIO", 3)
        pair.wait(4 * CLEAR_NS)
        assert pair.call("RDIO", 3) == []
        pair.wait(RESET_NS + CLEAR_NS)
        assert pair.call("RDIO", 3) and pair.call("DEXG", 3, 1) == []
        assert pair.call("RDIO", 0) and pair.call("RDIO", 4)


def test_watchdog_of_a_slave_that_is_never_served():
    """SL-007, SL-006: 94.2 ms without DEXG or WPAR reset a slave, also when there never was one."""
    pair = Pair(dict(address=3, io=7, watchdog=True))
    pair.wait(POWER_UP_NS + CLEAR_NS)
    assert pair.call("RDIO", 3)
    pair.wait(WATCHDOG_NS + CLEAR_NS)
    assert pair.call("RDIO", 3) == []


def test_bad_requests():
    """SL-007, SL-003, SL-004: what a bad request does, and where the limits of windows, quiet and pause are."""
    good = request_pulses(encode_call("RDIO", 1))
    at = lambda t: [(t + dt, p) for dt, p in good]  # noqa: E731
    trains = [[(0, 1)], good[:1], good[:7], good[1:], good + [(85_500, -1)], good + [(85_501, -1)],
              good + [(97_500, -1)], good + [(97_501, -1)], good[:-1] + [(79_500, 1)], good[:-1] + [(79_501, 1)],
              good[:-1] + [(77_125, 1)], good[:-1] + [(77_124, 1)], good + [(79_000, -1)],
              *(pulses(request_word(encode_call("RDIO", 1)) ^ flip, 14) for flip in (1, 2))]
    trains += [good[:5] + at(good[4][0] + gap) for gap in (30_000, 60_000)]
    trains += [good[:k] + good[k + 1:] for k in range(1, len(good))]
    trains += [sorted(good[:k] + [(good[k][0] + d, good[k][1])] + good[k + 1:])
               for k in range(1, len(good)) for d in (-1_900, -900, -875, 1_500, 1_501)]
    for first_good in (False, True):
        for train in trains:
            pair = mixed()
            pair.wait(POWER_UP_NS + CLEAR_NS)
            if first_good:
                pair.call("RDIO", 17)
            pair.request(train)
            for _ in range(2):
                assert pair.call("RDIO", 1)


STEPS = st.one_of(
    st.tuples(st.just("call"), st.integers(0, 2047)),
    st.tuples(st.just("known"), st.sampled_from(EVERY_CALL + [("DELA", i, 0) for i in (1, 5, 37, 40)]
                                                + [("ADRA", 0, n) for n in (1, 6, 8, 30)]
                                                + [("WID1", 0, n) for n in (3, 11)] + [("BR01", 0, 0)])),
    st.tuples(st.just("spoil"), st.sampled_from(EVERY_CALL), st.integers(1, 13),
              st.sampled_from(("drop", "shift", "invert", "tail"))),
    st.tuples(st.just("inputs"), st.integers(0, 8), st.integers(0, 15)),
    st.tuples(st.just("present"), st.integers(0, 8), st.booleans()),
    st.tuples(st.just("periphery"), st.integers(0, 8), st.booleans()),
    st.tuples(st.just("delay"), st.integers(0, 8), st.sampled_from((0, 250, 20_000))),
    st.tuples(st.just("dip")),
    st.tuples(st.just("wait"), st.sampled_from((2 * MS, 12 * MS, 40 * MS))),
)


@given(st.lists(STEPS, min_size=20, max_size=80))
@settings(max_examples=200, deadline=None, derandomize=True)
def test_random(steps):
    """SL-007: random calls, bad requests, supply, plugging and settings, in any order."""
    pair = mixed()
    pair.wait(POWER_UP_NS + CLEAR_NS)
    for what, *args in steps:
        if what == "call":
            pair.request(request_pulses(args[0]))
        elif what == "known":
            pair.call(*args[0])
        elif what == "spoil":
            (name, index, data), k, how = args
            train = request_pulses(encode_call(name, index, data))
            t, polarity = train[k]
            if how == "drop":
                del train[k]
            elif how == "tail":
                train.append((train[-1][0] + 3_000, -1))
            else:
                train[k] = (t, -polarity) if how == "invert" else (t - 1_200, polarity)
            pair.request(train)
        elif what == "wait":
            pair.wait(args[0])
        elif what == "dip":
            pair.wait(WRITE_NS + CLEAR_NS)      # a spoilt memory has a test of its own
            pair.power(False)
            pair.wait(MS)
            pair.power(True)
        elif what == "present":
            pair.wait(WRITE_NS + CLEAR_NS)
            pair.present(*args)
        else:
            getattr(pair, what)(*args)
