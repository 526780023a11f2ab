# SPDX-License-Identifier: Apache-2.0
"""From the slaves of a plant to those of the models; no simulator. What they then do on the RTL: cocotb_tests/top."""
from pathlib import Path

import pytest
from asi.plant import Faults, load_plant, parse_plant

from cocotb_tests.models.plants import make_faults, make_slave

PLANTS = sorted((Path(__file__).resolve().parents[2] / "sim/plants").glob("*.toml"))
EVERYTHING = """
name = "Everything a slave can be told"
description = "-"
duration = "1s"

[[slave]]
address = "1"
profile = "S-7.3.D"
values = [0x1234, -1]
invalid = [1]
overflow = [2]
watchdog = true
write_time = "100ms"
write_fails = true

[[slave]]
address = "2"
profile = "S-7.B.F"
inputs = "0110"
safety = { table = ["1", "2", "4", "8", "3", "5", "9", "6"], closed = [2] }
old = true

[[slave]]
address = "3B"
profile = "S-7.A.5"
strings = { id = "01 02 03 04 22", 7 = "AA" }
sel_at_zero = true
id1_locked = true
present = false

[expect]
lds = ["1"]
"""


def test_everything_arrives():
    """PL-004, SL-009, SL-010: every key of a slave in a plant reaches its model."""
    one, two, three = map(make_slave, parse_plant(EVERYTHING).slaves)
    assert (one.ctt.values[:2], one.ctt.invalid, one.ctt.overflow) == ([0x1234, 0xFFFF], 1, 2)
    assert one.watchdog and one.write_ns == 100_000_000 and one.write_fails and one.plugged and not one.old
    assert two.ctt.words == (1, 2, 4, 8, 3, 5, 9, 6) and two.ctt.closed == 2 and two.inputs == 6 and two.old
    assert three.address == 35 and three.ctt.strings == {0: bytes((1, 2, 3, 4, 0x22)), 7: b"\xAA"}
    assert three.sel_at_zero and three.id1_locked and not three.plugged


@pytest.mark.parametrize("path", PLANTS, ids=lambda path: path.stem)
def test_shipped_plants(path):
    """PL-004: every slave of every plant has a model with its codes, and values exactly where the plant gives some."""
    for slave in load_plant(path).slaves:
        made, codes = make_slave(slave), slave.codes
        assert (made.address, made.io, made.id, made.id1, made.id2) == (
            slave.index, codes.io, codes.id, codes.id1, codes.id2), slave.name
        assert (made.inputs, made.watchdog, made.plugged) == (slave.inputs, slave.watchdog, slave.present)
        assert not slave.values or made.ctt.values[:len(slave.values)] == list(slave.values), slave.name


def test_faults():
    """PL-004: probabilities of 1/65536 and times."""
    made = make_faults(Faults(no_answer=65_536 // 2, shifted_pulse=65_535, shift_ns=-700, delay_ns=9))
    assert (made.no_answer, made.parity, made.shifted_pulse) == (0.5, 0, 65_535 / 65_536)
    assert (made.shift_ns, made.delay_ns) == (-700, 9)
