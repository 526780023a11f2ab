# SPDX-License-Identifier: Apache-2.0
"""Execution control functions that need no telegram, one by one, with what they refuse."""
import pytest
from fake_line import ACTIVATION, DATA_EXCHANGE, OFFLINE, Master, PeripheralSlave, Slave, mask

BAD_ARG, PROTECTED, SLAVE0 = -1, -5, -6
NOBODY = (0, 32, 64, 200)


def list_words(indices):
    return [mask(indices) & 0xFFFFFFFF, mask(indices) >> 32]


def test_read_idi():
    """FN-001, CA-006: digital inputs at host level, as on the line; 0 where no slave is active."""
    m = Master([Slave(1, inputs=9), Slave(34, id=0xA, inputs=6)]).start().cycles(3)
    assert m.read()["in"] == [{1: 9, 34: 6}.get(i, 0) for i in range(64)]


def test_write_odi():
    """FN-002, CA-005: digital outputs at host level: 1 = on = 0 on the line."""
    m = Master([Slave(1)]).start()
    m.host_outputs[1] = 0b1010
    m.cycles(3)
    assert m.slaves[0].outputs == 0b0101


@pytest.mark.parametrize("protected", [False, True])
def test_permanent_parameter(protected):
    """FN-003, FN-004, EX-002: PP of one slave, in both modes; PI stays; refused for 0, 32 and values above F."""
    m = Master([Slave(1)], projected=[Slave(1)], protected_mode=protected).start()
    stored = m.read()["permanent_version"]
    assert m.lib.fw_set_pp(1, 6) == 0 and m.lib.fw_set_pp(63, 2) == 0
    assert m.permanent()[2] == [{1: 6, 63: 2}.get(i, 15) for i in range(64)] and m.read()["pi"] == [15] * 64
    assert m.read()["permanent_version"] == stored + 2
    before = m.read(), m.permanent()
    assert [m.lib.fw_set_pp(i, 1) for i in NOBODY] == [BAD_ARG] * 4 and m.lib.fw_set_pp(1, 16) == BAD_ARG
    assert (m.read(), m.permanent()) == before


def test_read_and_store_parameters():
    """FN-006, FN-007: PI becomes PP of all slaves, and that is stored."""
    m = Master([Slave(1)], parameters={1: 6, 40: 3}).start()
    assert m.read()["pi"] == [{1: 6, 40: 3}.get(i, 15) for i in range(64)]
    m.lib.fw_set_pp(1, 9)
    stored = m.read()["permanent_version"]
    m.lib.fw_store_parameters()
    assert m.permanent()[2] == m.read()["pi"] and m.read()["permanent_version"] == stored + 1


def test_permanent_configuration():
    """FN-008, FN-009, EX-016: PCD of one slave, configuration mode only; flags follow at once."""
    m = Master([Slave(1, io=3)]).start()
    assert m.lib.fw_set_lps(list_words({1})) == 0 and "config_ok" not in m.read()["flags"]
    assert m.lib.fw_set_pcd(1, m.slaves[0].codes) == 0 and "config_ok" in m.read()["flags"]
    assert m.permanent()[1][1] == m.slaves[0].codes
    m.protect()
    before = m.read(), m.permanent()
    assert m.lib.fw_set_pcd(1, 0x1234) == PROTECTED
    assert [m.lib.fw_set_pcd(i, 1) for i in NOBODY] == [BAD_ARG] * 4 and m.lib.fw_set_pcd(1, 0x10000) == BAD_ARG
    assert (m.read(), m.permanent()) == before


def test_store_actual_configuration():
    """FN-010, FN-011: CDI becomes PCD, LAS becomes LPS, PP of slaves not in LPS becomes F: one permanent update; the
    mode can be changed then and all slaves are active."""
    slaves = [Slave(1, io=3), Slave(4, id=0xA, id1=2), Slave(36, id=0xA), Slave(9, mute=frozenset({"WPAR"}))]
    m = Master(slaves, projected=[Slave(20)], parameters={4: 5, 20: 6}).start()
    assert m.read()["lds"] == {1, 4, 9, 36} and m.read()["las"] == {1, 4, 36}
    stored = m.read()["permanent_version"]
    assert m.lib.fw_store_configuration() == 0
    lps, pcd, pp, _ = m.permanent()
    assert lps == {1, 4, 36} and pcd == m.read()["cdi"] and pcd[9] == slaves[3].codes
    assert pp == [{4: 5}.get(i, 15) for i in range(64)] and m.read()["permanent_version"] == stored + 1
    m.slaves.pop()
    m.until(lambda s: s["flags"] >= {"config_ok"})
    m.protect()
    m.until(lambda s: s["phase"] == DATA_EXCHANGE)
    assert m.read()["las"] == {1, 4, 36}
    before = m.read(), m.permanent()
    assert m.lib.fw_store_configuration() == PROTECTED and (m.read(), m.permanent()) == before


