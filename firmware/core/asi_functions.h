/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_functions.h  The execution control functions of the complete specification's list, by their numbers
 * (FN-001 ..). What needs no telegram is done at once; the rest is a job (asi_jobs.h). Context: as asi_ec.h.
 * Indices as everywhere: number + 32 * Sel. A refused function changes nothing.
 */
#ifndef ASI_FUNCTIONS_H
#define ASI_FUNCTIONS_H
#include "asi_ec.h"

/** 2 Write_ODI: output image, host level, for the cycles from now on. */
void asi_fn_write_odi(asi_ec_t *ec, const uint32_t image[ASI_IMAGE_WORDS]);
/** 3 Set_Permanent_Parameter. @return ASI_E_ARG */
ASI_MUST_USE asi_status_t asi_fn_set_permanent_parameter(asi_ec_t *ec, unsigned index, unsigned parameter);
/** 4 Get_Permanent_Parameter, 9 Get_Permanent_Configuration, 13 Get_LPS. */
static inline const asi_projection_t *asi_fn_projection(const asi_ec_t *ec) { return &ec->permanent.projection; }
/** 7 Store_Actual_Parameters: PI becomes PP. */
void asi_fn_store_actual_parameters(asi_ec_t *ec);
/** 8 Set_Permanent_Configuration. @return ASI_E_ARG, ASI_E_PROTECTED */
ASI_MUST_USE asi_status_t asi_fn_set_permanent_configuration(asi_ec_t *ec, unsigned index, unsigned codes);
/** 10 Store_Actual_Configuration. @return ASI_E_PROTECTED */
ASI_MUST_USE asi_status_t asi_fn_store_actual_configuration(asi_ec_t *ec);
/** 12 Set_LPS. @return ASI_E_ARG, ASI_E_PROTECTED */
ASI_MUST_USE asi_status_t asi_fn_set_lps(asi_ec_t *ec, const asi_list_t *lps);
/** 3, 8, 12 at once for a host that keeps its own project, in both modes. In protected mode slaves that it does not
 * allow leave LAS at once (EX-009). @return ASI_E_ARG: LPS holds 0 or 32, or a parameter is above F */
ASI_MUST_USE asi_status_t asi_fn_set_projection(asi_ec_t *ec, const asi_projection_t *projection);
/** Whether that projection would be taken; reads nothing but its argument, so it may run with the interrupt open. */
ASI_MUST_USE asi_status_t asi_check_projection(const asi_projection_t *projection);
/** 1, 6, 11, 14, 15, 16, 23 Read_IDI, Read_Parameter, Read_Actual_Configuration, Get_LAS, Get_LDS, Get_Flags, Get_LPF:
 * asi_ec_state. */

/** 17, 18, 19, 21 Set_Operation_Mode, Set_Offline_Mode, Set_Data_Exchange_Active, Set_Auto_Address_Enable, and auto
 * clear: all or nothing. A change of mode passes through OFFLINE (EX-023); offline = false ends the auto-clear end
 * state. @return ASI_E_SLAVE0, ASI_E_AUTO_CLEAR, ASI_E_AUTO_CLEAR_MODE, ASI_E_ARG */
ASI_MUST_USE asi_status_t asi_fn_set_controls(asi_ec_t *ec, const asi_controls_t *controls);
/** The controls in use. */
asi_controls_t asi_fn_controls(const asi_ec_t *ec);

/** 5, 20, 22, 24, 27 .. 31: begin a function with telegrams; arguments as asi_job_kind_t says, length: bytes to
 * write, which the caller has put into ec->ctt.string.bytes. @return the refusals of FN-005 ..; ASI_E_BUSY: one is
 * open. Then asi_fn_job tells how it goes. */
ASI_MUST_USE asi_status_t asi_fn_start(asi_ec_t *ec, asi_job_kind_t kind, unsigned index, unsigned value,
                                       unsigned length);
/** Whether a function with telegrams would be refused as ASI_E_BUSY: one is open, or automatic addressing. */
static inline bool asi_fn_busy(const asi_ec_t *ec)
{
    return ec->job.status == ASI_E_BUSY || ec->automatic.status == ASI_E_BUSY;
}
/** The job begun last by asi_fn_start; its status is ASI_E_BUSY while it runs. */
static inline const asi_job_t *asi_fn_job(const asi_ec_t *ec) { return &ec->job; }
#endif
