# SPDX-License-Identifier: Apache-2.0
"""Native simulation from Python: simulated slaves (Net) and the Verilated chip with them (Chip).

Binding of tb/asi_tb.h (cffi, ABI mode: no compiler at run time). Times are in ns of bus time since reset; slaves
are handles in the order of add(). Every refused call raises NativeError.
"""
import re
import struct
from functools import cache
from pathlib import Path
from typing import NamedTuple

from cffi import FFI

_ROOT = Path(__file__).resolve().parents[3]
_BULK = 4096  # records fetched per call
CERTAIN = 0xFFFF  # probability of a fault: always
WRITE_NS = 15_000_000  # memory write of a slave unless set otherwise
STRING_ID, STRING_DIAGNOSIS, STRING_PARAMETERS = range(3)  # strings of CTT1


class NativeError(RuntimeError):
    """The native side refused a call, or its library is not there."""


class Pulse(NamedTuple):
    t_ns: int
    width_ns: int
    polarity: int  # -1, +1


class Telegram(NamedTuple):
    """One call on the line as the passive monitor saw it."""
    t_ns: int         # first pulse of the request
    delay_ns: int     # last request pulse to first answer pulse, -1 without answer
    call: int         # CB A4..A0 I4..I0
    error_class: int  # asi.regmap.ErrorClass of the answer
    data: int         # answer nibble, valid when error_class is OK
    phase: int        # asi.regmap.Phase when the request began
    repeated: int     # 1: immediate repetition of the call before
    request_ok: int   # 0: the request itself was not a legal telegram
    request_dev_ns: int | None  # good request: its pulse farthest from the 3 us grid, with sign
    answer_dev_ns: int | None   # the same of a good answer


class SlaveState(NamedTuple):
    address: int      # index: number + 32 * Sel
    outputs: int
    parameter: int
    dexg_disabled: bool
    synchronous: bool
    present: bool
    status: int       # S3..S0
    requests: int
    answers: int


class Stats(NamedTuple):
    clocks: int
    telegrams: int
    repeated: int
    failed: int             # answers that were not OK
    phase_ns: tuple         # bus time per phase_o
    cycles: int
    cycle_periods: int
    cycle_min_ns: int
    cycle_max_ns: int
    cycle_sum_ns: int
    irq_count: int
    irq_clocks_max: int
    irq_clocks_max_cycle: int

    @property
    def cycle_mean_ns(self):
        return self.cycle_sum_ns / self.cycle_periods if self.cycle_periods else 0.0


_PULSE = struct.Struct("=qii")
_TELEGRAM = struct.Struct("=qiHBBBBBxhh")
_NO_DEVIATION = -32768


def _telegram(fields):
    request_dev, answer_dev = fields[8:]
    return Telegram(*fields[:8], None if request_dev == _NO_DEVIATION else request_dev,
                    None if answer_dev == _NO_DEVIATION else answer_dev)


def declarations():
    """The C declarations between the cffi markers of tb/asi_tb.h."""
    text = (_ROOT / "tb/asi_tb.h").read_text()
    return re.search(r"/\* cffi begin \*/(.*)/\* cffi end \*/", text, re.S).group(1)


@cache
def load(name, directory=_ROOT / "build/tb"):
    """-> (ffi, lib) of lib<name>.so: 'asi_slaves', 'asi_chip' or 'asi_chip_trace'."""
    path = Path(directory) / f"lib{name}.so"
    if not path.exists():
        raise NativeError(f"{path} is missing: make build/tb/{path.name}")
    ffi = FFI()
    ffi.cdef(declarations())
    assert ffi.sizeof("asi_telegram") == _TELEGRAM.size and ffi.sizeof("asi_pulse") == _PULSE.size
    return ffi, ffi.dlopen(str(path))


def _check(result, what):
    if result < 0:
        raise NativeError(f"{what}: refused")
    return result


def _drain(ffi, function, handle):
    """All waiting telegrams of `function` (asi_net_log or asi_chip_log)."""
    out = []
    buffer = ffi.new("asi_telegram[]", _BULK)
    while count := _check(function(handle, buffer, _BULK), "log"):
        out += map(_telegram, _TELEGRAM.iter_unpack(ffi.buffer(buffer, count * _TELEGRAM.size)))
    return out


