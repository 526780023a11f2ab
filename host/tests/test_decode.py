# SPDX-License-Identifier: Apache-2.0
"""The telegram decoder: captures made pulse by pulse in every format, captures of the chip, damaged files.

test_run_and_capture_agree needs build/tb/libasi_chip_trace.so and build/firmware/asi_test.hex; `make test` builds both.
"""
import csv
import io
import json
import math
import random
import re
import struct
import tracemalloc
import zipfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from asi import decode as decoding
from asi.bench import name_waves, open_bench
from asi.capture import Analog, CaptureError, Comparators, Info, Manchester, Options, Sink
from asi.cli import QUICK_SETTLE_NS, app
from asi.plant import Faults, load_plant
from asi.run import Runner
from asi.telegram import encode_call, pulses, request_pulses, response_pulses, response_word

ROOT = Path(__file__).resolve().parents[2]
WIDTH = 1_500
END = 200_000       # quiet after the last pulse


# ---------------------------------------------------------------- making captures
def conversation(*calls, start=100_000, delay=21_500):
    """(call, nibble, answer pulses or a nibble) -> [(t_ns, polarity)]; an answer None is silence."""
    out, t = [], start
    for call, answer in calls:
        out += [(t + dt, polarity) for dt, polarity in request_pulses(call)]
        t += 78_000
        train = response_pulses(answer) if isinstance(answer, int) else answer
        if train is None:
            t += 72_000
            continue
        out += [(t + delay + dt, polarity) for dt, polarity in train]
        t += delay + 36_000 + (18_500 if isinstance(answer, int) else 40_000)
    return out


def levels(train, width=WIDTH, start=0, end=None):
    """Pulses -> [(t_ns, p, n)], one entry per change, the ends of the capture included."""
    events = sorted([(t, pol, 1) for t, pol in train] + [(t + width, pol, -1) for t, pol in train],
                    key=lambda e: (e[0], e[2]))
    count, out = {1: 0, -1: 0}, {start: (0, 0)}
    for t, polarity, step in events:
        count[polarity] += step
        out[t] = (int(count[1] > 0), int(count[-1] > 0))
    end = max(out) + END if end is None else end
    out.setdefault(end, (0, 0))
    return [(t, p, n) for t, (p, n) in sorted(out.items()) if start <= t <= end]


def man_levels(train, start=0):
    return [(start, 1)] + [(t, int(polarity > 0)) for t, polarity in train] + [(train[-1][0] + END, 1)]


def vcd(rows, names=("rx_p_i", "rx_n_i"), scale="1 ns", per_ns=1):
    codes = "!%&*"
    out = [f"$timescale {scale} $end", "$scope module top $end",
           *(f"$var wire 1 {code} {name} $end" for code, name in zip(codes, names)), "$upscope $end",
           "$enddefinitions $end"]
    for t, *values in rows:
        out += [f"#{round(t * per_ns)}", *(f"{v}{code}" for v, code in zip(values, codes))]
    return "\n".join(out) + "\n"


def csv_text(rows, head="time_ns,rx_p,rx_n", digits=0):
    return "\n".join([head, *(",".join([f"{t:.{digits}f}", *map(str, v)]) for t, *v in rows)]) + "\n"


def sampled(rows, rate):
    """Changes -> bytes, one per sample: bit 0 p (or MAN), bit 1 n."""
    step, out, now = 1e9 / rate, bytearray(), 0
    count = int(rows[-1][0] / step)
    for k in range(count):
        while now + 1 < len(rows) and rows[now + 1][0] <= k * step:
            now += 1
        out.append(sum(v << slot for slot, v in enumerate(rows[now][1:])))
    return bytes(out)


