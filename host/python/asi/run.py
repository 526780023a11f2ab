# SPDX-License-Identifier: Apache-2.0
"""Run a plant on a simulated chip: play the world and the host, watch the line, write logs, make the report.

Nothing grows with the length of a run: telegrams go to files in pieces, actions come from an iterator.
Times are ns of bus time since reset.
"""
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from asi import html_report, report
from asi.plant import Action, Check, Faults, Function, Plant, Slave
from asi.regmap import HOST_PI
from asi.status import LogEvent, Status
from asi.status import name_of as number_name
from asi.telegram import index_name, line_order
from asi.telegram_log import TelegramLog
from asi.trace import Trace
from asi.window import Analog, Answer, Event, FunctionError, HostWindow, State, WindowError

CHUNK_NS = 10_000_000        # longest step: Ctrl-C and the progress display react after at most this
POLL_NS = 500_000            # step while the firmware starts or a commit is open
START_LIMIT_NS = 100_000_000  # firmware must be up by then
COMMIT_LIMIT_NS = 100_000_000  # ... and a commit applied within this
FUNCTION_LIMIT_NS = 60_000_000_000  # the longest string of a CTT2 slave takes half a minute
MOST_EVENTS = 20_000         # of the event log are kept, the later ones counted
ON_THE_LINE = (5, 20, 22, 24, 27, 28, 29, 30, 31)  # functions with telegrams; the others change what a commit takes


class SimulationError(Exception):
    """The chip does not do what every run needs: it does not start, refuses the projection, never gets consistent."""


class Bench(Protocol):
    """The simulated world as the runner needs it; asi.native.Chip seen through asi.bench.NativeBench."""
    clk_hz: int

    def time(self) -> int: ...
    def run(self, until_ns: int) -> int: ...
    def pulse_counts(self) -> dict[str, Any]: ...
    def host_read(self, addr: int) -> int: ...
    def host_write(self, addr: int, data: int, be: int = 15) -> None: ...
    def telegrams(self) -> list[Any]: ...
    def stats(self) -> Any: ...
    def add(self, slave: Slave) -> int: ...
    def set_inputs(self, slave: int, nibble: int) -> None: ...
    def set_present(self, slave: int, present: bool) -> None: ...
    def set_periphery_fault(self, slave: int, fault: bool) -> None: ...
    def set_faults(self, slave: int, faults: Faults) -> None: ...
    def set_value(self, slave: int, channel: int, word: int) -> None: ...
    def get_value(self, slave: int, channel: int) -> int | None: ...
    def set_invalid(self, slave: int, invalid: int, overflow: int) -> None: ...
    def set_safety(self, slave: int, table: tuple[int, ...], closed: int) -> None: ...
    def power(self, good: bool) -> None: ...
    def apf(self, low: bool) -> None: ...
    def close(self) -> None: ...


@dataclass(frozen=True)
class Seen:
    """What a check needs beside state and inputs; only what it asks for has to be there."""
    suspects: frozenset[int] | None = None
    parameters: list[int] | None = None                                    # PI, 64 nibbles
    analog: dict[int, list[Analog]] = field(default_factory=dict)          # by index
    received: dict[int, list[int | None]] = field(default_factory=dict)    # by position in the plant's slaves
    events: list[Event] | None = None                                      # the whole log so far


