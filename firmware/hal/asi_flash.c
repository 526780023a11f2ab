/* SPDX-License-Identifier: Apache-2.0 */
/** @file asi_flash.c  JEDEC commands with 24-bit addresses, as all common SPI NOR parts have them (NV-007). */
#include "asi_flash.h"
#include "asi_spi.h"

/** Byte address of the storage area in flash: behind the image, whose header is at 0x100000 (firmware/boot/boot.c). */
#ifndef ASI_FLASH_STORE_OFFSET
#define ASI_FLASH_STORE_OFFSET 0x110000u
#endif

_Static_assert(ASI_FLASH_STORE_OFFSET % ASI_FLASH_SECTOR == 0u, "the area begins with a sector");

enum {
    PAGE_PROGRAM = 0x02, READ = 0x03, READ_STATUS = 0x05, WRITE_ENABLE = 0x06, SECTOR_ERASE = 0x20, READ_ID = 0x9F,
    WAKE = 0xAB,
    WRITE_IN_PROGRESS = 1,
    WAKE_US = 50,          /* longest tRES1 of common parts is 35 us */
    LEFT_OVER_US = 500000, /* an erase that a reset has left running */
};

static void begin(uint8_t command)
{
    asi_spi_select(true);
    (void)asi_spi_byte(command);
}

static void begin_at(uint8_t command, uint32_t address)
{
    address += ASI_FLASH_STORE_OFFSET;
    begin(command);
    (void)asi_spi_byte((uint8_t)(address >> 16));
    (void)asi_spi_byte((uint8_t)(address >> 8));
    (void)asi_spi_byte((uint8_t)address);
}

static void end(void)
{
    asi_spi_select(false);
}

static uint8_t status(void)
{
    begin(READ_STATUS);
    const uint8_t value = asi_spi_byte(0);
    end();
    return value;
}

static void write_enable(void)
{
    begin(WRITE_ENABLE);
    end();
}

bool asi_flash_open(void)
{
    begin(WAKE);
    end();
    const uint32_t start = asi_spi_time_us();
    while (asi_spi_time_us() - start < WAKE_US) {
    }
    for (;;) { /* a status of FF is no flash at all */
        const uint8_t value = status();
        if (!(value & WRITE_IN_PROGRESS) || value == 0xFFu || asi_spi_time_us() - start > LEFT_OVER_US)
            break;
    }
    begin(READ_ID);
    const uint8_t id[3] = {asi_spi_byte(0), asi_spi_byte(0), asi_spi_byte(0)};
    end();
    return (id[0] | id[1] | id[2]) != 0u && (id[0] & id[1] & id[2]) != 0xFFu;
}

void asi_flash_read(uint32_t address, void *to, unsigned bytes)
{
    uint8_t *out = to;
    begin_at(READ, address);
    while (bytes-- != 0u)
        *out++ = asi_spi_byte(0);
    end();
}

void asi_flash_program(uint32_t address, const void *from, unsigned bytes)
{
    const uint8_t *in = from;
    if (bytes == 0u || address >= ASI_FLASH_AREA || address % ASI_FLASH_PAGE + bytes > ASI_FLASH_PAGE)
        return;
    write_enable();
    begin_at(PAGE_PROGRAM, address);
    while (bytes-- != 0u)
        (void)asi_spi_byte(*in++);
    end();
}

void asi_flash_erase(uint32_t address)
{
    if (address >= ASI_FLASH_AREA)
        return;
    write_enable();
    begin_at(SECTOR_ERASE, address);
    end();
}

bool asi_flash_busy(void)
{
    return (status() & WRITE_IN_PROGRESS) != 0u;
}
