/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_persist.h  Permanent data of this master: what to start with, when to store, what the host sees of it.
 * Context: main loop only. Memory: static, one master. Requirements: NV-001, NV-005, NV-006, NV-009.
 */
#ifndef ASI_PERSIST_H
#define ASI_PERSIST_H
#include <stdbool.h>
#include <stdint.h>
#include "asi_permanent.h"
#include "asi_status.h"

/** Find the flash and read what is stored: once, at start, before the line is on. Takes as long as reading does,
 * some ms. @return the stored data, else defaults: nothing projected, codes FFFF, parameters F, configuration mode,
 *   data exchange on, no automatic addressing, no auto clear. Stays valid, and unchanged until asi_persist_request */
const asi_permanent_t *asi_persist_open(void);
/** What asi_persist_open gave is whole but makes no sense: the same as corrupt, so defaults are in use. */
void asi_persist_refuse(void);
/** Have this stored unless it is what is in flash already. It is copied; it must not change during the call. While a
 * store is under way the newest request waits. After a failed store, or without a flash, nothing is tried again until
 * the next request. */
void asi_persist_request(const asi_permanent_t *now);
/** One short step of storing; call it once in each round of the main loop. */
void asi_persist_serve(void);
/** Whether a store has ended since the last call. @param result ASI_OK or ASI_E_STORE */
bool asi_persist_ended(asi_status_t *result);
/** Word STORE of the host window (store_r in rdl/asi.rdl). */
uint32_t asi_persist_word(void);
/** The host interface's own block, stored with the rest. @param length bytes of it; 0: none */
const uint8_t *asi_persist_opaque(unsigned *length);
/** Have a new block stored, unless it is what is there already. It is copied.
 * @return ASI_E_OVERFLOW: more than ASI_STORE_OPAQUE; ASI_E_BUSY: a store is under way, ask again when it has ended */
ASI_MUST_USE asi_status_t asi_persist_opaque_set(const uint8_t *bytes, unsigned length);
#endif
