/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_flash.h  SPI NOR flash as the storage needs it (firmware/hal/asi_flash.c, on asi_spi.h).
 * Addresses are bytes from the start of the storage area, which lies behind the image.
 */
#ifndef ASI_FLASH_H
#define ASI_FLASH_H
#include <stdbool.h>
#include <stdint.h>

#define ASI_FLASH_SECTOR 4096u  /**< bytes of the smallest erase */
#define ASI_FLASH_PAGE 256u     /**< bytes of the largest program; it must not cross a page */
#define ASI_FLASH_SECTORS 16u   /**< sectors of the storage area; wear is spread over them */
#define ASI_FLASH_AREA (ASI_FLASH_SECTOR * ASI_FLASH_SECTORS)

/** Wake the flash and ask its JEDEC identification. An erase that a reset has left running may end first, for
 * half a second at most. @return false: none answers */
bool asi_flash_open(void);
void asi_flash_read(uint32_t address, void *to, unsigned bytes);
/** Start programming at most a page; 1 bits become 0. Returns at once; asi_flash_busy tells the end.
 * What would leave the page or the storage area is not begun. */
void asi_flash_program(uint32_t address, const void *from, unsigned bytes);
/** Start erasing the sector at this address. */
void asi_flash_erase(uint32_t address);
/** Reads the status register once. */
bool asi_flash_busy(void);
#endif
