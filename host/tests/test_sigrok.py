# SPDX-License-Identifier: Apache-2.0
"""The sigrok decoder: its own output against asi decode, on made captures and on waves of the chip with noisy slaves.

Every capture runs on a small stand-in for libsigrokdecode (fake_sigrok), in a Python without any package; where
sigrok-cli is installed it runs there too. The waves need build/tb/libasi_chip_trace.so and build/firmware/asi_test.hex;
`make test` builds both.
"""
import json
import os
import random
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from test_decode import (CALLS, FAULTS, NOISE, ROOT, TRAIN, conversation, dexg, levels, man_levels, sampled)

from asi import decode as decoding
from asi.bench import name_waves, open_bench
from asi.capture import Options
from asi.cli import QUICK_SETTLE_NS
from asi.plant import load_plant
from asi.run import Runner
from asi.telegram import encode_call, request_word, response_word
from tools import sigrok

FAKE = Path(__file__).with_name("fake_sigrok") / "sigrokdecode.py"
SIGROK = shutil.which("sigrok-cli")
CLEAN = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "SIGROK"))}
PAIR, MAN = ("rx_p", "rx_n"), ("man",)
NUMBER = {"rx_p": 0, "rx_n": 1, "man": 2}   # channels of the decoder
CLASSES = ("negative", "positive", "bit", "request", "delay", "answer", "bad", "error", "note")


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("decoders")
    sigrok.main(["install", str(folder)])
    return folder


class Capture:
    """Samples, and the same in a session file."""

    def __init__(self, path, samples, rate, names=PAIR):
        self.path, self.samples, self.rate, self.names = path, samples, rate, names
        self.session, self.raw = path / "line.sr", path / "line.bin"
        sigrok.write_session(self.session, samples, rate, names)
        self.raw.write_bytes(samples)

    @classmethod
    def of(cls, path, rows, rate, names=PAIR):
        return cls(path, sampled(rows, rate), rate, names)

    def decode(self, **options):
        """The records of asi decode."""
        records = []
        known = options.pop("known", lambda number: None)
        decoding.decode(self.session, decoding.Decoder(records.append, decoding.Extended(known)), Options(**options))
        return records

    def fake(self, folder, eof=True, rate=..., channels=None, **options):
        """[(start, stop, output, data)] of the decoder; its error text instead when it fails."""
        channels = {NUMBER[name]: bit for bit, name in enumerate(self.names)} if channels is None else channels
        job = {"folder": str(folder), "samples": str(self.raw), "rate": self.rate if rate is ... else rate,
               "channels": channels, "options": options, "eof": eof}
        # -S -I: nothing but the standard library, as in sigrok's own Python
        done = subprocess.run([sys.executable, "-I", "-S", str(FAKE)], input=json.dumps(job), capture_output=True,
                              text=True, check=False)
        if done.returncode:
            return done.stderr.strip().splitlines()[-1]
        return [tuple(json.loads(line)) for line in done.stdout.splitlines()]

    def sigrok_cli(self, folder, options="", output=("-B", "asi=jsonl")):
        return subprocess.run([SIGROK, "-i", str(self.session), "-P", "asi" + options, *output], check=True,
                              capture_output=True, env=CLEAN | {"SIGROKDECODE_DIR": str(folder)}).stdout.decode()


def records_of(puts):
    """The telegrams of the decoder's Python output; its JSON lines have to say the same."""
    out = [data for *_, kind, data in puts if kind == "python"]
    lines = [data for *_, kind, data in puts if kind == "binary"]
    assert all(name == "TELEGRAM" for name, _ in out)
    assert [json.loads(text) for number, text in lines if number == 0] == [record for _, record in out]
    return [record for _, record in out]


def shown(puts, *names):
    """[(start, stop, class, longest text)] of the annotations of these classes."""
    found = [(start, stop, CLASSES[data[0]], data[1][0]) for start, stop, kind, data in puts if kind == "ann"]
    return [entry for entry in found if not names or entry[2] in names]


def json_lines(records):
    return "".join(json.dumps(record, separators=(",", ":")) + "\n" for record in records)


