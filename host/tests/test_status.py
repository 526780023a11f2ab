# SPDX-License-Identifier: Apache-2.0
"""Names of the tools against their homes in the firmware's headers and the register map."""
import re
from pathlib import Path

import pytest

from asi import ctt_table, regmap
from asi.combined import (ANALOG_WORDS, PLAIN, S74_STRINGS, SAFETY_TABLE, STRING_BYTES, Kind, cyclic_words, kind_of,
                          word_at)
from asi.status import LogEvent, OfflineCause, Status, StoreState, name_of
from asi.window import LOG_EVENTS, Function

ROOT = Path(__file__).resolve().parents[2]
CORE = ROOT / "firmware/core"


def enumeration(header, prefix):
    """Members of the enumeration whose names begin with prefix: {rest of the name: value}."""
    text = re.sub(r"/\*.*?\*/", "", (CORE / header).read_text(), flags=re.S)
    return {name: int(value) for name, value in re.findall(rf"\b{prefix}(\w+) = (-?\d+)", text)}


def test_numbers_are_those_of_the_firmware():
    """EX-025, EX-037, EX-038: every error, event and cause of the headers has its name here, and no other."""
    status = enumeration("asi_status.h", "ASI_E_") | {"OK": 0}
    assert {one.name: one.value for one in Status} == status
    assert {one.name: one.value for one in LogEvent} == enumeration("asi_log.h", "ASI_EVENT_")
    assert {one.name: one.value for one in OfflineCause} == enumeration("asi_log.h", "ASI_OFFLINE_")
    jobs = enumeration("asi_jobs.h", "ASI_JOB_")
    assert {jobs[name] for name in jobs if name not in ("NONE", "AUTO_ADDRESS")} < set(Function)
    assert Function.CHANGE_ADDRESS == jobs["CHANGE_ADDRESS"] and Function.WRITE_ID1 == jobs["WRITE_ID1"]
    states = re.search(r'desc = "([^"]*)"; } state\[3:0\]', (ROOT / "rdl/asi.rdl").read_text())[1]
    assert re.findall(r"(\d) ", states) == [str(one.value) for one in StoreState]


def test_unknown_numbers_stay_numbers():
    """EX-038: a newer firmware's number is shown, not refused."""
    assert name_of(Status, -25) == "STORE" and name_of(Status, -99) == "-99" and name_of(LogEvent, 200) == "200"


def test_sizes_fit_the_window():
    """FN-025, FN-026, CT-014: words, string and log are as large as the register map says."""
    assert regmap.HOST_AODI - regmap.HOST_AIDI == 32 * ANALOG_WORDS * 2
    assert regmap.HOST_CTT_STATE - regmap.HOST_FN_STRING == STRING_BYTES
    assert regmap.HOST_STAT - regmap.HOST_LOG >= 8 * LOG_EVENTS and ctt_table.CTT2_MESSAGE_BYTES <= STRING_BYTES


@pytest.mark.parametrize("profile, kind", [
    ((0, 0, 15), PLAIN), ((7, 0xA, 0xE), PLAIN), ((7, 4, 0), PLAIN), ((6, 0, 5), PLAIN), ((6, 0, 7), PLAIN),
    ((0, 1, 5), PLAIN), ((7, 5, 0xE), PLAIN), ((0, 5, 5), PLAIN), ((7, 0xF, 0xC), PLAIN),
    ((7, 3, 0xC), Kind("CTT1", 1)), ((7, 3, 0xD), Kind("CTT1", 2)), ((7, 3, 0xE), Kind("CTT1", 4)),
    ((7, 3, 0xF), Kind("CTT1", 4)), ((7, 3, 5), Kind("CTT1", 0, 2, heard=2)), ((7, 1, 8), Kind("CTT1", 1)),
    ((7, 4, 0xC), Kind("CTT1", 1, strings=True)), ((7, 4, 4), Kind("CTT1", 0, 1, True, heard=1)),
    ((7, 5, 5), Kind("CTT2", 4, 4, True, True, heard=4)), ((7, 0xA, 5), Kind("CTT2", 2, 2, True, True, heard=2)),
    ((0xB, 0xA, 5), Kind("CTT2", 2, 2, True, True, heard=2)), ((7, 0xA, 7), Kind("CTT3", heard=1)),
    ((7, 0xA, 0xA), Kind("CTT3", 1, 1, heard=1)), ((7, 0xA, 8), Kind("CTT4", 1)), ((7, 0xA, 9), Kind("CTT4", 2)),
    ((6, 0, 0xA), Kind("CTT5", 1, 1, group=True)), ((6, 0, 0xC), Kind("CTT5", 1, 1, group=True)),
    ((0, 0xB, 15), Kind("safety", safety=True)), ((7, 0xB, 0), Kind("safety", safety=True))])
def test_kinds_follow_from_the_codes(profile, kind):
    """CT-001: what a slave exchanges follows from IO, ID and ID2."""
    assert kind_of(*profile) == kind


def test_words_of_a_channel():
    """FN-025: four words of a number; a B slave has the last two."""
    assert [word_at(5, channel) for channel in range(4)] == [20, 21, 22, 23]
    assert [word_at(5 + 32, channel) for channel in range(2)] == [22, 23] and word_at(31, 3) == 127
    for index, channel in ((0, 0), (32, 0), (64, 0), (5, 4), (37, 2), (5, -1)):
        with pytest.raises(ValueError):
            word_at(index, channel)


def test_cyclic_words_of_the_id_object():
    """CT-021: the I/O configuration byte says how many words there are; an unknown one says nothing."""
    assert [cyclic_words(bytes((0, 0, 0, 0, byte))) for byte in (0x22, 0x00, 0x13, 0x54, 0x08, 0x60)] == [
        (1, 1), (0, 0), (2, 1), (3, 4), (0, 0), None]
    assert cyclic_words(None) is None and cyclic_words(b"1234") is None


def test_strings_and_the_safety_table():
    """CT-014, CT-060: three strings of S-7.4; the table used when none is given has eight different legal words."""
    assert S74_STRINGS == {"id": 0, "diagnosis": 1, "parameters": 2}
    assert len(set(SAFETY_TABLE)) == 8 and not {0, 15} & set(SAFETY_TABLE)
