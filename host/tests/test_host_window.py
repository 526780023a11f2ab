# SPDX-License-Identifier: Apache-2.0
import pytest

from asi import regmap
from asi.plant import Codes, Host
from asi.regmap import Phase
from asi.report import event_text
from asi.status import LogEvent, Status
from asi.telegram import index_name
from asi.window import (COUNTERS, FLAGS, INDICES, Analog, Event, Function, FunctionError, HostWindow, Storage,
                        WindowError)


class Memory:
    """A dual-port memory; `script` may change a word just before it is read."""

    def __init__(self):
        self.words, self.reads, self.script = {}, 0, lambda memory, addr: None

    def host_read(self, addr):
        self.reads += 1
        self.script(self, addr)
        return self.words.get(addr, 0)

    def host_write(self, addr, data, be=15):
        assert be == 15 and addr % 4 == 0 and 0 <= data < 1 << 32
        self.words[addr] = data


def test_inputs_of_one_cycle():
    """HW-003: an image that changes while it is read is read again; the result is from one publication."""
    memory = Memory()

    def publish(memory, addr):  # the first two tries are hit in the middle, the third by an odd IN_SEQ
        if memory.reads in (5, 15):
            memory.words[regmap.HOST_IN_SEQ] = memory.words.get(regmap.HOST_IN_SEQ, 0) + 2
            for k in range(8):
                memory.words[regmap.HOST_IN_IMG + 4 * k] = 0x1111_1111 * memory.reads
        if memory.reads == 21:
            memory.words[regmap.HOST_IN_SEQ] += 1
        if memory.reads == 29:
            memory.words[regmap.HOST_IN_SEQ] += 1
    memory.script = publish
    assert HostWindow(memory).inputs() == [15] * 64


def test_inputs_during_a_long_publication():
    """HW-003: a publication with the codes of 62 slaves outlasts thousands of reads; its end is waited for."""
    memory = Memory()
    memory.words.update({regmap.HOST_IN_SEQ: 7, regmap.HOST_IN_IMG: 5})
    memory.script = lambda m, addr: m.words.update({regmap.HOST_IN_SEQ: 7 + (m.reads > 4_000)})
    assert HostWindow(memory).inputs()[0] == 5


def test_inputs_never_consistent():
    """HW-003: an image that never holds still, or is being written for ever, is an error, not a guess."""
    memory = Memory()
    memory.words[regmap.HOST_IN_SEQ] = 1
    with pytest.raises(WindowError):
        HostWindow(memory).inputs()
    memory = Memory()
    memory.script = lambda m, addr: m.words.update({regmap.HOST_IN_SEQ: m.words.get(regmap.HOST_IN_SEQ, 0) + 2})
    with pytest.raises(WindowError):
        HostWindow(memory).inputs()


def test_nibble_and_code_places():
    """HW-004: images, lists, codes and parameters are found where the register map puts them."""
    memory, window = Memory(), None
    window = HostWindow(memory)
    for index in INDICES:
        window.set_output(index, index % 16)
    assert window.outputs() == [0 if i == 32 else i % 16 for i in range(64)]
    assert memory.words[regmap.HOST_OUT_IMG] == 0x7654_3210
    window.set_output(7, 0)
    assert memory.words[regmap.HOST_OUT_IMG] == 0x0654_3210
    host = Host(True, {1: Codes(1, 2, 3, 4), 63: Codes(7, 10, 15, 14)}, {63: 5}, {1: 9}, False, True)
    sequence = window.configure(host)
    assert memory.words[regmap.HOST_PCD] == 0x4321_FFFF and memory.words[regmap.HOST_PCD + 4 * 31] == 0xEFA7_FFFF
    assert memory.words[regmap.HOST_PP + 60] == 0x050F_0F0F
    assert (memory.words[regmap.HOST_LPS_CFG], memory.words[regmap.HOST_LPS_CFG + 4]) == (2, 1 << 31)
    assert memory.words[regmap.HOST_HOST_CTRL] == 0b1001 and memory.words[regmap.HOST_HOST_SEQ] == sequence == 1
    for k in range(32):
        memory.words[regmap.HOST_CDI + 4 * k] = memory.words[regmap.HOST_PCD + 4 * k]
    assert window.detected_codes() == host.pcd
    for k, name in enumerate(FLAGS):
        memory.words[regmap.HOST_FLAGS] = 1 << k
        assert [flag for flag, on in window.flags().items() if on] == [name]
    memory.words.update({regmap.HOST_LAS: 1 << 5, regmap.HOST_LAS + 4: 1 << 5, regmap.HOST_SENT: 77})
    assert window.state().las == {5, 37} and window.state().counters["sent"] == 77
    assert tuple(window.state().counters) == COUNTERS


