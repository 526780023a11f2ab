/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_config.h  Constants of execution control: names as in docs/requirements.md, units in name or comment.
 * Each may be overridden with -D (ASI_PWR_SETTLE_US for test images). Line timing lives in rtl/phy/asi_timing_pkg.sv.
 */
#ifndef ASI_CONFIG_H
#define ASI_CONFIG_H

#define ASI_INDICES 64u     /**< slave indices: number + 32 * Sel; 32 is never used */
#define ASI_IMAGE_WORDS 8u  /**< eight nibbles a word */

/** P_PWR_SETTLE, us: good line voltage after power-up before the first detection pass (EX-003). */
#ifndef ASI_PWR_SETTLE_US
#define ASI_PWR_SETTLE_US 1000000u
#endif
/** P_CMD_RETRY, repetitions: failed detection, activation, management and inclusion follow-up calls (EX-010). */
#ifndef ASI_CMD_RETRY
#define ASI_CMD_RETRY 2u
#endif
/** P_INCL_MISS, rounds: a detected, not active slave that misses these leaves LDS (EX-014). */
#ifndef ASI_INCL_MISS
#define ASI_INCL_MISS 3u
#endif
/** P_INVERT_OUT, 0 or 1: payload output bits are inverted between host and line (CA-005). */
#ifndef ASI_INVERT_OUT
#define ASI_INVERT_OUT 1
#endif
/** P_EXTRA_CALLS, 1 or 2: extra slots in each cycle (LK-008, LK-009). */
#ifndef ASI_EXTRA_CALLS
#define ASI_EXTRA_CALLS 1
#endif
/** P_MIN_CYCLE_US, us, 0 = no limit: shortest cycle with active slaves (LK-014). */
#ifndef ASI_MIN_CYCLE_US
#define ASI_MIN_CYCLE_US 0u
#endif
/** us: shortest cycle while no slave is active; the cycle is a lone probe then and need not spin (LK-014). */
#ifndef ASI_EMPTY_CYCLE_US
#define ASI_EMPTY_CYCLE_US 1000u
#endif

/** P_FAIL_CYCLES, cycles: the sequencer's limit of failures in a row, SLOT_STATE.streak of a lost slave (LK-004). */
#define ASI_FAIL_CYCLES 3u

/** P_RDST_EVERY, cycles: a status poll in every so many cycles without other management (EX-027). With one extra
 * slot more polls would slow inclusion down: EX-030. */
#ifndef ASI_RDST_EVERY
#define ASI_RDST_EVERY 3u
#endif
/** P_S1_MIN_V21, 0 or 1: S1 of a slave without ID2 is ignored, before specification 2.1 it was a parity error
 * (EX-028). */
#ifndef ASI_S1_MIN_V21
#define ASI_S1_MIN_V21 1
#endif
/** P_NVM, us: longest memory write of a slave after ADRA or WID1 (AD-005). */
#ifndef ASI_NVM_US
#define ASI_NVM_US 500000u
#endif
/** P_NVM_POLL, us: between two status reads while a slave writes (AD-005). */
#ifndef ASI_NVM_POLL_US
#define ASI_NVM_POLL_US 5000u
#endif
/** P_RESET, us: a slave is ready again after Reset_Slave (FN-022). */
#ifndef ASI_RESET_US
#define ASI_RESET_US 2000u
#endif
/** P_RESCUE, tries: giving a slave its old address back after a failed change (AD-004). */
#ifndef ASI_RESCUE_TRIES
#define ASI_RESCUE_TRIES 5u
#endif
/** P_AUTO_WAIT, us: a failed automatic addressing is tried again after this (AD-009). */
#ifndef ASI_AUTO_WAIT_US
#define ASI_AUTO_WAIT_US 1000000u
#endif
/** P_CTT_MIN_CYCLE_US, us: shortest cycle while a combined transaction is active, so that every call of it is seen. */
#ifndef ASI_CTT_MIN_CYCLE_US
#define ASI_CTT_MIN_CYCLE_US 1000u
#endif
/** P_SUSPECT, points: at this many a duplicate address is suspected, at 0 no more (EX-034). In each look at a slave's
 * statistics garbled answers count when they are four times the missing ones and a quarter of the good ones; else a
 * missing answer takes two off, a look with good ones only takes one. */
#ifndef ASI_SUSPECT
#define ASI_SUSPECT 12u
#endif

_Static_assert(ASI_CMD_RETRY <= 3u, "the request word has two bits for repetitions");
_Static_assert(ASI_EXTRA_CALLS == 1 || ASI_EXTRA_CALLS == 2, "one or two extra slots");
_Static_assert(ASI_INCL_MISS >= 1u && ASI_INCL_MISS <= 255u, "kept in a byte");
_Static_assert(ASI_MIN_CYCLE_US <= 8191u && ASI_EMPTY_CYCLE_US <= 8191u, "CTRL.min_cycle_us has 13 bits");
#endif
