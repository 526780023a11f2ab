/* SPDX-License-Identifier: Apache-2.0 */
/** @file asi_functions.c  Execution control functions that need no telegram. */
#include "asi_ec_private.h"

static bool is_slave(unsigned index)
{
    const asi_list_t slaves = ASI_LIST_SLAVES;
    return index < ASI_INDICES && asi_list_has(&slaves, index);
}

/** The permanent data changed: slaves that protected mode does not allow any more leave LAS at once (EX-009). */
static void permanent_changed(asi_ec_t *ec)
{
    ec->state.permanent_version++;
    if (ec->permanent.protected_mode) {
        const asi_list_t las = ec->state.las;
        for (unsigned i = asi_list_next(&las, 0u); i < ASI_INDICES; i = asi_list_next(&las, i + 1u)) {
            if (!ec_may_activate(ec, i))
                ec_leave_las(ec, i);
        }
        if (ec->state.phase == ASI_PHASE_DATA_EXCHANGE)
            ec_run_cycle(ec);
    }
    ec_update_flags(ec);
}

void asi_fn_write_odi(asi_ec_t *ec, const uint32_t image[ASI_IMAGE_WORDS])
{
    for (unsigned w = 0; w < ASI_IMAGE_WORDS; w++)
        ec->out_host[w] = image[w];
}

asi_status_t asi_fn_set_permanent_parameter(asi_ec_t *ec, unsigned index, unsigned parameter)
{
    if (!is_slave(index) || parameter > 15u)
        return ASI_E_ARG;
    ec->permanent.projection.pp[index] = (uint8_t)parameter;
    permanent_changed(ec);
    return ASI_OK;
}

void asi_fn_store_actual_parameters(asi_ec_t *ec)
{
    for (unsigned i = 0; i < ASI_INDICES; i++)
        ec->permanent.projection.pp[i] = ec->state.pi[i];
    permanent_changed(ec);
}

asi_status_t asi_fn_set_permanent_configuration(asi_ec_t *ec, unsigned index, unsigned codes)
{
    if (!is_slave(index) || codes > 0xFFFFu)
        return ASI_E_ARG;
    if (ec->permanent.protected_mode)
        return ASI_E_PROTECTED;
    ec->permanent.projection.pcd[index] = (uint16_t)codes;
    permanent_changed(ec);
    return ASI_OK;
}

asi_status_t asi_fn_store_actual_configuration(asi_ec_t *ec)
{
    asi_projection_t *p = &ec->permanent.projection;
    if (ec->permanent.protected_mode)
        return ASI_E_PROTECTED;
    p->lps = ec->state.las; /* never 0 */
    for (unsigned i = 0; i < ASI_INDICES; i++) {
        p->pcd[i] = i == 0u ? ASI_CODES_NONE : ec->state.cdi[i];
        if (!asi_list_has(&p->lps, i))
            p->pp[i] = 15u;
    }
    permanent_changed(ec);
    return ASI_OK;
}

asi_status_t asi_fn_set_lps(asi_ec_t *ec, const asi_list_t *lps)
{
    const asi_list_t slaves = ASI_LIST_SLAVES;
    const asi_list_t alien = asi_list_without(lps, &slaves);
    if (!asi_list_is_empty(&alien))
        return ASI_E_ARG;
    if (ec->permanent.protected_mode)
        return ASI_E_PROTECTED;
    ec->permanent.projection.lps = *lps;
    permanent_changed(ec);
    return ASI_OK;
}

asi_status_t asi_check_projection(const asi_projection_t *projection)
{
    const asi_list_t slaves = ASI_LIST_SLAVES;
    const asi_list_t alien = asi_list_without(&projection->lps, &slaves);
    unsigned parameters = 0;
    for (unsigned i = 0; i < ASI_INDICES; i++)
        parameters |= projection->pp[i];
    return asi_list_is_empty(&alien) && parameters <= 15u ? ASI_OK : ASI_E_ARG;
}

asi_status_t asi_fn_set_projection(asi_ec_t *ec, const asi_projection_t *projection)
{
    const asi_status_t status = asi_check_projection(projection);
    if (status != ASI_OK)
        return status;
    ec->permanent.projection = *projection;
    permanent_changed(ec);
    return ASI_OK;
}

asi_controls_t asi_fn_controls(const asi_ec_t *ec)
{
    return (asi_controls_t){.protected_mode = ec->permanent.protected_mode, .offline = ec->offline,
                            .data_exchange = ec->permanent.data_exchange, .auto_address = ec->permanent.auto_address,
                            .auto_clear = ec->permanent.auto_clear};
}