def session(data, rate, names=("rx_p", "rx_n"), size=1, parts=1, analog=False):
    meta = (f"[global]\nsigrok version=0.5.2\n\n[device 1]\nsamplerate={rate / 1e6:g} MHz\n")
    if analog:
        meta += f"total analog=1\nanalog1={names[0]}\n"
    else:
        meta += f"capturefile=logic-1\nunitsize={size}\ntotal probes={len(names)}\n" + "".join(
            f"probe{k + 1}={name}\n" for k, name in enumerate(names))
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("version", "2")
        file.writestr("metadata", meta)
        stem, cut = ("analog-1-1" if analog else "logic-1"), -(-len(data) // parts)
        for k in range(parts):
            file.writestr(f"{stem}-{k + 1}", data[k * cut:(k + 1) * cut])
    return buffer.getvalue()


def volts(train, rate, amplitude=lambda t: 2.4, dc=30.0, noise=0.0, ripple=0.0, seed=1):
    """Samples of sin^2 pulses, 3 us at their base; a pulse 'starts' where it crosses half its height, 0.75 us in."""
    step, end = 1e9 / rate, train[-1][0] + END
    rng = random.Random(seed)
    out = [dc + (rng.uniform(-noise, noise) if noise else 0.0) + ripple * math.sin(k * step / 2e6)
           for k in range(int(end / step))]
    for t, polarity in train:
        first = t - 750
        for k in range(max(0, math.ceil(first / step)), min(len(out), int((first + 3_000) / step) + 1)):
            out[k] += polarity * amplitude(t) * math.sin(math.pi * (k * step - first) / 3_000) ** 2
    return out


CALLS = [encode_call("RDIO", 5), encode_call("RDID", 5), encode_call("DEXG", 5, 0b1010), encode_call("WPAR", 12, 6),
         encode_call("DEXG", 31, 15), encode_call("RID1", 37)]
TALK = [(call, 3 * k + 1 & 15) for k, call in enumerate(CALLS)] + [(encode_call("RDIO", 9), None)]
TRAIN = conversation(*TALK)


def run_decoder(tmp_path, content, name="capture", **options):
    """-> (records, statistics)."""
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    records = []
    decoder = decoding.Decoder(records.append)
    info = decoding.decode(path, decoder, Options(**options))
    return records, decoder.statistics(path, info)


def short(records):
    return [(r["word"], r["answer"] and int(r["answer"], 2), r["class"]) for r in records]


EXPECTED = [(call, answer, "NO_RESPONSE" if answer is None else "OK") for call, answer in TALK]


# ---------------------------------------------------------------- formats
FORMATS = {
    "vcd": lambda: vcd(levels(TRAIN)),
    "vcd ps": lambda: vcd(levels(TRAIN), scale="10 ps", per_ns=100),
    "vcd man": lambda: vcd(man_levels(TRAIN), ("MAN",)),
    "csv": lambda: csv_text(levels(TRAIN)),
    "csv seconds": lambda: csv_text([(t / 1e9, p, n) for t, p, n in levels(TRAIN)], "Time [s],p,n", 9),
    "csv man": lambda: csv_text(man_levels(TRAIN), "time (us),man").replace("time (us)", "time (ns)"),
    "csv one column": lambda: csv_text(man_levels(TRAIN), "time_ns,channel 0"),
    "csv semicolon": lambda: csv_text([(t / 1e9, p, n) for t, p, n in levels(TRAIN)], "t;rx_p;rx_n", 9)
    .replace(",", ";").replace(".", ","),
    "sigrok": lambda: session(sampled(levels(TRAIN), 4e6), 4e6),
    "sigrok 2 MHz": lambda: session(sampled(levels(TRAIN), 2e6), 2e6, parts=3),
    "sigrok man": lambda: session(sampled(man_levels(TRAIN), 12e6), 12e6, ("MAN",)),
    "sigrok wide": lambda: session(b"".join(bytes((0, v)) for v in sampled(levels(TRAIN), 5e6)), 5e6,
                                   [f"D{k}" for k in range(8)] + ["rx_p", "rx_n"], size=2, parts=2),
    "sigrok analog": lambda: session(struct.pack(f"<{len(v := volts(TRAIN, 5e6))}f", *v), 5e6, ("CH1",), analog=True),
    "csv analog": lambda: csv_text([(k * 250, f"{v:.3f}") for k, v in enumerate(volts(TRAIN, 4e6))], "time_ns,u [V]"),
}


@pytest.mark.parametrize("form", FORMATS)
def test_formats(tmp_path, form):
    """DE-001, DE-003: one conversation, every format and front end: the same telegrams, times to a sample."""
    records, statistics = run_decoder(tmp_path, FORMATS[form]())
    assert short(records) == EXPECTED
    for record, t in zip(records, [100_000 + 154_000 * k for k in range(7)]):
        assert abs(record["t_ns"] - t) <= 500
        assert record["delay_ns"] is None or abs(record["delay_ns"] - 21_500) <= 500
    exact = form.startswith(("vcd", "csv")) and "analog" not in form
    assert all(record["delay_ns"] in (21_500, None) for record in records) or not exact
    assert statistics["notes"] == []


def test_analog_2_mhz(tmp_path):
    """DE-011, DE-012: volts at the slowest sample rate, with a DC part, its ripple and noise."""
    data = volts(TRAIN, 2e6, noise=0.2, ripple=0.3)
    records, _ = run_decoder(tmp_path, session(struct.pack(f"<{len(data)}f", *data), 2e6, ("CH1",), analog=True))
    assert short(records) == EXPECTED


def test_analog_threshold_per_telegram(tmp_path):
    """DE-011: half of the first negative pulse, new in each pause: near and far slaves of 1.5 and 4 V both decode."""
    train = conversation(*[(encode_call("RDIO", 5), 9)] * 6)
    swing = {k: (4.0, 1.5)[k % 2] for k in range(12)}
    data = volts(train, 10e6, amplitude=lambda t: swing[int((t - 100_000) // 154_000 * 2
                                                            + ((t - 100_000) % 154_000 > 90_000))], dc=-12.0)
    content = session(struct.pack(f"<{len(data)}f", *data), 10e6, ("CH1",), analog=True)
    records, _ = run_decoder(tmp_path, content)
    assert short(records) == [(encode_call("RDIO", 5), 9, "OK")] * 6
    # the last pulse of the answer: 45 % of the first one is nothing, 70 % is a pulse (55 % is one too short, RX-009)
    for part, error in ((0.45, "NO_INFORMATION"), (0.7, "OK")):
        one = conversation((encode_call("RDIO", 5), 9))
        last = one[-1][0]
        data = volts(one, 10e6, amplitude=lambda t: 2.0 * (part if t == last else 1))
        records, _ = run_decoder(tmp_path, session(struct.pack(f"<{len(data)}f", *data), 10e6, ("A",), analog=True))
        assert [r["class"] for r in records] == [error]


@pytest.mark.parametrize("swap", [False, True])
def test_invert(tmp_path, swap):
    """DE-003: swapped wires are hinted at and put right by --invert, in every front end."""
    pair = levels(TRAIN)
    for rows, names in (([(t, n, p) for t, p, n in pair], ("rx_p", "rx_n")),
                        ([(t, 1 - m) for t, m in man_levels(TRAIN)], ("man",))):
        records, statistics = run_decoder(tmp_path, vcd(rows, names), invert=swap)
        assert (short(records) == EXPECTED) == swap
        assert any("--invert" in note for note in statistics["notes"]) != swap


def test_two_man_signals(tmp_path):
    """DE-003: transmitter and receiver on two MAN signals; the transmitter alone is said to miss the answers."""
    requests = [[(100_000 + 154_000 * k + dt, pol) for dt, pol in request_pulses(call)]
                for k, (call, _) in enumerate(TALK)]
    tx = {e for one in requests for e in one}
    rows = {t: [None, None] for t, _ in TRAIN}
    rows[0] = [1, 1]
    for t, polarity in TRAIN:
        rows[t][(t, polarity) not in tx] = int(polarity > 0)
    state, out = [1, 1], []
    for t, change in sorted(rows.items()):
        state = [old if new is None else new for old, new in zip(state, change)]
        out.append((t, *state))
    out.append((out[-1][0] + END, 1, 1))
    records, statistics = run_decoder(tmp_path, vcd(out, ("tx_man_o", "other")), man=("tx_man_o", "other"))
    assert short(records) == EXPECTED and statistics["notes"] == []
    records, statistics = run_decoder(tmp_path, vcd(out, ("tx_man_o", "other")))
    assert {r["class"] for r in records} == {"NO_RESPONSE"} and "transmitter only" in statistics["notes"][0]


def test_signal_names(tmp_path):
    """DE-003: the outermost of equal names is taken, an option wins, a column may be a number; else a refusal."""
    text = vcd(levels(TRAIN), ("a", "b"))
    with pytest.raises(CaptureError, match=r"cannot tell .* there are: top\.a, top\.b$"):
        run_decoder(tmp_path, text)
    assert short(run_decoder(tmp_path, text, p="a", n="top.b")[0]) == EXPECTED
    with pytest.raises(CaptureError, match="no signal 'c'"):
        run_decoder(tmp_path, text, p="a", n="c")
    for bad in (dict(p="a"), dict(p="a", n="b", man=("a",))):
        with pytest.raises(CaptureError):
            run_decoder(tmp_path, text, **bad)
    rows = csv_text(levels(TRAIN), "when,one,two")
    assert short(run_decoder(tmp_path, rows, p="2", n="3", time_unit="ns")[0]) == EXPECTED
    bare = rows.split("\n", 1)[1]
    assert short(run_decoder(tmp_path, bare, columns=("time_ns", "p", "n"))[0]) == EXPECTED
    inner = vcd(levels(TRAIN)).replace(
        "$upscope", "$scope module x $end $var wire 1 @ rx_p_i $end $upscope $end $upscope")
    assert run_decoder(tmp_path, inner)[1]["signals"] == ["top.rx_p_i", "top.rx_n_i"]


# ---------------------------------------------------------------- pulses
def test_short_pulses_are_ignored(tmp_path):
    """DE-012, RX-009: 749 ns are nothing, 750 ns are a pulse, a drop-out of 749 ns does not end one."""
    for front in ("p", "man"):
        for width, count in ((749, 0), (750, 1)):
            seen = []
            if front == "p":
                part = Comparators(Sink(lambda t, polarity: seen.append((t, polarity))), 750)
                for t, p in ((0, 0), (1_000, 1), (1_000 + width, 0)):
                    part.levels(t, p, 0)
            else:
                part = Manchester(Sink(lambda t, polarity: seen.append((t, polarity))), 750)
                for t, level in ((0, 1), (1_000, 0), (1_000 + width, 1)):
                    part.level(t, level)
            part.settle(1_500 + width)
            assert seen == [(1_000, 1 if front == "p" else -1)] * count
    seen = []
    part = Comparators(Sink(lambda t, polarity: seen.append((t, polarity))), 750)
    for t, n in ((0, 0), (1_000, 1), (2_000, 0), (2_749, 1), (3_500, 0), (9_000, 0)):
        part.levels(t, 0, n)
    assert seen == [(1_000, -1)]
    spikes = sorted(levels(TRAIN) + [(60_000, 1, 0), (60_700, 0, 0), (90_000, 0, 1), (90_700, 0, 0)])
    assert short(run_decoder(tmp_path, vcd(spikes))[0]) == EXPECTED


@pytest.mark.parametrize("ppm", [-1000, 0, 1000])
def test_clock_error_and_jitter(tmp_path, ppm):
    """DE-004, RX-010: a clock 1000 ppm off with 200 ns of jitter decodes; the deviation found is the one put in."""
    rng = random.Random(ppm)
    base, out, largest = 100_000, [], 0
    for k in range(40):
        for word, bits, at in ((request_pulses(encode_call("DEXG", 5, k & 15)), 14, 0),
                               (response_pulses(k * 7 & 15), 7, 99_500)):
            jitter = [0] + [rng.randint(-200, 200) for _ in word[1:]]
            moved = [(round(dt * (1 + ppm / 1e6)) + j, pol) for (dt, pol), j in zip(word, jitter)]
            if bits == 7:
                largest = max(largest, *(abs(m - dt) for (m, _), (dt, _) in zip(moved, word)))
            out += [(base + at + dt, pol) for dt, pol in moved]
        base += 154_200
    records, statistics = run_decoder(tmp_path, vcd(levels(out)))
    assert [(r["class"], r["answer"]) for r in records] == [("OK", f"{k * 7 & 15:04b}") for k in range(40)]
    assert abs(statistics["slaves"][0]["deviation_ns"]) == largest
    assert 150 < abs(statistics["request_deviation_ns"]) <= 278


E3 = response_pulses(0b0011)
FAULTS = {
    "START": [(t, -p) for t, p in E3],
    "ALTERNATION": E3[:8] + E3[9:],
    "TIMING": [(t + (2_000 if k == 3 else 0), p) for k, (t, p) in enumerate(E3)],
    "NO_INFORMATION": E3[:6] + E3[8:],
    "END_BIT": pulses(response_word(2) ^ 1, 7),
    "PARITY": pulses(response_word(3) ^ 2, 7),
    "LENGTH": [*E3, (39_000, -1)],
    "OK": E3,
}


@pytest.mark.parametrize("error", FAULTS)
def test_error_classes(tmp_path, error):
    """DE-004, RX-001..RX-008: each fault of an answer gives its class, the telegrams around it are not touched."""
    call = encode_call("RDIO", 5)
    train = conversation((call, 1), (call, FAULTS[error]), (call, 2))
    records, statistics = run_decoder(tmp_path, vcd(levels(train, 1_000)))
    assert [r["class"] for r in records] == ["OK", error, "OK"]
    assert [r["answer"] for r in records] == ["0001", "0011" if error == "OK" else None, "0010"]
    assert statistics["slaves"][0]["by_class"] == ({"OK": 3} if error == "OK" else {"OK": 2, error: 1})


def test_early_late_and_silent(tmp_path):
    """DE-004, LT-002, LT-003: a pulse before 12 us is EARLY, none until 66 us NO_RESPONSE, a broadcast needs none."""
    call = encode_call("RDIO", 5)
    for delay, error in ((11_999, "EARLY"), (12_000, "OK"), (66_000, "OK"), (66_001, "NO_RESPONSE")):
        train = conversation((call, 3), delay=delay)
        records, _ = run_decoder(tmp_path, vcd(levels(train, 1_000)))
        assert records[0]["class"] == error
    records, _ = run_decoder(tmp_path, vcd(levels(conversation((encode_call("BR01"), None)), 1_000)))
    assert [(r["call"], r["class"], r["answer"]) for r in records] == [("BR01", "OK", None)]


def test_bad_requests_and_repetitions(tmp_path):
    """DE-004: a request that lost a pulse is one line with its class; an immediate repetition is marked."""
    call = encode_call("RDIO", 5)
    train = conversation((call, 1), (call, None), (call, 2))
    cut = [e for e in conversation((call, 1), start=1_500_000) if e[0] != 1_500_000 + 78_000][:-12]
    records, statistics = run_decoder(tmp_path, vcd(levels(train + cut)))
    assert [(r["request_ok"], r["class"], r["repeated"]) for r in records] == [
        (True, "OK", False), (True, "NO_RESPONSE", False), (True, "OK", True), (False, "NO_INFORMATION", False)]
    assert (records[3]["call"], records[3]["word"]) == ("?", None)
    assert statistics["telegrams"]["bad_requests"] == 1 and statistics["telegrams"]["repeated"] == 1


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32))
def test_dropped_pulses(tmp_path_factory, seed):
    """DE-004: any one pulse of an answer is lost: never a wrong nibble, and the next telegram is good again."""
    rng = random.Random(seed)
    nibble = rng.randrange(16)
    train = response_pulses(nibble)
    del train[rng.randrange(len(train))]
    call = encode_call("DEXG", 5, 5)
    records, _ = run_decoder(tmp_path_factory.mktemp("d"), vcd(levels(conversation((call, train), (call, nibble)))))
    assert records[0]["class"] != "OK" and records[0]["answer"] is None
    assert short(records[-1:]) == [(call, nibble, "OK")] and len(records) == 2


