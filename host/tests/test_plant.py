# SPDX-License-Identifier: Apache-2.0
import copy
import json
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asi.combined import SAFETY_TABLE
from asi.plant import (SETTLE_NS, Codes, Logged, Options, PlantError, Safety, load_plant, parse_bytes, parse_nibble,
                       parse_numbers, parse_plant, parse_time)
from asi.status import LogEvent, Status

PLANTS = Path(__file__).resolve().parents[2] / "sim/plants"
SHIPPED = sorted(PLANTS.glob("*.toml"))

GOOD = """
name = "Test"
description = "Three slaves."
duration = "2s"
seed = 5

[host]
mode = "protected"
not_projected = ["7"]
parameters = { "5A" = "0110" }

[[host.extra]]
name = "Gone"
address = "9"
profile = "S-3.1"

[[host.output]]
address = "7"
value = "0001"

[[slave]]
name = "Left"
address = "5A"
profile = "S-7.A.E"
inputs = [{ at = "0s", value = "0001" }, { at = "10ms", value = "F" }]
repeat = "50ms"

[[slave]]
address = "5B"
profile = "S-0.A"

[[slave]]
name = "Late"
address = "7"
io = "8"
id = "0"
present = false
watchdog = true

[[event]]
at = "1s"
do = "connect"
slave = "7"

[[event]]
at = "1100ms"
do = "noise"
slave = "all"
parity = 0.5
shifted_pulse = 1
shift = "-2us"

[[check]]
at = "1500ms"
las = ["5A", "5B"]

[expect]
lds = ["5A", "5B", "7"]
cycle_max = "4.95ms"
[expect.flags]
config_ok = false
[expect.inputs]
"5A" = "0001"
"""


def faults(text):
    with pytest.raises(PlantError) as caught:
        parse_plant(text, "p.toml")
    assert str(caught.value) == "\n".join(caught.value.lines)
    return caught.value.lines


def test_values_of_a_good_plant():
    """PL-001: what the file says is what the tools get: indices, nibbles, codes, nanoseconds."""
    plant = parse_plant(GOOD, "p.toml")
    left, right, late = plant.slaves
    assert (plant.name, plant.duration_ns, plant.seed) == ("Test", 2 * 10**9, 5)
    assert (left.index, left.codes, left.inputs, left.present) == (5, Codes(7, 0xA, 7, 0xE), 1, True)
    assert (right.name, right.index, right.codes) == ("slave 5B", 37, Codes(0, 0xA, 15, 15))
    assert (late.codes, late.present, late.watchdog) == (Codes(8, 0, 15, 15), False, True)
    assert (left.address, right.address, late.address) == ("5A", "5B", "7")
    assert plant.host.protected and plant.host.data_exchange and not plant.host.auto_address
    assert plant.host.pcd == {5: left.codes, 37: right.codes, 9: Codes(3, 1, 15, 15)}
    assert plant.host.parameters == {5: 0b0110} and plant.host.outputs == {7: 1} and plant.host.names == {9: "Gone"}
    first, last = plant.checks
    assert (first.time_ns, first.las, first.lds) == (1_500_000_000, {5, 37}, None)
    assert (last.time_ns, last.lds, last.flags, last.inputs) == (2 * 10**9, {5, 37, 7}, {"config_ok": False}, {5: 1})
    assert last.cycle_max_ns == 4_950_000
    assert left.codes.word == 0xE7A7 and left.codes.profile == "S-7.A.E"
    assert plant.extended(5) and not plant.extended(7) and plant.name_of(5) == "5A" and plant.name_of(7) == "7"


def test_actions_are_sorted_and_repeat():
    """PL-001: timed actions come sorted, repetitions included, and endless series are only made as far as asked."""
    plant = parse_plant(GOOD, "p.toml")
    actions = plant.actions()
    assert [a.time_ns for a in actions] == sorted(a.time_ns for a in actions)
    steps = [(a.time_ns, a.value) for a in actions if a.do == "inputs"]
    assert steps[:3] == [(0, 1), (10_000_000, 15), (50_000_000, 1)] and len(steps) == 2 * 40 + 1
    noise, = (a for a in actions if a.do == "noise")
    assert noise.slaves == (0, 1, 2) and noise.value.parity == 32768 and noise.value.shifted_pulse == 65535
    assert noise.value.shift_ns == -2000 and noise.value.no_answer == 0
    assert [a.slaves for a in actions if a.do == "connect"] == [(2,)]
    assert len(plant.actions(10_000_000)) == 2


