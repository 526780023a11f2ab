/* SPDX-License-Identifier: Apache-2.0 */
/** @file asi_state.c  Execution control: lists, flags, history and images. */
#include "asi_ec_private.h"

void ec_log(asi_ec_t *ec, asi_event_kind_t event, unsigned index, unsigned data)
{
    asi_log_put(&ec->log, asi_port_time_us(), event, index, data);
}

/* ------------------------------------------------------------------------------------------ questions */

bool ec_is_extended(const asi_ec_t *ec, unsigned index)
{
    return (index & 32u) != 0u || asi_codes_id(ec->state.cdi[index]) == ASI_ID_EXTENDED;
}

/** EX-026: a B slave whose number belongs to a standard slave */
static bool clashes(const asi_ec_t *ec, unsigned index)
{
    return index > 32u && asi_list_has(&ec->state.lds, index - 32u) && !ec_is_extended(ec, index - 32u);
}

/** detected as projected */
static bool matches(const asi_ec_t *ec, unsigned index)
{
    const asi_projection_t *p = &ec->permanent.projection;
    return asi_list_has(&p->lps, index) && ec->state.cdi[index] == p->pcd[index] && !clashes(ec, index);
}

bool ec_may_activate(const asi_ec_t *ec, unsigned index)
{
    if (index == 0u)
        return false;
    return ec->permanent.protected_mode ? matches(ec, index) : !clashes(ec, index);
}

bool ec_has_strings(const asi_ec_t *ec, unsigned index)
{
    const unsigned codes = ec->state.cdi[index];
    return (codes & 0xFFu) == 0x47u && asi_ctt_kind((uint16_t)codes) != ASI_CTT_NONE; /* S-7.4, not as 4I/4O */
}

unsigned ec_parameter(const asi_ec_t *ec, unsigned index)
{
    return ec_has_strings(ec, index) ? ASI_CTT1_PAR_DATA : ec->state.pi[index];
}

unsigned ec_auto_clear_cause(const asi_ec_t *ec)
{
    unsigned index = ASI_INDICES;
    if (ec->permanent.auto_clear == ASI_AUTO_CLEAR_OFF)
        return index;
    const asi_list_t missing = asi_list_without(&ec->permanent.projection.lps, &ec->state.lds);
    if (ec->permanent.auto_clear & ASI_AUTO_CLEAR_MISSING)
        index = asi_list_next(&missing, 0u);
    if (index == ASI_INDICES && (ec->permanent.auto_clear & ASI_AUTO_CLEAR_FAULT))
        index = asi_list_next(&ec->state.lpf, 0u);
    return index;
}

/* ------------------------------------------------------------------------------------------ flags, history */

/** Slaves that are not as projected: wrong, extra, missing, address 0, members of incomplete groups. */
static asi_list_t wrong_slaves(const asi_ec_t *ec)
{
    const asi_ec_state_t *s = &ec->state;
    asi_list_t wrong = asi_list_without(&ec->permanent.projection.lps, &s->lds);
    const asi_list_t incomplete = asi_ctt_incomplete(&ec->ctt, &s->las, s->cdi);
    for (unsigned i = asi_list_next(&s->lds, 0u); i < ASI_INDICES; i = asi_list_next(&s->lds, i + 1u)) {
        if (i == 0u || !matches(ec, i))
            asi_list_add(&wrong, i);
    }
    wrong.w[0] |= incomplete.w[0];
    wrong.w[1] |= incomplete.w[1];
    return wrong;
}

/** EX-036: only in normal operation; elsewhere every slave is missing. */
static void keep_history(asi_ec_t *ec, const asi_list_t *wrong)
{
    const asi_list_t news = asi_list_without(wrong, &ec->wrong);
    const bool was_good = asi_list_is_empty(&ec->wrong), is_good = asi_list_is_empty(wrong);
    if (ec->state.phase != ASI_PHASE_DATA_EXCHANGE)
        return;
    ec->wrong = *wrong;
    if (!asi_list_is_empty(&news)) {
        ec->state.changed_slaves = news;
        ec->state.changed_us = asi_port_time_us();
    }
    if (was_good != is_good)
        ec_log(ec, ASI_EVENT_CONFIG_OK, is_good ? 0u : asi_list_next(&news, 0u), is_good);
}

void ec_update_flags(asi_ec_t *ec)
{
    const asi_ec_state_t *s = &ec->state;
    const asi_list_t wrong = wrong_slaves(ec);
    const asi_list_t missing = asi_list_without(&ec->permanent.projection.lps, &s->lds);
    asi_list_t alien = asi_list_without(&wrong, &missing); /* wrong and extra slaves, but for slave 0 */
    const unsigned first = asi_list_next(&missing, 0u);
    const bool one_missing = first < ASI_INDICES && asi_list_next(&missing, first + 1u) == ASI_INDICES;
    uint32_t flags = s->flags & (ASI_FLAG_NORMAL_OPERATION_ACTIVE | ASI_FLAG_OFFLINE_READY);

    asi_list_remove(&alien, 0u);
    if (asi_list_is_empty(&wrong))
        flags |= ASI_FLAG_CONFIG_OK;
    if (asi_list_has(&s->lds, 0u))
        flags |= ASI_FLAG_LDS0;
    if (ec->permanent.auto_address && ec->permanent.protected_mode && asi_list_is_empty(&alien)) {
        flags |= ASI_FLAG_AUTO_ADDRESS_ASSIGN;
        if (one_missing)
            flags |= ASI_FLAG_AUTO_ADDRESS_AVAILABLE;
    }
    if (!ec->permanent.protected_mode)
        flags |= ASI_FLAG_CONFIGURATION_ACTIVE;
    if (ec->apf)
        flags |= ASI_FLAG_APF;
    if (asi_list_is_empty(&s->lpf))
        flags |= ASI_FLAG_PERIPHERY_OK;
    ec->state.flags = flags;
    keep_history(ec, &wrong);
    touch(ec);
}