# ---------------------------------------------------------------- half telegrams, A/B, statistics
@settings(max_examples=150, deadline=None)
@given(st.integers(0, 250_000), st.integers(0, 250_000))
def test_cut_captures(tmp_path_factory, cut, tail):
    """DE-005: a capture cut anywhere: what was whole is decoded, a rest is named once or twice and never counted."""
    calls = [(encode_call("DEXG", 5, k), k) for k in range(1, 7)]
    start, end = 100_000 + cut, 100_000 + 6 * 154_000 - tail
    rows = [row for row in levels(conversation(*calls)) if start <= row[0] <= end]
    before = [row for row in levels(conversation(*calls)) if row[0] < start][-1:]
    rows = [(start, *row[1:]) for row in before if not rows or rows[0][0] > start] + rows
    rows.append((end, 0, 0)) if rows[-1][0] < end else None
    records, statistics = run_decoder(tmp_path_factory.mktemp("c"), vcd(rows))
    whole = [(call, answer, "OK") for k, (call, answer) in enumerate(calls)
             if start < 100_000 + 154_000 * k and 100_000 + 154_000 * k + 99_500 + 43_500 < end]
    assert short(records) == whole
    assert len(statistics["notes"]) <= 3
    assert all(re.match(r"(start|end) of the capture: .* not counted$", note) for note in statistics["notes"])


