# SPDX-License-Identifier: Apache-2.0
"""The HTML report: its data, its safety, thinning, events, eyes; in a real browser where there is one."""
import base64
import hashlib
import json
import re
from collections import Counter
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import pytest
from fake_bench import FakeBench
from typer.testing import CliRunner

from asi import cli, eye, html_report, trace
from asi.native import Net
from asi.plant import load_plant, parse_plant
from asi.regmap import ErrorClass, Phase
from asi.run import Runner
from asi.telegram import encode_call, request_pulses, response_pulses
from asi.telegram_log import to_record
from asi.trace import KEPT, PROBE, REPEATED, REQUEST_OK, ROW, SLICE_NS, Trace
from tools import browser_check

ROOT = Path(__file__).resolve().parents[2]
SETTLE = 20_000_000
HOSTILE = """</script><script>document.title=1</script><b>"'&amp;<!--\u2028;"""
VOID = {"meta", "link", "br", "input", "img", "hr"}


class Page(HTMLParser):
    """Elements with their attributes and text; fails on tags that do not match."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.open, self.elements, self.texts = [], [], {}
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        self.texts[len(self.elements) - 1] = ""
        if tag not in VOID:
            self.open.append((tag, len(self.elements) - 1))

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open and self.open[-1][0] == tag, f"</{tag}> closes {self.open[-1:]}"
        self.open.pop()

    def handle_data(self, data):
        for _, number in self.open[-3:]:
            self.texts[number] += data

    def all(self, tag, **attributes):
        return [(number, attrs) for number, (name, attrs) in enumerate(self.elements) if name == tag
                and all(attrs.get(key.replace("_", "-")) == value for key, value in attributes.items())]

    def data(self):
        (number, _), = self.all("script", id="data")
        return json.loads(self.texts[number])


def rows(data):
    return list(ROW.iter_unpack(base64.b64decode(data["timeline"]["rows"])))


@pytest.fixture(scope="module")
def packaging(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    Runner(load_plant(ROOT / "sim/plants/packaging.toml").with_settle(SETTLE), FakeBench(), folder).run()
    return folder


def telegram(t_ns, call, error=ErrorClass.OK, data=0, phase=Phase.DATA_EXCHANGE, repeated=0, delay=21_500, **more):
    return SimpleNamespace(t_ns=t_ns, delay_ns=delay if error != ErrorClass.NO_RESPONSE else -1, call=call,
                           error_class=int(error), data=data, phase=None if phase is None else int(phase),
                           repeated=repeated, request_ok=1, **more)


def traced(telegrams, **options):
    out = Trace(**options)
    for one in telegrams:
        out.add(to_record(one), one)
    return out


# ---------------------------------------------------------------- the data
def test_page_holds_and_shows_the_report(packaging):
    """PL-005: the data in the page is report.json; each number with a path and each table cell is its value."""
    report = json.loads((packaging / "report.json").read_text())
    page = Page((packaging / "report.html").read_text())
    assert page.data()["report"] == report and page.data()["schema"] == html_report.SCHEMA
    paths = [attrs for _, attrs in page.elements if "data-path" in attrs]
    for attrs in paths:
        value = report
        for key in attrs["data-path"].split("."):
            value = value[int(key)] if isinstance(value, list) else value[key]
        assert json.loads(attrs["data-v"]) == value, attrs
    shown = {attrs["data-path"] for attrs in paths}
    assert {"run.bus_time_ns", "cycles.min_ns", "cycles.mean_ns", "cycles.max_ns", "telegrams.requests",
            "telegrams.failed", "run.firmware", "result", "checks.0.result", "state.flags.apf"} <= shown
    cells = page.all("td")
    slaves = {"" if row["index"] is None else str(row["index"]): row for row in report["slaves"]}
    assert [attrs["data-index"] for _, attrs in page.all("tr") if "data-index" in attrs] == list(slaves)
    heads = [attrs["data-key"] for _, attrs in page.all("th", scope="col") if attrs.get("data-key")]
    seen = 0
    for row, (index, slave) in zip(range(len(slaves)), slaves.items()):
        mine = cells[row * (len(heads) - 1):(row + 1) * (len(heads) - 1)]
        for _, attrs in mine:
            if "num" in attrs["class"].split():
                value = slave
                for key in attrs["data-key"].split("."):
                    value = value.get(key, 0)
                assert json.loads(attrs["data-v"]) == value, (index, attrs)
                seen += 1
    assert seen >= 8 * len(slaves) and {"requests", "answers", "failed", "repeated", "by_class.NO_RESPONSE",
                                        "delay_mean_ns", "deviation_ns"} <= set(heads)


def test_time_line_has_the_telegrams_of_the_log(packaging):
    """PL-005: one row per line of telegrams.jsonl, the same call, address, data, answer, delay, class and phase."""
    data = Page((packaging / "report.html").read_text()).data()
    line = data["timeline"]
    records = [json.loads(text) for text in (packaging / "telegrams.jsonl").read_text().splitlines()]
    assert line["total"] == line["shown"] == len(records) > 1000 and line["every"] == 1
    for row, record in zip(rows(data), records, strict=True):
        t_ns, delay, _, _, call, error, answer, phase, flags = row
        assert line["calls"][call] == [record[key] for key in ("call", "address", "index", "data", "word")]
        assert (t_ns, line["classes"][str(error)], line["phase_names"][str(phase)]) == (
            record["t_ns"], record["class"], record["phase"])
        assert delay == (-1 if record["delay_ns"] is None else record["delay_ns"])
        assert (None if answer == 255 else f"{answer:04b}") == record["answer"]
        assert (bool(flags & REPEATED), bool(flags & REQUEST_OK)) == (record["repeated"], record["request_ok"])


def test_row_counts_answers_classes_delays(packaging):
    """PL-002, PL-005: the new columns of a slave follow from its telegrams in the log."""
    report = json.loads((packaging / "report.json").read_text())
    records = [json.loads(text) for text in (packaging / "telegrams.jsonl").read_text().splitlines()]
    for row in report["slaves"][:-1]:
        mine = [record for record in records if record["index"] == row["index"]]
        delays = [record["delay_ns"] for record in mine if record["answer"] is not None]
        assert row["by_class"] == dict(Counter(record["class"] for record in mine)) and row["answers"] == len(delays)
        if delays:
            assert (row["delay_min_ns"], row["delay_max_ns"]) == (min(delays), max(delays))
            assert row["delay_mean_ns"] == round(sum(delays) / len(delays))
        else:
            assert row["delay_min_ns"] is row["delay_mean_ns"] is row["delay_max_ns"] is None


def test_cycle_histogram_counts_every_cycle():
    """PL-005: bars add up to the cycles; their times are those from one DEXG of the lowest number to the next."""
    calls = [telegram(5_000_000 * cycle + 200_000 * k + 10_000 * (cycle % 3) * (k == 0),
                      encode_call("DEXG", k + 1), data=1) for cycle in range(40) for k in range(3)]
    out = traced(calls)
    starts = [one.t_ns for one in calls if one.call >> 5 & 31 == 1]
    periods = [b - a for a, b in zip(starts, starts[1:])]
    assert out.cycle_times.per_us == Counter(round(period / 1000) for period in periods[1:]) or \
        out.cycle_times.per_us == Counter(round(period / 1000) for period in periods)
    svg = html_report._histogram(out.cycle_times.per_us)
    assert sum(map(int, re.findall(r'data-count="(\d+)"', svg))) == sum(out.cycle_times.per_us.values())


def test_no_html_when_not_wanted(tmp_path):
    """PL-005: without the page nothing of it is written, and report.json is the same."""
    plant = load_plant(ROOT / "sim/plants/packaging.toml").with_settle(SETTLE)
    result = Runner(plant, FakeBench(), tmp_path, html=False).run()
    assert not (tmp_path / "report.html").exists()
    again = Runner(plant, FakeBench(), tmp_path).run()
    assert (tmp_path / "report.html").exists()
    for one in (result, again):
        one["run"].update(wall_s=0, real_time_ratio=0)
    assert result == again


def test_page_of_combined_transactions(tmp_path):
    """PL-005, FN-025, FN-030, EX-038: values with marks, functions, the log, history and storage are there;
    a page of plain slaves has no empty tables for them."""
    plant = load_plant(ROOT / "sim/plants/combined.toml").with_settle(SETTLE)
    report = Runner(plant, FakeBench(), tmp_path, until_ns=350_000_000).run()
    page = Page((tmp_path / "report.html").read_text())
    shown = {attrs["data-path"]: page.texts[number] for number, attrs in page.all("span") if "data-path" in attrs}
    for k, row in enumerate(report["analog"]):
        assert shown[f"analog.{k}.value"].startswith(f"{row['value']:04X} (")
        assert shown.get(f"analog.{k}.valid") == {True: "valid", False: "invalid", None: None}[row["valid"]]
    assert [shown[f"functions.{k}.result"] for k in range(3)] == ["OK", "PROFILE", "no answer"]
    (table, _), = page.all("table", id="log")
    cells = [page.texts[number] for number, attrs in page.all("td") if number > table]
    assert [event["text"] for event in report["events"]] == cells[1:2 * len(report["events"]):2]
    assert {"asks: read_id_string 4", "read_id_string 4: OK", "activated 5B"} <= {
        what for _, _, what in page.data()["timeline"]["events"]}
    texts = " ".join(page.texts[number] for number, _ in page.all("dd"))
    assert "no flash: nothing is kept over power-off" in texts
    assert "F-IN1 1, F-IN2 0" in texts and "nothing to tell" in texts
    plain = load_plant(ROOT / "sim/plants/packaging.toml").with_settle(SETTLE)
    Runner(plain, FakeBench(), tmp_path, until_ns=30_000_000).run()
    page = Page((tmp_path / "report.html").read_text())
    assert not page.all("table", id="analog") and not page.all("table", id="functions")


# ---------------------------------------------------------------- safety
def test_page_needs_and_may_load_nothing(packaging):
    """PL-006: no address to load from, no script or style beside ours, the policy allows ours only, by its hash."""
    text = (packaging / "report.html").read_text()
    page = Page(text)
    for _, attrs in page.elements:
        assert not {"src", "srcset", "action", "background", "style"} & set(attrs), attrs
        assert not [key for key in attrs if key.startswith("on")], attrs
        assert attrs.get("href", "data:,") == "data:,"
    assert not re.search(r"@import|url\(|https?:", text)
    scripts = page.all("script")
    assert len(scripts) == 2 and scripts[0][1] == {"type": "application/json", "id": "data"} and scripts[1][1] == {}
    (_, policy), = page.all("meta", http_equiv="Content-Security-Policy")
    digest = base64.b64encode(hashlib.sha256(page.texts[scripts[1][0]].encode()).digest()).decode()
    assert policy["content"].startswith("default-src 'none'; ") and f"script-src 'sha256-{digest}'" in policy["content"]


def hostile(tmp_path):
    quoted = json.dumps(HOSTILE)
    plant = parse_plant(f"""
