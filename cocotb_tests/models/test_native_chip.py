# SPDX-License-Identifier: Apache-2.0
"""The native chip (libasi_chip): line, host port, monitor and statistics, with a program that obeys the host.

No firmware here: the program of the fabric's block test does single accesses for the host, so each test makes the
sequencer do exactly what it wants. The firmware on this chip is tested with the plants.
"""
from pathlib import Path

import pytest

from asi import regmap as r
from asi.native import CERTAIN, Chip, NativeError
from asi.telegram import encode_call, request_pulses
from cocotb_tests.block import rv_build

US, MS = 1_000, 1_000_000
REGS, LINK = 0x8000_0000, 0x8001_0000
MAIL = 0x3F00  # the program's mailbox: op, addr, data, result
READY = 12 * MS  # APF is gone and slaves are up


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    out = tmp_path_factory.mktemp("chip") / "probe.hex"
    rv_build.build(Path(rv_build.__file__).with_name("soc_probe.c"), 0, out)
    return out


@pytest.fixture(params=["asi_chip", "asi_chip_trace"])
def waves(request, tmp_path):
    """None for the fast library, a wave file for the traced one: both have to do the same."""
    return tmp_path / "waves.fst" if request.param == "asi_chip_trace" else None


class Bench:
    def __init__(self, program, waves=None, seed=0, start=READY):
        self.chip = Chip(program, waves, seed)
        self.net = self.chip.net
        self.chip.run(start)

    def access(self, op, addr, data=0):
        for offset, value in ((4, addr), (8, data), (0, op)):
            self.chip.host_write(MAIL + offset, value)
        for _ in range(100):
            self.chip.run(self.chip.time_ns + 5 * US)
            if self.chip.host_read(MAIL) == 0:
                return self.chip.host_read(MAIL + 12)
        raise AssertionError("the program does not answer")

    def read(self, addr):
        return self.access(3, addr)

    def write(self, addr, data):
        self.access(6, addr, data)

    def batch(self, *calls, retries=0, no_reply=0):
        """Runs a batch; -> [result words]."""
        for i, call in enumerate(calls):
            self.write(LINK + r.LINK_BATCH + 4 * i, call | no_reply << 11 | retries << 12)
        self.write(REGS + r.REGS_CTRL, 1 << r.REGS_CTRL_LINE_EN_LSB)
        self.write(REGS + r.REGS_BATCH, len(calls))
        self.chip.run(self.chip.time_ns + 1_300 * US * len(calls))
        return [self.read(LINK + r.LINK_BATCH + 4 * i) for i in range(len(calls))]


def test_host_port(program, waves):
    """HW-006: words and single bytes over the host port; each access takes bus time, nothing else happens meanwhile."""
    chip = Chip(program, waves)
    chip.host_write(0x100, 0x1122_3344)
    chip.host_write(0x104, 0x5566_7788)
    chip.host_write(0x100, 0xAABB_CCDD, 0b0110)
    before = chip.time_ns
    assert (chip.host_read(0x100), chip.host_read(0x104)) == (0x11BB_CC44, 0x5566_7788)
    assert 0 < chip.time_ns - before < 2 * US


def test_time(program):
    """LT-001: time is counted in clocks of 62.5 ns; run() stops at the first clock not before the time asked for."""
    chip = Chip(program)
    assert chip.clk_hz == 16_000_000
    assert [chip.run(t) for t in (0, 1, 62, 63, 126, 1_000)] == [0, 62, 62, 125, 187, 1_000]
    assert chip.run(500) == 1_000
    assert chip.stats().clocks == 16


def test_batch_on_the_line(program, waves):
    """LT-004, LT-005, LK-010, RX-012, RX-013, SL-002: a batch over present and missing slaves, the gaps on the pins
    exact, first answers late, the chip's results as the monitor's."""
    bench = Bench(program, waves)
    for index in (1, 2, 5):
        bench.net.add(index, io=index)
    bench.chip.run(bench.chip.time_ns + 11 * MS)
    calls = [encode_call("RDIO", i) for i in (1, 2, 3, 5, 5, 1)]
    results = bench.batch(*calls)
    log = bench.chip.log()
    assert [t.call for t in log] == calls and all(t.request_ok for t in log)
    assert [(t.data, t.error_class) for t in log] == [(w & 15 if not w >> 4 & 15 else 0, w >> 4 & 15) for w in results]
    assert [t.error_class for t in log] == [0, 0, r.ErrorClass.NO_RESPONSE, 0, 0, 0]
    assert [t.data for t in log] == [1, 2, 0, 5, 5, 1]
    # asynchronous, then brought into step by the first good request
    assert [t.delay_ns for t in log] == [33_500, 21_500, -1, 21_500, 21_500, 21_500]
    steps = [b.t_ns - a.t_ns for a, b in zip(log, log[1:])]
    assert steps == [78_000 + 33_500 + 36_000 + 18_500, 154_000, 150_000, 154_000, 154_000]