def test_half_telegrams_are_named(tmp_path):
    """DE-005: the names: an answer without its request, a rest, a request without its answer yet, a cut answer."""
    call = encode_call("DEXG", 5, 3)
    train = conversation((call, 9), (call, 6))
    answer = [e for e in train if e[0] >= 100_000 + 90_000]
    notes = run_decoder(tmp_path, vcd(levels(answer, start=190_000)))[1]["notes"]
    assert notes == ["start of the capture: an answer 1001 without its request at 199.500 us; not counted"]
    notes = run_decoder(tmp_path, vcd(levels([e for e in train if e[0] > 130_000], start=130_000)))[1]["notes"]
    assert [n.split(": ")[1].split(" at ")[0] for n in notes] == ["rest of a telegram", "an answer 1001 without its "
                                                                  "request"]
    for end, text in ((290_000, "the request is cut off"), (340_000, "DEXG 5 at 254.000 us: no answer yet"),
                      (380_000, "DEXG 5 at 254.000 us: the answer is cut off")):
        records, statistics = run_decoder(tmp_path, vcd(levels(train, end=end)))
        assert len(records) == 1 and len(statistics["notes"]) == 1 and text in statistics["notes"][0]


def dexg(number, count, *i3):
    """DEXG calls to a number whose I3 takes the values of i3 in turn, all answered."""
    return [(number << 5 | i3[k % len(i3)] << 3 | 5, 1) for k in range(count)]


