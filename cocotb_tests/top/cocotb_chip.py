# SPDX-License-Identifier: Apache-2.0
"""The whole chip with its firmware (settle time 20 ms) on the Python models."""
from itertools import pairwise
from pathlib import Path

import cocotb
from asi.plant import load_plant, parse_plant
from asi.regmap import ErrorClass, Phase
from asi.telegram import decode_call, encode_call
from cocotb.triggers import RisingEdge, Timer

from cocotb_tests.models.chip import MAGIC, MASTER, Chip
from cocotb_tests.models.plants import Player
from cocotb_tests.models.slaves import Slave

PLANTS = Path(__file__).resolve().parents[2] / "sim/plants"
SETTLE_NS = 20_000_000          # of the test image
MS = 1_000_000


async def play(dut, name):
    """A plant with all its actions, functions and checks. Nobody else sends: no request on the line may be bad."""
    player = Player(dut, load_plant(PLANTS / f"{name}.toml").with_settle(SETTLE_NS))
    await player.play()
    assert player.log.counts.total.requests and not player.log.counts.broken_requests
    return player


async def running(dut, *slaves, min_las=None):
    """A chip in configuration mode that has activated all its slaves."""
    chip = Chip(dut, slaves)
    await chip.reset()
    wanted = {s.address for s in slaves if s.plugged and s.address} if min_las is None else min_las
    await chip.host.until(lambda: _las_is(chip, wanted), 120_000, "activation")
    chip.telegrams()
    return chip


async def _las_is(chip, wanted):
    return await chip.host.indices("LAS") == wanted


async def codes_of(chip, *indices):
    return {index: await chip.host.read("CDI", index) for index in indices}


@cocotb.test(timeout_time=1_500, timeout_unit="ms")
async def plant_standard31(dut):
    """PL-004: 31 standard slaves reach the state the plant promises."""
    await play(dut, "standard31")


@cocotb.test(timeout_time=1_500, timeout_unit="ms")
async def plant_extended62(dut):
    """PL-004, LK-002: 62 A/B slaves reach the state the plant promises."""
    await play(dut, "extended62")


@cocotb.test(timeout_time=1_500, timeout_unit="ms")
async def plant_packaging(dut):
    """PL-004, EX-009, EX-016, EX-017, EX-018: a missing, an extra and an unaddressed slave in protected mode."""
    await play(dut, "packaging")


@cocotb.test(timeout_time=2_500, timeout_unit="ms")
async def plant_faults(dut):
    """PL-004, EX-015, EX-012, EX-013, EX-021: drop-out and return, noise, a short dip and a power failure."""
    await play(dut, "faults")


@cocotb.test(timeout_time=2_500, timeout_unit="ms")
async def plant_combined(dut):
    """PL-004, SL-009, CT-001: values, strings, messages and safety words of every kind of slave, both ways."""
    await play(dut, "combined")


@cocotb.test(timeout_time=2_500, timeout_unit="ms")
async def plant_replacement(dut):
    """PL-004, FN-020: change_address, parameters and automatic addressing of a replaced slave."""
    await play(dut, "replacement")


WRONG = """
name = "Wrong on purpose"
description = "Every kind of expectation is missed once."
duration = "1200ms"

[host]
mode = "protected"
analog = [{ address = "3", values = [7] }]

[[host.function]]
at = "1090ms"
do = "write_parameter"
address = "9"
value = "0101"

[[slave]]
address = "1"
profile = "S-7.3.D"
values = [1, 2]

[[slave]]
address = "2"
profile = "S-0.B.0"

[[slave]]
address = "3"
profile = "S-7.3.4"

[[event]]
at = "1090ms"
do = "overflow"
slave = "1"
value = [1]

[[event]]
at = "1090ms"
do = "contacts"
slave = "2"
value = []

[[event]]
at = "1090ms"
do = "replace"
slave = "3"

[[check]]
at = "1090ms"
analog = { "1" = [1, 9] }
received = { "3" = [8] }
log = [{ event = "auto_clear" }]

[expect]
las = ["1-3"]
inputs = { "2" = "0001" }
analog = { "1" = ["any", 2] }
flags = { lds0 = false }
"""


@cocotb.test(timeout_time=300, timeout_unit="ms")
async def plant_that_is_wrong(dut):
    """PL-004: a plant on the RTL is not met without its values, flags, lists, log and functions, each named."""
    player = Player(dut, parse_plant(WRONG).with_settle(SETTLE_NS))
    try:
        await player.play()
    except AssertionError as error:
        said = str(error).splitlines()[0]       # pytest adds the parts again
    else:
        raise AssertionError("nothing was missed")
    for part in ("check at 110 ms not met: value 1 channel 2 is 0002 (2), expected 0009 (9)",
                 "slave #3 channel 1 received 0007 (7), expected 0008 (8)", "log: no auto_clear",
                 "write_parameter 9 0101: NOT_ACTIVE, expected OK", "LAS missing: 3", "lds0 is 1, expected 0",
                 "input 2 is 0000, expected 0001"):
        assert part in said, f"{part!r} is not in {said!r}"
    assert "value 1 channel 1" not in said and said.count("not met") == 3


