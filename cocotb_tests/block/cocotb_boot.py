# SPDX-License-Identifier: Apache-2.0
import os
import struct

import cocotb
from cocotb.triggers import ClockCycles, RisingEdge

from cocotb_tests.block.cocotb_master import MasterTB
from cocotb_tests.block.cocotb_soc import ALIVE
from cocotb_tests.models.flash import Flash, bind

FLASH_OFFSET, FLASH_MAGIC = 0x10_0000, 0x4249_5341                 # header of the image: firmware/boot/boot.c
WAKE_AND_READ = 1 + 4                                              # bytes on SPI before the first one of the image


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
    """HW-007, NV-007: the boot ROM wakes the flash, copies the program to RAM, reads nothing else, and starts it."""
    content = image()
    tb = BootTB(dut)
    flash = bind(dut, Flash())
    flash.load(FLASH_OFFSET, content)
    await tb.reset()
    assert await tb.alive(200_000), f"not started; {flash.bytes} bytes on SPI for {len(content)}"
    assert flash.counts() == (WAKE_AND_READ + len(content), 0, 0, 0) and int(dut.spi_cs_no.value) == 1
    assert await tb.peek(0) == struct.unpack_from("<I", content, 16)[0]


@cocotb.test(timeout_time=500, timeout_unit="ms")
async def damaged_flash(dut):
    """HW-007: an image with one wrong bit, in header, sums or program, is not started; a good one is, next try."""
    content = image()
    tb = BootTB(dut)
    flash = bind(dut, Flash())
    for byte in (0, 4, 8, 12, 16, len(content) - 1):
        bad = bytearray(content)
        bad[byte] ^= 0x10
        flash.load(FLASH_OFFSET, bad)
        flash.bytes = 0
        await tb.reset()
        assert not await tb.alive(80_000) and flash.bytes >= WAKE_AND_READ + 16, f"byte {byte}"
    flash.load(FLASH_OFFSET, content)
    assert await tb.alive(400_000)