def test_settle_time_moves_everything():
    """PL-004: for a firmware image with another settle time every time moves by the difference, never below 0."""
    plant = parse_plant(GOOD, "p.toml").with_settle(20_000_000)
    shift = SETTLE_NS - 20_000_000
    assert plant.duration_ns == 2 * 10**9 - shift
    assert [c.time_ns for c in plant.checks] == [1_500_000_000 - shift, 2 * 10**9 - shift]
    actions = plant.actions()
    assert min(a.time_ns for a in actions) == 0 and max(a.time_ns for a in actions) <= plant.duration_ns
    assert [a.time_ns for a in actions if a.do == "connect"] == [20_000_000]


def test_until_ends_a_repetition():
    """PL-001: `until` is the last time of a repeated event."""
    plant = parse_plant(GOOD.replace('do = "connect"\nslave = "7"', 'do = "offline"\nvalue = true\n'
                                     'repeat = "100ms"\nuntil = "1250ms"'), "p.toml")
    times = [a.time_ns for a in plant.actions() if a.do == "offline"]
    assert times == [1_000_000_000, 1_100_000_000, 1_200_000_000]


@pytest.mark.parametrize("text, ns", [("0s", 0), ("500ms", 500_000_000), ("1.5 s", 1_500_000_000), ("20us", 20_000),
                                      ("62.5ns", None), ("1min", 60_000_000_000), ("1h", 3_600_000_000_000),
                                      ("-1s", None), ("5", None), ("", None), (5, None), ("9999h", None),
                                      ("1e3s", None)])
def test_times(text, ns):
    """PL-001: times are numbers with a unit and whole nanoseconds; everything else is refused."""
    if ns is None:
        with pytest.raises(ValueError):
            parse_time(text)
    else:
        assert parse_time(text) == ns


def test_nibbles():
    """PL-001: a nibble is four binary digits or one hexadecimal digit, nothing else."""
    assert [parse_nibble(f"{n:04b}") for n in range(16)] == list(range(16))
    assert [parse_nibble(f"{n:X}") for n in range(16)] == list(range(16))
    for bad in ("", "00", "011", "0012", "00000", "G", "0x1", 5, None, True, "٠٠٠١"):
        with pytest.raises(ValueError):
            parse_nibble(bad)


