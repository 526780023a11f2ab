# SPDX-License-Identifier: Apache-2.0
"""Permanent storage (asi_store.c), its flash driver and the application's glue, on the JEDEC flash model."""
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from native_store import load

ABSENT, EMPTY, LOADED, CORRUPT = range(4)
OK, E_ARG, E_BUSY, E_OVERFLOW, E_STORE = 0, -1, -3, -18, -25
AREA, SECTOR, SECTORS, PAGE = 32768, 4096, 16, 256
OPAQUE = 3200
SMALL, TWO_PAGES = 0, 200  # opaque bytes of sets of one and two pages


class Store:
    def __init__(self):
        self.ffi, self.lib = load()
        self.flash = self.lib.st_new()
        self.start()

    def start(self):
        self.lib.st_start()
        return self.now

    @property
    def now(self):
        state = self.ffi.new("st_state *")
        self.lib.st_read(state)
        return state

    def store(self, seed, opaque=SMALL):
        """Must succeed."""
        assert self.lib.st_store(seed, opaque) == 1

    def holds(self, seed, opaque=SMALL):
        """After a restart."""
        self.start()
        return self.lib.st_loaded(seed, opaque) == 1

    def cut(self, count, seed=1):
        self.lib.asi_flash_cut_after(self.flash, count, seed)

    def area(self):
        out = self.ffi.new("uint8_t[]", SECTOR * SECTORS)
        assert self.lib.asi_flash_peek(self.flash, AREA, out, len(out)) == 0
        return bytearray(out)

    def set_area(self, data):
        assert self.lib.asi_flash_load(self.flash, AREA, bytes(data), len(data)) == 0

    def erases(self):
        return [self.lib.asi_flash_erases(self.flash, AREA + SECTOR * k) for k in range(SECTORS)]


@pytest.fixture
def s():
    return Store()


# ---------------------------------------------------------------- contents
@pytest.mark.parametrize("opaque", [0, 1, 64, 65, 69, 70, 3000, OPAQUE])
def test_what_survives(s, opaque):
    """NV-001, NV-003: LPS, PCD, PP, mode, addressing, data exchange, auto clear and the host's block, every length."""
    for seed in range(1, 6):
        s.store(seed, opaque)
        assert s.now.sequence == seed and s.holds(seed, opaque) and not s.lib.st_loaded(seed + 1, opaque)
        assert s.now.state == LOADED and s.now.saved and s.now.sequence == seed


def test_bytes_in_flash(s):
    """NV-001, NV-003: the format as docs/storage.md has it, read by the book; host byte order does not matter."""
    s.store(77, 3)
    s.start()
    record, f = s.area()[:PAGE], lambda name, k=0: s.lib.st_field(name.encode(), k)
    assert record[:8] == b"ASIP" + (1).to_bytes(4, "little")
    assert record[8:12] == (171 + 3).to_bytes(2, "little") + b"\x01\x00"
    payload = record[16:16 + 174]
    assert payload[:8] == f("lps").to_bytes(4, "little") + f("lps", 1).to_bytes(4, "little")
    assert payload[8:136] == b"".join(f("pcd", k).to_bytes(2, "little") for k in range(64))
    assert payload[136:168] == bytes(f("pp", 2 * k) | f("pp", 2 * k + 1) << 4 for k in range(32))
    flags = f("flags")
    assert payload[168] == flags & 7 | flags >> 3 << 4
    assert payload[169:171] == b"\x03\x00" and payload[171:] == bytes(f("opaque", k) for k in range(3))

    def crc(data, start):
        value = start
        for byte in data:
            value ^= byte
            for _ in range(8):
                value = value >> 1 ^ (0xEDB88320 if value & 1 else 0)
        return (value ^ 0xFFFF_FFFF).to_bytes(4, "little")
    assert record[12:16] == crc(record[:12], 0xFFFF_FFFF)
    assert record[190:194] == crc(record[:12] + payload, 0xFFFF_FFFF)  # address 0: the start value is its complement
    assert set(record[194:]) == {255}


