# SPDX-License-Identifier: Apache-2.0
"""Random plants on the native chip with the real firmware: slaves come, go, change profile and disturb the line, power
dips, foreign pulses, commits and outputs at any moment. What is shown must make sense all the time; when it has been
calm for a while it must be the truth, and the line must be exact."""
import random
from pathlib import Path

import pytest

from asi import regmap as r
from asi.native import Chip
from asi.plant import Codes
from asi.window import HostWindow

SLAVE0 = -6  # asi_status_t
FIRMWARE = Path(__file__).parents[2] / "build/firmware/asi_test.hex"
US, MS = 1_000, 1_000_000
OUTPUT_BITS = (0, 8, 0, 12, 0, 14, 0, 0, 15, 7, 7, 3, 3, 1, 1, 0)  # by IO code, D0 = bit 0: echoed in the answer
CHAOS, CALM, STALE = 200 * MS, 450 * MS, 60 * MS
PROTECTED, OFFLINE, DATA_EXCHANGE = (1 << getattr(r, f"HOST_CTRL_{name}_LSB") for name in
                                     ("PROTECTED_MODE", "OFFLINE", "DATA_EXCHANGE"))
FAULTS = ("p_no_answer", "p_parity", "p_missing_pulse", "p_shifted_pulse", "p_extra_pulse")


class Slave:
    def __init__(self, net, rng, index, extended):
        self.index, self.payload, self.present = index, 7 if extended else 15, False
        self.io, identity, id1, id2 = rng.randrange(16), 10 if extended else rng.randrange(10), rng.randrange(16), 5
        if extended:
            id1 = id1 & 7 | index >> 5 << 3
        self.word = Codes(self.io, identity, id1, id2).word
        self.past = [(0, rng.randrange(16))]  # inputs, with the time from which they hold
        self.handle = net.add(index, self.io, identity, id1, id2, self.past[0][1], watchdog=rng.random() < .5,
                              present=False)
        self.echo = OUTPUT_BITS[self.io] & self.payload

    def could_say(self, nibble, since):
        """Whether its inputs were these at some time from `since` on."""
        ends = [t for t, _ in self.past[1:]] + [since]
        return any(not (value ^ nibble) & ~self.echo & 15 for (_, value), end in zip(self.past, ends) if end >= since)


