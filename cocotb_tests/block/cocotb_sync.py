# SPDX-License-Identifier: Apache-2.0
import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge


@cocotb.test(timeout_time=10, timeout_unit="us")
async def two_clocks_delay(dut):
    """RX-009: the synchroniser delays by exactly two clocks, which the receiver takes out again."""
    Clock(dut.clk_i, 10, unit="ns").start()
    dut.rst_i.value = 1
    dut.async_i.value = 0
    await FallingEdge(dut.clk_i)
    await FallingEdge(dut.clk_i)
    dut.rst_i.value = 0
    dut.async_i.value = 1
    seen = []
    for _ in range(3):
        await FallingEdge(dut.clk_i)
        seen.append(int(dut.sync_o.value))
    assert seen == [0, 1, 1]
