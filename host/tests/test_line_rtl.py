# SPDX-License-Identifier: Apache-2.0
"""Telegrams through the analog line model into the real receiver RTL, faults, Monte Carlo."""
import io
import json
import re
import subprocess
import sys
from argparse import Namespace
from dataclasses import asdict, replace

import numpy as np
import pytest
from rich.console import Console

from asi.regmap import ErrorClass
from asi.telegram import decode_call, pulses, request_word, response_word
from sim.line import capture, margins, monte_carlo, sweeps
from sim.line.exchange import Hop, Repeater, Sender, Setup, exchange
from sim.line.network import bus, point_to_point, tree
from sim.line.rtl import receive

LINES = {"short": Setup((Hop(point_to_point()),)), "bus": Setup((Hop(bus()),)), "tree": Setup((Hop(tree()),))}


def rng(seed=1):
    return np.random.default_rng(seed)


def levels(train, clocks=2000, width_ns=1500.0):
    """Comparator levels of ideal pulses."""
    out = np.zeros(clocks, np.uint8)
    for t, polarity in train:
        out[round(t / 62.5):round((t + width_ns) / 62.5)] |= 1 if polarity < 0 else 2
    return out


def test_receiver_harness():
    """RX-003, RX-004, AN-006: ideal levels into the Verilated receivers come back as they were sent."""
    for word, bits, data in ((response_word(9), 7, 9), (request_word(0x2F3), 14, 0x2F3)):
        train = [(5000 + t, p) for t, p in pulses(word, bits)]
        got = receive(levels(train), 0, bits)
        assert (got.error_class, got.data, got.first) == (ErrorClass.OK, data, 80)
        assert got.pulses == [(round(t / 62.5), p) for t, p in train]
    assert receive(np.zeros(100, np.uint8), 0, 7).error_class is None
    assert receive(levels(train), 1999, 14).first is None                  # not listening
    with pytest.raises(ValueError):
        receive(np.zeros(10, np.uint8), 0, 8)


@pytest.mark.parametrize("name", LINES)
def test_nominal_exchange(name):
    """AN-006: every answer and requests of all kinds arrive over short line, 100 m with 31 slaves, and tree."""
    generator = rng()
    for data in range(16):
        call = int(generator.integers(1 << 11))
        for sent, outcome in zip((call, data), exchange(LINES[name], call, data, generator)):
            assert outcome.right and outcome.data == sent
            assert -300 < outcome.early_ns <= 0 <= outcome.late_ns < 700


@pytest.mark.parametrize("vpp", [3, 4, 6, 8])
def test_amplitudes(vpp):
    """AN-006: 3 to 8 Vpp at the receiver, both directions."""
    setup = sweeps.at_vpp(LINES["bus"], vpp)
    generator = rng(vpp)
    outcomes = [o for data in range(8) for o in exchange(setup, 100 * data, data, generator)]
    assert all(o.right for o in outcomes)
    peak = np.mean([np.abs(o.volts).max() for o in outcomes[::2]])
    assert 0.75 * vpp / 2 < peak < 1.2 * vpp / 2


def test_too_small_is_silence():
    """AN-004, AN-006: 0.9 Vpp is below the least level: NO_RESPONSE in both directions, nothing invented."""
    for outcome in exchange(sweeps.at_vpp(LINES["bus"], 0.9), 77, 5, rng()):
        assert outcome.error_class == ErrorClass.NO_RESPONSE and outcome.data is None


@pytest.mark.parametrize("gain, expected", [(0.8, (True, True)), (0.6, (None, True)), (0.2, (False, False))])
def test_must_detect(gain, expected):
    """AN-005: pulses of 80 % (request) and 60 % (answer) of the first are detected; of 20 % they are not."""
    setup = replace(LINES["bus"], master=Sender(later_gain=gain), slave=Sender(later_gain=gain))
    generator = rng(3)
    for data in range(8):
        for outcome, good in zip(exchange(setup, 55 * data, data, generator), expected):
            if good is not None:
                assert outcome.right == good and not outcome.wrong


def test_must_ignore():
    """AN-005: a foreign pulse below 30 % does no harm; one of 150 % does, and is not taken for data."""
    generator = rng(4)
    harmed = 0
    for data in range(16):
        assert all(o.right for o in exchange(replace(LINES["bus"], ghost=0.3), 99 * data, data, generator))
        strong = exchange(replace(LINES["bus"], ghost=1.5), 99 * data, data, generator)
        harmed += sum(not o.right for o in strong)
        assert not any(o.wrong for o in strong)
    assert harmed > 8


