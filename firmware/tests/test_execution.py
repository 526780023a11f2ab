# SPDX-License-Identifier: Apache-2.0
"""Execution control, rule by rule: the core over a fake sequencer with simulated slaves."""
import pytest
from fake_line import (ACTIVATION, DATA_EXCHANGE, DETECTION, OFFLINE, SETTLE_US, Master, PeripheralSlave, Slave,
                       name_of, projection)

from asi.telegram import encode_call

BAD_ARG, BAD_STATE = -1, -2
SLAVE0, AUTO_CLEAR, AUTO_CLEAR_MODE = -6, -19, -20


def std(index, **kw):
    return Slave(index, **kw)


def ab(index, **kw):
    return Slave(index, id=0xA, **kw)


def full_network():
    return [ab(i, io=i & 15, id1=i >> 2 & 15, id2=i & 7) for i in (*range(1, 32), *range(33, 64))]


# ------------------------------------------------------------------------------------------ OFFLINE
def test_offline_shows_nothing():
    """EX-001: OFFLINE has no telegrams, empty lists, CDI F, inputs 0, line outputs F, and sets Offline_Ready."""
    m = Master([std(3, inputs=9), ab(4, inputs=5), ab(36)])
    m.host_outputs = [15] * 64
    m.start().cycles(2)
    assert m.read()["in"][3] == 9 and list(m.port.out) != [0xFFFFFFFF] * 8
    m.set_offline(True)
    sent = len(m.log)
    for _ in range(20):
        m.step()
    s = m.read()
    assert s["phase"] == OFFLINE == m.port.phase and len(m.log) == sent and not m.port.line and not m.port.cycle
    assert not s["lds"] and not s["las"] and not s["lpf"] and s["cdi"] == [0xFFFF] * 64 and s["in"] == [0] * 64
    assert list(m.port.out) == [0xFFFFFFFF] * 8 and not any(m.port.active)
    assert "offline_ready" in s["flags"] and "normal_operation_active" not in s["flags"]
    m.set_offline(False)
    m.until(lambda s: s["phase"] == DATA_EXCHANGE)
    assert m.read()["lds"] == {3, 4, 36} and "offline_ready" not in m.read()["flags"]


def test_parameters_taken_at_power_up_only():
    """EX-002: PI := PP when OFFLINE ends after power-up; a later projection and OFFLINE keep PI."""
    m = Master([std(3)], parameters={3: 6})
    m.project([], {3: 9})  # still power-up: the newest counts
    m.start()
    assert m.read()["pi"][3] == 9 and m.slaves[0].parameter == 9
    m.project([], {3: 2})
    m.set_offline(True)
    m.tick()
    m.set_offline(False)
    m.until(lambda s: s["phase"] == DATA_EXCHANGE)
    assert m.read()["pi"][3] == 9 and m.slaves[0].parameter == 9


def test_settle_after_power_up():
    """EX-003: the first pass starts P_PWR_SETTLE after power-up, not before; the wait starts over when power fails."""
    m = Master([std(3)])
    m.tick(SETTLE_US - 1)
    for _ in range(5):
        m.tick(0)
    assert m.read()["phase"] == OFFLINE and "offline_ready" in m.read()["flags"]
    m.power(True)
    m.tick(10 * SETTLE_US)
    m.power(False)
    m.tick(SETTLE_US - 1)
    assert m.read()["phase"] == OFFLINE
    m.tick(1)
    assert m.read()["phase"] == DETECTION and m.log == []


def test_no_second_settle():
    """EX-003: a later OFFLINE ends at once when neither the host nor the power fail holds it; each of them does."""
    m = Master([std(3)]).start()
    m.power(True)
    m.set_offline(True)
    m.power(False)
    for _ in range(5):
        m.tick()
    assert m.read()["phase"] == OFFLINE
    m.set_offline(False)
    m.power(True)
    for _ in range(5):
        m.tick()
    assert m.read()["phase"] == OFFLINE
    m.power(False)
    m.tick()
    assert m.read()["phase"] == DETECTION


def test_offline_waits_for_the_sequencer():
    """EX-001, EX-003: DETECTION does not start, nor is Offline_Ready set, while an old cycle is still running."""
    m = Master([std(3)]).start()
    m.set_offline(True)
    m.set_offline(False)
    for _ in range(5):
        m.lib.fw_tick(1000)  # without the drain of m.tick()
    assert m.read()["phase"] == OFFLINE and "offline_ready" not in m.read()["flags"]
    m.until(lambda s: s["phase"] == DATA_EXCHANGE)
    assert m.port.violations == 0


# ------------------------------------------------------------------------------------------ DETECTION
def test_detection_reads_everything():
    """EX-004, EX-006: mixed network with a lone B slave, two pairs and slave 0: LDS and CDI hold what answers."""
    slaves = [std(1, io=3, id=5, id1=1, id2=2), ab(7, io=1, id1=2, id2=3), ab(39, io=4, id1=5, id2=6), ab(60, io=0xB),
              std(31, io=8), std(0, io=2, id=4)]
    m = Master(slaves)
    m.settle()
    m.until(lambda s: s["phase"] == ACTIVATION)
    s = m.read()
    assert s["lds"] == {0, 1, 7, 31, 39, 60}
    assert {i: s["cdi"][i] for i in s["lds"]} == {x.index: x.codes for x in slaves}
    assert all(s["cdi"][i] == 0xFFFF for i in range(64) if i not in s["lds"])
    assert s["changed"] >= s["lds"] and "lds0" in s["flags"]


def test_detection_order():
    """EX-004, EX-006: RDIO for 0..31, RDID, RID1 and RID2 of those that answer; then the same with Sel = 1 where ID = A
    or nobody answers; never Sel = 1 for address 0 or a standard slave."""
    m = Master([std(2), ab(5), ab(37), std(0)])
    m.settle()
    m.until(lambda s: s["phase"] == ACTIVATION)
    first, seen = [], set()
    for name in m.names():
        if name not in seen:
            first.append(name)
            seen.add(name)
    assert first == [("RDIO", i) for i in range(32)] + [("RDID", i) for i in (0, 2, 5)] + [
        (n, i) for i in (0, 2, 5) for n in ("RID1", "RID2")] + [("RDIO", 32 + i) for i in range(1, 32) if i != 2] + [
        ("RDID", 37), ("RID1", 37), ("RID2", 37)]