def test_commit_and_result():
    """HW-002: a commit is open until FW_SEQ follows; then its result is 0 or a negative status."""
    memory = Memory()
    memory.words[regmap.HOST_HOST_SEQ] = memory.words[regmap.HOST_FW_SEQ] = 0xFFFF_FFFF
    window = HostWindow(memory)
    sequence = window.set_control(protected_mode=True)
    assert sequence == 0 and window.result(sequence) is None  # wraps
    memory.words[regmap.HOST_FW_SEQ] = 0
    assert window.result(sequence) == 0
    memory.words[regmap.HOST_FW_RESULT] = 0xFFFF_FFFD
    assert window.result(sequence) == -3
    window.set_control(protected_mode=False, offline=True)
    assert memory.words[regmap.HOST_HOST_CTRL] == 0b10


# ---------------------------------------------------------------- functions
def serve(memory, answers):
    """The memory answers functions from `answers`: (status, data, string) one after the other, on the second look."""
    looks = {}

    def script(m, addr):
        sequence = m.words.get(regmap.HOST_FN_SEQ, 0)
        if addr != regmap.HOST_FN_DONE or m.words.get(addr, 0) == sequence:
            return
        looks[sequence] = looks.get(sequence, 0) + 1
        if looks[sequence] == 2 and answers:
            status, data, string = answers.pop(0)
            for k in range(0, len(string), 4):
                m.words[regmap.HOST_FN_STRING + k] = int.from_bytes(string[k:k + 4], "little")
            m.words.update({regmap.HOST_FN_LEN: len(string), regmap.HOST_FN_STATUS: status & 0xFFFF_FFFF,
                            regmap.HOST_FN_DATA: data, addr: sequence})
    memory.script = script
    return memory


def asked(memory):
    """-> code, arguments, string bytes as the firmware finds them."""
    words = memory.words
    data = b"".join(words.get(regmap.HOST_FN_STRING + 4 * k, 0).to_bytes(4, "little") for k in range(56))
    return (words[regmap.HOST_FN_CODE], words[regmap.HOST_FN_ARG], words[regmap.HOST_FN_ARG + 4],
            data[:words[regmap.HOST_FN_LEN]])


CODES = Codes(3, 1, 15, 14)
CALLS = [
    ("set_permanent_parameter", (5, 9), (3, 5, 9)), ("write_parameter", (37, 6), (5, 37, 6)),
    ("store_parameters", (), (7, 0, 0)), ("set_permanent_configuration", (5, CODES), (8, 5, CODES.word)),
    ("store_configuration", (), (10, 0, 0)), ("set_lps", ((1, 33, 63),), (12, 2, 0x8000_0002)),
    ("set_mode", (True,), (17, 1, 0)), ("set_mode", (False,), (17, 0, 0)), ("set_offline", (True,), (18, 1, 0)),
    ("set_offline", (False,), (18, 2, 0)), ("set_data_exchange", (True,), (19, 1, 0)),
    ("change_address", (5, 38), (20, 5, 38)), ("set_auto_address", (True,), (21, 1, 0)),
    ("execute", (0, 0x10), (22, 0, 0x10)), ("write_id1", (7,), (24, 7, 0)),
    ("read_parameter_string", (4,), (27, 4, 0)), ("read_diagnosis_string", (4,), (29, 4, 0)),
    ("read_id_string", (4,), (30, 4, 0)), ("set_auto_clear", (3,), (33, 3, 0)),
]


