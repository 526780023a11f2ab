# SPDX-License-Identifier: Apache-2.0
"""The report of a run: one plain dict (docs/report.md), written as JSON and shown on the terminal from that dict."""
import json
from pathlib import Path
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from rich.console import Console, Group
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from asi.combined import cyclic_words
from asi.plant import Check, Codes, Function
from asi.regmap import Phase
from asi.status import Status, name_of
from asi.telegram import line_order
from asi.telegram_log import Counts, Tally
from asi.window import INDICES, Event, WindowError

if TYPE_CHECKING:
    from asi.run import Runner

SCHEMA = "asi-report 1"
LISTS = ("lds", "las", "lps", "lpf")
EVENTS_SHOWN = 20            # of the event log, on the terminal


def check_result(check: Check, differences: list[str] | None, final: bool) -> dict[str, Any]:
    """One entry of report["checks"]; differences None: the run did not get there."""
    result = "not reached" if differences is None else "not met" if differences else "met"
    return {"name": "expect" if final else "check", "at_ns": check.time_ns, "result": result,
            "differences": differences or []}


def function_result(function: Function, differences: list[str] | None) -> dict[str, Any]:
    """The same of a function; None: it was not answered before the run ended early."""
    result = "not reached" if differences is None else "not met" if differences else "met"
    return {"name": "function", "at_ns": function.time_ns, "result": result, "differences": differences or []}


def event_text(event: Event, name_of_index: Callable[[int], str]) -> str:
    """'addressed 3: from 0: OK'."""
    who = f" {name_of_index(event.index)}" if event.about_slave else ""
    detail = event.detail(name_of_index)
    return f"{event.name.replace('_', ' ')}{who}{': ' if detail else ''}{detail}"


def build(runner: "Runner", counts: Counts, *, wall_s: float, interrupted: bool, error: str | None) -> dict[str, Any]:
    """Read the chip once more and put everything together."""
    plant, bench, window = runner.plant, runner.bench, runner.window
    bus_ns = bench.time()  # before the reads below, which take bus time themselves
    state, outputs, detected = window.state(), window.outputs(), window.detected_codes()
    inputs, analog, history = None, [], None
    try:
        inputs = window.inputs()
        analog = _analog(runner, state, detected)
        history = window.history()
    except WindowError as fault:
        error = error or str(fault)
    storage, safe = window.storage(), window.safety()
    stats, checks = bench.stats(), runner.results()
    failed = any(check["result"] == "not met" for check in checks)
    result = ("failed" if error else "interrupted" if interrupted else "expectation not met" if failed else "ok")
    lists = {name: sorted(getattr(state, name), key=line_order) for name in LISTS}
    timed = stats.cycle_periods > 0
    return {
        "schema": SCHEMA,
        "result": result,
        "error": error,
        "plant": {"file": plant.path, "name": plant.name, "description": plant.description, "seed": plant.seed},
        "run": {
            "bus_time_ns": bus_ns, "wanted_ns": runner.until_ns, "clk_hz": bench.clk_hz, "clocks": stats.clocks,
            "wall_s": round(wall_s, 3), "real_time_ratio": round(bus_ns / 1e9 / wall_s, 4) if wall_s > 0 else None,
            "firmware": runner.version,
        },
        "state": {
            "phase": state.phase.name, "flags": state.flags,
            **{name: [plant.name_of(index) for index in indices] for name, indices in lists.items()},
        },
        "slaves": _slaves(plant, state, inputs, outputs, detected, counts),
        "cycles": {
            "count": stats.cycles, "min_ns": stats.cycle_min_ns if timed else None,
            "mean_ns": stats.cycle_sum_ns // stats.cycle_periods if timed else None,
            "max_ns": stats.cycle_max_ns if timed else None,
        },
        "telegrams": {
            **_tally(counts.total), "bad_requests": counts.broken_requests,
            "by_call": dict(sorted(counts.by_call.items())), "by_class": dict(sorted(counts.by_class.items())),
        },
        "master": {name: state.counters[name] for name in ("sent", "repeated", "failed", "cycles")},
        "core": {"interrupts": stats.irq_count, "longest_busy_clocks": stats.irq_clocks_max,
                 "longest_busy_in_cycle_clocks": stats.irq_clocks_max_cycle},
        "start": {
            "first_telegram_ns": counts.first_ns, "first_cycle_ns": counts.first_cycle_ns,
            "start_up_ns": counts.first_cycle_ns - counts.first_ns if counts.first_cycle_ns is not None else None,
        },
        "phases_ns": {phase.name: stats.phase_ns[phase] for phase in Phase},
        "checks": checks,
        "analog": analog,
        "safety": [{"address": plant.name_of(slave.index), "name": slave.name, "f_in1": slave.index in safe[0],
                    "f_in2": slave.index in safe[1]} for slave in plant.slaves if slave.safety and slave.index],
        "functions": [_function(function, runner.answers.get(k)) for k, function in enumerate(plant.functions)],
        "events": [{"t_us": event.time_us, "event": event.name, "data": event.data,
                    "address": plant.name_of(event.index) if event.about_slave else None,
                    "text": event_text(event, plant.name_of)} for event in runner.events],
        "events_lost": runner.events_lost, "events_left_out": runner.events_left_out,
        "history": {
            "changed": _names(plant, history and history.changed), "changed_us": history and history.changed_us,
            "offline_causes": list(history.causes) if history else [],
            "last_offline_cause": history and history.last_cause, "offline_us": history and history.offline_us,
            "suspects": _names(plant, history and history.suspects),
        },
        "storage": vars(storage),
    }


