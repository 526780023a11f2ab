/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_diag.h  Statistics, line faults and the passive monitor in the host window (ST-006 .. ST-009). Main loop.
 */
#ifndef ASI_DIAG_H
#define ASI_DIAG_H
#include <stdbool.h>
#include "asi_ec.h"

/** Its words of the window start at 0. */
void asi_diag_init(void);
/** The host has committed: latched line faults are forgotten; monitor: record telegrams, starting with an empty ring
 * when that is new. */
void asi_diag_commit(bool monitor);
/** One index of the statistics each 1.024 ms, also to the core (EX-034); line faults, new telegrams. Bounded: at most
 * 64 telegrams a call. */
void asi_diag_serve(asi_ec_t *ec);
#endif