def test_incomplete_answers_stay_out():
    """EX-004: a slave without RDID, or an A/B slave without RID2, does not enter LDS in that pass."""
    m = Master([std(2, mute=frozenset({"RDID"})), ab(5, mute=frozenset({"RID2"})), std(9)])
    m.start()
    assert m.read()["lds"] == {9} and m.read()["cdi"][5] == 0xFFFF


@pytest.mark.parametrize("start_present", [True, False])
def test_old_slaves(start_present):
    """EX-005: a standard slave without RID1 and RID2 is taken with ID1 = ID2 = F, in detection and in inclusion."""
    m = Master([std(1), std(4, io=3, id=1, old=True, present=start_present)]).start()
    m.slaves[1].present = True
    m.rounds()
    assert m.read()["cdi"][4] == 0xFF13 and 4 in m.read()["las"]


def test_only_id1_missing():
    """EX-005: one of the two codes may be missing; the other one is kept."""
    m = Master([std(4, io=3, id=1, id2=6, mute=frozenset({"RID1"}))]).start()
    assert m.read()["cdi"][4] == 0x6F13


def test_detection_repeats():
    """EX-007: passes repeat while nobody answers; the slave that appears ends that."""
    m = Master([ab(41, present=False)])
    m.settle()
    for _ in range(20):
        m.step()
    assert m.read()["phase"] == DETECTION
    assert m.names().count(("RDIO", 17)) == 30  # ten passes of two steps, three attempts each
    m.slaves[0].present = True
    m.until(lambda s: s["phase"] == DATA_EXCHANGE)
    assert m.read()["las"] == {41}


def test_slave_zero_ends_detection():
    """EX-007, EX-008: a slave 0 alone counts as found, and is never activated."""
    m = Master([std(0)]).start()
    assert m.read()["lds"] == {0} and not m.read()["las"]
    m.rounds(2)
    assert not m.read()["las"] and ("WPAR", 0) not in m.names() and ("ADRA", 0) not in m.names()


# ------------------------------------------------------------------------------------------ ACTIVATION
def test_activation_calls():
    """EX-008, CA-002, CA-005: WPAR(PI) as it is, then DEXG(F); echo kept; A/B slaves have ~Sel in I3."""
    m = Master([std(3, echo=4), ab(5), ab(37)], parameters={3: 0b1010, 5: 0b0010, 37: 0b1011})
    m.settle()
    m.until(lambda s: s["phase"] == ACTIVATION)
    start = len(m.log)
    m.until(lambda s: s["phase"] == DATA_EXCHANGE)
    assert [c for c, _, _ in m.log[start:]] == [
        encode_call("WPAR", 3, 0b1010), encode_call("DEXG", 3, 15), encode_call("WPAR", 5, 0b0010, True),
        encode_call("DEXG", 5, 15, True), encode_call("WPAR", 37, 0b0011), encode_call("DEXG", 37, 7)]
    s = m.read()
    assert s["las"] == {3, 5, 37} and s["pecho"][3] == 4 and s["pecho"][37] == 0b0011
    assert [m.port.extended[i] for i in (3, 5, 37)] == [0, 1, 1]


@pytest.mark.parametrize("mute", ["WPAR", "DEXG"])
def test_activation_needs_both(mute):
    """EX-008: a slave that answers only one of the two calls is detected, not activated; inclusion tries again."""
    m = Master([std(3, mute=frozenset({mute})), std(4)]).start()
    assert m.read()["lds"] == {3, 4} and m.read()["las"] == {4}
    m.rounds()
    assert m.read()["las"] == {4}
    m.slaves[0].mute = frozenset()
    m.rounds()
    assert m.read()["las"] == {3, 4}


def test_full_network():
    """EX-004, EX-008: 62 A/B slaves are detected and activated, two activation batches; all inputs arrive."""
    slaves = full_network()
    for s in slaves:
        s.inputs = (s.index * 7) & 15
    m = Master(slaves).start()
    assert m.read()["las"] == {s.index for s in slaves}
    m.cycles(2)
    assert all(m.read()["in"][s.index] == s.inputs for s in slaves) and m.port.violations == 0


def test_modes():
    """EX-009: protected mode activates projected slaves with the projected codes only; configuration mode all."""
    good, wrong, extra = std(1), std(2, io=3), std(3)
    m = Master([good, wrong, extra])
    m.project([good, std(2, io=4)])
    m.protect()
    m.start()
    assert m.read()["las"] == {1} and m.read()["lds"] == {1, 2, 3}
    m.rounds(2)
    assert m.read()["las"] == {1}
    m.protect(False)
    m.until(lambda s: s["phase"] == DATA_EXCHANGE)
    assert m.read()["las"] == {1, 2, 3}


def test_projection_change_in_protected_mode():
    """EX-009: a slave the new projection does not allow leaves LAS at once; one it allows comes in by inclusion."""
    one, two = std(1, inputs=3), std(2, inputs=5)
    m = Master([one, two], projected=[one])
    m.protect()
    m.start().cycles(2)
    assert m.read()["las"] == {1} and m.read()["in"][1] == 3
    m.project([two])
    s = m.read()
    assert s["las"] == set() and s["lds"] == {1, 2} and s["in"][1] == 0 and not m.port.active[1]
    m.rounds()
    assert m.read()["las"] == {2} and "config_ok" not in m.read()["flags"]


def test_detection_and_activation_retries():
    """EX-010: two failures in a row of each call are repaired by repetitions, a third is not."""
    for deaf, found in ((2, True), (3, False)):
        m = Master([std(1), std(4, deaf=deaf)]).start()
        assert (4 in m.read()["lds"]) == found
        assert m.names().count(("RDIO", 4)) == 3 and m.slaves[1].heard["RDIO"] == 3