# (replace this, by this, the one line that must come out after "p.toml: ")
WRONG = [
    ('name = "Test"', "", "name: missing"),
    ('name = "Test"', "name = 5", "name: 5 is not a text in quotes"),
    ('name = "Test"', 'name = ""', "name: '' is not a name: 1 to 60 characters, no control characters"),
    ('name = "Test"', 'name = "Te\\u0007st"', "name: 'Te\\\\x07st' is not a name"),
    ("seed = 5", "sed = 5", "sed: unknown key"),
    ("seed = 5", "seed = true", "seed: "),
    ("seed = 5", "seed = -1", "seed: "),
    ('"2s"', '"2 seconds"', "duration: '2 seconds' is not a time"),
    ('"2s"', '"0s"', "duration: '0s' is too short"),
    ('mode = "protected"', 'mode = "safe"', "host.mode: 'safe': must be 'configuration' or 'protected'"),
    ('not_projected = ["7"]', 'not_projected = ["8"]', "host.not_projected: no slave of this plant has address 8"),
    ('not_projected = ["7"]', 'projected = ["8"]', "host.projected: no slave of this plant has address 8 (use"),
    ('not_projected = ["7"]', 'projected = ["9-2"]', "host.projected: '9-2' is not a range"),
    ('not_projected = ["7"]', 'projected = [5]', "host.projected: 5 is not an address: write it in quotes"),
    ('{ "5A" = "0110" }', '{ "8" = "0110" }', "host.parameters.'8': this address is not projected"),
    ('{ "5A" = "0110" }', '{ "x" = "0110" }', "host.parameters.'x': 'X' is not an AS-i address"),
    ('{ "5A" = "0110" }', '{ "5A" = "0112" }', "host.parameters.5A: '0112' is not a nibble"),
    ('address = "9"', 'address = "0"', "host.extra #1 (Gone).address: address 0 cannot be projected"),
    ('"S-3.1"', '"S-3.1.1.1"', "host.extra #1 (Gone).profile: 'S-3.1.1.1' is not a profile"),
    ('value = "0001"\n', "", "host.output #1: give value or values"),
    ('value = "0001"\n', 'value = "0001"\nrepeat = "1s"\n', "host.output #1.repeat: value is not a list of steps"),
    ('"5A"\nprofile', '"5"\nprofile', "slave #1 (Left).address: ID code A is a slave with extended addr"),
    ('"5A"\nprofile', '"32A"\nprofile', "slave #1 (Left).address: '32A' is not an AS-i address"),
    ('"S-7.A.E"', '"S-7.0.E"', "slave #1 (Left).address: 5A needs ID code A, this is 0"),
    ('"S-7.A.E"', '"S-7.A.E"\nid1 = "8"', "slave #1 (Left).id1: bit 3 stores Sel: 0..7 at 5A"),
    ('"S-7.A.E"', '"S-7.A.E"\nio = "7"', "slave #1 (Left).io: profile says this already"),
    ('"S-7.A.E"', '7', "slave #1 (Left).profile: 7 is not a text in quotes"),
    ('io = "8"\n', "", "slave #3 (Late).profile: missing: give a profile, or io and id"),
    ('"10ms"', '"0s"', "slave #1 (Left).inputs #2.at: not later than the step before"),
    ('repeat = "50ms"', 'repeat = "10ms"', "slave #1 (Left).repeat: shorter than the list of steps"),
    ('repeat = "50ms"', 'repeat = "1us"', "slave #1 (Left).repeat: '1us' is too short to repeat"),
    ('value = "F" }', 'valu = "F" }', "slave #1 (Left).inputs #2.value: missing"),
    ('"Late"', '"Left"', "slave #3 (Left).name: 'Left' is used twice"),
    ('"Late"', '"31B"', "slave #3 (31B).name: '31B' would be mixed up with an address"),
    ('"Late"', '"a\\u0007b"', "slave #3.name: "),
    ('address = "5B"', 'address = "5A"', "slave #2.address: 'Left' has it too (conflicts = true allows that)"),
    ('address = "5B"\nprofile = "S-0.A"', 'address = "5"\nprofile = "S-0.0"', "slave #2.address: 'Left' has it too"),
    ('"5A"\nprofile = "S-7.A.E"', '"5"\nprofile = "S-0.0"', "slave #2.address: 'Left' has the same number"),
    ("present = false", 'present = "no"', "slave #3 (Late).present: 'no' is not true or false"),
    ('do = "connect"', 'do = "explode"', "event #1.do: 'explode': must be 'drop'"),
    ('slave = "7"', "", "event #1.slave: missing: a name, an address or 'all'"),
    ('slave = "7"', 'slave = "8"', "event #1.slave: no slave has address 8"),
    ('slave = "7"', 'slave = "Right"', "event #1.slave: no slave is called 'Right'"),
    ('slave = "7"', 'slave = "7"\nparity = 0.1', "event #1.parity: belongs to 'noise', not to 'connect'"),
    ('slave = "7"', 'slave = "7"\nvalue = 1', "event #1.value: 'connect' takes no value"),
    ('slave = "7"', 'slave = "7"\nuntil = "1s"', "event #1.until: needs repeat"),
    ('do = "connect"', 'do = "power_off"', "event #1.slave: 'power_off' is not about one slave"),
    ('do = "connect"\nslave = "7"', 'do = "mode"\nvalue = true', "event #1.value: True is not 'configuration' or 'pro"),
    ('do = "connect"\nslave = "7"', 'do = "offline"\nvalue = "on"', "event #1.value: 'on' is not true or false"),
    ('do = "connect"', 'do = "inputs"', "event #1.value: None is not a nibble"),
    ("parity = 0.5", "parity = 1.5", "event #2.parity: 1.5 is not a probability from 0 to 1"),
    ("parity = 0.5", "parity = nan", "event #2.parity: nan is not a probability from 0 to 1"),
    ('shift = "-2us"', "", "event #2.shift: missing: shifted_pulse needs it"),
    ('shift = "-2us"', 'shift = "2ms"', "event #2.shift: longer than 1ms"),
    ('at = "1500ms"', 'at = "3s"', "check #1.at: after the end of the plant (duration)"),
    ('las = ["5A", "5B"]', "", "check #1: empty: nothing to check"),
    ('las = ["5A", "5B"]', 'las = "5A"', "check #1.las: '5A' is not a list of addresses"),
    ("config_ok = false", "config_okay = false", "expect.flags.config_okay"),
    ("config_ok = false", "config_ok = 0", "expect.flags.config_ok: 0 is not true or false"),
    ('"5A" = "0001"', '"55" = "0001"', "expect.inputs.'55': '55' is not an AS-i address"),
    ("[expect]", "[expect", "file: not TOML: "),
]


