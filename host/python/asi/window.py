# SPDX-License-Identifier: Apache-2.0
"""The native host window (asi_host in rdl/asi.rdl) over anything with host_read and host_write.

host_read(byte_address) -> 32-bit word; host_write(byte_address, word, byte_enable). The window never waits: a commit
returns a sequence number, `result` says later what became of it; whoever drives the simulation lets time pass between.
Execution control functions come in both kinds: `begin_function` and `answer` never wait; `function` and the methods
named after the functions do: they call `wait` between two looks at the window, and raise FunctionError when refused.
"""
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol, TypeVar

from asi import regmap
from asi.combined import STRING_BYTES, word_at
from asi.plant import Codes, Host
from asi.regmap import ErrorClass, Phase
from asi.status import LogEvent, OfflineCause, Status, StoreState, name_of
from asi.telegram import index_name

MAGIC = 0x4D49_5341  # 'ASIM'
IN_TRIES = 50        # an image alone is published faster than one try reads it
ODD_READS = 20_000   # with the codes of 62 slaves a publication takes 600 us, 3 000 reads of IN_SEQ
INDICES = tuple(index for index in range(64) if index != 32)
FLAGS = tuple(name.removeprefix("FLAGS_").removesuffix("_LSB").lower() for name in vars(regmap)
              if name.startswith("FLAGS_") and name.endswith("_LSB"))
COUNTERS = ("cycles", "sent", "repeated", "failed", "time_us")


FUNCTION_TRIES = 200_000  # looks at the window before a function is given up; each calls `wait`
LOG_EVENTS = 64
T = TypeVar("T")


class WindowError(Exception):
    """The window does not behave: never consistent, a function without an answer."""


class Function(IntEnum):
    """Execution control functions that go through FN_CODE, by their numbers (FN-001 ..)."""
    SET_PERMANENT_PARAMETER = 3
    WRITE_PARAMETER = 5
    STORE_PARAMETERS = 7
    SET_PERMANENT_CONFIGURATION = 8
    STORE_CONFIGURATION = 10
    SET_LPS = 12
    SET_MODE = 17
    SET_OFFLINE = 18
    SET_DATA_EXCHANGE = 19
    CHANGE_ADDRESS = 20
    SET_AUTO_ADDRESS = 21
    EXECUTE = 22
    WRITE_ID1 = 24
    READ_PARAMETER_STRING = 27
    WRITE_PARAMETER_STRING = 28
    READ_DIAGNOSIS_STRING = 29
    READ_ID_STRING = 30
    MESSAGE = 31
    SET_AUTO_CLEAR = 33


STRING_ANSWERS = (Function.READ_PARAMETER_STRING, Function.READ_DIAGNOSIS_STRING, Function.READ_ID_STRING,
                  Function.MESSAGE)


@dataclass(frozen=True)
class Answer:
    """What became of a function. data: the slave's answer nibble where there is one; string: bytes read."""
    status: int           # asi_status_t: 0 or negative
    data: int = 0
    string: bytes = b""

    @property
    def name(self) -> str:
        return name_of(Status, self.status)


class FunctionError(Exception):
    """A function was refused or failed. name: of asi_status_t; answer: with what the slave said, if anything."""

    def __init__(self, function: str, answer: Answer):
        super().__init__(f"{function}: {answer.name}")
        self.answer, self.status, self.name = answer, answer.status, answer.name


@dataclass(frozen=True)
class Analog:
    """One 16-bit value (FN-025). valid: False: a substitute of the master."""
    value: int
    valid: bool

    @property
    def signed(self) -> int:
        return self.value - (1 << 16) if self.value >> 15 else self.value


@dataclass(frozen=True)
class CttState:
    """Combined transaction of one slave (CTT_STATE)."""
    valid: tuple[bool, ...]   # per channel
    ov: bool                  # outputs: the slave takes new values
    tv: bool                  # the transfer works
    transparent: bool         # 16 plain bits
    string_open: bool         # a string or message is open, cyclic values pause


