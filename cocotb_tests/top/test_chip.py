# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import pythondata_cpu_vexriscv
from cocotb_tests.cocotb_run import PACKAGES, ROOT, RTL, run_cocotb

HERE = Path(__file__).resolve().parent
VEXRISCV = Path(pythondata_cpu_vexriscv.data_location) / "VexRiscv_Min.v"
SOURCES = [line for line in (RTL / "asi_master.f").read_text().splitlines() if line.endswith(".sv")]


def test_chip():
    """PL-004, LK-011, LK-012, LK-013: the whole chip with its firmware on the Python models, one build for all."""
    firmware = ROOT / "build/firmware/asi_test.hex"
    assert firmware.exists(), f"{firmware} is missing: make firmware"
    run_cocotb("tb_asi_master", [*(s for s in SOURCES if RTL / s not in PACKAGES), VEXRISCV, HERE / "tb_asi_master.sv"],
               "cocotb_tests.top.cocotb_chip", name="chip", quick=True, plusargs=[f"+firmware={firmware}"],
               extra_args=[str(HERE / "public.vlt"), "--timing", "-O3", "--x-assign", "fast", "--x-initial", "fast",
                           "-CFLAGS", "-fcoroutines -std=gnu++20 -O2", "-MAKEFLAGS", "CFG_CXXFLAGS_PCH_I=-include"])
