# SPDX-License-Identifier: Apache-2.0
"""The runner, report, logs and command line, on a fake chip (fake_bench.py)."""
import fcntl
import json
import os
import re
from io import StringIO
from pathlib import Path
from types import SimpleNamespace

import pytest
from fake_bench import FakeBench
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console
from typer.testing import CliRunner

from asi import cli, regmap, report
from asi.bench import BenchError, name_waves
from asi.plant import Logged, load_plant, parse_plant
from asi.regmap import ErrorClass, Phase
from asi.run import Runner, Seen, compare
from asi.status import LogEvent
from asi.telegram import CALLS, Decoded, decode_call, encode_call
from asi.telegram_log import HEADER, TelegramLog, to_line, to_record
from asi.window import Analog, Event, HostWindow, State

ROOT = Path(__file__).resolve().parents[2]
PACKAGING = ROOT / "sim/plants/packaging.toml"
COMBINED = ROOT / "sim/plants/combined.toml"
REPLACEMENT = ROOT / "sim/plants/replacement.toml"
SETTLE = 20_000_000

SMALL = """
name = "Small"
description = "Two slaves."
duration = "1100ms"
[host]
mode = "protected"
[[slave]]
name = "One [bold]"
address = "1"
profile = "S-0.0"
inputs = "0011"
[[slave]]
name = "Two"
address = "2B"
profile = "S-7.A.E"
[expect]
las = ["1", "2B"]
"""


def small(*pairs):
    text = SMALL
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    return parse_plant(text, "small.toml").with_settle(SETTLE)


def show(result):
    out = StringIO()
    report.show(result, Console(file=out, width=160))
    return out.getvalue()


def keys(value, prefix=""):
    """Every key path of nested data as docs/report.md writes it."""
    if isinstance(value, list):
        for item in value[:1]:
            yield from keys(item, f"{prefix}[]") if isinstance(item, dict) else ()
    for key, item in value.items() if isinstance(value, dict) else ():
        path = f"{prefix}.{key}".lstrip(".")
        if path in ("state.flags", "telegrams.by_call", "telegrams.by_class", "phases_ns", "slaves[].by_class"):
            yield f"{path}.*"
        elif isinstance(item, (dict, list)) and path not in ("plant", "run"):
            if not isinstance(item, dict):
                yield path + "[]" * bool(item and isinstance(item[0], dict))
            yield from keys(item, path)
        elif isinstance(item, dict):
            yield from keys(item, path)
        else:
            yield path


# ---------------------------------------------------------------- report
def test_report_and_json_say_the_same(tmp_path):
    """PL-002: the JSON file is the report, and every number on the terminal is one of its numbers."""
    plant = load_plant(PACKAGING).with_settle(SETTLE)
    result = Runner(plant, FakeBench(), tmp_path).run()
    assert json.loads((tmp_path / "report.json").read_text()) == result
    assert result["result"] == "ok" and result["error"] is None
    text = show(result)
    for name in ("lds", "las", "lps"):
        assert f"{name.upper()}       {len(result['state'][name])}: " in text
    for name, on in result["state"]["flags"].items():
        assert f"{name}={int(on)}" in text
    cycles, telegrams = result["cycles"], result["telegrams"]
    assert (f"min {report.us(cycles['min_ns'])}, mean {report.us(cycles['mean_ns'])}, "
            f"max {report.us(cycles['max_ns'])}; {cycles['count']} cycles") in text
    assert (f"{telegrams['requests']} requests, {telegrams['repeated']} repeated, {telegrams['failed']} "
            f"without a valid answer, {telegrams['bad_requests']} bad requests") in text
    for row in result["slaves"]:
        line, = (line for line in text.splitlines() if re.match(rf"\s*{row['address'] or 'other'}\s{{2}}\S", line))
        numbers = [str(row[key]) for key in ("requests", "failed", "repeated")]
        assert line.split()[-3:] == numbers
        if row["address"]:
            lists = [name.upper() for name in report.LISTS if row[name]]
            shown = [row["name"], row["profile"], " ".join(lists)] + [row[k] for k in ("inputs", "outputs") if row[k]]
            assert re.search(r"\s+".join(map(re.escape, shown)), line)
    start = result["start"]
    assert f"first telegram at {report.ms(start['first_telegram_ns'])}, first cycle at " in text
    for phase, time_ns in result["phases_ns"].items():
        assert (f"{phase} {report.ms(time_ns)}" in text) == bool(time_ns)


def test_report_numbers_are_the_log_s(tmp_path):
    """PL-002: the counts of the report are those of the log lines; the rows add up to the total."""
    result = Runner(load_plant(PACKAGING).with_settle(SETTLE), FakeBench(), tmp_path).run()
    records = [json.loads(line) for line in (tmp_path / "telegrams.jsonl").read_text().splitlines()]
    assert result["telegrams"]["requests"] == len(records) == sum(row["requests"] for row in result["slaves"])
    for row in result["slaves"][:-1]:
        mine = [record for record in records if record["index"] == row["index"]]
        assert row["requests"] == len(mine) and row["failed"] == sum(r["class"] != "OK" for r in mine)
    assert result["start"]["first_telegram_ns"] == records[0]["t_ns"]
    assert sum(result["telegrams"]["by_call"].values()) == sum(result["telegrams"]["by_class"].values()) == len(records)


