# SPDX-License-Identifier: Apache-2.0
"""The native host window (asi_host in rdl/asi.rdl) over anything with host_read and host_write.

host_read(byte_address) -> 32-bit word; host_write(byte_address, word, byte_enable). The window never waits: a commit
returns a sequence number, `result` says later what became of it; whoever drives the simulation lets time pass between.
"""
from dataclasses import dataclass
from typing import Protocol

from asi import regmap
from asi.plant import Codes, Host
from asi.regmap import ErrorClass, Phase

MAGIC = 0x4D49_5341  # 'ASIM'
IN_TRIES = 50        # an image alone is published faster than one try reads it
ODD_READS = 20_000   # with the codes of 62 slaves a publication takes 600 us, 3 000 reads of IN_SEQ
INDICES = tuple(index for index in range(64) if index != 32)
FLAGS = tuple(name.removeprefix("FLAGS_").removesuffix("_LSB").lower() for name in vars(regmap)
              if name.startswith("FLAGS_") and name.endswith("_LSB"))
COUNTERS = ("cycles", "sent", "repeated", "failed", "time_us")


class WindowError(Exception):
    """The window does not behave: never consistent."""


@dataclass(frozen=True)
class Statistics:
    """What the chip counted for one index (ST-001, ST-002). Times in ns; None while there is no good answer."""
    classes: dict[ErrorClass, int]      # attempts by class; those that never happened are left out
    repeat_ok: int
    repeat_failed: int
    delay_min_ns: float | None
    delay_mean_ns: float | None
    delay_max_ns: float | None
    deviation_ns: float | None          # largest distance of a pulse start from the grid, late is positive

    @property
    def requests(self) -> int:
        return sum(self.classes.values())


@dataclass(frozen=True)
class RingRecord:
    """One telegram of the passive monitor (ST-006). t_ns: first pulse, wraps after 2^32 * 125 ns."""
    t_ns: int
    request: bool
    data: int            # request: CB A4..A0 I4..I0; answer: I3..I0
    error_class: ErrorClass
    deviation_ns: float  # late is positive
    lost: bool           # telegrams before this one were lost


LINE_FAULTS = ("apf", "efault", "jabber")
RING_RECORDS = 512
RING_TICK_NS = 125


def _bits(word: int, name: str) -> int:
    """Field `name` (e.g. RECORD_DATA) of a word."""
    return word >> getattr(regmap, f"{name}_LSB") & (1 << getattr(regmap, f"{name}_W")) - 1


class HostPort(Protocol):
    """What the window needs of a chip."""

    def host_read(self, addr: int) -> int: ...

    def host_write(self, addr: int, data: int, be: int = 15) -> None: ...


@dataclass(frozen=True)
class State:
    """Everything the master shows beside the input image. Lists are sets of indices."""
    flags: dict[str, bool]
    phase: Phase
    lds: frozenset[int]
    las: frozenset[int]
    lps: frozenset[int]
    lpf: frozenset[int]
    counters: dict[str, int]