# ---------------------------------------------------------------- the same telegrams
CALL = encode_call("RDIO", 5)
FAULTY = conversation(*[(CALL, answer) for train in FAULTS.values() for answer in (1, train)], (CALL, 1))
EARLY = conversation((CALL, 3), (CALL, 4), delay=11_000)
SILENT = conversation((CALL, 1), (CALL, None), (CALL, None), (encode_call("BR01"), None), (CALL, 2))
BROKEN = SILENT + [e for e in conversation((CALL, 1), start=1_500_000) if e[0] != 1_578_000][:-12]
MADE = {
    "pulses 4 MHz": (levels(TRAIN), 4e6, PAIR, {}, {}),
    "pulses 2 MHz": (levels(TRAIN), 2e6, PAIR, {}, {}),
    "man 12 MHz": (man_levels(TRAIN), 12e6, MAN, {}, {}),
    "man upside down": ([(t, 1 - man) for t, man in man_levels(TRAIN)], 4e6, MAN, {"swap": "yes"}, {"invert": True}),
    "wires swapped": ([(t, n, p) for t, p, n in levels(TRAIN)], 4e6, PAIR, {"swap": "yes"}, {"invert": True}),
    "wires swapped, not told": ([(t, n, p) for t, p, n in levels(TRAIN)], 4e6, PAIR, {}, {}),
    "error classes": (levels(FAULTY, 1_000), 4e6, PAIR, {}, {}),
    "early": (levels(EARLY), 8e6, PAIR, {}, {}),
    "silence, broadcast, bad request": (levels(BROKEN), 4e6, PAIR, {}, {}),
    "starts in a telegram": (levels([(t - 130_000, pol) for t, pol in TRAIN if t > 130_000]), 4e6, PAIR, {}, {}),
    "A/B told": (levels(conversation(*dexg(5, 4, 1, 0), *dexg(6, 3, 0))), 4e6, PAIR, {"ab": "5 + 20-31"},
                 {"known": {5, *range(20, 32)}.__contains__}),
    "A/B told none": (levels(conversation((encode_call("RDID", 5), 10), *dexg(5, 3, 1, 0))), 4e6, PAIR,
                      {"ab": "none"}, {"known": lambda number: False}),
    "A/B learned": (levels(conversation((encode_call("RDID", 5), 10), *dexg(5, 3, 1, 0))), 4e6, PAIR, {}, {}),
}


@pytest.mark.parametrize("name", MADE)
def test_same_as_asi_decode(tmp_path, folder, name):
    """DE-013, DE-014: made captures of every kind give the records of asi decode, on a Python without packages."""
    rows, rate, names, told, options = MADE[name]
    capture = Capture.of(tmp_path, rows, rate, names)
    wanted = capture.decode(**options)
    assert len(wanted) >= 2
    for eof in (False, True):
        assert records_of(capture.fake(folder, eof, **told)) == wanted
    if name == "error classes":
        assert {record["class"] for record in wanted} == set(FAULTS)


@pytest.mark.parametrize("name", MADE)
@pytest.mark.skipif(not SIGROK, reason="sigrok-cli is not installed")
def test_same_in_sigrok(tmp_path, folder, name):
    """DE-013, DE-014: the same with sigrok-cli itself."""
    rows, rate, names, told, options = MADE[name]
    capture = Capture.of(tmp_path, rows, rate, names)
    told = "".join(f":{key}={value}" for key, value in {**{name: name for name in names}, **told}.items())
    assert capture.sigrok_cli(folder, told) == json_lines(capture.decode(**options))


@pytest.fixture(scope="module")
def chip(tmp_path_factory):
    """A run with noise on all slaves, its waves as a session, and its telegram log."""
    path = tmp_path_factory.mktemp("chip")
    plant = load_plant(ROOT / "sim/plants/extended62.toml").with_settle(QUICK_SETTLE_NS)
    waves = path / "waves.part"
    bench = open_bench(ROOT / "build/firmware/asi_test.hex", waves, plant.seed)
    add = bench.add

    def add_noisy(slave):
        handle = add(slave)
        bench.set_faults(handle, NOISE)
        return handle
    bench.add = add_noisy
    try:
        Runner(plant, bench, path, 130_000_000).run()
    finally:
        bench.close()
    sigrok.main(["session", str(name_waves(waves)), str(path / "chip.sr"), "--mhz", "8"])
    log = [json.loads(line) for line in (path / "telegrams.jsonl").read_text().splitlines()]
    capture = Capture.__new__(Capture)
    capture.path, capture.session, capture.rate, capture.names = path, path / "chip.sr", 8e6, sigrok.NAMES
    return capture, log


def test_chip(chip, folder, tmp_path):
    """DE-013, DE-002: waves of a noisy run, sampled: the records of asi decode, and the telegrams the run logged."""
    import zipfile
    capture, log = chip
    with zipfile.ZipFile(capture.session) as session:
        samples = b"".join(session.read(name) for name in session.namelist() if name.startswith("logic-1-"))
    capture.raw = tmp_path / "raw"
    capture.raw.write_bytes(samples)
    wanted = capture.decode()
    assert records_of(capture.fake(folder, channels={0: 0, 1: 1})) == wanted
    assert len(wanted) > 300 and len(log) - len(wanted) in (0, 1)
    assert [(r["word"], r["class"], r["answer"]) for r in wanted] == \
        [(r["word"], r["class"], r["answer"]) for r in log[:len(wanted)]]
    assert {r["class"] for r in wanted} >= {"OK", "NO_RESPONSE", "ALTERNATION", "TIMING", "NO_INFORMATION", "PARITY",
                                            "LENGTH"}