class World:
    def __init__(self, firmware, seed):
        self.rng = rng = random.Random(seed)
        self.chip = Chip(firmware, seed=seed)
        self.net, self.window, self.read = self.chip.net, HostWindow(self.chip), self.chip.host_read
        self.slaves = []
        for number in rng.sample(range(1, 32), rng.choice((1, 2, 4, 7))):
            indices = rng.choice(((number,), (number + 32,), (number, number + 32)))
            extended = number + 32 in indices or rng.random() < .5
            for index in indices * rng.choice((1, 1, 2)):  # twice: another profile may take its place
                self.slaves.append(Slave(self.net, rng, index, extended))
            if not extended and rng.random() < .3:  # EX-026
                self.slaves.append(Slave(self.net, rng, number + 32, True))
        self.slaves.append(Slave(self.net, rng, 0, False))
        self.control, self.outputs, self.pcd = DATA_EXCHANGE, [0] * 64, {}
        for slave in self.slaves[:-1]:
            self.connect(slave)
        while not self.window.ready():
            self.chip.run(self.chip.time_ns + MS)

    def at(self, index):
        return next((s for s in self.slaves if s.index == index and s.present), None)

    def connect(self, slave):
        if not self.at(slave.index):
            slave.present = True
            self.net.set_present(slave.handle, True)

    def run(self, ns):
        """Let time pass; look at the window now and then."""
        end = self.chip.time_ns + ns
        while self.chip.time_ns < end:
            self.chip.run(min(end, self.chip.time_ns + self.rng.randrange(1, 5_000) * US))
            self.look()

    def commit(self):
        for k in range(2):
            self.chip.host_write(r.HOST_LPS_CFG + 4 * k, sum(1 << i - 32 * k for i in self.pcd if i >> 5 == k))
        for k in range(32):
            self.chip.host_write(r.HOST_PCD + 4 * k,
                                 self.pcd.get(2 * k, 0xFFFF) | self.pcd.get(2 * k + 1, 0xFFFF) << 16)
        self.chip.host_write(r.HOST_HOST_CTRL, self.control)
        sequence = self.read(r.HOST_HOST_SEQ) + 1
        self.chip.host_write(r.HOST_HOST_SEQ, sequence)
        limit = self.chip.time_ns + 10 * MS
        while (result := self.window.result(sequence)) is None:
            assert self.chip.time_ns < limit, "the commit is not served"
            self.run(100 * US)
        if result == SLAVE0:  # EX-032: protected mode waits until nobody has address 0
            assert self.control >> r.HOST_CTRL_PROTECTED_MODE_LSB & 1
            self.control &= ~(1 << r.HOST_CTRL_PROTECTED_MODE_LSB)
            return self.commit()
        assert result == 0

    # ---- what happens
    def act(self):
        rng, slave = self.rng, self.rng.choice(self.slaves)
        action = rng.choice(("presence", "inputs", "outputs", "faults", "pulses", "dip", "power", "control", "project"))
        if action == "presence":
            if slave.present:
                slave.present = False
                self.net.set_present(slave.handle, False)
            else:
                self.connect(slave)
        elif action == "inputs":
            slave.past.append((self.chip.time_ns, rng.randrange(16)))
            self.net.set_inputs(slave.handle, slave.past[-1][1])
        elif action == "outputs":
            self.outputs[slave.index] = rng.randrange(16)
            self.window.set_output(slave.index, self.outputs[slave.index])
        elif action == "faults":
            faults = {name: rng.choice((0, 0, 20_000, 65_535)) for name in FAULTS}
            self.net.set_faults(slave.handle, **faults, shift_ns=rng.choice((-2_000, 2_000)),
                                delay_ns=rng.choice((0, 0, -15_000, -9_500, 20_000, 32_500, 50_000)))
        elif action == "pulses":
            at = self.chip.time_ns
            for _ in range(rng.choice((1, 2, 30, 300))):
                at += rng.randrange(500, 23_000)
                self.net.inject(at, rng.choice((-1, 1)))
        elif action in ("dip", "power"):
            self.chip.apf(True)
            if action == "power":
                self.net.power(False)
            self.run(rng.choice((3 * US, 50 * US, 999 * US, 1_001 * US, 3 * MS)))
            self.net.power(True)
            self.chip.apf(False)
        elif action == "control":
            self.control = rng.choice((0, PROTECTED, OFFLINE)) | rng.choice((DATA_EXCHANGE, DATA_EXCHANGE, 0))
            self.commit()
        else:
            self.pcd = {s.index: s.word for s in self.slaves if s.index and rng.random() < .8}
            self.commit()

    # ---- what must hold
    def look(self):
        """One publication: lists, codes, flags and image fit each other; inputs are of a slave and not old."""
        while True:
            sequence = self.read(r.HOST_IN_SEQ)
            state, image, codes = self.window.state(), self.window.inputs(), self.window.detected_codes()
            if not sequence & 1 and self.read(r.HOST_IN_SEQ) == sequence:
                break
        assert state.las <= state.lds and state.lds == set(codes)
        assert state.flags["normal_operation_active"] == (state.phase == r.Phase.DATA_EXCHANGE)
        assert state.flags["lds0"] == (0 in state.lds)
        if state.phase == r.Phase.OFFLINE:
            assert not state.lds and not any(image)
        if state.flags["config_ok"]:
            assert state.lds == state.lps
        since = self.chip.time_ns - STALE
        for index, nibble in enumerate(image):
            if index not in state.las:
                assert nibble == 0
            elif nibble:
                assert any(s.could_say(nibble, since) for s in self.slaves if s.index == index), (index, nibble)
        return state, image, codes

    def check_calls(self, log, active):
        """The rules of the line; active: gaps are exact, and each active number is called once a cycle."""
        numbers, cycle, started = {index & 31 for index in active}, [], False
        for call, following in zip(log, log[1:]):
            if not call.request_ok or not following.request_ok:  # hit by a foreign pulse
                continue
            assert call.phase != r.Phase.OFFLINE
            command, number, info = call.call >> 10, call.call >> 5 & 31, call.call & 31
            if call.phase == r.Phase.DATA_EXCHANGE:
                assert number and (info & 23 == 17 if command else info < 16)  # RDID: data exchange is off (LK-021)
            else:
                assert info & 23 in (16, 17, 18, 19, 22) if command else number  # RDIO .. RID2, RDST of a poll
            gap = following.t_ns - call.t_ns - 78_000
            expected = {0: call.delay_ns + 36_000 + 18_500, 1: 72_000}.get(call.error_class, 24_000)
            assert gap >= expected - 62
            if active:
                assert gap <= expected + 62 and not (call.phase == r.Phase.DATA_EXCHANGE and call.error_class)
                if call.phase == r.Phase.DATA_EXCHANGE:
                    cycle.append(number)
                else:
                    assert not started or cycle == sorted(numbers)
                    cycle, started = [], True

    def check_calm(self):
        """Faults gone, time enough: all that is shown is what is there."""
        for slave in self.slaves:
            self.net.set_faults(slave.handle)
        self.control &= ~OFFLINE
        self.commit()
        self.run(CALM)
        self.chip.log()
        self.chip.run(self.chip.time_ns + 30 * MS)
        log = self.chip.log()
        state, image, codes = self.look()
        present = {s.index: s for s in self.slaves if s.present}
        assert codes == {i: Codes(*(s.word >> 4 * k & 15 for k in range(4))) for i, s in present.items()}
        clash = {i for i in present if i > 32 and i - 32 in present and present[i - 32].payload == 15}
        match = {i for i in present if self.pcd.get(i) == present[i].word} - clash
        active = (match if self.control & PROTECTED else set(present) - clash) - {0}
        assert state.las == active and state.phase == (r.Phase.DATA_EXCHANGE if present else r.Phase.DETECTION)
        assert state.flags["config_ok"] == (match == set(present) == set(self.pcd))
        for index in active:
            slave = present[index]
            if not self.control & DATA_EXCHANGE:  # EX-024: nobody brings data either way
                assert image[index] == 0
                continue
            line = 15 & ~self.outputs[index]
            assert not (self.net.state(slave.handle).outputs ^ line) & slave.payload
            assert image[index] == line & slave.echo | slave.past[-1][1] & ~slave.echo
        # without data exchange watchdogs reset their slaves, which are silent for a while
        self.check_calls(log, active if self.control & DATA_EXCHANGE else ())


@pytest.mark.parametrize("seed", range(4))
def test_random_plant(seed):
    """CA-005, CA-006, EX-001, EX-009, EX-012, EX-015, EX-016, EX-017, EX-024, EX-026, HW-002, HW-003, HW-004, LK-001,
    LT-004, LT-005, LT-011: a random plant and host, then calm; see the methods of World."""
    world = World(FIRMWARE, seed)
    world.run(world.rng.randrange(20, 80) * MS)
    end = world.chip.time_ns + CHAOS
    while world.chip.time_ns < end:
        world.act()
        world.run(world.rng.choice((1, 200, 1_000, 5_000, 20_000)) * US)
    world.check_calls(world.chip.log(), ())
    world.check_calm()
    world.chip.close()
