# SPDX-License-Identifier: Apache-2.0
"""Random plants and hosts for very many cycles: the core against the reference after every batch, cycle and tick.

usage: soak.py [--cycles N] [--seeds S ...] [--jobs J]; a failure prints the seed that repeats it and exits with 1.
"""
import argparse
import multiprocessing
import random
import sys
import time
import traceback
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from fake_line import Master, Slave  # noqa: E402
from reference import EXECUTABLE, FN_CHANGE, FN_EXECUTE, FN_PARAMETER, FN_WRITE_ID1, SLAVES, Compare  # noqa: E402

# profiles without a combined transaction
STANDARD_ID, EXTENDED_ID, IO = (1, 9, 15), 10, (0, 1, 3, 4, 5, 8, 12, 15)
ZERO_SELECTS = ("0", "0", "1", "id1", "both")
# CA-003: DEXG and WPAR, ADRA, the executable ones, DELA
LEGAL = set(range(0x400)) | {0x400 | n << 5 | c for n, c in EXECUTABLE} | {
    0x400 | n << 5 | c for n in range(32) for c in (0, 8)}


class World:
    """A plant and a host that do something at random, from one seed."""

    def __init__(self, seed):
        self.dice = random.Random(seed)
        # few numbers make pairs, clashes and re-use; many make long cycles and full inclusion rounds
        few = self.dice.random() < 0.8
        self.indices = sorted(self.dice.sample(sorted(SLAVES), 5) + [0, 7, 39] if few else [*SLAVES, 0])
        slaves = [self.slave(i) for i in self.dice.sample(self.indices, self.dice.randrange(len(self.indices)))]
        projected = [s for s in slaves if s.index and self.dice.random() < 0.8]
        protected = self.dice.random() < 0.5
        self.m = Master(slaves, projected, seed=seed, protected_mode=protected,
                        auto_clear=self.dice.choice((0, 0, 0, 1, 2, 3)) if protected else 0)
        self.compare = Compare(self.m)
        self.actions = self.dice.choice((self.ACTIONS, self.ACTIONS, self.REPLACEMENTS))
        self.actions += ("job",) * self.dice.choice((3, 15, 60) if self.actions == self.ACTIONS else (0, 3))
        self.m.settle()

    def clock(self):
        return self.m.port.time_us

    def slave(self, index):
        extended = index > 32 or self.dice.random() < 0.4
        id1 = self.dice.randrange(16)
        if extended and self.dice.random() < 0.8:  # else its select bit is not that of its address
            id1 = id1 & 7 | index >> 5 << 3
        return Slave(index, io=self.dice.choice(IO), id=EXTENDED_ID if extended else self.dice.choice(STANDARD_ID),
                     id1=id1, id2=self.dice.randrange(16), inputs=self.dice.randrange(1, 16),
                     old=not extended and self.dice.random() < 0.2,
                     zero_select=self.dice.choice(ZERO_SELECTS) if extended else "0", clock=self.clock,
                     write_us=self.dice.choice((0,) * 12 + (9_000,) * 6 + (60_000,) * 3 + (600_000,)),
                     memory_fails=self.dice.random() < 0.1, id1_protected=self.dice.random() < 0.1)

    def some(self):
        return self.dice.choice(self.m.slaves) if self.m.slaves else self.slave(0)

    # ---- the plant
    def appears(self):
        s = self.slave(self.dice.choice(self.indices))
        if self.dice.random() < 0.9:  # else a second one with this address
            self.m.slaves = [x for x in self.m.slaves if x.index != s.index]
        self.m.slaves.append(s)

    def replaces(self):
        """A projected slave breaks down; one like it comes with address 0 (AD-008)."""
        lps, pcd, _, _ = self.m.permanent()
        lds = self.compare.r.lds
        if lps:
            missing = sorted(lps - lds) or sorted(lps)  # two missing ones would be too many
            i = self.dice.choice(missing)
            self.m.slaves = [x for x in self.m.slaves if x.index not in (0, i)]
            new = self.slave(0)
            new.io, new.id, new.id1, new.id2 = (pcd[i] >> k & 15 for k in (0, 4, 8, 12))
            new.zero_select = self.dice.choice(ZERO_SELECTS) if new.extended else "0"
            new.old = False
            self.m.slaves.append(new)

    def vanishes(self):
        if self.m.slaves:
            self.m.slaves.remove(self.some())

    def changes_codes(self):
        self.some().io = self.dice.choice(IO)

    def resets(self):
        self.some().power_up()

    def comes_and_goes(self):
        s = self.some()
        s.present = not s.present

    def misbehaves(self):
        names = self.dice.sample(("RDIO", "RDID", "RID1", "RID2", "WPAR", "DEXG", "RDST", "DELA", "ADRA",
                                  "WID1", "RES"), self.dice.randrange(3))
        self.some().mute = frozenset(names)

    def stutters(self):
        self.some().deaf = self.dice.randrange(7)

    def fault(self):
        s = self.some()
        s.fault = not s.fault

    def noise(self):
        self.m.noise = self.dice.choice((0.0, 0.0, 0.02, 0.3))

    def power(self):
        self.m.power(self.dice.random() < 0.4)

    # ---- the host
    def control(self):
        name = self.dice.choice(("protected_mode", "offline", "data_exchange", "auto_address", "auto_clear"))
        value = self.dice.randrange(5) if name == "auto_clear" else self.dice.random() < (0.2 if name == "offline" else 0.5)
        self.m.control(**{name: value})

    def project(self):
        slaves = [s for s in self.m.slaves if s.index]
        if self.dice.random() < 0.3:
            slaves = [self.slave(i) for i in self.indices if i and self.dice.random() < 0.4]
        self.m.project(slaves, {s.index: self.dice.randrange(16) for s in slaves})

    def function(self):
        index = self.dice.choice((*self.indices, 32, 64, 255))
        name, *args = self.dice.choice((
            ("set_pp", index, self.dice.randrange(17)), ("set_pcd", index, self.dice.randrange(0x10010)),
            ("set_lps", {i for i in self.indices if self.dice.random() < 0.5}), ("store_configuration",),
            ("store_parameters",)))
        self.compare.function(name, *args)

    def job(self):
        """A function with telegrams, at times with arguments that make no sense."""
        here = sorted(self.compare.r.lds) or [0]
        if here[0] == 0 and self.dice.random() < 0.7:
            here = [0]  # it is in the way of the others
        index = self.dice.choice((*here, *here, *here, self.dice.choice(self.indices), 0, 32, 64))
        kind, index, value = self.dice.choice((
            (FN_PARAMETER, index, self.dice.randrange(17)), (FN_CHANGE, index, self.dice.choice((index, 64))),
            (FN_CHANGE, index, self.dice.choice(self.indices)), (FN_CHANGE, index, self.dice.choice(self.indices)),
            (FN_CHANGE, index, index ^ 32), (FN_CHANGE, index, 0),
            (FN_EXECUTE, index & 31, self.dice.randrange(32)), (FN_EXECUTE, index & 31, 0x1C), (FN_EXECUTE, 31, 0x15),
            (FN_WRITE_ID1, 0, self.dice.randrange(17)), (self.dice.randrange(27), index, self.dice.randrange(64))))
        self.compare.start(kind, index, value)

    def automatic(self):
        """Project what is there and let it be addressed automatically."""
        if not self.m.controls()["protected_mode"]:
            self.compare.function("store_configuration")
        self.m.control(protected_mode=True, auto_address=True, auto_clear=0, offline=False)

    def outputs(self):
        self.m.host_outputs = [self.dice.randrange(16) for _ in range(64)]

    def late(self):
        self.m.cycle(report=False)

    def timing(self):
        self.m.delay = self.dice.randrange(4)

    ACTIONS = ("appears", "vanishes", "changes_codes", "resets", "comes_and_goes", "comes_and_goes", "misbehaves",
               "stutters", "fault", "noise", "power", "control", "control", "project", "function", "outputs", "late", "timing",
               "automatic", "replaces")
    REPLACEMENTS = ("automatic", "automatic", "replaces", "replaces", "replaces", "misbehaves", "stutters", "noise", "power",
                    "resets", "comes_and_goes", "control", "late", "timing")

    def run(self, cycles):
        """At least so many cycles of normal operation."""
        end = self.m.cycle_number + cycles
        while self.m.cycle_number < end:
            for _ in range(self.dice.choice((1, 1, 1, 2, 4))):
                getattr(self, self.dice.choice(self.actions))()
            for _ in range(self.dice.choice((1, 3, 20, 100))):
                self.m.step()
            if not self.m.slaves:
                self.appears()  # else the cycles would never come
            if self.m.apf and self.dice.random() < 0.5:
                self.m.power(False)
            if self.m.controls()["offline"] and self.dice.random() < 0.5:
                self.m.control(offline=False)
            self.check_log()
        return self

    def check_log(self):
        assert {call for call, _, _ in self.m.log} <= LEGAL
        del self.m.log[:]

    def home(self):
        """EX-012, EX-013, AD-004: left alone the master finds every slave that answers, wherever it is by now."""
        m = self.m
        m.noise = 0.0
        for s in m.slaves:
            s.mute, s.present, s.deaf, s.write_us, s.writing_until = frozenset(), True, 0, 0, None
        m.power(False)
        assert m.control(offline=False, auto_clear=0, auto_address=False) == 0
        for _ in range(40_000):  # what is open ends, its waits for memories and tries included
            m.step()
            if not self.compare.r.busy() and not self.compare.r.again:
                break
        assert not self.compare.r.busy()
        standard = {s.index for s in m.slaves if not s.extended}
        # one for each address, no B beside a standard slave
        seen = {s.index: s for s in m.slaves if s.index - 32 not in standard}
        m.slaves = list(seen.values())
        if m.slaves:
            m.until(lambda s: s["phase"] == 3)
            for _ in range(4):  # a gone one misses three rounds
                m.rounds()
            self.check_log()
            assert m.read()["lds"] == set(seen), (m.read()["lds"], set(seen))
        return self


