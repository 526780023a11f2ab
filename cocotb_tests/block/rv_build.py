# SPDX-License-Identifier: Apache-2.0
"""Compile a small C program for the soft core and write it as a $readmemh file (for block tests only)."""
import struct
import subprocess
import sys
from pathlib import Path

FLAGS = ("-target riscv32-freestanding-none -mcpu=generic_rv32 -mabi=ilp32 -Os -ffreestanding -nostdlib -Wall -Wextra "
         "-Werror -fno-sanitize=all").split()


def elf_words(elf, base):
    """Loadable bytes of an ELF32 file as little-endian words from address base on."""
    phoff, phentsize, phnum = struct.unpack_from("<I", elf, 28)[0], *struct.unpack_from("<HH", elf, 42)
    image = bytearray()
    for k in range(phnum):
        kind, offset, _, paddr, filesz = struct.unpack_from("<5I", elf, phoff + k * phentsize)
        if kind == 1 and filesz:
            end = paddr - base + filesz
            assert base <= paddr and end <= 0x10000, f"segment at {paddr:#x} does not fit at {base:#x}"
            image.extend(bytes(max(0, end - len(image))))
            image[paddr - base:end] = elf[offset:offset + filesz]
    image.extend(bytes(-len(image) % 4))
    return struct.unpack(f"<{len(image) // 4}I", image)


def build(source, base, out):
    """source (C, with a section .start) linked at base -> hex file out; returns its number of words."""
    out = Path(out)
    out.parent.mkdir(parents=True, exist_ok=True)
    script, elf = out.with_suffix(".ld"), out.with_suffix(".elf")
    script.write_text(f"ENTRY(_start) PHDRS {{ code PT_LOAD; }} SECTIONS {{ . = {base:#x};"
                      " .text : { KEEP(*(.start)) *(.text*) *(.rodata*) *(.srodata*) } :code"
                      " /DISCARD/ : { *(.eh_frame*) *(.comment) } }\n")
    subprocess.run([sys.executable, "-m", "ziglang", "cc", *FLAGS, "-T", str(script), "-o", str(elf), str(source)],
                   check=True)
    words = elf_words(elf.read_bytes(), base)
    out.write_text("".join(f"{w:08x}\n" for w in words))
    return len(words)