@pytest.mark.parametrize("what", range(1, 6))
def test_wrong_sets_are_refused(s, what):
    """NV-001: slaves 0 and 32 projected, a parameter or auto clear mode out of range, a block too long: not stored."""
    s.store(1)
    s.lib.st_spoil(what)
    assert s.lib.st_begin(2, 0) == E_ARG and not s.now.busy and s.now.saved
    assert s.holds(1)


def test_one_at_a_time(s):
    """NV-006: a store under way is not disturbed by another; each step moves at most a page over SPI."""
    assert s.lib.st_begin(1, OPAQUE) == OK and s.now.busy
    assert s.lib.st_begin(2, 0) == E_BUSY
    while s.lib.st_serve(0):
        pass
    assert s.now.saved and s.now.longest_step <= PAGE + 8 * 4  # page, command and address of eight reads
    assert s.now.steps < 180
    assert s.holds(1, OPAQUE)


# ---------------------------------------------------------------- power cuts
def restarted(s):
    s.store(1)
    s.start()
    return (1, SMALL), (2, SMALL)


def append(s):
    s.store(1)
    return (1, SMALL), (2, TWO_PAGES)


def last_page(s):
    for seed in range(1, 16):
        s.store(seed)
    assert s.now.newest == 14 * PAGE
    return (15, SMALL), (16, SMALL)


def sector_change(s):
    last_page(s)
    return (15, SMALL), (16, TWO_PAGES)


def ring_wrap(s):
    for seed in range(1, 17):
        s.store(seed)
        s.start()
    assert s.now.newest == 15 * SECTOR
    return (16, SMALL), (17, SMALL)


def torn_record(s):
    s.store(1, TWO_PAGES)
    s.cut(400)  # in its second page
    assert s.lib.st_store(2, TWO_PAGES) == -1
    assert not s.holds(2, TWO_PAGES)
    return (1, TWO_PAGES), (3, SMALL)


def torn_erase(s):
    s.store(1)
    s.start()
    s.cut(8, seed=5)
    assert s.lib.st_store(2, SMALL) == -1
    assert s.holds(1)
    return (1, SMALL), (3, SMALL)


def worn_sectors(s):
    s.store(1)
    s.start()
    s.lib.asi_flash_worn(s.flash, AREA + SECTOR, 1)
    s.lib.asi_flash_worn(s.flash, AREA + 2 * SECTOR, 2)
    return (1, SMALL), (2, SMALL)


def largest(s):
    s.store(1, OPAQUE)
    return (1, OPAQUE), (2, OPAQUE)


SITUATIONS = {f.__name__: f for f in (restarted, append, last_page, sector_change, ring_wrap, torn_record, torn_erase,
                                      worn_sectors, largest)}


def every_cut(s, old, new):
    result = s.ffi.new("st_cuts_result *")
    s.lib.st_cuts(*old, *new, 1, 1, 7, result)
    assert result.reason == 0, f"cut after {result.at} bytes: reason {result.reason}"
    assert result.was_old + result.was_new == result.cuts
    return result


def test_cut_of_the_first_store(s):
    """NV-002, NV-007, NV-008: power fails after any byte of the very first store: nothing or all is stored."""
    result = every_cut(s, (0, 0), (1, 64))
    assert result.was_old > 4096 and result.was_new > 0


@pytest.mark.parametrize("situation", SITUATIONS)
def test_cut_at_every_byte(s, situation):
    """NV-002, NV-003, NV-007: power fails after each single byte of a store, whatever the situation: the old or the new
    set is there, whole; after a second cut in the next store too; the next one works; nothing outside is written."""
    old, new = SITUATIONS[situation](s)
    result = every_cut(s, old, new)
    assert result.was_old > 200 and result.was_new > 0