def test_report_rows(tmp_path):
    """PL-002: rows follow number, then A before B; absent, unprojected and unaddressed slaves are told apart."""
    result = Runner(load_plant(PACKAGING).with_settle(SETTLE), FakeBench(), tmp_path).run()
    rows = {row["address"]: row for row in result["slaves"]}
    assert list(rows) == ["0", "1", "2", "3", "4", "5A", "5B", "6A", "6B", "7A", "7B", "8", "9", "10", "12", "20", None]
    lists = {address: [name for name in report.LISTS if row[name]] for address, row in rows.items()}
    assert lists["0"] == ["lds"] and lists["12"] == ["lps"] and lists["20"] == ["lds"]
    assert lists["5A"] == ["lds", "las", "lps"] and lists[None] == []
    assert rows["12"]["name"] == "Label printer" and rows["12"]["detected"] is None
    assert rows["5B"]["detected"] == "S-0.A.E" and rows["0"]["inputs"] is None
    assert rows["4"]["outputs"] == "0100" and rows["8"]["inputs"] == "1111"


def test_every_field_of_the_report_is_documented(tmp_path):
    """PL-002: docs/report.md has exactly the keys of the report, and the right exit codes."""
    result = Runner(load_plant(COMBINED).with_settle(SETTLE), FakeBench(), tmp_path).run()
    text = (ROOT / "docs/report.md").read_text()
    documented = {name for row in re.findall(r"^\| (`.*?) \|", text.split("## report.json")[1], re.M)
                  for name in re.findall(r"`([^`]+)`", row)}
    assert set(keys(result)) | {"slaves[]", "checks[]", "analog[]", "safety[]", "functions[]", "events[]"} == documented
    flags = re.findall(r"`(\w+)`", text.split("state.flags.*` |")[1].splitlines()[0])
    assert set(flags) == set(result["state"]["flags"])
    codes = {match[1]: int(match[0]) for match in re.findall(r"^\| (\d+) \| `(.+?)` \|", text, re.M)}
    assert codes == cli.EXIT_CODES


def test_names_with_markup_stay_what_they_are(tmp_path):
    """PL-002: a name that looks like terminal markup is shown as it is."""
    assert "One [bold]" in show(Runner(small(), FakeBench(), tmp_path).run())


@pytest.mark.parametrize("addresses, text", [
    ([], "none"), (["1"], "1"), (["1", "2"], "1 2"), (["1", "2", "3", "5"], "1-3 5"),
    (["1A", "1B", "2A", "2B", "3A", "3B"], "1A-3A 1B-3B"), (["0", "4", "5B", "6B", "7B"], "0 4 5B-7B")])
def test_lists_read_well(addresses, text):
    """PL-002: runs of addresses are joined, A and B apart."""
    assert report._list_text(addresses) == text


# ---------------------------------------------------------------- checks
def test_compare_names_every_difference():
    """PL-004: each kind of expectation that is not met gives its own line; met ones give none."""
    plant = small(('las = ["1", "2B"]', 'las = ["1", "2B"]\nlds = []\nlps = ["1"]\ncycle_max = "1ms"\n'
                                        'flags = { config_ok = true, apf = false }\ninputs = { "1" = "0011" }'))
    check = plant.checks[-1]
    flags = dict.fromkeys(regmap.__dict__, False) | {"config_ok": True, "apf": False}
    good = State(flags, Phase.DATA_EXCHANGE, frozenset(), frozenset({1, 34}), frozenset({1}), frozenset(), {})
    assert compare(check, good, [0, 3, *[0] * 62], 1_000_000, plant.name_of) == []
    bad = State(flags | {"config_ok": False, "apf": True}, Phase.OFFLINE, frozenset({3}), frozenset({1, 5}),
                frozenset(), frozenset(), {})
    assert compare(check, bad, [0] * 64, 1_000_001, plant.name_of) == [
        "LDS too many: 3", "LAS missing: 2B", "LAS too many: 5", "LPS missing: 1", "config_ok is 0, expected 1",
        "apf is 1, expected 0", "input 1 is 0000, expected 0011",
        "longest cycle 1000.001 us, expected at most 1000.000 us"]
    assert "no cycle was measured" in compare(check, good, [0, 3, *[0] * 62], 0)


def test_checks_at_their_time(tmp_path):
    """PL-004: a check sees the state before what happens at its time; one after the end is not reached."""
    plant = small(('[expect]', '[[event]]\nat = "1050ms"\ndo = "drop"\nslave = "Two"\n[[check]]\nat = "1050ms"\n'
                               'las = ["1", "2B"]\n[[check]]\nat = "1060ms"\nlas = ["1"]\n[expect]'),
                  ('las = ["1", "2B"]\n[[check]]', 'las = ["1", "2B"]\n[[check]]'))
    result = Runner(plant, FakeBench(), tmp_path).run()
    assert [c["result"] for c in result["checks"]] == ["met", "met", "not met"]
    assert result["result"] == "expectation not met" and result["checks"][2]["differences"] == ["LAS missing: 2B"]
    short = Runner(plant, FakeBench(), tmp_path, until_ns=75_000_000).run()
    assert [c["result"] for c in short["checks"]] == ["met", "not reached", "not reached"] and short["result"] == "ok"