@dataclass(frozen=True)
class Event:
    """One event of the log (EX-038). time_us: bus time, wraps after 71 minutes; event: number of a LogEvent."""
    time_us: int
    event: int
    index: int
    data: int

    @property
    def name(self) -> str:
        return name_of(LogEvent, self.event).lower()

    @property
    def about_slave(self) -> bool:
        """index means a slave; address 0 only where it can."""
        return bool(self.index) or self.event in (LogEvent.DETECTED, LogEvent.GONE, LogEvent.ADDRESSED)

    def detail(self, name_of_index: Callable[[int], str] = index_name) -> str:
        """The data in words, '' when there is nothing to say."""
        data, e = self.data, self.event
        if e == LogEvent.DETECTED:
            return f"S-{data & 15:X}.{data >> 4 & 15:X}.{data >> 12:X} ID1 {data >> 8 & 15:X}"
        if e == LogEvent.ADDRESSED:
            return f"from {name_of_index(data & 63)}: {name_of(Status, -(data >> 8))}"
        if e == LogEvent.STORED:
            return name_of(Status, -data)
        kinds = {LogEvent.START: StoreState, LogEvent.PHASE: Phase, LogEvent.OFFLINE: OfflineCause}
        if e in kinds:
            return name_of(kinds[e], data)
        words = {LogEvent.CONFIG_OK: ("0", "1"), LogEvent.PERIPHERY_FAULT: ("gone", "fault"),
                 LogEvent.APF: ("power is back", "power fail"), LogEvent.CTT: ("broken off", "works")}
        if e in words:
            return words[e][min(data, 1)]
        return f"mode {data}" if e == LogEvent.AUTO_CLEAR else str(data) if data else ""


@dataclass(frozen=True)
class History:
    """Why Config_OK or normal operation was lost (EX-034, EX-036, EX-037). Times in us of bus time, None: never."""
    changed: frozenset[int]          # slaves that broke Config_OK the last time
    changed_us: int | None
    causes: tuple[str, ...]          # of OFFLINE since start-up
    last_cause: str | None
    offline_us: int | None
    suspects: frozenset[int]         # suspected duplicate addresses


@dataclass(frozen=True)
class Storage:
    """Permanent data in flash."""
    state: str                       # of StoreState
    busy: bool
    failed: bool                     # the last store failed
    saved: bool                      # the data in use is in flash
    sequence: int                    # of the stored set, low 16 bits


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


def _signed32(word: int) -> int:
    return word - (1 << 32) if word >> 31 else word


def _indices(low: int, high: int) -> frozenset[int]:
    return frozenset(index for index in range(64) if (high << 32 | low) >> index & 1)


