# SPDX-License-Identifier: Apache-2.0
"""The two slave models side by side: same requests, same answers, same times (SL-007, SL-009, SL-010).

Each was written from the specification alone. Where a time is a free choice (how long a reset, a write or a power-up
takes) the scenarios keep clear of the limit itself by CLEAR_NS.
"""
from contextlib import suppress

import pytest
from asi import ctt_table as table
from asi.native import STRING_PARAMETERS, NativeError, Net
from asi.telegram import encode_call, pulses, request_pulses, request_word
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from cocotb_tests.models.line import Line
from cocotb_tests.models.slaves import POWER_UP_NS, RESET_NS, WATCHDOG_NS, WRITE_NS, Slave, SlaveNetwork

MS = 1_000_000
CLEAR_NS = 200_000      # one transaction and some reserve
REPEAT_NS = 80_000      # last request pulse to a repetition: it begins well within 200 us
CHANNELS = range(4)
# settings of a transaction: for the Python model an argument, for the native one a call
TRANSACTION = ("values", "strings", "invalid", "overflow", "swapped", "busy", "words", "closed")


def add_native(net, transaction, **config):
    """The native slave of a Python slave's arguments. -> handle"""
    slave = net.add(**config)
    for channel, value in enumerate(transaction.get("values", ())):
        net.set_value(slave, channel, value)
    for kind, string in transaction.get("strings", {}).items():
        net.set_string(slave, kind, string)
    if "invalid" in transaction or "overflow" in transaction:
        net.set_invalid(slave, transaction.get("invalid", 0), transaction.get("overflow", 0))
    if "swapped" in transaction or "busy" in transaction:
        net.set_options(slave, di_swapped=transaction.get("swapped", False), busy=transaction.get("busy", 0))
    if "words" in transaction:
        net.set_safety(slave, transaction["words"], transaction.get("closed", 3))
    return slave


class Pair:
    """The same slaves in both models; every step goes to both and compares what they send and what they show."""

    def __init__(self, *configs):
        self.line, self.net, self.native = Line(), None, Net(0)
        self.seen = []
        self.line.listen(lambda p: p.sender != "master" and self.seen.append((p.t_ns, p.polarity)))
        configs = [dict(config) for config in configs]
        self.slaves = [Slave(**config) for config in configs]
        self.net = SlaveNetwork(self.line, self.slaves)
        self.channels, self.written = [], []    # (slave, channel) of outputs; slaves with a parameter string
        for config in configs:
            k = add_native(self.native, {name: config.pop(name) for name in TRANSACTION if name in config}, **config)
            for channel in CHANNELS:
                with suppress(NativeError):
                    self.native.value(k, channel)
                    self.channels.append((k, channel))
            if (config.get("io"), config.get("id")) == (7, 4) and config["id2"]:
                self.written.append(k)
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
        for k, channel in self.channels:
            mine, theirs = self.slaves[k].ctt.outputs[channel], self.native.value(k, channel)
            assert mine == theirs, f"output {channel} of slave {k}: {mine} {theirs} {self.story()}"
        for k in self.written:
            mine, theirs = self.slaves[k].ctt.strings.get(2, b""), self.native.string(k, STRING_PARAMETERS)
            assert mine == theirs, f"string of slave {k}: {mine} {theirs} {self.story()}"
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

    def options(self, k, **options):
        def python(_):
            for name in ("write_fails", "id1_locked", "old", "sel_at_zero"):
                setattr(self.slaves[k], name, options.get(name, False))
            self.slaves[k].write_ns = options.get("write_ns", WRITE_NS)

        self.each(python, lambda net: net.set_options(k, **options))

    def value(self, k, channel, value):
        self.each(lambda net: self.slaves[k].ctt.values.__setitem__(channel, value),
                  lambda net: net.set_value(k, channel, value))

    def invalid(self, k, invalid, overflow):
        def python(_):
            self.slaves[k].ctt.invalid, self.slaves[k].ctt.overflow = invalid, overflow

        self.each(python, lambda net: net.set_invalid(k, invalid, overflow))

    def closed(self, k, words, closed):
        def python(_):
            self.slaves[k].ctt.words, self.slaves[k].ctt.closed = words, closed

        self.each(python, lambda net: net.set_safety(k, words, closed))

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


