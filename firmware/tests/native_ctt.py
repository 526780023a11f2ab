# SPDX-License-Identifier: Apache-2.0
"""Build the engines of the combined transactions natively, as they are or with other constants, and open them."""
import functools
import os

import cffi
from native import BUILD, GCOV, ROOT, SANITIZE, compile_native

SOURCES = [*sorted((ROOT / "firmware/core").glob("asi_ctt*.c")), ROOT / "firmware/core/asi_lists.c",
           ROOT / "firmware/tests/native_ctt.c"]
OPENED = []


@functools.cache
def load(*defines: str):
    """-> (ffi, lib) built with these constants ("ASI_CTT1_COUNT_UP=1"). Global state: fc_init starts over."""
    ffi = cffi.FFI()
    text = (ROOT / "firmware/tests/native_ctt.h").read_text()
    ffi.cdef(text.split("/* cffi begin */")[1].split("/* cffi end */")[0])
    counting = ["--coverage", "-DFW_GCOV"]
    if os.environ.get("FW_COVERAGE") == "1":
        name, flags = "libasi_ctt_branches", ["-O0", *counting]
    elif os.environ.get("ASI_COVERAGE") == "1" and GCOV:
        name, flags = "libasi_ctt_lines", ["-O1", *SANITIZE, *counting]
    else:
        name, flags = "libasi_ctt", ["-O1", *SANITIZE]
    name += "".join(f"-{d.lower()}" for d in defines).replace("asi_", "").replace("=", "_")
    flags = ["-fPIC", "-shared", *flags, *(f"-D{d}" for d in defines)]
    lib = ffi.dlopen(str(compile_native(BUILD / f"{name}.so", SOURCES, flags)))
    OPENED.append(lib)
    return ffi, lib
