/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_spi.h  The byte shifter (rtl/soc/asi_spi.sv), and time: all that asi_flash.c knows of the hardware.
 * Context: main loop only; nobody else uses the port once the program runs.
 */
#ifndef ASI_SPI_H
#define ASI_SPI_H
#include <stdbool.h>
#include <stdint.h>

/** Chip select pin low (true) or high. */
void asi_spi_select(bool on);
/** Shift one byte out and one in; waits for it, 1 us at most. */
uint8_t asi_spi_byte(uint8_t out);
/** us, wraps. */
uint32_t asi_spi_time_us(void);
#endif