def _ctt(byte: int) -> CttState:
    return CttState(tuple(bool(byte >> k & 1) for k in range(4)), *(bool(byte >> k & 1) for k in range(4, 8)))


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

    def __init__(self, port: HostPort, wait: Callable[[], None] = lambda: None):
        """wait: lets some time pass; only the methods that wait for a function call it."""
        self.port, self.wait = port, wait
        self._outputs = [0] * 8
        self._analog = [0] * 64
        self._log_next = 0

    # ------------------------------------------------------------ reading
    def _words(self, base: int, count: int) -> list[int]:
        return [self.port.host_read(base + 4 * k) for k in range(count)]

    def _steady(self, take: Callable[[], T], what: str) -> T:
        """take() of one publication: IN_SEQ even before and the same after; WindowError when it never holds still."""
        for _ in range(IN_TRIES):
            seqs = (self.port.host_read(regmap.HOST_IN_SEQ) for _ in range(ODD_READS))
            before = next((seq for seq in seqs if not seq & 1), 1)
            taken = take()
            if not before & 1 and self.port.host_read(regmap.HOST_IN_SEQ) == before:
                return taken
        raise WindowError(f"the {what} was never consistent in {IN_TRIES} tries (IN_SEQ)")

    def ready(self) -> bool:
        """True once the firmware has started (HW-001)."""
        return self.port.host_read(regmap.HOST_MAGIC) == MAGIC

    def version(self) -> str:
        word = self.port.host_read(regmap.HOST_VERSION)
        return f"{word >> 24}.{word >> 16 & 255}.{word & 0xFFFF}"

    def index_list(self, base: int) -> frozenset[int]:
        """A bit list: regmap.HOST_LDS, HOST_LAS, HOST_LPS, HOST_LPF or HOST_LPS_CFG."""
        return _indices(*self._words(base, 2))

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
        words = self._steady(lambda: self._words(regmap.HOST_IN_IMG, 8), "input image")
        return [words[index // 8] >> 4 * (index % 8) & 15 for index in range(64)]

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

    # ------------------------------------------------------------ combined transactions, diagnosis
    def ctt_state(self, index: int) -> CttState:
        """Combined transaction of a slave; all False for a plain one."""
        return _ctt(self.port.host_read(regmap.HOST_CTT_STATE + index // 4 * 4) >> 8 * (index % 4))

    def analog_input(self, index: int, channel: int = 0) -> Analog:
        """Value and valid mark of one publication (FN-025, CT-002). ValueError: no such channel (0 is the first)."""
        word = word_at(index, channel)

        def take() -> Analog:
            state = self.port.host_read(regmap.HOST_CTT_STATE + index // 4 * 4) >> 8 * (index % 4)
            value = self.port.host_read(regmap.HOST_AIDI + word // 2 * 4) >> 16 * (word % 2) & 0xFFFF
            return Analog(value, bool(state >> channel & 1))
        return self._steady(take, "analog image")

    def analog_output(self, index: int, channel: int = 0) -> int:
        """AODI as the host wrote it, 16 bits."""
        word = word_at(index, channel)
        return self.port.host_read(regmap.HOST_AODI + word // 2 * 4) >> 16 * (word % 2) & 0xFFFF

    def safety(self) -> tuple[frozenset[int], frozenset[int]]:
        """Non-safe view: the slaves with F-IN1, with F-IN2 (CT-060). Never use it for safety."""
        return self.index_list(regmap.HOST_SAFE_IN), self.index_list(regmap.HOST_SAFE_IN + 8)

    def events(self) -> tuple[list[Event], int]:
        """Events logged since the last call, in order, and how many were overwritten before (EX-038).

        The ring holds 64: nothing is lost as long as fewer come between two calls.
        """
        def new(head: int) -> int:
            count = head - self._log_next & 0xFFFF_FFFF
            return count if count < 1 << 31 else head       # the firmware has started again

        def take() -> tuple[int, list[list[int]]]:
            head = self.port.host_read(regmap.HOST_LOG_HEAD)
            return head, [self._words(regmap.HOST_LOG + 8 * (n % LOG_EVENTS), 2)
                          for n in range(head - min(new(head), LOG_EVENTS), head)]
        if self.port.host_read(regmap.HOST_LOG_HEAD) == self._log_next:
            return [], 0
        head, words = self._steady(take, "event log")
        lost = new(head) - len(words)
        self._log_next = head
        return [Event(time, word & 255, word >> 8 & 255, word >> 16) for time, word in words], lost

    def history(self) -> History:
        """EX-034, EX-036, EX-037."""
        def take() -> list[int]:
            return self._words(regmap.HOST_CHANGED_SLAVES, (regmap.HOST_LOG_HEAD - regmap.HOST_CHANGED_SLAVES) // 4)
        low, high, changed_us, causes, offline_us, suspect_low, suspect_high = self._steady(take, "history")
        known, last = causes & 0xFFFF, causes >> 16
        changed = _indices(low, high)
        return History(changed, changed_us if changed else None,
                       tuple(name_of(OfflineCause, k) for k in range(16) if known >> k & 1),
                       name_of(OfflineCause, last) if known else None, offline_us if known else None,
                       _indices(suspect_low, suspect_high))

    def storage(self) -> Storage:
        word = self.port.host_read(regmap.HOST_STORE)
        return Storage(name_of(StoreState, _bits(word, "STORE_STATE")), bool(_bits(word, "STORE_BUSY")),
                       bool(_bits(word, "STORE_FAILED")), bool(_bits(word, "STORE_SAVED")),
                       _bits(word, "STORE_SEQUENCE"))

    # ------------------------------------------------------------ functions
    def begin_function(self, code: int, first: int = 0, second: int = 0, string: bytes = b"") -> int:
        """Ask for a function -> its sequence. FunctionError BUSY: one is open (FN-032). ValueError: string too long."""
        if len(string) > STRING_BYTES:
            raise ValueError(f"{len(string)} bytes, at most {STRING_BYTES}")
        read, write = self.port.host_read, self.port.host_write
        sequence = read(regmap.HOST_FN_SEQ)
        if read(regmap.HOST_FN_DONE) != sequence:
            raise FunctionError(name_of(Function, code).lower(), Answer(Status.BUSY))
        for k in range(0, len(string), 4):
            write(regmap.HOST_FN_STRING + k, int.from_bytes(string[k:k + 4], "little"), 15)
        for base, word in ((regmap.HOST_FN_LEN, len(string)), (regmap.HOST_FN_CODE, code),
                           (regmap.HOST_FN_ARG, first), (regmap.HOST_FN_ARG + 4, second)):
            write(base, word, 15)
        sequence = sequence + 1 & 0xFFFF_FFFF
        write(regmap.HOST_FN_SEQ, sequence, 15)
        return sequence

    def answer(self, sequence: int) -> Answer | None:
        """Answer of a function, refusals as well; None: not yet."""
        read = self.port.host_read
        if read(regmap.HOST_FN_DONE) != sequence:
            return None
        status, string = _signed32(read(regmap.HOST_FN_STATUS)), b""
        if status in (Status.OK, Status.DEVICE) and read(regmap.HOST_FN_CODE) in STRING_ANSWERS:
            length = min(read(regmap.HOST_FN_LEN), STRING_BYTES)
            words = self._words(regmap.HOST_FN_STRING, (length + 3) // 4)
            string = b"".join(word.to_bytes(4, "little") for word in words)[:length]
        return Answer(status, read(regmap.HOST_FN_DATA), string)

    def function(self, code: int, first: int = 0, second: int = 0, string: bytes = b"") -> Answer:
        """Ask, wait, answer. FunctionError when refused or failed, WindowError when no answer comes."""
        sequence = self.begin_function(code, first, second, string)
        for _ in range(FUNCTION_TRIES):
            if (answer := self.answer(sequence)) is not None:
                if answer.status != Status.OK:
                    raise FunctionError(name_of(Function, code).lower(), answer)
                return answer
            self.wait()
        raise WindowError(f"{name_of(Function, code).lower()}: no answer (FN_DONE)")

    def set_permanent_parameter(self, index: int, nibble: int) -> None:
        self.function(Function.SET_PERMANENT_PARAMETER, index, nibble)

    def write_parameter(self, index: int, nibble: int) -> int:
        """-> the slave's echo."""
        return self.function(Function.WRITE_PARAMETER, index, nibble).data

    def store_parameters(self) -> None:
        """PI becomes PP."""
        self.function(Function.STORE_PARAMETERS)

    def set_permanent_configuration(self, index: int, codes: Codes) -> None:
        self.function(Function.SET_PERMANENT_CONFIGURATION, index, codes.word)

    def store_configuration(self) -> None:
        """CDI becomes PCD, LAS becomes LPS; configuration mode only."""
        self.function(Function.STORE_CONFIGURATION)

    def set_lps(self, indices: Iterable[int]) -> None:
        bits = sum(1 << index for index in set(indices))
        self.function(Function.SET_LPS, bits & 0xFFFF_FFFF, bits >> 32)

    def set_mode(self, protected: bool) -> None:
        self.function(Function.SET_MODE, int(protected))

    def set_offline(self, offline: bool) -> None:
        self.function(Function.SET_OFFLINE, 1 if offline else 2)

    def set_data_exchange(self, active: bool) -> None:
        self.function(Function.SET_DATA_EXCHANGE, int(active))

    def change_address(self, old: int, new: int) -> None:
        """Indices. An error may leave the slave at its old address or at 0 (docs/execution_control.md)."""
        self.function(Function.CHANGE_ADDRESS, old, new)

    def set_auto_address(self, enable: bool) -> None:
        self.function(Function.SET_AUTO_ADDRESS, int(enable))

    def execute(self, number: int, information: int) -> int:
        """One telegram of the legal set (FN-022): number 0..31, I4..I0 -> the answer nibble."""
        return self.function(Function.EXECUTE, number, information).data

    def write_id1(self, nibble: int) -> None:
        """Of the slave at address 0."""
        self.function(Function.WRITE_ID1, nibble)

    def read_parameter_string(self, index: int) -> bytes:
        return self.function(Function.READ_PARAMETER_STRING, index).string

    def write_parameter_string(self, index: int, string: bytes) -> None:
        self.function(Function.WRITE_PARAMETER_STRING, index, string=string)

    def read_diagnosis_string(self, index: int) -> bytes:
        return self.function(Function.READ_DIAGNOSIS_STRING, index).string

    def read_id_string(self, index: int) -> bytes:
        return self.function(Function.READ_ID_STRING, index).string

    def message(self, index: int, request: bytes) -> bytes:
        """Exchange one message with a CTT2 slave. FunctionError DEVICE: answer.string is its error response."""
        return self.function(Function.MESSAGE, index, string=request).string

    def set_auto_clear(self, mode: int) -> None:
        """0 off, 1 a projected slave is missing, 2 a peripheral fault, 3 either (EX-033)."""
        self.function(Function.SET_AUTO_CLEAR, mode)

    # ------------------------------------------------------------ writing
    def set_output(self, index: int, nibble: int) -> None:
        """Host level; goes out with the next cycle."""
        word, shift = index // 8, 4 * (index % 8)
        self._outputs[word] = self._outputs[word] & ~(15 << shift) | nibble << shift
        self.port.host_write(regmap.HOST_OUT_IMG + 4 * word, self._outputs[word], 15)

    def set_analog_output(self, index: int, channel: int, value: int) -> None:
        """AODI: value -32768..65535; ValueError: no such channel or value. A word is written whole: no half values."""
        if not -0x8000 <= value <= 0xFFFF:
            raise ValueError(f"{value} is not a 16-bit value")
        word, shift = word_at(index, channel) // 2, 16 * (word_at(index, channel) % 2)
        self._analog[word] = self._analog[word] & ~(0xFFFF << shift) | (value & 0xFFFF) << shift
        self.port.host_write(regmap.HOST_AODI + 4 * word, self._analog[word], 15)

    def acknowledge_irq(self) -> None:
        self.port.host_write(regmap.HOST_IRQ_ACK, 1, 15)

    def set_control(self, **bits: bool) -> int:
        """Change bits of HOST_CTRL (protected_mode, offline, data_exchange, auto_address_enable, monitor) -> sequence.

        The others stay as they are in the window: functions change them too.
        """
        return self._control(self.port.host_read(regmap.HOST_HOST_CTRL), bits)

    def _control(self, word: int, bits: dict[str, bool]) -> int:
        for name, on in bits.items():
            bit = 1 << getattr(regmap, f"HOST_CTRL_{name.upper()}_LSB")
            word = word | bit if on else word & ~bit
        self.port.host_write(regmap.HOST_HOST_CTRL, word, 15)
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
        for index, values in host.analog.items():
            for channel, value in enumerate(values):
                self.set_analog_output(index, channel, value)
        # from 0: what was stored or left there by another host does not count
        return self._control(0, {"protected_mode": host.protected, "data_exchange": host.data_exchange,
                                 "auto_address_enable": host.auto_address})

    def _commit(self) -> int:
        sequence = self.port.host_read(regmap.HOST_HOST_SEQ) + 1 & 0xFFFF_FFFF
        self.port.host_write(regmap.HOST_HOST_SEQ, sequence, 15)
        return sequence

    def result(self, sequence: int) -> int | None:
        """Result of a commit: None while the firmware has not applied it, 0 = done, else asi_status_t (negative)."""
        if self.port.host_read(regmap.HOST_FW_SEQ) != sequence:
            return None
        return _signed32(self.port.host_read(regmap.HOST_FW_RESULT))
