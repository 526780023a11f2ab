# SPDX-License-Identifier: Apache-2.0
"""Calls and lists of the core against the telegram codec of the host tools, which was written on its own."""
import random

import pytest
from native import load

from asi.telegram import decode_call, encode_call

COMMANDS = ("DELA", "RES", "RDIO", "RDID", "RID1", "RID2", "RDST")
INDICES = [*range(1, 32), *range(33, 64)]


def call(name, index=0, data=0, extended=False):
    return load()[1].fw_call(name.encode(), index, data, extended)


@pytest.mark.parametrize("name", ["DEXG", "WPAR"])
def test_data_and_parameter_calls(name):
    """CA-001, CA-002, CA-004: every slave, nibble and addressing mode; a B index has ~Sel in I3 without being told."""
    for index in INDICES:
        for data in range(16):
            for extended in (False, True):
                assert call(name, index, data, extended) == encode_call(name, index, data, extended)
    assert call(name, 5, 0b1010, True) & 0xF == 0b1010  # A: I3 = 1
    assert call(name, 37, 0b1010, True) & 0xF == 0b0010  # B: I3 = 0


def test_commands():
    """CA-003, CA-004: every command to every slave; B is A with I3 inverted."""
    for name in COMMANDS:
        for index in ([] if name == "DELA" else [0]) + INDICES:
            assert call(name, index) == encode_call(name, index), (name, index)
            assert call(name, index) ^ call(name, index ^ 32) == 8
    for data in range(32):
        assert call("ADRA", data=data) == encode_call("ADRA", data=data)
    for data in range(16):
        assert call("WID1", data=data) == encode_call("WID1", data=data)
    assert call("BR01") == encode_call("BR01")


def test_index_of_a_call():
    """ST-001, CA-004: the index a call is meant for, as the decoder of the host tools reads it."""
    lib = load()[1]
    for payload in range(0x800):
        for extended in (False, True):
            decoded = decode_call(payload, lambda number: extended)
            if decoded.name not in ("BR01", "?") and lib.fw_call_is_legal(payload):
                index = decoded.index & (63 if payload & 0x3E0 else 31)
                assert lib.fw_call_index(payload, extended) == index, hex(payload)


def test_worked_words():
    """CA-003: the words printed in the specification notes, E1 .. E11 (14-bit request = payload, parity, end bit)."""
    def word(payload):
        return payload << 2 | (payload.bit_count() & 1) << 1 | 1
    calls = [call("DEXG", 5, 0b1010), call("WPAR", 12, 6), call("ADRA", data=7), call("BR01")]
    assert [word(c) for c in calls] == [0x02A9, 0x065B, 0x001F, 0x1FD7]
    assert [word(call(n, 5)) for n in COMMANDS] == [0x1283, 0x12F1, 0x12C1, 0x12C7, 0x12CB, 0x12CD, 0x12FB]
    assert [word(call(n, 37)) for n in COMMANDS] == [0x12A1, 0x12D3, 0x12E3, 0x12E5, 0x12E9, 0x12EF, 0x12D9]


def test_legal_calls():
    """CA-003: of all 2048 payloads exactly those of the call table are legal; PRGM and reserved codes are not."""
    legal = {encode_call(n, i, d, e) for n in ("DEXG", "WPAR") for i in INDICES for d in range(16) for e in (0, 1)}
    legal |= {encode_call("ADRA", data=d) for d in range(32)} | {encode_call("WID1", data=d) for d in range(1, 16)}
    legal |= {encode_call(n, i) for n in COMMANDS for i in INDICES} | {encode_call("BR01")}
    legal |= {encode_call(n, i) for n in COMMANDS if n != "DELA" for i in (0, 32)} | {encode_call("WID1", data=0)}
    legal |= {encode_call("R1", i) ^ select for i in range(32) for select in (0, 8)}
    lib = load()[1]
    assert {c for c in range(4096) if lib.fw_call_is_legal(c)} == legal
    assert not lib.fw_call_is_legal(encode_call("PRGM")) and decode_call(encode_call("PRGM")).name == "PRGM"


def test_list_iteration():
    """EX-004: iterating a 64-bit list in two words finds every member once, rising."""
    lib, dice = load()[1], random.Random(1)
    cases = [0, 1, 1 << 63, 1 << 31, 1 << 32, (1 << 64) - 1] + [1 << k for k in range(64)]
    cases += [dice.getrandbits(64) & dice.getrandbits(64) for _ in range(200)]
    for bits in cases:
        words, found, i = [bits & 0xFFFFFFFF, bits >> 32], [], 0
        while (i := lib.fw_list_next(words, i)) < 64:
            found.append(i)
            i += 1
        assert i == 64 and found == [k for k in range(64) if bits >> k & 1]