@pytest.mark.parametrize("name, arguments, words", CALLS, ids=[f"{name}{a}" for name, a, _ in CALLS])
def test_every_function_has_its_number_and_arguments(name, arguments, words):
    """FN-003, FN-005, FN-007, FN-008, FN-010, FN-012, FN-017 .. FN-022, FN-024, FN-027, FN-029, FN-030, EX-033: where
    the window wants them, and FN_SEQ last."""
    memory = serve(Memory(), [(0, 0b0110, b"\x01\x02\x03\x04\x05")])
    memory.words[regmap.HOST_FN_SEQ] = memory.words[regmap.HOST_FN_DONE] = 0xFFFF_FFFF
    order, write = [], memory.host_write
    memory.host_write = lambda addr, data, be=15: (order.append(addr), write(addr, data, be))
    waits = []
    out = getattr(HostWindow(memory, lambda: waits.append(1)), name)(*arguments)
    assert (memory.words[regmap.HOST_FN_CODE], memory.words[regmap.HOST_FN_ARG],
            memory.words[regmap.HOST_FN_ARG + 4]) == words
    assert order[-1] == regmap.HOST_FN_SEQ and memory.words[regmap.HOST_FN_SEQ] == 0 and len(waits) == 1
    expected = {"write_parameter": 6, "execute": 6, "read_parameter_string": b"\1\2\3\4\5",
                "read_diagnosis_string": b"\1\2\3\4\5", "read_id_string": b"\1\2\3\4\5"}
    assert out == expected.get(name)


def test_strings_both_ways():
    """FN-028, FN-031, CT-014: bytes in rising order, any length up to 224; longer ones are refused before anything."""
    memory = serve(Memory(), [(0, 0, b""), (0, 0, bytes(range(224)))])
    window = HostWindow(memory)
    window.write_parameter_string(4, b"\x41\x42\x03\x43")
    assert asked(memory) == (28, 4, 0, b"")         # the firmware has set FN_LEN to what came out: nothing
    assert memory.words[regmap.HOST_FN_STRING] == 0x4303_4241
    assert window.message(10, b"\x10\x00\x05") == bytes(range(224))
    before = dict(memory.words)
    with pytest.raises(ValueError, match="225 bytes, at most 224"):
        window.message(10, bytes(225))
    assert memory.words == before


def test_refused_functions_have_the_name_of_the_error():
    """EX-025, FN-020, FN-031: an error is raised with its name; only a device error keeps what the slave said."""
    memory = serve(Memory(), [(-9, 0, b""), (-24, 0, b"\x90\x01"), (-23, 0, b"rest"), (-77, 0, b"")])
    window = HostWindow(memory)
    with pytest.raises(FunctionError, match="change_address: ADDRESS_USED") as caught:
        window.change_address(1, 2)
    assert caught.value.status == Status.ADDRESS_USED and caught.value.name == "ADDRESS_USED"
    with pytest.raises(FunctionError, match="message: DEVICE") as caught:
        window.message(10, b"\x10\x09\x05")
    assert caught.value.answer.string == b"\x90\x01"
    with pytest.raises(FunctionError, match="read_id_string: TRANSFER") as caught:
        window.read_id_string(4)
    assert caught.value.answer.string == b""
    with pytest.raises(FunctionError, match="write_id1: -77"):
        window.write_id1(1)


def test_one_function_at_a_time(monkeypatch):
    """FN-032: while one is open the next is refused as BUSY and nothing is written; one without answer is an error."""
    memory = Memory()
    window = HostWindow(memory)
    sequence = window.begin_function(Function.READ_ID_STRING, 4)
    assert window.answer(sequence) is None
    before = dict(memory.words)
    with pytest.raises(FunctionError, match="write_parameter: BUSY"):
        window.write_parameter(5, 1)
    assert memory.words == before
    memory.words[regmap.HOST_FN_DONE] = sequence
    monkeypatch.setattr("asi.window.FUNCTION_TRIES", 3)
    with pytest.raises(WindowError, match="write_parameter: no answer"):
        window.write_parameter(5, 1)


def test_functions_may_change_the_controls():
    """FN-017, FN-021: the next commit keeps what a function has changed in HOST_CTRL; configure starts from nothing."""
    memory = Memory()
    window = HostWindow(memory)
    window.set_control(protected_mode=True)
    memory.words[regmap.HOST_HOST_CTRL] |= 0b1000 | 3 << 5      # the firmware shows automatic addressing, auto clear
    window.set_control(data_exchange=True)
    assert memory.words[regmap.HOST_HOST_CTRL] == 0b1101 | 3 << 5
    window.configure(Host(True))
    assert memory.words[regmap.HOST_HOST_CTRL] == 0b0101


