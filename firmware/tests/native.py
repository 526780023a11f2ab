# SPDX-License-Identifier: Apache-2.0
"""Build the protocol core natively (undefined-behaviour checks on, gcov notes beside it) and open it through cffi."""
import functools
import os
import subprocess
from pathlib import Path

import cffi

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build/firmware/native"
SOURCES = [*sorted((ROOT / "firmware/core").glob("*.c")), ROOT / "firmware/tests/native.c"]
INCLUDES = [f"-I{ROOT / d}" for d in ("firmware/core", "firmware/generated")]
WARNINGS = ["-std=c17", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror"]


def compile_native(target: Path, sources, flags) -> Path:
    """cc -> target, by way of a unique name, so that parallel test workers do not meet; raises on failure."""
    target.parent.mkdir(parents=True, exist_ok=True)
    headers = [p for d in ("core", "generated", "tests") for p in (ROOT / "firmware" / d).glob("*.h")]
    newest = max(p.stat().st_mtime for p in [*sources, *headers])
    if not target.exists() or target.stat().st_mtime < newest:
        part = target.with_suffix(f".{os.getpid()}")
        subprocess.run([os.environ.get("CC", "cc"), *WARNINGS, *INCLUDES, "-g", *flags, *map(str, sources),
                        "-o", str(part)], check=True, cwd=target.parent)
        os.replace(part, target)
    return target


@functools.cache
def load():
    """-> (ffi, lib). The library is one line with global state: fw_init starts over."""
    ffi = cffi.FFI()
    text = (ROOT / "firmware/tests/native.h").read_text()
    ffi.cdef(text.split("/* cffi begin */")[1].split("/* cffi end */")[0])
    if os.environ.get("FW_COVERAGE") == "1":  # without the sanitizer, whose branches are never taken
        name, flags = "libasi_cov.so", ["-O0", "-fPIC", "-shared", "--coverage"]
    else:
        name, flags = "libasi.so", ["-O1", "-fPIC", "-shared", "-fsanitize=undefined", "-fno-sanitize-recover=all"]
    return ffi, ffi.dlopen(str(compile_native(BUILD / name, SOURCES, flags)))
