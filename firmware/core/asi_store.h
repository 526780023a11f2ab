/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_store.h  Permanent data in SPI NOR flash: a journal of whole sets with CRC (NV-001 ..).
 * Layer: protocol core; the flash is behind asi_flash.h. Context: main loop only, never in the interrupt.
 * Memory: one asi_store_t, owned by the caller. No call waits for the flash: asi_store_serve does one short step.
 */
#ifndef ASI_STORE_H
#define ASI_STORE_H
#include <stdbool.h>
#include <stdint.h>
#include "asi_permanent.h"
#include "asi_status.h"

#define ASI_STORE_OPAQUE 3200u /**< bytes of host data kept with the set: bus and slave parameters of the host interface */

/** What survives. `opaque` belongs to the host interface (packets, personalities); the rest is execution control's. */
typedef struct {
    asi_permanent_t master;
    uint16_t opaque_length;
    uint8_t opaque[ASI_STORE_OPAQUE];
} asi_permanent_set_t;

typedef enum { ASI_STORE_ABSENT, ASI_STORE_EMPTY, ASI_STORE_LOADED, ASI_STORE_CORRUPT } asi_store_state_t;

typedef struct {
    asi_store_state_t state;   /**< what was found at start */
    bool busy, failed, saved;  /**< under way; the last one failed; what is in use is in flash */
    uint32_t sequence;         /**< of the newest whole set */
    /* private to asi_store.c */
    uint32_t write_at, position, crc;
    uint16_t length;
    uint8_t step, sector, tries;
    const asi_permanent_set_t *set;
} asi_store_t;

/** Find and read the newest whole set. set: filled when state is ASI_STORE_LOADED, else untouched.
 * A flash that does not answer, is empty or holds no whole set ends here too, never in a wait (NV-005). */
void asi_store_open(asi_store_t *store, asi_permanent_set_t *set);
/** Store this set; it must stay unchanged while store->busy. @return ASI_E_BUSY; ASI_E_STORE: there is no flash */
ASI_MUST_USE asi_status_t asi_store_begin(asi_store_t *store, const asi_permanent_set_t *set);
/** One step of at most one page program or status read; to be called until !store->busy. */
void asi_store_serve(asi_store_t *store);
#endif