class Net:
    """Slaves on one line. Alone: feed it master pulses; on a chip: Chip.net."""

    def __init__(self, seed=0, *, _chip=None):
        if _chip:
            self._ffi, self._lib, self._chip = _chip._ffi, _chip._lib, _chip  # keeps the chip alive
            self._net = self._lib.asi_chip_net(_chip._chip)
        else:
            self._ffi, self._lib = load("asi_slaves")
            self._net = self._ffi.gc(self._lib.asi_net_new(seed), self._lib.asi_net_free)

    def add(self, address, io=0, id=0xF, id1=0xF, id2=0xF, inputs=0, watchdog=False, present=True, **options):
        """-> slave handle. address: index 0, 1..31, 33..63 (B: only with id = 0xA). options: as set_options."""
        cfg = self._ffi.new("asi_slave_cfg *", dict(
            address=address, io=io, id=id, id1=id1, id2=id2, inputs=inputs, watchdog=watchdog, present=present))
        slave = _check(self._lib.asi_net_add(self._net, cfg), f"slave at index {address}")
        if options:
            self.set_options(slave, **options)
        return slave

    def set_options(self, slave, write_ns=WRITE_NS, **flags):
        """SL-010: write_ns, time of a memory write; write_fails, id1_locked, old, sel_at_zero; CTT2: di_swapped, busy:
        what is not named is off (meaning: asi_slave_options in tb/asi_tb.h)."""
        options = self._ffi.new("asi_slave_options *", dict(flags, write_ns=write_ns))
        _check(self._lib.asi_net_set_options(self._net, slave, options), f"options of slave {slave}")

    def set_inputs(self, slave, inputs):
        """inputs: nibble, line level."""
        _check(self._lib.asi_net_set_inputs(self._net, slave, inputs), f"inputs {inputs} of slave {slave}")

    def set_present(self, slave, present):
        """Connect (power-up reset) or disconnect a slave."""
        _check(self._lib.asi_net_set_present(self._net, slave, present), f"slave {slave}")

    def set_periphery_fault(self, slave, fault):
        _check(self._lib.asi_net_set_periphery_fault(self._net, slave, fault), f"slave {slave}")

    def set_faults(self, slave, **faults):
        """p_no_answer, p_parity, p_missing_pulse, p_shifted_pulse, p_extra_pulse (1/65536 per answer, CERTAIN: always),
        shift_ns, delay_ns; what is not named is off."""
        _check(self._lib.asi_net_set_faults(self._net, slave, self._ffi.new("asi_slave_faults *", faults)),
               f"slave {slave}")

    # combined transactions (SL-009): refused when the slave's codes ask for no such thing
    def set_value(self, slave, channel, value):
        """Input value of a channel, 16 bit (S-7.A.A: 8 bit)."""
        _check(self._lib.asi_net_set_value(self._net, slave, channel, value), f"value {channel} of slave {slave}")

    def set_invalid(self, slave, invalid=0, overflow=0):
        """CTT1 inputs, a bit per channel: values are sent with V = 0, with O = 1."""
        _check(self._lib.asi_net_set_invalid(self._net, slave, invalid, overflow), f"validity of slave {slave}")

    def value(self, slave, channel=0):
        """-> output value the slave has received, None when there is none (yet)."""
        out = self._ffi.new("uint16_t *")
        known = _check(self._lib.asi_net_get_value(self._net, slave, channel, out), f"value {channel} of slave {slave}")
        return out[0] if known else None

    def set_string(self, slave, kind, data):
        """CTT1: kind STRING_ID, STRING_DIAGNOSIS or STRING_PARAMETERS, sequences of 3 bytes, F and V are added;
        CTT2: kind = index of the object, 0 = ID object."""
        _check(self._lib.asi_net_set_string(self._net, slave, kind, bytes(data), len(data)),
               f"string {kind} of slave {slave}")

    def string(self, slave, kind):
        """-> bytes: what set_string or the master has written."""
        out = self._ffi.new("uint8_t[256]")
        length = _check(self._lib.asi_net_get_string(self._net, slave, kind, out, 256),
                        f"string {kind} of slave {slave}")
        return bytes(self._ffi.buffer(out, length))

    def set_safety(self, slave, table, closed=3):
        """Safety slave: 8 words; closed: bits 0, 1 = channels 1, 2."""
        if len(table) != 8:
            raise NativeError(f"safety table of slave {slave}: 8 words, not {len(table)}")
        _check(self._lib.asi_net_set_safety(self._net, slave, bytes(table), closed), f"safety table of slave {slave}")

    def state(self, slave):
        """-> SlaveState now."""
        s = self._ffi.new("asi_slave_state *")
        _check(self._lib.asi_net_get(self._net, slave, s), f"slave {slave}")
        return SlaveState(s.address, s.outputs, s.parameter, bool(s.dexg_disabled), bool(s.synchronous),
                          bool(s.present), s.status, s.requests, s.answers)

    def power(self, good):
        """False: all slaves lose power."""
        _check(self._lib.asi_net_power(self._net, good), "power")

    def inject(self, t_ns, polarity, width_ns=1_500):
        """A pulse of a foreign sender, heard by master and monitor."""
        _check(self._lib.asi_net_inject(self._net, t_ns, polarity, width_ns), f"pulse at {t_ns} ns")

    def master_pulse(self, t_ns, polarity):
        """Only without a chip; time never goes back."""
        _check(self._lib.asi_net_master_pulse(self._net, t_ns, polarity), f"master pulse at {t_ns} ns")

    def advance(self, t_ns):
        """Only without a chip. -> [Pulse] that the slaves began until t_ns."""
        out, buffer = [], self._ffi.new("asi_pulse[64]")
        while True:
            count = _check(self._lib.asi_net_advance(self._net, t_ns, buffer, 64), f"advance to {t_ns} ns")
            out += map(Pulse._make, _PULSE.iter_unpack(self._ffi.buffer(buffer, count * _PULSE.size)))
            if count < 64:
                return out

    def log(self):
        """-> [Telegram], drained."""
        return _drain(self._ffi, self._lib.asi_net_log, self._net)

    def pulse_counts(self):
        """-> {"starts": [[bins of negative, of positive pulses] of the master, of the slaves], "ends": the same}:
        where in a bit time pulses began and ended since reset (asi_pulse_counts in tb/asi_tb.h)."""
        counts = self._ffi.new("asi_pulse_counts *")
        self._lib.asi_net_pulse_counts(self._net, counts)
        return {name: [[list(bins) for bins in sender] for sender in getattr(counts, name)]
                for name in ("starts", "ends")}


