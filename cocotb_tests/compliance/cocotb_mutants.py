# SPDX-License-Identifier: Apache-2.0
"""Every mutant of a netlist against the suite, in one simulation: the first case that fails kills it.
Started by python -m cocotb_tests.compliance --mutants N."""
import json
import os
import time
from pathlib import Path

import cocotb

from cocotb_tests.compliance.adapter import AsiXact
from cocotb_tests.compliance.cases import build
from cocotb_tests.compliance.runner import Bench

HZ = int(os.environ.get("ASI_COMPLIANCE_HZ", 16_000_000))
FIRST_SHARE = 16      # a first round takes every 16th case: it kills most mutants
REQUEST_SHARE = 16    # payloads: this share is enough to turn every bit


def order(groups):
    """All cases, a spread choice of every group first."""
    groups = {ident: cases[::REQUEST_SHARE] if ident == "C-REQ" else cases for ident, cases in groups.items()}
    flat = [(case, k % FIRST_SHARE == 0) for cases in groups.values() for k, case in enumerate(cases)]
    return [case for case, early in flat if early] + [case for case, early in flat if not early]


@cocotb.test()
async def mutants(dut):
    """RX-008: no mutant first: the suite passes; then each mutant is selected and played until a case fails."""
    bench = Bench(AsiXact(dut, HZ))
    cases = order(build(HZ))
    await bench.start()
    failed = await bench.run(cases)
    assert not failed, "without a mutant: " + ", ".join(case.ident for case, _ in failed)
    rows = []
    for number in range(1, int(os.environ["ASI_COMPLIANCE_MUTANTS"]) + 1):
        begin = time.monotonic()
        bench.adapter.mutant(number)
        await bench.reset()
        failed = await bench.run(cases, stop_first=True)
        rows.append({"mutant": number, "killed_by": failed[0][0].ident if failed else None,
                     "reason": failed[0][1][:300] if failed else None, "seconds": round(time.monotonic() - begin, 2)})
        Path(os.environ["ASI_COMPLIANCE_OUT"], "mutants.json").write_text(json.dumps(rows, indent=1) + "\n")
        bench.adapter.mutant(0)
        await bench.reset()
