# SPDX-License-Identifier: Apache-2.0
"""Plants: a network of slaves, what the host wants of it, what happens, and what must come out (PL-001, PL-004).

A plant is one TOML file (docs/plants.md). `load_plant` checks it completely and gives plain objects: every time is an
int in nanoseconds of bus time since reset, every address an index (number + 32 * Sel), every nibble an int 0..15.
Nothing here knows a simulator: the native runner and the cocotb tests use the same objects.

Errors: PlantError, whose text has one line per fault: file, key, reason.
"""
import heapq
import re
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import takewhile
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, StrictBool, StrictInt, Tag,
                      ValidationError)

from asi import combined
from asi.status import LogEvent, Status
from asi.telegram import address_name, index_name, parse_index

SETTLE_NS = 1_000_000_000      # P_PWR_SETTLE of the product firmware: plants are written for it
LONGEST_NS = 365 * 86_400 * 10**9
WATCHED_FLAGS = ("config_ok", "lds0", "auto_address_assign", "auto_address_available", "configuration_active",
                 "normal_operation_active", "apf", "offline_ready", "periphery_ok")


class PlantError(Exception):
    """A plant that cannot be used; `lines` has one line (file, key, reason) per fault."""

    def __init__(self, lines: list[str]):
        super().__init__("\n".join(lines))
        self.lines = lines


# ---------------------------------------------------------------- what the rest of the tools sees
@dataclass(frozen=True)
class Codes:
    """Configuration codes of a slave."""
    io: int
    id: int
    id1: int
    id2: int

    @property
    def word(self) -> int:
        """As in CDI and PCD of the host window."""
        return self.io | self.id << 4 | self.id1 << 8 | self.id2 << 12

    @property
    def extended(self) -> bool:
        """True: A/B addressing."""
        return self.id == 0xA

    @property
    def kind(self) -> combined.Kind:
        """What a slave with these codes exchanges beside its nibble."""
        return combined.kind_of(self.io, self.id, self.id2)

    @property
    def profile(self) -> str:
        return f"S-{self.io:X}.{self.id:X}.{self.id2:X}"


@dataclass(frozen=True)
class Options:
    """What a slave does other than most (SL-010; asi_slave_options of tb/asi_tb.h)."""
    write_ns: int = 15_000_000   # time of a memory write after ADRA or WID1
    write_fails: bool = False
    id1_locked: bool = False
    old: bool = False
    sel_at_zero: bool = False


@dataclass(frozen=True)
class Safety:
    """A safety slave: its eight words, and the closed contacts as bits 0 and 1."""
    table: tuple[int, ...] = combined.SAFETY_TABLE
    closed: int = 3


@dataclass(frozen=True)
class Slave:
    """One simulated slave; inputs, values, invalid, overflow: at time 0. Channels count from 0 here."""
    name: str
    index: int
    codes: Codes
    inputs: int = 0
    watchdog: bool = False
    present: bool = True
    values: tuple[int, ...] = ()                             # input words by channel, 0..FFFF
    invalid: int = 0                                         # bit per channel: sends V = 0
    overflow: int = 0                                        # bit per channel: sends O = 1
    strings: dict[int, bytes] = field(default_factory=dict)  # S-7.4: 0 ID, 1 diagnosis, 2 parameters; CTT2: objects
    safety: Safety | None = None
    options: Options = Options()

    @property
    def kind(self) -> combined.Kind:
        return self.codes.kind

    @property
    def address(self) -> str:
        """'5', '5A', '5B', '0'."""
        return address_name(self.index, self.codes.extended)


@dataclass(frozen=True)
class Faults:
    """Faults of a slave's answers: probabilities in 1/65536, times in ns (as asi_slave_faults of tb/asi_tb.h)."""
    no_answer: int = 0
    parity: int = 0
    missing_pulse: int = 0
    shifted_pulse: int = 0
    extra_pulse: int = 0
    shift_ns: int = 0
    delay_ns: int = 0


@dataclass(frozen=True)
class Action:
    """Something that happens at time_ns.

    do         slaves               value
    inputs     positions in slaves  nibble
    drop, connect, quiet            None
    noise      positions            Faults
    periphery_fault, periphery_ok   None
    value      positions            (channel, word): input word of a combined transaction
    invalid, overflow  positions    bit per channel: sends V = 0, O = 1
    contacts   positions            closed contacts of a safety slave, bits 0 and 1
    power_off, power_on             None: line and slaves lose power; comes back
    apf_low, apf_high               None: only the master sees low voltage
    output     ()                   (index, nibble), host level
    mode       ()                   True: protected
    offline, data_exchange, auto_address  bool
    analog     ()                   (index, channel, word): AODI
    function   ()                   position in Plant.functions
    """
    time_ns: int
    do: str
    slaves: tuple[int, ...] = ()
    value: Any = None


@dataclass(frozen=True)
class Function:
    """An execution control function that the host asks for at time_ns, and what it must end with (FN-001 ..)."""
    time_ns: int
    name: str                   # as in the file, e.g. change_address
    code: int
    first: int                  # FN_ARG
    second: int
    string: bytes
    status: int                 # expected asi_status_t
    data: int | None            # expected answer nibble; None: not looked at
    answer: bytes | None        # expected string; None: not looked at
    text: str                   # for people


@dataclass(frozen=True)
class Logged:
    """An event that must be in the event log; None: any."""
    event: int                  # LogEvent
    index: int | None = None
    data: int | None = None


@dataclass(frozen=True)
class Host:
    """What the host commits before the master starts; pcd and parameters by index."""
    protected: bool = False
    pcd: dict[int, Codes] = field(default_factory=dict)      # projected slaves: LPS and codes
    parameters: dict[int, int] = field(default_factory=dict)  # PP, F where not named
    outputs: dict[int, int] = field(default_factory=dict)     # nibbles at time 0, 0 where not named
    data_exchange: bool = True
    auto_address: bool = False
    names: dict[int, str] = field(default_factory=dict)       # of slaves that are projected only
    analog: dict[int, tuple[int, ...]] = field(default_factory=dict)  # AODI words by channel at time 0


