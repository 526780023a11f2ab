# SPDX-License-Identifier: Apache-2.0
"""asi replay: captures against the chip as a passive monitor; and the host window's diagnosis on the running chip."""
import random
from collections import Counter
from pathlib import Path

import pytest
from test_decode import CALLS, TALK, TRAIN, conversation, csv_text, levels, man_levels, session, vcd, volts
from typer.testing import CliRunner

from asi import replay
from asi.capture import CaptureError
from asi.cli import app
from asi.native import Chip
from asi.regmap import HOST_RING_TAIL, ErrorClass
from asi.telegram import encode_call, response_pulses
from asi.window import HostWindow

ROOT = Path(__file__).resolve().parents[2]
FIRMWARE = ROOT / "build/firmware/asi_test.hex"
MS = 1_000_000


def write(tmp_path, content, name):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def analog_csv(train, rate=8_000_000):
    return "time_ns,v\n" + "".join(f"{k * 1e9 / rate:.1f},{v:.4f}\n" for k, v in enumerate(volts(train, rate)))


@pytest.mark.parametrize("name, content", [
    ("pulses.vcd", lambda: vcd(levels(TRAIN))), ("pulses.csv", lambda: csv_text(levels(TRAIN))),
    ("man.csv", lambda: csv_text(man_levels(TRAIN), "time_ns,man")), ("volts.csv", lambda: analog_csv(TRAIN))])
def test_all_kinds_of_captures(tmp_path, name, content):
    """RP-001, ST-006, DE-001: pulses, Manchester level, voltage reach the receiver; it sees what the decoder sees."""
    result = replay.replay(write(tmp_path, content(), name), FIRMWARE)
    assert result.calls == len(TALK) and not result.differences and not result.lost
    requests = [record for _, record in result.records if record.request]
    assert [record.data for record in requests] == [call for call, _ in TALK]
    assert [r.data for _, r in result.records if not r.request] == [a for _, a in TALK if a is not None]
    first = result.records[0][0]
    assert abs(first - TRAIN[0][0]) <= 250  # clock edge and stamp, 125 ns each


def damaged(rng):
    """One answer with a fault."""
    train = response_pulses(rng.randrange(16))
    k = rng.randrange(len(train))
    kind = rng.randrange(5)
    if kind == 0:
        del train[k]
    elif kind == 1:
        train[k] = (train[k][0] + rng.choice((-2_000, -1_250, 750, 1_750, 2_250)), train[k][1])
    elif kind == 2:
        train[k] = (train[k][0], -train[k][1])
    elif kind == 3:
        train.append((rng.randrange(37_700, 43_000), rng.choice((-1, 1))))
    else:
        return train
    return sorted(train)


@pytest.mark.parametrize("seed", range(4))
def test_damaged_answers(tmp_path, seed):
    """RP-001, ST-006, RX-001 .. RX-008: every class of answer is told alike by decoder and chip."""
    rng = random.Random(seed)
    talk = [(rng.choice(CALLS), damaged(rng)) for _ in range(150)]
    result = replay.replay(write(tmp_path, csv_text(levels(conversation(*talk), width=1_000)), "x.csv"), FIRMWARE)
    classes = Counter(record.error_class for _, record in result.records if not record.request)
    assert result.calls == 150 and not result.differences and len(classes) >= 5


def test_silence_is_cut(tmp_path):
    """RP-002: a capture of 40 s with two conversations takes the time of these; times stay the capture's."""
    train = conversation(*TALK) + conversation(*TALK, start=40_000_000_000)
    result = replay.replay(write(tmp_path, csv_text(levels(train)), "long.csv"), FIRMWARE)
    assert result.calls == 2 * len(TALK) and not result.differences
    assert abs(result.records[-1][0] - (train[-1][0] - 78_000)) <= 250