name = {quoted}
description = {quoted}
duration = "1100ms"
[[slave]]
name = {quoted}
address = "1"
profile = "S-7.3.C"
[[slave]]
address = "2"
profile = "S-0.0"
[[event]]
at = "1050ms"
do = "drop"
slave = "1"
[expect]
las = ["1"]
""", f"{HOSTILE}.toml").with_settle(SETTLE)
    return Runner(plant, FakeBench(), tmp_path).run()


def test_texts_stay_texts(tmp_path):
    """PL-006: a hostile plant, slave or file name is shown as it is: no element more, data unbroken."""
    result = hostile(tmp_path)
    assert result["result"] == "expectation not met" and result["plant"]["name"] == HOSTILE
    text = (tmp_path / "report.html").read_text()
    page = Page(text)
    assert len(page.all("script")) == 2 and page.data()["report"] == result
    assert text.count("</script") == 2 and '<b>"' not in text and text.count("<!--") == 1
    (number, _), = page.all("h1")
    assert page.texts[number].startswith(HOSTILE)
    assert any(HOSTILE in page.texts[number] for number, attrs in page.all("td", data_key="name"))
    assert any(page.texts[number] == HOSTILE for number, attrs in page.all("td") if "data-key" not in attrs)
    assert any(HOSTILE in what for _, kind, what in page.data()["timeline"]["events"] if kind == "world")


# ---------------------------------------------------------------- long recordings
def long_line(cycles, wrong):
    """Cycles of five calls and a probe; wrong: {cycle: (class, call)} put into the third call, then its repetition."""
    t_ns = 1_000_000_000
    yield telegram(t_ns, encode_call("RDIO", 1), data=7, phase=Phase.DETECTION)
    for cycle in range(cycles):
        for k in range(5):
            t_ns += 154_000
            if k == 2 and cycle in wrong:
                yield telegram(t_ns, encode_call("DEXG", k + 1), wrong[cycle])
                t_ns += 154_000
                yield telegram(t_ns, encode_call("DEXG", k + 1), data=k, repeated=1)
            else:
                yield telegram(t_ns, encode_call("DEXG", k + 1), data=k)
        t_ns += 154_000
        yield telegram(t_ns, encode_call("RDIO", 30), ErrorClass.NO_RESPONSE, phase=Phase.INCLUSION)
    yield telegram(t_ns + 154_000, encode_call("WPAR", 4, 5), data=5, phase=Phase.MANAGEMENT)


def test_long_recordings_keep_what_matters():
    """PL-007: of 30 000 telegrams within a limit of 2000 every error, repetition and other call stays, with its
    neighbours; plain ones stay in whole slices; order and counts hold; the note gives the numbers."""
    wrong = {cycle: (ErrorClass.PARITY, ErrorClass.TIMING)[cycle % 2] for cycle in (3, 700, 701, 2500, 4990)}
    line = list(long_line(5000, wrong))
    out = traced(line, limit=2000)
    assert out.total == len(line) == 30_007 and out.shown <= 2000 and out.every >= 16
    page = html_report.of_run(json.loads(json.dumps(EMPTY_REPORT)), out, eye.empty())
    kept = rows(Page(page).data())
    times = [row[0] for row in kept]
    assert times == sorted(times) and len(set(times)) == len(times)
    there = set(times)
    for number, one in enumerate(line):
        name = "DEXG" if not one.call >> 10 and not one.call & 16 else "?"
        good = name == "DEXG" and not one.error_class
        plain = not one.repeated and (good or one.error_class == ErrorClass.NO_RESPONSE)
        if not plain:
            around = line[max(0, number - trace.CONTEXT):number + trace.CONTEXT + 1]
            assert {other.t_ns for other in around} <= there, number
        if one.t_ns // SLICE_NS % out.every == 0:
            assert one.t_ns in there
    outside = [row for row in kept if row[0] // SLICE_NS % out.every and not row[8] & KEPT]
    assert outside and len(outside) <= 2 * trace.CONTEXT * 12
    assert f"{out.shown} of 30007 telegrams" in page and f"every {out.every}th slice of 20 ms" in page
    assert sum(out.cycle_times.per_us.values()) >= 4990


def test_errors_stay_whatever_their_number():
    """PL-007: when errors alone exceed the limit they all stay; the neighbours go, the note does not promise them."""
    line = list(long_line(400, {cycle: ErrorClass.PARITY for cycle in range(400)}))
    out = traced(line, limit=300)
    assert sum(row[5] == ErrorClass.PARITY for row in rows({"timeline": out.data()})) == 400
    assert sum(bool(row[8] & REPEATED) for row in rows({"timeline": out.data()})) == 400
    assert "on both sides" not in out.note() and out.context == 0


def test_size_of_the_longest_page():
    """PL-007: a page filled to its limit stays below 3 MB; a short one has no note."""
    out = traced(long_line(12_000, {}))
    for k in range(3 * trace.MOST_EVENTS):
        out.event(k, "input", "17B Level sensor, high := 0101")
    assert trace.LIMIT * 3 // 8 < out.shown <= trace.LIMIT and out.left_out == {"input": 2 * trace.MOST_EVENTS}
    page = html_report.of_run(EMPTY_REPORT, out, eye.empty())
    assert len(page.encode()) < 3_000_000 and "4000 more events of the kind" in html_report.escape(out.note())
    assert traced(long_line(100, {})).note() is None


@pytest.mark.parametrize("phase, call, error, probe", [
    (Phase.INCLUSION, "RDIO", ErrorClass.NO_RESPONSE, True), (Phase.DETECTION, "RDIO", ErrorClass.NO_RESPONSE, True),
    (Phase.INCLUSION, "RDIO", ErrorClass.PARITY, False), (Phase.DATA_EXCHANGE, "DEXG", ErrorClass.NO_RESPONSE, False),
    (Phase.ACTIVATION, "RDIO", ErrorClass.NO_RESPONSE, False), (None, "RDIO", ErrorClass.NO_RESPONSE, True),
    (None, "DEXG", ErrorClass.NO_RESPONSE, False), (Phase.INCLUSION, "RDIO", ErrorClass.OK, False)])
def test_probes_are_no_errors(phase, call, error, probe):
    """PL-007: silence is no error where the call only looks for slaves, and nowhere else."""
    row, = rows({"timeline": traced([telegram(0, encode_call(call, 5), error, phase=phase)]).data()})
    assert bool(row[8] & PROBE) == probe


# ---------------------------------------------------------------- events
def test_slaves_that_come_and_go():
    """PL-010: exchange of data, loss after six failed requests (LK-004) and return are events at their telegram."""
    line, t_ns = [], 0
    for bad in (0, 0, *[1] * 5, 0, *[1] * 8, 0, 0):
        t_ns += 1_000_000
        line.append(telegram(t_ns, encode_call("DEXG", 7), ErrorClass.NO_RESPONSE if bad else ErrorClass.OK, data=1))
    events = [(t, what) for t, kind, what in traced(line).sorted_events() if kind == "slave"]
    assert events == [(1_000_000, "7 exchanges data"), (14_000_000, "7 does not answer: 6 failed requests in a row"),
                      (17_000_000, "7 exchanges data")]


def test_phases_of_the_time_line():
    """PL-010: phases run from their first to their last telegram; the three of a cycle are one; silence ends one."""
    line = [telegram(t * 1_000_000, encode_call("RDIO", 5), data=1, phase=phase) for t, phase in (
        (1, Phase.DETECTION), (2, Phase.DETECTION), (3, Phase.ACTIVATION), (4, Phase.DATA_EXCHANGE),
        (5, Phase.INCLUSION), (6, Phase.DATA_EXCHANGE), (30, Phase.DATA_EXCHANGE))]
    out = traced(line)
    assert out.phases == [[1e6, 2e6, "DETECTION"], [3e6, 3e6, "ACTIVATION"], [4e6, 6e6, "CYCLES"],
                          [30e6, 30e6, "CYCLES"]]
    assert [(t, what) for t, kind, what in out.events if kind == "phase"] == [
        (1e6, "DETECTION"), (3e6, "ACTIVATION"), (4e6, "CYCLES"), (30e6, "CYCLES")]


def test_plant_and_checks_are_events(tmp_path):
    """PL-010: what the plant does and its checks are listed at their times, with who and how."""
    hostile(tmp_path)
    events = Page((tmp_path / "report.html").read_text()).data()["timeline"]["events"]
    told = {kind: (t, what) for t, kind, what in events if kind in ("world", "check")}
    assert 70_000_000 <= told["world"][0] < 71_000_000 and told["world"][1] == f"drop 1 {HOSTILE}"
    assert told["check"][0] == 120_000_000 and told["check"][1].startswith("expect not met; LAS ")


# ---------------------------------------------------------------- eyes
def test_native_bench_measures_pulses():
    """PL-009: deviation of each good telegram and the counts of starts and ends, against the pulses that were sent."""
    net = Net()
    slave = net.add(5, io=0, id=0, inputs=0b0110)
    pulses = Counter()
    t_ns = 15_000_000
    for shift in (0, 1_000, -500, 2_000):
        net.advance(t_ns)
        net.set_faults(slave, p_shifted_pulse=0xFFFF if shift else 0, shift_ns=shift)
        late = 25 if shift == 1_000 else 0
        for number, (dt, polarity) in enumerate(request_pulses(encode_call("RDIO", 5))):
            net.master_pulse(t_ns + dt + late * (number > 0), polarity)
            if number:
                pulses["starts", 0, polarity > 0, eye.fold(dt + late)] += 1
                pulses["ends", 0, polarity > 0, eye.fold(dt + late + 1_500)] += 1
        sent = net.advance(t_ns + 400_000)
        for pulse in sent[1:]:
            pulses["starts", 1, pulse.polarity > 0, eye.fold(pulse.t_ns - sent[0].t_ns)] += 1
            pulses["ends", 1, pulse.polarity > 0, eye.fold(pulse.t_ns - sent[0].t_ns + pulse.width_ns)] += 1
        record, = net.log()
        assert record.request_dev_ns == late
        if shift == 2_000:
            assert record.error_class != ErrorClass.OK and record.answer_dev_ns is None
        else:
            assert record.error_class == ErrorClass.OK and record.answer_dev_ns == shift
        t_ns += 1_000_000
    counts = net.pulse_counts()
    have = Counter({(name, sender, bool(sign), k): number for name in counts for sender in (0, 1) for sign in (0, 1)
                    for k, number in enumerate(counts[name][sender][sign]) if number})
    assert have == pulses and sum(pulses.values()) > 150


def capture(path, form, shift=0):
    """A CSV of four exchanges at 8 MHz: volts (pulses of 2 V, 1.5 us) or comparator levels; answers' pulses late."""
    step, edges = 125, []
    for k in range(4):
        t0 = 100_000 + 300_000 * k
        edges += [(t0 + dt, sign) for dt, sign in request_pulses(encode_call("DEXG", 5, 0b1010))]
        first = t0 + 78_000 + 21_500
        edges += [(first + dt + shift * (dt > 0), sign) for dt, sign in response_pulses(0b0110)]
    lines = ["time_ns,u" if form == "volts" else "time_ns,rx_p,rx_n"]
    queue, now = sorted(edges), 0
    for t_ns in range(0, 1_400_000, step):
        while now < len(queue) and t_ns >= queue[now][0] + 1_500:
            now += 1
        sign = queue[now][1] if now < len(queue) and t_ns >= queue[now][0] else 0
        lines.append(f"{t_ns},{2.0 * sign + 0.001 * (t_ns % 3)}" if form == "volts" else
                     f"{t_ns},{int(sign > 0)},{int(sign < 0)}")
    path.write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize("form", ["volts", "levels"])
