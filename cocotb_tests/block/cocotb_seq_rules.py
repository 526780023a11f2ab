# SPDX-License-Identifier: Apache-2.0
"""The rules of formal/asi_seq_fv.sv in simulation: they are assertions, so running is checking."""
import cocotb
from cocotb.clock import Clock
from cocotb.triggers import ClockCycles, Timer

NUMBERS, CLOCKS = (1, 15, 31), 400_000  # numbers watched; clocks of each


@cocotb.test()
async def rules_hold(dut):
    """LK-001, LK-002, LK-004, LK-008, LK-009, LK-010, LK-013, LK-014, LK-015, LK-016, LK-017, LK-018, LK-019,
    LK-020, LK-021: every rule of the proof, for three numbers, with firmware that writes, lines that fail and switches
    that fall at any clock."""
    for number in NUMBERS:
        dut.rst_i.value = 1
        if number == NUMBERS[0]:
            dut.n_i.value = number
            await Timer(1, unit="us")
            Clock(dut.clk_i, 125, unit="ns").start()
        await ClockCycles(dut.clk_i, 3)
        dut.n_i.value = number  # under reset: the rules speak of one number
        await ClockCycles(dut.clk_i, 3)
        dut.rst_i.value = 0
        await ClockCycles(dut.clk_i, CLOCKS)