# ---------------------------------------------------------------- wear
def test_wear(s):
    """NV-004: sets are appended, sectors erased in turn, one set a start at worst."""
    dice = random.Random(1)
    sizes = [dice.choice([0, 0, 0, 500, 1500]) for _ in range(120)]
    for seed, opaque in enumerate(sizes, 1):
        s.store(seed, opaque)
        if dice.random() < 0.2:
            assert s.holds(seed, opaque)
    erases = s.erases()
    assert max(erases) - min(erases) <= 1 and sum(erases) < 60
    before = sum(erases)
    for seed in range(1, 161):  # sixteen a sector
        s.store(seed)
    assert sum(s.erases()) - before in (10, 11)
    assert max(s.erases()) - min(s.erases()) <= 1


@pytest.mark.parametrize("kind", [1, 2])
def test_worn_sectors_are_skipped(s, kind):
    """NV-004: a sector that does not erase or does not take data is passed over; the set lands in the next."""
    s.lib.asi_flash_worn(s.flash, AREA + SECTOR, kind)
    s.lib.asi_flash_worn(s.flash, AREA + 3 * SECTOR, kind)
    for seed in range(1, 40):
        s.store(seed, OPAQUE)
        assert s.holds(seed, OPAQUE) and s.now.newest // SECTOR not in (1, 3)


def test_worn_out(s):
    """NV-004, NV-005: when four sectors in a row fail the store has failed, what was stored is still there, and the
    next request goes on behind them."""
    s.store(1)
    s.start()
    for k in range(1, 6):
        s.lib.asi_flash_worn(s.flash, AREA + k * SECTOR, 1)
    assert s.lib.st_store(2, OPAQUE) == 0 and s.now.failed and not s.now.saved and not s.now.busy
    s.store(3)
    assert s.now.newest == 6 * SECTOR and not s.now.failed and s.holds(3)
    for k in range(SECTORS):
        s.lib.asi_flash_worn(s.flash, AREA + k * SECTOR, 2)
    for seed in range(4, 12):
        assert s.lib.st_store(seed, 0) == 0
    assert s.holds(3) and s.erases()[6] == 1


def test_newest_sector_is_never_erased(s):
    """NV-002, NV-004: all sectors but the one of the newest set fail: it is passed over each time round."""
    s.store(1)
    s.start()
    for k in range(1, SECTORS):
        s.lib.asi_flash_worn(s.flash, AREA + k * SECTOR, 1)
    for seed in range(2, 14):
        assert s.lib.st_store(seed, OPAQUE) == 0
    assert s.erases()[0] == 1 and s.holds(1)


# ---------------------------------------------------------------- flash that is missing or does not come back
@pytest.mark.parametrize("level,state", [(1, ABSENT), (2, ABSENT), (3, CORRUPT)])
def test_no_flash(s, level, state):
    """NV-005: no flash, data pin stuck or nonsense: the start ends, within half a second, and a store is refused or
    fails."""
    s.store(1)
    s.lib.st_absent(level)
    assert s.start().state == state and s.lib.st_time_us() < 700_000
    if state == ABSENT:
        assert s.lib.st_time_us() < 1_000 and s.lib.st_begin(2, 0) == E_STORE and not s.now.busy
    else:
        assert s.lib.st_begin(2, 0) == OK
        for _ in range(20_000):
            if not s.lib.st_serve(1_000):
                break
        assert s.now.failed
    s.lib.st_absent(0)
    assert s.holds(1) or state == CORRUPT  # what cannot be read may be erased for a new set


def test_erase_without_end(s):
    """NV-005, NV-006: a program or erase that does not end is given up; later all works again."""
    for program, erase in ((3_000, 10**11), (10**11, 6_000)):
        s.start()
        s.lib.asi_flash_times(s.flash, program, erase)
        start = s.lib.st_time_us()
        assert s.lib.st_begin(2, 0) == OK
        while s.lib.st_serve(1_000):
            assert s.lib.st_time_us() - start < 13_000_000  # four sectors, 3 s each
        assert s.now.failed
        s.lib.asi_flash_times(s.flash, 3_000, 6_000)
    s.start()
    s.store(3)
    assert s.holds(3)


