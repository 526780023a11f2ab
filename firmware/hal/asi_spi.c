/* SPDX-License-Identifier: Apache-2.0 */
/** @file asi_spi.c */
#include "asi_spi.h"
#include "asi_hw.h"

void asi_spi_select(bool on)
{
    REG(SPI_CTRL) = on ? ASI_REGS__SPI_CTRL__SELECT_bm : 0u;
}

uint8_t asi_spi_byte(uint8_t out)
{
    REG(SPI_DATA) = out;
    while (REG(SPI_CTRL) & ASI_REGS__SPI_CTRL__BUSY_bm) { /* the hardware ends it after 16 half periods */
    }
    return (uint8_t)(REG(SPI_DATA) & ASI_REGS__SPI_DATA__DATA_bm);
}

uint32_t asi_spi_time_us(void)
{
    return REG(TIME);
}
