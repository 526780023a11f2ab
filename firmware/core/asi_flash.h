/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_flash.h  SPI NOR flash as the storage needs it. The HAL implements it on asi_spi (firmware/hal/asi_flash.c),
 * the native build on a model. Addresses are bytes from the start of the storage area, which lies behind the image.
 */
#ifndef ASI_FLASH_H
#define ASI_FLASH_H
#include <stdbool.h>
#include <stdint.h>

#define ASI_FLASH_SECTOR 4096u  /**< bytes of the smallest erase */
#define ASI_FLASH_PAGE 256u     /**< bytes of the largest program; it must not cross a page */
#define ASI_FLASH_SECTORS 16u   /**< sectors of the storage area; wear is spread over them */

/** Wake the flash and ask its JEDEC identification. @return false: none answers */
bool asi_flash_open(void);
void asi_flash_read(uint32_t address, void *to, unsigned bytes);
/** Start programming at most a page; 1 bits become 0. Returns at once; asi_flash_busy tells the end. */
void asi_flash_program(uint32_t address, const void *from, unsigned bytes);
/** Start erasing the sector at this address. */
void asi_flash_erase(uint32_t address);
/** Reads the status register once. */
bool asi_flash_busy(void);
#endif
