# SPDX-License-Identifier: Apache-2.0
"""asi.native.Chip seen as the runner wants it (asi.run.Bench): slaves, line power and host port of one chip; and the
file that is the content of its flash."""
import fcntl
from pathlib import Path
from typing import Any

from asi.plant import Faults, Options, Slave

NEW_FLASH = 1 << 21                                 # bytes; the storage ends at 0x120000 (docs/storage.md)
FLASH_SIZES = tuple(1 << k for k in range(21, 25))  # 24-bit addresses


class BenchError(Exception):
    """The simulation cannot be started: a library is missing or refuses."""


class FlashError(Exception):
    """The file cannot be the flash; one line for the user, the file's name in it."""


class FlashFile:
    """The flash's content between runs: read here, created erased when missing, given back with `write`.

    Held until `close`, so that two runs do not store into one flash."""

    def __init__(self, path: Path):
        self.path = path
        try:
            is_new = not path.exists()
            self._file = open(path, "w+b" if is_new else "r+b")
        except OSError as error:
            raise FlashError(f"{path}: {error.strerror}") from None
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self.content = b"\xFF" * NEW_FLASH if is_new else self._file.read(FLASH_SIZES[-1] + 1)
            if is_new:
                self._put(self.content)
        except BlockingIOError:
            self._refuse("another run has this flash; give this one another file")
        except OSError as error:
            self._refuse(str(error.strerror))
        if len(self.content) not in FLASH_SIZES:
            sizes = ", ".join(str(size >> 20) for size in FLASH_SIZES)
            self._refuse(f"not the content of a flash: it has to be {sizes} MB long, exactly")

    def _refuse(self, reason: str) -> None:
        self._file.close()
        raise FlashError(f"{self.path}: {reason}")

    def _put(self, content: bytes) -> None:
        self._file.seek(0)
        self._file.write(content)
        self._file.flush()

    def write(self, content: bytes) -> None:
        """The content after the run, of the same length. OSError."""
        if content != self.content:
            self._put(content)
            self.content = content

    def close(self) -> None:
        self._file.close()


class NativeBench:
    """One chip with its line."""

    def __init__(self, chip: Any):
        self.chip, self.net, self.clk_hz = chip, chip.net, chip.clk_hz
        self._flash: Any = None

    def time(self) -> int:
        return self.chip.time_ns

    def run(self, until_ns: int) -> int:
        return self.chip.run(until_ns)

    def host_read(self, addr: int) -> int:
        return self.chip.host_read(addr)

    def host_write(self, addr: int, data: int, be: int = 15) -> None:
        self.chip.host_write(addr, data, be)

    def telegrams(self) -> list[Any]:
        return self.chip.log()

    def stats(self) -> Any:
        return self.chip.stats()

    def pulse_counts(self) -> dict[str, Any]:
        return self.net.pulse_counts()

    def add(self, slave: Slave) -> int:
        codes, net = slave.codes, self.net
        handle = net.add(address=slave.index, io=codes.io, id=codes.id, id1=codes.id1, id2=codes.id2,
                         inputs=slave.inputs, watchdog=slave.watchdog, present=slave.present)
        if slave.options != Options():
            net.set_options(handle, **vars(slave.options))
        for channel, word in enumerate(slave.values):
            net.set_value(handle, channel, word)
        if slave.invalid or slave.overflow:
            net.set_invalid(handle, slave.invalid, slave.overflow)
        for kind, string in slave.strings.items():
            net.set_string(handle, kind, string)
        if slave.safety is not None:
            net.set_safety(handle, slave.safety.table, slave.safety.closed)
        return handle

    def set_inputs(self, slave: int, nibble: int) -> None:
        self.net.set_inputs(slave, nibble)

    def set_present(self, slave: int, present: bool) -> None:
        self.net.set_present(slave, present)

    def set_periphery_fault(self, slave: int, fault: bool) -> None:
        self.net.set_periphery_fault(slave, fault)

    def set_faults(self, slave: int, faults: Faults) -> None:
        self.net.set_faults(slave, p_no_answer=faults.no_answer, p_parity=faults.parity,
                            p_missing_pulse=faults.missing_pulse, p_shifted_pulse=faults.shifted_pulse,
                            p_extra_pulse=faults.extra_pulse, shift_ns=faults.shift_ns, delay_ns=faults.delay_ns)

    def set_value(self, slave: int, channel: int, word: int) -> None:
        self.net.set_value(slave, channel, word)

    def get_value(self, slave: int, channel: int) -> int | None:
        """Output word that a slave has received; None: none yet."""
        return self.net.value(slave, channel)

    def set_invalid(self, slave: int, invalid: int, overflow: int) -> None:
        self.net.set_invalid(slave, invalid, overflow)

    def set_safety(self, slave: int, table: tuple[int, ...], closed: int) -> None:
        self.net.set_safety(slave, table, closed)

    def power(self, good: bool) -> None:
        self.net.power(good)

    def apf(self, low: bool) -> None:
        self.chip.apf(low)

    def attach_flash(self, content: bytes) -> None:
        """A flash with this content on the SPI pins; before the first run. BenchError: no library."""
        from asi import native
        try:
            self._flash = native.Flash(len(content))
            self._flash.load(0, content)
        except (OSError, RuntimeError) as error:
            raise BenchError(str(error)) from None
        self.chip.attach_flash(self._flash)

    def flash_content(self) -> bytes:
        """What is left in the flash when it is switched off now. Nothing may run after it."""
        self._flash.power_up()  # breaks off what is under way
        return self._flash.peek(0, self._flash.size)

    def close(self) -> None:
        self.chip.close()


def open_bench(firmware: Path, waves: Path | None, seed: int) -> NativeBench:
    """A chip in reset state at time 0; BenchError when the native libraries are not there or fail."""
    from asi import native  # only here: plants and reports need no simulator
    if not firmware.is_file():
        raise BenchError(f"{firmware} is missing: make firmware")
    try:
        return NativeBench(native.Chip(firmware=firmware, waves=waves, seed=seed))
    except (OSError, RuntimeError) as error:
        raise BenchError(str(error)) from None


def name_waves(path: Path) -> Path:
    """Give a finished wave file the suffix of what is in it: .vcd or .fst (the build decides). -> the new path."""
    with open(path, "rb") as file:
        suffix = ".vcd" if file.read(1) == b"$" else ".fst"
    return path.replace(path.with_suffix(suffix))
