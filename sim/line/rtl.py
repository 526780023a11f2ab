# SPDX-License-Identifier: Apache-2.0
"""The chip's receivers (asi_sync, asi_pulse_filter, asi_rx as they are synthesised) from Python.

Binding of tb/asi_line_rx.h (cffi, ABI mode). Times are in receiver clocks of 62.5 ns.
"""
import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from cffi import FFI

_ROOT = Path(__file__).resolve().parents[2]
LIBRARY = _ROOT / "build/tb/libasi_line_rx.so"
STROBE_CLOCKS = 12 + 2          # 750 ns filter and synchroniser: from a level to its strobe, at 16 MHz


class Received(NamedTuple):
    first: int | None           # clock of the first pulse (as on the pins), None: none
    error_class: int | None     # asi.regmap.ErrorClass, None: nothing was received
    data: int | None            # payload of an accepted telegram
    pulses: list[tuple[int, int]]   # accepted pulses: clock (as on the pins), polarity


@cache
def _library():
    ffi = FFI()
    header = (_ROOT / "tb/asi_line_rx.h").read_text()
    strobes = re.search(r"#define ASI_LINE_RX_STROBES (\d+)", header)[1]
    text = re.sub(r"/\*.*?\*/", "", header, flags=re.S)
    ffi.cdef(text[text.index("typedef struct"):text.rindex("#ifdef __cplusplus")].replace(
        "ASI_LINE_RX_STROBES", strobes))
    if not LIBRARY.exists():
        raise FileNotFoundError(f"{LIBRARY.relative_to(_ROOT)} is missing: make {LIBRARY.relative_to(_ROOT)}")
    return ffi, ffi.dlopen(str(LIBRARY))


def receive(levels: np.ndarray, enable: int, bits: int) -> Received:
    """Run the receiver over comparator levels (uint8, bit 0 negative, bit 1 positive), listening from clock enable."""
    ffi, lib = _library()
    levels = np.ascontiguousarray(levels, np.uint8)
    result = ffi.new("asi_line_rx_result *")
    if lib.asi_line_rx_run(ffi.from_buffer("uint8_t[]", levels), len(levels), enable, bits, result):
        raise ValueError(f"receiver of {bits} bits: 7 (answers) and 14 (requests) exist")
    pulses = [((word >> 2) - STROBE_CLOCKS, 1 if word & 2 else -1) for word in result.strobe[0:result.strobes]]
    done = result.done >= 0
    return Received(result.first - STROBE_CLOCKS if result.first >= 0 else None, result.error_class if done else None,
                    result.data if done and result.error_class == 0 else None, pulses)
