# SPDX-License-Identifier: Apache-2.0
"""The host window of the firmware image on the soft core: mailbox of functions, 16-bit values, log and history."""
import pytest
from ctt_line import Ctt1
from fake_chip import HOST_ATTN, MAX_CLOCKS, SLAVE_LOST, Chip, host_at, link_at
from fake_line import Slave
from test_image import full_network, network

from asi import ctt_table

ARG, BUSY, ABORTED, PROTECTED, NOT_DETECTED, NOT_ACTIVE, PROFILE = -1, -3, -4, -5, -7, -8, -17
OVERFLOW, AUTO_CLEAR_MODE, OFFLINE = -18, -20, -22
START, PHASE, WENT_OFFLINE, DETECTED, GONE, ACTIVATED, DEACTIVATED, CONFIG_OK = range(1, 9)
SUSPECT, AUTO_CLEAR = 12, 13
STRING = bytes.fromhex("00 B7 03 00 00 03 2A 11 01")
PROTECTED_BIT, OFFLINE_BIT, EXCHANGE_BIT, AUTO_BIT, MONITOR_BIT = (1 << k for k in range(5))


class Ctt1Slave(Slave):
    """A slave of type 1: its double answers the data calls and takes the parameters that select strings."""

    def __init__(self, index, id2, double):
        super().__init__(index, io=7, id=4 if double.strings else 3, id1=15, id2=id2)
        self.double = double

    def answer(self, call):
        answer = super().answer(call)
        name = self.named(call) if answer is not None else None
        if name == "WPAR":
            self.double.wpar(call & 15)
        return self.double.call(call & 15) if name == "DEXG" else answer


def host_words(chip):
    """What the host would commit: HOST_CTRL, LPS_CFG, PCD, PP."""
    return (chip.read("HOST_CTRL"), chip.list("LPS_CFG"), [chip.item("PCD", i, 2) for i in range(64)],
            [chip.item("PP", i, 1) for i in range(64)])


def clocked(chip, look):
    """The core runs clock by clock from now on, `look` is asked after each."""
    def run():
        for _ in range(MAX_CLOCKS):
            asleep = chip.lib.soc_run(1)
            look()
            if asleep:
                return chip
        raise AssertionError("the core does not come back to sleep")
    chip.run = run


