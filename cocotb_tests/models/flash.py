# SPDX-License-Identifier: Apache-2.0
"""SPI NOR flash: JEDEC commands, mode 0. Twin of tb/asi_flash.cpp, to the last bit (test_flash.py compares them).

Flash is pure Python: whole bytes (select, byte) or pins. bind() connects one to the SPI pins of a cocotb DUT.
Times in ns of the caller's clock, never going back.
"""
PAGE, SECTOR = 256, 4096
PROGRAM, READ, WRITE_DISABLE, STATUS, WRITE_ENABLE = 0x02, 0x03, 0x04, 0x05, 0x06
ERASE, READ_ID, WAKE, SLEEP = 0x20, 0x9F, 0xAB, 0xB9
KNOWN = {PROGRAM, READ, WRITE_DISABLE, STATUS, WRITE_ENABLE, ERASE, READ_ID, WAKE, SLEEP}
WAKE_NS = 30_000  # tRES1


def _hash(x):
    x &= 0xFFFF_FFFF
    x = (x ^ x >> 16) * 0x7FEB352D & 0xFFFF_FFFF
    x = (x ^ x >> 15) * 0x846CA68B & 0xFFFF_FFFF
    return x ^ x >> 16


class Flash:
    """size: bytes, a power of 2; all erased. Wakes up in deep power-down, as an FPGA leaves its flash."""

    def __init__(self, size=1 << 21):
        self.size, self.cells, self.doubts = size, bytearray(b"\xFF" * size), bytearray(size)
        self.program_ns, self.erase_ns = 400_000, 45_000_000
        self.bytes, self.programs, self.erases, self.refused = 0, 0, 0, 0
        self.rng, self.dead, self.op = 1, False, None
        self.power_up()

    # ---- the test's side
    def load(self, address, data):
        self.cells[address:address + len(data)] = data
        self.doubts[address:address + len(data)] = bytes(len(data))

    def times(self, program_ns, erase_ns):
        self.program_ns, self.erase_ns = program_ns, erase_ns

    def cut_after(self, count, seed=1):
        """Power fails after count more bytes on SPI; -1: never. seed: of what a broken off operation leaves."""
        self.rng, self.cut_left = seed or 1, count
        if count == 0:
            self._cut()

    def power_up(self):
        """Off and on again."""
        if not self.dead and self.op:
            self._tear()
        self.dead = self.selected = self.latch = False
        self.deep, self.awake_at = True, None
        self.op, self.busy_until, self.cut_left = None, 0, -1
        self.command, self.taken, self.address, self.page = None, 0, 0, {}
        self.bit, self.shift_in, self.shift_out, self.sck, self.cs_n = 0, 0, 0xFF, 0, 1

    def counts(self):
        """-> (bytes on SPI, programs, erases, refused frames)"""
        return self.bytes, self.programs, self.erases, self.refused

    # ---- cells
    def _dice(self):
        x = self.rng
        x ^= x << 13 & 0xFFFF_FFFF
        x ^= x >> 17
        x ^= x << 5 & 0xFFFF_FFFF
        self.rng = x
        return x

    def _finish(self):
        kind, at, page = self.op
        if kind == PROGRAM:
            for k, value in page.items():
                self.cells[at + k] &= value
                self.doubts[at + k] &= value
        else:
            self.load(at, b"\xFF" * SECTOR)
        self.op, self.latch = None, False

    def _tear(self):
        """Power has failed in it: cells anyhow, those between 0 and 1 in doubt."""
        kind, at, page = self.op
        how = self._dice() % (4 if kind == PROGRAM else 5)
        for k in sorted(page) if kind == PROGRAM else range(SECTOR):
            r = self._dice()
            a, b, c = r & 255, r >> 8 & 255, r >> 16 & 255
            cell, doubt = self.cells[at + k], self.doubts[at + k]
            if kind == PROGRAM:
                zeros = cell & ~page[k] & 255
                done = (0, zeros & a, zeros, zeros)[how]
                doubt = doubt & ~done | (zeros & a & b, zeros & ~a & b, zeros & a & b, 0)[how]
                cell &= ~done
            else:
                cell, doubt = ((cell & a, 0), (a, b), (255, a & b & c), (255, 0), (cell, doubt | ~cell & a & b))[how]
            self.cells[at + k], self.doubts[at + k] = cell & 255, doubt & 255
        self.op = None

    def _cut(self):
        self.cut_left = -1
        if self.op:
            self._tear()
        self.dead = True

    # ---- bytes
    def _settle(self, t):
        if self.op and t >= self.busy_until:
            self._finish()
        if self.deep and self.awake_at is not None and t >= self.awake_at:
            self.deep = False

    def _answer(self, t):
        if self.dead or not self.taken:
            return 0xFF
        self._settle(t)
        if self.command == STATUS:
            return bool(self.op) | self.latch << 1
        if self.command == READ_ID:
            return (0xEF, 0x40, self.size.bit_length() - 1)[(self.taken - 1) % 3]
        if self.command == READ and self.taken >= 4:
            a = (self.address + self.taken - 4) % self.size
            return self.cells[a] ^ self.doubts[a] & _hash(a + 0x9E3779B9 * self.bytes)
        return 0xFF

    def _take(self, t, value):
        if self.dead:
            return
        self._settle(t)
        if self.taken == 0:
            wrong = value not in KNOWN or self.deep and value != WAKE or self.op and value != STATUS
            self.command = None if wrong else value
        elif self.taken < 4:
            self.address = (self.address << 8 | value) % self.size
            if self.taken == 3:
                self.page = {}
        elif self.command == PROGRAM:
            self.page[(self.address + self.taken - 4) % PAGE] = value
        self.taken += 1
        self.bytes += 1
        if self.cut_left > 0:
            self.cut_left -= 1
            if self.cut_left == 0:
                self._cut()

    def _execute(self, t):
        self._settle(t)
        whole, one = self.bit == 0, self.bit == 0 and self.taken == 1
        done = self.command in (READ, STATUS, READ_ID) or one and self.command in (WRITE_ENABLE, WRITE_DISABLE, SLEEP)
        if one and self.command in (WRITE_ENABLE, WRITE_DISABLE):
            self.latch = self.command == WRITE_ENABLE
        elif one and self.command == SLEEP:
            self.deep, self.awake_at = True, None
        elif self.command == WAKE and whole:
            done = True
            if self.deep and self.awake_at is None:
                self.awake_at = t + WAKE_NS
        elif self.command == PROGRAM and whole and self.taken > 4 and self.latch:
            done = True
            self.op, self.busy_until = (PROGRAM, self.address & -PAGE, self.page), t + self.program_ns
            self.programs += 1
        elif self.command == ERASE and whole and self.taken == 4 and self.latch:
            done = True
            self.op, self.busy_until = (ERASE, self.address & -SECTOR, None), t + self.erase_ns
            self.erases += 1
        if not done and (self.taken or not whole):
            self.refused += 1

    def select(self, t, on):
        if self.dead or on == self.selected:
            return
        if not on:
            self._execute(t)
        self.selected, self.taken, self.bit, self.command = on, 0, 0, None

    def byte(self, t, value):
        """-> the byte that came back"""
        if self.dead or not self.selected:
            return 0xFF
        out = self._answer(t)
        self._take(t, value)
        return out

    # ---- pins
    def pins(self, t, cs_n, sck, mosi):
        """New levels of the pins. -> MISO"""
        rise, fall, selects = sck and not self.sck, self.sck and not sck, self.cs_n and not cs_n
        self.sck = sck
        if cs_n != self.cs_n:
            self.cs_n = cs_n
            self.select(t, not cs_n)
        if self.dead or not self.selected:
            return 1
        if rise and not selects:
            self.shift_in = (self.shift_in << 1 | mosi) & 255
            self.bit = (self.bit + 1) % 8
            if self.bit == 0:
                self._take(t, self.shift_in)
        if (selects or fall) and self.bit == 0:
            self.shift_out = self._answer(t)
        return 1 if self.dead else self.shift_out >> (7 - self.bit) & 1


def bind(dut, flash):
    """flash on the SPI pins of dut, from now on: power comes up. It hears each edge of chip select and clock."""
    import cocotb
    from cocotb.utils import get_sim_time

    flash.power_up()
    dut.spi_miso_i.value = 1

    async def follow(pin):
        while True:
            await pin.value_change
            levels = [int(p.value) for p in (dut.spi_cs_no, dut.spi_sck_o, dut.spi_mosi_o)]
            dut.spi_miso_i.value = flash.pins(int(get_sim_time("ns")), *levels)

    cocotb.start_soon(follow(dut.spi_cs_no))
    cocotb.start_soon(follow(dut.spi_sck_o))
    return flash
