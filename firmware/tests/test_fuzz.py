# SPDX-License-Identifier: Apache-2.0
"""The core under the address sanitizer (where the compiler has one), as a program of its own."""
import subprocess

import pytest
from native import BUILD, COMPILER, PINNED, ROOT, SANITIZE, SOURCES, compile_native


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_random_reports(seed):
    """EX-025: random and ill-fitting reports: no access out of bounds, no undefined behaviour, consistent lists."""
    flags = ["-O1", *SANITIZE, *([] if COMPILER == PINNED else ["-fsanitize=address"])]
    program = compile_native(BUILD / "fuzz", [*SOURCES, ROOT / "firmware/tests/fuzz.c"], flags)
    done = subprocess.run([program, str(seed), "60000"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
