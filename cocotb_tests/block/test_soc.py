# SPDX-License-Identifier: Apache-2.0
"""asi_soc with the real core. One small C program does single accesses on command; see soc_probe.c."""
from pathlib import Path

import pythondata_cpu_vexriscv
import pytest

from cocotb_tests.block.rv_build import build
from cocotb_tests.cocotb_run import ROOT, run_cocotb

VEXRISCV = Path(pythondata_cpu_vexriscv.data_location) / "VexRiscv_Min.v"
SOURCES = ["generated/asi_regs_pkg.sv", "generated/asi_regs.sv", "soc/asi_core.sv", "soc/asi_ram.sv",
           "soc/asi_boot_rom.sv", "soc/asi_shared_mem.sv", "soc/asi_fabric.sv", "soc/asi_spi.sv", "dpm/asi_dpm.sv",
           "soc/asi_soc.sv", VEXRISCV]


@pytest.mark.parametrize("clk_mhz,boot", [(8, "ram"), (48, "rom")])
def test_soc(clk_mhz, boot):
    program = ROOT / f"build/cocotb/soc_probe_{boot}.hex"
    build(ROOT / "cocotb_tests/block/soc_probe.c", 0 if boot == "ram" else 0x1000_0000, program)
    parameters = {"ClkHz": clk_mhz * 1_000_000, "BootFromFlash": int(boot == "rom")}
    if boot == "rom":
        parameters["BootRomHex"] = f'"{program}"'
    run_cocotb("asi_soc", SOURCES, "cocotb_tests.block.cocotb_soc", name=f"asi_soc-{clk_mhz}-{boot}",
               parameters=parameters, env={"BOOT": boot, "PROBE_HEX": str(program)},
               plusargs=[f"+firmware={program}"] if boot == "ram" else [])
