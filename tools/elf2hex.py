#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Turn a linked firmware ELF (ELF32, little endian) into memory images, and print its size.

usage: elf2hex.py FILE.elf [--hex FILE] [--bin FILE] [--flash FILE] [--ram BYTES] [--limit BYTES]
  --hex    $readmemh text, one 32-bit word a line, from the lowest load address
  --bin    the same as bytes
  --flash  the same behind the header that firmware/boot/boot.c expects: magic, words, two running sums
  --ram    RAM that the program may use (loaded and not loaded), for the report; exit 1 when it needs more
  --limit  exit 1 when the loaded image is longer
"""
import argparse
import struct
import sys
from pathlib import Path

FLASH_MAGIC = 0x42495341  # 'ASIB'


def load_elf(data):
    """ELF bytes -> (lowest load address, image bytes, bytes of memory with what is not loaded); ValueError."""
    if data[:6] != b"\x7fELF\x01\x01":
        raise ValueError("not a 32-bit little-endian ELF file")
    phoff, = struct.unpack_from("<I", data, 28)
    phentsize, phnum = struct.unpack_from("<HH", data, 42)
    parts, top = [], 0
    for k in range(phnum):
        kind, offset, vaddr, _, filesz, memsz = struct.unpack_from("<6I", data, phoff + k * phentsize)
        if kind == 1 and memsz:  # PT_LOAD
            top = max(top, vaddr + memsz)
            if filesz:
                parts.append((vaddr, data[offset:offset + filesz]))
    if not parts:
        raise ValueError("nothing to load")
    base, end = min(a for a, _ in parts), max(a + len(p) for a, p in parts)
    image = bytearray(end - base + -(end - base) % 4)
    for address, part in parts:
        image[address - base:address - base + len(part)] = part
    return base, bytes(image), top - base


def sums(words):
    """Two running 32-bit sums (Fletcher): order counts, and an erased or empty memory does not pass."""
    a = b = 0
    for word in words:
        a = (a + word) & 0xFFFFFFFF
        b = (b + a) & 0xFFFFFFFF
    return a, b


def flash_image(image):
    """Image bytes -> header and image as they lie in flash."""
    words = struct.unpack(f"<{len(image) // 4}I", image)
    return struct.pack("<4I", FLASH_MAGIC, len(words), *sums(words)) + image


def main(argv=None):
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("elf", type=Path)
    for name in ("hex", "bin", "flash"):
        p.add_argument(f"--{name}", type=Path)
    p.add_argument("--ram", type=int)
    p.add_argument("--limit", type=int)
    args = p.parse_args(argv)
    try:
        base, image, used = load_elf(args.elf.read_bytes())
    except (OSError, ValueError, struct.error) as error:
        sys.exit(f"{args.elf}: {error}")
    if args.hex:
        args.hex.write_text("".join(f"{w:08x}\n" for w, in struct.iter_unpack("<I", image)))
    if args.bin:
        args.bin.write_bytes(image)
    if args.flash:
        args.flash.write_bytes(flash_image(image))
    print(f"{args.elf.name}: {len(image)} bytes loaded at 0x{base:08x}, {used} bytes of memory without stack")
    if args.limit is not None and len(image) > args.limit:
        sys.exit(f"{args.elf}: {len(image)} bytes, at most {args.limit} are allowed")
    if args.ram is not None and used > args.ram:
        sys.exit(f"{args.elf}: needs {used} of {args.ram} bytes of memory")


if __name__ == "__main__":
    main()