@pytest.mark.parametrize("old, new, line", WRONG, ids=[line[:40] for *_, line in WRONG])
def test_each_fault_has_its_line(old, new, line):
    """PL-001: one line for one fault: file, key, reason."""
    assert GOOD.count(old) == 1
    lines = faults(GOOD.replace(old, new))
    assert lines[0].startswith(f"p.toml: {line}"), lines
    # a wrong key of a required value is two faults: the unknown key and the missing one
    assert len(lines) == (2 if "valu = " in new else 1), lines


# a second plant: combined transactions, options, functions, a replacement
RICH = """
name = "Rich"
description = "What is more than a nibble."
duration = "2s"
[host]
mode = "protected"
auto_clear = 3
[[host.analog]]
address = "3"
values = [1, [{ at = "0s", value = -1 }, { at = "1s", value = 0xFFFE }]]
[[host.function]]
at = "1100ms"
do = "change_address"
address = "5B"
new = "7A"
result = "ADDRESS_USED"
[[host.function]]
at = "1200ms"
do = "read_id_string"
address = "4"
answer = "00 b7 03"
[[host.function]]
at = "1300ms"
do = "set_permanent_configuration"
address = "9"
profile = "S-3.1"
[[slave]]
name = "In"
address = "2"
profile = "S-7.3.D"
values = [-2, [{ at = "10ms", value = 5 }]]
repeat = "100ms"
invalid = [2]
overflow = [1, 2]
[[slave]]
name = "Out"
address = "3"
profile = "S-7.3.5"
[[slave]]
name = "Meter"
address = "4"
profile = "S-7.4.C"
strings = { id = "00 B7 03", parameters = "010203" }
write_time = "100ms"
write_fails = true
[[slave]]
name = "Mux"
address = "5B"
profile = "S-7.A.7"
id1_locked = true
[[slave]]
name = "Door"
address = "6"
profile = "S-0.B"
safety = { closed = [2] }
[[slave]]
name = "Old"
address = "7"
profile = "S-0.0"
old = true
[[slave]]
name = "Drive"
address = "8"
profile = "S-7.5.5"
strings = { id = "00 2A 00 01 22", "17" = "01" }
[[event]]
at = "1400ms"
do = "replace"
slave = "Mux"
[[event]]
at = "1500ms"
do = "contacts"
slave = "Door"
value = []
[[event]]
at = "1600ms"
do = "periphery_fault"
slave = "Mux (new)"
[expect]
lpf = []
suspects = ["2"]
parameters = { "2" = "0101" }
analog = { "2" = [-2, "invalid"] }
received = { "Out" = [1, "any"] }
log = [{ event = "addressed", address = "5B", data = 0 }, { event = "apf" }]
"""


def test_values_of_a_rich_plant():
    """PL-001, SL-009, SL-010: channels, marks, strings, contacts and options arrive as the slaves want them."""
    plant = parse_plant(RICH, "r.toml")
    by_name = {slave.name: slave for slave in plant.slaves}
    first = by_name["In"]
    assert (first.values, first.invalid, first.overflow) == ((0xFFFE, 0), 2, 3)
    assert by_name["Meter"].strings == {0: bytes.fromhex("00B703"), 2: b"\1\2\3"}
    assert by_name["Meter"].options == Options(100_000_000, write_fails=True)
    assert by_name["Drive"].strings == {0: bytes.fromhex("002A000122"), 17: b"\1"}
    assert by_name["Door"].safety == Safety(SAFETY_TABLE, 2) and first.safety is None
    assert by_name["Old"].options == Options(old=True) and by_name["Mux"].options == Options(id1_locked=True)
    actions = plant.actions()
    assert [(a.time_ns, a.slaves, a.value) for a in actions if a.do == "value"][:2] == [
        (10_000_000, (0,), (1, 5)), (110_000_000, (0,), (1, 5))]
    assert plant.host.analog == {3: (1, 0xFFFF)}
    assert [(a.time_ns, a.value) for a in actions if a.do == "analog"] == [(0, (3, 1, 0xFFFF)),
                                                                         (10**9, (3, 1, 0xFFFE))]
    assert [(a.slaves, a.value) for a in actions if a.do == "contacts"] == [((4,), 0)]
    expect = plant.checks[-1]
    assert (expect.lpf, expect.suspects, expect.parameters) == (frozenset(), {2}, {2: 5})
    assert expect.analog == {2: (0xFFFE, "invalid")} and expect.received == {1: (1, "any")}
    assert expect.log == (Logged(LogEvent.ADDRESSED, 37, 0), Logged(LogEvent.APF))