# ---------------------------------------------------------------- analog values, safety
def test_places_of_analog_values():
    """FN-025, FN-026, CT-002: 16-bit values, two in a word, four of a number; neighbours stay; marks of CTT_STATE."""
    memory = Memory()
    window = HostWindow(memory)
    for channel in range(4):
        window.set_analog_output(5, channel, 0x1110 * (channel + 1))
    window.set_analog_output(5, 2, -2)
    assert memory.words[regmap.HOST_AODI + 40] == 0x2220_1110 and memory.words[regmap.HOST_AODI + 44] == 0x4440_FFFE
    assert [window.analog_output(5, channel) for channel in range(4)] == [0x1110, 0x2220, 0xFFFE, 0x4440]
    window.set_analog_output(5 + 32, 1, 7)                      # a B slave has the last two words of the number
    assert window.analog_output(5, 3) == 7
    memory.words.update({regmap.HOST_AIDI + 40: 0x8000_1234, regmap.HOST_CTT_STATE + 4: 0b0010_0001 << 8,
                         regmap.HOST_CTT_STATE + 36: 0b1101_0010 << 8})
    assert window.analog_input(5, 0) == Analog(0x1234, True) and window.analog_input(5, 1) == Analog(0x8000, False)
    assert window.analog_input(5, 1).signed == -32768 and window.analog_input(5, 0).signed == 0x1234
    state = window.ctt_state(5)
    assert (state.valid, state.ov, state.tv, state.transparent, state.string_open) == (
        (True, False, False, False), False, True, False, False)
    state = window.ctt_state(37)
    assert state.valid[1] and state.ov and not state.tv and state.transparent and state.string_open
    for bad in ((0, 0, 1), (37, 2, 1), (5, 4, 1), (5, 0, 65536), (5, 0, -32769)):
        with pytest.raises(ValueError):
            window.set_analog_output(*bad)
    host = Host(True, analog={3: (0x2710, 0xFFFF)})
    window.configure(host)
    assert memory.words[regmap.HOST_AODI + 24] == 0xFFFF_2710


def test_value_and_mark_of_one_publication():
    """CT-002, FN-025: a value that is published between mark and value is read again."""
    memory = Memory()

    def publish(m, addr):
        if m.reads == 3:                                        # after IN_SEQ and the mark, before the value
            m.words.update({regmap.HOST_IN_SEQ: 2, regmap.HOST_AIDI + 8: 0x7FFF, regmap.HOST_CTT_STATE: 0})
    memory.words.update({regmap.HOST_AIDI + 8: 0x55, regmap.HOST_CTT_STATE: 1 << 8})
    memory.script = publish
    assert HostWindow(memory).analog_input(1) == Analog(0x7FFF, False)


def test_safety_view():
    """CT-060: F-IN1 and F-IN2 as two lists."""
    memory = Memory()
    memory.words.update({regmap.HOST_SAFE_IN: 1 << 9, regmap.HOST_SAFE_IN + 8: 1 << 4, regmap.HOST_SAFE_IN + 12: 1})
    assert HostWindow(memory).safety() == ({9}, {4, 32})


# ---------------------------------------------------------------- event log, history, storage
def log(memory, *events):
    """Append (time_us, event, index, data) as the firmware does: the entry, then LOG_HEAD."""
    for time_us, event, index, data in events:
        head = memory.words.get(regmap.HOST_LOG_HEAD, 0)
        memory.words[regmap.HOST_LOG + 8 * (head % 64)] = time_us
        memory.words[regmap.HOST_LOG + 8 * (head % 64) + 4] = event | index << 8 | data << 16
        memory.words[regmap.HOST_LOG_HEAD] = head + 1 & 0xFFFF_FFFF


def test_event_log_loses_nothing_while_read():
    """EX-038: every event comes once and in order, over the end of the ring and the wrap of LOG_HEAD."""
    memory, got = Memory(), []
    window = HostWindow(memory)
    for burst in (1, 0, 63, 64, 5, 64):
        log(memory, *((len(got) + k, 6, 1 + (len(got) + k) % 31, 0) for k in range(burst)))
        events, lost = window.events()
        assert lost == 0 and len(events) == burst
        got += events
    assert [event.time_us for event in got] == list(range(197))
    assert (got[40].name, got[40].index) == ("activated", 10)
    window._log_next = memory.words[regmap.HOST_LOG_HEAD] = 0xFFFF_FFFF
    for slot, time_us in ((63, 1), (0, 2)):
        memory.words[regmap.HOST_LOG + 8 * slot] = time_us
    memory.words[regmap.HOST_LOG_HEAD] = 1
    events, lost = window.events()
    assert ([event.time_us for event in events], lost) == ([1, 2], 0)


