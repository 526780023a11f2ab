# SPDX-License-Identifier: Apache-2.0
"""A firmware image on the real soft core; Python plays sequencer, line and host while the core sleeps.

One thing happens at a time: the core runs until it sleeps in WAIT, then a batch, a cycle or a tick is played and its
event set. Bus time is what calls take (154 us each), so awake times compare with the cycle.
"""
import functools
import os
import subprocess

import cffi
import pythondata_cpu_vexriscv
from fake_line import ABORTED, NO_RESPONSE, OK
from native import ROOT

from asi import regmap

BUILD = ROOT / "build/firmware/soc"
MAX_CLOCKS = 400_000
CYCLE_DONE, BATCH_DONE, SLAVE_LOST, APF_CHANGE, TICK, HOST_ATTN = (1 << k for k in range(6))
EXCHANGE_DONE = 1 << 7


@functools.cache
def load():
    """Verilate the core once -> (ffi, lib)."""
    ffi = cffi.FFI()
    text = (ROOT / "firmware/tests/soc.h").read_text()
    ffi.cdef(text.split("/* cffi begin */")[1].split("/* cffi end */")[0])
    library = BUILD / "libfwsoc.so"
    sources = [ROOT / "firmware/tests/soc.cpp", ROOT / "firmware/tests/soc.h"]
    if not library.exists() or library.stat().st_mtime < max(p.stat().st_mtime for p in sources):
        core = f"{pythondata_cpu_vexriscv.data_location}/VexRiscv_Min.v"
        part = BUILD / f"part{os.getpid()}"
        part.mkdir(parents=True, exist_ok=True)
        subprocess.run(["verilator", "--cc", "--exe", "--build", "-j", "1", "-O3", "--x-assign", "fast", "-Wno-fatal",
                        "-Wno-lint", "--top-module", "VexRiscv", "--prefix", "VVexRiscv", "--Mdir", str(part),
                        "-o", "libfwsoc.so", "-CFLAGS", f"-fPIC -O2 -I{ROOT}/firmware/generated", "-LDFLAGS", "-shared",
                        core, str(sources[0])], check=True, stdout=subprocess.DEVNULL)
        os.replace(part / "libfwsoc.so", library)
    return ffi, ffi.dlopen(str(library))


def host_at(name):
    """Byte offset in the host window."""
    return getattr(regmap, f"HOST_{name}")


def link_at(name):
    """Byte offset in the link RAM."""
    return getattr(regmap, f"LINK_{name}")


def image(name):
    """build/firmware/<name>.hex, made when it is missing or old -> words"""
    venv = os.environ["VERILATOR_ROOT"].rsplit("/lib/", 1)[0]
    subprocess.run(["make", "-s", f"VENV={venv}", f"build/firmware/{name}.hex"], check=True, cwd=ROOT,
                   stdout=subprocess.DEVNULL)
    return [int(line, 16) for line in (ROOT / f"build/firmware/{name}.hex").read_text().split()]


def signed(word):
    return word - (1 << 32) * (word >> 31)