@pytest.mark.parametrize("talk, address, data", [
    ([(encode_call("RDID", 5), 10), *dexg(5, 1, 1)], "5A", "101"),
    ([(encode_call("RDID", 5), 10), *dexg(5, 1, 0)], "5B", "101"),
    ([(encode_call("RDID", 37), 10), *dexg(5, 1, 1)], "5A", "101"),
    ([(encode_call("RDID", 5), 7), *dexg(5, 20, 0, 1)], "5", "1101"),
    ([(encode_call("RID1", 37), 3), *dexg(5, 1, 0)], "5B", "101"),
    ([(encode_call("RID1", 37), None), *dexg(5, 1, 0)], "5", "0101"),
    ([(encode_call("R1", 37), 3), *dexg(5, 1, 0)], "5B", "101"),
    (dexg(5, 8, 1, 0), "5B", "101"),
    (dexg(5, 7, 1, 0), "5", "1101"),
    (dexg(5, 21, 1, 1, 0), "5", "0101"),
])
def test_extended_addressing(tmp_path, talk, address, data):
    """DE-006: A/B by ID code A, by an answered call with Sel = 1, by eight alternating DEXG calls; not by less."""
    records, statistics = run_decoder(tmp_path, vcd(levels(conversation(*talk))))
    assert (records[-1]["address"], records[-1]["data"]) == (address, data)
    assert address in [row["address"] for row in statistics["slaves"]]