def _drop(index):
    return lambda train: [(t, p, 1.0) for k, (t, p) in enumerate(train) if k != index]


def _shift(index, ns):
    return lambda train: [(t + ns * (k == index), p, 1.0) for k, (t, p) in enumerate(train)]


def _flipped_parity(train):
    start = train[0][0]
    return [(start + t, p, 1.0) for t, p in pulses(response_word(3) ^ 2, 7)]


# answer 3: -0 +3 -6 +9 -12 +18 -21 +24 -30 +36 (E3), so the faults are those of E12
@pytest.mark.parametrize("edit, classes", [
    (lambda train: [(t, -p, 1.0) for t, p in train], {ErrorClass.START}),
    (_drop(7), {ErrorClass.ALTERNATION}),
    (_shift(8, 1500.0), {ErrorClass.TIMING}),       # -30: 1.5 us, and the first pulse was seen early
    (lambda train: [(t, p, 1.0) for k, (t, p) in enumerate(train) if k not in (6, 7)], {ErrorClass.NO_INFORMATION}),
    (_flipped_parity, {ErrorClass.PARITY}),
    (lambda train: [*((t, p, 1.0) for t, p in train), (train[-1][0] + 4000.0, -1, 1.0)], {ErrorClass.LENGTH}),
    (lambda train: [(t - 15_000.0, p, 1.0) for t, p in train], {ErrorClass.EARLY}),
    (lambda train: [], {ErrorClass.NO_RESPONSE}),
], ids=["start", "alternation", "timing", "no_information", "parity", "length", "early", "no_response"])
def test_classes_of_faults(edit, classes):
    """AN-007, RX-011: each fault of an answer, made on the line, has its class at the end of the chain."""
    def fault(train):       # applies to answers only: 7 bits last 36 us
        return edit(train) if train[-1][0] - train[0][0] < 40_000 else [(t, p, 1.0) for t, p in train]
    request, answer = exchange(replace(LINES["short"], edit=fault), 21, 3, rng(6))
    assert request.right
    assert {answer.error_class} == classes and not answer.wrong


@pytest.mark.parametrize("repeaters", [1, 2])
@pytest.mark.parametrize("retimed", [True, False])
def test_repeaters(repeaters, retimed):
    """AN-010: telegrams pass one and two repeaters; without re-timing pulses come later against the first."""
    hops = (Hop(bus()),) * (repeaters + 1)
    setup = Setup(hops, repeaters=(Repeater(retimed=retimed),) * repeaters)
    generator = rng(7)
    outcomes = [o for data in range(6) for o in exchange(setup, 300 * data, data, generator)]
    assert all(o.right for o in outcomes)
    plain = max(o.late_ns for data in range(6) for o in exchange(LINES["bus"], 300 * data, data, rng(data)))
    worst = max(o.late_ns for o in outcomes)
    assert worst <= plain + 100 if retimed else worst >= plain + repeaters * 100
    with pytest.raises(ValueError):
        exchange(Setup(hops), 1, 1, generator)


@pytest.mark.parametrize("delay, expected", [(1000.0, ErrorClass.OK), (5000.0, ErrorClass.OK),
                                             (15_000.0, ErrorClass.NO_RESPONSE)])
def test_repeater_delays_the_answer(delay, expected):
    """AN-010, LT-003: the answer comes later by twice the delay of each repeater; beyond P_RX_TIMEOUT it is none."""
    setup = Setup((Hop(point_to_point()),) * 3, repeaters=(Repeater(delay),) * 2)
    request, answer = exchange(setup, 11, 5, rng(8))
    assert request.right and answer.error_class == expected


@pytest.mark.parametrize("name, good, bad", [("fast", 1000, 45000), ("slow", 1000, 45000), ("jitter", 300, 1300),
                                             ("white_3v", 0.1, 0.4), ("length", 100, 500), ("capacitance", 0, 40)])