# ---------------------------------------------------------------- host and world
def test_host_commits_once_and_completely(tmp_path):
    """PL-004: the host writes projection, codes, parameters and mode, then one commit, after the firmware is up."""
    bench = FakeBench()
    Runner(load_plant(PACKAGING).with_settle(SETTLE), bench, tmp_path).run()
    commits = [(time, data) for time, addr, data in bench.writes if addr == regmap.HOST_HOST_SEQ]
    assert [data for _, data in commits] == [1] and commits[0][0] >= 1_000_000
    before = [addr for _, addr, _ in bench.writes[:[a for _, a, _ in bench.writes].index(regmap.HOST_HOST_SEQ)]]
    assert {regmap.HOST_LPS_CFG, regmap.HOST_LPS_CFG + 4, regmap.HOST_HOST_CTRL} < set(before)
    window = HostWindow(bench)
    assert window.index_list(regmap.HOST_LPS_CFG) == {1, 2, 3, 4, 5, 37, 6, 38, 7, 39, 8, 9, 10, 12}
    assert bench.host_read(regmap.HOST_PCD + 4 * 6) & 0xFFFF == 0xEF07      # 12: S-7.0.E, ID1 = F
    assert bench.host_read(regmap.HOST_PCD + 4 * 10) & 0xFFFF == 0xFFFF     # 20 is not projected
    parameters = window.parameters(regmap.HOST_PP)
    assert parameters[4] == 0b1011 and parameters[6] == 0b1101 and parameters[5] == 15
    assert bench.host_read(regmap.HOST_HOST_CTRL) == 0b1101  # protected, data exchange, auto address


def test_host_events_wait_for_the_open_commit(tmp_path):
    """PL-004: host events at one time become one commit after the other, in order."""
    plant = small(("[expect]", "".join(f'[[event]]\nat = "1050ms"\ndo = "{do}"\nvalue = {value}\n' for do, value in
                                       (("mode", '"configuration"'), ("data_exchange", "false"), ("offline", "true")))
                   + "[expect]"))
    bench = FakeBench()
    Runner(plant, bench, tmp_path).run()
    control = [(t, d) for t, a, d in bench.writes if a == regmap.HOST_HOST_CTRL]
    assert [d for _, d in control] == [0b101, 0b100, 0b000, 0b010]
    assert control[1][0] < control[2][0] < control[3][0]