class HostWindow:
    """Named access to the host window of one chip."""

    def __init__(self, port: HostPort):
        self.port = port
        self.control = 0
        self._outputs = [0] * 8

    # ------------------------------------------------------------ reading
    def _words(self, base: int, count: int) -> list[int]:
        return [self.port.host_read(base + 4 * k) for k in range(count)]

    def ready(self) -> bool:
        """True once the firmware has started (HW-001)."""
        return self.port.host_read(regmap.HOST_MAGIC) == MAGIC

    def version(self) -> str:
        word = self.port.host_read(regmap.HOST_VERSION)
        return f"{word >> 24}.{word >> 16 & 255}.{word & 0xFFFF}"

    def index_list(self, base: int) -> frozenset[int]:
        """A bit list: regmap.HOST_LDS, HOST_LAS, HOST_LPS, HOST_LPF or HOST_LPS_CFG."""
        low, high = self._words(base, 2)
        return frozenset(index for index in range(64) if (high << 32 | low) >> index & 1)

    def flags(self) -> dict[str, bool]:
        word = self.port.host_read(regmap.HOST_FLAGS)
        return {name: bool(word >> getattr(regmap, f"FLAGS_{name.upper()}_LSB") & 1) for name in FLAGS}

    def state(self) -> State:
        """Flags, phase, lists and counters."""
        read = self.port.host_read
        return State(self.flags(), Phase(read(regmap.HOST_PHASE)), self.index_list(regmap.HOST_LDS),
                     self.index_list(regmap.HOST_LAS), self.index_list(regmap.HOST_LPS),
                     self.index_list(regmap.HOST_LPF),
                     {name: read(getattr(regmap, f"HOST_{name.upper()}")) for name in COUNTERS})

    def inputs(self) -> list[int]:
        """The input image, 64 nibbles of one cycle (HW-003); WindowError when it never holds still."""
        for _ in range(IN_TRIES):
            before = next((seq for _ in range(ODD_READS) if not (seq := self.port.host_read(regmap.HOST_IN_SEQ)) & 1), 1)
            words = self._words(regmap.HOST_IN_IMG, 8)
            if not before & 1 and self.port.host_read(regmap.HOST_IN_SEQ) == before:
                return [words[index // 8] >> 4 * (index % 8) & 15 for index in range(64)]
        raise WindowError(f"the input image was never consistent in {IN_TRIES} tries (IN_SEQ)")

    def outputs(self) -> list[int]:
        """The output image at host level, 64 nibbles."""
        words = self._words(regmap.HOST_OUT_IMG, 8)
        return [words[index // 8] >> 4 * (index % 8) & 15 for index in range(64)]

    def detected_codes(self) -> dict[int, Codes]:
        """CDI: index -> codes, as read from the line; FFFF (not detected) is left out."""
        words = self._words(regmap.HOST_CDI, 32)
        out = {}
        for index in INDICES:
            code = words[index // 2] >> 16 * (index % 2) & 0xFFFF
            if code != 0xFFFF:
                out[index] = Codes(code & 15, code >> 4 & 15, code >> 8 & 15, code >> 12)
        return out

    def parameters(self, base: int) -> list[int]:
        """64 nibbles of regmap.HOST_PP, HOST_PI or HOST_PECHO."""
        words = self._words(base, 16)
        return [words[index // 4] >> 8 * (index % 4) & 15 for index in range(64)]

    def clock_mhz(self) -> int:
        return self.port.host_read(regmap.HOST_CLOCK_MHZ)

    def statistics(self, index: int) -> Statistics:
        """Counters of one index; the firmware copies them to the window every 65 ms (ST-009)."""
        words = self._words(regmap.HOST_STAT + 0x40 * index, 16)
        count = words[regmap.STAT_COUNT // 4:][:regmap.STAT_REPEAT_OK // 4]
        delay, deviation = words[regmap.STAT_DELAY // 4], words[regmap.STAT_DEVIATION // 4]
        good, ns = count[ErrorClass.OK], 1000 / self.clock_mhz()
        late = 1 if _bits(deviation, "STAT_DEVIATION_LATE") else -1
        return Statistics(
            {ErrorClass(k): n for k, n in enumerate(count) if n},
            words[regmap.STAT_REPEAT_OK // 4], words[regmap.STAT_REPEAT_FAILED // 4],
            _bits(delay, "STAT_DELAY_MIN") * ns if good else None,
            words[regmap.STAT_DELAY_SUM // 4] * ns / good if good else None,
            _bits(delay, "STAT_DELAY_MAX") * ns if good else None,
            late * _bits(deviation, "STAT_DEVIATION_CLOCKS") * ns if good else None)

    def line_faults(self) -> dict[str, tuple[bool, bool]]:
        """apf, efault, jabber -> (there now, seen since the last commit) (LT-017)."""
        word = self.port.host_read(regmap.HOST_LINE_FAULTS)
        return {name: (bool(word >> k & 1), bool(word >> 8 + k & 1)) for k, name in enumerate(LINE_FAULTS)}

    def monitored(self) -> list[RingRecord]:
        """Take all telegrams that the passive monitor has recorded (ST-006); set_control(monitor=True) starts it."""
        read, ns = self.port.host_read, 1000 / self.clock_mhz()
        head, tail, out = read(regmap.HOST_RING_HEAD), read(regmap.HOST_RING_TAIL) % RING_RECORDS, []
        while tail != head:
            time, word = self._words(regmap.HOST_RING + 8 * tail, 2)
            late = 1 if _bits(word, "RECORD_LATE") else -1
            out.append(RingRecord(time * RING_TICK_NS, bool(_bits(word, "RECORD_REQUEST")), _bits(word, "RECORD_DATA"),
                                  ErrorClass(_bits(word, "RECORD_ERROR")), late * _bits(word, "RECORD_DEVIATION") * ns,
                                  bool(_bits(word, "RECORD_LOST"))))
            tail = (tail + 1) % RING_RECORDS
        self.port.host_write(regmap.HOST_RING_TAIL, tail)
        return out

    def monitor_lost(self) -> int:
        """Telegrams that found the ring full (ST-008)."""
        return self.port.host_read(regmap.HOST_RING_LOST)

    # ------------------------------------------------------------ writing
    def set_output(self, index: int, nibble: int) -> None:
        """Host level; goes out with the next cycle."""
        word, shift = index // 8, 4 * (index % 8)
        self._outputs[word] = self._outputs[word] & ~(15 << shift) | nibble << shift
        self.port.host_write(regmap.HOST_OUT_IMG + 4 * word, self._outputs[word], 15)

    def acknowledge_irq(self) -> None:
        self.port.host_write(regmap.HOST_IRQ_ACK, 1, 15)

    def set_control(self, **bits: bool) -> int:
        """Change bits of HOST_CTRL (protected_mode, offline, data_exchange, auto_address_enable, monitor) -> sequence."""
        for name, on in bits.items():
            bit = 1 << getattr(regmap, f"HOST_CTRL_{name.upper()}_LSB")
            self.control = self.control | bit if on else self.control & ~bit
        self.port.host_write(regmap.HOST_HOST_CTRL, self.control, 15)
        return self._commit()

    def configure(self, host: Host) -> int:
        """Write projection, parameters, outputs and mode of a plant's host and commit once -> sequence (HW-002)."""
        lps, pcd, pp = 0, [0xFFFF] * 64, [15] * 64
        for index, codes in host.pcd.items():
            lps |= 1 << index
            pcd[index] = codes.word
        for index, nibble in host.parameters.items():
            pp[index] = nibble
        write = self.port.host_write
        for k in range(2):
            write(regmap.HOST_LPS_CFG + 4 * k, lps >> 32 * k & 0xFFFF_FFFF, 15)
        for k in range(32):
            write(regmap.HOST_PCD + 4 * k, pcd[2 * k] | pcd[2 * k + 1] << 16, 15)
        for k in range(16):
            write(regmap.HOST_PP + 4 * k, sum(pp[4 * k + byte] << 8 * byte for byte in range(4)), 15)
        for index, nibble in host.outputs.items():
            self.set_output(index, nibble)
        return self.set_control(protected_mode=host.protected, data_exchange=host.data_exchange,
                                auto_address_enable=host.auto_address, offline=False)

    def _commit(self) -> int:
        sequence = self.port.host_read(regmap.HOST_HOST_SEQ) + 1 & 0xFFFF_FFFF
        self.port.host_write(regmap.HOST_HOST_SEQ, sequence, 15)
        return sequence

    def result(self, sequence: int) -> int | None:
        """Result of a commit: None while the firmware has not applied it, 0 = done, else asi_status_t (negative)."""
        if self.port.host_read(regmap.HOST_FW_SEQ) != sequence:
            return None
        word = self.port.host_read(regmap.HOST_FW_RESULT)
        return word - (1 << 32) if word >> 31 else word
