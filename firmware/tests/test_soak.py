# SPDX-License-Identifier: Apache-2.0
"""A short soak in every test run; `make soak` runs a million cycles."""
import pytest
from soak import soak


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_soak(seed):
    """EX-001 .. EX-029, EX-032, EX-033, EX-035 .. EX-038, FN-001 .. FN-024, FN-032, FN-033, AD-001 .. AD-009: random
    plants and hosts, functions and automatic addressing, 10 000 cycles in all: lists, flags, codes, images, history, log,
    the function's state and the calls asked for are those of the reference after every batch, cycle and tick; in the end
    every slave is found."""
    assert soak(seed, 2_500) >= 2_500
