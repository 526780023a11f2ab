/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_jobs.h  Execution control functions that need the line: one at a time, a call per management slot, so that
 * data exchange goes on meanwhile (FN-005, FN-020, FN-022, FN-024, FN-027 .. FN-031, AD-001 ..).
 * Layer: protocol core. Memory: two asi_job_t inside asi_ec_t, that of the host and that of automatic addressing.
 * Context: as asi_ec.h.
 */
#ifndef ASI_JOBS_H
#define ASI_JOBS_H
#include <stdbool.h>
#include <stdint.h>
#include "asi_status.h"

/** Kinds; the number is that of the execution control function. */
typedef enum {
    ASI_JOB_NONE = 0,
    ASI_JOB_WRITE_PARAMETER = 5,      /**< index, value: parameter. data: answer of the slave */
    ASI_JOB_CHANGE_ADDRESS = 20,      /**< index: old, value: new index */
    ASI_JOB_EXECUTE = 22,             /**< index: number 0..31, value: I4..I0. data: answer */
    ASI_JOB_WRITE_ID1 = 24,           /**< value: new ID1 of the slave at address 0; 0..7 if A/B. data: as read */
    ASI_JOB_READ_PARAMETER_STRING = 27,
    ASI_JOB_WRITE_PARAMETER_STRING = 28,
    ASI_JOB_READ_DIAGNOSIS_STRING = 29,
    ASI_JOB_READ_ID_STRING = 30,      /**< strings: index; bytes in asi_ctt_t.string */
    ASI_JOB_MESSAGE = 31,             /**< CTT2: exchange one message; ours, not in the list of 30 */
    ASI_JOB_AUTO_ADDRESS = 32,        /**< internal: automatic addressing; index 0, value: missing index */
} asi_job_kind_t;

/** A job and how far it is. Private to asi_jobs.c but for kind, index, value, length, status, data. */
typedef struct {
    uint8_t kind, index, value;
    uint16_t length;           /**< strings: bytes to write; then bytes read */
    asi_status_t status;       /**< ASI_E_BUSY while open */
    uint8_t data;
    uint8_t step, target;      /* the index the slave is headed for: the new one, in the rescue the old one */
    uint8_t id1, id1_now;      /* ID1 the slave came with; what it has now, above F: not known */
    uint8_t wanted;            /* ID1 being written */
    uint8_t tries;
    bool waiting;              /* a call of this job is open */
    bool other;                /* this step was tried with the other select */
    bool at_zero;              /* the slave answered at address 0 */
    bool rescue, answered;
    bool no_id2;               /* of the slave, as in asi_ec_t */
    uint16_t codes;            /* of the slave */
    asi_status_t outcome;      /* what the job will end with */
    uint32_t since_us;         /* the wait for the slave's memory began */
    uint32_t pause_from_us, pause_us; /* no call before this is over */
} asi_job_t;
#endif
