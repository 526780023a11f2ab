/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_store.h  Permanent data in SPI NOR flash: a journal of whole sets with CRC (NV-001 ..; docs/storage.md).
 * Layer: protocol core; the flash is behind asi_flash.h. Context: main loop only, never in the interrupt.
 * Memory: one asi_store_t, owned by the caller. No call waits for the flash: asi_store_serve does one short step.
 */
#ifndef ASI_STORE_H
#define ASI_STORE_H
#include <stdbool.h>
#include <stdint.h>
#include "asi_flash.h"
#include "asi_permanent.h"
#include "asi_status.h"

#define ASI_STORE_OPAQUE 3200u /**< bytes of the host interface kept with the set: bus and slave parameters */
#define ASI_STORE_TRIES 4u     /**< sectors tried for one set before the store has failed */
#define ASI_STORE_CANDIDATES 20u /**< spoilt sets passed over at start before it is called corrupt: bounds the start */
#define ASI_STORE_ERASE_US 3000000u  /**< us: a sector erase that takes longer has failed (0.4 s in common parts) */
#define ASI_STORE_PROGRAM_US 20000u  /**< us: the same of a page program (5 ms) */

/** What survives. `opaque` belongs to the host interface (packets, personalities); the rest is execution control's. */
typedef struct {
    asi_permanent_t master;
    uint16_t opaque_length;
    uint8_t opaque[ASI_STORE_OPAQUE];
} asi_permanent_set_t;

typedef enum { ASI_STORE_ABSENT, ASI_STORE_EMPTY, ASI_STORE_LOADED, ASI_STORE_CORRUPT } asi_store_state_t;

typedef struct {
    asi_store_state_t state;   /**< what was found at start */
    bool busy, failed, saved;  /**< under way; the last one failed; the last set given or read is in flash */
    uint32_t sequence;         /**< of the newest whole set; 0: there is none */
    /* private to asi_store.c */
    bool open;                 /* the sector was erased since the start: what is behind the last set is truly free */
    uint8_t step, sector, tries;
    uint16_t length, position; /* of the record under way: bytes; next byte */
    uint32_t newest, at, next_sequence, crc, since_us;
    const asi_permanent_set_t *set;
    uint8_t page[ASI_FLASH_PAGE];
} asi_store_t;

/** Find and read the newest whole set. Unless state is ASI_STORE_LOADED afterwards, the content of set is anything.
 * A flash that does not answer, is empty or holds no whole set ends here too, never in a wait (NV-005). */
void asi_store_open(asi_store_t *store, asi_permanent_set_t *set);
/** Store this set; it must stay unchanged while store->busy.
 * @return ASI_E_BUSY; ASI_E_STORE: there is no flash; ASI_E_ARG: opaque_length or a value is out of range */
ASI_MUST_USE asi_status_t asi_store_begin(asi_store_t *store, const asi_permanent_set_t *set);
/** One step, at most one page programmed or read; to be called until !store->busy. now_us: bus time, wraps. */
void asi_store_serve(asi_store_t *store, uint32_t now_us);
#endif
