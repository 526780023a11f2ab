/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file boot.c  Copy the program from SPI NOR flash to RAM and start it (HW-007). At most 1 KB, in ROM, no variables.
 * In flash, little-endian words: magic, length in words, two running sums (tools/elf2hex.py --flash), then the image.
 * A bad header or sum is tried again for ever: the flash may still be waking up or be rewritten.
 */
#include <stdbool.h>
#include <stdint.h>
#include "asi_hw.h"

/** Byte address of the header in flash; behind the bitstream on UP5K boards. */
#ifndef ASI_FLASH_OFFSET
#define ASI_FLASH_OFFSET 0x100000u
#endif
#define FLASH_MAGIC 0x42495341u      /* 'ASIB' */
#define FLASH_READ 0x03u             /* read, 24-bit address, any length */
#define FLASH_WAKE 0xABu             /* release from deep power-down: an FPGA may leave its flash in it */
#define RAM_WORDS (62u * 256u)       /* 64 KB without the stack */
#define WAKE_US 50u                  /* longest tRES1 of common parts is 35 us */
#define RETRY_US 10000u

void boot(void);

static uint32_t spi_byte(uint32_t out)
{
    REG(SPI_DATA) = out;
    while (REG(SPI_CTRL) & ASI_REGS__SPI_CTRL__BUSY_bm) {
    }
    return REG(SPI_DATA) & ASI_REGS__SPI_DATA__DATA_bm;
}

static uint32_t spi_word(void)
{
    uint32_t word = 0;
    for (unsigned k = 0; k < 4u; k++)
        word = word >> 8 | spi_byte(0) << 24;
    return word;
}

static void pause_us(uint32_t us)
{
    const uint32_t start = REG(TIME);
    while (REG(TIME) - start < us) {
    }
}

static bool load(void)
{
    REG(SPI_CTRL) = ASI_REGS__SPI_CTRL__SELECT_bm;
    spi_byte(FLASH_WAKE);
    REG(SPI_CTRL) = 0;
    pause_us(WAKE_US);

    REG(SPI_CTRL) = ASI_REGS__SPI_CTRL__SELECT_bm;
    spi_byte(FLASH_READ);
    spi_byte(ASI_FLASH_OFFSET >> 16 & 255u);
    spi_byte(ASI_FLASH_OFFSET >> 8 & 255u);
    spi_byte(ASI_FLASH_OFFSET & 255u);
    const uint32_t magic = spi_word(), words = spi_word(), sum_a = spi_word(), sum_b = spi_word();
    uint32_t a = 0, b = 0;
    const bool header_good = magic == FLASH_MAGIC && words != 0u && words <= RAM_WORDS;
    if (header_good) {
        volatile uint32_t *ram = 0; /* the program starts at address 0 */
        for (uint32_t w = 0; w < words; w++) {
            const uint32_t word = spi_word();
            ram[w] = word;
            a += word;
            b += a;
        }
    }
    REG(SPI_CTRL) = 0;
    return header_good && a == sum_a && b == sum_b;
}

/** Returns when a good program lies in RAM. */
void boot(void)
{
    while (!load())
        pause_us(RETRY_US);
}