def test_statistics(tmp_path):
    """DE-007: requests, answers, classes, delays per slave; rate; cycle from one call of the lowest to the next."""
    numbers, cycles = (2, 3, 7), 5
    talk, delays = [], []
    for k in range(cycles):
        talk += [(encode_call("DEXG", number, 1), number) for number in numbers]
        talk.append((encode_call("RDIO", 10 + k), None))
    rows = levels(conversation(*talk, delay=30_000))
    records, statistics = run_decoder(tmp_path, vcd(rows))
    assert len(records) == 20 and delays == []
    period = 3 * (78_000 + 30_000 + 36_000 + 18_500) + 150_000
    assert statistics["cycles"] == {"count": 3, "min_ns": period, "mean_ns": period, "max_ns": period}
    by = {row["index"]: row for row in statistics["slaves"]}
    assert sorted(by) == [2, 3, 7, 10, 11, 12, 13, 14]
    assert (by[3]["requests"], by[3]["answers"], by[3]["delay_min_ns"], by[3]["delay_max_ns"]) == (5, 5, 30_000, 30_000)
    assert (by[12]["requests"], by[12]["answers"], by[12]["delay_mean_ns"]) == (1, 0, None)
    telegrams = statistics["telegrams"]
    assert (telegrams["requests"], telegrams["failed"], telegrams["by_call"]) == (20, 5, {"DEXG": 15, "RDIO": 5})
    span = records[-1]["t_ns"] - records[0]["t_ns"]
    assert telegrams["per_second"] == round(19e9 / span, 1)


def test_cycles_survive_changes():
    """DE-007: activations, a silent line, a new lowest slave and a lost one give no false cycle time."""
    cycles, t = decoding.Cycles(), 0

    def feed(*calls):
        nonlocal t
        for name, number in calls:
            cycles.add(t, name, number, False)
            t += 154_000
    for number in (2, 3):
        feed(("WPAR", number), ("DEXG", number))
    for _ in range(3):
        feed(("DEXG", 2), ("DEXG", 3), ("RDIO", 9))
    feed(("DEXG", 2), ("DEXG", 3), ("DEXG", 1))          # slave 1 is activated in the extra slot
    for _ in range(3):
        feed(("DEXG", 1), ("DEXG", 2), ("DEXG", 3))
    t += 20_000_000
    for _ in range(40):
        feed(("DEXG", 2), ("DEXG", 3), ("RDIO", 1))       # slave 1 is gone
    assert cycles.span.count > 6 and cycles.span.least == cycles.span.largest == 3 * 154_000


# ---------------------------------------------------------------- the chip
NOISE = Faults(no_answer=2_000, parity=4_000, missing_pulse=6_000, shifted_pulse=6_000, extra_pulse=4_000,
               shift_ns=1_800)


@pytest.mark.parametrize("name, noise", [("packaging", None), ("extended62", None), ("standard31", NOISE)])
def test_run_and_capture_agree(tmp_path, name, noise):
    """DE-002, DE-004, DE-007: the waves of a run decode to its telegram log, telegram for telegram, phase included.

    With noise on all slaves too: every error class that faults of an answer can cause is there.
    """
    plant = load_plant(ROOT / f"sim/plants/{name}.toml").with_settle(QUICK_SETTLE_NS)
    waves = tmp_path / "waves.part"
    bench = open_bench(ROOT / "build/firmware/asi_test.hex", waves, plant.seed)
    if noise:
        add = bench.add

        def add_noisy(slave):
            handle = add(slave)
            bench.set_faults(handle, noise)
            return handle
        bench.add = add_noisy
    try:
        Runner(plant, bench, tmp_path, 180_000_000 if name == "extended62" else 110_000_000).run()
        cycles = bench.stats()
    finally:
        bench.close()
    wanted = [json.loads(line) for line in (tmp_path / "telegrams.jsonl").read_text().splitlines()]
    records = []
    decoder = decoding.Decoder(records.append, decoding.Extended(plant.extended))
    path = name_waves(waves)
    info = decoding.decode(path, decoder)
    statistics = decoder.statistics(path, info)
    assert len(wanted) > 300 and len(records) in (len(wanted), len(wanted) - 1)  # the last one may be cut off
    assert not noise or {r["class"] for r in records} >= {"OK", "NO_RESPONSE", "ALTERNATION", "TIMING",
                                                          "NO_INFORMATION", "PARITY", "LENGTH"}
    clock = 1e9 / bench.clk_hz
    for record, other in zip(records, wanted):
        assert abs(record.pop("t_ns") - other.pop("t_ns")) <= clock
        if record["delay_ns"] is not None and other["delay_ns"] is not None:
            assert abs(record.pop("delay_ns") - other.pop("delay_ns")) <= clock
        assert record == other
    if not noise:
        assert statistics["cycles"]["count"] > 5
        assert abs(statistics["cycles"]["min_ns"] - cycles.cycle_min_ns) <= clock
    learned = []
    decoding.decode(path, decoding.Decoder(learned.append))
    last = {r["index"]: r["address"] for r in records if r["answer"] and r["call"] == "DEXG"}
    assert last and last == {r["index"]: r["address"] for r in learned if r["answer"] and r["call"] == "DEXG"}


