/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_window.h  The native host window (rdl/asi.rdl, asi_host): commits in, published state out (HW-001 .. 005).
 * Everything the firmware publishes changes only while IN_SEQ is odd.
 */
#ifndef ASI_WINDOW_H
#define ASI_WINDOW_H
#include <stdbool.h>
#include "asi_ec.h"

#define ASI_MAGIC 0x4D495341u /* 'ASIM' */
#define ASI_VERSION 0x00010000u /* 0.1.0: major<<24 | minor<<16 | patch */

/** Default window: configuration mode, data exchange on, outputs 0, LPS empty. MAGIC is 0 until asi_window_open.
 * @return the projection that goes with it */
const asi_projection_t *asi_window_init(void);
/** Publish the first state and write MAGIC, last (HW-001). */
void asi_window_open(asi_ec_t *ec);
/** Output image of the host to the core. Interrupt, or masked. */
void asi_window_take_outputs(asi_ec_t *ec);
/** Publish all, then raise host_irq_o once. Interrupt, or masked. */
void asi_window_publish(asi_ec_t *ec);
/** Whether anything but images, counters and time has changed since the last publication. */
bool asi_window_is_stale(const asi_ec_t *ec);
/** Apply an open commit (HW-002); masks the interrupt only while the prepared change is switched on. Main loop.
 * @return true: the host wrote again meanwhile, call again */
bool asi_window_serve(asi_ec_t *ec);
#endif
