# SPDX-License-Identifier: Apache-2.0
"""The modules beside the tests (fake_line, native, ...) are imported by name."""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
