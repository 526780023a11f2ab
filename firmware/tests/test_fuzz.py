# SPDX-License-Identifier: Apache-2.0
"""The core under the address sanitizer (where the compiler has one), as a program of its own."""
import subprocess

import pytest
from native import BUILD, COMPILER, PINNED, ROOT, SANITIZE, SOURCES, compile_native

CORPUS = sorted((ROOT / "firmware/tests/corpus").iterdir())


def run(*arguments):
    flags = ["-O1", *SANITIZE, *([] if COMPILER == PINNED else ["-fsanitize=address"])]
    program = compile_native(BUILD / "fuzz", [*SOURCES, ROOT / "firmware/tests/fuzz.c"], flags)
    done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return int(done.stdout.split()[0])


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_random_inputs(seed):
    """EX-025: random slaves, answers, functions and ill-fitting reports: no access out of bounds, no undefined
    behaviour, consistent lists, refused functions change nothing."""
    assert run(seed, 150) > 3_000


def test_corpus():
    """EX-025: what coverage-guided fuzzing (`make fuzz`) has found so far still holds."""
    assert len(CORPUS) > 20 and run(*CORPUS) > 1_000
