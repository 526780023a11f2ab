#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Generate what knows the combined transactions' constants from rdl/ctt.toml: C header, Python module, document table.

usage: gen_ctt.py [--check]
  --check  change nothing; exit 1 and name the files that differ
exit code 2: rdl/ctt.toml is not usable; one line says why, and nothing was written
"""
import argparse
import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
NOTE = "Generated from rdl/ctt.toml by tools/gen_ctt.py (make regs). Do not edit."
BEGIN, END = "<!-- ctt.toml begin -->", "<!-- ctt.toml end -->"


def rows(text):
    """TOML text -> [(group, key, value, experimental, doc)]; ValueError when a row lacks one of them."""
    out = []
    for group, keys in tomllib.loads(text).items():
        if not isinstance(keys, dict):
            raise ValueError(f"{group}: a key outside of a table")
        for key, row in keys.items():
            if (not isinstance(row, dict) or set(row) != {"value", "exp", "doc"} or type(row["value"]) is not int
                    or not isinstance(row["exp"], bool) or not isinstance(row["doc"], str)):
                raise ValueError(f"{group}.{key}: needs value (an integer), exp (true or false) and doc, nothing else")
            out.append((group, key, row["value"], row["exp"], row["doc"]))
    return out


def used():
    """Names of constants that the firmware and the native slaves ask for, e.g. CTT1_TOGGLE_POS."""
    files = [*(ROOT / "firmware/core").glob("*.[ch]"), *(ROOT / "tb").glob("*.cpp")]
    name = re.compile(r"\bASI_((?:CTT[1-5]|SAFETY)_[A-Z0-9_]+)\b")
    return {found for file in files for found in name.findall(file.read_text())}


def c_header(table):
    """-> text of firmware/generated/asi_ctt_table.h"""
    lines = ["/* SPDX-License-Identifier: Apache-2.0 */", f"/* {NOTE} */",
             "#ifndef ASI_CTT_TABLE_H", "#define ASI_CTT_TABLE_H"]
    for group, key, value, exp, doc in table:
        name = f"ASI_{group.upper()}_{key.upper()}"  # each may be overridden with -D, to build the alternatives
        lines += [f"/** {'experimental: ' * exp}{doc} */", f"#ifndef {name}", f"#define {name} {value}", "#endif"]
    return "\n".join([*lines, "#endif", ""])


def python_module(table):
    """-> text of host/python/asi/ctt_table.py"""
    lines = ["# SPDX-License-Identifier: Apache-2.0", f'"""{NOTE}"""']
    lines += [f"{group.upper()}_{key.upper()} = {value}" for group, key, value, _, _ in table]
    return "\n".join([*lines, ""])


def document(text, table):
    """-> the document with its table replaced"""
    head, rest = text.split(BEGIN)
    tail = rest.split(END)[1]
    body = ["| Parameter | Value | | Meaning |", "|---|---|---|---|"]
    body += [f"| `{g}.{k}` | {v} | {'*experimental*' if e else ''} | {d} |" for g, k, v, e, d in table]
    return head + "\n".join([BEGIN, *body, END]) + tail


def main(argv=None):
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--check", action="store_true")
    args = p.parse_args(argv)
    try:
        table = rows((ROOT / "rdl/ctt.toml").read_text())
        if gone := sorted(used() - {f"{group}_{key}".upper() for group, key, *_ in table}):
            raise ValueError(f"missing, but in use: {', '.join(gone)}")
    except ValueError as error:  # TOML that is none as well
        print(f"rdl/ctt.toml: {error}", file=sys.stderr)
        return 2
    page = ROOT / "docs/combined_transactions.md"
    outputs = {ROOT / "firmware/generated/asi_ctt_table.h": c_header(table),
               ROOT / "host/python/asi/ctt_table.py": python_module(table),
               page: document(page.read_text(), table)}
    stale = [path for path, text in outputs.items() if not path.exists() or path.read_text() != text]
    for path in stale:
        if args.check:
            print(f"{path.relative_to(ROOT)} differs from rdl/ctt.toml: make regs", file=sys.stderr)
        else:
            path.write_text(outputs[path])
    return 1 if args.check and stale else 0


if __name__ == "__main__":
    sys.exit(main())
