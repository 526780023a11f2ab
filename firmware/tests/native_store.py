# SPDX-License-Identifier: Apache-2.0
"""Build the permanent storage with its flash driver and the flash model as one native library, open it through cffi."""
import functools
import os
import subprocess

import cffi
from native import BUILD, COMPILER, GCOV, PINNED, ROOT, SANITIZE, compile_native

from asi import native as tb

SOURCES = [ROOT / "firmware/core/asi_store.c", ROOT / "firmware/hal/asi_flash.c",
           ROOT / "firmware/app/asi_persist.c", ROOT / "firmware/tests/native_store.c"]
FLASH = ROOT / "tb/asi_flash.cpp"


def between_markers(path):
    return path.read_text().split("/* cffi begin */")[1].split("/* cffi end */")[0]


def library(name, sources, flags):
    """-> shared library of sources (C) with the flash model, which is C++ without its library."""
    counting = os.environ.get("FW_COVERAGE") == "1" or os.environ.get("ASI_COVERAGE") == "1" and GCOV
    if counting:
        flags, name = [*flags, "--coverage", "-DFW_GCOV"], f"{name}_lines"
    level = "-O0" if os.environ.get("FW_COVERAGE") == "1" else "-O1"
    if level == "-O1":
        flags = [*flags, *SANITIZE]
    return compile_native(BUILD / f"lib{name}.so", [*sources, *model()],
                          ["-fPIC", "-shared", level, *(f"-I{ROOT}/firmware/{d}" for d in ("hal", "app")), *flags])


def model():
    """-> [object file of the flash model], built when it is missing or old"""
    target = BUILD / "asi_flash.o"
    newest = max(p.stat().st_mtime for p in (FLASH, ROOT / "tb/asi_flash.h", ROOT / "tb/asi_tb.h"))
    if not target.exists() or target.stat().st_mtime < newest:
        target.parent.mkdir(parents=True, exist_ok=True)
        part = target.with_suffix(f".{os.getpid()}.o")
        compiler = [*PINNED[:-1], "c++"] if COMPILER == PINNED else COMPILER
        subprocess.run([*compiler, "-std=c++20", "-O2", "-fPIC", "-fno-exceptions", "-fno-rtti", "-c", str(FLASH),
                        "-o", str(part)], check=True)
        os.replace(part, target)
    return [target]


@functools.cache
def load():
    """-> (ffi, lib)"""
    ffi = cffi.FFI()
    ffi.cdef(between_markers(ROOT / "firmware/tests/native_store.h"))
    flash = tb.declarations()
    start = flash.index("typedef struct {\n    uint64_t bytes;")
    ffi.cdef(flash[start:flash.index("/* firmware_path")])
    return ffi, ffi.dlopen(str(library("asi_store", SOURCES, ["-DASI_FLASH_STORE_OFFSET=32768u"])))