class Flash:
    """SPI NOR flash model (asi_flash of tb/asi_tb.h), erased. size: bytes, a power of 2. Its content outlives the chips
    that it is attached to."""

    def __init__(self, size=1 << 21):
        self._ffi, self._lib = load("asi_slaves")
        flash = self._lib.asi_flash_new(size)
        if flash == self._ffi.NULL:
            raise NativeError(f"flash: {size} is not a power of 2 between 64 KB and 16 MB")
        self._flash, self.size = self._ffi.gc(flash, self._lib.asi_flash_free), size

    def load(self, address, data):
        """Put bytes there, whatever was there."""
        _check(self._lib.asi_flash_load(self._flash, address, bytes(data), len(data)), f"load at {address:#x}")

    def peek(self, address, count):
        """-> bytes; doubtful cells as they tend."""
        out = self._ffi.new("uint8_t[]", count)
        _check(self._lib.asi_flash_peek(self._flash, address, out, count), f"read at {address:#x}")
        return bytes(out)

    def doubt(self, address, count):
        """-> bytes whose set bits mark cells that read as 0 or 1, each time anew."""
        out = self._ffi.new("uint8_t[]", count)
        _check(self._lib.asi_flash_doubt(self._flash, address, out, count), f"read at {address:#x}")
        return bytes(out)

    def times(self, program_ns, erase_ns):
        """How long a page program and a sector erase take; 0.4 ms and 45 ms if never called."""
        self._lib.asi_flash_times(self._flash, program_ns, erase_ns)

    def cut_after(self, count, seed=1):
        """Power fails after so many more bytes on SPI; -1: never. seed: of what a broken off operation leaves."""
        self._lib.asi_flash_cut_after(self._flash, count, seed)

    @property
    def dead(self):
        """Power has failed."""
        return bool(self._lib.asi_flash_is_dead(self._flash))

    def power_up(self):
        """Off and on again; its time starts at 0. Attaching does the same."""
        self._lib.asi_flash_power_up(self._flash)

    def worn(self, address, kind):
        """A sector: 1 erases leave a bit 0, 2 the first byte of a page does not take zeros, 0 good again."""
        _check(self._lib.asi_flash_worn(self._flash, address, kind), f"worn({address:#x}, {kind})")

    def counts(self):
        """-> (bytes on SPI, programs, erases, refused frames) since it was made."""
        c = self._ffi.new("asi_flash_counts *")
        self._lib.asi_flash_get_counts(self._flash, c)
        return c.bytes, c.programs, c.erases, c.refused

    def erases(self, address):
        """-> erases of the sector there."""
        return self._lib.asi_flash_erases(self._flash, address)

    def select(self, t_ns, on):
        self._lib.asi_flash_select(self._flash, t_ns, on)

    def byte(self, t_ns, out):
        """Shift one byte. -> the byte that came back"""
        return self._lib.asi_flash_byte(self._flash, t_ns, out)

    def pins(self, t_ns, cs_n, sck, mosi):
        """New levels of the pins. -> MISO"""
        return self._lib.asi_flash_pins(self._flash, t_ns, cs_n, sck, mosi)