@cocotb.test(timeout_time=300, timeout_unit="ms")
async def full_cycle(dut):
    """LK-001, LK-011, LK-012, LK-013, LT-004, LT-005: 31 slaves: order, cycle <= 4.95 ms, jitter and gaps in clocks."""
    chip = Chip(dut, [Slave(n, inputs=n & 15) for n in range(1, 32)])
    await chip.reset()
    await chip.host.until(lambda: _las_is(chip, set(range(1, 32))), 120_000, "activation")
    chip.telegrams()
    syncs = []
    for _ in range(12):
        await RisingEdge(dut.sync_o)
        syncs.append(chip.pins.now())
    periods = [b - a for a, b in pairwise(syncs)]
    assert max(periods) <= 4_950_000, periods
    records = [r for r in chip.telegrams() if r.t_ns >= syncs[1]]
    # one extra call per cycle: the inclusion probes an address that nobody has, or a status is read
    numbers = [r.call >> 5 & 31 for r in records]
    starts = [k for k, r in enumerate(records) if decode_call(r.call).name == "DEXG" and numbers[k] == 1]
    equal = {}                          # periods by what became of the extra call
    for (a, b), period in zip(pairwise(starts), periods[1:]):
        assert numbers[a:a + 31] == list(range(1, 32)) and b - a == 32, numbers[a:b]
        extra = records[b - 1]
        equal.setdefault(extra.error_class, []).append(period)
        assert (decode_call(extra.call).name == "RDST") == (extra.error_class is ErrorClass.OK), extra
    assert equal.keys() == {ErrorClass.OK, ErrorClass.NO_RESPONSE}
    assert all(max(same) - min(same) <= 62.5 for same in equal.values()), equal
    for a, b in pairwise(records):      # P_GAP_OK after an answer, P_GAP_NORSP after the time-out, to the clock
        assert round(b.t_ns - a.t_ns, 3) == (154_000 if a.error_class is ErrorClass.OK else 150_000), (a, b)
    assert {r.error_class for r in records} <= {ErrorClass.OK, ErrorClass.NO_RESPONSE}
    assert (await chip.host.inputs())[1:32] == [n & 15 for n in range(1, 32)]


@cocotb.test(timeout_time=600, timeout_unit="ms")
async def dropout_and_return(dut):
    """EX-012, EX-013, EX-015, LK-003, LK-004, LK-005: an unplugged slave is called six times, leaves, returns."""
    slave = Slave(7, inputs=9)
    chip = await running(dut, Slave(3, inputs=5), slave)
    assert (await chip.host.inputs())[7] == 9
    chip.settle()
    chip.net.set_present(slave, False)
    chip.telegrams()
    await chip.host.until(lambda: _las_is(chip, {3}), 20_000, "removal", step_us=100)
    # the image is published with the cycle: give it one
    await Timer(3, "ms")
    assert await chip.host.indices("LDS") == {3} and await chip.host.read("CDI", 7) == 0xFFFF
    assert (await chip.host.inputs())[7] == 0 and (await chip.host.inputs())[3] == 5
    calls = [r for r in chip.telegrams() if decode_call(r.call).name == "DEXG" and r.call >> 5 & 31 == 7]
    bad = [r for r in calls if r.error_class is not ErrorClass.OK]
    assert len(bad) == 6 and [r.repeated for r in bad] == [False, True] * 3
    chip.settle()
    chip.net.set_present(slave, True)
    await chip.host.until(lambda: _las_is(chip, {3, 7}), 200_000, "return")
    await Timer(3, "ms")
    assert await chip.host.indices("LDS") == {3, 7} and (await chip.host.inputs())[7] == 9


@cocotb.test(timeout_time=600, timeout_unit="ms")
async def mode_change(dut):
    """EX-009, EX-016, EX-023, HW-002: to protected mode and back; only what is projected rightly is activated."""
    chip = await running(dut, Slave(3, io=7), Slave(4, io=0), Slave(37, io=7, id=0xA, id1=15))
    window = chip.host
    assert "configuration_active" in await window.flags()
    codes = await codes_of(chip, 3, 4, 37)
    await window.project({3: codes[3], 4: codes[4] ^ 1, 9: 0xFFF7})
    await window.control(protected_mode=1)
    chip.telegrams()
    assert await window.commit() == 0
    await window.until(lambda: _las_is(chip, {3}), 200_000, "protected mode")
    flags = await window.flags()
    assert not flags & {"config_ok", "configuration_active"} and "normal_operation_active" in flags
    assert await window.indices("LDS") == {3, 4, 37} and await window.indices("LPS") == {3, 4, 9}
    assert Phase.DETECTION in {r.phase for r in chip.telegrams()}       # it passed through OFFLINE and started again
    await window.project(codes)
    assert await window.commit() == 0
    await window.until(lambda: _las_is(chip, {3, 4, 37}), 200_000, "all projected")
    await Timer(5, "ms")
    assert "config_ok" in await window.flags()
    await window.control(protected_mode=0)
    assert await window.commit() == 0
    await window.until(lambda: _las_is(chip, {3, 4, 37}), 200_000, "configuration mode")
    assert "configuration_active" in await window.flags()


