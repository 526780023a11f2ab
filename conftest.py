# SPDX-License-Identifier: Apache-2.0
"""After a run with ASI_COVERAGE=1: the coverage figures, above pytest's closing line."""
import json
import os
from pathlib import Path


def pytest_terminal_summary(terminalreporter):
    if os.environ.get("ASI_COVERAGE") != "1":
        return
    from tools.coverage import report
    text, data = report()
    terminalreporter.section("coverage")
    terminalreporter.write_line("\n".join(text))
    target = Path(__file__).parent / "build/test/coverage.json"
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(json.dumps(data, indent=1) + "\n")