def test_every_function():
    """HW-008, FN-003, FN-005, FN-007, FN-008, FN-010, FN-012, FN-017, FN-018, FN-019, FN-020, FN-021, FN-022, FN-024,
    FN-027 .. FN-031: each code does its work through the mailbox or is refused there; the host's own words follow."""
    chip = Chip(network()).start()
    one, two, three = chip.slaves
    chip.cycle()
    assert chip.function(3, 1, 6)[0] == 0 and chip.item("PP", 1, 1) == 6
    assert chip.function(3, 32, 6)[0] == chip.function(3, 1, 16)[0] == ARG and chip.item("PP", 32, 1) == 15
    heard = one.heard["WPAR"]
    assert chip.function(5, 1, 9) == (0, 9, b"") and one.parameter == 9
    for _ in range(10):
        chip.cycle()
    assert one.heard["WPAR"] == heard + 1  # once for each FN_SEQ
    assert chip.item("PI", 1, 1) == 9 and chip.item("PP", 1, 1) == 6
    assert chip.function(7)[0] == 0 and chip.item("PP", 1, 1) == 9
    assert chip.function(8, 2, 0x1234)[0] == 0 and chip.item("PCD", 2, 2) == 0x1234
    assert chip.function(12, 0b110, 0b1000)[0] == 0 and chip.list("LPS_CFG") == chip.list("LPS") == {1, 2, 35}
    assert chip.function(12, 1, 0)[0] == ARG and chip.list("LPS_CFG") == {1, 2, 35}
    assert chip.function(10)[0] == 0 and chip.list("LPS_CFG") == chip.list("LPS") == {1, 2, 34}
    assert [chip.item("PCD", i, 2) for i in (1, 2, 34, 35)] == [one.codes, two.codes, three.codes, 0xFFFF]
    assert chip.read("FLAGS") & 1
    assert chip.function(17, 1)[0] == 0 and chip.read("HOST_CTRL") == PROTECTED_BIT | EXCHANGE_BIT
    assert chip.read("PHASE") == 0 or chip.read("OFFLINE_CAUSES") >> 16 == 3
    chip.until(lambda: chip.list("LAS") == {1, 2, 34} and chip.read("PHASE") == 3)
    assert chip.function(8, 2, 0)[0] == chip.function(10)[0] == chip.function(12, 2)[0] == PROTECTED
    assert chip.function(18, 1)[0] == 0 and chip.read("HOST_CTRL") == PROTECTED_BIT | OFFLINE_BIT | EXCHANGE_BIT
    assert chip.function(5, 1, 3)[0] == OFFLINE and chip.function(18, 0)[0] == ARG
    assert chip.function(18, 2)[0] == 0 and chip.read("HOST_CTRL") == PROTECTED_BIT | EXCHANGE_BIT
    chip.until(lambda: chip.read("PHASE") == 3)
    assert chip.function(19, 0)[0] == 0 and chip.read("HOST_CTRL") == PROTECTED_BIT and chip.function(19, 2)[0] == ARG
    assert chip.function(19, 1)[0] == 0 and chip.read("HOST_CTRL") == PROTECTED_BIT | EXCHANGE_BIT
    chip.until(lambda: chip.read("PHASE") == 3)
    assert chip.function(21, 1)[0] == 0 and chip.read("HOST_CTRL") == PROTECTED_BIT | EXCHANGE_BIT | AUTO_BIT
    assert chip.function(33, 1)[0] == AUTO_CLEAR_MODE and chip.read("FLAGS") & 4
    assert chip.function(21, 0)[0] == 0 and chip.function(33, 3)[0] == 0 and chip.function(33, 4)[0] == ARG
    assert chip.read("HOST_CTRL") == PROTECTED_BIT | EXCHANGE_BIT | 3 << 5
    assert chip.function(33, 0)[0] == chip.function(17, 0)[0] == 0 and chip.read("HOST_CTRL") == EXCHANGE_BIT
    chip.until(lambda: chip.list("LAS") == {1, 2, 34} and chip.read("PHASE") == 3)
    assert chip.function(20, 3, 4)[0] == NOT_DETECTED and chip.function(20, 1, 1)[0] == ARG
    assert chip.function(20, 1, 5)[0] == 0 and one.index == 5
    chip.until(lambda: chip.list("LAS") == {2, 5, 34})
    assert chip.function(22, 5, 0x10) == (0, one.io, b"") and chip.function(22, 5, 0x1F - 2)[0] == ARG
    assert chip.function(24, 3)[0] == NOT_DETECTED and chip.function(24, 16)[0] == ARG
    assert [chip.function(code, 5)[0] for code in (27, 29, 30, 31)] == [PROFILE] * 4
    assert chip.function(30, 9)[0] == NOT_ACTIVE and chip.function(28, 5, string=b"abc" * 74)[0] == OVERFLOW
    assert {chip.function(code, 1, 1)[0] for code in (0, 1, 2, 4, 6, 9, 11, 23, 32, 34, 255)} == {ARG}
    before = host_words(chip)
    assert chip.commit() == 0 and host_words(chip) == before  # the host's next commit keeps what the functions did
    assert chip.list("LPS") == {1, 2, 34} and chip.item("PP", 1, 1) == 9


def test_refusals_change_nothing():
    """HW-008: the answer of a refusal has no data and no string, and the host's words stay as the host left them."""
    chip = Chip(network()).start()
    chip.put("PCD", 9, 2, 0xABCD)  # prepared for a commit
    chip.write("HOST_CTRL", EXCHANGE_BIT | AUTO_BIT)
    before = host_words(chip)
    chip.write("FN_DATA", 0x77)
    assert chip.function(30, 1, string=b"left over")[:2] == (PROFILE, 0) and chip.read("FN_LEN") == 0
    assert chip.function(3, 0, 1) == (ARG, 0, b"") and host_words(chip) == before
    chip.write("FN_LEN", 0xFFFFFFFF)
    chip.write("FN_CODE", 31)
    chip.write("FN_SEQ", chip.read("FN_SEQ") + 1)
    chip.until(lambda: chip.answered)
    assert chip.read("FN_STATUS") == OVERFLOW & 0xFFFFFFFF and chip.read("FN_LEN") == 0 and host_words(chip) == before


@pytest.mark.parametrize("code,status,data,string", [(5, 0, 9, b""), (30, 0, 0, STRING), (3, 0, 0, b""),
                                                     (12, ARG, 0, b"")])