def _names(plant, indices: frozenset[int] | None) -> list[str]:
    return [plant.name_of(index) for index in sorted(indices or (), key=line_order)]


def _function(function: Function, done: tuple | None) -> dict[str, Any]:
    answer, asked_ns, done_ns = done or (None, None, None)
    return {"function": function.text, "at_ns": function.time_ns, "asked_ns": asked_ns, "answered_ns": done_ns,
            "result": answer and answer.name, "expected": name_of(Status, function.status),
            "data": answer and answer.data, "string": answer and answer.string.hex(" ")}


def _analog(runner: "Runner", state, detected: dict[int, Codes]) -> list[dict[str, Any]]:
    """One row per 16-bit value that the codes of a slave promise: the plant's, or those that were detected."""
    plant, window, rows = runner.plant, runner.window, []
    position = {slave.index: k for k, slave in reversed(list(enumerate(plant.slaves)))}
    for index in sorted({*position, *detected} - {0}, key=line_order):
        slave = plant.slaves[position[index]] if index in position else None
        kind = (slave.codes if slave else detected[index]).kind
        inputs, outputs = kind.inputs, kind.outputs
        if kind.messages and (words := cyclic_words(slave.strings.get(0) if slave else None)):
            inputs, outputs = min(inputs, words[0]), min(outputs, words[1])
        received = runner.receives(position[index]) if slave else []
        transfer = window.ctt_state(index) if inputs or outputs else None
        for direction, count in (("in", inputs), ("out", outputs)):
            for channel in range(count):
                one = window.analog_input(index, channel) if direction == "in" else None
                rows.append({
                    "address": plant.name_of(index), "index": index, "name": slave and slave.name, "kind": kind.name,
                    "direction": direction, "channel": channel + 1,
                    "value": one.value if one else window.analog_output(index, channel),
                    "valid": one and one.valid, "transparent": transfer.transparent, "transfer": transfer.tv,
                    "received": received[channel] if not one and channel < len(received) else None,
                })
    return rows


def _tally(tally: Tally) -> dict[str, int]:
    return {"requests": tally.requests, "repeated": tally.repeated, "failed": tally.failed}


def _line(tally: Tally) -> dict[str, Any]:
    """What the line showed of one address; the names are those of the decoder's statistics."""
    delay = tally.delay.as_dict()
    return {"answers": tally.answers, "by_class": dict(sorted(tally.classes.items())),
            "delay_min_ns": delay["min_ns"], "delay_mean_ns": delay["mean_ns"], "delay_max_ns": delay["max_ns"],
            "deviation_ns": tally.deviation_ns}


