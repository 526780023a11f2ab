# SPDX-License-Identifier: Apache-2.0
import os
import struct

import cocotb
from cocotb.triggers import ClockCycles, FallingEdge, RisingEdge

from cocotb_tests.block.cocotb_master import MasterTB
from cocotb_tests.block.cocotb_soc import ALIVE

FLASH_OFFSET, FLASH_MAGIC = 0x10_0000, 0x4249_5341                 # header of the image: firmware/boot/boot.c
READ = 0x03


class Flash:
    """SPI NOR flash, mode 0: answers READ with a 24-bit address. content begins at byte address `base`."""

    def __init__(self, dut, base, content):
        self.dut, self.base, self.content = dut, base, content
        self.bits, self.head, self.reads = 0, 0, 0                 # bits of this frame, first four bytes, bytes read
        for run in (self._select, self._rise, self._fall):
            cocotb.start_soon(run())

    async def _select(self):
        while True:
            await FallingEdge(self.dut.spi_cs_no)
            self.bits, self.head = 0, 0

    async def _rise(self):
        while True:
            await RisingEdge(self.dut.spi_sck_o)
            if self.bits < 32:
                self.head = self.head << 1 | int(self.dut.spi_mosi_o.value)
            self.bits += 1

    async def _fall(self):
        while True:
            await FallingEdge(self.dut.spi_sck_o)
            if self.bits < 32 or self.head >> 24 != READ:
                continue
            byte, bit = divmod(self.bits - 32, 8)
            offset = (self.head & 0xFFFFFF) - self.base + byte
            value = self.content[offset] if 0 <= offset < len(self.content) else 0xFF
            self.dut.spi_miso_i.value = value >> (7 - bit) & 1
            self.reads += bit == 7


def image():
    """The probe program as the loader wants it: magic, words, sum of the words, sum of the running sums, words."""
    words = [int(w, 16) for w in open(os.environ["PROBE_HEX"]).read().split()]
    a = b = 0
    for word in words:
        a = a + word & 0xFFFF_FFFF
        b = b + a & 0xFFFF_FFFF
    return struct.pack(f"<{4 + len(words)}I", FLASH_MAGIC, len(words), a, b, *words)


class BootTB(MasterTB):
    async def reset(self):
        self.dut.rst_i.value = 1
        await ClockCycles(self.clk, 3)
        self.dut.rst_i.value = 0
        await RisingEdge(self.clk)
        await self.host_write(ALIVE, 0)

    async def alive(self, limit):
        """True when the program says within limit clocks that it runs."""
        for _ in range(limit // 500):
            if await self.host_read(ALIVE) == 0x600DB007:
                return True
            await ClockCycles(self.clk, 500)
        return False


@cocotb.test(timeout_time=500, timeout_unit="ms")
async def from_flash(dut):
    """HW-007: the boot ROM copies the program from flash to RAM, reads nothing else, and starts it."""
    content = image()
    tb = BootTB(dut)
    flash = Flash(dut, FLASH_OFFSET, content)
    await tb.reset()
    assert await tb.alive(200_000), f"not started; {flash.reads} of {len(content)} bytes read"
    assert flash.reads == len(content) and int(dut.spi_cs_no.value) == 1
    assert await tb.peek(0) == struct.unpack_from("<I", content, 16)[0]


@cocotb.test(timeout_time=500, timeout_unit="ms")
async def damaged_flash(dut):
    """HW-007: an image with one wrong bit, in header, sums or program, is not started; a good one is, next try."""
    content = image()
    tb = BootTB(dut)
    flash = Flash(dut, FLASH_OFFSET, content)
    for byte in (0, 4, 8, 12, 16, len(content) - 1):
        bad = bytearray(content)
        bad[byte] ^= 0x10
        flash.content, flash.reads = bytes(bad), 0
        await tb.reset()
        assert not await tb.alive(80_000) and flash.reads >= 16, f"byte {byte}"
    flash.content = content
    assert await tb.alive(400_000)