def test_reset_during_an_erase(s):
    """NV-005: the chip alone was reset while its flash erases: the start waits for that, and finds the set."""
    s.store(1)
    s.start()
    s.lib.asi_flash_times(s.flash, 3_000, 100_000_000)
    assert s.lib.st_begin(2, OPAQUE) == OK
    s.lib.st_serve(0)
    s.lib.st_reset()
    assert s.now.state == LOADED and s.lib.st_loaded(1, SMALL) and 90_000 < s.lib.st_time_us() < 200_000


# ---------------------------------------------------------------- spoilt contents
def filled(s):
    """A flash with sets in several sectors -> [(seed, opaque, first byte, bytes)] in order of their sequence"""
    sets = []
    for seed, opaque in enumerate([0, 200, 0, 3000, 500, 0, 0, 1500], 1):
        s.store(seed, opaque)
        sets.append((seed, opaque, s.now.newest, 191 + opaque))
        if seed % 3 == 0:
            s.start()
    return sets


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 7), st.one_of(st.integers(0, 15), st.integers(0, 3699)), st.integers(1, 255)),
                max_size=20))
def test_spoilt_records(flips):
    """NV-003, NV-005: the newest record without a wrong bit wins, whatever is spoilt elsewhere; a store works."""
    s = Store()
    sets = filled(s)
    area, spoilt = s.area(), set()
    for record, offset, bits in flips:
        _, _, at, size = sets[record]
        area[at + offset % size] ^= bits
    whole = s.area()
    spoilt = {k for k, (_, _, at, size) in enumerate(sets) if area[at:at + size] != whole[at:at + size]}
    s.set_area(area)
    s.start()
    good = [k for k in range(len(sets)) if k not in spoilt]
    if good:
        assert s.now.state == LOADED and s.lib.st_loaded(*sets[good[-1]][:2])
    else:
        assert s.now.state == CORRUPT
    s.store(99, 300)
    assert s.holds(99, 300)


@pytest.mark.parametrize("byte,bits", [(0, 1), (4, 1), (8, 1), (9, 2), (10, 1), (12, 1)])
def test_spoilt_header(s, byte, bits):
    """NV-003: a record whose header is wrong, its length too, does not hide the newer one behind it."""
    s.store(1)
    s.store(2)
    area = s.area()
    area[byte] ^= bits
    s.set_area(area)
    assert s.holds(2)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from([0, 1, 8, 30]), st.booleans())
def test_random_flash(seed, density, blocks):
    """NV-005: anything at all in flash: the start ends soon, gives no set that was never stored, and a store works."""
    s = Store()
    dice = random.Random(seed)
    sets = filled(s) if density else []
    area = s.area() if density else bytearray(dice.randbytes(SECTOR * SECTORS))
    for _ in range(density):
        at = dice.randrange(len(area))
        n = dice.randrange(1, 3000) if blocks else 1
        area[at:at + n] = dice.randbytes(len(area[at:at + n]))
    for k in range(dice.randrange(4)):  # whole sectors moved: copies of records in wrong places
        a, b = (SECTOR * dice.randrange(SECTORS) for _ in range(2))
        area[a:a + SECTOR] = area[b:b + SECTOR]
    s.set_area(area)
    s.start()
    assert s.lib.st_time_us() < 1_500_000
    if s.now.state == LOADED:
        assert any(s.lib.st_loaded(*one[:2]) for one in sets)
    s.store(99, 300)
    assert s.holds(99, 300)