def test_store_configuration_leaves_out_slave_0():
    """FN-010: a slave 0 is not projected, and its codes are not."""
    m = Master([Slave(0), Slave(1)]).start()
    assert m.lib.fw_store_configuration() == 0
    assert m.permanent()[0] == {1} and m.permanent()[1][0] == 0xFFFF


def test_set_lps():
    """FN-012, FN-013: LPS as a whole, configuration mode only, without 0 and 32."""
    m = Master([Slave(1)]).start()
    everybody = set(range(64)) - {0, 32}
    assert m.lib.fw_set_lps(list_words(everybody)) == 0 and m.permanent()[0] == everybody
    for bad in ({0, 1}, {32}):
        assert m.lib.fw_set_lps(list_words(bad)) == BAD_ARG
    assert m.lib.fw_set_lps(list_words({1})) == 0
    m.lib.fw_set_pcd(1, m.slaves[0].codes)
    m.protect()
    assert m.lib.fw_set_lps(list_words({2})) == PROTECTED and m.permanent()[0] == {1}


def test_lists_and_flags():
    """FN-014, FN-015, FN-016, FN-023: LAS, LDS, LPF and flags as they are."""
    m = Master([Slave(0), PeripheralSlave(1, fault=True), Slave(40, id=0xA, mute=frozenset({"DEXG"}))]).start()
    m.until(lambda s: s["lpf"])
    s = m.read()
    assert (s["lds"], s["las"], s["lpf"]) == ({0, 1, 40}, {1}, {1})
    assert s["flags"] == {"lds0", "configuration_active", "normal_operation_active"}


def test_operation_mode():
    """FN-017, EX-023: passes through OFFLINE with a new detection, is stored, and is refused with slave 0."""
    m = Master([Slave(1)], projected=[Slave(1)]).start()
    stored = m.read()["permanent_version"]
    m.protect()
    assert m.read()["phase"] == OFFLINE and m.read()["permanent_version"] == stored + 1
    assert m.controls()["protected_mode"]
    m.until(lambda s: s["phase"] == DATA_EXCHANGE)
    m.slaves.append(Slave(0))
    m.until(lambda s: 0 in s["lds"])
    m.protect(False)  # this way is free
    m.until(lambda s: s["phase"] == DATA_EXCHANGE)
    assert m.control(protected_mode=True) == SLAVE0


def test_offline_mode():
    """FN-018, EX-001, EX-003: into the offline phase and out of it; not stored."""
    m = Master([Slave(1)]).start()
    stored = m.read()["permanent_version"]
    m.set_offline(True)
    assert m.read()["phase"] == OFFLINE and m.controls()["offline"]
    m.set_offline(False)
    m.until(lambda s: s["phase"] == DATA_EXCHANGE, steps=12)
    assert m.read()["permanent_version"] == stored and not m.controls()["offline"]


def test_data_exchange_control():
    """FN-019, EX-024: stored; before normal operation it takes effect with it, without another activation."""
    m = Master([Slave(1, inputs=3)])
    m.set_data_exchange(False)
    stored = m.read()["permanent_version"]
    m.start().cycles(4)
    assert m.port.read_id and m.read()["in"][1] == 0 and m.read()["las"] == {1}
    m.set_offline(True)
    m.set_data_exchange(True)
    assert m.read()["permanent_version"] == stored + 1
    m.set_offline(False)
    m.until(lambda s: s["phase"] == DATA_EXCHANGE)
    m.cycles(2)
    assert not m.port.read_id and m.read()["in"][1] == 3


def test_auto_address_control():
    """FN-021: what was set is read back and stored; setting the same again stores nothing."""
    m = Master([Slave(1)]).start()
    stored = m.read()["permanent_version"]
    m.set_auto_address(True)
    m.set_auto_address(True)
    assert m.controls()["auto_address"] and m.read()["permanent_version"] == stored + 1
    m.set_auto_address(False)
    assert not m.controls()["auto_address"] and m.read()["permanent_version"] == stored + 2


def test_data_exchange_back_during_an_inclusion():
    """EX-024, FN-019, EX-013: a slave that is included in the last cycle before the new activation does not stop it."""
    for moment in range(1, 12):
        m = Master([Slave(1, inputs=5), Slave(9, inputs=6, present=False)]).start()
        m.set_data_exchange(False)
        m.cycles(2)
        m.slaves[1].present = True
        while m.slaves[1].heard["RDIO"] == 0:
            m.cycles(1)
        m.cycles(moment)
        for s in m.slaves:
            s.power_up()  # both need WPAR again
        m.set_data_exchange(True)
        m.until(lambda s: s["phase"] == ACTIVATION, steps=4)
        m.until(lambda s: s["las"] == {1, 9} and s["in"][1] == 5 and s["in"][9] == 6, steps=200)
        assert m.port.violations == 0, moment
