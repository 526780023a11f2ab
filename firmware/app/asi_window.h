/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_window.h  The native host window (asi_host of rdl/asi.rdl): images, lists, codes, the host's commits and
 * functions. Words of the firmware are written here and nowhere else, but for those of asi_diag.c.
 */
#ifndef ASI_WINDOW_H
#define ASI_WINDOW_H
#include "asi_ec.h"

#define ASI_MAGIC 0x4D495341u   /* 'ASIM' */
#define ASI_VERSION 0x00020000u /* major, minor, patch: 8, 8, 16 bits */

/** Fill the window from the permanent data; MAGIC stays 0. */
void asi_window_init(const asi_permanent_t *permanent);
/** The window is valid: first publication, then MAGIC (HW-001). */
void asi_window_open(asi_ec_t *ec);
/** The host's outputs, digital and analog, for the next cycle. In the interrupt. */
void asi_window_take_outputs(asi_ec_t *ec);
/** State, images, lists and counters after a cycle (HW-003 .. HW-005). In the interrupt. */
void asi_window_publish(asi_ec_t *ec);
/** How long an interrupt took, us; the longest shows (HW-011). */
void asi_window_show_load(uint32_t us);
/** True when something besides the images changed since the last publication. */
bool asi_window_is_stale(const asi_ec_t *ec);
/** Apply the host's commit, start or finish its function (HW-002, HW-008). Main loop. @return true: call again at
 * once */
bool asi_window_serve(asi_ec_t *ec);
#endif