def test_functions_of_a_rich_plant():
    """PL-001, FN-020, FN-030, EX-033: a function has number, arguments and an expected end; names know its letters."""
    plant = parse_plant(RICH, "r.toml")
    clear, change, read, codes = plant.functions
    assert (clear.code, clear.first, clear.time_ns) == (33, 3, 0)
    assert (change.code, change.first, change.second, change.status) == (20, 37, 7, Status.ADDRESS_USED)
    assert (read.code, read.first, read.answer, read.status) == (30, 4, bytes.fromhex("00B703"), 0)
    assert (codes.code, codes.first, codes.second) == (8, 9, 0xFF13)
    assert change.text == "change_address 5B 7A" and codes.text == "set_permanent_configuration 9 S-3.1.F ID1 F"
    assert [(a.time_ns, a.value) for a in plant.actions() if a.do == "function"] == [
        (0, 0), (1_100_000_000, 1), (1_200_000_000, 2), (1_300_000_000, 3)]
    assert plant.name_of(7) == "7A" and plant.name_of(9) == "9"
    assert [f.time_ns for f in plant.with_settle(20_000_000).functions] == [0, 120_000_000, 220_000_000, 320_000_000]


def test_a_replacement_is_a_slave_more():
    """PL-001: the new slave has address 0, the same profile and options, and is an A slave from the factory."""
    plant = parse_plant(RICH, "r.toml")
    old, new = plant.slaves[3], plant.slaves[-1]
    assert (new.name, new.index, new.present, new.options) == ("Mux (new)", 0, False, old.options)
    assert (old.codes.id1, new.codes.id1) == (15, 7) and new.codes.profile == old.codes.profile
    deeds = [(a.time_ns, a.do, a.slaves) for a in plant.actions() if a.time_ns >= 1_400_000_000 and a.slaves != (0,)]
    assert deeds == [(1_400_000_000, "drop", (3,)), (1_400_000_000, "connect", (7,)),
                     (1_500_000_000, "contacts", (4,)), (1_600_000_000, "periphery_fault", (7,))]
    everyone, = (a for a in parse_plant(RICH.replace('do = "contacts"\nslave = "Door"\nvalue = []',
                                                     'do = "quiet"\nslave = "all"')).actions() if a.do == "quiet")
    assert everyone.slaves == tuple(range(7))   # the replacement comes by its own event only


