# SPDX-License-Identifier: Apache-2.0
"""Calls, telegrams and pulses of the AS-Interface line.

A *call* is the 11-bit payload CB A4..A0 I4..I0 of a request; an *index* is number + 32 * Sel
(0, 1..31 = standard or A, 33..63 = 1B..31B). Times are in nanoseconds from the first pulse.
Rules: TL-001..TL-006, CA-001..CA-015 (docs/requirements.md).
"""
from dataclasses import dataclass

HALF_BIT_NS = 3_000
BIT_NS = 2 * HALF_BIT_NS

# (mnemonic, CB, I4 I3 I2 I1 I0 as a pattern): d = data bit, s = Sel, n = ~Sel; x = data or ~Sel
_PATTERNS = (
    ("DEXG", 0, "0xddd"), ("WPAR", 0, "1xddd"), ("DELA", 1, "0s000"), ("RES", 1, "1n100"), ("RDIO", 1, "1s000"),
    ("RDID", 1, "1s001"), ("RID1", 1, "1s010"), ("RID2", 1, "1s011"), ("RDST", 1, "1n110"),
    ("R1", 1, "1n111"),
)
CALLS = tuple(p[0] for p in _PATTERNS) + ("ADRA", "WID1", "BR01", "PRGM")


def index_name(index):
    """5 -> '5', 37 -> '5B'. (Whether 5 is a standard or an A slave is not in the index.)"""
    return f"{index & 31}{'B' if index & 32 else ''}"


def parse_index(text):
    """'5', '5A' -> 5, '5B' -> 37, '0' -> 0; ValueError otherwise."""
    text = str(text).strip().upper()
    number, sel = (text[:-1], text[-1] == "B") if text[-1:] in ("A", "B") else (text, False)
    if not number.isdecimal() or not 0 <= int(number) <= 31 or (int(number) == 0 and text != "0"):
        raise ValueError(f"'{text}' is not an AS-i address (0, 1..31, 1A..31A, 1B..31B)")
    return int(number) + 32 * sel


def address_name(index: int, extended: bool) -> str:
    """Index -> '5', '5A', '5B'; extended: the number is used with A/B addressing."""
    return index_name(index) + ("A" if extended and 0 < index < 32 else "")


def line_order(index: int) -> tuple[int, int]:
    """Sort key: by number, A before B."""
    return index & 31, index >> 5


def parse_numbers(text: str) -> frozenset[int]:
    """'5,7,20-31' -> numbers 1..31; ValueError with the part that is none."""
    out: set[int] = set()
    for part in text.split(","):
        first, _, last = part.strip().partition("-")
        if not (first.isdecimal() and (last or first).isdecimal() and 1 <= int(first) <= int(last or first) <= 31):
            raise ValueError(f"'{part.strip()}' is no number or range within 1..31")
        out.update(range(int(first), int(last or first) + 1))
    return frozenset(out)


def encode_call(name, index=0, data=0, extended=False):
    """-> 11-bit call. data: I3..I0 (DEXG, WPAR, WID1) or the new address number (ADRA).

    extended: DEXG and WPAR to an A/B slave, whose I3 is ~Sel. A B index is always extended.
    """
    number, sel = index & 31, index >> 5
    if name == "ADRA":
        return data & 31
    if name == "WID1":
        return 1 << 10 | data & 15
    if name == "BR01":
        return 1 << 10 | 31 << 5 | 0b10101
    if name == "PRGM":
        return 1 << 10 | 0b11101
    for mnemonic, control, pattern in _PATTERNS:
        if mnemonic == name:
            break
    else:
        raise ValueError(f"unknown call '{name}', one of {', '.join(CALLS)}")
    info = 0
    for position, kind in zip((4, 3, 2, 1, 0), pattern):
        bit = {"0": 0, "1": 1, "s": sel, "n": 1 - sel, "d": data >> position & 1,
               "x": 1 - sel if extended or sel else data >> position & 1}[kind]
        info |= bit << position
    return control << 10 | number << 5 | info


@dataclass(frozen=True)
class Decoded:
    """A decoded call: mnemonic, slave index (None: not one slave), data nibble or new number (None: no data)."""
    name: str
    index: int | None
    data: int | None


def decode_call(call, extended=lambda number: False):
    """11-bit call -> Decoded. extended(number): True when that number is known to use A/B addressing.

    DELA to address 0 and WID1 with the code 0 are one word; nobody deletes address 0, so it is WID1.
    """
    control, number, info = call >> 10 & 1, call >> 5 & 31, call & 31
    if number == 0 and not control:
        return Decoded("ADRA", 0, info)
    if control and number == 0 and not info & 16:
        return Decoded("WID1", 0, info & 15)
    if control and number == 31 and info == 0b10101:
        return Decoded("BR01", None, None)
    if control and number == 0 and info == 0b11101:
        return Decoded("PRGM", None, None)
    if not control:
        name = "WPAR" if info & 16 else "DEXG"
        if extended(number):
            return Decoded(name, number + (0 if info & 8 else 32), info & 7)
        return Decoded(name, number, info & 15)
    for mnemonic, ctrl, pattern in _PATTERNS:
        for sel in (0, 1):
            if ctrl and encode_call(mnemonic, number + 32 * sel) & 31 == info:
                return Decoded(mnemonic, number + 32 * sel, None)
    return Decoded("?", number, None)


def request_word(call):
    """11-bit call -> 14-bit request ST CB A I PB EB."""
    return call << 2 | (call.bit_count() & 1) << 1 | 1


def response_word(data):
    """Nibble -> 7-bit response ST I PB EB."""
    return data << 2 | (data.bit_count() & 1) << 1 | 1


def pulses(word, bits):
    """Telegram word -> [(time_ns, polarity)], polarity -1 or +1, time from the first pulse (TL-005)."""
    values = [word >> (bits - 1 - k) & 1 for k in range(bits)]
    out = []
    for k, bit in enumerate(values):
        polarity = 1 if bit else -1
        out.append((k * BIT_NS, polarity))
        if k + 1 < bits and values[k + 1] == bit:
            out.append((k * BIT_NS + HALF_BIT_NS, -polarity))
    return out


def request_pulses(call):
    return pulses(request_word(call), 14)


def response_pulses(data):
    return pulses(response_word(data), 7)
