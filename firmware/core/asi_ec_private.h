/* SPDX-License-Identifier: Apache-2.0 */
/** @file asi_ec_private.h  What the parts of execution control share. Nobody else includes it. */
#ifndef ASI_EC_PRIVATE_H
#define ASI_EC_PRIVATE_H
#include "asi_calls.h"
#include "asi_ec.h"
#include "asi_functions.h"

/* ---- asi_state.c: lists, flags, images */
static inline void touch(asi_ec_t *ec) { ec->state.version++; }
bool ec_is_extended(const asi_ec_t *ec, unsigned index);
/** EX-008, EX-009, EX-026 */
bool ec_may_activate(const asi_ec_t *ec, unsigned index);
/** The flags from lists, codes and controls, and the history with them (EX-016 .. EX-022, EX-036). On changes only. */
void ec_update_flags(asi_ec_t *ec);
void ec_set_echo(asi_ec_t *ec, unsigned index, uint8_t echo);
void ec_set_pi(asi_ec_t *ec, unsigned index, uint8_t parameter);
/** S-7.4: the parameter selects strings, so the master owns it (FN-005). */
bool ec_has_strings(const asi_ec_t *ec, unsigned index);
/** The parameter a slave is activated with: PI, or F where the master owns it. */
unsigned ec_parameter(const asi_ec_t *ec, unsigned index);
void ec_enter_las(asi_ec_t *ec, unsigned index);
void ec_leave_las(asi_ec_t *ec, unsigned index);
/** A complete answer: into LDS and CDI (EX-004, EX-013). */
void ec_enter_lds(asi_ec_t *ec, unsigned index, uint16_t codes);
/** Gone (EX-014, EX-015). */
void ec_leave_lds(asi_ec_t *ec, unsigned index);
/** Line level of the outputs (CA-005) to the port. */
void ec_send_outputs(asi_ec_t *ec);
/** Let the cycle run as LAS and the controls want it. */
void ec_run_cycle(const asi_ec_t *ec);
/** Whether a fault of the mode's kind exists (EX-033). -> index, or 64 */
unsigned ec_auto_clear_cause(const asi_ec_t *ec);
void ec_log(asi_ec_t *ec, asi_event_kind_t event, unsigned index, unsigned data);
static inline void put_code(uint16_t *codes, unsigned position, unsigned nibble)
{
    *codes = (uint16_t)((*codes & ~(15u << position)) | nibble << position);
}

/* ---- asi_ec.c */
/** Into OFFLINE, from any phase. */
void ec_stop(asi_ec_t *ec, asi_offline_cause_t cause);
/** Activate all of LAS anew (EX-024), as soon as the cycle has ended and pause_us are over. */
void ec_reactivate(asi_ec_t *ec, uint32_t pause_us);
/** One call for the next management slot. Only when ec->owner is ASI_OWNER_NONE, in normal operation. */
void ec_manage(asi_ec_t *ec, asi_owner_t owner, uint16_t call, unsigned index, unsigned retries, bool no_reply);

/* ---- asi_inclusion.c */
void ec_inclusion_begin(asi_ec_t *ec);
void ec_inclusion_result(asi_ec_t *ec, const asi_result_t *result);
/** True while a found slave is read or activated, not between two probes. */
bool ec_inclusion_busy(const asi_ec_t *ec);
/** Keep away from these indices; a probe or reading of one of them is given up. Empty: all are free again. */
void ec_inclusion_hold(asi_ec_t *ec, const asi_list_t *held);

/* ---- asi_jobs.c */
/** Result of a call with owner JOB. */
void ec_job_result(asi_ec_t *ec, const asi_result_t *result);
/** Once per cycle, after the results: time goes on for a job that waits; automatic addressing may begin (AD-008). */
void ec_job_cycle(asi_ec_t *ec);
/** OFFLINE or a new activation: an open job ends as ABORTED. */
void ec_job_abort(asi_ec_t *ec);
#endif