RICH_WRONG = [
    ('values = [-2,', 'values = [-32769,', "slave #1 (In).values #1: -32769 is not a 16-bit value"),
    ('values = [-2,', 'values = [true,', "slave #1 (In).values #1: True is not a 16-bit value"),
    ('values = [-2,', 'values = [1, 2,', "slave #1 (In).values: 3 channels, S-7.3.D has 2"),
    ('[{ at = "10ms", value = 5 }]]', '2]', "slave #1 (In).repeat: neither inputs nor one of values is a list"),
    ('value = 5 }', 'value = 5 }, { at = "1ms", value = 6 }', "slave #1 (In).values #2 #2.at: not later than"),
    ('invalid = [2]', 'invalid = [3]', "slave #1 (In).invalid: [3] is not a list of numbers 1 to 2"),
    ('invalid = [2]', 'invalid = 2', "slave #1 (In).invalid: 2 is not a list of numbers 1 to 2"),
    ('"S-7.3.5"\n', '"S-7.3.5"\nvalues = [1]\n', "slave #2 (Out).values: S-7.3.5 has no 16-bit inputs"),
    ('"S-7.3.5"\n', '"S-7.3.5"\noverflow = [1]\n', "slave #2 (Out).overflow: S-7.3.5 sends no valid and overflow"),
    ('"S-7.3.5"\n', '"S-6.0.B"\nvalues = [1]\n', "slave #2 (Out).values: S-6.0.B has no 16-bit inputs: give each"),
    ('id = "00 B7 03"', 'id = "00 B7 3"', "slave #3 (Meter).strings.id: '00 B7 3' is not a string of bytes"),
    ('id = "00 B7 03"', '"1" = "00"', "slave #3 (Meter).strings.'1': S-7.4.C has no such string"),
    ('"17" = "01"', '"256" = "01"', "slave #7 (Drive).strings.'256': S-7.5.5 has no such string"),
    ('write_time = "100ms"', 'write_time = "2s"', "slave #3 (Meter).write_time: longer than 1s"),
    ('id1_locked = true', 'id1_locked = 1', "slave #4 (Mux).id1_locked: 1 is not true or false"),
    ('closed = [2]', 'closed = [3]', "slave #5 (Door).safety.closed: [3] is not a list of numbers 1 to 2"),
    ('closed = [2]', 'table = ["0001"]', "slave #5 (Door).safety.table: "),
    ('"S-0.B"', '"S-0.0"', "slave #5 (Door).safety: S-0.0.F is no safety slave"),
    ('old = true', 'old = true\nid1 = "3"', "slave #6 (Old).old: a slave without ID1 and ID2 is no A/B slave"),
    ('slave = "Mux"', 'slave = "all"', "event #1.slave: 'all' cannot be replaced"),
    ('slave = "Mux"', 'slave = "Mux"\nrepeat = "1s"', "event #1.repeat: a slave is replaced once"),
    ('slave = "Mux"', 'slave = "Mux"\nvalue = 1', "event #1.value: 'replace' takes no value"),
    ('do = "contacts"\nslave = "Door"\nvalue = []', 'do = "replace"\nslave = "Mux"',
     "event #2.slave: 'Mux' is replaced twice"),
    ('value = []', 'value = [0]', "event #2.value: [0] is not a list of numbers 1 to 2"),
    ('slave = "Door"', 'slave = "Old"', "event #2.slave: not a safety slave"),
    ('auto_clear = 3', 'auto_clear = 4', "host.auto_clear: 4: must be less than or equal to 3"),
    ('auto_clear = 3', 'auto_clear = 3\nauto_address = true', "host.auto_clear: goes with neither automatic ad"),
    ('address = "3"\nvalues = [1', 'address = "2"\nvalues = [1', "host.analog #1.address: the slave at 2 has no 16"),
    ('address = "3"\nvalues = [1', 'address = "30"\nvalues = [1', "host.analog #1.address: no slave of this plant has"),
    ('values = [1, [{ at = "0s"', 'values = [1, 1, [{ at = "0s"', "host.analog #1.values: 3 channels, the slave has 2"),
    ('new = "7A"\n', "", "host.function #1.new: missing"),
    ('new = "7A"\n', 'new = "7A"\nvalue = 1\n', "host.function #1.value: 'change_address' takes no value"),
    ('"ADDRESS_USED"', '"USED"', "host.function #1.result: 'USED' is not 'OK' or an error: ARG, STATE"),
    ('new = "7A"\n', 'new = "7A"\ndata = "1"\n', "host.function #1.data: 'change_address' answers with no nibble"),
    ('new = "7A"\n', 'new = "7A"\nanswer = "01"\n', "host.function #1.answer: 'change_address' answers with no str"),
    ('"read_id_string"', '"read_id"', "host.function #2.do: 'read_id': must be 'set_permanent_parameter'"),
    ('do = "read_id_string"\naddress = "4"\nanswer = "00 b7 03"', 'do = "execute"\naddress = "4"\nvalue = "1"',
     "host.function #2.value: '1' is not five binary digits I4..I0"),
    ('do = "read_id_string"\naddress = "4"\nanswer = "00 b7 03"', 'do = "write_id1"\nvalue = "2222"',
     "host.function #2.value: '2222' is not a nibble"),
    ('do = "read_id_string"\naddress = "4"\nanswer = "00 b7 03"', 'do = "set_auto_clear"\nvalue = 4',
     "host.function #2.value: 4 is not a number 0 to 3"),
    ('profile = "S-3.1"\n', "", "host.function #3.profile: missing: give a profile, or io and id"),
    ('suspects = ["2"]', 'suspects = "2"', "expect.suspects: '2' is not a list of addresses"),
    ('"2" = "0101"', '"x" = "0101"', "expect.parameters.'x': 'X' is not an AS-i address"),
    ('[-2, "invalid"]', '[-2, "bad"]', "expect.analog.2 #2: 'bad' is not a 16-bit value, 'invalid' or 'any'"),
    ('[-2, "invalid"]', '[1, 2, 3, 4, 5]', "expect.analog.'2': 5 channels, must be 1 to 4"),
    ('[-2, "invalid"]', '[]', "expect.analog.'2': 0 channels, must be 1 to 4"),
    ('analog = { "2"', 'analog = { "0"', "expect.analog.'0': address 0 has no 16-bit values"),
    ('id = "00 B7 03"', 'id = "00 B7"', "slave #3 (Meter).strings.'id': 2 bytes, must be sequences of 3, at most 219"),
    ('id = "00 B7 03"', f'id = "{"00 B7 03 " * 74}"', "slave #3 (Meter).strings.'id': 222 bytes, must be sequences"),
    ('id = "00 2A 00 01 22"', 'id = "00 2A 00 01"', "slave #7 (Drive).strings.'id': 4 bytes, an ID object has 5"),
    ('values = [1, [{ at = "0s"', 'values = []  # [[{ at = "0s"', "host.analog #1.values: empty list"),
    ('do = "read_id_string"\naddress = "4"\nanswer = "00 b7 03"', 'do = "set_auto_clear"\nvalue = 1.0',
     "host.function #2.value: 1.0 is not a number 0 to 3"),
    ('"Out" = [1, "any"]', '"In" = [1]', "expect.received.'In': not one slave with that many outputs"),
    ('"Out" = [1, "any"]', '"Gone" = [1]', "expect.received.'Gone': no slave is called 'Gone'"),
    ('{ event = "apf" }', '{ event = "APF" }', "expect.log #2.event: 'APF' is not an event: start, phase, offline"),
    ('data = 0 }', 'data = -1 }', "expect.log #1.data: -1: must be greater than or equal to 0"),
    ('address = "5B", data', 'address = 5, data', "expect.log #1.address: 5 is not an address: write it in quotes"),
]


