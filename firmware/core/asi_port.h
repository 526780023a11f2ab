/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_port.h  What the protocol core needs from below. The HAL implements it on link RAM and registers
 * (firmware/hal/asi_hal.c), the native build on a fake sequencer (firmware/tests/native.c).
 * Reports come back through asi_ec_batch_done, asi_ec_exchange_done, asi_ec_cycle_done, asi_ec_slave_lost and
 * asi_ec_power.
 */
#ifndef ASI_PORT_H
#define ASI_PORT_H
#include <stdbool.h>
#include <stdint.h>
#include "asi_config.h"
#include "asi_enums.h"

/** One call on the line. */
typedef struct {
    uint16_t call;    /**< 11 bits, asi_calls.h */
    uint8_t retries;  /**< immediate repetitions after a failure, 0..3 */
    uint8_t tag;      /**< management and inclusion: comes back with the result */
    bool no_reply;    /**< broadcast: no answer is expected */
    bool sel;         /**< for a B slave: statistics are kept under its index (ST-001) */
} asi_request_t;

/** What came of it. */
typedef struct {
    uint8_t data;   /**< answer nibble, valid when error is ASI_ERR_OK */
    uint8_t error;  /**< asi_error_class_t of the last attempt */
    uint8_t tag;    /**< tag of the request */
} asi_result_t;

/** Books of a slot: its last finished call. */
typedef struct {
    uint8_t data;   /**< last valid answer */
    uint8_t error;  /**< class of the last attempt */
    uint8_t sent;   /**< I3..I0 on the line */
    uint8_t calls;  /**< calls finished, modulo 16 (LK-020) */
} asi_slot_state_t;

/** How the cycle runs. */
typedef struct {
    bool two_extra;         /**< P_EXTRA_CALLS = 2 */
    bool read_id;           /**< slots are called with RDID instead of DEXG (LK-021) */
    uint16_t min_cycle_us;  /**< shortest period, 0 = none */
} asi_cycle_mode_t;

/** Let telegrams out, or not: then an open call and all that follow it in a batch or cycle end as ABORTED. */
void asi_port_line(bool on);
/** True when neither a batch nor a cycle is running. */
bool asi_port_idle(void);
/** Run n (1..64) requests back to back; only when idle. The requests are copied. */
void asi_port_batch(const asi_request_t *requests, unsigned n);
/** Run cycles this way; may be repeated at any time. NULL: stop after the present one. */
void asi_port_cycle(const asi_cycle_mode_t *mode);
/** Call this index in the cycle, or not. extended: I3 of the call is ~Sel. live: the nibble is that of
 * asi_port_live. */
void asi_port_slot(unsigned index, bool active, bool extended, bool live);
/** Next nibble of a live slot, line level; it goes out with the next call of this slot that begins afterwards
 * (LK-018). */
void asi_port_live(unsigned index, unsigned nibble);
/** Books of an active slot. */
asi_slot_state_t asi_port_slot_state(unsigned index);
/** Inputs of an index that has not been called for a cycle become 0 in the reports of later cycles. */
void asi_port_forget(unsigned index);
/** One call for the next management slot; only when the last one has been reported. */
void asi_port_management(const asi_request_t *request);
/** The call of all inclusion slots from now on; NULL: none. */
void asi_port_inclusion(const asi_request_t *request);
/** Output nibbles at line level, taken at the start of a cycle, all or nothing. Nibbles of live slots are not
 * touched. */
void asi_port_outputs(const uint32_t image[ASI_IMAGE_WORDS]);
/** Phase to show outside running cycles. OFFLINE only with the line off. */
void asi_port_phase(asi_phase_t phase);
/** Bus time in us, wraps. */
uint32_t asi_port_time_us(void);
#endif
