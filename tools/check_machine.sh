#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Say in one line what this machine lacks; exit 1 if anything. usage: check_machine.sh [PYTHON]
python=${1:-python3}
missing=()
if "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
  "$python" -c 'import venv, ensurepip' 2>/dev/null || missing+=("Python's venv module")
else
  found=$("$python" --version 2>/dev/null) || found="no $python"
  missing+=("Python 3.11 or newer (found: $found)")
fi
{ command -v c++ || command -v g++ || command -v clang++; } >/dev/null || missing+=("a C++ compiler (g++ or clang++)")
command -v make >/dev/null || missing+=("make")
command -v perl >/dev/null || missing+=("perl")
[ ${#missing[@]} -eq 0 ] && exit 0
printf -v list '%s; ' "${missing[@]}"
echo "missing on this machine: ${list%; }" >&2
exit 1