@pytest.mark.parametrize("old, new, line", RICH_WRONG, ids=[line[:50] for *_, line in RICH_WRONG])
def test_each_fault_of_a_rich_plant_has_its_line(old, new, line):
    """PL-001: one line for one fault of values, strings, options, functions and expectations: file, key, reason."""
    assert RICH.count(old) == 1
    lines = faults(RICH.replace(old, new))
    assert lines[0].startswith(f"p.toml: {line}") and len(lines) == 1, lines


def test_bytes_and_numbers():
    """PL-001: strings are pairs of hexadecimal digits, at most 224 bytes; channels count from 1."""
    assert parse_bytes(" 0a FF\n01") == b"\x0a\xff\x01" and len(parse_bytes("00" * 224)) == 224
    for bad in ("", "0", "0 1", "0G", 10, None, "00" * 225):
        with pytest.raises(ValueError):
            parse_bytes(bad)
    assert parse_numbers([3, 1, 3], 4) == 0b101 and parse_numbers([], 2) == 0


def test_all_faults_are_reported_together():
    """PL-001: several faults give several lines."""
    lines = faults(GOOD.replace('slave = "7"', 'slave = "8"').replace('las = ["5A", "5B"]', ""))
    assert lines == ["p.toml: event #1.slave: no slave has address 8", "p.toml: check #1: empty: nothing to check"]


def test_conflicts_are_allowed_on_request():
    """PL-001: two slaves on one address are refused unless the plant says that it means it."""
    text = GOOD.replace('address = "5B"', 'address = "5A"').replace("seed = 5", "seed = 5\nconflicts = true")
    assert [s.index for s in parse_plant(text).slaves] == [5, 5, 7]
    assert "several slaves have address 5A: use the name" in faults(text.replace('slave = "7"', 'slave = "5A"'))[0]


def test_files_that_are_no_plants(tmp_path):
    """PL-001: a missing file, a folder, bytes that are no text and bottomless nesting are one line each."""
    (tmp_path / "bytes.toml").write_bytes(b"name = \"\xff\"")
    (tmp_path / "deep.toml").write_text("a=" + "[" * 100_000)
    (tmp_path / "number.toml").write_text("a=" + "9" * 100_000)
    for name, reason in (("gone.toml", "No such file or directory"), ("", "Is a directory"),
                         ("bytes.toml", "not UTF-8 text"), ("deep.toml", "nested too deeply"),
                         ("number.toml", "not TOML")):
        with pytest.raises(PlantError) as caught:
            load_plant(tmp_path / name)
        line, = caught.value.lines
        assert line.startswith(f"{tmp_path / name}: file: {reason}")


