# SPDX-License-Identifier: Apache-2.0
"""The firmware image itself on the soft core (VexRiscv Min, Verilated): start-up, HAL, interrupt, host window, boot."""
import sys

import pytest
from fake_chip import Chip, image, load
from fake_line import SETTLE_US, Slave
from native import ROOT

sys.path.insert(0, str(ROOT / "tools"))
import elf2hex  # noqa: E402

CLOCKS_PER_US = 16
NETWORK = [Slave(1, inputs=5), Slave(2, id=0xA, io=7, inputs=9), Slave(34, id=0xA, io=4, inputs=3)]


def network():
    return [Slave(s.index, io=s.io, id=s.id, inputs=s.inputs) for s in NETWORK]


def full_network():
    return [Slave(i, id=0xA, io=i & 15, inputs=i & 15) for i in (*range(1, 32), *range(33, 64))]


def test_magic_comes_last():
    """HW-001: from random memory; when MAGIC appears all else has its first value, and nothing changes after it."""
    chip = Chip(network())
    for _ in range(200_000):
        if chip.read("MAGIC") == 0x4D495341:
            break
        chip.lib.soc_clocks(1)
    window = [chip.window[k] for k in range(0x2C0 // 4)]
    assert chip.read("VERSION") == 0x00020000 and chip.read("HOST_CTRL") == 4 and chip.list("LPS_CFG") == set()
    assert chip.item("CDI", 63, 2) == chip.item("PCD", 0, 2) == 0xFFFF and chip.item("PP", 7, 1) == 15
    assert chip.read("PHASE") == 0 and chip.read("HOST_SEQ") == chip.read("FW_SEQ") == 0
    chip.run()
    assert window == [chip.window[k] for k in range(0x2C0 // 4)] and chip.r.clocks < 200_000


def test_start_up():
    """EX-003, EX-004, EX-008, HW-004: an image with a short settle time brings the network up and shows it."""
    chip = Chip(network()).start()
    for _ in range(2):
        chip.cycle()
    assert chip.list("LDS") == chip.list("LAS") == {1, 2, 34} and chip.list("LPS") == set()
    assert [chip.item("CDI", s.index, 2) for s in NETWORK] == [s.codes for s in NETWORK]
    assert [chip.nibble("IN_IMG", i) for i in (1, 2, 34, 3)] == [5, 9, 3, 0]
    assert chip.read("FLAGS") == 0b1_0011_0000 and chip.item("PECHO", 1, 1) == 15
    assert chip.read("CYCLES") == 3 and chip.read("SENT") == len(chip.log) and chip.read("TIME_US") > 20_000
    assert chip.item("CDI", 3, 2) == 0xFFFF


def test_product_settle_time():
    """EX-003: the product image sends nothing for P_PWR_SETTLE, the first batch soon after."""
    chip = Chip(network(), firmware="asi").run()
    while not chip.r.batches:
        assert chip.log == []
        chip.tick()
    assert SETTLE_US <= chip.r.skipped_us + chip.r.clocks // CLOCKS_PER_US < SETTLE_US + 20_000


def test_outputs_and_inputs():
    """CA-001, CA-005, HW-003, HW-004: outputs reach the slaves inverted, changed inputs the host; one IRQ a cycle."""
    chip = Chip(network()).start()
    chip.write("OUT_IMG", 0b0101 << 8 | 0b0110 << 4)
    chip.write("OUT_IMG", 0b0001 << 8, 4)
    for _ in range(4):
        chip.slaves[0].inputs = (chip.slaves[0].inputs + 3) & 15
        irqs, seq = chip.r.host_irqs, chip.read("IN_SEQ")
        chip.cycle()
        assert chip.r.host_irqs == irqs + 1 and chip.read("IN_SEQ") == seq + 2 and seq % 2 == 0
        assert chip.nibble("IN_IMG", 1) == chip.slaves[0].inputs
    assert [s.outputs for s in chip.slaves] == [0b1001, 0b010, 0b110]
    assert chip.r.ctrl & 4 == 0


def test_commit():
    """HW-002, EX-009, EX-016, EX-023: a commit is applied as a whole, passes through OFFLINE, and is acknowledged."""
    chip = Chip(network()).start()
    for s in chip.slaves[:2]:
        chip.put("PCD", s.index, 2, s.codes)
    chip.write("LPS_CFG", 0b110)
    assert chip.commit(protected_mode=1, auto_address_enable=1) == 0
    assert chip.read("PHASE") == 0 and chip.list("LPS") == {1, 2}
    chip.until(lambda: chip.read("PHASE") == 3)
    assert chip.list("LAS") == {1, 2} and chip.list("LDS") == {1, 2, 34} and chip.read("FLAGS") & 0b11101 == 0
    chip.slaves.pop()
    chip.until(lambda: chip.list("LDS") == {1, 2})
    assert chip.read("FLAGS") & 0b11101 == 0b00101  # Config_OK, Auto_Address_Assign


@pytest.mark.parametrize("change", [{"LPS_CFG": 1}, {"PP": 16}, {"raw": 0x80}])
def test_refused_commit(change):
    """HW-002, EX-025: a bad commit is acknowledged with its error and changes nothing; the next good one works."""
    chip = Chip(network()).start()
    chip.cycle()
    before = [chip.list(n) for n in ("LDS", "LAS", "LPS")], chip.read("FLAGS"), chip.read("PHASE")
    if "LPS_CFG" in change:
        chip.write("LPS_CFG", 0b11)
    if "PP" in change:
        chip.put("PP", 5, 1, change["PP"])
    assert chip.commit(protected_mode=1, raw=change.get("raw", 0)) == -1
    chip.cycle()
    assert ([chip.list(n) for n in ("LDS", "LAS", "LPS")], chip.read("FLAGS"), chip.read("PHASE")) == before
    chip.write("LPS_CFG", 0b10)
    chip.put("PP", 5, 1, 15)
    assert chip.commit() == 0
    chip.cycle()
    assert chip.list("LPS") == {1}


def test_commit_is_applied_once():
    """HW-002: without a new HOST_SEQ nothing is taken over; a commit during a commit is seen as well."""
    chip = Chip(network()).start()
    chip.write("LPS_CFG", 0b10)
    for _ in range(3):
        chip.cycle()
    assert chip.list("LPS") == set() and chip.read("FW_SEQ") == 0
    chip.write("HOST_SEQ", 1)
    chip.r.event |= 1 << 5
    chip.lib.soc_clocks(2_500)  # the firmware is copying PCD and PP
    assert chip.read("FW_SEQ") == 0
    chip.write("LPS_CFG", 0b110)
    chip.write("HOST_SEQ", 2)
    chip.r.event |= 1 << 5
    chip.run()
    chip.cycle()
    assert chip.read("FW_SEQ") == 2 and chip.list("LPS") == {1, 2} and chip.read("FW_RESULT") == 0


def test_commit_while_cycles_never_wait():
    """HW-002, HW-004: cycles that end faster than they are served (one slave, 8 MHz) cannot keep a commit out, and
    are still published."""
    chip = Chip(network()[:1]).start()
    chip.write("LPS_CFG", 0b10)
    chip.write("HOST_SEQ", 1)
    chip.r.event |= 1 << 5
    irqs = chip.r.host_irqs
    for _ in range(200):
        chip.r.event |= 1
        chip.lib.soc_clocks(250)
    assert chip.read("FW_SEQ") == 1 and chip.list("LPS") == {1} and chip.r.host_irqs - irqs > 10


def test_parameters_from_commit_before_start():
    """EX-002, CA-002: PP committed before the settle time is over becomes PI and reaches the slave."""
    chip = Chip(network()).run()
    chip.put("PP", 1, 1, 6)
    assert chip.commit() == 0
    chip.until(lambda: chip.read("PHASE") == 3)
    chip.cycle()
    assert chip.item("PI", 1, 1) == 6 and chip.slaves[0].parameter == 6 and chip.item("PECHO", 1, 1) == 6


def test_slave_comes_and_goes():
    """EX-012, EX-013, EX-015, CA-006, HW-004: a lost slave leaves the window, a new one enters it, through the HAL."""
    chip = Chip(network()).start()
    gone = chip.slaves.pop(0)
    chip.until(lambda: 1 not in chip.list("LDS"), 6)
    assert chip.list("LAS") == {2, 34} and chip.item("CDI", 1, 2) == 0xFFFF and chip.nibble("IN_IMG", 1) == 0
    gone.power_up()
    chip.slaves.append(gone)
    chip.until(lambda: 1 in chip.list("LAS"), 120)
    chip.cycle()
    assert chip.nibble("IN_IMG", 1) == 5 and chip.item("CDI", 1, 2) == gone.codes


def test_inputs_of_an_earlier_activation():
    """CA-006, EX-009, LK-005: a slave that the projection put out and lets in again never shows its old inputs; its
    neighbours in the image keep theirs."""
    chip = Chip(network() + [Slave(3, inputs=6)]).start()
    for s in chip.slaves:
        chip.put("PCD", s.index, 2, s.codes)
    chip.write("LPS_CFG", 0b1110)
    chip.write("LPS_CFG", 0b100, 1)
    assert chip.commit(protected_mode=1) == 0
    chip.until(lambda: chip.nibble("IN_IMG", 1) == 5)
    chip.write("LPS_CFG", 0b1100)
    assert chip.commit(protected_mode=1) == 0
    assert chip.list("LAS") == {2, 3, 34}
    for _ in range(5):
        chip.cycle()
    chip.slaves[0].inputs = 9
    chip.write("LPS_CFG", 0b1110)
    assert chip.commit(protected_mode=1) == 0
    seen = []
    while len(seen) < 500 and seen[-1:] != [9]:
        chip.cycle()
        seen.append(chip.nibble("IN_IMG", 1))
        assert [chip.nibble("IN_IMG", i) for i in (2, 3, 34)] == [9, 6, 3]
    assert set(seen) == {0, 9}


@pytest.mark.parametrize("phase", [1, 3])
def test_power_fail(phase):
    """EX-001, EX-021, HW-004: APF stops the line at once and shows; the line comes back afterwards."""
    chip = Chip(network()).run()
    chip.until(lambda: chip.read("PHASE") == phase)
    chip.power(True)
    assert chip.read("PHASE") == chip.r.exec == 0 and chip.r.ctrl == 0 and chip.read("FLAGS") & 0x60 == 0x40
    assert chip.list("LDS") == set() and chip.nibble("IN_IMG", 1) == 0
    irqs = chip.r.host_irqs
    for _ in range(5):
        chip.step()
    assert chip.read("FLAGS") & 0x80 and chip.r.host_irqs == irqs + 1  # Offline_Ready, shown once
    for s in chip.slaves:
        s.power_up()
    chip.power(False)
    chip.until(lambda: chip.list("LAS") == {1, 2, 34}, 30)


def test_offline_and_back():
    """EX-001, EX-003: the host's offline request holds the line quiet; the outputs are F; the same slaves come back."""
    chip = Chip(network()).start()
    chip.write("OUT_IMG", 0xFFFFFFFF)
    for _ in range(3):
        chip.cycle()
    assert chip.commit(offline=1) == 0
    sent = len(chip.log)
    for _ in range(10):
        chip.step()
    assert len(chip.log) == sent and chip.read("FLAGS") & 0xA0 == 0x80
    assert all(chip.link[0x300 // 4 + w] == 0xFFFFFFFF for w in range(8))
    assert chip.commit() == 0
    chip.until(lambda: chip.list("LAS") == {1, 2, 34}, 30)


def test_data_exchange_off():
    """EX-024: data exchange off: the slaves are asked for their ID codes and IDI is 0; on again: activated anew."""
    chip = Chip(network()).start()
    chip.write("OUT_IMG", 0xFFFFFFFF)
    for _ in range(3):
        chip.cycle()
    assert chip.slaves[0].outputs == 0 and chip.nibble("IN_IMG", 1) == 5
    assert chip.commit(data_exchange=0) == 0
    chip.cycle()
    start = len(chip.log)
    for _ in range(3):
        chip.cycle()
    assert not any(c >> 10 == 0 for c, *_ in chip.log[start:]) and chip.slaves[0].heard["RDID"] >= 3
    assert chip.nibble("IN_IMG", 1) == 0 and chip.read("PHASE") == 3
    chip.slaves[0].power_up()  # its watchdog
    assert chip.commit() == 0
    chip.until(lambda: chip.slaves[0].outputs == 0, 20)
    assert chip.nibble("IN_IMG", 1) == 5 and 1 in chip.list("LAS")


@pytest.mark.parametrize("stop", ["offline", "power", "data_exchange"])
def test_first_cycle_sends_present_outputs(stop):
    """LK-006, EX-001, EX-024: outputs that the host took back while nothing was exchanged are never sent again, not
    even in the first cycle."""
    chip = Chip(network()).start()
    chip.write("OUT_IMG", 0xFFFFFFFF)
    for _ in range(3):
        chip.cycle()
    assert chip.slaves[0].outputs == 0
    if stop == "power":
        chip.power(True)
    else:
        assert chip.commit(offline=stop == "offline", data_exchange=stop != "data_exchange") == 0
    for _ in range(3):
        chip.step()
    chip.log.clear()
    chip.write("OUT_IMG", 0)
    if stop == "power":
        chip.power(False)
    else:
        assert chip.commit() == 0
    chip.until(lambda: sum(call >> 4 == 1 << 1 for call, *_ in chip.log) > 4)  # DEXG to slave 1
    assert {call & 15 for call, *_ in chip.log if call >> 4 == 1 << 1} == {15}


def awake(chip, steps):
    """Longest time awake in so many steps, us at 16 MHz."""
    chip.r.awake_max = 0
    for _ in range(steps):
        chip.step()
    return chip.r.awake_max / CLOCKS_PER_US


def test_time_budget():
    """HW-004, LK-013: the core is asleep again before the next cycle ends, at 16 MHz: with one slave (308 us), with 62
    (4.9 ms); a mode change, a detection and the loss of all 62 slaves at once take no longer than 5.6 ms each."""
    one = awake(Chip(network()[:1]).start(), 100)
    full = Chip(full_network()).start()
    for _ in range(10):
        full.step()
    assert len(full.list("LAS")) == 62
    many = awake(full, 100)
    full.r.awake_max = 0
    assert full.commit(protected_mode=1) == 0
    commit = full.r.awake_max / CLOCKS_PER_US
    assert full.commit() == 0
    detection = awake(full, 12)
    assert full.read("PHASE") == 3 and len(full.list("LAS")) == 62
    full.slaves = []
    lost = awake(full, 8)
    assert full.list("LDS") == set()
    print(f"\nawake, us: cycle of one slave {one:.0f}, of 62 {many:.0f}; mode change {commit:.0f}, "
          f"detection {detection:.0f}, 62 lost {lost:.0f}")
    assert one < 308 and many < 400 and max(commit, detection, lost) < 5_600


def test_stack():
    """HW-002, EX-025: half of the 2 KB stack is never touched by 62 slaves, commits and a power fail; guard intact."""
    chip = Chip(full_network()).start()
    for _ in range(80):
        chip.step()
    chip.commit(protected_mode=1, auto_address_enable=1)
    chip.until(lambda: chip.read("PHASE") == 3)
    chip.power(True)
    chip.step()
    stack = [chip.lib.soc_ram()[k] for k in range(62 * 256, 64 * 256)]
    untouched = next(k for k, word in enumerate(stack) if k and word != 0xA5A5A5A5)
    print(f"\nstack: {4 * (512 - untouched)} of 2048 bytes used")
    assert stack[0] == 0x57AC6A4D and untouched > 256
    chip.lib.soc_ram()[62 * 256] = 0  # an overrun: the line goes quiet and the window is marked dead
    chip.r.event |= 1 << 4
    assert chip.lib.soc_run(20_000) == 0 and chip.read("MAGIC") == 0 and chip.r.ctrl == 0


def test_sequencer_never_waits_for_late_firmware():
    """EX-012, LK-013: two cycles per interrupt: no inclusion result is taken twice, a new slave still gets in."""
    chip = Chip(network()[:2]).start()
    chip.slaves.append(network()[2])
    run, chip.run = chip.run, lambda: chip
    for k in range(200):
        chip.cycle()
        if k % 2:
            run()
    assert chip.list("LAS") == {1, 2, 34}


def test_boot_from_flash():
    """HW-007: the boot ROM copies the image and starts it; header and sums are checked, and it tries again."""
    words = image("asi_test")
    flash = bytearray(elf2hex.flash_image(b"".join(w.to_bytes(4, "little") for w in words)))
    flash[40] ^= 1  # a flipped bit in the program
    chip = Chip(network(), flash=bytes(flash))
    for _ in range(60):
        chip.lib.soc_clocks(100_000)
        if chip.r.flash_selects >= 4:
            break
    assert chip.r.flash_selects >= 4 and chip.read("MAGIC") != 0x4D495341  # wake and read, twice
    chip.flash[40] ^= 1
    for _ in range(60):
        chip.lib.soc_clocks(100_000)
        if chip.read("MAGIC") == 0x4D495341:
            break
    assert [chip.lib.soc_ram()[k] for k in range(16)] == words[:16]
    chip.start()
    assert chip.list("LAS") == {1, 2, 34}


@pytest.mark.parametrize("position,value", [(0, 0), (4, 0), (5, 0xFF), (8, 1), (12, 1)])
def test_boot_refuses(position, value):
    """HW-007: wrong magic, no or too many words, wrong sums: never started."""
    flash = bytearray(elf2hex.flash_image(b"\x13\0\0\0" * 8 + b"\x6f\0\0\0"))
    if flash[position] == value:
        value ^= 0x55
    flash[position] = value
    if position == 4:
        assert flash[4:8] == b"\0\0\0\0"
    chip = Chip(flash=bytes(flash))
    for _ in range(10):
        chip.lib.soc_clocks(100_000)
    assert chip.r.flash_selects >= 4 and chip.r.bad_accesses == 0


def test_image_sizes():
    """HW-007: the boot program fits its 1 KB, the product image its RAM, and no variable has an initial value."""
    assert len(image("boot")) <= 256
    for name in ("asi", "asi_test"):
        base, data, used = elf2hex.load_elf((ROOT / f"build/firmware/{name}.elf").read_bytes()) if image(name) else None
        assert base == 0 and used <= 62 * 1024
    assert load()
