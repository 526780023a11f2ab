# SPDX-License-Identifier: Apache-2.0
import pytest

from cocotb_tests.cocotb_run import run_cocotb


@pytest.mark.parametrize("mhz", [8, 16])
def test_rx(mhz):
    run_cocotb("asi_rx", ["phy/asi_rx.sv"], "cocotb_tests.block.cocotb_rx", parameters={"ClkHz": mhz * 10**6})


def test_rx_request():
    """The same receiver with 14 bits, as a passive monitor of requests uses it."""
    run_cocotb("asi_rx", ["phy/asi_rx.sv"], "cocotb_tests.block.cocotb_rx_request",
               parameters={"ClkHz": 8 * 10**6, "Bits": 14})