@cocotb.test(timeout_time=600, timeout_unit="ms")
async def power_dip(dut):
    """EX-001, EX-021, LT-010, LT-011: no telegram starts while APF is set; then the master starts by itself."""
    chip = await running(dut, Slave(3, inputs=5), Slave(5, io=8))
    requests = []
    chip.line.listen(lambda p: p.sender == MASTER and requests.append(p.t_ns))
    chip.supply(False)
    fell = chip.pins.now()
    await Timer(40, "ms")
    assert requests and requests[-1] < fell + 1_000_000 + 100_000   # P_APF_ON and what was being sent
    flags = await chip.host.flags()
    assert "apf" in flags and "normal_operation_active" not in flags
    assert await chip.host.indices("LAS") == set() == await chip.host.indices("LDS")
    assert not any(await chip.host.inputs())
    requests.clear()
    chip.supply(True)
    back = chip.pins.now()
    await chip.host.until(lambda: _las_is(chip, {3, 5}), 200_000, "second start")
    assert requests[0] >= back + 10_000_000         # P_APF_OK
    assert "apf" not in await chip.host.flags()
    await Timer(3, "ms")
    assert (await chip.host.inputs())[3] == 5


@cocotb.test(timeout_time=300, timeout_unit="ms")
async def commits(dut):
    """HW-001, HW-002, HW-004: a commit is applied once and completely, and acknowledged; lists show the last cycle."""
    chip = await running(dut, Slave(3, io=7))
    window = chip.host
    assert await window.read("MAGIC") == MAGIC
    assert await window.read("FW_SEQ") == await window.read("HOST_SEQ") == 0
    await window.write_indices("LPS_CFG", {3, 40})
    await window.write("PP", 5, 3)
    await Timer(5, "ms")
    assert await window.indices("LPS") == set()         # nothing happens without a commit
    assert await window.commit() == 0
    assert await window.read("FW_SEQ") == 1 and await window.indices("LPS") == {3, 40}
    first = await window.read("CYCLES")
    await Timer(10, "ms")
    assert await window.read("CYCLES") > first and await window.read("SENT") > 0


@cocotb.test(timeout_time=300, timeout_unit="ms")
async def images(dut):
    """HW-003, HW-005, HW-006, CA-001, CA-005: outputs arrive inverted, inputs come with one interrupt per image."""
    slave, ab = Slave(3, io=7, inputs=0b0110), Slave(37, io=7, id=0xA, id1=15, inputs=0b1001)
    chip = await running(dut, slave, ab)
    window = chip.host
    await window.set_output(3, 0b1010)
    await window.set_output(37, 0b0011)
    await Timer(8, "ms")
    assert (slave.outputs, ab.outputs) == (0b0101, 0b1100)
    inputs = await window.inputs()
    assert (inputs[3], inputs[37], sum(inputs)) == (0b0110, 0b1001, 15)
    await window.write("IRQ_ACK", 1)
    raised = 0
    before = await window.read("IN_SEQ")
    for _ in range(5):
        if not int(dut.host_irq_o.value):
            await RisingEdge(dut.host_irq_o)
        raised += 1
        await window.write("IRQ_ACK", 1)
        assert int(dut.host_irq_o.value) == 0
    after = await window.read("IN_SEQ")
    assert after // 2 - before // 2 in (raised, raised + 1), (before, after, raised)


@cocotb.test(timeout_time=300, timeout_unit="ms")
async def activation_calls(dut):
    """EX-003, EX-008, CA-002: WPAR with the parameter, then DEXG with F; nothing before the settle time."""
    chip = Chip(dut, [Slave(3, inputs=1)])
    await chip.reset()
    await chip.host.write("PP", 5, 3)
    assert await chip.host.commit() == 0
    await chip.host.until(lambda: _las_is(chip, {3}), 120_000, "activation")
    while await chip.host.read("IN_SEQ") & 1:      # LAS stands before PECHO in a publication (HW-003)
        pass
    records = chip.telegrams()
    assert records[0].t_ns >= SETTLE_NS - MS
    to_3 = [r.call for r in records if decode_call(r.call).name in ("WPAR", "DEXG") and r.call >> 5 & 31 == 3]
    assert to_3[1] == encode_call("DEXG", 3, 15) and decode_call(to_3[0]).name == "WPAR"
    assert await chip.host.read("PECHO", 3) == to_3[0] & 15 == await chip.host.read("PI", 3)