def test_world_events_reach_the_bench(tmp_path):
    """PL-004: inputs, faults, power and the power fail pin arrive at the right slave at the right time."""
    story = ""
    for at, do, more in ((1020, "inputs", 'slave = "1"\nvalue = "1000"'),
                         (1030, "noise", 'slave = "2B"\nno_answer = 1'), (1040, "quiet", 'slave = "all"'),
                         (1050, "power_off", ""), (1060, "power_on", ""),
                         (1070, "apf_low", ""), (1080, "apf_high", ""), (1090, "periphery_fault", 'slave = "Two"'),
                         (1095, "periphery_ok", 'slave = "Two"')):
        story += f'[[event]]\nat = "{at}ms"\ndo = "{do}"\n{more}\n'
    bench, calls = FakeBench(), []
    for name in ("set_inputs", "set_faults", "set_periphery_fault", "power", "apf"):
        def spy(*args, name=name, work=getattr(bench, name)):
            calls.append((bench.now // 1_000_000, name, *args))
            return work(*args)
        setattr(bench, name, spy)
    result = Runner(small(("[expect]", story + "[expect]")), bench, tmp_path).run()
    calls = [(t - 20, *(a if isinstance(a, (int, str, bool)) else a.no_answer for a in rest)) for t, *rest in calls]
    assert calls == [(20, "set_inputs", 0, 8), (30, "set_faults", 1, 65535), (40, "set_faults", 0, 0),
                     (40, "set_faults", 1, 0), (50, "power", False), (50, "apf", True), (60, "power", True),
                     (60, "apf", False), (70, "apf", True), (80, "apf", False), (90, "set_periphery_fault", 1, True),
                     (95, "set_periphery_fault", 1, False)]
    assert result["telegrams"]["by_class"]["NO_RESPONSE"] > 0


@pytest.mark.parametrize("bench, text", [
    (dict(boots=False), "the firmware did not start within 100 ms"),
    (dict(applies=False), "commit 1 was not applied within 100 ms"),
    (dict(commit_result=-3), "commit 1 was refused: FW_RESULT = -3"),
    (dict(sick=True), "was never consistent in 50 tries (IN_SEQ)")])
def test_failures_of_the_chip_are_named(tmp_path, bench, text):
    """PL-002: a chip that does not do its part ends the run with a reason, and the report is still written."""
    plant = small(('"1100ms"', '"1200ms"'), ('las = ["1", "2B"]', 'las = ["1", "2B"]\ninputs = { "1" = "0011" }'))
    result = Runner(plant, FakeBench(**bench), tmp_path).run()
    assert result["result"] == "failed" and text in result["error"] and text in show(result)
    assert json.loads((tmp_path / "report.json").read_text()) == result


def test_what_the_simulation_refuses_is_a_failed_run(tmp_path):
    """PL-002: a slave that the simulation does not take, that no check of the plant knew: a report."""
    bench = FakeBench()

    def add(slave):
        raise RuntimeError("string 0 of slave 0: refused")
    bench.add = add
    result = Runner(load_plant(COMBINED).with_settle(SETTLE), bench, tmp_path).run()
    assert (result["result"], result["error"]) == ("failed", "string 0 of slave 0: refused")


@pytest.mark.parametrize("storage, text", [
    (("NO_FLASH", False, True, False, 0), "no flash: nothing is kept over power-off"),
    (("EMPTY", False, False, False, 0), "flash was empty at the start; nothing stored since"),
    (("EMPTY", True, False, False, 0), "flash was empty at the start; storing"),
    (("LOADED", False, False, True, 7), "loaded from flash at the start; the data in use is stored, set 7"),
    (("LOADED", False, True, False, 7),
     "loaded from flash at the start; storing FAILED: the data in use is not in flash"),
    (("CORRUPT", False, False, True, 1),
     "flash was CORRUPT at the start, defaults in use; the data in use is stored, set 1")])
def test_storage_in_words(storage, text):
    """PL-002, NV-005: a board without flash is a plain state; a store that failed is loud."""
    assert report.storage_line(dict(zip(("state", "busy", "failed", "saved", "sequence"), storage))) == text


# ---------------------------------------------------------------- combined transactions, functions, log
@pytest.mark.parametrize("path", [COMBINED, REPLACEMENT], ids=lambda path: path.stem)
def test_plants_of_the_new_functions(tmp_path, path):
    """PL-004, FN-005, FN-020, FN-025, FN-026, FN-030, FN-031: values, strings and functions reach both ends, on a
    master made of rules."""
    plant = load_plant(path).with_settle(SETTLE)
    result = Runner(plant, FakeBench(), tmp_path).run()
    assert result["result"] == "ok" and all(check["result"] == "met" for check in result["checks"])
    assert len(result["checks"]) == len(plant.checks) + len(plant.functions)
    assert plant.duration_ns <= 2_500_000_000


def test_report_shows_values_functions_and_log(tmp_path):
    """PL-002, FN-025, FN-030, EX-038: value with mark, what the slave has received, functions, events, storage."""
    result = Runner(load_plant(COMBINED).with_settle(SETTLE), FakeBench(), tmp_path, until_ns=350_000_000).run()
    rows = {(row["address"], row["direction"], row["channel"]): row for row in result["analog"]}
    assert rows["1", "in", 1]["value"] == 0xFC18 and rows["1", "in", 1]["valid"] is True
    assert rows["2", "in", 2]["value"] == 0x7FFF and rows["2", "in", 2]["valid"] is False
    assert rows["3", "out", 2]["value"] == rows["3", "out", 2]["received"] == 0xFF9C
    assert rows["10", "out", 1]["kind"] == "CTT2" and ("10", "in", 2) not in rows       # its ID object says one word
    assert [row["result"] for row in result["functions"]] == ["OK", "PROFILE", None]
    assert result["safety"] == [{"address": "9", "name": "Door switch", "f_in1": True, "f_in2": False}]
    assert sum(event["event"] == "activated" for event in result["events"]) == 11 and result["events_lost"] == 0
    text = show(result)
    for line in (r"2  Temperatures, two channels\s+CTT1\s+in\s+2\s+7FFF 32767  invalid",
                 r"3  Positioner, two set-points\s+CTT1\s+out  2\s+FF9C -100\s+FF9C -100",
                 r"read_id_string 4 at 120.000 ms: OK after", r"write_parameter 4 0111 at 170.000 ms: PROFILE",
                 r"9 F-IN1=1 F-IN2=0", r"storage\s+no flash: nothing is kept over power-off", r"activated 5B",
                 r"\.\.\. 2 before these"):
        assert re.search(line, text), line


def test_function_that_ends_otherwise(tmp_path):
    """PL-004: a function with another result, answer or string is a check that is not met, with its own line."""
    plant = load_plant(COMBINED).with_settle(SETTLE)
    bench = FakeBench(refuse={31: -24})
    bench_add = bench.add

    def add(slave):
        handle = bench_add(slave)
        bench.slaves[handle].strings = {0: b"other"}
        return handle
    bench.add = add
    result = Runner(plant, bench, tmp_path).run()
    assert result["result"] == "expectation not met"
    assert [check["differences"] for check in result["checks"] if check["name"] == "function"] == [
        ["read_id_string 4: string 6f 74 68 65 72, expected 00 b7 03 00 00 03 2a 11 01"], [],
        ["message 10 10 00 05: DEVICE, expected OK"]]


def test_functions_wait_for_each_other_and_outputs_do_not(tmp_path):
    """FN-032, PL-004: a slow function holds the next one back, not the outputs; what was not answered is said."""
    bench = FakeBench(function_ns=200_000_000)
    result = Runner(load_plant(COMBINED).with_settle(SETTLE), bench, tmp_path).run()
    asked = [time for time, addr, _ in bench.writes if addr == regmap.HOST_FN_SEQ]
    first, second = result["functions"][:2]
    assert len(asked) == 3 and asked[1] >= asked[0] + 200_000_000
    assert second["at_ns"] < first["answered_ns"] <= second["asked_ns"]
    outputs = [time for time, addr, data in bench.writes if addr == regmap.HOST_AODI + 24 and data >> 16 == 0xFF9C]
    assert 320_000_000 <= outputs[0] <= 330_000_000
    never = Runner(load_plant(COMBINED).with_settle(SETTLE), FakeBench(function_ns=10**12), tmp_path).run()
    assert [c["differences"] for c in never["checks"] if c["name"] == "function"][0] == [
        "read_id_string 4: not answered"]
    short = Runner(load_plant(COMBINED).with_settle(SETTLE), FakeBench(), tmp_path, until_ns=60_000_000).run()
    assert {c["result"] for c in short["checks"]} == {"not reached"} and short["result"] == "ok"


def test_a_function_without_end_stops_the_run(tmp_path):
    """PL-002, FN-032: no answer for a minute is a failure of the simulation, not a wait without end."""
    plant = small(("[expect]", '[[host.function]]\nat = "1050ms"\ndo = "store_parameters"\n[expect]'),
                  ('"1100ms"', '"70s"'))
    bench = FakeBench(function_ns=10**12)
    run = bench.run
    bench.run = lambda until_ns: run(until_ns) if bench.now < 80_000_000 else setattr(
        bench, "now", bench.now + 10**9) or bench.now
    result = Runner(plant, bench, tmp_path).run()
    assert result["result"] == "failed" and "store_parameters: no answer within 60 s" in result["error"]


def test_commits_wait_for_functions_that_change_their_words(tmp_path):
    """HW-002, FN-010: a commit waits for a function that changes its words, not for one with telegrams."""
    for do, waits in (("store_configuration", True), ("write_id1", False)):
        value = 'value = "1"\n' if do == "write_id1" else ""
        plant = small(("[expect]", f'[[host.function]]\nat = "1040ms"\ndo = "{do}"\n{value}[[event]]\nat = "1045ms"\n'
                                   'do = "data_exchange"\nvalue = false\n[expect]'))
        bench = FakeBench(function_ns=20_000_000)
        Runner(plant, bench, tmp_path).run()
        commit = [time for time, addr, _ in bench.writes if addr == regmap.HOST_HOST_SEQ][1]
        assert (commit >= 80_000_000) == waits and commit >= 65_000_000


def test_auto_clear_is_a_function_at_the_start(tmp_path):
    """EX-033, PL-004: the host sets auto clear once its first commit is applied."""
    plant = small(('mode = "protected"', 'mode = "protected"\nauto_clear = 2'))
    bench = FakeBench()
    result = Runner(plant, bench, tmp_path).run()
    assert (bench.host_read(regmap.HOST_FN_CODE), bench.host_read(regmap.HOST_FN_ARG)) == (33, 2)
    order = [addr for _, addr, _ in bench.writes if addr in (regmap.HOST_HOST_SEQ, regmap.HOST_FN_SEQ)]
    assert order == [regmap.HOST_HOST_SEQ, regmap.HOST_FN_SEQ] and result["result"] == "ok"


def test_world_of_combined_slaves_reaches_the_bench(tmp_path):
    """PL-004, SL-009: values, marks and contacts arrive at the right slave; both marks are told together."""
    story = "".join(f'[[event]]\nat = "{at}ms"\ndo = "{do}"\nslave = "In"\nvalue = {value}\n' for at, do, value in
                    ((1030, "overflow", [1, 2]), (1040, "invalid", [2]), (1050, "overflow", [])))
    plant = small(("[expect]", '[[slave]]\nname = "In"\naddress = "4"\nprofile = "S-7.3.D"\ninvalid = [1]\n'
                               'values = [3, [{ at = "1020ms", value = -1 }]]\n[[slave]]\nname = "Door"\n'
                               'address = "5"\nprofile = "S-0.B"\n' + story +
                               '[[event]]\nat = "1060ms"\ndo = "contacts"\nslave = "Door"\nvalue = [2]\n[expect]'),
                  ('las = ["1", "2B"]', 'las = ["1", "2B", "4", "5"]'))
    bench, calls = FakeBench(), []
    for name in ("set_value", "set_invalid", "set_safety"):
        def spy(*args, name=name, work=getattr(bench, name)):
            calls.append((bench.now // 1_000_000 - 20, name, *args))
            return work(*args)
        setattr(bench, name, spy)
    result = Runner(plant, bench, tmp_path).run()
    assert result["result"] == "ok"
    assert [call[1:] for call in calls] == [
        ("set_value", 2, 1, 0xFFFF), ("set_invalid", 2, 1, 3), ("set_invalid", 2, 2, 3), ("set_invalid", 2, 2, 0),
        ("set_safety", 3, plant.slaves[3].safety.table, 2)]
    assert [call[0] for call in calls] == [20, 30, 40, 50, 60]


def test_compare_names_differences_of_the_new_kinds():
    """PL-004: parameters, values, received words, log, LPF and suspects; what nobody has looked at is not met."""
    plant = small(('las = ["1", "2B"]', """
lpf = ["1"]
suspects = []
parameters = { "1" = "0101" }
analog = { "1" = [5, "invalid", "any", -1] }
log = [{ event = "addressed", address = "1" }, { event = "apf", data = 1 }]"""))
    check = plant.checks[-1]
    state = State({}, Phase.DATA_EXCHANGE, frozenset(), frozenset(), frozenset(), frozenset({1}), {})
    values = [Analog(5, True), Analog(0x7FFF, False), Analog(9, False), Analog(0xFFFF, True)]
    events = [Event(1, LogEvent.APF, 0, 1), Event(2, LogEvent.ADDRESSED, 1, 0), Event(3, LogEvent.APF, 0, 1)]
    seen = Seen(frozenset(), [0, 5], {1: values}, {}, events)
    assert compare(check, state, None, None, plant.name_of, seen) == []
    values = [Analog(5, False), Analog(0x7FFF, True), Analog(9, True), Analog(0xFFFE, True)]
    assert compare(check, state, None, None, plant.name_of, Seen(frozenset({3}), [0, 4], {1: values}, {}, events[:2])) \
        == ["SUSPECTS too many: 3", "parameter 1 is 0100, expected 0101",
            "value 1 channel 1 is 0005 (5) (invalid), expected 0005 (5)",
            "value 1 channel 2 is 7FFF (32767), expected invalid", "value 1 channel 4 is FFFE (-2), expected FFFF (-1)",
            "log: no apf after the events before"]
    assert compare(check, state, None, None, plant.name_of) == [
        "suspects were not looked at", "parameter 1 is not known, expected 0101",
        *(f"value 1 channel {k} is not known, expected {text}" for k, text in
          ((1, "0005 (5)"), (2, "invalid"), (4, "FFFF (-1)"))), "log: no addressed 1"]
    assert Logged(LogEvent.APF, None, 1) == check.log[1]


def test_the_log_is_read_while_it_lasts(tmp_path):
    """EX-038, PL-002: events that were overwritten are counted in the report and shown."""
    bench = FakeBench()
    run, flooded = bench.run, []

    def flood(until_ns):
        out = run(until_ns)
        if bench.now > 60_000_000 and not flooded:
            flooded.append(bench.now)
            for _ in range(70):
                bench._event(LogEvent.SUSPECT, 3)
        return out
    bench.run = flood
    result = Runner(small(), bench, tmp_path).run()
    assert sum(event["event"] == "suspect" for event in result["events"]) == 64 and result["events_lost"] == 6
    assert [event["event"] for event in result["events"]].index("activated") < 4
    assert "6 lost: the reader was too slow" in show(result)
    page = (tmp_path / "report.html").read_text()
    assert "events were overwritten before they were read" in page


# ---------------------------------------------------------------- telegram log
def telegram(call, error=ErrorClass.OK, data=0, delay=21_500, phase=Phase.DATA_EXCHANGE, repeated=0, ok=1, t=1_234_567):
    return SimpleNamespace(t_ns=t, delay_ns=delay, call=call, error_class=int(error), data=data, phase=int(phase),
                           repeated=repeated, request_ok=ok)


LINES = [
    (telegram(encode_call("DEXG", 49, 0b101), data=6),
     "       1234.567  DEXG 17B  101   -> 0110      21.500  OK             DATA_EXCHANGE"),
    (telegram(encode_call("DEXG", 17, 0b101, extended=True), ErrorClass.PARITY, repeated=1),
     "       1234.567  DEXG 17A  101   -> -         21.500  PARITY         DATA_EXCHANGE repeated"),
    (telegram(encode_call("RDIO", 18), ErrorClass.NO_RESPONSE, delay=-1, phase=Phase.INCLUSION),
     "       1234.567  RDIO 18         -> -                 NO_RESPONSE    INCLUSION"),
    (telegram(encode_call("WPAR", 3, 0b1011), data=0b1011, delay=33_500, phase=Phase.ACTIVATION),
     "       1234.567  WPAR 3    1011  -> 1011      33.500  OK             ACTIVATION"),
    (telegram(encode_call("ADRA", 0, 7), data=6, phase=Phase.MANAGEMENT),
     "       1234.567  ADRA 0    00111 -> 0110      21.500  OK             MANAGEMENT"),
    (telegram(encode_call("WID1", 0, 15), phase=Phase.MANAGEMENT),
     "       1234.567  WID1 0    1111  -> 0000      21.500  OK             MANAGEMENT"),
    (telegram(encode_call("WID1", 0, 0), phase=Phase.MANAGEMENT),
     "       1234.567  WID1 0    0000  -> 0000      21.500  OK             MANAGEMENT"),
    (telegram(0b1_00101_10111, data=4, phase=Phase.MANAGEMENT),
     "       1234.567  R1   5B         -> 0100      21.500  OK             MANAGEMENT"),
    (telegram(encode_call("BR01"), delay=-1, phase=Phase.OFFLINE),
     "       1234.567  BR01 all        -> -                 OK             OFFLINE"),
    (telegram(encode_call("RID1", 31 + 32), ErrorClass.LENGTH, ok=0, t=0, phase=Phase.DETECTION),
     "          0.000  RID1 31B        -> -         21.500  LENGTH         DETECTION     bad request"),
]


@pytest.mark.parametrize("record, line", LINES, ids=[line.split("  ")[1] or line[:30] for _, line in LINES])
def test_log_lines(record, line):
    """PL-003: one line per call: bus time in us, call, address with A/B, data, answer, delay, class, phase, remark."""
    assert to_line(to_record(record, lambda number: number in (17, 31))) == line


def test_log_columns_stand_below_their_names():
    """PL-003: the header names the columns of the lines."""
    line = to_line(to_record(LINES[1][0], lambda number: number == 17))
    for name, text in (("call", "DEXG"), ("addr", "17A"), ("data", "101"), ("class", "PARITY"), ("phase", "DATA_EXCH"),
                       ("remark", "repeated")):
        assert HEADER.index(name) == line.index(text)


def test_calls_decode_to_what_they_encode():
    """CA-003, CA-004, PL-003: every word with a name is the word of that name; R1 carries ~Sel; WID1 0 is not DELA."""
    named = {}
    for call in range(2048):
        for extended in (False, True):
            out = decode_call(call, lambda number: extended)
            if out.name != "?":
                assert encode_call(out.name, out.index or 0, out.data or 0, extended) == call, (call, out)
                named.setdefault(out.name, set()).add(call)
    assert named.keys() == set(CALLS) and 1 << 10 not in named["DELA"]
    # all numbers with both selects; BR01 and PRGM have words of their own
    assert {name: len(named[name]) for name in ("R1", "RDST", "RDIO", "DELA", "WID1")} == {
        "R1": 64, "RDST": 64, "RDIO": 64, "DELA": 62, "WID1": 16}
    assert [decode_call(encode_call("R1", index)) for index in (0, 5, 37)] == [
        Decoded("R1", 0, None), Decoded("R1", 5, None), Decoded("R1", 37, None)]


@given(st.integers(0, 2047), st.sampled_from(ErrorClass), st.integers(0, 15), st.booleans())
def test_every_call_has_its_record(call, error, data, extended):
    """PL-003: for all calls the record has the documented fields and types, and they agree with the decoder."""
    record = to_record(telegram(call, error, data), lambda number: extended)
    documented = dict(re.findall(r"^\| `(\w+)` \| ([^|]+?) \|", (ROOT / "docs/telegram_log.md").read_text(), re.M))
    assert list(record) == list(documented)
    kinds = {"int": int, "text": str, "bool": bool, "null": type(None)}
    for name, text in documented.items():
        assert type(record[name]) in [kinds[word] for word in text.split(" or ")], name
    decoded = decode_call(call, lambda number: extended)
    assert (record["call"], record["index"], record["word"]) == (decoded.name, decoded.index, call)
    assert record["answer"] == (f"{data:04b}" if error == ErrorClass.OK else None)
    if record["data"] is not None:
        assert int(record["data"], 2) == decoded.data
        assert encode_call(decoded.name, decoded.index, decoded.data, extended) == call
    assert json.loads(json.dumps(record)) == record


def test_both_logs_have_every_telegram(tmp_path):
    """PL-003: both files have one line per telegram, also when they come in pieces; or only counts."""
    telegrams = [record for record, _ in LINES]
    with TelegramLog(tmp_path, lambda number: False) as log:
        assert log.add(telegrams[:3]) == 3 and log.add([]) == 0 and log.add(telegrams[3:]) == 7
    text = (tmp_path / "telegrams.log").read_text().splitlines()
    records = [json.loads(line) for line in (tmp_path / "telegrams.jsonl").read_text().splitlines()]
    assert text[0] + "\n" == HEADER and text[1:] == [to_line(record) for record in records] and len(records) == 10
    with TelegramLog(None, lambda number: False) as quiet:
        quiet.add(telegrams)
    assert quiet.counts == log.counts
    assert (log.counts.total.requests, log.counts.total.failed, log.counts.total.repeated) == (10, 3, 1)
    assert log.counts.broken_requests == 1 and log.counts.by_class["OK"] == 7


def test_numbers_outside_the_map_are_shown():
    """PL-003: a class or phase number that the register map does not know is not hidden."""
    record = to_record(telegram(0, error=12, phase=7))
    assert record["class"] == "UNKNOWN_12" and record["phase"] == "UNKNOWN_7" and record["answer"] is None


# ---------------------------------------------------------------- command line
@pytest.fixture
def asi(tmp_path, monkeypatch):
    """asi(*arguments, bench=...) -> (exit code, standard output, standard error); out is tmp_path / 'run'."""
    def call(*arguments, bench=None):
        made = []

        def open_bench(firmware, waves, seed):
            if isinstance(bench, Exception):
                raise bench
            made.append((firmware, waves, seed))
            if waves:
                Path(waves).write_bytes(b"$date")
            call.bench = bench or FakeBench()
            return call.bench
        monkeypatch.setattr(cli, "open_bench", open_bench)
        out = ["--out", str(tmp_path / "run")] if arguments[:1] == ("run",) else []
        result = CliRunner().invoke(cli.app, [*map(str, arguments), *out])
        assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
        call.made = made
        return result.exit_code, result.stdout, result.stderr
    return call


def written(tmp_path, text=SMALL):
    path = tmp_path / "p.toml"
    path.write_text(text)
    return path


def test_exit_0(asi, tmp_path):
    """PL-002, PL-004: a plant that meets its expectations ends with 0, quiet lines, report and logs."""
    code, out, err = asi("run", PACKAGING, "--quick")
    assert code == 0 and err == ""
    assert "expect at 520.000 ms: met" in out and "\x1b" not in out
    assert [line for line in out.splitlines() if re.fullmatch(r"\d+ of 520 ms  \d+ cycles  [\d.]+ x real time", line)]
    assert sorted(p.name for p in (tmp_path / "run").iterdir()) == [
        "report.html", "report.json", "telegrams.jsonl", "telegrams.log"]
    assert asi.made == [(Path("build/firmware/asi_test.hex"), None, 7)] and asi.bench.closed


def test_exit_1(asi, tmp_path):
    """PL-004: an expectation that is not met ends with 1 and one clear line per difference."""
    path = written(tmp_path, SMALL.replace('["1", "2B"]', '["1", "3"]'))
    code, out, err = asi("run", path, "--quick")
    assert code == 1
    assert err.splitlines() == [f"not met: expect at 120.000 ms: LAS {text}" for text in ("missing: 3", "too many: 2B")]


@pytest.mark.parametrize("arguments", [("run", "gone.toml"), ("run", PACKAGING, "--time", "5 parsecs"), ("run",),
                                       ("run", PACKAGING, "--time", "0s"), ("run", PACKAGING, "--seed", "-1"),
                                       ("fly", PACKAGING), ("check", PACKAGING, "gone.toml")])
def test_exit_2(asi, arguments):
    """PL-001: bad input ends with 2 and runs nothing."""
    code, out, err = asi(*arguments)
    assert code == 2 and err and asi.made == []


def test_bad_plant_lines(asi, tmp_path):
    """PL-001: each fault of a plant is one line on standard error: file, key, reason."""
    path = written(tmp_path, SMALL.replace('"2B"\n', '"42"\n').replace('duration = "1100ms"', ""))
    code, out, err = asi("run", path)
    assert (code, out) == (2, "")
    assert err.splitlines() == [
        f"{path}: duration: missing",
        f"{path}: slave #2 (Two).address: '42' is not an AS-i address (0, 1..31, 1A..31A, 1B..31B)"]


def test_exit_3(asi, tmp_path):
    """PL-002: a simulation that cannot start or fails ends with 3 and the reason."""
    assert asi("run", PACKAGING, bench=BenchError("no library"))[::2] == (3, "simulation: no library\n")
    code, out, err = asi("run", PACKAGING, "--quick", bench=FakeBench(boots=False))
    assert code == 3 and "simulation: the firmware did not start" in err
    assert json.loads((tmp_path / "run/report.json").read_text())["result"] == "failed"


def test_ctrl_c(asi, tmp_path):
    """PL-002: Ctrl-C ends the run with the report so far, complete logs and code 130."""
    code, out, err = asi("run", PACKAGING, "--quick", bench=FakeBench(break_at_ns=100_000_000))
    assert code == 130 and "INTERRUPTED" in out and asi.bench.closed
    result = json.loads((tmp_path / "run/report.json").read_text())
    assert result["result"] == "interrupted" and result["checks"][0]["result"] == "not reached"
    assert 0 < result["run"]["bus_time_ns"] <= 100_000_000 < result["run"]["wanted_ns"]
    lines = (tmp_path / "run/telegrams.jsonl").read_text().splitlines()
    assert len(lines) == result["telegrams"]["requests"] > 0 and all(map(json.loads, lines))


def test_options(asi, tmp_path):
    """PL-002: time, seed, waves, firmware and settle time reach the run; without logs there are none."""
    code, out, _ = asi("run", written(tmp_path), "--time", "60ms", "--seed", "99", "--waves", "--no-log",
                       "--firmware", "x.hex", "--settle", "20ms")
    assert code == 0 and asi.made == [(Path("x.hex"), tmp_path / "run/waves.part", 99)]
    assert sorted(p.name for p in (tmp_path / "run").iterdir()) == ["report.html", "report.json", "waves.vcd"]
    result = json.loads((tmp_path / "run/report.json").read_text())
    assert result["plant"]["seed"] == 99 and result["run"]["wanted_ns"] == 60_000_000
    assert result["checks"][0]["result"] == "not reached"
    slow = asi("run", written(tmp_path), "--time", "500ms", "--no-quick")[1]
    assert "note: the line stays quiet until 1000.000 ms" in slow
    assert "20 ms instead of 1 s" in asi("run", written(tmp_path), "--time", "500ms")[1]


def test_check_command(asi, tmp_path):
    """PL-001: `check` tells good plants from bad ones without running them."""
    code, out, err = asi("check", PACKAGING, written(tmp_path))
    assert code == 0 and asi.made == [] and len(out.splitlines()) == 2
    assert out.splitlines()[0] == f"{PACKAGING}: Packaging machine: 15 slaves, 14 projected, 1500.000 ms"


def test_wave_files_get_their_suffix(tmp_path):
    """PL-002: the wave file is named after what is in it."""
    for content, suffix in ((b"$date today $end", ".vcd"), (b"\x00\x00\x00", ".fst")):
        path = tmp_path / "waves.part"
        path.write_bytes(content)
        assert name_waves(path) == tmp_path / f"waves{suffix}" and not path.exists()


def test_long_runs_do_not_grow(tmp_path):
    """PL-003: the runner asks for telegrams in pieces that do not depend on the length of the run."""
    bench, sizes = FakeBench(), []
    drain = bench.telegrams

    def telegrams():
        log = drain()
        sizes.append(len(log))
        return log
    bench.telegrams = telegrams
    Runner(small(), bench, tmp_path, until_ns=3_000_000_000, log=False).run()
    assert max(sizes) <= 80 and sum(sizes) > 15_000  # 10 ms of line are 65 telegrams


def test_one_run_per_folder(asi, tmp_path):
    """PL-002: a second run in the same folder is refused in one line, and waves of an earlier run do not stay."""
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "waves.fst").write_text("old")
    other = os.open(folder, os.O_RDONLY)
    fcntl.flock(other, fcntl.LOCK_EX)
    code, _, err = asi("run", written(tmp_path), "--time", "60ms")
    assert code == 2 and err.count("\n") == 1 and "another run" in err
    os.close(other)
    assert asi("run", written(tmp_path), "--time", "60ms")[0] == 0
    assert not (folder / "waves.fst").exists()
