# SPDX-License-Identifier: Apache-2.0
"""tick_i is high all the time here, so a microsecond is a clock; one test has a real tick."""
import cocotb
from cocotb.triggers import ValueChange
from cocotb_tests.block.phy_bench import now, start, until, wait

SYNC = 2  # clocks of the synchroniser


async def begin(dut, tick=1, apf_ni=1):
    await start(dut, tick_i=tick, apf_ni=apf_ni, efault_i=0)
    changes = []

    async def run():
        while True:
            await ValueChange(dut.apf_o)
            changes.append((now(), int(dut.apf_o.value)))
    cocotb.start_soon(run())
    return changes


async def good_power(dut, changes):
    await wait(10_020)
    assert [level for _, level in changes] == [0]
    changes.clear()


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def after_reset(dut):
    """LT-010: after reset APF is set until the line was good for 10 ms; with a bad line it stays."""
    changes = await begin(dut, apf_ni=0)
    await wait(11_000)
    assert changes == [] and dut.apf_o.value == 1
    dut.apf_ni.value = 1
    good = now()
    await wait(10_020)
    assert changes == [(good + SYNC + 10_001, 0)]


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def fail_and_clear(dut):
    """LT-010: 1 ms of low voltage sets APF, 10 ms of good voltage clear it, within one tick; less does not."""
    changes = await begin(dut)
    await good_power(dut, changes)
    for low, fails in ((1000, False), (1001, True)):
        dut.apf_ni.value = 0
        fell = now()
        await wait(low)
        dut.apf_ni.value = 1
        await wait(20)
        assert changes == ([(fell + SYNC + 1001, 1)] if fails else [])
        await wait(100)
    changes.clear()
    await wait(9000)
    for good in (10_000, 10_001):
        dut.apf_ni.value = 0
        await wait(10)
        changes.clear()
        dut.apf_ni.value = 1
        rose = now()
        await wait(good)
        dut.apf_ni.value = 0
        await wait(10)
        assert changes == ([(rose + SYNC + 10_001, 0)] if good == 10_001 else [])


@cocotb.test(timeout_time=2, timeout_unit="ms")
async def dips(dut):
    """LT-010: dips below 6 us neither add up to a fail nor restart the 10 ms; peaks below 6 us do not restart the 1
    ms."""
    changes = await begin(dut)
    started = now()
    while now() < started + 10_200:      # 5 us low in every 20 us from reset on
        dut.apf_ni.value = 0
        await wait(5)
        dut.apf_ni.value = 1
        await wait(15)
    assert len(changes) == 1 and changes[0][1] == 0 and changes[0][0] <= started + 10_030
    changes.clear()
    fell = now()
    while now() < fell + 1100:           # 5 us good in every 20 us
        dut.apf_ni.value = 0
        await wait(15)
        dut.apf_ni.value = 1
        await wait(5)
    assert changes == [(fell + SYNC + 1001, 1)]


@cocotb.test(timeout_time=2, timeout_unit="ms")
async def long_dip(dut):
    """LT-010: a good state of 7 us, one tick above the filter, does restart the 1 ms."""
    changes = await begin(dut)
    await good_power(dut, changes)
    for length, restarts in ((6, False), (7, True)):
        dut.apf_ni.value = 0
        fell = now()
        await wait(900)
        dut.apf_ni.value = 1
        await wait(length)
        dut.apf_ni.value = 0
        await until(fell + 1200)
        assert changes == ([] if restarts else [(fell + SYNC + 1001, 1)])
        dut.apf_ni.value = 1
        await wait(10_100)
        changes.clear()


@cocotb.test(timeout_time=2, timeout_unit="ms")
async def real_tick(dut):
    """LT-010: with a tick every 8 clocks, at any phase, 1 ms sets APF after 1000 to 1001 us."""
    for phase in (0, 3, 7):
        changes = await begin(dut, tick=1)
        await good_power(dut, changes)
        dut.tick_i.value = 0
        dut.apf_ni.value = 0
        fell = now()
        await wait(phase)
        for _ in range(1005):
            dut.tick_i.value = 1
            await wait(1)
            dut.tick_i.value = 0
            await wait(7)
        assert len(changes) == 1 and 8000 <= changes[0][0] - fell - SYNC <= 8008 + 8


EF = 1_000_001  # clocks from a change of the earth fault input, synchronised, to that of the output


def earth_changes(dut):
    seen = []

    async def run():
        while True:
            await ValueChange(dut.efault_o)
            seen.append((now(), int(dut.efault_o.value)))
    cocotb.start_soon(run())
    return seen


@cocotb.test(timeout_time=50, timeout_unit="ms")
async def earth_fault(dut):
    """LT-016: 1 s of earth fault sets it, 1 s without clears it, within one tick; the second is without a break: after
    one sample of the other level it starts again. APF does not move."""
    changes = await begin(dut)
    earth = earth_changes(dut)
    for level in (1, 0):
        dut.efault_i.value = level
        await wait(EF - 1)                 # one tick too short
        dut.efault_i.value = 1 - level
        await wait(1)
        dut.efault_i.value = level
        moved = now()
        await wait(EF + 10)
        assert earth == [(moved + SYNC + EF, level)]
        earth.clear()
    assert [level for _, level in changes] == [0]          # power good, once