@pytest.mark.parametrize("fault", [dict(p_parity=CERTAIN), dict(p_extra_pulse=CERTAIN), dict(p_no_answer=CERTAIN),
                                   dict(p_shifted_pulse=CERTAIN, shift_ns=2_000), dict(p_missing_pulse=CERTAIN),
                                   dict(delay_ns=-10_500), dict(delay_ns=45_000)])
def test_chip_and_monitor_agree(program, fault):
    """RX-008, RX-011, LT-002, LT-003, LT-012: chip and monitor name the same class for each fault; repetitions are seen
    as such, within 200 us in the nominal case."""
    bench = Bench(program, seed=5)
    slave = bench.net.add(5, io=9)
    bench.chip.run(bench.chip.time_ns + 11 * MS)
    call = encode_call("RDIO", 5)
    bench.batch(call)
    bench.net.set_faults(slave, **fault)
    bench.chip.log()
    for _ in range(4):
        (result,) = bench.batch(call, retries=2)
        log = bench.chip.log()
        assert len(log) == 3 and [t.repeated for t in log] == [0, 1, 1]
        assert log[0].error_class == result >> 8 & 15 and log[2].error_class == result >> 4 & 15 != 0
        if "delay_ns" not in fault:
            assert all(b.t_ns - a.t_ns <= 200 * US for a, b in zip(log, log[1:]))


def test_foreign_pulses(program):
    """LT-006, RX-011: a lone injected pulse is a bad answer; one more restarts the quiet time."""
    bench = Bench(program)
    call = encode_call("RDIO", 9)
    bench.batch(call, call, call)
    bench.chip.log()
    for i in range(3):
        bench.write(LINK + r.LINK_BATCH + 4 * i, call)
    for offset, value in ((4, REGS + r.REGS_BATCH), (8, 3), (0, 6)):  # starts the batch, does not wait
        bench.chip.host_write(MAIL + offset, value)
    limit, log = bench.chip.time_ns + MS, []
    while not log:
        assert bench.chip.run(bench.chip.time_ns + 10 * US) < limit
        log = bench.chip.log()
    second = log[0].t_ns + 150 * US
    bench.net.inject(second + 98 * US, -1)
    bench.net.inject(second + 135 * US, 1)
    bench.chip.run(second + 400 * US)
    bad, after = bench.chip.log()
    assert (bad.t_ns, bad.error_class, bad.delay_ns) == (second, r.ErrorClass.NO_INFORMATION, 20 * US)
    assert after.t_ns == second + 135 * US + 24 * US


def test_power_fail(program):
    """LT-010, LT-011: pin apf_ni low for 1 ms stops the line; the call that was to come ends as ABORTED."""
    bench = Bench(program)
    bench.net.add(5, io=9)
    bench.chip.run(bench.chip.time_ns + 11 * MS)
    call = encode_call("RDIO", 5)
    assert bench.batch(call)[0] >> 4 & 15 == r.ErrorClass.OK
    bench.chip.log()
    bench.chip.apf(True)
    bench.chip.run(bench.chip.time_ns + 2 * MS)
    assert bench.batch(call)[0] >> 4 & 15 == r.ErrorClass.ABORTED
    assert bench.chip.log() == []
    bench.chip.apf(False)
    bench.chip.run(bench.chip.time_ns + 11 * MS)
    assert bench.batch(call)[0] & 0xFF == 9