def _slaves(plant, state, inputs, outputs, detected, counts) -> list[dict[str, Any]]:
    """One row per address that the plant, the projection or the master knows."""
    known = {slave.index: slave for slave in reversed(plant.slaves)}
    rows = []
    for index in sorted({*known, *plant.host.pcd, *state.lds, *state.las, *state.lps}, key=line_order):
        slave, projected = known.get(index), plant.host.pcd.get(index)
        codes = slave.codes if slave else projected
        rows.append({
            "address": plant.name_of(index), "index": index,
            "name": " / ".join(s.name for s in plant.slaves if s.index == index) or plant.host.names.get(index),
            "profile": codes.profile if codes else None,
            "detected": detected[index].profile if index in detected else None,
            **{name: index in getattr(state, name) for name in LISTS},
            "inputs": None if inputs is None or not index else f"{inputs[index]:04b}",
            "outputs": None if not index else f"{outputs[index]:04b}",
            **_tally(tally := counts.by_index.get(index, Tally())), **_line(tally),
        })
    rest = Tally()
    for index in INDICES:
        if index in counts.by_index and all(row["index"] != index for row in rows):
            rest.add(counts.by_index[index])
    rows.append({"address": None, "index": None, "name": None, "profile": None, "detected": None,
                 **{name: False for name in LISTS}, "inputs": None, "outputs": None, **_tally(rest), **_line(rest)})
    return rows


def write(report: dict[str, Any], path: Path) -> None:
    path.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")


# ---------------------------------------------------------------- the terminal
def us(time_ns: int | None) -> str:
    """4928000 -> '4928.000 us': for what is compared to the clock."""
    return "-" if time_ns is None else f"{time_ns / 1e3:.3f} us"


def ms(time_ns: int | None) -> str:
    """1500003000 -> '1500.003 ms'."""
    return "-" if time_ns is None else f"{time_ns / 1e6:.3f} ms"


def _ranges(addresses: list[str]) -> str:
    """['1', '2', '3', '5A'] -> '1-3 5A'; only plain runs of the same kind are joined."""
    out: list[list[str]] = []
    for address in addresses:
        last = out[-1][-1] if out else ""
        if last and address.strip("AB").isdecimal() and address[-1:].isalpha() == last[-1:].isalpha() \
                and (not address[-1:].isalpha() or address[-1] == last[-1]) \
                and int(address.strip("AB")) == int(last.strip("AB")) + 1:
            out[-1].append(address)
        else:
            out.append([address])
    return " ".join(" ".join(run) if len(run) < 3 else f"{run[0]}-{run[-1]}" for run in out) or "none"


def _list_text(addresses: list[str]) -> str:
    """A network of A/B pairs reads better as two runs."""
    groups = [[a for a in addresses if not a.endswith(("A", "B"))], [a for a in addresses if a.endswith("A")],
              [a for a in addresses if a.endswith("B")]]
    return " ".join(_ranges(group) for group in groups if group) or "none"


def _pairs(rows: list[tuple[str, Any]]) -> Table:
    table = Table.grid(padding=(0, 2))
    table.add_column(style="dim")
    table.add_column()
    for name, value in rows:
        table.add_row(name, value if isinstance(value, Text) else Text(str(value)))
    return table


def _flags(flags: dict[str, bool]) -> Text:
    good = {"config_ok": True, "periphery_ok": True, "normal_operation_active": True, "apf": False, "lds0": False}
    text = Text()
    for name, on in flags.items():
        bad = name in good and good[name] != on
        text.append(f"{name}={int(on)}", style="bold red" if bad else "bold green" if on else "dim")
        text.append("  ")
    return text