def test_poll_retries():
    """EX-010, EX-027: a status poll has two repetitions in its slot; without any answer LPF stays as it is."""
    m = Master([PeripheralSlave(4, fault=True)]).start()
    m.until(lambda s: s["lpf"] == {4})
    m.slaves[0].fault, m.slaves[0].mute = False, frozenset({"RDST"})
    start = len(m.log)
    m.cycles(9)
    polls = [e for c, e, _ in m.log[start:] if name_of(c)[0] == "RDST"]
    assert polls == [1] * 9 and m.read()["lpf"] == {4} and m.read()["las"] == {4}
    m.slaves[0].mute = frozenset()
    m.until(lambda s: not s["lpf"], steps=6)


# ------------------------------------------------------------------------------------------ normal operation, inclusion
def test_normal_operation_flag():
    """EX-011: set while the cycle runs, and only then."""
    m = Master([std(1)])
    m.settle()
    while m.read()["phase"] != DATA_EXCHANGE:
        assert "normal_operation_active" not in m.read()["flags"] and not m.port.cycle
        m.step()
    assert "normal_operation_active" in m.read()["flags"] and m.port.cycle
    m.set_offline(True)
    assert "normal_operation_active" not in m.read()["flags"]


def test_probe_order():
    """EX-012, AD-007: one probe a cycle, to every address not in LAS, all with Sel = 0, then with Sel = 1, wrapping;
    address 0 with both."""
    m = Master([std(1), ab(5), ab(37)]).start()
    start = len(m.log)
    m.probes(2 * 61)
    probes = [i for n, i in m.names(start) if n == "RDIO"]
    candidates = [0, 32, *(i for i in range(1, 64) if i not in (1, 5, 37, 32))]
    assert probes == candidates * 2
    cycles = m.cycle_number
    assert len(m.log) - start == cycles * 3  # 1, 5 and 5B in turns, and one extra call
    polls = [n for n in map(name_of, (c for c, _, _ in m.log[start:])) if n[0] == "RDST"]
    assert len(polls) == cycles // 3 and polls[:4] == [("RDST", i) for i in (1, 5, 37, 1)]


def test_inclusion_one_call_per_slot():
    """EX-013: RDIO, RDID, RID1, RID2, WPAR, DEXG in six following cycles; then LAS, with the slave's own data."""
    m = Master([std(1), std(9, io=3, id=2, id1=4, id2=5, present=False, inputs=6)], parameters={9: 3}).start()
    m.slaves[1].present = True
    while m.slaves[1].heard["RDIO"] == 0:
        m.cycles(1)
    calls = ["RDIO"]
    for _ in range(5):
        start = len(m.log)
        m.cycles(1)
        calls += [n for n, i in m.names(start) if i == 9]
    assert calls == ["RDIO", "RDID", "RID1", "RID2", "WPAR", "DEXG"]
    s = m.read()
    assert s["las"] == {1, 9} and s["cdi"][9] == 0x5423 and m.slaves[1].parameter == 3 and s["in"][9] == 0
    m.cycles(1)
    assert m.read()["in"][9] == 6 and m.port.violations == 0


def test_late_firmware():
    """EX-012, EX-013: when reports are missed the sequencer repeats the request; old results are not taken for new."""
    m = Master([std(1), ab(9, present=False), ab(41, present=False)]).start()
    m.slaves[1].present = m.slaves[2].present = True
    for _ in range(80):
        for _ in range(m.random.randrange(4)):
            m.cycle(report=False)
        m.cycle()
    assert m.read()["las"] == {1, 9, 41} and {m.read()["cdi"][9], m.read()["cdi"][41]} == {m.slaves[1].codes}


def test_old_inclusion_result_is_ignored():
    """EX-012: a report with another tag than that of the present request changes nothing."""
    m = Master([std(1)]).start()
    m.cycles(3)
    request = m.port.inclusion.call
    m.lib.fw_cycle_done((0, 0, 0), (7, 0, (m.port.inclusion.tag - 1) & 255), [0] * 8)
    assert m.port.inclusion.call == request and m.read()["lds"] == {1}
    m.lib.fw_cycle_done((0, 0, 0), (7, 0, m.port.inclusion.tag), [0] * 8)
    assert m.port.inclusion.call != request


@pytest.mark.parametrize("name", ["RDID", "RID1", "RID2", "WPAR", "DEXG"])
def test_inclusion_retries(name):
    """EX-010, EX-013: a failed follow-up call is repeated in the next slots, twice; the slave is then included."""
    m = Master([std(1), ab(9, present=False)]).start()
    s = m.slaves[1]
    s.present = True
    order = ["RDIO", "RDID", "RID1", "RID2", "WPAR", "DEXG"]
    while s.heard[order[order.index(name) - 1]] == 0:
        m.cycles(1)
    s.deaf = 2
    m.cycles(2 + len(order) - order.index(name))
    assert 9 in m.read()["las"] and s.heard[name] == 3


def test_inclusion_gives_up():
    """EX-010, EX-013: after the third failure the search goes on; an A/B slave without RID1 is not taken."""
    m = Master([std(1), ab(9, mute=frozenset({"RID1"}))]).start()
    m.probes(63 + 4)  # one round, and RDID and three times RID1
    assert m.read()["lds"] == {1} and m.slaves[1].heard["RID1"] == 6  # three in detection, three in the round


def test_missed_rounds():
    """EX-014, EX-017: slave 0 that vanishes leaves LDS after three missed rounds, not two."""
    m = Master([std(1), std(0)]).start()
    m.cycles(1)
    while [n for n in m.names()[-2:] if n == ("RID2", 0)] == []:
        m.cycles(1)
    m.slaves[1].present = False
    m.probes(2 * 63)
    assert m.read()["lds"] == {0, 1} and "lds0" in m.read()["flags"]
    m.probes(63)
    assert m.read()["lds"] == {1} and "lds0" not in m.read()["flags"] and m.read()["cdi"][0] == 0xFFFF


def test_miss_counter_starts_over():
    """EX-014: missed rounds count in a row only."""
    m = Master([std(1), std(0)]).start()
    for _ in range(4):
        m.slaves[1].present = False
        m.probes(2 * 63)
        assert m.read()["lds"] == {0, 1}
        m.slaves[1].present = True
        m.probes(63 + 3)
        assert m.read()["lds"] == {0, 1}


