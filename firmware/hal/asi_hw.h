/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_hw.h  Where the generated maps lie (docs/architecture.md). The generated structs are packed, and a
 * compiler may read a packed word byte by byte: so only their offsets are used, and each access is one volatile word.
 */
#ifndef ASI_HW_H
#define ASI_HW_H
#include <stddef.h>
#include <stdint.h>
#include "asi_host.h"
#include "asi_link_ram.h"
#include "asi_regs.h"

#define ASI_WINDOW_BASE 0x40000000u
#define ASI_REGS_BASE 0x80000000u
#define ASI_LINK_BASE 0x80010000u
#define ASI_STATS_BASE 0x80020000u
#define ASI_STATS_CLEAR_BASE 0x80021000u /* a read here clears the word */
#define ASI_RING_BASE 0x80030000u
#define ASI_RING_RECORDS 256u

#define REG(name) (*(volatile uint32_t *)(ASI_REGS_BASE + offsetof(asi_regs_t, name)))
/** first word of an array or a single word of the link RAM */
#define LINK(name) ((volatile uint32_t *)(ASI_LINK_BASE + offsetof(asi_link_ram_t, name)))
/** the same for the host window; type: uint32_t, uint16_t (CDI, PCD) or uint8_t (PP, PI, PECHO) */
#define WINDOW(type, name) ((volatile type *)(ASI_WINDOW_BASE + offsetof(asi_host_t, name)))
#endif