/* ------------------------------------------------------------------------------------------ codes, parameters */

static void set_codes(asi_ec_t *ec, unsigned index, uint16_t codes)
{
    if (ec->state.cdi[index] != codes) {
        ec->state.cdi[index] = codes;
        asi_list_add(&ec->state.changed, index);
    }
}

void ec_set_echo(asi_ec_t *ec, unsigned index, uint8_t echo)
{
    if (ec->state.pecho[index] != echo) {
        ec->state.pecho[index] = echo;
        asi_list_add(&ec->state.changed, index);
        touch(ec);
    }
}

void ec_set_pi(asi_ec_t *ec, unsigned index, uint8_t parameter)
{
    if (ec->state.pi[index] != parameter) {
        ec->state.pi[index] = parameter;
        asi_list_add(&ec->state.changed, index);
        touch(ec);
    }
}

/* ------------------------------------------------------------------------------------------ images */

void ec_send_outputs(asi_ec_t *ec)
{
    bool changed = false;
    for (unsigned w = 0; w < ASI_IMAGE_WORDS; w++) { /* idle F, payload inverted; I3 of A/B calls is not ours */
        const uint32_t line = (ec->out_host[w] ^ ec->invert[w]) | ~ec->las_mask[w];
        changed |= line != ec->out_line[w];
        ec->out_line[w] = line;
    }
    if (changed)
        asi_port_outputs(ec->out_line);
}

void ec_run_cycle(const asi_ec_t *ec)
{
    if (ec->reactivate)
        return; /* it is being stopped (EX-024) */
    uint16_t min_cycle_us = ASI_MIN_CYCLE_US;
    if (asi_list_is_empty(&ec->state.las))
        min_cycle_us = ASI_EMPTY_CYCLE_US;
    else if (!asi_list_is_empty(&ec->ctt.live) && min_cycle_us < ASI_CTT_MIN_CYCLE_US)
        min_cycle_us = ASI_CTT_MIN_CYCLE_US;
    const asi_cycle_mode_t mode = {.two_extra = ASI_EXTRA_CALLS == 2, .read_id = !ec->permanent.data_exchange,
                                   .min_cycle_us = min_cycle_us};
    asi_port_cycle(&mode);
}

/* ------------------------------------------------------------------------------------------ LAS, LDS */

void ec_enter_las(asi_ec_t *ec, unsigned index)
{
    const bool extended = ec_is_extended(ec, index);
    const unsigned w = asi_word(index), shift = asi_shift(index);
    const bool live = asi_ctt_open(&ec->ctt, index, ec->state.cdi[index], asi_port_time_us());
    asi_list_add(&ec->state.las, index);
    ec->las_mask[w] |= 15u << shift;
    ec->invert[w] |= (ASI_INVERT_OUT ? (extended ? 7u : 15u) : 0u) << shift;
    ec->calls[index] = 0;
    if (live) {
        ec->live_mask[w] |= 15u << shift;
        asi_port_live(index, asi_ctt_first(&ec->ctt, index, ec->out_host[w] >> shift & 15u));
    }
    asi_port_slot(index, true, extended, live);
    if (ec->state.phase == ASI_PHASE_DATA_EXCHANGE)
        ec_log(ec, ASI_EVENT_ACTIVATED, index, 0u);
}

void ec_leave_las(asi_ec_t *ec, unsigned index)
{
    const uint32_t others = ~(15u << asi_shift(index));
    if (!asi_list_has(&ec->state.las, index))
        return;
    asi_port_slot(index, false, false, false);
    asi_ctt_close(&ec->ctt, index);
    asi_list_remove(&ec->ctt_failed, index);
    asi_list_remove(&ec->state.las, index);
    asi_list_remove(&ec->state.lpf, index); /* EX-027 */
    ec->las_mask[asi_word(index)] &= others;
    ec->invert[asi_word(index)] &= others;
    ec->live_mask[asi_word(index)] &= others;
    ec->live_in[asi_word(index)] &= others;
    ec->state.in[asi_word(index)] &= others; /* CA-006, LK-005 */
    if (ec->state.phase == ASI_PHASE_DATA_EXCHANGE)
        ec_log(ec, ASI_EVENT_DEACTIVATED, index, 0u);
}

void ec_enter_lds(asi_ec_t *ec, unsigned index, uint16_t codes)
{
    const bool known = asi_list_has(&ec->state.lds, index) && ec->state.cdi[index] == codes;
    asi_list_add(&ec->state.lds, index);
    set_codes(ec, index, codes);
    ec->miss[index] = 0;
    if (!known && ec->state.phase == ASI_PHASE_DATA_EXCHANGE)
        ec_log(ec, ASI_EVENT_DETECTED, index, codes);
    /* EX-026: the B slave of this number would hear the standard slave's calls with D3 = 0 */
    if (index != 0u && index < 32u && !ec_is_extended(ec, index))
        ec_leave_las(ec, index + 32u);
}

void ec_leave_lds(asi_ec_t *ec, unsigned index)
{
    ec_leave_las(ec, index);
    if (asi_list_has(&ec->state.lds, index) && ec->state.phase == ASI_PHASE_DATA_EXCHANGE)
        ec_log(ec, ASI_EVENT_GONE, index, 0u);
    asi_list_remove(&ec->state.lds, index);
    set_codes(ec, index, ASI_CODES_NONE);
    ec->miss[index] = 0;
}