@pytest.mark.parametrize("config", [dict(io=3, id=5), dict(io=7, id=0xA, id1=0xF, id2=0xE),
                                    dict(io=7, id=3, id2=0xC, values=(0x1234,)), dict(io=7, id=0xB)])
@pytest.mark.parametrize("times", [1, 2])
def test_power_fail_while_writing(config, times):
    """SL-007, SL-005: a spoilt memory looks the same in both models, and so does the slave once a new ADRA went well:
    its codes, its select and its transaction are back."""
    pair = Pair(dict(address=0, **config))
    pair.wait(POWER_UP_NS + CLEAR_NS)

    def all_reads(number):
        return [bool(pair.call(name, index)) for index in (0, 32, number, number + 32)
                for name in ("RDIO", "RDID", "RDST", "RID1", "RID2")]
    whole = all_reads(7)
    for _ in range(times):
        pair.call("ADRA", data=7)
        pair.wait(2 * MS)
        assert any(all_reads(7))
        pair.power(False)
        pair.wait(MS)
        pair.power(True)
        pair.wait(POWER_UP_NS + CLEAR_NS)
        assert sum(all_reads(7)) == 5
    pair.call("ADRA", data=7)
    all_reads(7)
    pair.wait(WRITE_NS + CLEAR_NS)
    assert sum(all_reads(7)) == sum(whole)
    sel, extended = config.get("id1", 0) >> 3, config["id"] == 0xA
    assert pair.call("WPAR", 7 + 32 * sel, 7, extended=extended)
    for nibble in (6, 13, 4, 11, 2, 9, 0) * 2:
        assert pair.call("DEXG", 7 + 32 * sel, nibble, extended=extended)


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


# ------------------------------------------------------------------------------------------ options (SL-010)
def at_zero(**options):
    return Pair(dict(address=0, io=7, id=0xA, id1=0xF, id2=0xE, **options), dict(address=3, io=7, id1=5, **options))


AT_ZERO = [(name, index, data) for index in (0, 32, 3, 12, 44)
           for name, data in (("RDIO", 0), ("RDID", 0), ("RID1", 0), ("RID2", 0), ("RDST", 0))]


@pytest.mark.parametrize("options", [{}, dict(sel_at_zero=True), dict(old=True), dict(id1_locked=True),
                                     dict(write_fails=True), dict(write_ns=0), dict(write_ns=400 * MS),
                                     dict(sel_at_zero=True, write_fails=True, id1_locked=True, write_ns=3 * MS)])
def test_options(options):
    """SL-007, SL-010: the steps of an address change, with all that can be read behind each, for every option."""
    pair = at_zero(**options)
    pair.wait(POWER_UP_NS + CLEAR_NS)
    answers = 0
    for name, index, data in (("WID1", 0, 7), ("WID1", 0, 6), ("WID1", 0, 0xF), ("ADRA", 0, 12), ("DELA", 3, 0),
                              ("WID1", 0, 2), ("WID1", 0, 5), ("ADRA", 0, 3), ("DELA", 12, 0), ("DELA", 44, 0),
                              ("WID1", 0, 7), ("ADRA", 0, 12), ("BR01", 0, 0)):
        answers += bool(pair.call(name, index, data))
        for wait in (CLEAR_NS, options.get("write_ns", WRITE_NS)):
            for call in AT_ZERO:
                answers += bool(pair.call(*call))
            pair.wait(wait)
    assert answers > 100
    pair.power(False)
    pair.wait(MS)
    pair.power(True)
    pair.wait(POWER_UP_NS + CLEAR_NS)
    assert sum(bool(pair.call(*call)) for call in AT_ZERO) >= (2 if options.get("old") else 4)


OPTION_STEPS = st.one_of(
    st.tuples(st.just("call"), st.sampled_from(AT_ZERO)),
    st.tuples(st.just("call"), st.sampled_from([("ADRA", 0, n) for n in (3, 12)] + [("WID1", 0, n) for n in range(16)]
                                               + [("DELA", n, 0) for n in (3, 12, 44)] + [("BR01", 0, 0)])),
    st.tuples(st.just("options"), st.integers(0, 1), st.fixed_dictionaries({}, optional={
        **dict.fromkeys(("write_fails", "id1_locked", "old", "sel_at_zero"), st.booleans()),
        "write_ns": st.sampled_from((0, 5 * MS, 60 * MS))})),
    st.tuples(st.just("dip")),
    st.tuples(st.just("wait"), st.sampled_from((2 * MS, 20 * MS, 100 * MS))),
)


