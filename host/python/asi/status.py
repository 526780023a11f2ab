# SPDX-License-Identifier: Apache-2.0
"""Numbers of the firmware as names: errors (firmware/core/asi_status.h), events and causes (firmware/core/asi_log.h).

The headers are their home; a test compares. Unknown numbers of a newer firmware stay numbers (`name_of`).
"""
from enum import IntEnum


class Status(IntEnum):
    """asi_status_t: how a function or a commit ended."""
    OK = 0
    ARG = -1
    STATE = -2
    BUSY = -3
    ABORTED = -4
    PROTECTED = -5
    SLAVE0 = -6
    NOT_DETECTED = -7
    NOT_ACTIVE = -8
    ADDRESS_USED = -9
    NO_ANSWER = -10
    DELETE = -11
    READ_ID1 = -12
    WRITE_ID1 = -13
    ID1_TEMPORARY = -14
    SET_ADDRESS = -15
    ADDRESS_TEMPORARY = -16
    PROFILE = -17
    OVERFLOW = -18
    AUTO_CLEAR = -19
    AUTO_CLEAR_MODE = -20
    POWER = -21
    OFFLINE = -22
    TRANSFER = -23
    DEVICE = -24
    STORE = -25


class LogEvent(IntEnum):
    """asi_event_kind_t: what the event log tells."""
    START = 1
    PHASE = 2
    OFFLINE = 3
    DETECTED = 4
    GONE = 5
    ACTIVATED = 6
    DEACTIVATED = 7
    CONFIG_OK = 8
    PERIPHERY_FAULT = 9
    ADDRESSED = 10
    APF = 11
    SUSPECT = 12
    AUTO_CLEAR = 13
    STORED = 14
    CTT = 15


class OfflineCause(IntEnum):
    """asi_offline_cause_t: why the line is offline."""
    START = 0
    HOST = 1
    POWER = 2
    MODE = 3
    AUTO_CLEAR = 4


class StoreState(IntEnum):
    """STORE.state of the host window."""
    NO_FLASH = 0
    EMPTY = 1
    LOADED = 2
    CORRUPT = 3


def name_of(kind: type[IntEnum], number: int) -> str:
    """Name of a number, or the number as text when a newer firmware has more of them."""
    try:
        return kind(number).name
    except ValueError:
        return str(number)