def test_all_spoilt_ends_soon(s):
    """NV-005: 240 sets, all spoilt, is the longest search: it gives up after ASI_STORE_CANDIDATES of them."""
    for seed in range(1, 241):
        s.store(seed)
    area = s.area()
    for at in range(0, len(area), PAGE):
        area[at + 100] ^= 1
    s.set_area(area)
    s.start()
    assert s.now.state == CORRUPT and s.lib.st_time_us() < 100_000
    s.store(300)
    assert s.holds(300) and s.now.sequence == 241


def test_record_inside_the_host_block(s):
    """NV-003: a record copied to another place, as a host may keep one in its block, is not taken for one."""
    s.store(1)
    s.start()
    s.store(2)
    area = s.area()
    area[PAGE:2 * PAGE] = area[SECTOR:SECTOR + PAGE]
    area[SECTOR] ^= 1
    s.set_area(area)
    assert s.holds(1)


def test_sequence_wraps(s):
    """NV-003: sequence numbers pass 2^32 without a set being lost; 0 stays the number of no set."""
    s.lib.st_set_sequence(2**32 - 6)
    seen = []
    for seed in range(1, 12):
        s.store(seed)
        seen.append(s.now.sequence)
        if seed % 2:
            assert s.holds(seed)
    assert seen == [2**32 - 5 + k if k < 5 else k - 4 for k in range(11)]


def test_equal_sequence(s):
    """NV-002, NV-003: an attempt that a cut spoilt, with cells in doubt, and the next one with the same number: should
    the spoilt one read as whole one day, the later one wins still."""
    s.store(1)
    early = s.area()
    s.store(2)            # appended: number 2; a cut leaves it in doubt
    lucky = s.area()
    s.set_area(early)
    s.start()
    s.store(3)            # number 2 again, in the next sector
    assert s.now.sequence == 2 and s.now.newest == SECTOR
    area = s.area()
    area[:SECTOR] = lucky[:SECTOR]
    s.set_area(area)
    assert s.holds(3)


# ---------------------------------------------------------------- the application's glue
def word(s):
    w = s.lib.st_persist_word()
    return w & 15, w >> 4 & 7, w >> 16  # state; busy 1, failed 2, saved 4; sequence


BUSY, FAILED, SAVED = 1, 2, 4


def test_defaults(s):
    """NV-005, NV-009: empty flash: configuration mode, data exchange on, no automatic addressing, nothing projected."""
    assert s.lib.st_persist_open() == 1 and word(s) == (EMPTY, 0, 0)
    s.lib.st_persist_serve(50)
    assert word(s) == (EMPTY, 0, 0) and s.lib.st_persist_ended() == 1 and sum(s.erases()) == 0
    s.lib.st_absent(1)
    assert s.lib.st_persist_open() == 1 and word(s) == (ABSENT, 0, 0)


def test_request(s):
    """NV-001, NV-006, NV-009: a request is stored step by step and in use after the next start; equal data is not
    stored again."""
    s.lib.st_persist_open()
    s.lib.st_persist_request(5)
    assert word(s) == (EMPTY, BUSY, 0)
    s.lib.st_persist_serve(2)
    assert word(s) == (EMPTY, BUSY, 0) and s.lib.st_persist_ended() == 1
    s.lib.st_persist_serve(100)
    assert word(s) == (EMPTY, SAVED, 1) and s.lib.st_persist_ended() == OK and s.lib.st_persist_ended() == 1
    programs, start = s.area(), s.erases()
    for _ in range(3):
        s.lib.st_persist_request(5)
        assert word(s) == (EMPTY, SAVED, 1)
        s.lib.st_persist_serve(50)
    assert s.area() == programs and s.erases() == start and s.lib.st_persist_ended() == 1
    assert s.lib.st_persist_open() == 0 and s.lib.st_persist_is(5) == 1 and word(s) == (LOADED, SAVED, 1)
    s.lib.st_persist_request(5)
    s.lib.st_persist_serve(100)
    assert s.area() == programs and word(s) == (LOADED, SAVED, 1)
    s.lib.st_persist_request(6)
    s.lib.st_persist_serve(100)
    assert word(s) == (LOADED, SAVED, 2)