def to_toml(value):
    """A TOML value of plain Python data, as far as the tests below need it."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {to_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(to_toml, value)) + "]"
    if isinstance(value, str):
        return json.dumps(value).replace("\\ud", "\\u0")  # no lone surrogates in TOML
    if isinstance(value, float):
        return repr(value).replace("e+", "e")
    return str(value).lower() if isinstance(value, bool) else str(value)


SCALARS = st.one_of(st.integers(-2**70, 2**70), st.booleans(), st.floats(), st.text(max_size=8),
                    st.sampled_from(["5", "5A", "31B", "0", "1-31", "all", "S-7.A", "1s", "-1us", "0011", "F"]))
KEYS = st.sampled_from(["at", "do", "slave", "value", "address", "profile", "name", "inputs", "repeat", "values",
                        "strings", "string", "new", "invalid", "safety", "log", "x y", ""])
VALUES = st.recursive(SCALARS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3),
                      max_leaves=6)


def spots(data, path=()):
    """Every place in nested data."""
    yield path
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, item in items:
        yield from spots(item, (*path, key))


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_no_malformed_plant_makes_a_traceback(data):
    """PL-001: a plant with any value replaced, removed or added is loaded or refused in lines, never a traceback."""
    import tomllib
    plant = copy.deepcopy(tomllib.loads(data.draw(st.sampled_from([GOOD, RICH]))))
    for _ in range(data.draw(st.integers(1, 3))):
        *path, last = data.draw(st.sampled_from([p for p in spots(plant) if p]))
        place = plant
        for key in path:
            place = place[key]
        deed = data.draw(st.sampled_from(["replace", "remove", "add"]))
        if deed == "remove":
            del place[last]
        elif deed == "add" and isinstance(place, dict):
            place[data.draw(KEYS)] = data.draw(VALUES)
        else:
            place[last] = data.draw(VALUES)
    text = "\n".join(f"{json.dumps(key)} = {to_toml(value)}" for key, value in plant.items())
    try:
        parse_plant(text, "p.toml")
    except PlantError as error:
        assert error.lines
        for line in error.lines:
            assert line.startswith("p.toml: ") and line.count(": ") >= 2 and len(line.splitlines()) == 1


@settings(max_examples=200, deadline=None)
@given(st.text(max_size=60))
def test_no_text_makes_a_traceback(text):
    """PL-001: any text at all is a plant or a line."""
    with pytest.raises(PlantError) as caught:
        parse_plant(text, "p.toml")
    assert all(len(line.splitlines()) == 1 for line in caught.value.lines)


def test_a_byte_order_mark_is_no_fault(tmp_path):
    """PL-001: some editors write one before the text."""
    path = tmp_path / "mark.toml"
    path.write_bytes(b"\xef\xbb\xbf" + SHIPPED[0].read_bytes())
    assert load_plant(path).name == load_plant(SHIPPED[0]).name


def test_the_shipped_plants():
    """PL-004: the plants that are shipped are good and say what to expect of lists and flags."""
    assert [path.stem for path in SHIPPED] == ["combined", "extended62", "faults", "packaging", "replacement",
                                               "standard31"]
    plants = {path.stem: load_plant(path) for path in SHIPPED}
    for plant in plants.values():
        expect = plant.checks[-1]
        assert plant.description and None not in (expect.lds, expect.las, expect.lps) and len(expect.flags) >= 6
        assert expect.lps == plant.host.pcd.keys()
    assert [s.index for s in plants["standard31"].slaves] == list(range(1, 32))
    assert {s.index for s in plants["extended62"].slaves} == {*range(1, 32), *range(33, 64)}
    profiles = {s.codes.profile[:5] for s in plants["packaging"].slaves}
    assert profiles == {"S-0.0", "S-3.0", "S-7.0", "S-8.0", "S-0.A", "S-3.A", "S-7.A"}
    assert {a.do for a in plants["faults"].actions()} >= {"drop", "connect", "noise", "quiet", "power_off", "power_on"}
    kinds = {slave.kind.name for slave in plants["combined"].slaves}
    assert kinds == {"CTT1", "CTT2", "CTT3", "CTT5", "plain", "safety"}
    assert plants["replacement"].host.auto_address and plants["replacement"].slaves[-1].index == 0
