# SPDX-License-Identifier: Apache-2.0
"""The modules beside the tests (fake_line, native, ...) are imported by name."""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))


def pytest_sessionfinish():
    """A worker of a parallel run may be killed before its libraries write their coverage counters."""
    import native
    if native.load.cache_info().currsize:
        native.load()[1].fw_counters_write()
    import native_ctt
    for lib in native_ctt.OPENED:
        lib.fc_counters_write()
    import native_store
    if native_store.load.cache_info().currsize:
        native_store.load()[1].st_counters_write()