class Chip:
    """Core, fake sequencer and slaves, and the host's side of the window."""

    def __init__(self, slaves=(), firmware="asi_test", flash=None, words=None):
        self.ffi, self.lib = load()
        self.slaves, self.log, self.apf = list(slaves), [], False
        self.flash = self.ffi.new("uint8_t[]", flash or b"\0")
        start = 0x1000_0000 if flash is not None else 0
        self.lib.soc_open(start, self.flash, 0x100000, len(flash or b""))
        self.r, self.link, self.window = self.lib.soc_regs(), self.lib.soc_link(), self.lib.soc_window()
        memory = self.lib.soc_rom() if flash is not None else self.lib.soc_ram()
        for k, word in enumerate(words or image("boot" if flash is not None else firmware)):
            memory[k] = word
        self.cycle_number = 0
        self.was_management = False

    # ---- the core
    def run(self):
        """Until the core sleeps; it must, and by then all events are served."""
        assert self.lib.soc_run(MAX_CLOCKS) == 1, "the core does not come back to sleep"
        assert self.r.event & self.r.event_en == 0
        assert self.r.bad_accesses == self.r.seq_violations == self.r.torn_writes == self.r.batch_while_busy == 0
        return self

    def event(self, bits):
        self.r.event |= bits
        return self.run()

    # ---- the sequencer
    def attempt(self, call):
        if not self.r.ctrl & 8 or self.apf:
            return ABORTED, 0
        self.r.skipped_us += 154
        self.link[link_at("SENT") // 4] += 1
        answers = {a for s in self.slaves if (a := s.answer(call)) is not None}
        result = (OK, answers.pop()) if len(answers) == 1 else (7, 0) if answers else (NO_RESPONSE, 0)
        self.log.append((call, *result))
        return result

    def request(self, word):
        """Request word -> result word"""
        for _ in range((word >> 12 & 3) + 1):
            error, data = self.attempt(word & 0x7FF)
            if error in (OK, ABORTED):
                break
        return word & 0xFF0000 | error << 4 | data

    def batch(self):
        if not self.r.status & 1:
            return False
        at = link_at("BATCH") // 4
        for k in range(self.r.batch_len):
            self.link[at + k] = self.request(self.link[at + k])
        self.r.status &= ~1
        self.event(BATCH_DONE)
        return True

    def cycle(self):
        if self.r.ctrl & 9 != 9:
            return False
        slot, state, out, work, img = (link_at(n) // 4 for n in ("SLOT", "SLOT_STATE", "OUT_IMG", "IN_WORK", "IN_IMG"))
        events, start = CYCLE_DONE, self.r.skipped_us
        for number in range(1, 32):
            a, b = (self.link[slot + i] & 1 and (self.link[state + i] >> 16 & 7) < 3 for i in (number, number + 32))
            if not a and not b:
                continue
            i = number + 32 * bool(b and (not a or self.cycle_number & 1))
            nibble = self.link[out + i // 8] >> i % 8 * 4 & 15
            if self.link[slot + i] & 2:
                nibble = nibble & 7 | (0 if i > 31 else 8)
            call = number << 5 | nibble
            if self.r.ctrl & 16:  # LK-021
                call = 0x400 | number << 5 | 0x11 ^ (8 if i > 31 else 0)
            result = self.request(1 << 12 | call)
            books = (call & 15) << 20 | (self.link[state + i] + (1 << 28)) & 0xF000_0000
            value = self.link[work + i // 8]
            if result >> 4 & 15 == OK:
                self.link[state + i] = result & 15 | books
                value = value & ~(15 << i % 8 * 4) | (result & 15) << i % 8 * 4
            else:
                streak = (self.link[state + i] >> 16 & 7) + 1
                self.link[state + i] = self.link[state + i] & 15 | result & 0xF0 | streak << 16 | books
                if streak == 3:
                    events |= SLAVE_LOST
                    value &= ~(15 << i % 8 * 4)
            self.link[work + i // 8] = value & 0xFFFFFFFF
        if self.r.event_en & EXCHANGE_DONE:  # there are live slots
            self.event(EXCHANGE_DONE)
        mgmt, incl = link_at("MGMT_REQ") // 4, link_at("INCL_REQ") // 4
        pending = (self.link[mgmt] ^ self.link[mgmt + 1]) >> 16 & 255
        if pending and not (self.was_management and self.link[incl] >> 31):
            self.link[mgmt + 1] = self.request(self.link[mgmt])
            self.was_management = True
        elif self.link[incl] >> 31:
            self.link[incl + 1] = self.request(self.link[incl])
            self.was_management = False
        for w in range(8):
            self.link[img + w] = self.link[work + w]
        self.cycle_number += 1
        self.link[link_at("CYCLES") // 4] += 1
        self.r.skipped_us = max(self.r.skipped_us, start + (self.r.ctrl >> 16 & 0x1FFF))
        self.event(events)
        return True

    def tick(self):
        self.r.skipped_us += 1024
        return self.event(TICK)

    def step(self):
        if not self.r.ctrl & 8:  # a stop drains
            if self.r.status & 1:
                for k in range(self.r.batch_len):
                    self.link[link_at("BATCH") // 4 + k] = ABORTED << 4
                self.r.status &= ~1
                self.r.event |= BATCH_DONE
        return self.batch() or self.cycle() or self.tick()

    def until(self, condition, steps=1500):
        for _ in range(steps):
            if condition():
                return self
            self.step()
        raise AssertionError(f"not reached in {steps} steps: phase {self.read('PHASE')}")

    def start(self):
        self.run()
        return self.until(lambda: self.read("PHASE") == 3)

    def power(self, apf):
        self.apf = apf
        self.r.status = self.r.status & ~4 | 4 * apf
        return self.event(APF_CHANGE)

    # ---- the host
    def read(self, name, k=0):
        return self.window[host_at(name) // 4 + k]

    def write(self, name, value, k=0):
        self.window[host_at(name) // 4 + k] = value

    def item(self, name, index, size):
        """Entry of CDI, PCD (size 2), PP, PI, PECHO (size 1)."""
        at = host_at(name) + index * size
        return self.window[at // 4] >> at % 4 * 8 & (1 << 8 * size) - 1

    def put(self, name, index, size, value):
        at = host_at(name) + index * size
        mask = (1 << 8 * size) - 1 << at % 4 * 8
        self.window[at // 4] = self.window[at // 4] & ~mask | value << at % 4 * 8

    def list(self, name):
        return {i for i in range(64) if self.read(name, i >> 5) >> (i & 31) & 1}

    def nibble(self, name, index):
        return self.read(name, index // 8) >> index % 8 * 4 & 15

    def commit(self, **controls):
        """HOST_CTRL from keywords (data_exchange is on), HOST_SEQ + 1, -> FW_RESULT once FW_SEQ follows."""
        bits = {"data_exchange": 1, **controls}
        word = sum(bits.pop(n, 0) << k for k, n in enumerate(
            ("protected_mode", "offline", "data_exchange", "auto_address_enable")))
        self.write("HOST_CTRL", word | bits.pop("raw", 0))
        assert not bits
        self.write("HOST_SEQ", self.read("HOST_SEQ") + 1 & 0xFFFFFFFF)
        self.event(HOST_ATTN)
        assert self.read("FW_SEQ") == self.read("HOST_SEQ")
        return signed(self.read("FW_RESULT"))

    def ask(self, code, a=0, b=0, string=b""):
        """Begin a function of the mailbox; wakes nobody."""
        for k in range(0, len(string), 4):
            self.write("FN_STRING", int.from_bytes(string[k:k + 4], "little"), k // 4)
        for name, value, k in (("FN_LEN", len(string), 0), ("FN_CODE", code, 0), ("FN_ARG", a, 0), ("FN_ARG", b, 1)):
            self.write(name, value, k)
        self.write("FN_SEQ", self.read("FN_SEQ") + 1 & 0xFFFFFFFF)

    @property
    def answered(self):
        return self.read("FN_DONE") == self.read("FN_SEQ")

    def function(self, code, a=0, b=0, string=b"", steps=400):
        """-> (FN_STATUS, FN_DATA, bytes of FN_STRING)"""
        self.ask(code, a, b, string)
        for _ in range(steps):
            if self.answered:
                break
            self.step()
        assert self.answered, f"function {code} has no answer"
        length = self.read("FN_LEN")
        words = b"".join(self.read("FN_STRING", k).to_bytes(4, "little") for k in range((length + 3) // 4))
        return signed(self.read("FN_STATUS")), self.read("FN_DATA"), words[:length]

    def events(self):
        """The log: [(time, event, index, data)], oldest first"""
        head = self.read("LOG_HEAD")
        words = [(self.read("LOG", 2 * (n % 64)), self.read("LOG", 2 * (n % 64) + 1))
                 for n in range(max(0, head - 64), head)]
        return [(t, w & 255, w >> 8 & 255, w >> 16) for t, w in words]

