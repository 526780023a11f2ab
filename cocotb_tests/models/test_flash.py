# SPDX-License-Identifier: Apache-2.0
"""The two flash models: each rule of NV-008 on both, then random command streams on both at once."""
import pytest
from asi import native
from hypothesis import given, settings
from hypothesis import strategies as st

from cocotb_tests.models import flash as model

US, MS = 1_000, 1_000_000
SIZE = 1 << 16


class Bus:
    """Frames to one model, half a microsecond a byte."""

    def __init__(self, flash, awake=True):
        self.flash, self.t = flash, 0
        if awake:
            self.frame(model.WAKE)
            self.t += model.WAKE_NS

    def frame(self, *out):
        """-> bytes that came back"""
        self.flash.select(self.t, True)
        back = []
        for value in out:
            back.append(self.flash.byte(self.t, value))
            self.t += 500
        self.flash.select(self.t, False)
        return back

    def at(self, command, address, *data):
        return self.frame(command, address >> 16 & 255, address >> 8 & 255, address & 255, *data)[4:]

    def read(self, address, count):
        return self.at(model.READ, address, *bytes(count))

    def status(self):
        return self.frame(model.STATUS, 0)[1]

    def write(self, *frame):
        self.frame(model.WRITE_ENABLE)
        self.at(*frame)

    def wait(self):
        """-> ns until not busy"""
        start = self.t
        while self.status() & 1:
            self.t += 10 * US
        return self.t - start


@pytest.fixture(params=[native.Flash, model.Flash], ids=["native", "python"])
def bus(request):
    return Bus(request.param(SIZE))


def test_commands(bus):
    """NV-008: identification, erased when new, only 1 to 0 by programming, FF by erase of one sector, reads wrap."""
    assert bus.frame(0x9F, 0, 0, 0)[1:] == [0xEF, 0x40, 16]
    assert bus.read(0, 4) == [255] * 4
    bus.write(model.PROGRAM, 0x1FFE, 0x0F, 0x3C)
    bus.wait()
    bus.write(model.PROGRAM, 0x1FFE, 0xF5, 0xFF)
    bus.wait()
    bus.write(model.PROGRAM, 0x2000, 0x77)
    bus.wait()
    assert bus.read(0x1FFD, 4) == [255, 0x05, 0x3C, 0x77]
    bus.flash.load(SIZE - 1, b"\x12")
    bus.flash.load(0, b"\x34")
    assert bus.read(SIZE - 1, 2) == [0x12, 0x34]
    bus.write(model.ERASE, 0x1ABC)
    bus.wait()
    assert bus.read(0x1FFD, 4) == [255, 255, 255, 0x77]


def test_times(bus):
    """NV-008: program and erase take their time; until then only the status is answered, nothing else is obeyed."""
    bus.flash.load(0x100, b"\x00")
    bus.write(model.PROGRAM, 0, 0x55)
    assert bus.status() == 3 and bus.read(0, 1) == [255] and bus.frame(0x9F, 0)[1] == 255
    bus.write(model.PROGRAM, 0x100, 1)  # lost, and does not prolong it
    assert 350 * US < bus.wait() < 450 * US
    assert bus.status() == 0 and bus.read(0, 1) == [0x55]
    bus.write(model.ERASE, 0)
    assert 44 * MS < bus.wait() < 46 * MS
    assert bus.read(0, 1) == bus.read(0x100, 1) == [255]
    bus.flash.times(5 * US, 7 * US)
    bus.write(model.PROGRAM, 0, 1)
    assert bus.wait() < 30 * US


def test_write_enable(bus):
    """NV-008: without the latch nothing is written; it is set by 06, cleared by 04 and by each program and erase."""
    bus.at(model.PROGRAM, 0, 0)
    assert bus.status() == 0 and bus.read(0, 1) == [255]
    bus.frame(model.WRITE_ENABLE)
    assert bus.status() == 2
    bus.frame(model.WRITE_DISABLE)
    bus.at(model.ERASE, 0)
    assert bus.status() == 0
    bus.write(model.PROGRAM, 0, 0)
    bus.wait()
    bus.at(model.PROGRAM, 1, 0)
    assert bus.status() == 0 and bus.read(0, 2) == [0, 255]
    assert bus.flash.counts()[1:] == (1, 0, 3)


def test_page_wrap(bus):
    """NV-008: a program wraps in its page; of more than 256 bytes the last ones count."""
    bus.write(model.PROGRAM, 0x1FE, 1, 2, 3)
    bus.wait()
    assert bus.read(0x1FE, 3) == [1, 2, 255] and bus.read(0x100, 2) == [3, 255]
    bus.write(model.PROGRAM, 0x300, *range(256), 0xF0)
    bus.wait()
    assert bus.read(0x300, 2) == [0xF0, 1] and bus.read(0x400, 1) == [255]


def test_frames(bus):
    """NV-008, NV-007: commands of the wrong length, unknown ones, and all but AB in deep power-down do nothing."""
    bus.frame(model.WRITE_ENABLE, 0)
    assert bus.status() == 0
    bus.frame(model.WRITE_ENABLE)
    bus.at(model.ERASE, 0, 0)
    bus.frame(model.ERASE, 0)
    bus.at(model.PROGRAM, 0)
    bus.frame(0xC7)
    assert bus.status() == 2 and bus.flash.counts()[1:3] == (0, 0) and bus.flash.counts()[3] == 5
    bus.frame(model.SLEEP)
    assert bus.frame(0x9F, 0)[1] == 255
    bus.frame(model.WAKE)
    assert bus.frame(0x9F, 0)[1] == 255  # not yet
    bus.t += model.WAKE_NS
    assert bus.frame(0x9F, 0)[1] == 0xEF
    bus.flash.power_up()
    assert Bus(bus.flash, awake=False).frame(0x9F, 0)[1] == 255