@given(st.lists(OPTION_STEPS, min_size=10, max_size=60))
@settings(max_examples=100, deadline=None, derandomize=True)
def test_random_options(steps):
    """SL-007, SL-010: random calls around address 0 while the options change."""
    pair = at_zero()
    pair.wait(POWER_UP_NS + CLEAR_NS)
    for what, *args in steps:
        if what == "call":
            pair.call(*args[0])
        elif what == "options":
            pair.options(args[0], **args[1])
        elif what == "wait":
            pair.wait(args[0])
        else:
            pair.wait(100 * MS)                 # a spoilt memory has a test of its own
            pair.power(False)
            pair.wait(MS)
            pair.power(True)
            pair.wait(POWER_UP_NS + CLEAR_NS)


# ------------------------------------------------------------------------------------------ transactions (SL-009)
ID_OBJECT = bytes((1, 2, 3, 4, 0x32, 6))
STRING = b"\x20\x37\x07\x01\x01\x03\x10\x11\x01"


def transacting():
    """A slave of every kind. Index in this order is the slave's number."""
    return Pair(
        dict(address=1, io=7, id=3, id2=0xD, values=(0x1234, 0x8001)), dict(address=2, io=7, id=3, id2=6),
        dict(address=3, io=7, id=4, id2=0xC, values=(0x7FFF,), strings={0: STRING, 1: STRING[3:6]}),
        dict(address=4, io=7, id=4, id2=5, strings={2: STRING}),
        dict(address=5, io=7, id=1, id2=9, values=(0xABCD, 0x5432)), dict(address=6, io=7, id=2, id2=1),
        dict(address=7, io=7, id=5, id2=5, values=(1, 2, 3, 4), strings={0: ID_OBJECT, 3: b"abcd"}, inputs=2),
        dict(address=8, io=7, id=0xA, id1=7, id2=5, inputs=1),
        dict(address=40, io=0xB, id=0xA, id1=7, id2=5, strings={0: ID_OBJECT, 3: b"xy"}, swapped=True, busy=1),
        dict(address=9, io=7, id=0xA, id1=7, id2=7, inputs=9),
        dict(address=41, io=7, id=0xA, id1=7, id2=0xA, values=(0x3C,)),
        dict(address=10, io=0, id=0xB), dict(address=11, io=7, id=0xB, words=(3, 5, 6, 9, 10, 12, 7, 14), closed=3),
        dict(address=12, io=7, id=0xA, id1=7, id2=9, inputs=6), dict(address=13, io=6, id=0, id2=0xA, inputs=3),
        dict(address=14, io=7, id=4, id2=0, inputs=5), dict(address=15, io=7, id=3, id2=0xF))


INDICES = (1, 2, 3, 4, 5, 6, 7, 8, 40, 9, 41, 10, 11, 12, 13, 14, 15)
EXTENDED = (8, 40, 9, 41, 12)


def activate(pair):
    pair.wait(POWER_UP_NS + CLEAR_NS)
    for index in INDICES:
        assert pair.call("WPAR", index, 15, extended=index in EXTENDED)
        assert pair.call("DEXG", index, 15, extended=index in EXTENDED)


@pytest.mark.parametrize("index", INDICES)
def test_every_nibble_after_every_other(index):
    """SL-007, SL-009: each kind of slave, all pairs of successive nibbles, each also repeated at once; every second
    pair comes as fast as a repetition."""
    pair = transacting()
    activate(pair)
    calls = [request_pulses(encode_call("DEXG", index, nibble, index in EXTENDED)) for nibble in range(16)]
    for first in range(16):
        for second in range(16):
            assert pair.request(calls[first], REPEAT_NS if second & 1 else 150_000) and pair.request(calls[second])
        assert pair.request(calls[first], REPEAT_NS) and pair.request(calls[first], REPEAT_NS)
        assert pair.request(calls[first])


