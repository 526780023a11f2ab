# SPDX-License-Identifier: Apache-2.0
"""asi_master with BootFromFlash: the boot loader as `make firmware` builds it, and a small program in flash."""
from cocotb_tests.block.rv_build import build
from cocotb_tests.block.test_master import SOURCES
from cocotb_tests.cocotb_run import ROOT, run_cocotb

LOADER = ROOT / "build/firmware/boot.hex"


def test_boot():
    assert LOADER.exists(), "build the loader first: make firmware"
    program = ROOT / "build/cocotb/boot_probe.hex"
    build(ROOT / "cocotb_tests/block/soc_probe.c", 0, program)
    run_cocotb("asi_master", SOURCES, "cocotb_tests.block.cocotb_boot", name="asi_master-boot",
               parameters={"ClkHz": 8_000_000, "BootFromFlash": 1, "BootRomHex": f'"{LOADER}"'},
               env={"PROBE_HEX": str(program)})