def test_eye_of_a_capture(tmp_path, form):
    """PL-009, PL-005: decode --html: starts and ends lie where the capture has them, volts are there if analog."""
    capture(tmp_path / "line.csv", form, shift=500)
    done = CliRunner().invoke(cli.app, ["decode", str(tmp_path / "line.csv"), "--html", str(tmp_path / "line.html"),
                                        "--stats", str(tmp_path / "line.json"), "--format", "none"])
    assert done.exit_code == 0, done.output
    page = Page((tmp_path / "line.html").read_text())
    data = page.data()
    assert data["kind"] == "capture" and data["report"] == json.loads((tmp_path / "line.json").read_text())
    assert data["timeline"]["total"] == 4 and len(rows(data)) == 4
    assert all(abs(row[3] - 500) <= 125 and abs(row[2]) <= 125 for row in rows(data))
    labels = [attrs["aria-label"] for _, attrs in page.all("svg")]
    assert sum("Voltage eye" in label for label in labels) == (2 if form == "volts" else 0)
    assert sum("Eye of pulse" in label for label in labels) == 2
    totals = [int(attrs["data-total"]) for _, attrs in page.all("svg") if "data-total" in attrs]
    assert totals == [4 * (len(request_pulses(encode_call("DEXG", 5, 0b1010))) - 1), 4 * (len(response_pulses(6)) - 1)]
    assert not [1 for _, attrs in page.all("svg") if attrs.get("data-outside", "0") != "0"]