def test_answer_is_complete_before_done(code, status, data, string):
    """HW-008, FN-005, FN-030: in the very clock in which FN_DONE follows FN_SEQ, status, data, length and string are
    there, and stay."""
    double = Ctt1(strings={ctt_table.CTT1_PAR_ID: STRING})
    chip = Chip(network() + [Ctt1Slave(8, 0xC, double)]).start()
    for _ in range(20):
        chip.cycle()
    for name in ("FN_STATUS", "FN_DATA"):
        chip.write(name, 0xEEEEEEEE)
    for k in range(56):
        chip.write("FN_STRING", 0xEEEEEEEE, k)
    seen = []

    def answer():
        length = chip.read("FN_LEN")
        words = b"".join(chip.read("FN_STRING", k).to_bytes(4, "little") for k in range(56))
        return chip.read("FN_STATUS"), chip.read("FN_DATA"), words[:length]

    def look():
        if not seen and chip.answered:
            seen.append(answer())
    chip.ask(code, 8 if code == 30 else 1, 9)
    assert not chip.answered
    clocked(chip, look)
    chip.until(lambda: seen, 1500)
    for _ in range(3):
        chip.step()
    assert seen[0] == answer() == (status & 0xFFFFFFFF, data, string)


def test_functions_in_line():
    """HW-008, FN-032, HW-002: while a function is open a second one waits, with its string untouched, and a commit in
    between is applied at once; the second is done once, after the first."""
    chip = Chip(network()).start()
    slave = chip.slaves[0]
    slave.clock = lambda: chip.r.skipped_us
    slave.write_us = 60_000
    chip.ask(20, 1, 5)
    for _ in range(6):
        chip.step()
    assert not chip.answered and slave.index == 5 and chip.read("FN_DONE") == 0
    chip.ask(3, 7, 2, string=b"untouched!!!")
    chip.write("LPS_CFG", 0b100000)
    assert chip.commit() == 0 and chip.list("LPS") == {5} and chip.read("FN_DONE") == 0
    assert chip.item("PP", 7, 1) == 15 and 5 not in chip.list("LAS")
    done = []
    for _ in range(600):
        if chip.read("FN_DONE") != (done[-1] if done else 0):
            done.append(chip.read("FN_DONE"))
        if chip.answered:
            break
        assert chip.item("PP", 7, 1) == 15
        chip.step()
    assert done == [2] and chip.read("FN_STATUS") == 0 and chip.item("PP", 7, 1) == 2
    assert b"".join(chip.read("FN_STRING", k).to_bytes(4, "little") for k in range(3)) == b"untouched!!!"
    chip.until(lambda: 5 in chip.list("LAS"))
    assert chip.list("LPS_CFG") == {5}  # the commit is in what the host's words show after the function
    chip.put("PP", 7, 1, 11)
    for _ in range(5):
        chip.cycle()
    assert chip.item("PP", 7, 1) == 11  # not done again


def test_strings_in_line():
    """HW-008, FN-028, FN-030, FN-032: the string of a function that waits is not spoilt by the answer of the one
    before, which nobody can read any more."""
    double = Ctt1(strings={ctt_table.CTT1_PAR_ID: STRING})
    chip = Chip(network() + [Ctt1Slave(8, 0xC, double)]).start()
    for _ in range(20):
        chip.cycle()
    chip.ask(30, 8)
    for _ in range(4):
        chip.step()
    assert not chip.answered and chip.read("CTT_STATE", 2) & 0x80
    text = bytes.fromhex("11 22 33 44 55 66 77 88 99 AA BB CC")
    chip.ask(28, 8, string=text)
    chip.until(lambda: chip.answered, 400)
    assert chip.read("FN_STATUS") == 0 and chip.read("FN_DONE") == 2
    # the master sets F and V, the last bits of each sequence
    assert double.written is not None and len(double.written) == 12
    assert all((a ^ b) & (0xFC if k % 3 == 2 else 0xFF) == 0 for k, (a, b) in enumerate(zip(double.written, text)))


