# SPDX-License-Identifier: Apache-2.0
"""The report as one HTML file that needs nothing else: page.html, page.css, page.js of asi/html, and the data in them.

Numbers, tables and diagrams are made here, so they are there without a script and on paper; the script adds the time
line, sorting and jumps. Every text is untrusted (plant names, file names) and escaped; a content security policy allows
our one script and our one style sheet and no network. A number that comes from report.json carries its path in
data-path (or row and key in data-index and data-key) and its exact value in data-v.
"""
import base64
import hashlib
import json
import math
from collections.abc import Callable, Sequence
from html import escape
from importlib import resources
from pathlib import Path
from string import Template
from typing import Any, NamedTuple

from asi import eye
from asi.checks import WIN_EARLY_NS, WIN_LATE_NS
from asi.regmap import ErrorClass
from asi.report import history_lines, storage_line
from asi.telegram import BIT_NS, HALF_BIT_NS
from asi.trace import Trace

SCHEMA = "asi-html 1"
LISTS = ("lds", "las", "lps", "lpf")
_CLASSES = [c.name for c in ErrorClass if c]
_BARS = 60
_GOOD_FLAGS = {"config_ok": True, "periphery_ok": True, "normal_operation_active": True, "apf": False, "lds0": False}
_EVENT_ROWS = 500


# ---------------------------------------------------------------- small pieces
def _number(value: float | int | None, digits: int = 0) -> str:
    """13012 -> '13 012' with narrow spaces that do not break; None: a dash."""
    if value is None:
        return "–"
    return f"{value:,.{digits}f}".replace(",", "\u202f").replace("-", "\u2212")


def _us(time_ns: float | None, digits: int = 3) -> str:
    return _number(None if time_ns is None else time_ns / 1e3, digits)


def _ms(time_ns: float | None) -> str:
    return _number(None if time_ns is None else time_ns / 1e6, 3)


def _at(report: dict[str, Any], path: str) -> Any:
    for key in path.split("."):
        report = report[int(key) if isinstance(report, list) else key]
    return report


def _value(report: dict[str, Any], path: str, show: Callable[[Any], str] = _number) -> str:
    """One number of the report, shown and exact."""
    value = _at(report, path)
    return (f'<span class="n" data-path="{escape(path)}" data-v="{escape(json.dumps(value))}">'
            f'{escape(show(value))}</span>')


def _tile(name: str, content: str, small: str = "") -> str:
    return f'<div class="tile"><dt>{escape(name)}</dt><dd>{content}</dd>{f"<p>{small}</p>" if small else ""}</div>'


# ---------------------------------------------------------------- slaves
class Column(NamedTuple):
    """One column of the slave table. value(row) -> what sorts; show(value) -> text."""
    key: str
    title: str
    hint: str
    value: Callable[[dict[str, Any]], Any]
    show: Callable[[Any], str] = lambda value: "" if value is None else str(value)
    numeric: bool = True


def _key(key: str) -> Callable[[dict[str, Any]], Any]:
    return lambda row: row.get(key)