class Talk:
    """A master's side over both models: calls of one slave with losses and immediate repetitions, as drawn."""

    def __init__(self, pair, index, draw):
        self.pair, self.index, self.draw, self.control = pair, index, draw, 0

    def nibble(self, nibble):
        """One DEXG, with its accident. -> answer pulses"""
        call = encode_call("DEXG", self.index, nibble, self.index in EXTENDED)
        accident = self.draw(ACCIDENTS)
        if accident == "again":             # the answer was lost
            self.pair.request(request_pulses(call), REPEAT_NS)
        elif accident == "bad":             # the request was
            self.pair.request(pulses(request_word(call) ^ 2, 14))
        elif accident == "late":            # an old nibble in the next cycle
            self.pair.request(request_pulses(call))
        elif accident == "skip":
            return
        answer = self.pair.request(request_pulses(call))
        assert answer

    def triples(self, bits):
        """Numbers of an input or triples of an output, with alternating control bit."""
        for three in bits:
            self.nibble(self.control << 3 | three)
            self.control ^= 1

    def frame(self, frame, first):
        self.triples(frame >> 3 * n & 7 for n in range(first, -1, -1))

    def message(self, message, idle):
        """A CTT2 message, then idle calls for the answer; the bits beside it are drawn."""
        beside = self.draw(st.integers(0, 3)) << 2
        for byte in message:
            for bit in range(7, -1, -1):
                for clock in (0, 1):
                    self.nibble(beside | (byte >> bit & 1) << table.CTT2_DO_DATA | clock << table.CTT2_DO_CLOCK)
        for _ in range(idle):
            self.nibble(beside | 3)


# thousands of draws: to shrink a failure would take many minutes, so it is shown as it was found
LONG = dict(deadline=None, derandomize=True, phases=(Phase.generate,))
ACCIDENTS = st.sampled_from(("",) * 40 + ("again",) * 4 + ("bad", "late", "skip"))
WORD = st.integers(0, 0xFFFF)
MODES = (table.CTT1_PAR_ID, table.CTT1_PAR_DIAG, table.CTT1_PAR_RD, table.CTT1_PAR_WR)


@given(st.data())
@settings(max_examples=60, **LONG)
def test_random_ctt1(data):
    """SL-007, SL-009, CT-010, CT-014, CT-015: values and strings of every CTT1 slave under random accidents."""
    draw = data.draw
    pair = transacting()
    activate(pair)
    talks = {index: Talk(pair, index, draw) for index in (1, 2, 3, 4, 5, 6, 15)}
    for _ in range(draw(st.integers(3, 12))):
        index = draw(st.sampled_from(sorted(talks)))
        talk, k = talks[index], INDICES.index(index)
        what = draw(st.sampled_from(("value",) * 4 + ("string", "set", "invalid", "parameter", "silence", "reset")))
        if what == "value" and index in (1, 3, 5, 15):
            talk.triples(range(6, -1, -1))
        elif what == "value":
            talk.frame(draw(st.integers(0, (1 << 21) - 1)) & ~(4 << 18) | draw(st.integers(0, 1)), 6)
        elif what == "string" and index in (3, 4):
            mode = draw(st.sampled_from(MODES))
            pair.call("WPAR", index, mode)
            if draw(st.booleans()):             # WPAR again, within the first sequence
                talk.triples((7, 6, 5))
                pair.call("WPAR", index, mode)
            for _ in range(draw(st.integers(1, 4))):
                if mode == table.CTT1_PAR_WR:
                    talk.frame(draw(st.integers(0, 0xFFFFFF)) | draw(st.integers(0, 1)), 7)
                else:
                    talk.triples(range(7, -1, -1))
            pair.call("WPAR", index, 15)
        elif what == "set" and index in (1, 3, 5, 15):
            pair.value(k, 0, draw(WORD))
        elif what == "invalid" and index in (1, 15):
            pair.invalid(k, draw(st.integers(0, 3)), draw(st.integers(0, 3)))
        elif what == "parameter":
            pair.call("WPAR", index, draw(st.integers(0, 15)))
            pair.call("WPAR", index, draw(st.sampled_from((15, 14))))
        elif what == "silence":
            talk.triples([draw(st.integers(0, 7)) for _ in range(draw(st.integers(0, 3)))])
            pair.wait(table.CTT1_SLAVE_TIMEOUT_MS * MS + draw(st.sampled_from((-20 * MS, CLEAR_NS))))
        elif what == "reset":
            pair.call("RES", index)
            pair.wait(RESET_NS + CLEAR_NS)
            pair.call("WPAR", index, 15)