def test_lost_slave():
    """EX-015, CA-006: a slave that fails three cycles leaves LAS, LDS, CDI; its input reads 0; it is found again."""
    m = Master([std(1, inputs=5), ab(4, inputs=9), ab(36, inputs=3)]).start().cycles(4)
    m.slaves[2].present = False
    m.cycles(5)  # turns: at most three of these are its own
    assert m.read()["in"][36] == 3
    m.cycles(1)
    s = m.read()
    assert s["las"] == s["lds"] == {1, 4} and s["cdi"][36] == 0xFFFF and s["in"][36] == 0 and not m.port.active[36]
    assert s["in"][4] == 9 and 36 in s["changed"]
    assert m.lose([36]) == BAD_STATE
    m.slaves[2].power_up()
    m.slaves[2].present = True
    m.rounds()
    assert m.read()["las"] == {1, 4, 36} and m.read()["in"][36] == 3


def test_all_lost():
    """EX-015, LK-014: with LAS empty the cycle is paced and goes on; the first slave back ends the pacing."""
    m = Master([std(1)]).start()
    assert m.port.min_cycle_us == 0
    m.slaves[0].present = False
    m.cycles(4)
    assert not m.read()["las"] and m.port.min_cycle_us == 1000 and m.port.cycle
    m.slaves[0].power_up()
    m.slaves[0].present = True
    m.rounds()
    assert m.read()["las"] == {1} and m.port.min_cycle_us == 0


# ------------------------------------------------------------------------------------------ flags
def test_config_ok():
    """EX-016: in both modes; missing, extra and wrong slave and slave 0 each clear it."""
    one, two = std(1), ab(34)
    for protected in (False, True):
        for present, ok in (([one, two], True), ([one], False), ([one, two, std(3)], False),
                            ([one, ab(34, io=1)], False), ([one, ab(34, id1=3)], False), ([one, two, std(0)], False)):
            m = Master([Slave(**{**vars(s), "heard": s.heard.copy()}) for s in present], projected=[one, two])
            m.protect(protected)
            m.start()
            assert ("config_ok" in m.read()["flags"]) == ok, (protected, present)


def test_auto_address_flags():
    """EX-018, EX-019: assign needs enable, protected mode and no wrong or extra slave; available one missing slave."""
    one, two, three = std(1), std(2), std(3)
    m = Master([one, two], projected=[one, two, three]).start()

    def flags():
        return m.read()["flags"] & {"auto_address_assign", "auto_address_available"}
    assert flags() == set()
    m.set_auto_address(True)
    assert flags() == set()
    m.protect()
    m.until(lambda s: s["phase"] == DATA_EXCHANGE)
    assert flags() == {"auto_address_assign", "auto_address_available"}
    m.slaves.append(std(0, io=1))  # a slave 0 does not disturb; this one is not the missing one
    m.rounds()
    assert flags() == {"auto_address_assign", "auto_address_available"} and "lds0" in m.read()["flags"]
    m.project([one, two])
    assert flags() == {"auto_address_assign"}
    m.project([one, two, three, std(4)])
    assert flags() == {"auto_address_assign"}
    m.project([one, std(2, io=1), three])
    assert flags() == set()
    m.project([one, three])
    assert flags() == set()
    m.project([one, two, three])
    m.set_auto_address(False)
    assert flags() == set()


def test_configuration_active():
    """EX-020: follows the mode."""
    m = Master([std(1)]).start()
    assert "configuration_active" in m.read()["flags"]
    m.protect()
    assert "configuration_active" not in m.read()["flags"]


@pytest.mark.parametrize("phase", [DETECTION, ACTIVATION, DATA_EXCHANGE])
def test_power_fail(phase):
    """EX-021: APF in any phase: OFFLINE, flag, default images; all comes back with the voltage."""
    m = Master([std(1, inputs=5), ab(2), ab(34)])
    m.host_outputs = [5] * 64
    m.settle()
    m.until(lambda s: s["phase"] == phase)
    m.power(True)
    s = m.read()
    assert s["phase"] == OFFLINE and "apf" in s["flags"] and s["in"] == [0] * 64 and not s["lds"]
    assert list(m.port.out) == [0xFFFFFFFF] * 8
    for _ in range(10):
        m.step()
    assert m.read()["phase"] == OFFLINE
    m.power(False)
    assert "apf" not in m.read()["flags"]
    m.until(lambda s: s["phase"] == DATA_EXCHANGE)
    assert m.read()["las"] == {1, 2, 34} and m.port.violations == 0


def test_periphery():
    """EX-022: LPF is empty, so Periphery_OK is set."""
    m = Master([std(1)]).start()
    assert "periphery_ok" in m.read()["flags"] and not m.read()["lpf"]


def test_mode_change_passes_offline():
    """EX-023: both changes pass through OFFLINE with Offline_Ready and a new detection; the same mode does not."""
    m = Master([std(1)], projected=[std(1)]).start()
    for protected in (True, False):
        m.protect(protected)
        assert m.read()["phase"] == OFFLINE
        m.tick()
        assert "offline_ready" in m.read()["flags"]
        m.until(lambda s: s["phase"] == DETECTION)
        m.until(lambda s: s["phase"] == DATA_EXCHANGE)
        m.protect(protected)
        assert m.read()["phase"] == DATA_EXCHANGE


# ------------------------------------------------------------------------------------------ data, functions, clash
def test_outputs():
    """CA-005, LK-006: payload inverted, A/B slaves in three bits; idle addresses F; one cycle later on the line."""
    m = Master([std(1), ab(2), ab(34)])
    m.host_outputs = [15] * 64
    m.host_outputs[1], m.host_outputs[2], m.host_outputs[34] = 0b0110, 0b1101, 0b0011
    m.start().cycles(4)
    assert [s.outputs for s in m.slaves] == [0b1001, 0b010, 0b100]
    assert m.port.out[0] >> 8 & 15 == 0b1010  # bit 3 is no payload: not inverted
    assert m.port.out[0] >> 12 == 0xFFFFF and list(m.port.out)[5:] == [0xFFFFFFFF] * 3
    m.host_outputs[1] = 0
    m.cycles(1)  # its report brings the new value; the next cycle has begun with the old one
    m.cycles(1)
    assert m.slaves[0].outputs == 0b1001
    m.cycles(1)
    assert m.slaves[0].outputs == 15


