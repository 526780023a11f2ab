# SPDX-License-Identifier: Apache-2.0
"""Times of execution control on the whole chip, in bus time (tools/exec_times.py measures them for the figures)."""
import pytest

from tools import exec_times as times


@pytest.mark.parametrize("n", [31, 62])
def test_start_up(n):
    """EX-031: from the first telegram to the first cycle."""
    assert times.start_up(n) <= times.GOALS[f"start_{n}_ms"]


def test_failed_slave():
    """EX-030, LK-004: a slave that is gone is called in exactly 3 of its cycles."""
    assert times.lost() == times.GOALS["lost_cycles"]


def test_returned_slave():
    """EX-030, EX-029: back in the cycle in time, first, middle and last address; at most one extra call a cycle."""
    worst, line = times.returned([(1, 60), (16, 83), (31, 129)])
    assert worst <= times.GOALS["returned_ms"] and times.extra_calls(line.log) == 1


def test_replaced_slave():
    """AD-010, AD-008: a slave with address 0 takes the place of the missing one by itself."""
    assert times.replaced([(31, 100)]) <= times.GOALS["replaced_ms"]


def test_interrupt():
    """HW-011: combined transactions on all 31 numbers leave half of the cycle to the rest."""
    assert times.core_work(list(times.MIXES.values())[-1], ms=120) <= times.GOALS["interrupt_us"]
