#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Times of execution control on the whole chip, in bus time: start-up, loss, return, replacement, work of the core.

usage: exec_times.py [--json FILE]
Needs build/tb/libasi_chip.so and build/firmware/asi_test.hex (make figures and make test build them). The test image
waits 20 ms after power-up instead of 1 s; all else is the product's. host/tests/test_times.py holds the figures to
their goals (EX-029 .. EX-031, AD-010).
"""
import argparse
import json
import sys
from pathlib import Path

from asi import regmap
from asi.native import Chip
from asi.plant import Codes, Host
from asi.regmap import Phase
from asi.telegram import decode_call
from asi.window import HostWindow

ROOT = Path(__file__).resolve().parent.parent
FIRMWARE = ROOT / "build/firmware/asi_test.hex"
MS = 1_000_000
STANDARD = Codes(io=0, id=0, id1=0xF, id2=0xE)
EXTENDED = Codes(io=0, id=0xA, id1=7, id2=0xE)
GOALS = {"start_31_ms": 60, "start_62_ms": 110, "lost_cycles": 3, "returned_ms": 350, "replaced_ms": 1000,
         "interrupt_us": 2462}  # half a cycle of 31 calls


class Line:
    """A chip with slaves; codes: {index: Codes}."""

    def __init__(self, codes, protected=False, auto_address=False):
        self.chip = Chip(FIRMWARE)
        self.net, self.window, self.codes = self.chip.net, HostWindow(self.chip), codes
        self.slaves = {i: self.add(i, c) for i, c in codes.items()}
        while not self.window.ready():
            self.run(1)
        if protected:
            host = Host(protected=True, pcd=codes, parameters={}, outputs={}, data_exchange=True, auto_address=auto_address)
            self.window.configure(host)
        self.log = []

    def add(self, index, codes, **options):
        id1 = codes.id1 & 7 | index >> 2 & 8 if codes.extended and index else codes.id1
        return self.net.add(index, codes.io, codes.id, id1, codes.id2, inputs=5, **options)

    def run(self, ms):
        self.chip.run(self.chip.time_ns + int(ms * MS))

    def until(self, telegram, limit_ms=3000):
        """Run until telegram(t) holds -> that telegram. RuntimeError after limit_ms of bus time."""
        for _ in range(int(limit_ms / 5)):
            self.run(5)
            new = self.chip.log()
            self.log += new
            for t in new:
                if telegram(t):
                    return t
        raise RuntimeError(f"nothing of the kind in {limit_ms} ms")

    def exchanges(self, index):
        """-> test for a good cyclic DEXG of this index"""
        def test(t):
            name, i = of(t, self.codes[index].extended)
            return t.phase == Phase.DATA_EXCHANGE and t.error_class == 0 and name == "DEXG" and i == index
        return test

    def start(self):
        self.until(lambda t: t.phase == Phase.DATA_EXCHANGE)
        return self


def of(t, extended=False):
    """-> (mnemonic, index)"""
    call = decode_call(t.call, lambda number: extended)
    return call.name, call.index


def network(n):
    """31 standard slaves or 31 A/B pairs."""
    numbers = range(1, 32)
    return ({i: STANDARD for i in numbers} if n == 31 else
            {i + k: EXTENDED for i in numbers for k in (0, 32)})


def start_up(n):
    """First telegram to the first cycle, ms."""
    line = Line(network(n)).start()
    first = next(t for t in line.log if t.phase == Phase.DATA_EXCHANGE)
    return (first.t_ns - line.log[0].t_ns) / MS


def lost(index=17):
    """Cycles in which a slave that went was called in vain."""
    line = Line(network(31)).start()
    line.run(50)
    line.chip.log()
    line.net.set_present(line.slaves[index], False)
    line.run(80)
    calls = [t for t in line.chip.log() if of(t) == ("DEXG", index) and t.error_class]
    return sum(not t.repeated for t in calls)


def returned(cases):
    """[(index, ms of absence)] -> worst time from plugging in (with its 10 ms of power-up) to the first cyclic data, ms."""
    line, worst = Line(network(31)).start(), 0
    for index, absence in cases:
        line.net.set_present(line.slaves[index], False)
        line.run(absence)
        line.log += line.chip.log()
        line.net.set_present(line.slaves[index], True)
        begin = line.chip.time_ns
        worst = max(worst, line.until(line.exchanges(index)).t_ns - begin)
        line.run(20)
    return worst / MS, line


def replaced(cases, write_ms=100):
    """[(index, ms of absence)] -> worst time from plugging in the new one at address 0 to its first cyclic data, ms."""
    worst = 0
    for index, absence in cases:
        line = Line(network(31), protected=True, auto_address=True).start()
        line.run(30)
        line.net.set_present(line.slaves[index], False)
        line.run(absence)
        line.chip.log()
        begin = line.chip.time_ns
        line.add(0, line.codes[index], write_ns=int(write_ms * MS))
        worst = max(worst, line.until(line.exchanges(index)).t_ns - begin)
    return worst / MS


def extra_calls(log):
    """Most extra calls, repetitions apart, between two cycles' DEXG calls (EX-029)."""
    most = run = 0
    for t in log:
        if t.phase == Phase.DATA_EXCHANGE:
            run = 0
        elif t.phase in (Phase.MANAGEMENT, Phase.INCLUSION) and not t.repeated:
            run += 1
            most = max(most, run)
    return most


def core_work(kinds, ms=250):
    """Longest interrupt while cycles run (HW-011), us, with slaves of combined transactions on all 31 numbers.
    kinds: profiles that take turns, "7.3.D" or pairs like "7.A.7+7.A.A"."""
    codes = {}
    for number in range(1, 32):
        for k, profile in enumerate(kinds[number % len(kinds)].split("+")):
            io, id, id2 = (int(x, 16) for x in profile.split("."))
            codes[number + 32 * k] = Codes(io, id, 7 if id == 0xA else 0xF, id2)
    line = Line(codes).start()
    line.run(40)
    for k in range(64):
        line.chip.host_write(regmap.HOST_AODI + 4 * k, 0x12345678 + k)
    line.run(ms)
    return line.chip.host_read(regmap.HOST_CORE_LOAD)


MIXES = {"31 x S-7.3.D": ["7.3.D"], "62 x S-7.A.A": ["7.A.A+7.A.A"], "S-7.3.D, S-7.3.5, pairs S-7.A.7 + S-7.A.A":
         ["7.3.D", "7.A.7+7.A.A", "7.3.5", "7.A.A+7.A.7"]}


def measure():
    """-> {figure: value}, see GOALS"""
    returned_ms, line = returned([(k, 60 + 23 * n) for n, k in enumerate((1, 9, 17, 25, 31, 2, 30, 16))])
    works = {name: core_work(kinds) for name, kinds in MIXES.items()}
    return {"start_31_ms": start_up(31), "start_62_ms": start_up(62), "lost_cycles": lost(), "returned_ms": returned_ms,
            "replaced_ms": replaced([(1, 70), (16, 100), (31, 130)]), "extra_calls": extra_calls(line.log),
            "interrupt_us": max(works.values()), "interrupt_us_by_mix": works}


def main(argv=None):
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--json", type=Path)
    args = p.parse_args(argv)
    found = measure()
    for name, value in found.items():
        goal = f"  goal {GOALS[name]}" if name in GOALS else ""
        print(f"{name:20} {value if not isinstance(value, float) else f'{value:.1f}'}{goal}")
    if args.json:
        args.json.parent.mkdir(parents=True, exist_ok=True)
        args.json.write_text(json.dumps(found, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