class Chip:
    """Verilated asi_master with a Net on its pins.

    firmware: RAM image (hex words); waves: wave file to write, uses the slower traced library.
    """

    def __init__(self, firmware=None, waves=None, seed=0):
        self._ffi, self._lib = load("asi_chip_trace" if waves else "asi_chip")
        for what, name, mode in (("firmware", firmware, "rb"), ("waves", waves, "wb")):
            try:
                if name is not None:
                    open(name, mode).close()
            except OSError as error:
                raise NativeError(f"{what} {name}: {error.strerror}") from None
        path = [self._ffi.NULL if p is None else self._ffi.new("char[]", str(Path(p).resolve()).encode())
                for p in (firmware, waves)]
        chip = self._lib.asi_chip_new(*path, seed)
        if chip == self._ffi.NULL:
            raise NativeError(f"chip: cannot open firmware {firmware} or waves {waves}")
        self._chip = self._ffi.gc(chip, self._lib.asi_chip_free)
        self.net = Net(_chip=self)
        self.clk_hz = self._lib.asi_chip_clk_hz(self._chip)

    def close(self):
        """Ends the simulation and completes the wave file. Nothing may be called after it."""
        self.net = None
        if self._chip is not None:
            self._ffi.release(self._chip)
            self._chip = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    @property
    def time_ns(self):
        return self._lib.asi_chip_time(self._chip)

    def run(self, until_ns):
        """-> time reached, ns."""
        return self._lib.asi_chip_run(self._chip, until_ns)

    def run_irq(self, until_ns):
        """As run, but stops when host_irq_o is high. -> time reached, ns."""
        return self._lib.asi_chip_run_irq(self._chip, until_ns)

    def host_read(self, byte_addr):
        """A read on the host port; takes bus time."""
        return self._lib.asi_chip_host_read(self._chip, byte_addr)

    def host_write(self, byte_addr, data, byte_enable=0xF):
        """A write on the host port; takes bus time."""
        self._lib.asi_chip_host_write(self._chip, byte_addr, data, byte_enable)

    def apf(self, low):
        """Pin apf_ni: True = line voltage too low. The slaves follow net.power()."""
        self._lib.asi_chip_apf(self._chip, low)

    def efault(self, fault):
        """Pin efault_i: True = the front end sees an earth fault."""
        self._lib.asi_chip_efault(self._chip, fault)

    def attach_flash(self, flash):
        """Flash (or None) on the SPI pins; it is powered up. Its content stays when the chip goes."""
        address = int(flash._ffi.cast("uintptr_t", flash._flash)) if flash else 0  # the libraries' types differ by name
        self._lib.asi_chip_attach_flash(self._chip, self._ffi.cast("asi_flash *", address))
        self._flash = flash  # keeps it alive

    def log(self):
        """-> [Telegram], drained."""
        return _drain(self._ffi, self._lib.asi_chip_log, self._chip)

    def stats(self):
        """-> Stats since reset."""
        s = self._ffi.new("asi_chip_stats *")
        self._lib.asi_chip_get_stats(self._chip, s)
        return Stats(s.clocks, s.telegrams, s.repeated, s.failed, tuple(s.phase_ns), s.cycles, s.cycle_periods,
                     s.cycle_min_ns, s.cycle_max_ns, s.cycle_sum_ns, s.irq_count, s.irq_clocks_max,
                     s.irq_clocks_max_cycle)