def test_default_outputs():
    """CA-005: host default 0 is F on the line; the port is only told when something changes."""
    m = Master([std(1)]).start()
    m.cycles(10)
    assert m.slaves[0].outputs == 15 and m.port.outputs == 1
    m.host_outputs[1] = 1
    m.cycles(10)
    assert m.slaves[0].outputs == 14 and m.port.outputs == 2


def test_refused_functions_change_nothing():
    """EX-025: bad projections, controls and reports that do not fit are refused, and nothing changes."""
    m = Master([std(1)], projected=[std(1)]).start()
    before, controls = m.read(), m.controls()
    for bad in (0, 32):
        lps, pcd, pp = projection([std(1)])
        lps[bad >> 5] |= 1 << (bad & 31)
        assert m.lib.fw_set_projection(lps, pcd, pp) == BAD_ARG
    lps, pcd, pp = projection()
    assert m.lib.fw_set_projection(lps, pcd, [*pp[:63], 16]) == BAD_ARG
    assert m.control(auto_clear=4, protected_mode=True) == BAD_ARG
    assert m.lose([2, 0, 32]) == m.lose([]) == BAD_STATE
    assert m.lib.fw_batch_done([(0, 0, 0)], 1) == BAD_STATE
    assert m.read() == before and m.controls() == controls and m.port.managements == 0
    m.set_offline(True)
    assert m.lib.fw_cycle_done((0, 0, 0), (0, 0, 0), [0xFFFFFFFF] * 8) == BAD_STATE
    assert m.read()["in"] == [0] * 64


@pytest.mark.parametrize("bad", [dict(auto_clear=4), dict(auto_clear=1), dict(auto_clear=3, protected_mode=True,
                                                                             auto_address=True), dict(lps=[1, 0])])
def test_senseless_permanent_data(bad):
    """EX-025, NV-005: permanent data that makes no sense is reported, and factory settings are used instead."""
    m = Master([std(1)], projected=[std(2)])
    lps, pcd, pp = m.projected
    controls = dict(data_exchange=True, protected_mode=False, auto_address=False, auto_clear=0)
    controls.update({k: v for k, v in bad.items() if k != "lps"})
    everything = m.ffi.new("fw_permanent *", dict(lps=bad.get("lps", lps), pcd=pcd, pp=pp, controls=controls))
    assert m.lib.fw_init(everything) in (BAD_ARG, -20)
    assert m.permanent() == (set(), [0xFFFF] * 64, [15] * 64,
                             dict(protected_mode=0, offline=0, data_exchange=1, auto_address=0, auto_clear=0))


@pytest.mark.parametrize("b_first", [True, False])
def test_clash(b_first):
    """EX-026: a standard slave and a B slave on one number: both detected, the standard one active, Config_OK clear
    even when both are projected; when the standard slave goes the B slave is activated."""
    standard, b = std(5), ab(37, inputs=3)
    m = Master([standard, b, std(9)], projected=[standard, b, std(9)])
    (standard if b_first else b).present = False
    m.start()
    assert m.read()["las"] == {9, 37 if b_first else 5}
    standard.present = b.present = True
    m.rounds(2)
    s = m.read()
    assert s["lds"] == {5, 9, 37} and s["las"] == {5, 9} and "config_ok" not in s["flags"] and s["in"][37] == 0
    assert not m.port.active[37]
    standard.present = False
    m.rounds(2)
    assert m.read()["las"] == {9, 37} and m.port.violations == 0


# ------------------------------------------------------------------------------------------ status polls, auto clear
def test_polls():
    """EX-027, EX-022, FN-023: S1 sets LPF and clears Periphery_OK, S1 = 0 clears LPF; so does leaving LAS."""
    m = Master([PeripheralSlave(1), PeripheralSlave(5, id=0xA), PeripheralSlave(37, id=0xA)]).start()
    assert "periphery_ok" in m.read()["flags"]
    m.slaves[2].fault = True
    m.until(lambda s: s["lpf"] == {37}, steps=12)
    assert "periphery_ok" not in m.read()["flags"]
    m.slaves[0].fault = True
    m.until(lambda s: s["lpf"] == {1, 37}, steps=12)
    m.slaves[2].fault = False
    m.until(lambda s: s["lpf"] == {1}, steps=12)
    m.slaves[0].present = False
    m.until(lambda s: s["las"] == {5, 37}, steps=12)
    assert not m.read()["lpf"] and "periphery_ok" in m.read()["flags"]


def test_polls_never_part_an_inclusion():
    """EX-027, EX-013: no poll between the six calls of an inclusion; at most one in P_RDST_EVERY = 3 cycles."""
    m = Master([std(1), std(9, present=False)]).start()
    m.slaves[1].present = True
    m.until(lambda s: 9 in s["las"])
    calls = [name_of(c)[0] for c, _, _ in m.log if c >> 10 or c >> 4 & 1 or c >> 5 == 9]
    first = calls.index("RDID", calls.index("RDST"))  # of the inclusion: detection polls nobody
    assert calls[first - 1:first + 5] == ["RDIO", "RDID", "RID1", "RID2", "WPAR", "DEXG"]
    start, cycles = len(m.log), m.cycle_number
    m.cycles(90)
    assert [n for n, _ in map(name_of, (c for c, _, _ in m.log[start:]))].count("RDST") == 30 and cycles


def test_periphery_without_slaves():
    """EX-022: without any active slave LPF is empty and Periphery_OK set; nobody is polled."""
    m = Master([std(0)]).start().cycles(30)
    assert "periphery_ok" in m.read()["flags"] and "RDST" not in [name_of(c)[0] for c, _, _ in m.log]