@pytest.mark.parametrize("sequences", [73, 74, 75, 148])
def test_string_that_is_too_long(sequences):
    """SL-007, SL-009, CT-014: 73 sequences are taken, more are dropped to the last; the old string stays, the next one
    is taken again."""
    pair = Pair(dict(address=4, io=7, id=4, id2=5, strings={2: STRING}))
    pair.wait(POWER_UP_NS + CLEAR_NS)
    k, control = 0, 0

    def write(frames):
        nonlocal control
        pair.call("WPAR", 4, table.CTT1_PAR_WR)
        for number, frame in enumerate(frames):
            frame = frame << 8 | (1 if number == len(frames) - 1 else 3)
            for n in range(7, -1, -1):
                pair.call("DEXG", 4, control << 3 | frame >> 3 * n & 7)
                control ^= 1
        pair.call("WPAR", 4, table.CTT1_PAR_DATA)
        return pair.slaves[k].ctt.strings[2]

    assert len(write(range(sequences))) == (219 if sequences == 73 else len(STRING))
    assert write((0xA5A5, 0x1234)) == bytes.fromhex("A5A503123401")


MESSAGES = ((0x00,), (0x01, 0x5A, 0xA5), (0x01, 1, 2, 3, 4), (0x10, 0, 5), (0x10, 0, 6), (0x10, 0, 7), (0x10, 3, 2),
            (0x10, 9, 1), (0x11, 3, 4, 1, 2, 3, 4), (0x11, 3, 2, 8, 9), (0x11, 0, 5, 1, 2, 3, 4, 5), (0x12, 3, 1),
            (0x13, 3, 2, 6, 7), (0x1D, 3, 2, 2, 4, 5), (0x1D, 3, 4, 4, 9, 8, 7, 6), (0x1D, 3, 9, 1, 4), (0x14, 1),
            (0x10,), (0x3F,), (0x40,), (0x50, 3), (0x90, 1), (0xFF,), (0x02,))


@given(st.data())
@settings(max_examples=25, **LONG)
def test_random_ctt2(data):
    """SL-007, SL-009, CT-020, CT-021: messages to every CTT2 slave, whole and broken, under random accidents."""
    draw = data.draw
    pair = transacting()
    activate(pair)
    for _ in range(draw(st.integers(1, 4))):
        index = draw(st.sampled_from((7, 8, 40)))
        talk, k = Talk(pair, index, draw), INDICES.index(index)
        pair.value(k, draw(st.integers(0, 3)), draw(WORD))
        talk.message(draw(st.sampled_from(MESSAGES)), draw(st.sampled_from((0, 7, 9, 40, 110))))


@pytest.mark.parametrize("index", [7, 8, 40])
def test_every_message(index):
    """SL-007, SL-009, CT-021: every message of the table, good and refused, to every CTT2 slave."""
    pair = transacting()
    activate(pair)
    for message in MESSAGES:
        calls = [(byte >> bit & 1) << 1 | clock for byte in message for bit in range(7, -1, -1) for clock in (0, 1)]
        for nibble in calls + [3] * 130:
            assert pair.call("DEXG", index, 12 | nibble, extended=index in EXTENDED)


@given(st.data())
@settings(max_examples=60, **LONG)
def test_random_other_kinds(data):
    """SL-007, SL-009, CT-030, CT-031, CT-040, CT-050, CT-060: CTT3, CTT4, CTT5 and safety slaves, random nibbles."""
    draw = data.draw
    pair = transacting()
    activate(pair)
    talks = {index: Talk(pair, index, draw) for index in (9, 41, 10, 11, 12, 13, 14)}
    for _ in range(draw(st.integers(10, 60))):
        index = draw(st.sampled_from(sorted(talks)))
        k = INDICES.index(index)
        talks[index].nibble(draw(st.integers(0, 15)))
        what = draw(st.sampled_from(("",) * 6 + ("set", "reset")))
        if what == "reset":
            pair.call("RES", index)
            pair.wait(RESET_NS + CLEAR_NS)
            pair.call("WPAR", index, 15, extended=index in EXTENDED)
        elif what == "set" and index == 41:
            pair.value(k, 0, draw(st.integers(0, 255)))
        elif what == "set" and index in (10, 11):
            pair.closed(k, tuple(draw(st.permutations((1, 2, 5, 6, 9, 10, 12, 13)))), draw(st.integers(0, 3)))
        elif what == "set":
            pair.inputs(k, draw(st.integers(0, 15)))