def test_cycles_and_statistics(program):
    """LK-001, LK-012, HW-005: a cycle over three slaves; periods, phases, telegrams, host interrupt."""
    bench = Bench(program)
    for index in (1, 2, 3):
        bench.net.add(index, io=7, inputs=index)
    bench.chip.run(bench.chip.time_ns + 11 * MS)
    bench.batch(*(encode_call("WPAR", i, 15) for i in (1, 2, 3)))
    bench.chip.log()
    for i in (1, 2, 3):
        bench.write(LINK + r.LINK_SLOT + 4 * i, 1)
    start = bench.chip.stats()
    bench.write(REGS + r.REGS_CTRL, 1 << r.REGS_CTRL_LINE_EN_LSB | 1 << r.REGS_CTRL_CYCLE_EN_LSB)
    bench.chip.run(bench.chip.time_ns + 20 * MS)
    stats = bench.chip.stats()
    log = bench.chip.log()
    assert stats.telegrams - start.telegrams == len(log) and stats.failed == start.failed
    assert stats.cycle_min_ns == stats.cycle_max_ns == stats.cycle_mean_ns == 3 * 154 * US
    assert stats.cycle_periods == stats.cycles - 1 and stats.cycles - len(log) // 3 in (0, 1)  # the last is under way
    assert sum(stats.phase_ns) == bench.chip.time_ns
    assert stats.phase_ns[r.Phase.DATA_EXCHANGE] >= stats.cycle_sum_ns
    assert {t.phase for t in log} == {r.Phase.DATA_EXCHANGE}
    assert bench.net.state(0).outputs == 0  # OUT_IMG is 0 at line level
    before = bench.chip.time_ns
    assert bench.chip.run_irq(before + MS) >= before + MS  # nobody has raised it
    bench.write(REGS + r.REGS_HOST_IRQ, 1)
    now = bench.chip.time_ns
    assert bench.chip.run_irq(now + MS) == now
    bench.chip.host_write(r.HOST_IRQ_ACK, 0)
    assert bench.chip.run_irq(now + MS) >= now + MS


def history(program, seed, waves=None):
    bench = Bench(program, waves, seed)
    bench.net.set_faults(bench.net.add(5, io=9), p_no_answer=20_000, p_missing_pulse=20_000, p_extra_pulse=20_000)
    bench.chip.run(bench.chip.time_ns + 11 * MS)
    bench.batch(*[encode_call("RDIO", 5)] * 16)
    return bench.chip.log(), bench.chip.stats()


def test_reproducible_and_the_same_with_waves(program, tmp_path):
    """SL-008, PL-003: one seed gives one history, to the clock, with and without waves; another seed another one."""
    first = history(program, 1)
    assert first == history(program, 1) == history(program, 1, tmp_path / "waves")
    assert first[0] != history(program, 2)[0]
    assert {t.error_class for t in first[0]} > {r.ErrorClass.OK}


def test_chips_side_by_side(program, tmp_path):
    """SL-008: chips live, run and end in any order without a trace in each other."""
    chips = [Bench(program, waves, start=0) for waves in (None, tmp_path / "a", None, tmp_path / "b")]
    for k, bench in enumerate(chips):
        bench.net.add(5, io=k)
        bench.chip.run(READY)
    for bench in (chips[1], chips[0]):
        bench.chip.close()
    for k in (2, 3):
        assert chips[k].batch(encode_call("RDIO", 5))[0] & 0xFF == k
        chips[k].chip.close()


def test_waves(program, tmp_path):
    """PL-003: the wave file has the chip's hierarchy, the true clock and every edge of the transmitter."""
    import pywellen
    path = tmp_path / "waves"
    bench = Bench(program, path, start=0)
    bench.chip.run(READY)
    bench.batch(encode_call("RDIO", 5))
    bench.chip.close()
    wave = pywellen.Waveform(str(path))
    signals = {v.full_name: v for v in wave.all_vars()}
    clock = [t for t, v in signals["TOP.clk_i"].tv if v == 1][:5]
    assert {b - a for a, b in zip(clock, clock[1:])} == {62_500}
    edges = [t for t, _ in signals["TOP.tx_man_o"].tv][1:]
    assert [(t - edges[0]) // 1_000 for t in edges] == [t for t, _ in request_pulses(encode_call("RDIO", 5))]
    assert any(name.startswith("TOP.asi_master.") for name in signals)


def test_refused(program, tmp_path):
    """HW-007: a missing firmware file or an impossible wave file is an error, not the end of the process."""
    with pytest.raises(NativeError):
        Chip(tmp_path / "missing.hex")
    with pytest.raises(NativeError):
        Chip(program, waves=tmp_path / "missing" / "waves")