def test_sweep_points(name, good, bad):
    """AN-009: inside the limit no telegram fails, far outside they do, and the point says which classes."""
    point = sweeps.run_point(name, good, 8, 1)
    assert all(point[w]["failed"] == 0 and point[w]["early_ns"] <= 0 <= point[w]["late_ns"] for w in margins.WAYS)
    point = sweeps.run_point(name, bad, 8, 1)
    for where in margins.WAYS:
        assert point[where]["failed"] == sum(point[where]["classes"].values()) > 0


def test_first_error_and_limits():
    """AN-009: the first error is the first one from the good end; a limit holds only if everything up to it is good."""
    sweep = sweeps.BY_NAME["later"]                     # 100 % downwards, limits 80 / 60
    points = [{"value": v, "request": {"failed": v <= 75}, "answer": {"failed": v in (65, 40)}} for v in sweep.values]
    assert sweeps.first_error(sweep, points, "request") == (80, 75)
    assert sweeps.first_error(sweep, points, "answer") == (70, 65)
    assert sweeps.keeps_limit(sweep, points, "request") is True
    assert sweeps.keeps_limit(sweep, points, "answer") is False
    free = sweeps.BY_NAME["dip"]
    assert sweeps.keeps_limit(free, [], "answer") is None
    assert sweeps.first_error(free, [{"value": 0, "answer": {"failed": 0}}], "answer") == (0, None)


@pytest.mark.parametrize("population", monte_carlo.POPULATIONS)
def test_sample_is_reproducible(population):
    """AN-008: a Monte Carlo sample follows from seed, population and number, alone or in a row."""
    row = monte_carlo.run_samples(population, 3, 3, 1)
    alone = monte_carlo.run_sample(population, 4, 1)
    assert asdict(alone) == asdict(row[1])
    assert monte_carlo.draw(population, 4, 1)[0] == monte_carlo.draw(population, 4, 1)[0]
    assert monte_carlo.draw(population, 4, 1)[0] != monte_carlo.draw(population, 4, 2)[0]
    assert monte_carlo.draw(population, 4, 1)[0] != monte_carlo.draw(population, 5, 1)[0]


def test_drawn_installations_are_legal():
    """AN-008: legal samples keep the limits they claim: 100 m, 62 slaves, 55..68 mA, 1000 ppm, 45..55 %, 0.45 V."""
    for number in range(40):
        setup, _ = monte_carlo.draw("legal", number, 1)
        assert len(setup.repeaters) <= 2
        for hop in setup.hops:
            hop.segment.checked()
            assert len(hop.segment.loads) - 2 <= 62 and 80 <= hop.segment.cable.impedance <= 120
        for sender in (setup.master, setup.slave):
            assert 0.055 <= sender.amps <= 0.068 and abs(sender.ppm) <= 1000
        assert 0.45 <= setup.master_rx.comparators.ratio <= 0.55
        d = setup.disturbance
        assert 4 * d.white_v + d.sine_v + d.burst_v + 0.4 * d.dip_v <= 0.45 + 1e-9


def test_small_monte_carlo():
    """AN-008: 50 legal installations: no telegram is accepted wrongly, next to none fails."""
    total = monte_carlo.summary(monte_carlo.run_samples("legal", 0, 50, 1))
    assert total["samples"] == 50 and total["wrong"] == []
    for where in margins.WAYS:
        assert total[where]["telegrams"] == 50 * monte_carlo.EXCHANGES
        assert total[where]["wrong"] == 0 and total[where]["failed"] <= 2
    assert -875 <= total["early_ns"] < 0 < total["late_ns"] <= 1500


def test_stress_fails_and_says_why():
    """AN-007, AN-008: under stress many telegrams fail, each with a class of the receiver, and counts add up."""
    total = monte_carlo.summary(monte_carlo.run_samples("stress", 0, 12, 1))
    for where in margins.WAYS:
        d = total[where]
        assert d["failed"] > 0 and d["accepted"] > 0 and len(d["classes"]) >= 3
        assert d["telegrams"] == d["accepted"] + sum(d["classes"].values()) and d["failed"] >= d["wrong"]


def test_confidence_bound():
    """AN-008: the 95 % bound: 3/n without an event, exact for small numbers, 1 when everything fails."""
    assert monte_carlo.upper_bound(0, 1000) == pytest.approx(1 - 0.05 ** (1 / 1000), rel=1e-6)
    assert monte_carlo.upper_bound(1, 2) == pytest.approx(0.9747, abs=1e-3)
    assert monte_carlo.upper_bound(2, 100) == pytest.approx(0.0616, abs=1e-3)
    assert monte_carlo.upper_bound(5, 5) == 1.0


