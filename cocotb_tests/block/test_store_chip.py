# SPDX-License-Identifier: Apache-2.0
"""The permanent storage on the whole Verilated chip: its own core, SPI port and pins, and the flash model on them.

Every byte of a cut is tried natively (firmware/tests/test_store.py); here samples show that core, compiler and SPI port
do the same."""
import random
import subprocess
import sys

import pytest
from asi.native import Chip, Flash

from cocotb_tests.cocotb_run import ROOT

US, MS = 1_000, 1_000_000
MAIL = 0x3F00
OP, SEED, OPAQUE, RESULT, SEQUENCE, STATE, OPEN_US, LONGEST_US, STEPS = range(MAIL, MAIL + 36, 4)
ALIVE, STORE, IS_LOADED = 0x600D_0000, 1, 2
ABSENT, EMPTY, LOADED, CORRUPT = range(4)
AREA, AREA_BYTES, SECTOR = 0x11_0000, 0x1_0000, 4096
FIRMWARE = ROOT / "firmware"
FLAGS = ("-target riscv32-freestanding-none -mcpu=generic_rv32 -mabi=ilp32 -std=c17 -Os -fno-unroll-loops -mno-relax "
         "-ffreestanding -fno-builtin -fno-sanitize=all -fno-delete-null-pointer-checks -ffunction-sections "
         "-fdata-sections -Wall -Wextra -Werror -nostdlib -static -Wl,--gc-sections").split()


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """The probe, with the firmware's start-up code and linker script -> hex file"""
    out = tmp_path_factory.mktemp("store")
    sources = [FIRMWARE / "hal/startup.S", FIRMWARE / "hal/asi_mem.c", FIRMWARE / "hal/asi_spi.c",
               FIRMWARE / "hal/asi_flash.c", FIRMWARE / "core/asi_store.c", ROOT / "cocotb_tests/block/store_probe.c"]
    subprocess.run([sys.executable, "-m", "ziglang", "cc", *FLAGS,
                    *(f"-I{FIRMWARE / d}" for d in ("hal/include", "core", "hal", "app", "generated")),
                    "-T", str(FIRMWARE / "hal/firmware.ld"), *map(str, sources), "-o", str(out / "probe.elf")],
                   check=True)
    subprocess.run([sys.executable, str(ROOT / "tools/elf2hex.py"), str(out / "probe.elf"), "--hex",
                    str(out / "probe.hex")], check=True, stdout=subprocess.DEVNULL)
    return out / "probe.hex"


class Bench:
    """A chip on this flash, started."""

    def __init__(self, program, flash):
        self.flash = flash
        self.chip = Chip(program)
        self.chip.attach_flash(flash)
        self.chip.host_write(STATE, 0)
        self.state = self.wait(lambda: self.chip.host_read(STATE) & 0xFFFF_0000 == ALIVE, 900 * MS) and \
            self.chip.host_read(STATE) & 0xFFFF

    def wait(self, condition, limit_ns):
        end = self.chip.time_ns + limit_ns
        while self.chip.time_ns < end:
            if condition():
                return True
            self.chip.run(self.chip.time_ns + 100 * US)
        raise AssertionError("the program does not go on")

    def begin(self, op, seed, opaque=0):
        for offset, value in ((SEED, seed), (OPAQUE, opaque), (OP, op)):
            self.chip.host_write(offset, value)

    def store(self, seed, opaque=0):
        """-> 1 saved, 0 failed, None: power has failed"""
        self.begin(STORE, seed, opaque)
        self.wait(lambda: self.chip.host_read(OP) == 0 or self.flash.dead, 900 * MS)
        return None if self.flash.dead else self.chip.host_read(RESULT)

    def holds(self, seed, opaque=0):
        self.begin(IS_LOADED, seed, opaque)
        self.wait(lambda: self.chip.host_read(OP) == 0, 50 * MS)
        return self.chip.host_read(RESULT) == 1


@pytest.fixture
def flash():
    """Fast, so that the core and not the flash takes the time."""
    f = Flash()
    f.load(0, random.Random(1).randbytes(f.size))
    f.load(AREA, b"\xFF" * AREA_BYTES)
    f.times(30 * US, 300 * US)
    return f


def test_store_and_start_again(program, flash):
    """NV-001, NV-003, NV-006, NV-007: sets of one page and of the largest size over a start; only the area is written,
    no command is refused, and no step takes long."""
    flash.times(400 * US, 45 * MS)
    outside = flash.peek(0, AREA), flash.peek(AREA + AREA_BYTES, flash.size - AREA - AREA_BYTES)
    bench = Bench(program, flash)
    assert bench.state == EMPTY
    assert bench.store(7) == 1 and bench.store(8) == 1
    assert flash.counts()[1:] == (2, 1, 0)
    bench = Bench(program, flash)
    assert bench.state == LOADED and bench.holds(8) and not bench.holds(7)
    assert bench.chip.host_read(OPEN_US) < 10_000
    assert bench.store(9, 3200) == 1
    assert bench.chip.host_read(LONGEST_US) < 2_500 and bench.chip.host_read(STEPS) > 60
    bench = Bench(program, flash)
    assert bench.state == LOADED and bench.holds(9, 3200) and bench.chip.host_read(SEQUENCE) == 3
    assert bench.chip.host_read(OPEN_US) < 90_000
    assert outside == (flash.peek(0, AREA), flash.peek(AREA + AREA_BYTES, flash.size - AREA - AREA_BYTES))
    assert flash.counts()[3] == 0


@pytest.mark.parametrize("level", ["none", "nonsense"])
def test_without_a_flash(program, flash, level):
    """NV-005: nothing on the pins, or a flash full of anything: the chip starts, and says so."""
    flash.load(AREA, random.Random(2).randbytes(AREA_BYTES))
    bench = Bench(program, flash if level == "nonsense" else None)
    assert bench.state == (CORRUPT if level == "nonsense" else ABSENT)
    assert bench.chip.host_read(OPEN_US) < 300_000
    if level == "nonsense":
        assert bench.store(3) == 1


@pytest.mark.parametrize("situation", ["append", "new sector"])
def test_power_cut(program, flash, situation):
    """NV-002, NV-008: power fails at sampled bytes on the pins, in erase, check, program and read-back: the old or the
    new set is there after a start, and the next store works."""
    dice = random.Random(situation)
    bench = Bench(program, flash)
    assert bench.store(1) == 1
    before = flash.counts()[0]
    if situation == "new sector":
        bench = Bench(program, flash)
        before = flash.counts()[0]
    assert bench.store(2, 200) == 1
    length = flash.counts()[0] - before
    old, found = (2, 200), set()
    for n in sorted(dice.sample(range(1, length), 6)) + [5, 6, length - 1, length - 300]:
        seed = 1000 + n
        bench = Bench(program, flash)
        assert bench.holds(*old)
        if situation == "append":
            assert bench.store(seed - 1) == 1
            old = (seed - 1, 0)
        flash.cut_after(n, seed=n)
        done = bench.store(seed, 200)
        bench = Bench(program, flash)
        assert bench.state == LOADED
        is_new = bench.holds(seed, 200)
        assert is_new or (done is None and bench.holds(*old)), f"cut after {n} bytes"
        found.add(is_new)
        if is_new:
            old = (seed, 200)
    assert found == {True, False}
