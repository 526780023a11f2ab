/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_status.h  The one enumeration of errors of the firmware (EX-025).
 * 0 is success; errors are negative and a number is never reused. A function that returns one has changed nothing.
 */
#ifndef ASI_STATUS_H
#define ASI_STATUS_H
typedef enum {
    ASI_OK = 0,
    ASI_E_ARG = -1,     /**< an argument is out of range (index, list with 0 or 32 set, nibble above F, unknown bit) */
    ASI_E_STATE = -2,   /**< not possible in this phase */
    ASI_E_BUSY = -3,    /**< one is already open; ask again later */
    ASI_E_ABORTED = -4, /**< the open call was dropped because the line went offline */
} asi_status_t;
#if defined(__GNUC__)
#define ASI_MUST_USE __attribute__((warn_unused_result))
#else
#define ASI_MUST_USE
#endif
#endif