def test_function_ends_as_aborted():
    """HW-008, FN-033: OFFLINE in the middle: the open function is answered with ABORTED, the next one is taken."""
    chip = Chip(network()).start()
    slave = chip.slaves[0]
    slave.clock, slave.write_us = lambda: chip.r.skipped_us, 60_000
    chip.ask(20, 1, 5)
    for _ in range(6):
        chip.step()
    chip.power(True)
    chip.until(lambda: chip.answered, 5)
    assert chip.read("FN_STATUS") == ABORTED & 0xFFFFFFFF
    assert chip.function(5, 1, 1)[0] == -21  # POWER


def test_function_waits_for_automatic_addressing():
    """HW-008, AD-008: a function that meets automatic addressing waits for its end, the replaced slave is active, and
    the log has the order."""
    chip = Chip(network()).start()
    chip.cycle()
    assert chip.function(10)[0] == chip.function(17, 1)[0] == chip.function(21, 1)[0] == 0
    chip.until(lambda: chip.read("FLAGS") & 1 and chip.read("PHASE") == 3)
    old = chip.slaves.pop(0)
    new = Slave(0, io=old.io, id=old.id, inputs=6, clock=lambda: chip.r.skipped_us, write_us=30_000)
    chip.until(lambda: 1 not in chip.list("LDS"))
    chip.slaves.append(new)
    chip.until(lambda: new.index == 1)
    chip.ask(5, 2, 4)
    chip.step()
    assert not chip.answered and chip.item("PI", 2, 1) == 15
    chip.until(lambda: chip.answered)
    assert (chip.read("FN_STATUS"), chip.read("FN_DATA"), chip.item("PI", 2, 1)) == (0, 12, 4)  # its echo has I3 = ~Sel
    assert new.status & 1 == 0  # the memory had its time first
    chip.until(lambda: 1 in chip.list("LAS") and chip.nibble("IN_IMG", 1) == 6)
    addressed = [(index, data) for _, event, index, data in chip.events() if event == 10]
    assert addressed == [(1, 0)]


# ---------------------------------------------------------------- controls that nobody committed
def test_auto_clear_is_not_left_in_passing():
    """HW-008, EX-033: auto clear sets HOST_CTRL.offline, so that a commit about something else keeps the end state; the
    host leaves it by taking that bit back."""
    chip = Chip(network()).start()
    chip.cycle()
    assert chip.function(10)[0] == chip.function(17, 1)[0] == chip.function(33, 1)[0] == 0
    chip.until(lambda: chip.read("PHASE") == 3)
    assert not chip.read("HOST_CTRL") & OFFLINE_BIT
    chip.slaves.pop(0)
    shown = []
    clocked(chip, lambda: shown.append(chip.read("HOST_CTRL")) if chip.read("PHASE") == 0 and not shown else None)
    chip.until(lambda: chip.read("PHASE") == 0)
    del chip.run
    word = chip.read("HOST_CTRL")
    assert word == PROTECTED_BIT | OFFLINE_BIT | EXCHANGE_BIT | 1 << 5 == shown[0]  # not later than the phase
    assert [event for _, event, *_ in chip.events()].count(AUTO_CLEAR) == 1
    chip.put("PP", 2, 1, 3)
    chip.write("HOST_SEQ", chip.read("HOST_SEQ") + 1)
    chip.event(HOST_ATTN)
    assert chip.read("FW_RESULT") == 0 and chip.read("FW_SEQ") == chip.read("HOST_SEQ")
    sent = len(chip.log)
    for _ in range(20):
        chip.step()
    assert len(chip.log) == sent and chip.read("PHASE") == 0
    chip.write("HOST_CTRL", PROTECTED_BIT | EXCHANGE_BIT)
    chip.write("HOST_SEQ", chip.read("HOST_SEQ") + 1)
    chip.event(HOST_ATTN)
    chip.until(lambda: chip.list("LAS") == {2, 34} and chip.read("PHASE") == 3)


