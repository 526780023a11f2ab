# SPDX-License-Identifier: Apache-2.0
"""A short soak in every test run; `make soak` runs a million cycles."""
import pytest
from soak import soak


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_soak(seed):
    """EX-001 .. EX-029, EX-032, EX-033, EX-035 .. EX-038, FN-001 .. FN-004, FN-006 .. FN-019, FN-021, FN-023: random
    plants and hosts, 10 000 cycles in all: lists, flags, codes, images, history, log and the calls asked for are those
    of the reference after every batch, cycle and tick."""
    assert soak(seed, 2_500) >= 2_500
