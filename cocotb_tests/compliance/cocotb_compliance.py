# SPDX-License-Identifier: Apache-2.0
"""The compliance suite in the simulator: one test per group. Started by python -m cocotb_tests.compliance."""
import json
import os
from pathlib import Path

import cocotb

from cocotb_tests.compliance.adapter import AsiXact
from cocotb_tests.compliance.cases import build
from cocotb_tests.compliance.runner import Bench

HZ = int(os.environ.get("ASI_COMPLIANCE_HZ", 16_000_000))
OUT = os.environ.get("ASI_COMPLIANCE_OUT")     # folder for one JSON file per group
STOP = os.environ.get("ASI_COMPLIANCE_STOP") == "1"


async def play(dut, ident):
    """Play a group and write its results; the assertion names every case that failed."""
    bench = Bench(AsiXact(dut, HZ))
    cases = [case for case in build(HZ, [ident])[ident] if set(case.needs) <= bench.adapter.abilities
             and (case.margin is None or case.margin >= bench.adapter.slack)]
    await bench.start()
    failed = await bench.run(cases, STOP)
    reasons = {}
    for case, message in failed:
        reasons.setdefault(case.ident, message)
    if OUT:
        rows = [{"id": case.ident, "title": case.title, "rules": list(case.rules),
                 "class": "ABORTED" if case.kind == "abort" else case.outcomes[-1].error,
                 "failed": reasons.get(case.ident)} for case in cases]
        Path(OUT, f"{ident}.json").write_text(json.dumps(rows) + "\n")
    assert cases and not failed, "\n".join(f"{case.ident} ({case.title}): {text}" for case, text in failed)


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def good_answers(dut):
    """TL-002, TL-003, TL-005, RX-013, LT-002, LT-003, LT-004: all 16 answers at five response delays."""
    await play(dut, "C-ANS")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def echo_delays(dut):
    """RX-012, RX-014, TL-006: own request heard with every delay from 0 to 1 us, clock by clock, and 1.5 to 3
    us."""
    await play(dut, "C-ECD")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def window_edges(dut):
    """RX-003, RX-008, RX-010: one pulse of an answer moved to both limits of its window, two clocks inside to
    two clocks outside."""
    await play(dut, "C-WIN")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def jitter(dut):
    """RX-003, RX-010, LT-004: all pulses of an answer moved inside their windows; drift, which a
    resynchronising receiver would accept."""
    await play(dut, "C-JIT")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def start(dut):
    """RX-001, RX-008: start: first pulse positive: whole answers inverted, first pulse missing, a positive
    pulse before the answer."""
    await play(dut, "C-STA")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def alternation(dut):
    """RX-002, RX-008: alternation: polarity of each pulse turned, alone, with all that follow, with its
    neighbour."""
    await play(dut, "C-ALT")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def timing(dut):
    """RX-003, RX-008: timing: a pulse of each window moved into the dead zones beside it; swapped order of
    failed checks."""
    await play(dut, "C-TIM")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def no_information(dut):
    """RX-004, RX-008, RX-011: no information: each window without its pulse, with and without a break in the
    alternation; broken-off answers."""
    await play(dut, "C-INF")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def parity(dut):
    """RX-005, RX-008, TL-003: parity: every answer with a wrong parity bit, and with every single bit
    turned."""
    await play(dut, "C-PAR")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def end_bit(dut):
    """RX-006, RX-008: end bit: every answer, right and wrong parity, with a negative end pulse."""
    await play(dut, "C-END")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def length(dut):
    """RX-007, RX-008: length: every answer with one, two and many pulses after its end; longer telegrams;
    earlier checks come first."""
    await play(dut, "C-LEN")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def length_clocks(dut):
    """RX-007: length: a pulse after the end at every clock until two clocks after the window."""
    await play(dut, "C-LNC")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def extra_pulses(dut):
    """RX-003, RX-002, RX-008: a pulse too many in every dead zone, both polarities; pairs, which keep the
    alternation; two in one window."""
    await play(dut, "C-EXT")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def both_lines(dut):
    """RX-003, RX-008: both comparators at once: never a good answer; which check names it is open."""
    await play(dut, "C-BOT")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def glitches(dut):
    """RX-009: pulses around the filter's 750 ns: on a quiet line, inside answers, as whole answers, on both
    lines."""
    await play(dut, "C-FLT")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def window_opens(dut):
    """LT-002, LT-006, RX-012: pulses and answers around the opening of the response window and the end of the
    read-back, clock by clock."""
    await play(dut, "C-OPN")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def time_out(dut):
    """LT-003, LT-005, LT-006, RX-011, RX-013: answers and pulses around the time-out, clock by clock; silence;
    late answers and what follows them."""
    await play(dut, "C-TMO")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def two_slaves(dut):
    """RX-002, RX-003, RX-008: two answers at once: the same and different data, together and shifted by 1 clock
    to 12 us."""
    await play(dut, "C-TWO")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def read_back(dut):
    """RX-014, RX-002, RX-004, RX-007: own request damaged: each pulse missing or turned, each bit another, a
    pulse more, no echo, late echo."""
    await play(dut, "C-OWN")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def read_back_windows(dut):
    """RX-003, RX-014: own request: each of its pulses at both limits of its window, one clock inside to one
    clock outside."""
    await play(dut, "C-OWW")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def gaps(dut):
    """LT-004, LT-005, LT-006, LT-009: gaps: end pulse at its limits; after each class; restarted by pulses at
    many places, also after their end."""
    await play(dut, "C-GAP")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def late_requests(dut):
    """LT-009: requests offered after the gap: the whole lead of tx_en."""
    await play(dut, "C-LAT")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def babble(dut):
    """LT-007: a line that never gets quiet: the next request comes after 1 ms."""
    await play(dut, "C-BAB")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def idle(dut):
    """LT-008: first request after a stop: 60 us of quiet, restarted by pulses."""
    await play(dut, "C-IDL")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def abort(dut):
    """LT-011: stop while a call is open: ABORTED, and the request on the line is completed."""
    await play(dut, "C-ABO")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def repetitions(dut):
    """LT-006, LT-012, RX-008: repetitions: each class first, then each class or a good answer; 0 to 3
    repetitions; all fail."""
    await play(dut, "C-REP")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def broadcasts(dut):
    """RX-008, LT-005, LT-006: calls without an answer: silence is success; an answer or a disturbance is judged
    as always."""
    await play(dut, "C-BRC")


@cocotb.test(timeout_time=900, timeout_unit="ms")
async def requests(dut):
    """TL-001, TL-003, TL-004, TL-005, LT-001, LT-005, RX-014: all 2048 payloads: the pulse grid on tx_man, and
    the echo is good."""
    await play(dut, "C-REQ")