@pytest.mark.parametrize("cut", range(1, 9))
def test_power_cut(bus, cut):
    """NV-008: after a cut nothing is heard or answered; what was not begun has not happened, the rest anyhow."""
    bus.flash.load(0, bytes(range(64)))
    bus.flash.cut_after(cut, seed=cut)  # 06 | 20 00 00 00 | 05 00 | 05
    bus.write(model.ERASE, 0)
    bus.frame(model.STATUS, 0)
    assert bus.frame(model.STATUS, 0)[1] == 255
    bus.flash.power_up()
    again = Bus(bus.flash)
    assert again.status() == 0
    before = again.read(0, 64) == [*range(64)]
    assert before if cut < 6 else not before
    again.write(model.ERASE, 0)
    again.wait()
    assert set(again.read(0, 4096)) == {255}


def test_doubtful_cells():
    """NV-008: a broken off operation leaves cells that read differently each time, until they are written for good."""
    seen = set()
    for seed in range(1, 20):
        flash = native.Flash(SIZE)
        bus = Bus(flash)
        bus.write(model.PROGRAM, 0, *bytes(200))
        flash.cut_after(1, seed)
        bus.status()
        flash.power_up()
        bus = Bus(flash)
        doubt = any(flash.doubt(0, 256))
        assert not any(flash.doubt(256, SIZE - 256)) and set(flash.peek(256, SIZE - 256)) == {255}
        assert doubt == (len({tuple(bus.read(0, 256)) for _ in range(8)}) > 1)
        seen.add((doubt, bus.read(0, 200) == [0] * 200))
        bus.write(model.PROGRAM, 0, *bytes(200))
        bus.wait()
        assert bus.read(0, 201) == [0] * 200 + [255] and not any(flash.doubt(0, 256))
    assert {(True, False), (False, True)} <= seen


addresses = st.tuples(st.sampled_from([0, 1]), st.sampled_from([0, 1, 0x0F, 0x10]), st.sampled_from([0, 1, 0xFE, 0xFF]))
bodies = st.one_of(
    st.tuples(st.sampled_from([model.STATUS, model.READ_ID, model.WRITE_ENABLE, model.WRITE_DISABLE, model.WAKE])),
    st.tuples(st.sampled_from([model.STATUS, model.READ_ID]), st.just(0), st.just(0)),
    st.tuples(st.sampled_from([model.PROGRAM, model.READ, model.ERASE]), addresses, st.binary(max_size=9)),
    st.tuples(st.integers(0, 255), st.binary(max_size=5)))
steps = st.lists(st.one_of(
    st.tuples(st.just("frame"), bodies, st.sampled_from([0, 0, 0, 0, 1, 5])),
    st.tuples(st.just("enabled"), bodies, st.just(0)),
    st.tuples(st.just("wait"), st.sampled_from([1, 31, 100, 1000, 60_000])),
    st.tuples(st.just("cut"), st.integers(-1, 30), st.integers(0, 9)),
    st.tuples(st.just("power"))), max_size=25)


def flat(body):
    for part in body:
        if isinstance(part, int):
            yield part
        else:
            yield from part


@settings(max_examples=300, deadline=None)
@given(steps=steps, by_pins=st.booleans())
def test_models_agree(steps, by_pins):
    """NV-008: random frames, whole and broken, pauses, power cuts: both models answer and end alike, by byte or pin."""
    twins = [native.Flash(SIZE), model.Flash(SIZE)]
    t = 0

    def both(call):
        a, b = (call(f) for f in twins)
        assert a == b
        return a

    def frame(data, odd_bits):
        nonlocal t
        if not by_pins:
            both(lambda f: f.select(t, True))
            for value in data:
                both(lambda f: f.byte(t, value))
                t += 500
            both(lambda f: f.select(t, False))
            return
        bits = [value >> n & 1 for value in data for n in range(7, -1, -1)] + [1] * odd_bits
        both(lambda f: f.pins(t, 0, 0, 0))
        for bit in bits:
            for sck in (1, 0):
                t += 31
                both(lambda f: f.pins(t, 0, sck, bit))
        t += 31
        both(lambda f: f.pins(t, 1, 0, 0))

    frame([model.WAKE], 0)
    t += model.WAKE_NS
    for step in steps:
        if step[0] == "enabled":
            frame([model.WRITE_ENABLE], 0)
        if step[0] in ("frame", "enabled"):
            frame(list(flat(step[1])), step[2])
        elif step[0] == "wait":
            t += step[1] * US
        elif step[0] == "cut":
            both(lambda f: f.cut_after(step[1], step[2]))
        else:
            both(lambda f: f.power_up())
            t = 0
            frame([model.WAKE], 0)
            t += model.WAKE_NS
        both(lambda f: f.dead)
        both(lambda f: f.counts())
    both(lambda f: f.power_up())
    assert twins[0].peek(0, SIZE) == twins[1].cells and twins[0].doubt(0, SIZE) == twins[1].doubts
