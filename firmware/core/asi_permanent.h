/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_permanent.h  What the master keeps over power-off, apart from the host's own block (NV-001).
 */
#ifndef ASI_PERMANENT_H
#define ASI_PERMANENT_H
#include <stdbool.h>
#include <stdint.h>
#include "asi_config.h"
#include "asi_lists.h"

/** What the host has projected. */
typedef struct {
    asi_list_t lps;               /**< projected slaves; never 0 or 32 */
    uint16_t pcd[ASI_INDICES];    /**< projected codes: IO 3..0, ID 7..4, ID1 11..8, ID2 15..12 */
    uint8_t pp[ASI_INDICES];      /**< projected parameters, 0..F */
} asi_projection_t;

/** Auto clear modes (EX-033). */
enum { ASI_AUTO_CLEAR_OFF = 0, ASI_AUTO_CLEAR_MISSING = 1, ASI_AUTO_CLEAR_FAULT = 2, ASI_AUTO_CLEAR_BOTH = 3 };

typedef struct {
    asi_projection_t projection;
    bool protected_mode, auto_address, data_exchange;
    uint8_t auto_clear;
} asi_permanent_t;
#endif