def compare(check: Check, state: State, inputs: list[int] | None, cycle_max_ns: int | None,
            name_of: Callable[[int], str] = index_name, seen: Seen = Seen()) -> list[str]:
    """-> one line per difference between what a check wants and what is there; empty: met."""
    out = []
    for name in ("lds", "las", "lps", "lpf", "suspects"):
        want, have = getattr(check, name), getattr(seen if name == "suspects" else state, name)
        if want is not None and want != have:
            for word, indices in (("missing", want - (have or set())), ("too many", (have or set()) - want)):
                if indices:
                    out.append(f"{name.upper()} {word}: {' '.join(map(name_of, sorted(indices, key=line_order)))}")
            if have is None:
                out.append(f"{name} were not looked at")
    for name, want in check.flags.items():
        if state.flags[name] != want:
            out.append(f"{name} is {int(not want)}, expected {int(want)}")
    for index, want in check.inputs.items():
        have = inputs[index] if inputs is not None else None
        if have != want:
            shown = "unreadable" if have is None else f"{have:04b}"
            out.append(f"input {name_of(index)} is {shown}, expected {want:04b}")
    if check.cycle_max_ns is not None:
        if not cycle_max_ns:
            out.append("no cycle was measured")
        elif cycle_max_ns > check.cycle_max_ns:
            out.append(f"longest cycle {report.us(cycle_max_ns)}, expected at most {report.us(check.cycle_max_ns)}")
    for index, want in check.parameters.items():
        have = None if seen.parameters is None else seen.parameters[index]
        if have != want:
            shown = "not known" if have is None else f"{have:04b}"
            out.append(f"parameter {name_of(index)} is {shown}, expected {want:04b}")
    for index, words in check.analog.items():
        values = seen.analog.get(index, [])
        for channel, want in enumerate(words):
            have = values[channel] if channel < len(values) else None
            if want != "any" and (have is None or (not have.valid if want != "invalid" else have.valid)
                                  or (want != "invalid" and have.value != want)):
                shown = "not known" if have is None else _word(have.value) + ("" if have.valid else " (invalid)")
                out.append(f"value {name_of(index)} channel {channel + 1} is {shown}, expected {_word(want)}")
    for position, words in check.received.items():
        values = seen.received.get(position, [])
        for channel, want in enumerate(words):
            have = values[channel] if channel < len(values) else None
            if want not in ("any", have):
                shown = "nothing" if have is None else _word(have)
                out.append(f"slave #{position + 1} channel {channel + 1} received {shown}, expected {_word(want)}")
    events = iter(seen.events or ())
    for wanted in check.log:
        if not any(event.event == wanted.event and wanted.index in (None, event.index)
                   and wanted.data in (None, event.data) for event in events):
            what = [name_of_event(wanted.event)] + ([] if wanted.index is None else [name_of(wanted.index)])
            out.append(f"log: no {' '.join(what)}{'' if wanted is check.log[0] else ' after the events before'}")
            break
    return out


def name_of_event(number: int) -> str:
    return number_name(LogEvent, number).lower()


def _word(value: int | str) -> str:
    """0xFFFE -> 'FFFE (-2)'."""
    return value if isinstance(value, str) else f"{value:04X} ({value - (value >> 15 << 16)})"


def function_differences(function: Function, answer: Answer) -> list[str]:
    """-> one line per difference between what a function had to end with and its answer."""
    out = []
    if answer.status != function.status:
        out.append(f"{function.text}: {answer.name}, expected {number_name(Status, function.status)}")
    elif function.data is not None and answer.data != function.data:
        out.append(f"{function.text}: answer {answer.data:04b}, expected {function.data:04b}")
    elif function.answer is not None and answer.string != function.answer:
        out.append(f"{function.text}: string {answer.string.hex(' ') or 'empty'}, expected {function.answer.hex(' ')}")
    return out