def test_event_log_tells_what_was_lost():
    """EX-038: a reader that was too slow gets the last 64 and the number of those before; a restart loses none."""
    memory = Memory()
    window = HostWindow(memory)
    log(memory, *((k, 6, 1, 0) for k in range(200)))
    events, lost = window.events()
    assert lost == 136 and [event.time_us for event in events] == list(range(136, 200))
    memory.words[regmap.HOST_LOG_HEAD] = 0
    log(memory, (7, 1, 0, 2))
    events, lost = window.events()
    assert ([event.time_us for event in events], lost) == ([7], 0)


def test_event_log_is_never_torn():
    """EX-038: events that are published while others are read are not mixed with them."""
    memory = Memory()
    window = HostWindow(memory)
    log(memory, *((k, 6, 1, 0) for k in range(10)))

    def publish(m, addr):
        if m.reads == 9:
            log(m, *((1000 + k, 7, 2, 0) for k in range(64)))
            m.words[regmap.HOST_IN_SEQ] = 2
    memory.script = publish
    events, lost = window.events()
    assert lost == 10 and {(event.time_us // 1000, event.event) for event in events} == {(1, 7)} and len(events) == 64


@pytest.mark.parametrize("event, index, data, text", [
    (LogEvent.START, 0, 2, "start: LOADED"), (LogEvent.PHASE, 0, Phase.DETECTION, "phase: DETECTION"),
    (LogEvent.OFFLINE, 0, 2, "offline: POWER"), (LogEvent.DETECTED, 37, 0xEFA7, "detected 5B: S-7.A.E ID1 F"),
    (LogEvent.DETECTED, 0, 0xFF00, "detected 0: S-0.0.F ID1 F"), (LogEvent.GONE, 5, 0, "gone 5"),
    (LogEvent.CONFIG_OK, 3, 0, "config ok 3: 0"), (LogEvent.CONFIG_OK, 0, 1, "config ok: 1"),
    (LogEvent.PERIPHERY_FAULT, 4, 1, "periphery fault 4: fault"), (LogEvent.APF, 0, 0, "apf: power is back"),
    (LogEvent.ADDRESSED, 37, 0, "addressed 5B: from 0: OK"),
    (LogEvent.ADDRESSED, 5, 20 | 16 << 8, "addressed 5: from 20: ADDRESS_TEMPORARY"),
    (LogEvent.AUTO_CLEAR, 7, 3, "auto clear 7: mode 3"), (LogEvent.STORED, 0, 25, "stored: STORE"),
    (LogEvent.CTT, 8, 0, "ctt 8: broken off"), (LogEvent.SUSPECT, 8, 0, "suspect 8"), (99, 0, 5, "99: 5")])
def test_events_read_well(event, index, data, text):
    """EX-038: an event in words, its data as the header says; unknown ones are shown as numbers."""
    assert event_text(Event(1, int(event), index, data), index_name) == text


def test_history_and_storage():
    """EX-034, EX-036, EX-037, NV-005: causes and slaves by name; nothing there yet is None, not time 0."""
    memory = Memory()
    window = HostWindow(memory)
    history = window.history()
    assert (history.changed, history.changed_us, history.causes, history.last_cause, history.offline_us) == (
        frozenset(), None, (), None, None)
    memory.words.update({
        regmap.HOST_CHANGED_SLAVES: 8, regmap.HOST_CHANGED_SLAVES + 4: 4, regmap.HOST_CHANGED_TIME: 1_300_000,
        regmap.HOST_OFFLINE_CAUSES: 4 << 16 | 0b10101, regmap.HOST_OFFLINE_TIME: 99, regmap.HOST_SUSPECTS: 2,
        regmap.HOST_STORE: 0xBEEF << 16 | 1 << 6 | 1 << 4 | 3})
    history = window.history()
    assert (history.changed, history.changed_us, history.suspects) == ({3, 34}, 1_300_000, {1})
    assert history.causes == ("START", "POWER", "AUTO_CLEAR")
    assert (history.last_cause, history.offline_us) == ("AUTO_CLEAR", 99)
    assert window.storage() == Storage("CORRUPT", True, False, True, 0xBEEF)