def test_eye_counts_starts_ends_and_volts():
    """PL-009: the first pulse defines the grid and is not counted; ends follow their own pulse; samples are folded."""
    one = eye.Eye()
    for t_ns, polarity in ((1_500, -1), (4_600, 1), (7_400, -1)):
        one.end(10_000 + t_ns, polarity)
    for t_ns in (10_000, 16_000, 13_000):
        one.sample(t_ns, -2.0 if t_ns % 6000 == 4000 else 1.0)
    one.telegram(1, 10_000, [(0, -1), (3_100, 1), (6_000, -1)])
    starts, ends = one.counts["starts"], one.counts["ends"]
    assert [(sign, k) for sign in (0, 1) for k, n in enumerate(starts[1][sign]) if n] == [
        (0, eye.fold(0)), (1, eye.fold(3_100))]
    assert [(sign, k) for sign in (0, 1) for k, n in enumerate(ends[1][sign]) if n] == [
        (0, eye.fold(1_400)), (1, eye.fold(4_600))]
    assert not any(map(any, starts[0] + ends[0]))
    assert one.volts[1] == {(eye.fold(0), -20): 2, (eye.fold(3_000), 10): 1}


# ---------------------------------------------------------------- a real browser
needs_browser = pytest.mark.skipif(browser_check.missing() is not None, reason=str(browser_check.missing()))