@pytest.mark.parametrize("clocks", [0, 1_000, 2_500, 4_000, 6_000, 12_000])
def test_auto_clear_during_a_commit(clocks):
    """HW-002, EX-033: auto clear stops the line while the firmware is taking a commit about something else, early or
    late in it: the commit is taken and the line stays off."""
    chip = Chip(network()).start()
    chip.cycle()
    assert chip.function(10)[0] == chip.function(17, 1)[0] == chip.function(33, 1)[0] == 0
    chip.until(lambda: chip.read("PHASE") == 3)
    for _ in range(3):
        chip.cycle()
    chip.slaves.pop(0)
    while chip.link[link_at("SLOT_STATE") // 4 + 1] >> 16 & 7 < 2:
        chip.cycle()
    chip.run = lambda: chip
    chip.cycle()  # the third: what it raises comes later
    events, chip.r.event = chip.r.event, HOST_ATTN
    chip.put("PP", 2, 1, 3)
    chip.write("HOST_SEQ", chip.read("HOST_SEQ") + 1)
    chip.lib.soc_clocks(clocks)
    chip.r.event |= events
    del chip.run
    chip.run()
    assert events & SLAVE_LOST and chip.read("FW_SEQ") == chip.read("HOST_SEQ") and chip.read("FW_RESULT") == 0
    assert chip.list("LPS") == {1, 2, 34} and chip.read("HOST_CTRL") & OFFLINE_BIT
    sent = len(chip.log)
    for _ in range(20):
        chip.step()
    assert len(chip.log) == sent and chip.read("PHASE") == 0


def test_monitor_stays_silent():
    """HW-008, ST-007: functions in a passive monitor do not switch the line on; 18 says what comes after it."""
    chip = Chip(network()).start()
    assert chip.commit(raw=MONITOR_BIT) == 0
    chip.step()
    sent = len(chip.log)
    assert chip.function(18, 2)[0] == chip.function(3, 1, 5)[0] == 0
    assert chip.read("HOST_CTRL") == EXCHANGE_BIT | MONITOR_BIT
    for _ in range(20):
        chip.step()
    assert len(chip.log) == sent and chip.read("PHASE") == 0
    assert chip.function(18, 1)[0] == 0 and chip.read("HOST_CTRL") == EXCHANGE_BIT | OFFLINE_BIT | MONITOR_BIT
    assert chip.function(18, 2)[0] == 0 and chip.commit() == 0
    chip.until(lambda: chip.list("LAS") == {1, 2, 34})


# ---------------------------------------------------------------- HW-009
def test_no_torn_values():
    """HW-009, FN-025, FN-026, CT-002: the host turns AODI over at every clock, and each value that the slaves take is
    one of the two, whole; AIDI, CTT_STATE and SAFE_IN change only while IN_SEQ is odd, values never by halves, and the
    host sees only values that the slave has sent."""
    sent = [0x0000]

    def feed(channel):
        sent.append(0xFFFF - sent[-1])
        return sent[-1], 0, 1
    source, sink = Ctt1(feed=feed), Ctt1(output=True, channels=2)
    chip = Chip([Ctt1Slave(8, 0xC, source), Ctt1Slave(9, 5, sink), Slave(3, id=0xB, inputs=0)] + network()).start()
    chip.r.shake_address, chip.r.shake_bytes = host_at("AODI") + 4 * 2 * 9, 8
    seen = set()

    def look():
        if not chip.read("IN_SEQ") & 1:
            seen.add((chip.read("AIDI", 16) & 0xFFFF, chip.read("CTT_STATE", 2) & 15))
    for k in range(260):
        if k == 200:  # clock by clock for a while: what a host could read at any time
            clocked(chip, look)
        chip.cycle()
    taken = sink.values_taken
    assert set(taken[0]) == set(taken[1]) == {0x0000, 0xFFFF}
    assert min(len(taken[0]), len(taken[1])) > 10
    assert {0x0000, 0xFFFF} <= {value for value, valid in seen if valid} <= {0x0000, 0xFFFF}
    assert chip.r.analog_writes > 20 and chip.r.combined_writes >= 2 and chip.r.safe_writes > 100
    assert chip.r.torn_writes == chip.r.seq_violations == 0


# ---------------------------------------------------------------- HW-010
def test_log_before_its_head():
    """HW-010, EX-038: in the very clock in which LOG_HEAD moves, the events it tells of are complete; they do not
    change any more, the order is that of time, and nothing is missing from power-up to a new slave."""
    chip = Chip(network()).run()
    taken = {}

    def look():
        head = chip.read("LOG_HEAD")
        for n in range(look.head, head):
            taken[n] = chip.read("LOG", 2 * n), chip.read("LOG", 2 * n + 1)
        look.head = head
    look.head = 0
    look()
    clocked(chip, look)
    chip.until(lambda: chip.read("PHASE") == 3, 60)
    new = Slave(5, id=2)
    chip.slaves.append(new)
    chip.until(lambda: chip.list("LAS") == {1, 2, 5, 34}, 100)
    assert look.head < 64 and sorted(taken) == list(range(look.head))
    assert all(taken[n] == (chip.read("LOG", 2 * n), chip.read("LOG", 2 * n + 1)) for n in taken)
    events = chip.events()
    assert [t for t, *_ in events] == sorted(t for t, *_ in events)
    assert [e[1:] for e in events] == [(START, 0, 0), (PHASE, 0, 1), (PHASE, 0, 2), (PHASE, 0, 3), (CONFIG_OK, 1, 0),
                                       (DETECTED, 5, new.codes), (ACTIVATED, 5, 0)]


def test_log_overflow():
    """HW-010, EX-038: 124 events at once: LOG_HEAD counts all, LOG has the last 64 in order."""
    chip = Chip(full_network()).start()
    for _ in range(3):
        chip.cycle()
    head = chip.read("LOG_HEAD")
    chip.slaves.clear()
    chip.run = lambda: chip  # the firmware is late, or they come in two halves
    for _ in range(6):
        chip.cycle()
    del chip.run
    chip.run()
    assert chip.list("LDS") == set() and chip.read("LOG_HEAD") - head == 125
    events = [(event, index) for _, event, index, _ in chip.events()]
    pairs = [(event, index) for index in range(1, 64) for event in (DEACTIVATED, GONE) if index != 32]
    tail = [e for e in events if e[0] in (DEACTIVATED, GONE)]
    assert len(events) == 64 and tail == pairs[-len(tail):] and len(tail) >= 60
    times = [t for t, *_ in chip.events()]
    assert times == sorted(times) and times[-1] <= chip.read("TIME_US")


def test_history():
    """HW-010, EX-034, EX-036, EX-037: CHANGED_*, OFFLINE_* and SUSPECTS follow losses, the host's OFFLINE, power fails
    and garbled answers in the statistics."""
    chip = Chip(network()).start()
    chip.cycle()
    assert chip.list("CHANGED_SLAVES") == {1, 2, 34} and chip.read("OFFLINE_CAUSES") == 1
    assert chip.list("SUSPECTS") == set()
    assert chip.function(10)[0] == 0 and chip.read("FLAGS") & 1
    before = chip.read("TIME_US")
    for index, left in ((1, {2, 34}), (34, {2})):  # one after the other: each is news
        chip.slaves[:] = [s for s in chip.slaves if s.index != index]
        chip.until(lambda: chip.list("LDS") == left)
        assert chip.list("CHANGED_SLAVES") == {index} and before < chip.read("CHANGED_TIME") <= chip.read("TIME_US")
        before = chip.read("CHANGED_TIME")
    assert chip.commit(offline=1) == 0
    assert chip.read("OFFLINE_CAUSES") == 1 << 16 | 0b11 and before < chip.read("OFFLINE_TIME") <= chip.read("TIME_US")
    first = chip.read("OFFLINE_TIME")
    assert chip.commit() == 0
    chip.until(lambda: chip.read("PHASE") == 3)
    chip.power(True)
    assert chip.read("OFFLINE_CAUSES") == 2 << 16 | 0b111 and chip.read("OFFLINE_TIME") > first
    chip.power(False)
    chip.until(lambda: chip.read("PHASE") == 3)
    stats = chip.lib.soc_stats()
    for _ in range(40):  # 20 garbled answers among good ones, none missing
        stats[16 * 2 + 0] += 3
        stats[16 * 2 + 7] += 1
        for _ in range(70):
            chip.tick()
        chip.cycle()
        if chip.list("SUSPECTS"):
            break
    assert chip.list("SUSPECTS") == {2} and stats[16 * 2 + 7] >= 12
    assert [(index, data) for _, event, index, data in chip.events() if event == SUSPECT] == [(2, 1)]


def test_store_word_without_flash():
    """HW-010, NV-005: without a flash STORE says so, a store fails at once and shows as failed, the line goes on."""
    chip = Chip(network()).start()
    assert chip.read("STORE") == 0
    cycles = chip.read("CYCLES")
    assert chip.function(3, 1, 5)[0] == 0
    chip.until(lambda: chip.read("STORE") & 0x30 == 0x20, 50)  # not busy, failed
    assert chip.read("STORE") == 0x20
    chip.cycle()
    assert chip.read("CYCLES") > cycles and chip.read("PHASE") == 3
