# SPDX-License-Identifier: Apache-2.0
"""What the tests of rtl/phy share. All times are clocks.

The simulated clock has a period of 10 ns whatever ClkHz says: the modules only know clocks. Rising edge k is at 10 k
ns. Tests live in the middle of clocks (10 k + 5 ns): what they drive there counts as an edge on the pin at clock edge
k, and now() is k. So a difference of two now() or edge numbers is what an oscilloscope would show.
"""
import cocotb
from cocotb.clock import Clock
from cocotb.triggers import RisingEdge, Timer
from cocotb.utils import get_sim_time

PERIOD = 10


def now():
    """Number of the last rising clock edge."""
    return int(get_sim_time("ns")) // PERIOD


async def wait(clocks):
    if clocks:
        await Timer(clocks * PERIOD, "ns")


async def until(clock):
    """Wait for the middle of clock `clock`; the past is a mistake of the test."""
    delta = clock * PERIOD + PERIOD // 2 - int(get_sim_time("ns"))
    assert delta >= 0, f"clock {clock} is over, now {now()}"
    if delta:
        await Timer(delta, "ns")


async def start(dut, **inputs):
    """Clock and reset; inputs: values of the other inputs. Ends in the middle of a clock, reset released."""
    if rest := -int(get_sim_time("ns")) % PERIOD:  # the test before may have ended in the middle of a clock
        await Timer(rest, "ns")
    Clock(dut.clk_i, PERIOD, unit="ns", impl="gpi").start()
    for name, value in inputs.items():
        getattr(dut, name).value = value
    dut.rst_i.value = 1
    await Timer(2 * PERIOD + PERIOD // 2, "ns")
    dut.rst_i.value = 0
    await wait(1)


def watch(strobe, *values):
    """-> list that grows by (clock, *values) for each clock with strobe high, as the next clock edge samples it.

    A strobe longer than one clock fails the test. Sampling late in the clock keeps delta glitches out.
    """
    hits = []

    async def run():
        while True:
            await RisingEdge(strobe)
            clock = now()
            await Timer((clock + 1) * PERIOD - 1 - int(get_sim_time("ns")), "ns")
            if strobe.value == 1:
                hits.append((clock, *(int(v.value) for v in values)))
                await Timer(PERIOD, "ns")
                assert strobe.value == 0, f"{strobe._name} is longer than one clock"
    cocotb.start_soon(run())
    return hits


def to_clocks(pulses, hz):
    """[(ns, polarity)] -> [(clock, polarity)]"""
    return [(t * hz // 10**9, polarity) for t, polarity in pulses]