@needs_browser
def test_page_in_a_browser(packaging, tmp_path):
    """PL-005, PL-006, PL-008: numbers, keyboard, wheel, drag, touch, sorting, contrast, no console line, no request; a
    hostile plant and a capture load as quietly."""
    capture(tmp_path / "line.csv", "volts")
    CliRunner().invoke(cli.app, ["decode", str(tmp_path / "line.csv"), "--html", str(tmp_path / "line.html"),
                                 "--format", "none"])
    hostile(tmp_path)
    with browser_check.Browser() as browser:
        lines = browser_check.check_page(browser, packaging / "report.html",
                                         json.loads((packaging / "report.json").read_text()))
        assert len(lines) == 7
        for name in ("report.html", "line.html"):
            browser.log("browser"), browser.log("performance")
            browser.open(tmp_path / name)
            assert browser.run("return [document.documentElement.dataset.ready, document.scripts.length]") == ["1", 2]
            browser_check.check_quiet(browser)
        browser.open(tmp_path / "report.html")
        assert browser.run("return document.title").startswith(HOSTILE.split("\u2028")[0])


EMPTY_REPORT = {
    "schema": "asi-report 1", "result": "ok", "error": None,
    "plant": {"file": "p.toml", "name": "Long", "description": "Long.", "seed": 1},
    "run": {"bus_time_ns": 10**11, "wanted_ns": 10**11, "clk_hz": 16_000_000, "clocks": 1, "wall_s": 1.0,
            "real_time_ratio": 1.0, "firmware": None},
    "state": {"phase": "OFFLINE", "flags": {}, "lds": [], "las": [], "lps": [], "lpf": []}, "slaves": [],
    "cycles": {"count": 0, "min_ns": None, "mean_ns": None, "max_ns": None},
    "telegrams": {"requests": 0, "repeated": 0, "failed": 0, "bad_requests": 0, "by_call": {}, "by_class": {}},
    "master": {}, "core": {"interrupts": 0, "longest_busy_clocks": 0, "longest_busy_in_cycle_clocks": 0},
    "start": {"first_telegram_ns": None, "first_cycle_ns": None, "start_up_ns": None}, "phases_ns": {}, "checks": [],
    "analog": [], "safety": [], "functions": [], "events": [], "events_lost": 0, "events_left_out": 0,
    "history": {"changed": [], "changed_us": None, "offline_causes": [], "last_offline_cause": None, "offline_us": None,
                "suspects": []},
    "storage": {"state": "NO_FLASH", "busy": False, "failed": False, "saved": False, "sequence": 0},
}
