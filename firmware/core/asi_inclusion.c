/* SPDX-License-Identifier: Apache-2.0 */
/** @file asi_inclusion.c  Execution control: the inclusion phase, one call per cycle (EX-012 .. EX-014). */
#include "asi_ec_private.h"

enum { PROBE, INCLUDE_ID, INCLUDE_ID1, INCLUDE_ID2, INCLUDE_WPAR, INCLUDE_DEXG }; /* ec->inclusion_step */

bool ec_inclusion_busy(const asi_ec_t *ec)
{
    return ec->inclusion_open && ec->inclusion_step != PROBE;
}

/** The request of this step, for all slots until the next one. A repetition is a further slot (EX-013). */
static void request_step(asi_ec_t *ec, unsigned step)
{
    static const uint8_t read[] = {ASI_CMD_RDIO, ASI_CMD_RDID, ASI_CMD_RID1, ASI_CMD_RID2};
    const unsigned i = ec->inclusion_index;
    asi_request_t request = {.tag = ++ec->inclusion_tag, .sel = i >= 32u};
    if (step != ec->inclusion_step)
        ec->inclusion_failures = 0;
    ec->inclusion_step = (uint8_t)step;
    if (step == INCLUDE_WPAR)
        request.call = asi_call_wpar(i, ec_parameter(ec, i), ec_is_extended(ec, i));
    else if (step == INCLUDE_DEXG)
        request.call = asi_call_dexg(i, 15u, ec_is_extended(ec, i));
    else
        request.call = asi_call_command((asi_command_t)read[step], i == 0u && ec->zero_sel ? 32u : i);
    asi_port_inclusion(&request);
    ec->inclusion_open = true;
}

/** EX-012: the next address not in LAS, 0 included with both selects, all of Sel = 0, then all of Sel = 1, wrapping. */
static void probe_next(asi_ec_t *ec)
{
    const asi_list_t all = {{0xFFFFFFFFu, 0xFFFFFFFEu}};
    asi_list_t candidates = asi_list_without(&all, &ec->state.las);
    candidates = asi_list_without(&candidates, &ec->held);
    unsigned i = asi_list_next(&candidates, ec->inclusion_index + 1u);
    if (i == ASI_INDICES)
        i = asi_list_next(&candidates, 0u);
    if (i == ASI_INDICES) { /* only held ones are left */
        ec->inclusion_open = false;
        asi_port_inclusion(0);
        return;
    }
    ec->inclusion_index = (uint8_t)i;
    ec->inclusion_failures = 0;
    ec->zero_other = i != 0u;
    if (i == 0u && !asi_list_has(&ec->state.lds, 0u))
        ec->zero_sel = false; /* AD-007 */
    request_step(ec, PROBE);
}

void ec_inclusion_begin(asi_ec_t *ec)
{
    ec->held = ASI_LIST_EMPTY;
    ec->inclusion_index = ASI_INDICES - 1u; /* the first probe goes to 0 */
    probe_next(ec);
}

void ec_inclusion_hold(asi_ec_t *ec, const asi_list_t *held)
{
    ec->held = *held;
    if (!ec->inclusion_open || asi_list_has(held, ec->inclusion_index))
        probe_next(ec);
}

/** No complete answer from the candidate in this round (EX-014). */
static void candidate_missed(asi_ec_t *ec)
{
    const unsigned i = ec->inclusion_index;
    if (asi_list_has(&ec->state.lds, i) && ++ec->miss[i] >= ASI_INCL_MISS) {
        ec_leave_lds(ec, i);
        ec_update_flags(ec);
    }
    probe_next(ec);
}

/** All codes are read (EX-013). */
static void candidate_read(asi_ec_t *ec)
{
    const unsigned i = ec->inclusion_index;
    const asi_list_t lds = ec->state.lds, las = ec->state.las;
    const uint16_t codes = ec->state.cdi[i];
    ec_enter_lds(ec, i, ec->inclusion_codes);
    if (ec->inclusion_no_id2)
        asi_list_add(&ec->no_id2, i);
    else
        asi_list_remove(&ec->no_id2, i);
    if (codes != ec->inclusion_codes || !asi_list_equal(&lds, &ec->state.lds) ||
        !asi_list_equal(&las, &ec->state.las)) {
        ec_run_cycle(ec); /* LAS may have become empty (EX-026) */
        ec_update_flags(ec);
    }
    if (ec_may_activate(ec, i)) {
        asi_port_forget(i); /* it may have been active before */
        request_step(ec, INCLUDE_WPAR);
    } else {
        probe_next(ec);
    }
}

void ec_inclusion_result(asi_ec_t *ec, const asi_result_t *result)
{
    const unsigned i = ec->inclusion_index, step = ec->inclusion_step;
    const bool good = result->error == ASI_ERR_OK;
    const bool last_try = step == PROBE || ec->inclusion_failures >= ASI_CMD_RETRY;

    if (!ec->inclusion_open || result->tag != ec->inclusion_tag)
        return; /* a repeat of an older probe */
    if (!good && !last_try) { /* EX-010, one call per slot */
        ec->inclusion_failures++;
        request_step(ec, step);
        return;
    }
    switch (step) {
    case PROBE:
        ec->inclusion_codes = (uint16_t)(0xFFF0u | result->data);
        if (good) {
            request_step(ec, INCLUDE_ID);
        } else if (!ec->zero_other) { /* AD-007: an A/B slave at address 0 may obey the other select */
            ec->zero_other = true;
            ec->zero_sel = !ec->zero_sel;
            request_step(ec, PROBE);
        } else {
            candidate_missed(ec);
        }
        break;
    case INCLUDE_ID:
    case INCLUDE_ID1:
    case INCLUDE_ID2:
        if (good) {
            put_code(&ec->inclusion_codes, 4u * step, result->data);
        } else if (step == INCLUDE_ID || asi_codes_id(ec->inclusion_codes) == ASI_ID_EXTENDED) {
            candidate_missed(ec);
            break;
        } /* else EX-005: the code stays F */
        ec->inclusion_no_id2 = !good;
        if (step == INCLUDE_ID2)
            candidate_read(ec);
        else
            request_step(ec, step + 1u);
        break;
    case INCLUDE_WPAR:
        if (good && ec_may_activate(ec, i)) { /* the projection may have changed meanwhile */
            ec_set_echo(ec, i, result->data);
            request_step(ec, INCLUDE_DEXG);
        } else {
            probe_next(ec);
        }
        break;
    default: /* INCLUDE_DEXG */
        if (good && ec_may_activate(ec, i)) {
            ec_enter_las(ec, i);
            ec_run_cycle(ec);
            ec_update_flags(ec);
        }
        probe_next(ec);
        break;
    }
}