@dataclass(frozen=True)
class Check:
    """State the host window must show at time_ns; None and missing flags: not looked at."""
    time_ns: int
    lds: frozenset[int] | None = None
    las: frozenset[int] | None = None
    lps: frozenset[int] | None = None
    flags: dict[str, bool] = field(default_factory=dict)
    inputs: dict[int, int] = field(default_factory=dict)
    cycle_max_ns: int | None = None
    lpf: frozenset[int] | None = None
    suspects: frozenset[int] | None = None
    parameters: dict[int, int] = field(default_factory=dict)                  # PI
    analog: dict[int, tuple[int | str, ...]] = field(default_factory=dict)    # AIDI: word, "invalid" or "any"
    received: dict[int, tuple[int | str, ...]] = field(default_factory=dict)  # by position: words the slave has got
    log: tuple[Logged, ...] = ()                                              # so far, in this order


@dataclass(frozen=True)
class Plant:
    """A checked plant. `checks` are sorted by time; the table [expect] is the check at duration_ns."""
    path: str
    name: str
    description: str
    duration_ns: int
    seed: int
    host: Host
    slaves: tuple[Slave, ...]
    checks: tuple[Check, ...]
    sources: tuple[tuple["Action", int, int], ...]  # first action, period (0: once), last time
    shift_ns: int = 0
    functions: tuple[Function, ...] = ()     # in the order of the file
    lettered: frozenset[int] = frozenset()   # numbers that functions name with A or B

    def iter_actions(self) -> Iterator[Action]:
        """Every timed action, sorted by time (equal times: order of the file); endless when something repeats."""
        return heapq.merge(*(self._series(*source) for source in self.sources), key=lambda action: action.time_ns)

    def actions(self, until_ns: int | None = None) -> list[Action]:
        """The sorted actions with time_ns <= until_ns (default: duration_ns)."""
        limit = self.duration_ns if until_ns is None else until_ns
        return list(takewhile(lambda action: action.time_ns <= limit, self.iter_actions()))

    def _series(self, first: Action, period_ns: int, last_ns: int) -> Iterator[Action]:
        time_ns = first.time_ns
        while time_ns <= last_ns:
            yield replace(first, time_ns=max(0, time_ns + self.shift_ns))
            if not period_ns:
                return
            time_ns += period_ns

    def extended(self, number: int) -> bool:
        """True when the plant or the projection has an A/B slave on this number."""
        return number in self._extended_numbers

    def name_of(self, index: int) -> str:
        """Index -> '5', '5A' or '5B' as this plant uses the number."""
        return address_name(index, self.extended(index & 31))

    @cached_property
    def _extended_numbers(self) -> frozenset[int]:
        indices = [s.index for s in self.slaves if s.codes.extended and s.index]
        indices += [index for index, codes in self.host.pcd.items() if codes.extended]
        return frozenset(index & 31 for index in indices) | self.lettered

    def with_settle(self, settle_ns: int) -> "Plant":
        """The same plant for a firmware image that waits settle_ns instead of SETTLE_NS: every time moves with it."""
        shift = settle_ns - SETTLE_NS
        move = lambda time_ns: max(0, time_ns + shift)  # noqa: E731 - what happened before the start happens at 0
        return replace(self, shift_ns=self.shift_ns + shift, duration_ns=move(self.duration_ns),
                       checks=tuple(replace(c, time_ns=move(c.time_ns)) for c in self.checks),
                       functions=tuple(replace(f, time_ns=move(f.time_ns)) for f in self.functions))


# ---------------------------------------------------------------- values
_TIME = re.compile(r"(-?)(\d{1,12}(?:\.\d{1,9})?)\s*(ns|us|ms|s|min|h)")
_UNIT_NS = {"ns": 1, "us": 10**3, "ms": 10**6, "s": 10**9, "min": 60 * 10**9, "h": 3600 * 10**9}


def parse_time(text: Any, negative: bool = False) -> int:
    """'500ms', '1.5 s', '20us' -> ns; ValueError with a reason otherwise."""
    match = _TIME.fullmatch(text.strip()) if isinstance(text, str) else None
    if not match:
        raise ValueError(f"{_show(text)} is not a time: a number with ns, us, ms, s, min or h, in quotes")
    whole, _, part = match[2].partition(".")
    unit = _UNIT_NS[match[3]]
    digits, scale = int(whole + part), 10 ** len(part)
    if digits * unit % scale:
        raise ValueError(f"{_show(text)} is finer than a nanosecond")
    time_ns = digits * unit // scale
    if match[1] and time_ns and not negative:
        raise ValueError(f"{_show(text)} is negative")
    if time_ns > LONGEST_NS:
        raise ValueError(f"{_show(text)} is longer than a year")
    return -time_ns if match[1] else time_ns


def parse_nibble(text: Any) -> int:
    """'0011' (D3..D0) or one hexadecimal digit -> 0..15; ValueError otherwise."""
    if isinstance(text, str) and re.fullmatch(r"[01]{4}", text):
        return int(text, 2)
    if isinstance(text, str) and re.fullmatch(r"[0-9A-Fa-f]", text):
        return int(text, 16)
    raise ValueError(f"{_show(text)} is not a nibble: four binary digits D3..D0 or one hexadecimal digit, in quotes")


def parse_addresses(value: Any) -> frozenset[int]:
    """['1', '5A', '7-12', '1B-31B'] -> indices; ValueError otherwise."""
    if not isinstance(value, list):
        raise ValueError(f"{_show(value)} is not a list of addresses")
    out: set[int] = set()
    for item in value:
        first, _, last = _text(item, "address").partition("-")
        low, high = parse_index(first), parse_index(last or first)
        if low > high or low >> 5 != high >> 5:
            raise ValueError(f"{_show(item)} is not a range of addresses, e.g. '1-31' or '1B-31B'")
        out.update(range(low, high + 1))
    return frozenset(out)