def test_damaged_waves(tmp_path, capfd):
    """DE-009: damaged binary waves give telegrams or one line; the reader's own panics do not reach the terminal."""
    waves = tmp_path / "waves.part"
    bench = open_bench(ROOT / "build/firmware/asi_test.hex", waves, 1)
    bench.run(21_500_000)
    bench.close()
    path = name_waves(waves)
    content = path.read_bytes()
    rng = random.Random(7)
    refused = 0
    for number in range(30):
        data = bytearray(content)
        for _ in range(rng.randint(1, 4)):
            data[rng.choice((rng.randrange(400), len(data) - 1 - rng.randrange(9_000), rng.randrange(len(data))))] ^= \
                1 << rng.randrange(8)
        path.write_bytes(data if number % 3 else data[:rng.randrange(len(data))])
        result = command(path, "-f", "none")
        assert result.exit_code in (0, 1, 2) and (result.exception is None or isinstance(result.exception, SystemExit))
        assert result.exit_code == 0 or len(result.stderr.splitlines()) == 1
        refused += result.exit_code == 2
    assert refused > 5
    assert capfd.readouterr().err == ""


# ---------------------------------------------------------------- command
runner = CliRunner()


def command(*arguments):
    return runner.invoke(app, ["decode", *map(str, arguments)])


@pytest.fixture
def capture(tmp_path):
    path = tmp_path / "talk.vcd"
    path.write_text(vcd(levels(TRAIN)))
    return path


def test_outputs(tmp_path, capture):
    """DE-008, PL-003: table as telegrams.log, JSON lines with the documented fields, CSV with the same, statistics."""
    table = command(capture)
    assert table.exit_code == 0
    assert table.stdout.startswith("#   bus time us  call addr data     answer  delay us  class")
    assert "        408.000  DEXG 5    1010  -> 0111      21.500  OK             -" in table.stdout
    assert "7 requests, 0 repeated, 1 without a valid answer" in table.stdout
    lines = command(capture, "-f", "jsonl")
    rows = [json.loads(line) for line in lines.stdout.splitlines()]
    documented = re.findall(r"^\| `(\w+)` \|", (ROOT / "docs/telegram_log.md").read_text(), re.M)
    assert [list(row) for row in rows] == [list(documented)] * 7 == [list(decoding.FIELDS)] * 7
    result = command(capture, "-f", "csv", "-o", tmp_path / "out.csv", "--stats", tmp_path / "s.json")
    assert result.exit_code == 0 and "7 requests" in result.stdout
    with open(tmp_path / "out.csv", newline="") as file:
        found = list(csv.DictReader(file))
    assert [(r["word"], r["class"]) for r in found] == [(str(r["word"]), r["class"]) for r in rows]
    statistics = json.loads((tmp_path / "s.json").read_text())
    assert statistics["schema"] == "asi-decode 1" and statistics["telegrams"]["requests"] == 7
    page = (ROOT / "docs/decode.md").read_text()
    for key in [*statistics, *statistics["telegrams"], *statistics["cycles"], *statistics["slaves"][0]]:
        assert f"`{key}`" in page, key


def test_ab_options(tmp_path):
    """DE-006, DE-008: --ab and --plant say which numbers use A/B addressing; nonsense is refused."""
    path = tmp_path / "x.vcd"
    path.write_text(vcd(levels(conversation(*dexg(5, 2, 0)))))
    assert json.loads(command(path, "-f", "jsonl", "--ab", "4-6").stdout.splitlines()[0])["address"] == "5B"
    assert json.loads(command(path, "-f", "jsonl", "--ab", "6").stdout.splitlines()[0])["address"] == "5"
    plant = ROOT / "sim/plants/packaging.toml"
    assert json.loads(command(path, "-f", "jsonl", "--plant", plant).stdout.splitlines()[0])["address"] == "5B"
    for bad in (["--ab", "32"], ["--ab", "x"], ["--ab", "5", "--plant", plant], ["--time-unit", "h"], ["-f", "xml"],
                ["--arm", "0"], ["--p", "rx_p_i"]):
        assert command(path, *bad).exit_code == 2