@pytest.mark.parametrize("start_present", [True, False])
def test_s1_of_old_slaves(start_present):
    """EX-028: S1 of a slave that did not answer RID2 is ignored, found in detection or by inclusion; a newer slave on
    the same address is believed."""
    m = Master([std(1), PeripheralSlave(4, fault=True, old=True, present=start_present)]).start()
    m.slaves[1].present = True
    m.rounds()
    assert 4 in m.read()["las"] and not m.read()["lpf"] and m.slaves[1].heard["RDST"]
    m.slaves[1].present = False
    m.until(lambda s: 4 not in s["las"])
    m.slaves[1] = PeripheralSlave(4, fault=True)
    m.until(lambda s: s["lpf"] == {4})


@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_nothing_but_the_legal_telegrams(noise):
    """EX-029, LK-001, LK-002, LK-003: each cycle: one DEXG per number with one repetition at most, then one extra call:
    a probe or inclusion call once, a status poll with two repetitions at most."""
    m = Master([std(1), ab(5), ab(37), std(9), std(30, present=False), std(0)], seed=3).start()
    m.noise = noise
    for _ in range(400):
        if m.random.random() < 0.05:
            s = m.random.choice(m.slaves)
            s.present = not s.present
        numbers = sorted({i & 31 for i in m.read()["las"]})
        start = len(m.log)
        m.cycles(1)
        calls, k = m.log[start:], 0
        for number in numbers:
            call = calls[k][0]
            assert call >> 5 == number and not call & 16
            k += 2 if calls[k][1] else 1
            assert k < 2 or calls[k - 1][0] == call or calls[k - 1][1] == 0
        extra = calls[k:]
        assert len({c for c, _, _ in extra}) == 1
        poll = name_of(extra[0][0])[0] == "RDST"
        assert len(extra) == 1 or poll and len(extra) <= 3 and all(e for _, e, _ in extra[:-1])


def test_protected_mode_refused():
    """EX-032, FN-017: protected mode is refused while slave 0 is detected, and nothing changes; without it is taken."""
    m = Master([std(1), std(0)]).start()
    before = m.read()
    assert m.control(protected_mode=True) == SLAVE0 and m.read() == before and not m.controls()["protected_mode"]
    m.slaves.pop()
    m.until(lambda s: 0 not in s["lds"])
    assert m.control(protected_mode=True) == 0 and m.read()["phase"] == OFFLINE


@pytest.mark.parametrize("mode", [0, 1, 2, 3])
@pytest.mark.parametrize("fault", ["missing", "periphery"])
def test_auto_clear(mode, fault):
    """EX-033, FN-018, FN-019, EX-037: the fault of the mode's kind ends in OFFLINE until the host leaves it; data
    exchange cannot be switched there; other faults do nothing."""
    slaves = [std(1), PeripheralSlave(2)]
    m = Master(slaves, projected=slaves, protected_mode=True, auto_clear=mode).start().cycles(20)
    assert m.read()["las"] == {1, 2}
    if fault == "missing":
        slaves[0].present = False
    else:
        slaves[1].fault = True
    m.until(lambda s: s["phase"] == OFFLINE or len(s["las"]) < 2 or s["lpf"], steps=20)
    if not mode & (1 if fault == "missing" else 2):
        m.cycles(20)
        return
    m.until(lambda s: s["phase"] == OFFLINE, steps=1)
    for _ in range(20):
        m.tick()
    s = m.read()
    assert s["phase"] == OFFLINE and "offline_ready" in s["flags"] and s["offline_causes"] == 1 | 1 << 4 | 4 << 16
    assert m.controls()["offline"] and m.control(data_exchange=False) == AUTO_CLEAR
    assert m.control(auto_clear=mode) == 0 and m.control(data_exchange=False) == AUTO_CLEAR  # the end state stays
    slaves[0].present, slaves[1].fault = True, False
    assert m.control(offline=False) == 0
    m.until(lambda s: s["phase"] == DATA_EXCHANGE)
    m.cycles(20)
    assert m.read()["las"] == {1, 2}


def test_auto_clear_at_start():
    """EX-033: a projected slave that is missing from the start stops the line in its first cycle of operation."""
    m = Master([std(1)], projected=[std(1), std(2)], protected_mode=True, auto_clear=1).start()
    m.cycles(1)
    assert m.read()["phase"] == OFFLINE and m.controls()["offline"]


def test_auto_clear_goes_alone():
    """EX-033, FN-021: auto clear goes with neither automatic addressing nor configuration mode, in either order."""
    m = Master([std(1)], projected=[std(1)])
    assert m.control(auto_clear=1) == AUTO_CLEAR_MODE
    m.protect()
    assert m.control(auto_clear=1, auto_address=True) == AUTO_CLEAR_MODE
    assert m.control(auto_clear=1) == 0
    assert m.control(auto_address=True) == AUTO_CLEAR_MODE == m.control(protected_mode=False)
    assert m.controls() == dict(protected_mode=1, offline=0, data_exchange=1, auto_address=0, auto_clear=1)
    assert m.control(auto_clear=0, auto_address=True) == 0


# ------------------------------------------------------------------------------------------ data exchange inactive
def test_data_exchange_inactive():
    """EX-024, LK-021, FN-019: RDID instead of DEXG, inputs 0, a slave that vanishes is still noticed; afterwards all of
    LAS is activated anew, also slaves that were reset meanwhile."""
    m = Master([std(1, inputs=5), ab(2, inputs=3), ab(34, inputs=9), std(8, inputs=1)])
    m.host_outputs[1] = 15
    m.start().cycles(4)
    m.set_data_exchange(False)
    m.cycles(1)
    start = len(m.log)
    m.cycles(6)
    calls = [name_of(c) for c, _, _ in m.log[start:]]
    assert not [n for n in calls if n[0] in ("DEXG", "WPAR")] and {("RDID", i) for i in (1, 2, 8, 34)} <= set(calls)
    s = m.read()
    assert s["in"] == [0] * 64 and s["las"] == {1, 2, 8, 34} and s["phase"] == DATA_EXCHANGE
    m.slaves[3].present = False
    m.slaves[0].power_up()
    m.cycles(4)
    assert m.read()["las"] == {1, 2, 34}
    m.set_data_exchange(True)
    start = len(m.log)
    m.until(lambda s: s["phase"] == ACTIVATION, steps=4)
    m.until(lambda s: s["phase"] == DATA_EXCHANGE, steps=4)
    assert [n for n in m.names(start) if n[0] == "WPAR"] == [("WPAR", 1), ("WPAR", 2), ("WPAR", 2)]
    m.cycles(4)
    s = m.read()
    assert s["las"] == {1, 2, 34} and [s["in"][i] for i in (1, 2, 34)] == [5, 3, 9] and m.slaves[0].outputs == 0
    assert m.port.violations == 0