def _columns(rows: Sequence[dict[str, Any]], trace: Trace, of_run: bool) -> list[Column]:
    """A new counter of the rows needs one line here."""
    text = dict(numeric=False)
    classes = [name for name in _CLASSES if any(row["by_class"].get(name) for row in rows)]

    def last(row: dict[str, Any]) -> str:
        data, answer = trace.last.get(row["index"], (None, None))
        return "" if answer is None else f"{data or ''} → {answer}"

    run_only = [
        Column("name", "Name", "of the plant", _key("name"), **text),
        Column("profile", "Profile", "of the plant or the projection; in brackets what the master read instead",
               lambda r: (r["profile"] or r["detected"] or "") +
               (f" ({r['detected']})" if r["detected"] and r["profile"] not in (None, r["detected"]) else ""), **text),
        Column("lists", "Lists", "LDS, LAS, LPS, LPF at the end",
               lambda r: " ".join(name.upper() for name in LISTS if r[name]), **text),
        Column("inputs", "In", "input image at the end", _key("inputs"), **text),
        Column("outputs", "Out", "output image at the end", _key("outputs"), **text),
    ]
    return [
        *(run_only if of_run else []),
        Column("last", "Last data", "of the last answered DEXG, as on the line: request → answer", last, **text),
        Column("requests", "Requests", "on the line, repetitions included", _key("requests"), _number),
        Column("answers", "Answers", "good ones", _key("answers"), _number),
        *([Column("failed", "Failed", "requests without a valid answer", _key("failed"), _number)] if of_run else []),
        Column("repeated", "Repeated", "immediate repetitions", _key("repeated"), _number),
        *(Column(f"by_class.{name}", name.replace("_", " ").capitalize(), f"requests whose answer was of class {name}",
                 lambda r, name=name: r["by_class"].get(name, 0), _number) for name in classes),
        Column("delay_min_ns", "Delay min µs", "last pulse of the request to first pulse of a good answer",
               _key("delay_min_ns"), _us),
        Column("delay_mean_ns", "mean", "mean delay, µs", _key("delay_mean_ns"), _us),
        Column("delay_max_ns", "max", "largest delay, µs", _key("delay_max_ns"), _us),
        Column("deviation_ns", "Deviation µs", "of the pulses of good answers, the farthest from the 3 µs grid",
               _key("deviation_ns"), _us),
    ]


def _slaves(rows: Sequence[dict[str, Any]], trace: Trace, of_run: bool) -> str:
    shown = [row for row in rows if row["index"] is not None or row["requests"]]
    columns = _columns(shown, trace, of_run)
    head = ('<th scope="col" data-key="address" aria-sort="ascending"><button type="button">Address</button></th>'
            + "".join(f'<th scope="col" data-key="{escape(c.key)}" class="{"num" if c.numeric else ""}" '
                      f'title="{escape(c.hint)}"><button type="button">{escape(c.title)}</button></th>'
                      for c in columns))
    body = []
    for order, row in enumerate(shown):
        index = "" if row["index"] is None else row["index"]
        cells = [f'<th scope="row" data-v="{order}">' + (
            f'<button type="button" class="find" data-find="{index}" title="show on the time line">'
            f'{escape(row["address"])}</button>' if row["address"] else "other") + "</th>"]
        for c in columns:
            value = c.value(row)
            bad = row["address"] is not None and bool(value) and c.key.startswith(("failed", "by_class."))
            if c.key == "lists":
                bad = row["lps"] != row["las"] or (row["index"] == 0 and row["lds"])
            exact = json.dumps(value) if c.numeric else str(value or "")
            cells.append(f'<td data-key="{escape(c.key)}" data-v="{escape(exact)}" '
                         f'class="{"num " * c.numeric}{"bad" * bad}">{escape(c.show(value))}</td>')
        body.append(f'<tr data-index="{index}">{"".join(cells)}</tr>')
    return (f'<div class="scroll" tabindex="0" role="region" aria-label="Slaves"><table id="slaves" class="sort">'
            f'<thead><tr>{head}</tr></thead><tbody>{"".join(body)}</tbody></table></div>')