def parse_bytes(text: Any) -> bytes:
    """'10 22 0A' -> bytes; ValueError otherwise."""
    if isinstance(text, str) and re.fullmatch(r"\s*([0-9A-Fa-f]{2}\s*)+", text):
        data = bytes.fromhex(text)
        if len(data) > combined.STRING_BYTES:
            raise ValueError(f"{len(data)} bytes, at most {combined.STRING_BYTES}")
        return data
    raise ValueError(f"{_show(text)} is not a string of bytes: pairs of hexadecimal digits, in quotes")


def parse_numbers(value: Any, highest: int) -> int:
    """[1, 3] -> 0b101: numbers 1..highest as bits from bit 0; ValueError otherwise."""
    numbers = value if isinstance(value, list) else None
    if numbers is None or any(isinstance(n, bool) or not isinstance(n, int) or not 1 <= n <= highest for n in numbers):
        raise ValueError(f"{_show(value)} is not a list of numbers 1 to {highest}")
    return sum(1 << n - 1 for n in set(numbers))


def _show(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."


def _text(value: Any, what: str) -> str:
    if not isinstance(value, str):
        raise ValueError(f"{_show(value)} is not an {what}: write it in quotes")
    return value


def _address(value: Any) -> str:
    parse_index(_text(value, "address"))
    return value.strip().upper()


def _probability(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 <= value <= 1:
        raise ValueError(f"{_show(value)} is not a probability from 0 to 1")
    return min(65535, round(value * 65536))


def _signed_time(value: Any) -> int:
    return parse_time(value, negative=True)


def _projected(value: Any) -> Any:
    return value if value == "all" else parse_addresses(value)


def _period(value: Any) -> int:
    if (period := parse_time(value)) < 10_000:
        raise ValueError(f"{_show(value)} is too short to repeat, at least 10us")
    return period


def _word(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not -0x8000 <= value <= 0xFFFF:
        raise ValueError(f"{_show(value)} is not a 16-bit value, -32768 to 65535")
    return value & 0xFFFF


def _wanted_word(value: Any) -> int | str:
    if value in ("invalid", "any"):
        return value
    try:
        return _word(value)
    except ValueError:
        raise ValueError(f"{_show(value)} is not a 16-bit value, 'invalid' or 'any'") from None


def _status(value: Any) -> int:
    if not isinstance(value, str) or value not in Status.__members__:
        raise ValueError(f"{_show(value)} is not 'OK' or an error: {', '.join(list(Status.__members__)[1:])}")
    return int(Status[value])


def _event_name(value: Any) -> int:
    if not isinstance(value, str) or value.upper() not in LogEvent.__members__ or value != value.lower():
        raise ValueError(f"{_show(value)} is not an event: {', '.join(name.lower() for name in LogEvent.__members__)}")
    return int(LogEvent[value.upper()])


def _index(value: Any) -> int:
    return parse_index(_text(value, "address"))


def _contacts(value: Any) -> int:
    return parse_numbers(value, 2)


def _name(value: Any) -> Any:
    if isinstance(value, str) and not (1 <= len(value) <= 60 and not re.search(r"[\x00-\x1f\x7f]", value)):
        raise ValueError(f"{_show(value)} is not a name: 1 to 60 characters, no control characters")
    return value  # of another type: pydantic says so


def _duration(value: Any) -> int:
    if (time_ns := parse_time(value)) < 10_000:
        raise ValueError(f"{_show(value)} is too short, at least 10us")
    return time_ns


Time = Annotated[int, BeforeValidator(parse_time)]
SignedTime = Annotated[int, BeforeValidator(_signed_time)]
Period = Annotated[int, BeforeValidator(_period)]
Nibble = Annotated[int, BeforeValidator(parse_nibble)]
Address = Annotated[str, BeforeValidator(_address)]
Addresses = Annotated[frozenset[int], BeforeValidator(parse_addresses)]
Bytes = Annotated[bytes, BeforeValidator(parse_bytes)]
Word = Annotated[int, BeforeValidator(_word)]
WantedWord = Annotated[Any, BeforeValidator(_wanted_word)]
Contacts = Annotated[int, BeforeValidator(_contacts)]
Index = Annotated[int, BeforeValidator(_index)]
Probability = Annotated[int, BeforeValidator(_probability)]
Name = Annotated[str, BeforeValidator(_name)]


# ---------------------------------------------------------------- the file
class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class _Step(_Table):
    at: Time
    value: Nibble


_Inputs = Annotated[Annotated[Nibble, Tag("(nibble)")] | Annotated[list[_Step], Tag("(steps)")],
                    Discriminator(lambda value: "(steps)" if isinstance(value, list) else "(nibble)")]


class _WordStep(_Table):
    at: Time
    value: Word


_Channel = Annotated[Annotated[Word, Tag("(word)")] | Annotated[list[_WordStep], Tag("(steps)")],
                     Discriminator(lambda value: "(steps)" if isinstance(value, list) else "(word)")]


class _Safety(_Table):
    table: Annotated[list[Nibble], Field(min_length=8, max_length=8)] = list(combined.SAFETY_TABLE)
    closed: Contacts = 3


class _Codes(_Table):
    profile: str | None = None
    io: Nibble | None = None
    id: Nibble | None = None
    id1: Nibble | None = None
    id2: Nibble | None = None


class _Slave(_Codes):
    name: Name | None = None
    address: Address
    inputs: _Inputs = 0
    repeat: Period | None = None
    watchdog: StrictBool = False
    present: StrictBool = True
    values: list[_Channel] | None = None
    invalid: Any = None
    overflow: Any = None
    strings: dict[str, Bytes] | None = None
    safety: _Safety | None = None
    write_time: Time = Options.write_ns
    write_fails: StrictBool = False
    id1_locked: StrictBool = False
    old: StrictBool = False
    sel_at_zero: StrictBool = False


class _Extra(_Codes):
    name: Name | None = None
    address: Address


class _Output(_Table):
    address: Address
    value: Nibble | None = None
    values: list[_Step] | None = None
    repeat: Period | None = None


class _Analog(_Table):
    address: Address
    values: list[_Channel]
    repeat: Period | None = None


class _Function(_Codes):
    at: Time
    do: Literal["set_permanent_parameter", "write_parameter", "store_parameters", "set_permanent_configuration",
                "store_configuration", "set_lps", "change_address", "execute", "write_id1", "read_parameter_string",
                "write_parameter_string", "read_diagnosis_string", "read_id_string", "message", "set_auto_clear"]
    address: Address | None = None
    new: Address | None = None
    addresses: Addresses | None = None
    value: Any = None
    string: Bytes | None = None
    result: Annotated[int, BeforeValidator(_status)] = 0
    data: Nibble | None = None
    answer: Bytes | None = None


class _Host(_Table):
    mode: Literal["configuration", "protected"] = "configuration"
    projected: Annotated[Any, BeforeValidator(_projected)] = "all"
    not_projected: Addresses = frozenset()
    extra: list[_Extra] = []
    parameters: dict[str, Nibble] = {}
    data_exchange: StrictBool = True
    auto_address: StrictBool = False
    auto_clear: Annotated[StrictInt, Field(ge=0, le=3)] = 0
    output: list[_Output] = []
    analog: list[_Analog] = []
    function: list[_Function] = []


class _Event(_Table):
    at: Time
    do: Literal["drop", "connect", "noise", "quiet", "inputs", "periphery_fault", "periphery_ok", "power_off",
                "power_on", "apf_low", "apf_high", "mode", "offline", "data_exchange", "auto_address", "replace",
                "invalid", "overflow", "contacts"]
    slave: str | None = None
    value: Any = None
    repeat: Period | None = None
    until: Time | None = None
    no_answer: Probability | None = None
    parity: Probability | None = None
    missing_pulse: Probability | None = None
    shifted_pulse: Probability | None = None
    extra_pulse: Probability | None = None
    shift: SignedTime | None = None
    delay: Time | None = None


class _Logged(_Table):
    event: Annotated[int, BeforeValidator(_event_name)]
    address: Index | None = None
    data: Annotated[StrictInt, Field(ge=0, le=0xFFFF)] | None = None


class _Expect(_Table):
    lds: Addresses | None = None
    las: Addresses | None = None
    lps: Addresses | None = None
    flags: dict[Literal[WATCHED_FLAGS], StrictBool] = {}
    inputs: dict[str, Nibble] = {}
    cycle_max: Time | None = None
    lpf: Addresses | None = None
    suspects: Addresses | None = None
    parameters: dict[str, Nibble] = {}
    analog: dict[str, list[WantedWord]] = {}
    received: dict[str, list[WantedWord]] = {}
    log: list[_Logged] = []


class _Check(_Expect):
    at: Time


class _File(_Table):
    name: Name
    description: str
    duration: Annotated[int, BeforeValidator(_duration)]
    seed: Annotated[StrictInt, Field(ge=0, lt=2**63)] = 1
    conflicts: StrictBool = False
    host: _Host = _Host()
    slave: list[_Slave]
    event: list[_Event] = []
    check: list[_Check] = []
    expect: _Expect


# ---------------------------------------------------------------- checks that need more than one value
class _Fault(ValueError):
    def __init__(self, key: str, reason: str):
        super().__init__(reason)
        self.key = key


_SLAVE_EVENTS = ("drop", "connect", "noise", "quiet", "inputs", "periphery_fault", "periphery_ok", "replace",
                 "invalid", "overflow", "contacts")
# functions: number, and the keys that each needs
_FUNCTIONS = {
    "set_permanent_parameter": (3, ("address", "value")), "write_parameter": (5, ("address", "value")),
    "store_parameters": (7, ()), "set_permanent_configuration": (8, ("address",)), "store_configuration": (10, ()),
    "set_lps": (12, ("addresses",)), "change_address": (20, ("address", "new")), "execute": (22, ("address", "value")),
    "write_id1": (24, ("value",)), "read_parameter_string": (27, ("address",)),
    "write_parameter_string": (28, ("address", "string")), "read_diagnosis_string": (29, ("address",)),
    "read_id_string": (30, ("address",)), "message": (31, ("address", "string")), "set_auto_clear": (33, ("value",)),
}
_ARGUMENTS = ("address", "new", "addresses", "value", "string")
_CODE_KEYS = ("profile", "io", "id", "id1", "id2")
_SWITCHES = ("offline", "data_exchange", "auto_address")
_FAULT_KEYS = ("no_answer", "parity", "missing_pulse", "shifted_pulse", "extra_pulse")


def _codes(table: _Codes, index: int) -> Codes:
    """Codes of a slave or a projection at this index."""
    if table.profile is not None:
        given = [key for key in ("io", "id", "id2") if getattr(table, key) is not None]
        if given:
            raise _Fault(given[0], "profile says this already")
        match = re.fullmatch(r"S-([0-9A-F])\.([0-9A-F])(?:\.([0-9A-F]))?", table.profile.strip().upper())
        if not match:
            raise _Fault("profile", f"{_show(table.profile)} is not a profile like S-7.0 or S-7.A.7")
        io, ident, id2 = (int(digit, 16) if digit else 15 for digit in match.groups())
    elif table.io is None or table.id is None:
        raise _Fault("profile", "missing: give a profile, or io and id")
    else:
        io, ident, id2 = table.io, table.id, 15 if table.id2 is None else table.id2
    letter = table.address[-1]
    if ident == 0xA and letter not in "AB" and index:
        raise _Fault("address", f"ID code A is a slave with extended addressing: {table.address}A or {table.address}B")
    if ident != 0xA and letter in "AB":
        raise _Fault("address", f"{table.address} needs ID code A, this is {ident:X}")
    sel = index >> 5
    id1 = table.id1 if table.id1 is not None else 15 if ident != 0xA or sel else 7
    if ident == 0xA and index and id1 >> 3 != sel:
        raise _Fault("id1", f"bit 3 stores Sel: {'8..F' if sel else '0..7'} at {table.address}")
    return Codes(io, ident, id1, id2)


def _steps(steps: list[_Step], repeat: int | None, key: str) -> None:
    for number, (now, later) in enumerate(zip(steps, steps[1:]), 2):
        if later.at <= now.at:
            raise _Fault(f"{key} #{number}.at", "not later than the step before")
    if not steps:
        raise _Fault(key, "empty list")
    if repeat is not None and steps[-1].at - steps[0].at >= repeat:
        raise _Fault("repeat", "shorter than the list of steps")


class _Builder:
    """Turns the checked tables into a Plant and collects the faults that need several values."""

    def __init__(self, path: str, file: _File):
        self.path, self.file, self.lines = path, file, []
        self.sources: list[tuple[Action, int, int]] = []
        self.slaves: list[Slave] = []
        self.by_name: dict[str, int] = {}
        self.functions: list[Function] = []
        self.lettered: set[int] = set()

    def guard(self, prefix: str, work: Callable[[], Any]) -> Any:
        """work() with its fault written down; None then."""
        try:
            return work()
        except _Fault as fault:
            key = ".".join(part for part in (prefix, fault.key) if part)
            self.lines.append(f"{self.path}: {key}: {fault}")
        return None

    def series(self, steps: list[_Step], repeat: int | None, do: str, slaves: tuple[int, ...], value) -> None:
        for step in steps:
            self.sources.append((Action(step.at, do, slaves, value(step.value)), repeat or 0, LONGEST_NS))

    def slave(self, table: _Slave) -> None:
        index = parse_index(table.address)
        codes = _codes(table, index)
        name = table.name or f"slave {table.address}"
        if name in self.by_name:
            raise _Fault("name", f"'{name}' is used twice")
        if _is_address(name) or name == "all":
            raise _Fault("name", f"'{name}' would be mixed up with an address")
        position = len(self.slaves)
        steps = table.inputs if isinstance(table.inputs, list) else None
        values = table.values or []
        if steps is not None:
            _steps(steps, table.repeat, "inputs")
        elif table.repeat is not None and not any(isinstance(value, list) for value in values):
            raise _Fault("repeat", "neither inputs nor one of values is a list of steps")
        known = self.extras(table, codes)
        if not self.file.conflicts and table.present:
            for other in self.slaves:
                if other.present and other.index == index:
                    raise _Fault("address", f"'{other.name}' has it too (conflicts = true allows that)")
                if other.present and index and other.index & 31 == index & 31 \
                        and not (codes.extended and other.codes.extended):
                    raise _Fault("address", f"'{other.name}' has the same number (conflicts = true allows that)")
        self.by_name[name] = position
        first = table.inputs if steps is None else steps[0].value if steps[0].at == 0 else 0
        self.slaves.append(Slave(name, index, codes, first, table.watchdog, table.present, **known,
                                 values=self.channels(values, table.repeat, "value", (position,), ())))
        if steps is not None:
            self.series(steps, table.repeat, "inputs", (position,), lambda nibble: nibble)

    def extras(self, table: _Slave, codes: Codes) -> dict[str, Any]:
        """What a slave has beside inputs and values, as arguments of Slave."""
        kind, out = codes.kind, {}
        if table.values is not None and (kind.group or not kind.inputs):
            hint = ": give each member its inputs" if kind.group else ""
            raise _Fault("values", f"{codes.profile} has no 16-bit inputs{hint}")
        if table.values is not None and len(table.values) > kind.inputs:
            raise _Fault("values", f"{len(table.values)} channels, {codes.profile} has {kind.inputs}")
        for key in ("invalid", "overflow"):
            if (given := getattr(table, key)) is not None:
                out[key] = _with_key(key, lambda g=given: self.mask(codes, g))
        if table.strings is not None:
            out["strings"] = {}
            for text, data in table.strings.items():
                number = self.string_number(kind, text)
                if number is None:
                    raise _Fault(f"strings.{_show(text)}", f"{codes.profile} has no such string")
                if kind.messages and number == 0 and len(data) < combined.ID_BYTES:
                    raise _Fault(f"strings.{_show(text)}", f"{len(data)} bytes, an ID object has {combined.ID_BYTES}")
                if not kind.messages and (len(data) % 3 or len(data) > combined.SEQUENCES_BYTES):
                    raise _Fault(f"strings.{_show(text)}", f"{len(data)} bytes, must be sequences of 3, "
                                                           f"at most {combined.SEQUENCES_BYTES}")
                out["strings"][number] = data
        if kind.safety:
            safety = table.safety or _Safety()
            out["safety"] = Safety(tuple(safety.table), safety.closed)
        elif table.safety is not None:
            raise _Fault("safety", f"{codes.profile} is no safety slave (ID code B)")
        if table.old and (codes.extended or (codes.id1, codes.id2) != (15, 15)):
            raise _Fault("old", "a slave without ID1 and ID2 is no A/B slave and reads as F, F")
        if table.write_time > 10**9:
            raise _Fault("write_time", "longer than 1s")
        out["options"] = Options(table.write_time, table.write_fails, table.id1_locked, table.old, table.sel_at_zero)
        return out

    def mask(self, codes: Codes, value: Any) -> int:
        """Channels of an input slave with V and O bits (CTT1) -> bits."""
        if codes.kind.name != "CTT1" or not codes.kind.inputs:
            raise ValueError(f"{codes.profile} sends no valid and overflow bits")
        return parse_numbers(value, codes.kind.inputs)

    def string_number(self, kind: combined.Kind, text: str) -> int | None:
        """Number of a slave's string in tb/asi_tb.h; None: it has no such string."""
        if kind.messages:
            if re.fullmatch(r"[1-9][0-9]{0,2}", text) and int(text) < 256:
                return int(text)
            return 0 if text == "id" else None
        return combined.S74_STRINGS.get(text) if kind.strings else None

    def channels(self, values: list, repeat: int | None, do: str, slaves: tuple[int, ...],
                 before: tuple[int, ...]) -> tuple[int, ...]:
        """Words per channel at time 0; lists of steps become actions with the value (*before, channel, word)."""
        out = []
        for channel, value in enumerate(values):
            if isinstance(value, list):
                _steps(value, repeat, f"values #{channel + 1}")
                self.series(value, repeat, do, slaves, lambda word, c=channel: (*before, c, word))
                value = value[0].value if value[0].at == 0 else 0
            out.append(value)
        return tuple(out)

    def replacement(self, table: _Event) -> None:
        """The slave that a `replace` event will bring: same profile and inputs, address 0."""
        old = self.find(table.slave)
        if len(old) != 1:
            raise _Fault("slave", "'all' cannot be replaced")
        slave = self.slaves[old[0]]
        name = f"{slave.name} (new)"
        if name in self.by_name:
            raise _Fault("slave", f"'{slave.name}' is replaced twice, or '{name}' is a slave: replace '{name}'")
        codes = slave.codes
        if codes.extended:
            codes = replace(codes, id1=codes.id1 & 7)  # leaves the factory as an A slave
        self.by_name[name] = len(self.slaves)
        self.slaves.append(replace(slave, name=name, index=0, present=False, codes=codes))

    def find(self, text: str | None) -> tuple[int, ...]:
        if text is None:
            raise _Fault("slave", "missing: a name, an address or 'all'")
        if text == "all":  # those of the file: a replacement comes by its event
            return tuple(range(len(self.file.slave)))
        if text in self.by_name:
            return (self.by_name[text],)
        if not _is_address(text):
            raise _Fault("slave", f"no slave is called {_show(text)}")
        found = [k for k, slave in enumerate(self.slaves) if slave.index == parse_index(text)]
        if not found:
            raise _Fault("slave", f"no slave has address {text}")
        if len(found) > 1:
            raise _Fault("slave", f"several slaves have address {text}: use the name")
        return tuple(found)

    def event(self, table: _Event) -> None:
        slaves: tuple[int, ...] = ()
        if table.do in _SLAVE_EVENTS:
            slaves = self.find(table.slave)
        elif table.slave is not None:
            raise _Fault("slave", f"'{table.do}' is not about one slave")
        faults = {key: getattr(table, key) for key in _FAULT_KEYS if getattr(table, key) is not None}
        times = [key for key in ("shift", "delay") if getattr(table, key) is not None]
        if table.do != "noise" and (faults or times):
            raise _Fault([*faults, *times][0], f"belongs to 'noise', not to '{table.do}'")
        value: Any = None
        if table.do == "noise":
            if not faults and table.delay is None:
                raise _Fault("do", f"noise needs one of {', '.join(_FAULT_KEYS)} or delay")
            if table.shifted_pulse and not table.shift:
                raise _Fault("shift", "missing: shifted_pulse needs it")
            for key in times:
                if abs(getattr(table, key)) > 1_000_000:
                    raise _Fault(key, "longer than 1ms")
            value = Faults(**faults, shift_ns=table.shift or 0, delay_ns=table.delay or 0)
        elif table.do in ("invalid", "overflow"):
            value = {_with_key("value", lambda k=k: self.mask(self.slaves[k].codes, table.value)) for k in slaves}.pop()
        elif table.do == "contacts":
            if any(self.slaves[k].safety is None for k in slaves):
                raise _Fault("slave", "not a safety slave (ID code B)")
            value = _with_key("value", lambda: parse_numbers(table.value, 2))
        elif table.do == "inputs":
            value = _with_key("value", lambda: parse_nibble(table.value))
        elif table.do == "mode":
            if table.value not in ("configuration", "protected"):
                raise _Fault("value", f"{_show(table.value)} is not 'configuration' or 'protected'")
            value = table.value == "protected"
        elif table.do in _SWITCHES:
            if not isinstance(table.value, bool):
                raise _Fault("value", f"{_show(table.value)} is not true or false")
            value = table.value
        if value is None and table.value is not None:
            raise _Fault("value", f"'{table.do}' takes no value")
        if table.do == "replace":
            if table.repeat is not None:
                raise _Fault("repeat", "a slave is replaced once")
            new = self.by_name[f"{self.slaves[slaves[0]].name} (new)"]
            for do, position in (("drop", slaves[0]), ("connect", new)):
                self.sources.append((Action(table.at, do, (position,)), 0, LONGEST_NS))
            return
        if table.until is not None and (table.repeat is None or table.until < table.at):
            raise _Fault("until", "needs repeat" if table.repeat is None else "before at")
        last = LONGEST_NS if table.until is None else table.until
        self.sources.append((Action(table.at, table.do, slaves, value), table.repeat or 0, last))

    def host(self) -> Host:
        host, pcd = self.file.host, {}
        known = {s.index: s.codes for s in reversed(self.slaves) if s.index}
        wanted = frozenset(known) if host.projected == "all" else host.projected
        for key, indices in (("projected", wanted), ("not_projected", host.not_projected)):
            for index in sorted(indices - known.keys()):
                raise _Fault(key, f"no slave of this plant has address {index_name(index)}"
                                  f"{' (use host.extra)' if key == 'projected' else ''}")
        for index in sorted(wanted - host.not_projected):
            pcd[index] = known[index]
        extra, names = set(), {}
        for number, table in enumerate(host.extra, 1):
            index = parse_index(table.address)
            if not index or index in extra:
                raise _Fault(f"{_item('extra', number, table.name)}.address",
                             "used twice" if index else "address 0 cannot be projected")
            extra.add(index)
            key = _item("host.extra", number, table.name)
            codes = self.guard(key, lambda t=table, i=index: _codes(t, i))
            if codes is not None:
                pcd[index] = codes
            if table.name:
                names[index] = table.name
        parameters = {}
        for text, nibble in host.parameters.items():
            index = _with_key(f"parameters.{_show(text)}", lambda t=text: parse_index(t))
            if index not in pcd:
                raise _Fault(f"parameters.{_show(text)}", "this address is not projected")
            parameters[index] = nibble
        outputs = {}
        for number, table in enumerate(host.output, 1):
            key, index = f"output #{number}", parse_index(table.address)
            if (table.value is None) == (table.values is None):
                raise _Fault(key, "give value or values")
            if not index:
                raise _Fault(f"{key}.address", "address 0 has no outputs")
            if table.values is None:
                if table.repeat is not None:
                    raise _Fault(f"{key}.repeat", "value is not a list of steps")
                outputs[index] = table.value
                continue
            self.guard(f"host.{key}", lambda t=table: _steps(t.values, t.repeat, "values"))
            if table.values and table.values[0].at == 0:
                outputs[index] = table.values[0].value
            self.series(table.values, table.repeat, "output", (), lambda nibble, i=index: (i, nibble))
        analog = {}
        for number, table in enumerate(host.analog, 1):
            key, index = f"host.analog #{number}", parse_index(table.address)
            analog[index] = self.guard(key, lambda t=table: self.analog(t, pcd))
        if host.auto_clear:
            if host.auto_address or host.mode != "protected":
                raise _Fault("auto_clear", "goes with neither automatic addressing nor configuration mode")
            self.ask(Function(0, "set_auto_clear", 33, host.auto_clear, 0, b"", 0, None, None,
                              f"set_auto_clear {host.auto_clear}"))
        for number, table in enumerate(host.function, 1):
            self.guard(f"host.function #{number}", lambda t=table: self.function(t))
        return Host(host.mode == "protected", pcd, parameters, outputs, host.data_exchange, host.auto_address,
                    names, analog)

    def analog(self, table: _Analog, pcd: dict[int, Codes]) -> tuple[int, ...]:
        index = parse_index(table.address)
        kinds = [codes.kind for codes in ([pcd[index]] if index in pcd else
                                          [s.codes for s in self.slaves if s.index == index])]
        if not kinds:
            raise _Fault("address", f"no slave of this plant has address {table.address}")
        if not kinds[0].outputs:
            raise _Fault("address", f"the slave at {table.address} has no 16-bit outputs")
        if not table.values:
            raise _Fault("values", "empty list")
        if len(table.values) > kinds[0].outputs:
            raise _Fault("values", f"{len(table.values)} channels, the slave has {kinds[0].outputs}")
        if table.repeat is not None and not any(isinstance(value, list) for value in table.values):
            raise _Fault("repeat", "values has no list of steps")
        return self.channels(table.values, table.repeat, "analog", (), (index,))

    def ask(self, function: Function) -> None:
        self.sources.append((Action(function.time_ns, "function", (), len(self.functions)), 0, LONGEST_NS))
        self.functions.append(function)

    def function(self, table: _Function) -> None:
        """One [[host.function]]; its text says what people call it."""
        code, needed = _FUNCTIONS[table.do]
        if table.do == "set_permanent_configuration":
            needed += _CODE_KEYS
        for key in (*_ARGUMENTS, *_CODE_KEYS):
            given = getattr(table, key) is not None
            if key in needed and not given and key not in _CODE_KEYS:
                raise _Fault(key, "missing")
            if given and key not in needed:
                raise _Fault(key, f"'{table.do}' takes no {key}")
        if table.answer is not None and table.do not in ("read_parameter_string", "read_diagnosis_string",
                                                         "read_id_string", "message"):
            raise _Fault("answer", f"'{table.do}' answers with no string")
        if table.data is not None and table.do not in ("write_parameter", "execute"):
            raise _Fault("data", f"'{table.do}' answers with no nibble")
        first, second = (parse_index(address) if address else 0 for address in (table.address, table.new))
        words = [table.do, *(a for a in (table.address, table.new) if a)]
        for address in (table.address, table.new):
            if address and address[-1] in "AB":
                self.lettered.add(parse_index(address) & 31)
        if table.do == "set_auto_clear":
            if type(table.value) is not int or not 0 <= table.value <= 3:
                raise _Fault("value", f"{_show(table.value)} is not a number 0 to 3")
            first = table.value
            words.append(str(first))
        elif table.do == "execute":
            if not isinstance(table.value, str) or not re.fullmatch("[01]{5}", table.value):
                raise _Fault("value", f"{_show(table.value)} is not five binary digits I4..I0, in quotes")
            first, second = first & 31, int(table.value, 2)
            words.append(table.value)
        elif "value" in needed:
            nibble = _with_key("value", lambda: parse_nibble(table.value))
            first, second = (nibble, 0) if table.do == "write_id1" else (first, nibble)
            words.append(f"{nibble:04b}")
        elif table.do == "set_lps":
            bits = sum(1 << index for index in table.addresses)
            first, second = bits & 0xFFFF_FFFF, bits >> 32
            words.append(" ".join(map(index_name, sorted(table.addresses))))
        elif table.do == "set_permanent_configuration":
            codes = _codes(table, first)
            second = codes.word
            words.append(f"{codes.profile} ID1 {codes.id1:X}")
        if table.string is not None:
            words.append(table.string.hex(" "))
        self.ask(Function(table.at, table.do, code, first, second, table.string or b"", table.result, table.data,
                          table.answer, " ".join(words)))

    def check(self, table: _Expect, time_ns: int) -> Check:
        if time_ns > self.file.duration:
            raise _Fault("at", "after the end of the plant (duration)")
        if table.model_fields_set <= {"at"}:
            raise _Fault("", "empty: nothing to check")
        inputs, parameters, analog = ({self.key(name, text): value for text, value in getattr(table, name).items()}
                                      for name in ("inputs", "parameters", "analog"))
        for index, words in analog.items():
            most = 0 if index == 0 else 2 if index > 32 else combined.ANALOG_WORDS
            if not 1 <= len(words) <= most:
                raise _Fault(f"analog.'{index_name(index)}'", f"{len(words)} channels, must be 1 to {most}" if most else
                             "address 0 has no 16-bit values")
        received = {}
        for text, words in table.received.items():
            found = self.guard_key(f"received.{_show(text)}", lambda t=text: self.find(t))
            if len(found) != 1 or not words or "invalid" in words or len(words) > self.slaves[found[0]].kind.heard:
                raise _Fault(f"received.{_show(text)}",
                             "not one slave with that many outputs of a combined transaction")
            received[found[0]] = tuple(words)
        return Check(time_ns, table.lds, table.las, table.lps, dict(table.flags), inputs, table.cycle_max, table.lpf,
                     table.suspects, parameters, {i: tuple(w) for i, w in analog.items()}, received,
                     tuple(Logged(one.event, one.address, one.data) for one in table.log))

    def key(self, name: str, text: str) -> int:
        """An address that is a key of the table `name` -> index."""
        return _with_key(f"{name}.{_show(text)}", lambda: parse_index(text))

    def guard_key(self, key: str, work: Callable[[], Any]) -> Any:
        """work() whose fault belongs to this key."""
        try:
            return work()
        except _Fault as fault:
            raise _Fault(key, str(fault)) from None

    def plant(self) -> Plant:
        file = self.file
        for number, table in enumerate(file.slave, 1):
            self.guard(_item("slave", number, table.name), lambda t=table: self.slave(t))
        if self.lines:  # the rest would only repeat these
            raise PlantError(self.lines)
        for number, table in enumerate(file.event, 1):
            if table.do == "replace":  # first: other events may be about the new slaves
                self.guard(f"event #{number}", lambda t=table: self.replacement(t))
        if self.lines:
            raise PlantError(self.lines)
        for number, table in enumerate(file.event, 1):
            self.guard(f"event #{number}", lambda t=table: self.event(t))
        host = self.guard("host", self.host)
        checks = [self.guard(f"check #{number}", lambda t=table: self.check(t, t.at))
                  for number, table in enumerate(file.check, 1)]
        checks.append(self.guard("expect", lambda: self.check(file.expect, file.duration)))
        if self.lines:
            raise PlantError(self.lines)
        return Plant(self.path, file.name, file.description.strip(), file.duration, file.seed, host,
                     tuple(self.slaves), tuple(sorted(checks, key=lambda c: c.time_ns)), tuple(self.sources),
                     functions=tuple(self.functions), lettered=frozenset(self.lettered))


def _is_address(text: str) -> bool:
    try:
        parse_index(text)
    except ValueError:
        return False
    return True


def _with_key(key: str, work: Callable[[], Any]) -> Any:
    try:
        return work()
    except ValueError as error:
        raise _Fault(key, str(error)) from None


def _item(table: str, number: int, name: Any) -> str:
    label = f" ({name})" if isinstance(name, str) and name.isprintable() else ""
    return f"{table} #{number}{label}"


def _key(loc: tuple, data: Any) -> str:
    """Pydantic's location -> 'slave #4 (Stacker lamp).inputs #2.at'; names of union members are left out."""
    out: list[str] = []
    for part in loc:
        if isinstance(part, str) and part.startswith("("):
            continue
        if isinstance(part, int):
            data = data[part] if isinstance(data, list) and part < len(data) else None
            name = data.get("name") if isinstance(data, dict) else None
            out[-1] = _item(out[-1], part + 1, name) if out else f"#{part + 1}"
        elif isinstance(data, dict):
            out.append(part if part.isprintable() else ascii(part))
            data = data.get(part)
    return ".".join(out) or "file"


_REASONS = {"missing": "missing", "extra_forbidden": "unknown key"}
_KINDS = {"model_type": "a table", "list_type": "a list", "dict_type": "a table", "string_type": "a text in quotes",
          "bool_type": "true or false", "int_type": "a whole number"}


def _reason(error: dict) -> str:
    reason = _REASONS.get(error["type"]) or error["msg"].removeprefix("Value error, ").replace("Input should", "must")
    if error["type"] in _KINDS:
        reason = f"{_show(error['input'])} is not {_KINDS[error['type']]}"
    elif error["type"] not in (*_REASONS, "value_error"):
        reason = f"{_show(error['input'])}: {reason}"
    return " ".join(ascii(reason)[1:-1].replace("\\'", "'").replace('\\"', '"').split())


def parse_plant(text: str, path: str = "plant.toml") -> Plant:
    """TOML text -> Plant; PlantError. path is only used in messages."""
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise PlantError([f"{path}: file: nested too deeply"]) from None
    except ValueError as error:
        raise PlantError([f"{path}: file: not TOML: {' '.join(str(error).split())}"]) from None
    try:
        file = _File.model_validate(data)
    except ValidationError as error:
        faults: dict[str, str] = {}
        for item in error.errors(include_url=False, include_context=False):
            faults.setdefault(_key(item["loc"], data), _reason(item))  # one line per key: unions report each member
        raise PlantError([f"{path}: {key}: {reason}" for key, reason in faults.items()]) from None
    return _Builder(path, file).plant()


def load_plant(path: str | Path) -> Plant:
    """Read and check a plant file; PlantError for everything that is wrong with it, unreadable files included."""
    try:
        text = Path(path).read_bytes().decode("utf-8-sig")  # some editors put a mark before the text
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else "not UTF-8 text"
        raise PlantError([f"{path}: file: {reason}"]) from None
    return parse_plant(text, str(path))