def test_newest_request_waits(s):
    """NV-006: requests during a store: the newest is stored after it, those between are not."""
    s.lib.st_persist_open()
    s.lib.st_persist_request(5)
    s.lib.st_persist_serve(5)
    for seed in (6, 7, 5):
        s.lib.st_persist_request(seed)
    s.lib.st_persist_serve(100)
    assert word(s) == (EMPTY, SAVED, 1)
    s.lib.st_persist_request(6)
    s.lib.st_persist_serve(3)
    for seed in (7, 8):
        s.lib.st_persist_request(seed)
    s.lib.st_persist_serve(100)
    assert word(s) == (EMPTY, SAVED, 3)
    s.lib.st_persist_open()
    assert s.lib.st_persist_is(8) == 1


def test_failed_request(s):
    """NV-005, NV-006: without a flash, or with one that is worn out, a request ends as failed; it is tried again only
    with the next request, an equal one too."""
    s.lib.st_absent(1)
    s.lib.st_persist_open()
    s.lib.st_persist_request(5)
    s.lib.st_persist_serve(10)
    assert word(s) == (ABSENT, FAILED, 0) and s.lib.st_persist_ended() == E_STORE
    s.lib.st_absent(0)
    for k in range(SECTORS):
        s.lib.asi_flash_worn(s.flash, AREA + k * SECTOR, 1)
    s.lib.st_persist_open()
    assert word(s) == (EMPTY, 0, 0)
    s.lib.st_persist_request(5)
    s.lib.st_persist_serve(200)
    assert word(s) == (EMPTY, FAILED, 0) and s.lib.st_persist_ended() == E_STORE
    erases = sum(s.erases())
    s.lib.st_persist_serve(200)
    assert sum(s.erases()) == erases == 4
    for k in range(SECTORS):
        s.lib.asi_flash_worn(s.flash, AREA + k * SECTOR, 0)
    s.lib.st_persist_request(5)
    s.lib.st_persist_serve(200)
    assert word(s) == (EMPTY, SAVED, 2) and s.lib.st_persist_ended() == OK


def test_host_block(s):
    """NV-001, NV-006: the host's own block is stored with the rest, an equal one not again; too long or too early is
    refused."""
    s.lib.st_persist_open()
    assert s.lib.st_persist_opaque_is(1, 0) and s.lib.st_persist_opaque_set(1, OPAQUE + 1) == E_OVERFLOW
    s.lib.st_persist_request(5)
    s.lib.st_persist_serve(5)
    assert s.lib.st_persist_opaque_set(9, 700) == E_BUSY
    s.lib.st_persist_serve(100)
    assert s.lib.st_persist_opaque_set(9, 700) == OK and word(s) == (EMPTY, BUSY, 1)
    s.lib.st_persist_serve(100)
    assert word(s) == (EMPTY, SAVED, 2) and s.lib.st_persist_opaque_set(9, 700) == OK
    s.lib.st_persist_serve(100)
    assert word(s) == (EMPTY, SAVED, 2)
    s.lib.st_persist_open()
    assert s.lib.st_persist_is(5) and s.lib.st_persist_opaque_is(9, 700)
    s.lib.st_persist_request(6)
    s.lib.st_persist_serve(100)
    s.lib.st_persist_open()
    assert s.lib.st_persist_is(6) and s.lib.st_persist_opaque_is(9, 700)
    assert s.lib.st_persist_opaque_set(9, 699) == OK
    s.lib.st_persist_serve(100)
    s.lib.st_persist_open()
    assert s.lib.st_persist_is(6) and s.lib.st_persist_opaque_is(9, 699) and not s.lib.st_persist_opaque_is(9, 700)