# ---------------------------------------------------------------- diagrams
def _histogram(per_us: dict[int, int]) -> str:
    """Cycle times: bars of a whole number of us."""
    if not per_us:
        return '<p class="none">No complete cycle was seen.</p>'
    low, high = min(per_us), max(per_us)
    step = max(1, math.ceil((high - low + 1) / _BARS))
    bins: dict[int, int] = {}
    for us, count in per_us.items():
        bins[(us - low) // step] = bins.get((us - low) // step, 0) + count
    number, top = (high - low) // step + 1, max(bins.values())
    width, height, left, bottom = 560, 200, 56, 30
    slot = min(width / number, 40)
    bars = []
    for k, count in sorted(bins.items()):
        tall = max(2.0, (height - 14) * count / top)
        first = low + k * step
        text = f"{first} µs" if step == 1 else f"{first} to {first + step - 1} µs"
        bars.append(f'<rect class="bar" x="{left + k * slot:.1f}" y="{height - tall:.1f}" '
                    f'width="{max(1, slot - 1):.1f}" '
                    f'height="{tall:.1f}" data-us="{first}" data-count="{count}">'
                    f'<title>{text}: {_number(count)} cycles</title></rect>')
    ticks = sorted({0, number // 2, number - 1})
    labels = "".join(f'<text x="{left + (k + .5) * slot:.1f}" y="{height + 16}" '
                     f'text-anchor="middle">{low + k * step}</text>'
                     for k in ticks if k in (0, number - 1) and (k == 0 or number * slot > 60) or number * slot > 160)
    total = sum(per_us.values())
    return (f'<svg viewBox="0 0 {width + left + 24} {height + bottom + 8}" role="img" aria-label="Histogram of '
            f'{total} cycle '
            f'times from {low} to {high} microseconds"><line class="axis" x1="{left}" x2="{left + width}" '
            f'y1="{height}" '
            f'y2="{height}"/><text x="{left - 6}" y="22" text-anchor="end">{_number(top)}</text><text x="{left - 6}" '
            f'y="{height}" text-anchor="end">0</text>{"".join(bars)}{labels}<text x="{left + width}" y="{height + 32}" '
            f'text-anchor="end">cycle time, µs; bars of {step} µs</text></svg>')


_EYE_W, _EYE_LEFT = 560, 34


def _eye_x(t_ns: float) -> float:
    return _EYE_LEFT + (t_ns - eye.FROM_NS) * _EYE_W / BIT_NS


def _eye_frame(height: int) -> str:
    """Receiver windows around both grid points, and the time axis."""
    out = []
    for grid in (0, HALF_BIT_NS):
        x0, x1 = _eye_x(grid - WIN_EARLY_NS), _eye_x(grid + WIN_LATE_NS)
        out.append(f'<rect class="window" x="{x0:.1f}" y="0" width="{x1 - x0:.1f}" '
                   f'height="{height}"><title>receiver window '
                   f'−{WIN_EARLY_NS / 1000:g}/+{WIN_LATE_NS / 1000:g} µs</title></rect>'
                   f'<line class="grid" x1="{_eye_x(grid):.1f}" x2="{_eye_x(grid):.1f}" y1="0" y2="{height}"/>')
    for us in range(-1, 6):
        out.append(f'<text x="{_eye_x(us * 1000):.1f}" y="{height + 15}" text-anchor="middle">{us:d}</text>'.replace(
            ">-", ">\u2212"))
    return "".join(out)


def _pulse_eye(starts: list[list[int]], ends: list[list[int]], title: str) -> str:
    """Positive pulses upwards, negative ones downwards; heights logarithmic, so that a single outlier shows."""
    total = sum(map(sum, starts))
    if not total:
        return ""
    half, axis = 90, 100
    top = max(map(max, starts + ends))
    slot = _EYE_W / eye.BINS
    paths = []
    for name, bins in (("ends", ends), ("starts", starts)):
        for sign, counts in enumerate(bins):
            tall = [(-1 if sign else 1) * max(4.0, half * math.log1p(count) / math.log1p(top)) for count in counts]
            path = "".join(f"M{_EYE_LEFT + k * slot:.1f} {axis}v{tall[k]:.1f}h{slot:.1f}V{axis}z"
                           for k, count in enumerate(counts) if count)
            paths.append(f'<path class="{name}" d="{path}"/>')
    outside = sum(count for bins in starts for k, count in enumerate(bins) if not _in_window(k))
    return (f'<figure><figcaption>{escape(title)}: {_number(total)} pulses after the first of each telegram, '
            f'<b class="{"bad" if outside else ""}">{_number(outside)} begin outside the windows</b></figcaption>'
            f'<svg viewBox="0 0 {_EYE_W + _EYE_LEFT + 24} 236" role="img" data-total="{total}" '
            f'data-outside="{outside}" '
            f'aria-label="Eye of pulse starts and ends, {escape(title)}">{_eye_frame(2 * axis)}'
            f'<line class="axis" x1="{_EYE_LEFT}" x2="{_EYE_LEFT + _EYE_W}" y1="{axis}" y2="{axis}"/>{"".join(paths)}'
            f'<text x="{_EYE_LEFT - 8}" y="55" text-anchor="end">+</text><text x="{_EYE_LEFT - 8}" y="153" '
            f'text-anchor="end">−</text><text x="{_EYE_LEFT + _EYE_W}" y="232" text-anchor="end">µs in the bit time; '
            f'height: logarithm of the number</text></svg></figure>')


def _in_window(k: int) -> bool:
    """Bin k lies at least partly in a receiver window."""
    first = eye.FROM_NS + k * eye.BIN_NS
    late = (first + WIN_EARLY_NS) % HALF_BIT_NS
    return late <= WIN_EARLY_NS + WIN_LATE_NS or late > HALF_BIT_NS - eye.BIN_NS


def _volt_eye(cells: dict[tuple[int, int], int], title: str) -> str:
    if not cells:
        return ""
    most = max(cells.values())
    reach = max(10, max(abs(v) for _, v in cells))
    height = 220
    tall, slot = height / (2 * reach + 1), _EYE_W / eye.BINS
    levels: list[list[str]] = [[] for _ in range(6)]
    for (k, v), count in sorted(cells.items()):
        level = min(5, int(6 * math.log1p(count) / math.log1p(most)))
        levels[level].append(f"M{_EYE_LEFT + k * slot:.1f} {(reach - v) * tall:.1f}h{slot:.1f}v{tall:.1f}h{-slot:.1f}z")
    paths = "".join(f'<path class="volts v{level}" d="{"".join(path)}"/>' for level, path in enumerate(levels) if path)
    volts = reach * eye.VOLT
    return (f'<figure><figcaption>{escape(title)}: voltage, {_number(sum(cells.values()))} samples</figcaption>'
            f'<svg viewBox="0 0 {_EYE_W + _EYE_LEFT + 24} {height + 36}" role="img" aria-label="Voltage eye, '
            f'{escape(title)}">'
            f'{_eye_frame(height)}{paths}<text x="{_EYE_LEFT - 4}" y="11" text-anchor="end">{volts:+.1f}</text>'
            f'<text x="{_EYE_LEFT - 4}" y="{height / 2 + 4}" text-anchor="end">0 V</text><text x="{_EYE_LEFT - 4}" '
            f'y="{height}" text-anchor="end">−{volts:.1f}</text><text x="{_EYE_LEFT + _EYE_W}" y="{height + 32}" '
            f'text-anchor="end">µs in the bit time; darkness: logarithm of the number</text></svg></figure>')


def _eyes(counts: dict[str, Any], volts: Sequence[dict] = ({}, {})) -> str:
    parts = [_volt_eye(volts[sender], name) + _pulse_eye(counts["starts"][sender], counts["ends"][sender], name)
             for sender, name in enumerate(("Requests", "Answers"))]
    if not any(parts):
        return '<p class="none">No pulses were counted.</p>'
    ends = "" if any(map(any, counts["ends"][0] + counts["ends"][1])) else " The ends of the pulses are not known here."
    return (f'<p class="hint">One bit time; 0 is the grid point of the first pulse, bit pulses belong to 0, '
            f'half-bit pulses '
            f'to 3 µs. <span class="key starts"></span> starts <span class="key ends"></span> ends <span '
            f'class="key window"></span> receiver window.{ends}</p><div class="figures">{"".join(parts)}</div>')


# ---------------------------------------------------------------- lists of the run
def _checks(checks: Sequence[dict[str, Any]]) -> str:
    if not checks:
        return '<p class="none">The plant expects nothing.</p>'
    marks = {"met": ("✓", "good"), "not met": ("✗", "bad"), "not reached": ("–", "dim")}
    rows = []
    for number, check in enumerate(checks):
        mark, style = marks[check["result"]]
        notes = "".join(f"<br>{escape(text)}" for text in check["differences"])
        exact = escape(json.dumps(check["result"]))
        rows.append(f'<li class="{style}" data-path="checks.{number}.result" data-v="{exact}">'
                    f'<b aria-hidden="true">{mark}</b> <span>{escape(check["name"])} at {_ms(check["at_ns"])} ms: '
                    f'{escape(check["result"])}{notes}</span></li>')
    return f'<ul class="checks">{"".join(rows)}</ul>'


def _events(trace: Trace) -> str:
    events = trace.sorted_events()
    if not events:
        return '<p class="none">Nothing happened beside the telegrams.</p>'
    rows = "".join(f'<tr><td class="num"><button type="button" class="goto" data-t="{t}">{_ms(t)}</button></td>'
                   f'<td><span class="tag">{escape(kind)}</span></td><td>{escape(text)}</td></tr>'
                   for t, kind, text in events[:_EVENT_ROWS])
    more = (f'<p class="hint">The first {_EVENT_ROWS} of {len(events)}; all of them are marked on the time line.</p>'
            if len(events) > _EVENT_ROWS else "")
    return (f'<div class="scroll tall" tabindex="0" role="region" aria-label="Events"><table id="events"><thead><tr>'
            f'<th scope="col" class="num">ms</th><th scope="col">Kind</th><th scope="col">What</th></tr></thead>'
            f'<tbody>{rows}</tbody></table></div>{more}')


def _table(name: str, label: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Cells are HTML already."""
    body = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
    cells = "".join(f'<th scope="col">{escape(text)}</th>' for text in head)
    return (f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(label)}"><table id="{name}">'
            f'<thead><tr>{cells}</tr></thead><tbody>{body}</tbody></table></div>')


def _word(value: int | None) -> str:
    return "" if value is None else f"{value:04X} ({_number(value - (value >> 15 << 16))})"


def _process(report: dict[str, Any]) -> str:
    """16-bit values and functions, where there are any; then log, history and storage."""
    out = []
    if report["analog"]:
        rows = [[escape(row["address"]), escape(row["name"] or ""), escape(row["kind"]), row["direction"],
                 str(row["channel"]), _value(report, f"analog.{k}.value", _word),
                 _valid(report, k, row), _value(report, f"analog.{k}.received", _word)]
                for k, row in enumerate(report["analog"])]
        head = ("Address", "Name", "Kind", "Direction", "Channel", "Value", "Mark", "Received by the slave")
        out.append(_section("16-bit values", _table("analog", "16-bit values", head, rows), "values"))
    if report["functions"]:
        rows = [[escape(row["function"]), _value(report, f"functions.{k}.at_ns", _ms),
                 _value(report, f"functions.{k}.answered_ns", _ms),
                 _value(report, f"functions.{k}.result", lambda x: x or "no answer"),
                 escape(row["string"] or "")] for k, row in enumerate(report["functions"])]
        head = ("Function", "Asked ms", "Answered ms", "Result", "String")
        out.append(_section("Functions", _table("functions", "Functions", head, rows)))
    lost = "".join(f'<p class="hint">{_value(report, key)} {what}</p>' for key, what in
                   (("events_lost", "events were overwritten before they were read"),
                    ("events_left_out", "later events are left out")) if report[key])
    log = [[_number(row["t_us"] / 1e3, 3), escape(row["text"])] for row in report["events"][-_EVENT_ROWS:]]
    safe = [(f"Safety view of {escape(row['address'])}", f"F-IN1 {int(row['f_in1'])}, F-IN2 {int(row['f_in2'])}")
            for row in report["safety"]]
    pairs = _pairs([*safe, ("History", "<br>".join(escape(line) for line in history_lines(report["history"]))),
                    ("Storage", escape(storage_line(report["storage"])))])
    table = _table("log", "Event log", ("ms", "Event"), log) if log else '<p class="none">No events.</p>'
    out.append(_section("Event log of the master", table + lost + pairs, "log-section"))
    return "".join(out)


def _valid(report: dict[str, Any], k: int, row: dict[str, Any]) -> str:
    mark = "" if row["valid"] is None else _value(report, f"analog.{k}.valid", lambda v: "valid" if v else "invalid")
    return mark + ("" if row["transfer"] else " no transfer")


def _flags(report: dict[str, Any]) -> str:
    out = []
    for name, on in report["state"]["flags"].items():
        bad = name in _GOOD_FLAGS and _GOOD_FLAGS[name] != on
        out.append(f'<span class="flag {"bad" if bad else "good" if on else "dim"}" '
                   f'data-path="state.flags.{escape(name)}" '
                   f'data-v="{json.dumps(on)}">{escape(name)} {int(on)}</span>')
    return f'<p class="flags">{"".join(out)}</p>'


def _pairs(rows: Sequence[tuple[str, str]]) -> str:
    items = "".join(f"<dt>{escape(name)}</dt><dd>{content}</dd>" for name, content in rows)
    return f'<dl class="pairs">{items}</dl>'


def _counts(report: dict[str, Any], path: str) -> str:
    return ", ".join(f"{escape(name)} {_value(report, f'{path}.{name}')}" for name in _at(report, path)) or "none"


def _section(title: str, content: str, name: str = "") -> str:
    return f'<section{f" id={name}" if name else ""}><h2>{escape(title)}</h2>{content}</section>'


# ---------------------------------------------------------------- the two pages
def of_run(report: dict[str, Any], trace: Trace, pulse_counts: dict[str, Any]) -> str:
    """report: report.json (docs/report.md). -> HTML."""
    v = lambda path, show=_number: _value(report, path, show)  # noqa: E731
    run, checks = report["run"], report["checks"]
    met = sum(check["result"] == "met" for check in checks)
    style = {"ok": "good", "interrupted": "warn"}.get(report["result"], "bad")
    tiles = [
        _tile("Bus time", f"{v('run.bus_time_ns', _ms)} ms", f"of {v('run.wanted_ns', _ms)} ms; {v('run.clocks')} "
                                                             f"clocks at "
              f"{v('run.clk_hz', lambda x: f'{x / 1e6:g}')} MHz"),
        _tile("Cycle mean", f"{v('cycles.mean_ns', _us)} µs", f"min {v('cycles.min_ns', _us)}, max "
                                                              f"{v('cycles.max_ns', _us)}; "
              f"{v('cycles.count')} cycles"),
        _tile("Requests", v("telegrams.requests"), f"{v('telegrams.repeated')} repeated, {v('telegrams.failed')} "
                                                   f"without a "
              f"valid answer, {v('telegrams.bad_requests')} bad"),
        _tile("Slaves active", f'<span class="n">{len(report["state"]["las"])}</span>',
              f'{len(report["state"]["lds"])} detected, {len(report["state"]["lps"])} projected'),
        _tile("Start-up", f"{v('start.start_up_ns', _ms)} ms",
              f"first telegram at {v('start.first_telegram_ns', _ms)} ms"),
        _tile("Checks met", f'<span class="n" id="met">{met}</span> of {len(checks)}',
              f'{sum(c["result"] == "not met" for c in checks)} not met, '
              f'{sum(c["result"] == "not reached" for c in checks)} not reached'),
    ]
    details = _pairs([
        ("Firmware", v("run.firmware", lambda x: x or "not started")),
        ("Phase at the end", v("state.phase", str)),
        *((name.upper(), escape(" ".join(report["state"][name])) or "none") for name in LISTS),
        ("Calls", _counts(report, "telegrams.by_call")), ("Answers", _counts(report, "telegrams.by_class")),
        ("Phases, ms", ", ".join(f"{escape(name)} {v(f'phases_ns.{name}', _ms)}"
                                 for name, t in report["phases_ns"].items() if t) or "none"),
        ("Master's counts", _counts(report, "master")),
        ("Core", f"{v('core.interrupts')} times awake, longest {v('core.longest_busy_clocks')} clocks, "
                 f"{v('core.longest_busy_in_cycle_clocks')} while cycles run"),
        ("Simulation", f"{v('run.wall_s', lambda x: f'{x:.1f}')} s, {v('run.real_time_ratio', lambda x: f'{x}')} of "
                       f"real time; "
                       f"seed {v('plant.seed', str)}"),
    ])
    head = (f'<h1>{escape(report["plant"]["name"])} <span class="badge {style}" data-path="result" '
            f'data-v="{escape(json.dumps(report["result"]))}">{escape(report["result"])}</span></h1>'
            f'<p class="about">{escape(" ".join(report["plant"]["description"].split()))}</p>'
            + (f'<p class="error" role="alert">{escape(report["error"])}</p>' if report["error"] else ""))
    return _page(report["plant"]["name"], "run", report, trace, head, tiles,
                 first=_section("Checks", _checks(checks) + _flags(report), "checks"),
                 slaves=_slaves(report["slaves"], trace, True), more=_process(report), eyes=_eyes(pulse_counts),
                 details=details)


def of_capture(statistics: dict[str, Any], trace: Trace, collected: eye.Eye) -> str:
    """statistics: of asi decode (docs/decode.md). -> HTML."""
    v = lambda path, show=_number: _value(statistics, path, show)  # noqa: E731
    name = Path(statistics["file"]).name
    tiles = [
        _tile("Capture", f'<span class="n">{_ms(statistics["end_ns"] - statistics["begin_ns"])}</span> ms',
              f"{v('begin_ns', _ms)} to {v('end_ns', _ms)} ms"),
        _tile("Cycle mean", f"{v('cycles.mean_ns', _us)} µs", f"min {v('cycles.min_ns', _us)}, max "
                                                              f"{v('cycles.max_ns', _us)}; "
              f"{v('cycles.count')} periods"),
        _tile("Requests", v("telegrams.requests"), f"{v('telegrams.repeated')} repeated, {v('telegrams.failed')} "
                                                   f"without a "
              f"valid answer, {v('telegrams.bad_requests')} bad"),
        _tile("Addresses called", f'<span class="n">{len(statistics["slaves"])}</span>',
              f'{sum(bool(row["answers"]) for row in statistics["slaves"])} answered'),
        _tile("Per second", v("telegrams.per_second", lambda x: _number(x, 1))),
        _tile("Request deviation", f"{v('request_deviation_ns', _us)} µs", "farthest pulse from the 3 µs grid"),
    ]
    details = _pairs([
        ("Format", escape(f"{statistics['format']}, {statistics['kind']}: {', '.join(statistics['signals'])}")),
        ("Calls", _counts(statistics, "telegrams.by_call")), ("Answers", _counts(statistics, "telegrams.by_class")),
    ])
    notes = "".join(f"<li>{escape(note)}</li>" for note in statistics["notes"])
    head = (f'<h1>{escape(name)} <span class="badge">capture</span></h1>'
            f'<p class="about">{escape(statistics["file"])}</p>')
    return _page(name, "capture", statistics, trace, head, tiles,
                 first=_section("Notes", f"<ul>{notes}</ul>") if notes else "",
                 slaves=_slaves(statistics["slaves"], trace, False),
                 eyes=_eyes(collected.pulse_counts(), collected.volts), details=details)


def _page(title: str, kind: str, report: dict[str, Any], trace: Trace, head: str, tiles: Sequence[str], *, first: str,
          slaves: str, eyes: str, details: str, more: str = "") -> str:
    folder = resources.files("asi") / "html"
    style, script, page = ((folder / name).read_text("utf-8") for name in ("page.css", "page.js", "page.html"))
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    note = trace.note()
    times = trace.cycle_times
    return Template(page).substitute(
        policy=f"default-src 'none'; style-src 'unsafe-inline'; img-src data:; script-src 'sha256-{digest}'; "
               f"base-uri 'none'; "
               "form-action 'none'",
        title=escape(f"{title} – AS-i report"), style=style, script=script, head=head, tiles="".join(tiles),
        first=first,
        note=f'<p class="hint" id="left-out">{escape(note)}</p>' if note else "",
        histogram=_histogram(times.per_us),
        cycles=f'{_number(times.count)} cycles, from one DEXG of the lowest number to the next' if times.count else "",
        slaves=slaves, more=more, eyes=eyes, events=_events(trace), details=details,
        data=_json({"schema": SCHEMA, "kind": kind, "report": report, "timeline": trace.data()}))


def _json(data: dict[str, Any]) -> str:
    """JSON that cannot end its script element, whatever the texts in it."""
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=True)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def write(page: str, path: Path) -> None:
    path.write_text(page, encoding="utf-8")
