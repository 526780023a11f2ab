# SPDX-License-Identifier: Apache-2.0
import pytest

from asi import regmap
from asi.plant import Codes, Host
from asi.window import COUNTERS, FLAGS, INDICES, HostWindow, WindowError


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
