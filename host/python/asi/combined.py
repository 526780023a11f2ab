# SPDX-License-Identifier: Apache-2.0
"""Which slaves have more to say than a nibble: combined transactions and safety, by their codes (CT-001)."""
from dataclasses import dataclass

ANALOG_WORDS = 4                       # 16-bit words of a number in AIDI and AODI
STRING_BYTES = 224                     # FN_STRING of the host window
SEQUENCES_BYTES = 219                  # longest string of an S-7.4 slave: 73 sequences of 3 bytes
ID_BYTES = 5                           # ID object of a CTT2 slave; its last byte is the I/O configuration
SAFETY_TABLE = (0b0001, 0b0101, 0b0110, 0b1001, 0b1110, 0b1011, 0b1100, 0b0111)  # a legal one, where none is given
S74_STRINGS = {"id": 0, "diagnosis": 1, "parameters": 2}
_CHANNELS = (1, 2, 4, 4)               # CTT1: two bits of ID2
_CYCLIC_WORDS = (0, 1, 1, 2, 3, 4)     # CTT2: three bits of the I/O configuration byte (one byte counts as a word)


@dataclass(frozen=True)
class Kind:
    """What a slave exchanges beside its nibble. inputs, outputs: 16-bit words in AIDI and AODI."""
    name: str
    inputs: int = 0
    outputs: int = 0
    strings: bool = False              # functions 27 to 31
    messages: bool = False             # CTT2: objects by index
    safety: bool = False
    group: bool = False                # CTT5: the first of several addresses
    heard: int = 0                     # words that a simulated slave can be asked for: what it has received


PLAIN = Kind("plain")


def kind_of(io: int, id_: int, id2: int) -> Kind:
    """Kind for these codes; a later member of a CTT5 group is plain, its word belongs to the first."""
    if id_ == 0xB:
        return Kind("safety", safety=True)
    if (io, id_) == (6, 0) and id2 in (0xA, 0xB, 0xC):
        return Kind("CTT5", 1, 1, group=True)  # each member hears a nibble only
    if (io, id2) in ((7, 5), (0xB, 5)) and id_ == 0xA:
        return Kind("CTT2", 2, 2, True, True, heard=2)
    if io != 7:
        return PLAIN
    if (id_, id2) == (5, 5):
        return Kind("CTT2", 4, 4, True, True, heard=4)
    if id_ == 0xA:
        return {7: Kind("CTT3", heard=1), 0xA: Kind("CTT3", 1, 1, heard=1), 8: Kind("CTT4", 1),
                9: Kind("CTT4", 2)}.get(id2, PLAIN)
    if id_ in (1, 2, 3, 4) and (id_, id2) != (4, 0):
        channels = _CHANNELS[id2 & 3]
        if id2 & 8:
            return Kind("CTT1", channels, strings=id_ == 4)
        return Kind("CTT1", 0, channels, strings=id_ == 4, heard=channels)
    return PLAIN


def cyclic_words(id_object: bytes | None) -> tuple[int, int] | None:
    """Input and output words that the ID object of a CTT2 slave names; None: no object, or not one we know."""
    if id_object is None or len(id_object) < 5:
        return None
    ins, outs = id_object[4] & 7, id_object[4] >> 4 & 7
    if max(ins, outs) >= len(_CYCLIC_WORDS):
        return None
    return _CYCLIC_WORDS[ins], _CYCLIC_WORDS[outs]


def word_at(index: int, channel: int) -> int:
    """Number of a channel's 16-bit word (0 = the first) in AIDI and AODI; ValueError: the slave has none there."""
    if not 0 < index < 64 or index == 32:
        raise ValueError(f"index {index} has no analog values")
    if not 0 <= channel < (2 if index > 32 else ANALOG_WORDS):
        raise ValueError(f"index {index} has no channel {channel}")
    return (index & 31) * ANALOG_WORDS + (index >> 5) * 2 + channel