# ------------------------------------------------------------------------------------------ history
def test_changed_codes():
    """EX-035, EX-016: other codes under a known address: not active in protected mode, Config_OK 0, CDI shows them;
    with the old codes all is as before."""
    good = std(4, io=3)
    m = Master([std(1), good], projected=[std(1), std(4, io=3)], protected_mode=True).start()
    assert "config_ok" in m.read()["flags"]
    good.io = 5
    m.cycles(10)
    assert m.read()["las"] == {1, 4}  # DEXG tells nothing
    good.present = False
    m.until(lambda s: s["las"] == {1})
    good.present = True
    m.rounds(2)
    s = m.read()
    assert s["las"] == {1} and s["lds"] == {1, 4} and s["cdi"][4] & 15 == 5 and "config_ok" not in s["flags"]
    good.io = 3
    m.rounds()
    assert m.read()["las"] == {1, 4} and "config_ok" in m.read()["flags"]


def test_history_of_changes():
    """EX-036: the slaves that broke Config_OK the last time, and when; they stay shown after all is well again."""
    slaves = [std(1), std(4), ab(37)]
    m = Master(slaves, projected=slaves, protected_mode=True).start().cycles(5)
    assert not m.read()["changed_slaves"]
    slaves[1].present = slaves[2].present = False
    m.until(lambda s: s["las"] == {1}, steps=12)
    s = m.read()
    assert s["changed_slaves"] == {4, 37} and "config_ok" not in s["flags"]
    assert 0 <= m.port.time_us - s["changed_us"] < 5_000
    slaves[1].present = slaves[2].present = True
    m.until(lambda s: s["las"] == {1, 4, 37})
    m.cycles(10)
    assert m.read()["changed_us"] == s["changed_us"] and m.read()["changed_slaves"] == {4, 37}
    m.slaves.append(std(9))
    m.until(lambda s: 9 in s["lds"])
    assert m.read()["changed_slaves"] == {9} and m.read()["changed_us"] > s["changed_us"]


def test_history_of_offline():
    """EX-037: bits of all causes since start-up, the last one, and its time."""
    m = Master([std(1)], projected=[std(1)]).start()
    assert m.read()["offline_causes"] == 1  # the start
    seen = 1
    for cause, act in ((1, lambda: m.set_offline(True)), (2, lambda: m.power(True)), (3, lambda: m.protect())):
        act()
        seen |= 1 << cause
        assert m.read()["offline_causes"] == seen | cause << 16 and m.read()["offline_us"] == m.port.time_us
        m.power(False)
        m.set_offline(False)
        m.until(lambda s: s["phase"] == DATA_EXCHANGE)
        m.cycles(3)
    assert m.read()["offline_us"] < m.port.time_us


def test_event_log():
    """EX-038: events in their order with rising bus time, the last 64 kept; entries and departures give the lists."""
    m = Master([std(1), std(4), ab(37)]).start()
    seen, known, lds = [], 0, m.read()["lds"]
    for k in range(40):
        s = m.slaves[m.random.randrange(3)]
        s.present = not s.present
        s.power_up()
        m.cycles(150 if k % 2 else 3)
        head, last = m.events()
        assert head - known <= 64
        seen += last[len(last) - (head - known):] if head > known else []
        known = head
    assert known > 64 and len(seen) == known and [e[0] for e in seen] == sorted(e[0] for e in seen)
    assert [e[3] for e in seen if e[1] == 2] == [DETECTION, ACTIVATION, DATA_EXCHANGE]
    for _, event, index, data in seen[[e[3] if e[1] == 2 else 0 for e in seen].index(DATA_EXCHANGE):]:
        if event == 4:
            lds.add(index)
        elif event == 5:
            lds.remove(index)
    assert lds == m.read()["lds"]


def test_reports_that_do_not_fit():
    """EX-025: a batch of another length, reports of another phase: refused or without effect, nothing changes."""
    m = Master(full_network())
    m.lib.fw_exchange_done()
    m.settle()
    m.tick()
    assert m.read()["phase"] == DETECTION and m.port.batch_len == 32
    before = m.read()
    assert m.lib.fw_batch_done([(0, 0, 0)] * 31, 31) == BAD_STATE == m.lib.fw_batch_done([], 0)
    m.lib.fw_exchange_done()
    assert m.read() == before
    m.until(lambda s: s["phase"] == ACTIVATION)
    assert m.lib.fw_cycle_done((0, 0, 0), (0, 0, 0), [0] * 8) == BAD_STATE and m.lib.fw_slave_lost([2, 0]) == BAD_STATE
    m.until(lambda s: s["las"])
    s = m.read()
    assert s["phase"] == ACTIVATION and m.lib.fw_slave_lost([2, 0]) == 0
    assert m.read()["las"] == s["las"] - {1} and not m.port.cycle
    m.until(lambda s: len(s["las"]) == 62)


def test_new_activation_waits_for_the_sequencer():
    """EX-024: data exchange comes back: the cycle under way ends first."""
    m = Master([std(1)], data_exchange=False).start().cycles(2)
    m.set_data_exchange(True)
    assert not m.port.idle
    m.lib.fw_tick(1024)
    assert m.read()["phase"] == DATA_EXCHANGE
    m.cycle()
    m.tick()
    assert m.read()["phase"] == ACTIVATION


