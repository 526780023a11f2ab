/* SPDX-License-Identifier: Apache-2.0 */
/** @file asi_jobs.c  Execution control functions that need the line. */
#include "asi_ec_private.h"

void ec_job_result(asi_ec_t *ec, const asi_result_t *result) { (void)ec; (void)result; }
void ec_job_cycle(asi_ec_t *ec) { (void)ec; }
void ec_job_abort(asi_ec_t *ec) { (void)ec; }
asi_status_t asi_fn_start(asi_ec_t *ec, asi_job_kind_t kind, unsigned index, unsigned value, unsigned length)
{
    (void)ec; (void)kind; (void)index; (void)value; (void)length;
    return ASI_E_STATE;
}