def test_stuck_line(tmp_path):
    """RP-001, RP-002: a comparator stuck for hours between two conversations costs no simulated time and spoils
    nothing; times too large to be exact are refused in one line."""
    hour = 3_600_000_000_000
    rows = levels(TRAIN) + [(hour, 1, 0), (2 * hour, 0, 0)] + levels(conversation(*TALK, start=2 * hour + 100_000))[1:]
    result = replay.replay(write(tmp_path, csv_text(rows), "stuck.csv"), FIRMWARE)
    requests = [record.data for _, record in result.records if record.request and record.error_class == ErrorClass.OK]
    assert requests == 2 * [call for call, _ in TALK] and not result.differences
    assert abs(result.records[-1][0] - rows[-2][0] + 36_000) < 90_000
    huge = "time_ns,rx_p,rx_n\n0,0,0\n1e30,1,0\n1e31,0,0\n1e300,0,1\n"
    with pytest.raises(CaptureError, match="huge.csv: at 1e\\+30 ns: "):
        replay.replay(write(tmp_path, huge, "huge.csv"), FIRMWARE)


def test_babble_to_the_end(tmp_path):
    """RP-001, DE-005: a babbling line that the end of the capture cuts off is no telegram for the decoder: no
    difference, however long it was."""
    train = TRAIN + [(TRAIN[-1][0] + 500_000 + 6_000 * k, 1) for k in range(1_000)]
    result = replay.replay(write(tmp_path, csv_text(levels(train, end=train[-1][0] + 2_000)), "babble.csv"), FIRMWARE)
    assert result.calls == len(TALK) and not result.differences
    assert result.records[-1][1].error_class == ErrorClass.START


def test_impossible_volts(tmp_path):
    """DE-011, PL-009: two samples of a converter gone mad (1e308 V) cost the telegram they are in, nothing else, and
    break neither replay nor page."""
    rows = analog_csv(TRAIN).splitlines()
    for k, bad in ((1_000, "1e308"), (1_001, "-1e308")):
        rows[k] = rows[k].split(",")[0] + "," + bad
    path = write(tmp_path, "\n".join(rows), "mad.csv")
    result = replay.replay(path, FIRMWARE)
    assert len(TALK) - 1 <= result.calls <= len(TALK) + 1 and not result.differences
    page = CliRunner().invoke(app, ["decode", str(path), "--html", str(tmp_path / "mad.html")])
    assert page.exit_code == 0 and (tmp_path / "mad.html").stat().st_size > 10_000


def test_differences_are_told(tmp_path, monkeypatch):
    """RP-001: what the two sides see differently is named with both views, exit code 1."""
    path = write(tmp_path, csv_text(levels(TRAIN)), "x.csv")
    taken = replay.calls_of_chip

    def lying(records):
        for k, call in enumerate(taken(records)):
            if k == 0:
                call.data ^= 1
            if k != 2:
                yield call
    monkeypatch.setattr(replay, "calls_of_chip", lying)
    out = CliRunner().invoke(app, ["replay", str(path), "--firmware", str(FIRMWARE)])
    lines = out.stdout.splitlines()
    assert out.exit_code == 1 and len(lines) == 3 and "100.000 us" in lines[0]
    assert "decoder: request 4B0, OK answer 0001; chip: request 4B0, OK answer 0000" in lines[0]
    assert "chip: nothing" in lines[1] and "2 differ" in lines[2]


def test_command(tmp_path):
    """RP-001, RP-002: exit codes, records as JSON lines, one line for a bad capture."""
    path, records = write(tmp_path, session(bytes(100_000), 16_000_000), "none.sr"), tmp_path / "r.jsonl"
    run = CliRunner().invoke
    base = ["--firmware", str(FIRMWARE)]
    assert run(app, ["replay", str(path), *base]).exit_code == 1
    bad = run(app, ["replay", str(write(tmp_path, "nothing", "bad.csv")), *base])
    assert bad.exit_code == 2 and len(bad.stderr.splitlines()) == 1
    missing = run(app, ["replay", str(path), "--firmware", str(tmp_path / "none.hex")])
    assert missing.exit_code == 3
    assert missing.stderr == f"simulation: firmware {tmp_path}/none.hex: No such file or directory\n"
    for option in ("--out", "--waves"):     # told at once, not after the simulation
        nowhere = run(app, ["replay", str(path), option, str(tmp_path / "none/x"), *base])
        assert nowhere.exit_code == 2
        assert nowhere.stderr.splitlines() == [f"{tmp_path}/none/x: No such file or directory"]
    good = run(app, ["replay", str(write(tmp_path, csv_text(levels(TRAIN)), "x.csv")), "--out", str(records), *base])
    assert good.exit_code == 0 and len(records.read_text().splitlines()) == 2 * len(TALK) - 1


