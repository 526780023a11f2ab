#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Generate everything that knows a register, shared word or enumeration from rdl/asi.rdl.

usage: gen_registers.py [--check] [--html DIR]
  --check  generate into a temporary folder and compare; exit 1 and name the files that differ
  --html   write the HTML register reference to DIR as well
"""
import argparse
import filecmp
import shutil
import sys
import tempfile
from pathlib import Path

from peakrdl_cheader.exporter import CHeaderExporter
from peakrdl_html import HTMLExporter
from peakrdl_regblock import RegblockExporter
from peakrdl_regblock.cpuif.passthrough import PassthroughCpuif
from peakrdl_regblock.udps import ALL_UDPS
from systemrdl import RDLCompiler
from systemrdl.node import RegfileNode, RegNode

ROOT = Path(__file__).resolve().parent.parent
MAPS = ("asi_regs", "asi_link_ram", "asi_stats", "asi_ring", "asi_host")
ENUMS = ("error_class_e", "phase_e")
NOTE = "Generated from rdl/asi.rdl by tools/gen_registers.py (make regs). Do not edit."


def compile_rdl():
    """-> ({map name: addrmap node}, {enum name: enum})"""
    rdl = RDLCompiler()
    for udp in ALL_UDPS:
        rdl.register_udp(udp)
    rdl.compile_file(str(ROOT / "rdl/asi.rdl"))
    maps = {name: rdl.elaborate(name).top for name in MAPS}
    enums = {}
    for node in maps.values():
        for reg in node.descendants(in_post_order=False):
            if isinstance(reg, RegNode):
                for field in reg.fields():
                    enum = field.get_property("encode")
                    if enum is not None:
                        enums[enum.type_name] = enum
    return maps, {name: enums[name] for name in ENUMS}


def constants(maps):
    """Yield (name, value) of every word offset and field position, e.g. LINK_SLOT, 0x000; names may repeat.

    A register file (STAT, TELEGRAM) has the offset of its first element here, and those of its words inside it."""
    for name, node in maps.items():
        prefix = name.removeprefix("asi_").removesuffix("_ram").upper()
        for child in node.children(unroll=False):
            yield f"{prefix}_{child.inst_name}", child.raw_absolute_address if child.is_array else child.absolute_address
        for child in node.children(unroll=False):
            if isinstance(child, RegNode):
                yield from fields(child, prefix)
        for child in node.children(unroll=False):
            if isinstance(child, RegfileNode):
                stem = child.type_name.removesuffix("_r").upper()
                for reg in child.registers():
                    yield f"{stem}_{reg.inst_name}", reg.raw_address_offset
                    yield from fields(reg, stem)


def fields(reg, prefix):
    """Yield (name, value) of a register's fields; a named type is known by its name, others by prefix and register."""
    kind = reg.type_name or reg.inst_name
    stem = kind.removesuffix("_r").upper() if kind.endswith("_r") else f"{prefix}_{reg.inst_name}"
    if stem != "WORD":
        for field in reg.fields():
            yield f"{stem}_{field.inst_name.upper()}_LSB", field.lsb
            yield f"{stem}_{field.inst_name.upper()}_W", field.width


def sv_package(maps, enums):
    out = [f"// SPDX-License-Identifier: Apache-2.0\n// {NOTE}", "package asi_map_pkg;"]
    for name, enum in enums.items():
        stem = {"error_class_e": "Err", "phase_e": "Phase"}[name]
        width = max(m.value for m in enum).bit_length()
        items = ",\n".join(
            f"    {stem}{''.join(p.capitalize() for p in m.name.split('_'))} = {width}'d{m.value}" for m in enum)
        out.append(f"  typedef enum logic [{width-1}:0] {{\n{items}\n  }} {name};")
    out.append("  // byte offsets inside each window; _LSB and _W are bit positions and widths of fields")
    done = set()
    for const, value in constants(maps):
        if const in done or const.startswith("REGS_"):  # asi_regs.sv knows those
            continue
        done.add(const)
        camel = "".join(p.capitalize() for p in const.split("_"))
        out.append(f"  localparam int unsigned {camel} = 'h{value:x};")
    out.append("endpackage\n")
    return "\n".join(out)


def python_module(maps, enums):
    out = [f'# SPDX-License-Identifier: Apache-2.0\n"""{NOTE}\n\nByte offsets inside each window; _LSB and _W are'
           ' bit positions and widths of fields."""', "from enum import IntEnum", ""]
    for name, enum in enums.items():
        cls = {"error_class_e": "ErrorClass", "phase_e": "Phase"}[name]
        out += ["", f"class {cls}(IntEnum):"]
        out += [f"    {m.name} = {m.value}  # {m.rdl_desc}" for m in enum]
        out.append("")
    out.append("")
    done = set()
    for const, value in constants(maps):
        if const in done:
            continue
        done.add(const)
        out.append(f"{const} = 0x{value:X}")
    return "\n".join(out) + "\n"


def c_enums(enums):
    out = [f"/* SPDX-License-Identifier: Apache-2.0 */\n/* {NOTE} */", "#ifndef ASI_ENUMS_H\n#define ASI_ENUMS_H"]
    for name, enum in enums.items():
        stem = {"error_class_e": "ASI_ERR", "phase_e": "ASI_PHASE"}[name]
        cname = {"error_class_e": "asi_error_class_t", "phase_e": "asi_phase_t"}[name]
        out.append("typedef enum {")
        out += [f"    {stem}_{m.name} = {m.value}, /**< {m.rdl_desc} */" for m in enum]
        out.append(f"}} {cname};")
    out.append("#endif\n")
    return "\n".join(out)


def generate(root, html):
    """Write every generated file below root; returns their paths relative to root."""
    maps, enums = compile_rdl()
    sv, c, py = root / "rtl/generated", root / "firmware/generated", root / "host/python/asi"
    for folder in (sv, c, py):
        folder.mkdir(parents=True, exist_ok=True)
    RegblockExporter().export(maps["asi_regs"], str(sv), cpuif_cls=PassthroughCpuif)
    (sv / "asi_map_pkg.sv").write_text(sv_package(maps, enums))
    for name, node in maps.items():
        CHeaderExporter().export(node, str(c / f"{name}.h"))
    (c / "asi_enums.h").write_text(c_enums(enums))
    (py / "regmap.py").write_text(python_module(maps, enums))
    if html:
        HTMLExporter().export(list(maps.values()), str(html))
    return [sv / "asi_regs_pkg.sv", sv / "asi_regs.sv", sv / "asi_map_pkg.sv", py / "regmap.py", c / "asi_enums.h",
            *(c / f"{name}.h" for name in MAPS)]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--html", type=Path)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as tmp:
        tmp = Path(tmp)
        stale = [p.relative_to(tmp) for p in generate(tmp, args.html)
                 if not (ROOT / p.relative_to(tmp)).exists()
                 or not filecmp.cmp(p, ROOT / p.relative_to(tmp), shallow=False)]
        if not args.check:  # only what differs, so that nothing else is built again
            for path in stale:
                (ROOT / path).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(tmp / path, ROOT / path)
            return 0
    for path in stale:
        print(f"stale: {path}: run 'make regs' and commit", file=sys.stderr)
    return 1 if stale else 0


if __name__ == "__main__":
    sys.exit(main())