GOOD = vcd(levels(TRAIN))
BAD = {
    "empty": (b"", "empty"),
    "text": (b"hello\nworld\n", "no row of numbers"),
    "header only": (b"$timescale 1 ns $end\n$scope module x $end\n", "line 2: ends before $enddefinitions"),
    "timescale": (b"$timescale 1 parsec $end\n$enddefinitions $end\n", "line 1: timescale '1 parsec'"),
    "no timescale": (b"$enddefinitions $end\n", "no $timescale"),
    "no command": (b"$date x $end\nhello\n", "line 2: 'hello' where"),
    "time": (GOOD + "#12x4\n", "time '#12x4'"),
    "time back": (GOOD + "#5\n", "time goes back"),
    "value": (GOOD + "?!\n", "'?!' is no value change"),
    "vector": (GOOD + "b01\n", "'b01' without a signal"),
    "csv columns": (b"time_ns,rx_p,rx_n\n0,0,0\n1,0\n", "line 3: not 3 numbers: '1,0'"),
    "csv number": (b"time_ns,rx_p,rx_n\n0,0,0\n1,0,nan\n", "line 3: not 3 numbers"),
    "csv time back": (b"time_ns,rx_p,rx_n\n5,0,0\n1,0,0\n", "line 3: time goes back"),
    "csv no header": (b"0,0,0\n1,0,0\n", "--columns"),
    "csv head": (b"time,p\n0,0,0\n1,0,0\n", "3 values under 2 column names"),
    "csv slow": ("time_us,rx_p,rx_n\n" + "".join(f"{k},0,0\n" for k in range(40)), "at least 2 MHz"),
    "zip": (b"PK\x03\x04" + bytes(50), "damaged sigrok session"),
    "slow": (session(bytes(100), 1e6), "sample rate '1 MHz' is not at least 2 MHz"),
    "no samples": (session(b"", 4e6), "no samples"),
    "unit size": (session(bytes(9), 4e6, size=99), "unit size 99"),
    "fst": (b"\0" + (329).to_bytes(8, "big") + bytes(400), "unknown file format"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input(tmp_path, case):
    """DE-009, DE-012: one line with file, place and reason, exit code 2."""
    content, text = BAD[case]
    path = tmp_path / "bad.dat"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    result = command(path)
    assert result.exit_code == 2 and (result.exception is None or isinstance(result.exception, SystemExit))
    lines = result.stderr.splitlines()
    assert len(lines) == 1 and lines[0].startswith(f"{path}: ") and text in lines[0]
    if content[:40] == GOOD[:40]:
        assert "7 requests" in result.stdout  # what came before the fault is decoded
    assert command(tmp_path / "none").stderr == f"{tmp_path}/none: No such file or directory\n"


def test_no_telegram(tmp_path):
    """DE-008: a capture without any telegram ends with exit code 1 and says so."""
    path = tmp_path / "quiet.vcd"
    path.write_text(vcd([(0, 0, 0), (1_000_000, 0, 0)]))
    result = command(path)
    assert result.exit_code == 1 and result.stderr == f"{path}: no telegram\n"


SEEDS = [vcd(levels(TRAIN)).encode(), csv_text(levels(TRAIN)).encode(), session(sampled(levels(TRAIN), 4e6), 4e6),
         csv_text([(k * 500, f"{v:.2f}") for k, v in enumerate(volts(TRAIN[:80], 2e6))], "time_ns,u").encode()]


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.one_of(
    st.binary(max_size=300),
    st.binary(max_size=60).map(lambda b: b"\0" + (329).to_bytes(8, "big") + b),
    st.tuples(st.sampled_from(SEEDS), st.lists(st.tuples(st.integers(0, 1 << 20), st.binary(max_size=6)), max_size=6),
              st.integers(0, 1 << 20)).map(lambda a: damage(*a))))
def test_damaged_files(tmp_path_factory, content):
    """DE-009: random and damaged files give telegrams or one line, exit code 0, 1 or 2, never a traceback."""
    path = tmp_path_factory.mktemp("f") / "x"
    path.write_bytes(content)
    for extra in ([], ["--p", "rx_p", "--n", "rx_n"], ["--analog", "u"]):
        result = command(path, "-f", "jsonl", *extra)
        assert result.exit_code in (0, 1, 2), result.exception
        assert result.exception is None or isinstance(result.exception, SystemExit)
        if result.exit_code == 2:
            assert len([x for x in result.stderr.splitlines() if not x.startswith("note: ")]) == 1
        for line in result.stdout.splitlines():
            json.loads(line)


def damage(content, patches, length):
    data = bytearray(content)
    for at, patch in patches:
        at %= len(data)
        data[at:at + len(patch)] = patch
    return bytes(data[:length % (2 * len(data)) or None])


# ---------------------------------------------------------------- size
def test_memory_does_not_grow(tmp_path):
    """DE-010: five times the capture, the same memory: VCD, CSV and sigrok."""
    talk = [(encode_call("DEXG", 1 + k % 5, k & 15), k & 15) for k in range(60)]

    def peak(content):
        path = tmp_path / "long"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        count = [0]

        def emit(record):
            count[0] += 1
        decoder = decoding.Decoder(emit)
        tracemalloc.start()
        try:
            decoding.decode(path, decoder)
            return tracemalloc.get_traced_memory()[1], count[0]
        finally:
            tracemalloc.stop()

    for make in (lambda rows: vcd(rows), lambda rows: csv_text(rows), lambda rows: session(sampled(rows, 4e6), 4e6)):
        (small, few), (large, many) = (peak(make(levels(conversation(*talk * times)))) for times in (2, 10))
        assert many == 5 * few == 600
        assert large < small * 1.25 + 20_000


def test_analog_swing_below_arm_is_silence():
    """DE-011: noise below the least amplitude starts nothing."""
    seen = []
    front = Analog(Sink(lambda t, polarity: seen.append(t)), 750)
    rng = random.Random(3)
    for k in range(20_000):
        front.sample(k * 100.0, 30 + rng.uniform(-0.5, 0.5))
    front.settle(2_000_000.0)
    assert seen == []


def test_info_names_what_was_used(tmp_path):
    """DE-003: the statistics say which format and which signals were decoded."""
    statistics = run_decoder(tmp_path, GOOD)[1]
    assert (statistics["format"], statistics["kind"]) == ("VCD", "pulses")
    assert statistics["signals"] == ["top.rx_p_i", "top.rx_n_i"]
    assert Info().signals == []