@pytest.fixture
def few_sweeps(monkeypatch):
    monkeypatch.setattr(margins, "SWEEPS", tuple(s for s in sweeps.SWEEPS if s.name in ("repeaters", "mains")))


ARGS = Namespace(samples=2, telegrams=2, seed=1, no_dask=True, scheduler="")


def test_margins_tables(few_sweeps):
    """AN-009: `make margins` in one process: every sweep and population in data and tables; what is broken is named."""
    console = Console(record=True, width=200, file=io.StringIO())
    data = json.loads(json.dumps(margins.measure(ARGS, console)))
    assert [e["name"] for e in data["sweeps"]] == ["mains", "repeaters"]
    assert data["monte_carlo"]["legal"]["request"]["telegrams"] == 2 * monte_carlo.EXCHANGES
    assert margins.broken(data) == []
    margins.show(data, console)
    assert "repeaters in series, re-timed" in console.export_text()
    data["monte_carlo"]["legal"]["answer"]["wrong"] = 1
    data["sweeps"][1]["request"]["keeps_limit"] = False
    assert len(margins.broken(data)) == 2


def test_margins_page(tmp_path):
    """AN-009: the page has every sweep and both populations, and its plots exist."""
    pytest.importorskip("matplotlib", reason="matplotlib comes with make margins only")
    from sim.line.margins_page import write_page
    points = [{"value": v, **{w: {"telegrams": 2, "failed": 0, "wrong": 0, "classes": {}} for w in margins.WAYS}}
              for v in (0, 1)]
    way = {"last_good": 1, "first_bad": None, "keeps_limit": None, "wrong": 0}
    part = monte_carlo.run_samples("legal", 0, 2, 1)
    found = {**monte_carlo.summary(part), "extremes_ns": [[s.early_ns, s.late_ns] for s in part],
             "by_disturbance": margins.by_disturbance(part)}
    data = {"date": "2026-01-01", "seconds": 1, "seed": 1, "command": "x", "telegrams_per_point": 2,
            "exchanges_per_sample": 16,
            "sweeps": [{"name": s.name, "title": s.title, "unit": s.unit, "source": s.source, "points": points,
                        "limits": {"request": None, "answer": None}, "request": way, "answer": way}
                       for s in sweeps.SWEEPS], "monte_carlo": {"legal": found, "stress": found}}
    write_page(data, tmp_path, tmp_path / "images")
    page = (tmp_path / "margins.md").read_text()
    assert all(f"| {s.title} |" in page for s in sweeps.SWEEPS)
    for image in re.findall(r"!\[.*?\]\((.*?)\)", page):
        assert (tmp_path / image).read_text().rstrip().endswith("</svg>")
    assert page.count("![") == 3


def test_margins_command():
    """AN-008, AN-009: --sample runs a sample again; a wrong population and no samples are refused in one line."""
    def run(*args):
        return subprocess.run([sys.executable, "-m", "sim.line.margins", *args], capture_output=True, text=True)
    done = run("--sample", "legal:4")
    assert done.returncode == 0 and "Sample(" in done.stdout
    for args in (("--sample", "odd:1"), ("--sample", "legal:x"), ("--samples", "0")):
        done = run(*args)
        assert done.returncode == 1 and len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("probe", ["master", "far"])
def test_capture_decodes(tmp_path, probe):
    """AN-011, DE-011: the voltage at either end of a 100 m line, as CSV, decodes to the exchange it was made from."""
    file, out = tmp_path / "line.csv", tmp_path / "out.jsonl"
    capture.write_csv(file, *capture.volts(capture.EXAMPLE, probe=probe))
    done = subprocess.run([sys.executable, "-m", "asi", "decode", str(file), "--format", "jsonl", "--out", str(out)],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = [json.loads(line) for line in out.read_text().splitlines()]
    assert [r["word"] for r in found] == [call for call, _ in capture.EXAMPLE]
    assert [r["call"] for r in found] == [decode_call(call).name for call, _ in capture.EXAMPLE]
    assert [r["answer"] and int(r["answer"], 2) for r in found] == [answer for _, answer in capture.EXAMPLE]
    assert [r["class"] for r in found] == ["OK", "OK", "OK", "NO_RESPONSE", "OK"]