class Runner:
    """One run. `progress` is called after each step with (bus time in ns, end in ns, cycles so far)."""

    def __init__(self, plant: Plant, bench: Bench, folder: Path, until_ns: int | None = None, *, log: bool = True,
                 html: bool = True, progress: Callable[[int, int, int], None] | None = None):
        self.plant, self.bench, self.folder = plant, bench, folder
        self.until_ns = plant.duration_ns if until_ns is None else until_ns
        self.progress = progress or (lambda now, end, cycles: None)
        self.window = HostWindow(bench)
        self.configured = False
        self.version: str | None = None
        self._log_wanted = log
        self._trace = Trace() if html else None
        self._pending: tuple[int, int] | None = None  # open commit: sequence, time of the write
        self._host_queue: deque[Action] = deque()
        self._checks = deque(plant.checks)
        self._results: list[dict[str, Any]] = []
        self._asked: deque[int] = deque()             # functions that wait, by position
        self._open: tuple[int, int, int] | None = None  # open function: position, sequence, time
        self.answers: dict[int, tuple[Answer, int, int]] = {}  # by position: answer, asked, answered in ns
        self.events: list[Event] = []
        self.events_lost = self.events_left_out = 0
        self._marks = {k: [slave.invalid, slave.overflow] for k, slave in enumerate(plant.slaves)}
        self._handles: list[int] = []

    def run(self) -> dict[str, Any]:
        """Run to the end, Ctrl-C or a failure; -> the report (docs/report.md), also written to report.json."""
        started = time.monotonic()
        interrupted, error = False, None
        self.folder.mkdir(parents=True, exist_ok=True)
        with TelegramLog(self.folder if self._log_wanted else None, self.plant.extended,
                         self._trace and self._trace.add) as log:
            try:
                self.play(log)
            except KeyboardInterrupt:
                interrupted = True
            except (SimulationError, WindowError, FunctionError, RuntimeError) as fault:  # RuntimeError: of the bench
                error = str(fault)
            log.add(self.bench.telegrams())
            wall_s = time.monotonic() - started
            out = report.build(self, log.counts, wall_s=wall_s, interrupted=interrupted, error=error)
        report.write(out, self.folder / "report.json")
        if self._trace is not None:
            for check in out["checks"]:
                if check["result"] != "not reached":
                    self._trace.event(check["at_ns"], "check", "; ".join([f"{check['name']} {check['result']}",
                                                                          *check["differences"]]))
            html_report.write(html_report.of_run(out, self._trace, self.bench.pulse_counts()),
                              self.folder / "report.html")
        return out

    def results(self) -> list[dict[str, Any]]:
        """Checks and functions so far, those not reached included, by time."""
        last = self.plant.checks[-1]
        out = self._results + [report.check_result(check, None, check is last) for check in self._checks]
        over = self.bench.time() >= self.plant.duration_ns
        for position, function in enumerate(self.plant.functions):
            differences: list[str] | None = [f"{function.text}: not answered"] if over else None
            if position in self.answers:
                differences = function_differences(function, self.answers[position][0])
            out.append(report.function_result(function, differences))
        return sorted(out, key=lambda one: (one["at_ns"], one["name"] == "expect"))

    def receives(self, position: int) -> list[int | None]:
        """Output words that a simulated slave has received."""
        heard = self.plant.slaves[position].kind.heard
        if position >= len(self._handles):  # the run failed before
            return [None] * heard
        return [self.bench.get_value(self._handles[position], channel) for channel in range(heard)]

    # ------------------------------------------------------------ the loop
    def play(self, log: TelegramLog) -> None:
        """The run itself, without a report; SimulationError, WindowError, FunctionError."""
        for slave in self.plant.slaves:
            self._handles.append(self.bench.add(slave))
        actions = self.plant.iter_actions()
        action = next(actions, None)
        now = self.bench.time()
        while True:
            while action is not None and action.time_ns <= now:
                self._act(action)
                action = next(actions, None)
            self._host()
            if now >= self.until_ns:
                break
            waiting = not self.configured or self._pending is not None or self._open is not None
            stop = min(now + (POLL_NS if waiting else CHUNK_NS), self.until_ns,
                       *[a.time_ns for a in (action, self._checks[0] if self._checks else None) if a is not None])
            now = self.bench.run(max(stop, now + 1))
            log.add(self.bench.telegrams())
            self._read_log()
            while self._checks and self._checks[0].time_ns <= now:  # before what happens at the same time
                self._check(self._checks.popleft())
            self.progress(now, self.until_ns, self.bench.stats().cycles)

    def _read_log(self) -> None:
        """The event log of the master: often enough that its 64 places last."""
        if not self.configured:
            return
        events, lost = self.window.events()
        self.events_lost += lost
        room = max(0, MOST_EVENTS - len(self.events))
        self.events += events[:room]
        self.events_left_out += len(events[room:])
        if self._trace is not None:
            for event in events:
                self._trace.event(event.time_us * 1_000, "log", report.event_text(event, self.plant.name_of))

    def _seen(self, check: Check) -> Seen:
        window = self.window
        return Seen(window.history().suspects if check.suspects is not None else None,
                    window.parameters(HOST_PI) if check.parameters else None,
                    {index: [window.analog_input(index, channel) for channel in range(len(words))]
                     for index, words in check.analog.items()},
                    {position: self.receives(position) for position in check.received}, self.events)

    def _check(self, check: Check) -> None:
        state = self.window.state()
        inputs = self.window.inputs() if check.inputs else None
        differences = compare(check, state, inputs, self.bench.stats().cycle_max_ns,
                              self.plant.name_of, self._seen(check))
        self._results.append(report.check_result(check, differences, check is self.plant.checks[-1]))

    # ------------------------------------------------------------ the world
    def _act(self, action: Action) -> None:
        bench = self.bench
        if self._trace is not None:
            self._trace.event(bench.time(), *self._told(action))
        handles = [self._handles[position] for position in action.slaves]
        if action.do in ("output", "analog", "mode", "offline", "data_exchange", "auto_address"):
            self._host_queue.append(action)
        elif action.do == "function":
            self._asked.append(action.value)
        elif action.do in ("invalid", "overflow"):
            for position, handle in zip(action.slaves, handles):
                self._marks[position][action.do == "overflow"] = action.value
                bench.set_invalid(handle, *self._marks[position])
        elif action.do == "contacts":
            for position, handle in zip(action.slaves, handles):
                bench.set_safety(handle, self.plant.slaves[position].safety.table, action.value)
        elif action.do == "power_off":
            bench.power(False)
            bench.apf(True)
        elif action.do == "power_on":
            bench.power(True)
            bench.apf(False)
        elif action.do in ("apf_low", "apf_high"):
            bench.apf(action.do == "apf_low")
        else:
            work = {
                "inputs": lambda h: bench.set_inputs(h, action.value),
                "value": lambda h: bench.set_value(h, *action.value),
                "drop": lambda h: bench.set_present(h, False),
                "connect": lambda h: bench.set_present(h, True),
                "noise": lambda h: bench.set_faults(h, action.value),
                "quiet": lambda h: bench.set_faults(h, Faults()),
                "periphery_fault": lambda h: bench.set_periphery_fault(h, True),
                "periphery_ok": lambda h: bench.set_periphery_fault(h, False),
            }[action.do]
            for handle in handles:
                work(handle)

    def _told(self, action: Action) -> tuple[str, str]:
        """-> kind and text of an event, for people."""
        value, words = action.value, [action.do.replace("_", " ")]
        if action.do == "output":
            return "output", f"{self.plant.name_of(value[0])} := {value[1]:04b}"
        if action.do == "analog":
            return "output", f"{self.plant.name_of(value[0])} channel {value[1] + 1} := {_word(value[2])}"
        if action.do == "function":
            return "host", f"asks: {self.plant.functions[value].text}"
        who = ", ".join(f"{slave.address} {slave.name}" for slave in map(self.plant.slaves.__getitem__, action.slaves))
        if action.do == "inputs":
            return "input", f"{who} := {value:04b}"
        if action.do == "value":
            return "input", f"{who} channel {value[0] + 1} := {_word(value[1])}"
        if action.do in ("invalid", "overflow", "contacts"):
            numbers = " ".join(str(k + 1) for k in range(4) if value >> k & 1) or "none"
            return "world", f"{'contacts closed' if action.do == 'contacts' else action.do} {who}: {numbers}"
        if isinstance(value, Faults):
            words += [f"{name.replace('_', ' ')} {number / 65536:.2%}" if not name.endswith("_ns") else
                      f"{name[:-3]} {number / 1000:g} us" for name, number in vars(value).items() if number]
        elif action.do == "mode":
            words.append("protected" if value else "configuration")
        elif value is not None:
            words.append("on" if value else "off")
        return ("host" if action.do in ("mode", "offline", "data_exchange", "auto_address") else "world",
                f"{words[0]} {who}{': ' + ', '.join(words[1:]) if words[1:] else ''}".strip())

    # ------------------------------------------------------------ the host
    def _host(self) -> None:
        """Start-up, open commits, then what waits in the queue; one commit at a time."""
        now = self.bench.time()
        if not self.configured:
            if self.window.ready():
                self.configured = True
                self.version = self.window.version()
                self._pending = (self.window.configure(self.plant.host), now)
            elif now > START_LIMIT_NS:
                raise SimulationError(f"the firmware did not start within {START_LIMIT_NS // 10**6} ms (MAGIC)")
            return
        if self._pending is not None:
            sequence, since = self._pending
            result = self.window.result(sequence)
            if result is None:
                if now - since > COMMIT_LIMIT_NS:
                    raise SimulationError(f"commit {sequence} was not applied within {COMMIT_LIMIT_NS // 10**6} ms")
                return
            if result != 0:
                raise SimulationError(f"commit {sequence} was refused: FW_RESULT = {result}")
            self._pending = None
        self._functions(now)
        while self._host_queue and self._pending is None:
            if self._host_queue[0].do not in ("output", "analog") and self._open is not None \
                    and self.plant.functions[self._open[0]].code not in ON_THE_LINE:
                return
            action = self._host_queue.popleft()
            if action.do == "output":
                self.window.set_output(*action.value)
            elif action.do == "analog":
                self.window.set_analog_output(*action.value)
            else:
                name = {"mode": "protected_mode", "auto_address": "auto_address_enable"}.get(action.do, action.do)
                self._pending = (self.window.set_control(**{name: action.value}), now)

    def _functions(self, now: int) -> None:
        """The answer of the open function, then the next one: one at a time (FN-032)."""
        if self._open is not None:
            position, sequence, since = self._open
            text = self.plant.functions[position].text
            answer = self.window.answer(sequence)
            if answer is None:
                if now - since > FUNCTION_LIMIT_NS:
                    raise SimulationError(f"{text}: no answer within {FUNCTION_LIMIT_NS // 10**9} s (FN_DONE)")
                return
            self._open = None
            self.answers[position] = (answer, since, now)
            if self._trace is not None:
                self._trace.event(now, "host", f"{text}: {answer.name}")
        if self._asked:
            position = self._asked.popleft()
            function = self.plant.functions[position]
            sequence = self.window.begin_function(function.code, function.first, function.second, function.string)
            self._open = (position, sequence, now)