/** EX-033: what goes together, whatever the line does. */
static asi_status_t check_modes(bool protected_mode, bool auto_address, unsigned auto_clear)
{
    if (auto_clear > ASI_AUTO_CLEAR_BOTH)
        return ASI_E_ARG;
    return auto_clear && (auto_address || !protected_mode) ? ASI_E_AUTO_CLEAR_MODE : ASI_OK;
}

/** No data, no values: substitutes instead of the last ones, and an open string or message ends (CT-005). When data
 * exchange comes back all of LAS is activated anew, and the engines with it. */
static void stop_transactions(asi_ec_t *ec)
{
    for (unsigned i = asi_list_next(&ec->state.las, 0u); i < ASI_INDICES; i = asi_list_next(&ec->state.las, i + 1u))
        asi_ctt_close(&ec->ctt, i);
}

asi_status_t asi_fn_set_controls(asi_ec_t *ec, const asi_controls_t *c)
{
    asi_permanent_t *p = &ec->permanent;
    const asi_status_t status = check_modes(c->protected_mode, c->auto_address, c->auto_clear);
    if (status != ASI_OK)
        return status;
    if (c->protected_mode && !p->protected_mode && asi_list_has(&ec->state.lds, 0u))
        return ASI_E_SLAVE0; /* EX-032 */
    if (ec->auto_cleared && c->offline && c->data_exchange != p->data_exchange)
        return ASI_E_AUTO_CLEAR;

    const bool new_mode = c->protected_mode != p->protected_mode;
    const bool starts = c->data_exchange && !p->data_exchange, stops = !c->data_exchange && p->data_exchange;
    const bool changed = new_mode || starts || stops || c->auto_address != p->auto_address ||
                         c->auto_clear != p->auto_clear;
    p->protected_mode = c->protected_mode;
    p->auto_address = c->auto_address;
    p->auto_clear = c->auto_clear;
    p->data_exchange = c->data_exchange;
    ec->auto_cleared = ec->auto_cleared && c->offline;
    if (new_mode) /* EX-023 */
        ec_stop(ec, ASI_OFFLINE_MODE);
    if (c->offline && !ec->offline)
        ec_stop(ec, ASI_OFFLINE_HOST);
    ec->offline = c->offline;
    if (ec->state.phase == ASI_PHASE_DATA_EXCHANGE) { /* EX-024 */
        if (starts) {
            ec_reactivate(ec, 0u);
        } else if (stops) {
            stop_transactions(ec);
            ec_run_cycle(ec);
        }
    }
    if (changed) {
        ec->state.permanent_version++;
        ec_update_flags(ec);
    }
    return ASI_OK;
}

/** @return ASI_OK when this permanent data makes sense */
static asi_status_t check_permanent(const asi_permanent_t *p)
{
    const asi_status_t status = asi_check_projection(&p->projection);
    return status != ASI_OK ? status : check_modes(p->protected_mode, p->auto_address, p->auto_clear);
}

asi_status_t asi_ec_init(asi_ec_t *ec, const asi_permanent_t *permanent)
{
    const asi_status_t status = check_permanent(permanent);
    *ec = (asi_ec_t){.power_up = true, .settle_left_us = ASI_PWR_SETTLE_US};
    if (status == ASI_OK) {
        ec->permanent = *permanent;
    } else {
        ec->permanent.data_exchange = true;
        for (unsigned i = 0; i < ASI_INDICES; i++) {
            ec->permanent.projection.pcd[i] = ASI_CODES_NONE;
            ec->permanent.projection.pp[i] = 15u;
        }
    }
    ec->state.offline_causes = 1u << ASI_OFFLINE_START | (uint32_t)ASI_OFFLINE_START << 16; /* EX-037 */
    asi_ctt_init(&ec->ctt);
    for (unsigned i = 0; i < ASI_INDICES; i++) {
        ec->state.cdi[i] = ASI_CODES_NONE;
        ec->state.pi[i] = ec->permanent.projection.pp[i];
        ec->state.pecho[i] = 15u;
    }
    ec->state.changed = (asi_list_t){{0xFFFFFFFFu, 0xFFFFFFFFu}};
    asi_port_phase(ASI_PHASE_OFFLINE);
    ec_send_outputs(ec); /* line value F */
    ec_update_flags(ec);
    return status;
}