# ---------------------------------------------------------------- diagnosis in the host window
def start(*slaves, offline=False):
    chip = Chip(FIRMWARE)
    window = HostWindow(chip)
    handles = [chip.net.add(index, io=7, id=0xA if index > 32 or index == 3 else 0xF) for index in slaves]
    while not window.ready():
        chip.run(chip.time_ns + MS // 10)
    return chip, window, handles


def test_counters_against_the_line_monitor():
    """ST-001, ST-002, ST-009: what the chip counts per address is what the independent monitor of the line counts."""
    chip, window, (_, _, _, faulty) = start(1, 3, 35, 5)
    chip.run(100 * MS)
    for fault in ({"p_parity": 20_000}, {"p_no_answer": 20_000}, {"p_missing_pulse": 20_000}, {"p_extra_pulse": 20_000},
                  {"p_shifted_pulse": 20_000, "shift_ns": -1_250}, {"delay_ns": 4_000},
                  {"p_shifted_pulse": 40_000, "shift_ns": 1_000}):
        chip.net.set_faults(faulty, **fault)
        chip.run(chip.time_ns + 40 * MS)
    window.set_control(offline=True)
    chip.run(chip.time_ns + 80 * MS)      # everything is copied once
    log = chip.log()
    sel = {call: index for index in range(64) if index != 32 for call in
           [encode_call(name, index) for name in ("RDIO", "RDID", "RID1", "RID2", "RDST", "RES")]}
    ab = {3, 35 & 31}

    def index_of(t):
        number = t.call >> 5 & 31
        return sel[t.call] if t.call in sel else number + 32 * (number in ab and not t.call & 8)
    seen, delays = {}, {}
    for t in log[:-1]:                    # the last one is cut off by OFFLINE
        index = index_of(t)
        seen.setdefault(index, Counter())[ErrorClass(t.error_class)] += 1
        if t.error_class == ErrorClass.OK:
            delays.setdefault(index, []).append(t.delay_ns)
    last = index_of(log[-1])
    for index in (0, 1, 3, 35, 5, 7, 40):
        found = window.statistics(index)
        classes = dict(found.classes)
        if index == last and classes != seen.get(index, {}):  # judged before OFFLINE came
            classes[ErrorClass(log[-1].error_class)] -= 1
        assert classes == dict(seen.get(index, {})), index
        if index in delays:
            assert found.delay_min_ns == min(delays[index]) and found.delay_max_ns == max(delays[index])
            assert abs(found.delay_mean_ns - sum(delays[index]) / len(delays[index])) < 100
    found = window.statistics(5)
    assert found.repeat_ok > 10 and found.repeat_failed > 3 and found.deviation_ns == 1_000
    assert {ErrorClass.NO_RESPONSE, ErrorClass.PARITY, ErrorClass.LENGTH, ErrorClass.TIMING} <= set(found.classes)


def test_passive_monitor_is_silent():
    """ST-007, ST-009: as a monitor the master sends nothing and records a foreign one, until it is master again."""
    chip, window, _ = start(1)
    chip.run(80 * MS)
    assert window.state().las == {1}
    window.set_control(monitor=True)
    chip.run(chip.time_ns + 5 * MS)
    chip.log()
    begin = chip.time_ns
    for t, polarity in conversation((encode_call("RDIO", 7), 5), start=begin + MS):
        chip.net.inject(t, polarity)
    chip.run(begin + 20 * MS)
    records = window.monitored()
    assert [(r.request, r.data, r.error_class) for r in records] == [
        (True, encode_call("RDIO", 7), ErrorClass.OK), (False, 5, ErrorClass.OK)]
    assert not chip.log() and window.state().las == set()  # the log begins with requests of the own pins only
    window.set_control(monitor=False)
    chip.run(chip.time_ns + 80 * MS)
    assert window.state().las == {1} and not window.monitored()


def test_ring_overflow():
    """ST-008, ST-009: a host that does not read keeps the oldest telegrams; the loss is counted and marked."""
    chip, window, _ = start()
    window.set_control(monitor=True)
    chip.run(chip.time_ns + 5 * MS)
    calls = [(encode_call("DEXG", 1 + k % 31, k % 16), k % 16) for k in range(300)]
    for t, polarity in conversation(*calls, start=chip.time_ns + MS):
        chip.net.inject(t, polarity)
    chip.run(chip.time_ns + 60 * MS)
    records = window.monitored()
    assert len(records) == 511 and window.monitor_lost() == 600 - 511 and not any(r.lost for r in records)
    assert [r.data for r in records if r.request] == [call for call, _ in calls[:256]]
    for t, polarity in conversation((calls[0]), start=chip.time_ns + MS):
        chip.net.inject(t, polarity)
    chip.run(chip.time_ns + 5 * MS)
    assert [r.lost for r in window.monitored()] == [True, False]


@pytest.mark.parametrize("tail", [0xFFFF_FFFF, 512, 0x8000_0003])
def test_nonsense_in_ring_tail(tail):
    """ST-008, ST-009: whatever another host program has left in RING_TAIL, the chip goes on, and who reads the ring
    once has only new telegrams from then on."""
    chip, window, _ = start()
    window.set_control(monitor=True)
    chip.run(chip.time_ns + 5 * MS)
    chip.host_write(HOST_RING_TAIL, tail)
    for value in (3, 9):
        for t, polarity in conversation((encode_call("RDIO", 7), value), start=chip.time_ns + MS):
            chip.net.inject(t, polarity)
        chip.run(chip.time_ns + 5 * MS)
        records = window.monitored()
    assert [(r.request, r.data) for r in records] == [(True, encode_call("RDIO", 7)), (False, 9)]


def test_line_faults():
    """LT-017, ST-009: a short power fail is seen as it is and stays latched until the next commit."""
    chip, window, _ = start(1)
    chip.run(60 * MS)
    chip.apf(True)
    chip.run(chip.time_ns + 5 * MS)
    assert window.line_faults()["apf"] == (True, True)
    chip.apf(False)
    chip.run(chip.time_ns + 15 * MS)
    assert window.line_faults()["apf"] == (False, True)
    window.set_control()
    chip.run(chip.time_ns + 5 * MS)
    assert window.line_faults() == {"apf": (False, False), "efault": (False, False), "jabber": (False, False)}


def test_earth_fault():
    """LT-016, LT-017, ST-009: after 1 s at the pin the host sees an earth fault; shorter ones leave no trace, and data
    exchange goes on. Latched until the next commit, and again while it lasts."""
    chip, window, _ = start(1)
    chip.run(80 * MS)
    chip.efault(True)
    chip.run(chip.time_ns + 100 * MS)
    chip.efault(False)                      # 100 ms: not long enough
    chip.run(chip.time_ns + MS)
    chip.efault(True)
    begin = chip.time_ns
    chip.run(begin + 995 * MS)
    assert window.line_faults()["efault"] == (False, False) and window.state().las == {1}
    chip.run(begin + 1_010 * MS)
    assert window.line_faults()["efault"] == (True, True) and window.state().las == {1}
    window.set_control()
    chip.run(chip.time_ns + 5 * MS)
    assert window.line_faults()["efault"] == (True, True)


def test_foreign_sender_in_requests():
    """RX-014, ST-001, SL-003: somebody else's pulses between the own ones spoil requests: BAD_MASTER, even where the
    slave answers. Each attempt is counted once, and the slaves stay in data exchange."""
    chip, window, _ = start(1, 2)
    chip.run(80 * MS)
    rng = random.Random(1)
    for _ in range(60):
        chip.run(chip.time_ns + rng.randrange(2_000_000, 3_000_000))    # a repetition shall find the line free
        chip.net.inject(chip.time_ns + 1_000, rng.choice((-1, 1)))
    chip.run(chip.time_ns + 5 * MS)
    las = window.state().las
    window.set_control(offline=True)
    chip.run(chip.time_ns + 80 * MS)        # everything is copied once
    log = chip.log()
    counted = [window.statistics(index) for index in range(64) if index != 32]
    spoilt = sum(found.classes.get(ErrorClass.BAD_MASTER, 0) for found in counted)
    assert las == {1, 2}
    assert sum(found.requests for found in counted) in (len(log), len(log) - 1)    # OFFLINE may abort the last one
    assert 10 < spoilt <= 60 and sum(found.repeat_ok for found in counted) >= spoilt - 1
