# SPDX-License-Identifier: Apache-2.0
import pytest

from cocotb_tests.cocotb_run import run_cocotb


@pytest.mark.parametrize("width", [1, 3])
def test_sync(width):
    run_cocotb("asi_sync", ["phy/asi_sync.sv"], "cocotb_tests.block.cocotb_sync", parameters={"Width": width})