EPISODE = 2_000  # cycles with one plant and host
SHOW = 25_000    # cycles between two lines of progress


def soak(seed, cycles):
    """-> cycles run. A seed and a number name an episode: soak(seed, n) starts with the episodes of soak(seed, n - 1)."""
    done = episode = shown = 0
    while done < cycles:
        if done - shown >= SHOW:
            shown = done
            print(f"seed {seed}: {done} cycles", flush=True)
        name = seed * 1_000_000 + episode
        try:
            done += World(name).run(min(EPISODE, cycles - done)).home().m.cycle_number
        except BaseException:
            print(f"episode {name} fails; repeat it with: firmware/tests/soak.py --episode {name}", flush=True)
            raise
        episode += 1
    return done


def worker(job):
    try:
        return soak(*job)
    except Exception:
        traceback.print_exc()
        return None


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cycles", type=int, default=1_000_000, help="in all")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4])
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--episode", type=int, help="run only this one")
    a = parser.parse_args()
    if a.episode is not None:
        return print(World(a.episode).run(EPISODE).home().m.cycle_number, "cycles")
    began = time.monotonic()
    with multiprocessing.Pool(a.jobs) as pool:
        done = pool.map(worker, [(seed, -(-a.cycles // len(a.seeds))) for seed in a.seeds], chunksize=1)
    good = sum(n for n in done if n)
    print(f"soak: {good} cycles with seeds {a.seeds}, {good / (time.monotonic() - began):.0f} cycles/s, "
          f"{sum(n is None for n in done)} seeds failed")
    return sys.exit(None in done)


if __name__ == "__main__":
    main()