def test_zero_with_the_other_select_and_without_id2():
    """AD-007, EX-005, EX-004: what is known of a slave at address 0 does not depend on the select it was read with."""
    m = Master([std(0, id=1, old=True, zero_select="1"), std(3)]).start()
    assert m.read()["lds"] == {0, 3} and m.read()["cdi"][0] == m.slaves[0].codes
    m.rounds(4)
    assert m.read()["lds"] == {0, 3}


def test_slave_whose_codes_are_all_f():
    """EX-013, EX-016: codes FFFF are those of a slave too, once it is in LDS."""
    m = Master([std(1), std(9, io=15, id=15, id1=15, id2=15, present=False)]).start()
    m.slaves[1].present = True
    m.rounds()
    assert m.read()["lds"] == m.read()["las"] == {1, 9} and m.read()["flags"] == m.expected_flags(m.read())


def test_suspected_duplicates():
    """EX-034: garbled answers raise the suspicion, missing ones lower it, good ones too; a list only, nothing acts."""
    m = Master([std(1), std(4)]).start()
    las = m.read()["las"]
    for _ in range(100):
        m.lib.fw_quality(4, 40, 0, 10)  # noise: one in five is spoilt, the others get through
    assert not m.read()["suspects"]
    m.lib.fw_quality(4, 10, 0, 11)
    assert not m.read()["suspects"]
    m.lib.fw_quality(4, 3, 0, 1)  # P_SUSPECT = 12
    assert m.read()["suspects"] == {4}
    m.lib.fw_quality(1, 0, 50, 3)  # a dead slave
    m.lib.fw_quality(4, 0, 1, 0)
    m.lib.fw_quality(4, 0, 0, 0)  # not called
    assert m.read()["suspects"] == {4}
    m.lib.fw_quality(4, 0, 6, 0)
    assert not m.read()["suspects"] and m.read()["las"] == las
    m.lib.fw_quality(4, 0, 0, 1000)  # the points are limited: one bad hour is not held against it for ever
    for _ in range(24):
        assert m.read()["suspects"] == {4}
        m.lib.fw_quality(4, 16, 0, 0)
    assert not m.read()["suspects"]
    assert [e[1:] for e in m.events()[1] if e[1] == 12] == [(12, 4, 1), (12, 4, 0)] * 2


# ------------------------------------------------------------------------------------ the projection changes meanwhile
@pytest.mark.parametrize("calls", [3, 4])
def test_projection_change_during_inclusion(calls):
    """EX-009, EX-013: a slave that the host takes out of its project between WPAR and DEXG is not activated."""
    one, nine = std(1), std(9, present=False)
    m = Master([one, nine], projected=[one, nine], protected_mode=True).start()
    nine.present = True
    while m.slaves[1].heard["RDIO"] == 0:
        m.cycles(1)
    m.probes(calls)
    m.project([one])
    m.probes(20)
    assert m.read()["las"] == {1} and m.read()["lds"] == {1, 9} and nine.heard["DEXG"] == calls - 3


def test_projection_change_during_activation():
    """EX-009: the same in the activation phase, for slaves of the batch under way."""
    slaves = [std(1), std(2)]
    m = Master(slaves, projected=slaves, protected_mode=True)
    m.settle()
    m.until(lambda s: s["phase"] == ACTIVATION)
    m.project(slaves[:1])
    m.until(lambda s: s["phase"] == DATA_EXCHANGE)
    assert m.read()["las"] == {1}


def test_projection_change_between_activation_batches():
    """EX-009: and for those of an earlier batch."""
    slaves = full_network()
    m = Master(slaves, projected=slaves, protected_mode=True)
    m.settle()
    m.until(lambda s: s["phase"] == ACTIVATION)
    m.batch()
    assert len(m.read()["las"]) == 32
    m.project(slaves[40:])
    m.until(lambda s: s["phase"] == DATA_EXCHANGE)
    assert m.read()["las"] == {s.index for s in slaves[40:]}


# ------------------------------------------------------------------------------------------ with combined transactions
def test_multiplexed_slave():
    """CT-030, LK-018: S-7.A.7: its slot is live with outputs 3, 2 and 1, 0 in turn; the cycle is not too short."""
    m = Master([ab(5, io=7, id2=7)])
    m.host_outputs[5] = 0b1001
    m.start().cycles(8)
    assert m.port.live[5] and m.port.min_cycle_us == 1000
    start = len(m.log)
    m.cycles(6)
    nibbles = [c & 15 for c, _, _ in m.log[start:] if c < 0x400]
    assert nibbles in ([0b1101, 0b1010] * 3, [0b1010, 0b1101] * 3)
    m.slaves[0].present = False
    m.until(lambda s: not s["las"])
    m.slaves[0] = ab(5)  # a plain slave comes back in its place
    m.until(lambda s: s["las"])
    assert not m.port.live[5] and m.port.min_cycle_us == 0


def test_safety_slave():
    """CT-060: words pass as they are; a failed call gives 0000 in that cycle, other slaves keep their last value."""
    m = Master([std(2, inputs=5), std(9, io=0, id=0xB, inputs=0b1011)]).start().cycles(3)
    assert m.read()["in"][9] == 0b1011
    m.slaves[0].deaf = m.slaves[1].deaf = 2
    m.cycles(1)
    assert m.read()["in"][9] == 0 and m.read()["in"][2] == 5
    m.cycles(1)
    assert m.read()["in"][9] == 0b1011


def test_incomplete_group():
    """CT-052, EX-016: a member of a CTT5 group without the other one is a configuration error."""
    slaves = [std(5, io=6, id=0, id2=0xA), std(6, io=6, id=0, id2=5)]
    m = Master(slaves, projected=slaves, protected_mode=True).start().cycles(2)
    assert "config_ok" in m.read()["flags"]
    m = Master(slaves[:1], projected=slaves[:1]).start().cycles(2)
    assert m.read()["las"] == {5} and "config_ok" not in m.read()["flags"]


def test_master_owns_the_parameter():
    """FN-005, EX-008: a slave with strings (S-7.4) is activated with parameter F whatever PI says."""
    m = Master([std(3, io=7, id=4, id2=0xC), std(4)], parameters={3: 5, 4: 5}).start()
    assert [s.parameter for s in m.slaves] == [15, 5]