def _slave_table(rows: list[dict[str, Any]]) -> Table:
    table = Table(box=None, header_style="bold", padding=(0, 1))
    for name, justify in (("addr", "right"), ("name", "left"), ("profile", "left"), ("lists", "left"),
                          ("in", "left"), ("out", "left"), ("requests", "right"), ("failed", "right"),
                          ("repeated", "right")):
        table.add_column(name, justify=justify, no_wrap=name != "name")
    for row in rows:
        if row["address"] is None and not row["requests"]:
            continue
        profile = row["profile"] or row["detected"] or ""
        if row["detected"] and row["detected"] != profile:
            profile += f" (is {row['detected']})"
        lists = " ".join(name.upper() for name in LISTS if row[name])
        bad = row["lps"] != row["las"] or (row["index"] == 0 and row["lds"])
        name = row["name"] or ("-" if row["address"] else "addresses without a slave")
        table.add_row(row["address"] or "other", Text(name), profile, Text(lists, style="yellow" if bad else "green"),
                      row["inputs"] or "", row["outputs"] or "",
                      *(str(row[key]) for key in ("requests", "failed", "repeated")))
    return table


def word(value: int | None) -> str:
    """0xFFFE -> 'FFFE -2'."""
    return "-" if value is None else f"{value:04X} {value - (value >> 15 << 16)}"


def _analog_table(rows: list[dict[str, Any]]) -> Table:
    table = Table(box=None, header_style="bold", padding=(0, 1))
    for name in ("addr", "16-bit values", "kind", "", "channel", "value", "mark", "received"):
        table.add_column(name, justify="right" if name in ("addr", "value", "received") else "left")
    for row in rows:
        mark = ("" if row["valid"] is None else "valid" if row["valid"] else "invalid") + \
            ("" if row["transfer"] else " no transfer")
        table.add_row(row["address"], Text(row["name"] or "-"), row["kind"], row["direction"], str(row["channel"]),
                      word(row["value"]), Text(mark.strip(), style="green" if mark == "valid" else "yellow"),
                      "" if row["direction"] == "in" else word(row["received"]))
    return table


def _functions(rows: list[dict[str, Any]]) -> Text:
    text = Text()
    for number, row in enumerate(rows):
        text.append(f"{chr(10) if number else ''}{row['function']} at {ms(row['at_ns'])}: ")
        text.append(row["result"] or "no answer", style="green" if row["result"] == row["expected"] else "bold red")
        if row["answered_ns"] is not None:
            text.append(f" after {ms(row['answered_ns'] - row['asked_ns'])}")
        if row["string"]:
            text.append(f"\n  {row['string']}")
    return text


def _events(report: dict[str, Any]) -> Text:
    rows, text = report["events"], Text()
    if hidden := max(0, len(rows) - EVENTS_SHOWN):
        text.append(f"... {hidden} before these\n", style="dim")
    text.append("\n".join(f"{row['t_us'] / 1e3:.3f} ms  {row['text']}" for row in rows[hidden:]) or "none")
    for key, what in (("events_left_out", "later ones left out"), ("events_lost", "lost: the reader was too slow")):
        if report[key]:
            text.append(f"\n{report[key]} {what}", style="yellow")
    return text


def history_lines(history: dict[str, Any]) -> list[str]:
    """History in words, for the terminal and the page."""
    out = []
    if history["changed_us"] is not None:
        out.append(f"Config_OK was last broken at {history['changed_us'] / 1e3:.3f} ms "
                   f"by {' '.join(history['changed'])}")
    if history["last_offline_cause"]:
        out.append(f"offline because of {', '.join(history['offline_causes'])}; last {history['last_offline_cause']} "
                   f"at {history['offline_us'] / 1e3:.3f} ms")
    if history["suspects"]:
        out.append(f"suspected duplicate addresses: {' '.join(history['suspects'])}")
    return out or ["nothing to tell"]


STORAGE_AT_START = {"EMPTY": "flash was empty at the start", "LOADED": "loaded from flash at the start",
                    "CORRUPT": "flash was CORRUPT at the start, defaults in use"}


def storage_line(storage: dict[str, Any]) -> str:
    """In words, for people: a board without flash is a plain state, no failure."""
    if storage["state"] == "NO_FLASH":
        return "no flash: nothing is kept over power-off"
    now = ("storing" if storage["busy"] else "storing FAILED: the data in use is not in flash" if storage["failed"] else
           f"the data in use is stored, set {storage['sequence']}" if storage["saved"] else "nothing stored since")
    return f"{STORAGE_AT_START.get(storage['state'], storage['state'])}; {now}"


