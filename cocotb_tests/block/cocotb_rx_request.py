# SPDX-License-Identifier: Apache-2.0
"""asi_rx with Bits = 14: the tests of the answer receiver that do not depend on the telegram."""
from cocotb_tests.block.cocotb_rx import deviation, disabled, good, random_faults, windows  # noqa: F401
