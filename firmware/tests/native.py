# SPDX-License-Identifier: Apache-2.0
"""Build the protocol core natively, undefined-behaviour checks on, and open it through cffi.

The compiler is $CC, else cc, else the pinned clang of the firmware (which has no address sanitizer and no gcov).
ASI_COVERAGE=1: count lines where gcov is there; FW_COVERAGE=1: branches too, so without the sanitizer's own.
"""
import functools
import os
import shutil
import subprocess
import sys
from pathlib import Path

import cffi

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build/firmware/native"
# without the storage: it needs a flash (native_store.py)
SOURCES = [*sorted(p for p in (ROOT / "firmware/core").glob("*.c") if p.name != "asi_store.c"),
           ROOT / "firmware/tests/native.c"]
INCLUDES = [f"-I{ROOT / d}" for d in ("firmware/core", "firmware/generated")]
PINNED = [sys.executable, "-m", "ziglang", "cc"]
COMPILER = os.environ["CC"].split() if "CC" in os.environ else ["cc"] if shutil.which("cc") else PINNED
SANITIZE = ["-fsanitize=undefined", "-fno-sanitize-recover=all"]
GCOV = COMPILER != PINNED and shutil.which("gcov") is not None
WARNINGS = ["-std=c17", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror"]


def compile_native(target: Path, sources, flags) -> Path:
    """Compile -> target, by way of a unique name, so that parallel test workers do not meet; raises on failure."""
    target.parent.mkdir(parents=True, exist_ok=True)
    headers = [p for d in ("core", "generated", "tests") for p in (ROOT / "firmware" / d).glob("*.h")]
    newest = max(p.stat().st_mtime for p in [*sources, *headers])
    if not target.exists() or target.stat().st_mtime < newest:
        part = target.with_suffix(f".{os.getpid()}")
        subprocess.run([*COMPILER, *WARNINGS, *INCLUDES, "-g", *flags, *map(str, sources),
                        "-o", str(part)], check=True, cwd=target.parent)
        os.replace(part, target)
    return target


@functools.cache
def load():
    """-> (ffi, lib). The library is one line with global state: fw_init starts over."""
    ffi = cffi.FFI()
    text = (ROOT / "firmware/tests/native.h").read_text()
    ffi.cdef(text.split("/* cffi begin */")[1].split("/* cffi end */")[0])
    counting = ["--coverage", "-DFW_GCOV"]
    if os.environ.get("FW_COVERAGE") == "1":
        name, flags = "libasi_branches.so", ["-O0", *counting]
    elif os.environ.get("ASI_COVERAGE") == "1" and GCOV:
        name, flags = "libasi_lines.so", ["-O1", *SANITIZE, *counting]
    else:
        name, flags = "libasi.so", ["-O1", *SANITIZE]
    return ffi, ffi.dlopen(str(compile_native(BUILD / name, SOURCES, ["-fPIC", "-shared", *flags])))