def _checks(checks: list[dict[str, Any]]) -> Text:
    text = Text()
    styles = {"met": "green", "not met": "bold red", "not reached": "yellow"}
    for number, check in enumerate(checks):
        text.append(f"{chr(10) if number else ''}{check['name']} at {ms(check['at_ns'])}: ")
        text.append(check["result"], style=styles[check["result"]])
        for difference in check["differences"]:
            text.append(f"\n  {difference}")
    return text


def render(report: dict[str, Any]) -> Group:
    """The report for a person; uses nothing but the dict."""
    run, state, cycles, telegrams = report["run"], report["state"], report["cycles"], report["telegrams"]
    style = {"ok": "green", "interrupted": "yellow"}.get(report["result"], "red")
    ratio = "-" if run["real_time_ratio"] is None else f"{run['real_time_ratio']:.2f} x real time"
    title = Text.assemble((report["plant"]["name"], "bold"), "  ", (report["result"].upper(), f"bold {style}"))
    if unreached := sum(check["result"] == "not reached" for check in report["checks"]):
        title.append(f"  {unreached} of {len(report['checks'])} checks not reached", style="yellow")
    head = _pairs([
        ("bus time", f"{ms(run['bus_time_ns'])} in {run['wall_s']:.1f} s ({ratio}), "
                     f"{run['clocks']} clocks at {run['clk_hz'] / 1e6:g} MHz"),
        ("firmware", run["firmware"] or "not started"),
        ("phase", state["phase"]),
        ("flags", _flags(state["flags"])),
        *[(name.upper(), f"{len(state[name])}: {_list_text(state[name])}" if state[name] else "none")
          for name in LISTS],
    ])
    phases = ", ".join(f"{name} {ms(time)}" for name, time in report["phases_ns"].items() if time)
    start = report["start"]
    foot = _pairs([
        ("cycle", f"min {us(cycles['min_ns'])}, mean {us(cycles['mean_ns'])}, max {us(cycles['max_ns'])}; "
                  f"{cycles['count']} cycles"),
        ("telegrams", f"{telegrams['requests']} requests, {telegrams['repeated']} repeated, "
                      f"{telegrams['failed']} without a valid answer, {telegrams['bad_requests']} bad requests"),
        ("calls", ", ".join(f"{name} {count}" for name, count in telegrams["by_call"].items()) or "none"),
        ("answers", ", ".join(f"{name} {count}" for name, count in telegrams["by_class"].items()) or "none"),
        ("master counts", ", ".join(f"{name} {count}" for name, count in report["master"].items())),
        ("core", f"{report['core']['interrupts']} times awake, longest {report['core']['longest_busy_clocks']} clocks, "
                 f"{report['core']['longest_busy_in_cycle_clocks']} while cycles run"),
        ("start-up", f"first telegram at {ms(start['first_telegram_ns'])}, first cycle at "
                     f"{ms(start['first_cycle_ns'])}, {ms(start['start_up_ns'])} from one to the other"),
        ("phases", phases or "none"),
        *([("functions", _functions(report["functions"]))] if report["functions"] else []),
        *([("safety view", ", ".join(f"{row['address']} F-IN1={int(row['f_in1'])} F-IN2={int(row['f_in2'])}"
                                     for row in report["safety"]))] if report["safety"] else []),
        ("event log", _events(report)),
        ("history", "\n".join(history_lines(report["history"]))),
        ("storage", storage_line(report["storage"])),
        ("expected", _checks(report["checks"])),
    ])
    parts: list[Any] = [Panel(head, title=title, title_align="left", border_style=style),
                        _slave_table(report["slaves"]), Text("")]
    if report["analog"]:
        parts += [_analog_table(report["analog"]), Text("")]
    parts.append(foot)
    if report["error"]:
        parts.append(Text(f"error: {report['error']}", style="bold red"))
    return Group(*parts)


def show(report: dict[str, Any], console: Console) -> None:
    console.print(render(report))