@pytest.mark.skipif(not SIGROK, reason="sigrok-cli is not installed")
def test_chip_in_sigrok(chip, folder):
    """DE-013: the same run in sigrok-cli, telegram for telegram."""
    capture, _ = chip
    assert capture.sigrok_cli(folder, ":rx_p=rx_p:rx_n=rx_n") == json_lines(capture.decode())


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.integers(0, 2**32))
def test_damaged_lines(tmp_path_factory, folder, seed):
    """DE-013, DE-004: pulses lost, added and moved anywhere, cut ends: asi decode's records; the last may be missing.

    Before libsigrokdecode 0.6 a decoder is not told how many quiet samples follow its last wait().
    """
    rng = random.Random(seed)
    train = []
    for t, polarity in conversation(*[(rng.choice(CALLS), rng.choice([1, 6, 15, None])) for _ in range(8)]):
        what = rng.random()
        if what > 0.03:
            train.append((t + rng.choice([0, 0, 0, 0, rng.randint(-1_000, 1_600)]), polarity))
        if what > 0.98:
            train.append((t + rng.randint(0, 30_000), rng.choice([-1, 1])))
    train = sorted(set(train))
    end = rng.randint(400_000, train[-1][0] + 100_000)
    capture = Capture.of(tmp_path_factory.mktemp("d"), levels(train, rng.choice([900, 1_500, 2_500]), end=end), 8e6)
    wanted = capture.decode()
    assert records_of(capture.fake(folder)) == wanted
    found = records_of(capture.fake(folder, eof=False))
    assert found in (wanted, wanted[:-1])


# ---------------------------------------------------------------- what is shown
def test_annotations(tmp_path, folder):
    """DE-015: pulses, bits, request with call, address and data, delay, answer: what they say and where they stand."""
    rate = 8e6
    talk = ((encode_call("RDID", 17), 10), (encode_call("DEXG", 17 + 32, 0b101), 6))
    puts = Capture.of(tmp_path, levels(conversation(*talk)), rate).fake(folder)
    for turn, (request, answer, (call, nibble)) in enumerate((("RDID 17A", "1010", talk[0]),
                                                              ("DEXG 17B 101", "0110", talk[1]))):
        if turn == 0:
            request = "RDID 17A"    # its own answer has told that the number uses A/B addressing
        us = 100 + 154 * turn
        at = [round((us + dt) * 8) for dt in (-3, 81, 96.5, 138.5)]
        found = [entry for entry in shown(puts, "request", "delay", "answer") if at[0] <= entry[0] < at[3]]
        assert found == [(at[0], at[1], "request", request), (at[1], at[2], "delay", "21.500 us"),
                         (at[2], at[3], "answer", answer)]
        bits = [entry for entry in shown(puts, "bit") if at[0] <= entry[0] < at[3]]
        assert [start for start, *_ in bits] == [at[0] + 48 * k for k in range(14)] + [at[2] + 48 * k for k in range(7)]
        assert all(stop - start == 48 for start, stop, *_ in bits)
        assert "".join(text.split()[1] for *_, text in bits) == f"{request_word(call):014b}{response_word(nibble):07b}"
        assert [text.split()[0] for *_, text in bits][:3] == ["ST", "CB", "A4"]
    pulses = shown(puts, "negative", "positive")
    train = conversation(*talk)
    assert [(start, kind) for start, _, kind, _ in pulses] == \
        [(round(t * 8 / 1e3), "positive" if polarity > 0 else "negative") for t, polarity in train]
    assert shown(puts, "error", "note", "bad") == []


@pytest.mark.parametrize("error", [name for name in FAULTS if name != "OK"])
def test_error_annotations(tmp_path, folder, error):
    """DE-015, DE-004: a bad answer stands on the telegram row, its class and address on the warnings row above it."""
    rows = levels(conversation((CALL, 1), (CALL, FAULTS[error]), (CALL, 2)), 1_000)
    puts = Capture.of(tmp_path, rows, 8e6).fake(folder)
    (start, _, _, text), = shown(puts, "error")
    assert text == f"{error} 5" and start == round((254 + 96.5) * 8)
    assert [(kind, text) for _, _, kind, text in shown(puts, "answer", "bad")] == [
        ("answer", "0001"), ("bad", f"bad answer, {error}"), ("answer", "0010")]
    requests = [text for *_, text in shown(puts, "request")]
    assert requests == ["RDIO 5", "RDIO 5", "RDIO 5, repeated"]
    if error == "NO_INFORMATION":
        assert "?" in [text.split()[1] for *_, text in shown(puts, "bit")]


