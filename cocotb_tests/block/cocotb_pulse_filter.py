# SPDX-License-Identifier: Apache-2.0
import cocotb
from cocotb_tests.block.phy_bench import now, start, wait, watch


async def begin(dut):
    await start(dut, pulse_i=0)
    return int(dut.Clocks.value), watch(dut.start_o)


async def drive(dut, *levels):
    """levels: clocks of alternating 1 and 0, beginning with 1 -> clock of the first rise"""
    first = now()
    for position, clocks in enumerate(levels):
        dut.pulse_i.value = 1 - position % 2
        await wait(clocks)
    dut.pulse_i.value = 0
    return first


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def width(dut):
    """RX-009: one clock less than 750 ns gives nothing, 750 ns and more give one strobe, always after the same time."""
    clocks, hits = await begin(dut)
    assert clocks == int(dut.ClkHz.value) * 750 // 10**9
    for width_clocks in range(1, 3 * clocks):
        hits.clear()
        first = await drive(dut, width_clocks)
        await wait(3 * clocks)
        assert hits == ([(first + clocks,)] if width_clocks >= clocks else []), width_clocks


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def interruption(dut):
    """RX-009: the 750 ns are without a break; two parts of 750 ns less one clock are no pulse."""
    clocks, hits = await begin(dut)
    await drive(dut, clocks - 1, 1, clocks - 1, 1, clocks - 1)
    await wait(3 * clocks)
    assert hits == []


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def drop_out(dut):
    """RX-009: a drop-out shorter than 750 ns inside a pulse makes no second strobe, one of 750 ns does."""
    clocks, hits = await begin(dut)
    first = await drive(dut, clocks + 2, clocks - 1, clocks, 1, 3 * clocks)
    await wait(3 * clocks)
    assert hits == [(first + clocks,)]
    hits.clear()
    first = await drive(dut, clocks + 2, clocks, clocks)
    await wait(3 * clocks)
    assert hits == [(first + clocks,), (first + 3 * clocks + 2,)]


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def reset(dut):
    """RX-009: reset forgets a pulse that has begun; a pulse that is still there afterwards is a new one."""
    clocks, hits = await begin(dut)
    dut.pulse_i.value = 1
    await wait(clocks - 1)
    dut.rst_i.value = 1
    await wait(1)
    dut.rst_i.value = 0
    first = now()
    await wait(3 * clocks)
    assert hits == [(first + clocks,)]