def test_no_answer_and_bad_requests(tmp_path, folder):
    """DE-015: no answer is a warning until the time-out; broadcasts are to all; a bad request keeps its bits."""
    puts = Capture.of(tmp_path, levels(BROKEN), 8e6).fake(folder)
    errors = shown(puts, "error")
    assert [text for *_, text in errors] == ["NO_RESPONSE 5", "NO_RESPONSE 5", "NO_INFORMATION"]
    start, stop = errors[0][:2]
    assert (start, stop) == (round((254 + 78) * 8), round((254 + 78 + 66) * 8))
    assert "BR01 all" in [text for *_, text in shown(puts, "request")]
    assert [text for *_, text in shown(puts, "bad")] == ["bad request"]
    swapped = [(t, n, p) for t, p, n in levels(TRAIN)]
    (tmp_path / "s").mkdir()
    puts = Capture.of(tmp_path / "s", swapped, 8e6).fake(folder)
    assert {text for *_, text in shown(puts, "error")} == {
        "START: the first pulse is positive; are the wires swapped?"}


def test_rests_are_notes(tmp_path, folder):
    """DE-015, DE-005: what a capture cuts off is a note, not a telegram."""
    train = [(t - 190_000, polarity) for t, polarity in conversation((CALL, 9), (CALL, 6)) if t >= 190_000]
    puts = Capture.of(tmp_path, levels(train, end=190_000), 8e6).fake(folder)
    notes = shown(puts, "note")
    assert notes[0][3].startswith("start of the capture: an answer 1001 without its request")
    assert notes[1][3].startswith("end of the capture: RDIO 5 ") and len(notes) == 2
    assert records_of(puts) == []


# ---------------------------------------------------------------- options, refusals, folder
@pytest.mark.parametrize("change, text", [
    ({"channels": {}}, "ChannelError: connect rx_p and rx_n, or MAN"),
    ({"channels": {0: 0}}, "ChannelError: connect rx_p and rx_n, or MAN"),
    ({"channels": {0: 0, 1: 1}, "input": "man"}, "ChannelError: connect MAN"),
    ({"channels": {2: 0}, "input": "pulses"}, "ChannelError: connect rx_p and rx_n"),
    ({"rate": None}, "SamplerateError: Cannot decode without samplerate."),
    ({"rate": 1_000_000}, "SamplerateError: a sample rate of at least 2 MHz is needed"),
    ({"ab": "5+40"}, "OptionError: ab: '40' is no number or range within 1..31"),
])
def test_refusals(tmp_path, folder, change, text):
    """DE-016: missing channels, no or a low sample rate and bad numbers are refused with one line that says why."""
    assert Capture.of(tmp_path, levels(TRAIN), 4e6).fake(folder, **change).endswith(text)


def test_input_option(tmp_path, folder):
    """DE-016: with all channels connected the pulses are taken, MAN when the option says so."""
    state, rows = 1, []
    for t, p, n in levels(TRAIN):
        state = 1 if p else 0 if n else state
        rows.append((t, 0, 0, state))
    capture = Capture.of(tmp_path, rows, 4e6, ("rx_p", "rx_n", "man"))
    assert records_of(capture.fake(folder)) == []
    assert [r["class"] for r in records_of(capture.fake(folder, input="man"))] == ["OK"] * 6 + ["NO_RESPONSE"]


def test_folder_is_self_contained(folder, tmp_path):
    """DE-014: the folder has what its modules import and nothing else; installing again replaces it."""
    modules = sorted(path.stem for path in (folder / "asi").glob("*.py"))
    assert modules == sorted(["__init__", "pd", *sigrok.MODULES])
    code = ("import sys; sys.path[:0] = sys.argv[1:]; import asi.pd; "
            "print(*sorted(m for m in sys.modules if m.startswith('asi.')))")
    loaded = subprocess.run([sys.executable, "-I", "-S", "-c", code, str(folder), str(FAKE.parent)], check=True,
                            capture_output=True, text=True).stdout.split()
    assert loaded == sorted(f"asi.{name}" for name in modules if name != "__init__")
    (tmp_path / "asi").mkdir()
    (tmp_path / "asi/old.py").write_text("")
    sigrok.install(tmp_path)
    assert not (tmp_path / "asi/old.py").exists() and (tmp_path / "asi/pd.py").exists()


def test_sample():
    """DE-013: a sample has the value of its instant; the last change lasts to the end."""
    assert sigrok.sample([(0, 0), (250, 1), (300, 2), (1_000, 3)], 1_500, 4e6) == bytes([0, 1, 2, 2, 3, 3])
