/* SPDX-License-Identifier: Apache-2.0 */
/** @file asi_ec.c  Execution control: the phases as a table, batches in front of the cycle, reports from below. */
#include "asi_ec_private.h"

/* ------------------------------------------------------------------------------------------ batches */

#define ZERO_SEL1 32u /**< detection: address 0 with Sel = 1 (AD-007) */

static void add_request(asi_ec_t *ec, unsigned index, uint16_t call)
{
    ec->requests[ec->batch_len] =
        (asi_request_t){.call = call, .retries = ASI_CMD_RETRY, .sel = index > ZERO_SEL1}; /* EX-010 */
    ec->request_index[ec->batch_len] = (uint8_t)index;
    ec->batch_len++;
}

static void send_batch(asi_ec_t *ec)
{
    ec->batch_open = true;
    asi_port_batch(ec->requests, ec->batch_len);
}

/* ------------------------------------------------------------------------------------------ the phases as a table */

typedef enum { EV_NONE, EV_START, EV_STOP, EV_NOBODY, EV_FOUND, EV_TRIED, EV_AGAIN } event_t;

static event_t begin_detection(asi_ec_t *ec);
static event_t begin_activation(asi_ec_t *ec);
static event_t begin_operation(asi_ec_t *ec);
static event_t begin_again(asi_ec_t *ec);
static event_t go_offline(asi_ec_t *ec);

static const struct {
    asi_phase_t phase;
    event_t event;
    asi_phase_t next;
    event_t (*action)(asi_ec_t *ec); /* may raise the next event */
} transitions[] = {
    {ASI_PHASE_OFFLINE, EV_START, ASI_PHASE_DETECTION, begin_detection},          /* EX-003 */
    {ASI_PHASE_DETECTION, EV_NOBODY, ASI_PHASE_DETECTION, begin_detection},       /* EX-007 */
    {ASI_PHASE_DETECTION, EV_FOUND, ASI_PHASE_ACTIVATION, begin_activation},      /* EX-004, EX-007 */
    {ASI_PHASE_ACTIVATION, EV_TRIED, ASI_PHASE_DATA_EXCHANGE, begin_operation},   /* EX-008, EX-011 */
    {ASI_PHASE_DATA_EXCHANGE, EV_AGAIN, ASI_PHASE_ACTIVATION, begin_again},       /* EX-024 */
    {ASI_PHASE_DETECTION, EV_STOP, ASI_PHASE_OFFLINE, go_offline},                /* EX-001, EX-021, EX-023 */
    {ASI_PHASE_ACTIVATION, EV_STOP, ASI_PHASE_OFFLINE, go_offline},               /* the same */
    {ASI_PHASE_DATA_EXCHANGE, EV_STOP, ASI_PHASE_OFFLINE, go_offline},            /* the same */
};

static void dispatch(asi_ec_t *ec, event_t event)
{
    while (event != EV_NONE) {
        event_t raised = EV_NONE;
        for (unsigned row = 0; row < sizeof transitions / sizeof transitions[0]; row++) {
            if (transitions[row].phase == ec->state.phase && transitions[row].event == event) {
                if (transitions[row].next != ec->state.phase) {
                    if (transitions[row].next == ASI_PHASE_OFFLINE)
                        asi_port_line(false); /* EX-001: before the phase is shown */
                    ec->state.phase = transitions[row].next;
                    asi_port_phase(ec->state.phase);
                    ec_log(ec, ASI_EVENT_PHASE, 0u, ec->state.phase);
                    touch(ec);
                }
                raised = transitions[row].action(ec);
                break;
            }
        }
        event = raised;
    }
}

/** The cycle does not run any more: what was open in it is gone. */
static void end_cycle(asi_ec_t *ec)
{
    asi_port_cycle(0);
    asi_port_inclusion(0);
    ec->inclusion_open = false;
    ec->owner = ASI_OWNER_NONE; /* the sequencer has taken it or never will: asi_port_line(false) ends it */
    ec->reactivate = false;
    ec->state.flags &= ~(uint32_t)ASI_FLAG_NORMAL_OPERATION_ACTIVE;
    ec_job_abort(ec);
}

/** EX-001 */
static event_t go_offline(asi_ec_t *ec)
{
    end_cycle(ec);
    for (unsigned i = asi_list_next(&ec->state.lds, 0u); i < ASI_INDICES; i = asi_list_next(&ec->state.lds, i + 1u))
        ec_leave_lds(ec, i);
    ec->batch_open = false;
    ec->no_id2 = ASI_LIST_EMPTY;
    ec_send_outputs(ec);
    ec_update_flags(ec);
    return EV_NONE;
}

void ec_stop(asi_ec_t *ec, asi_offline_cause_t cause)
{
    ec->state.offline_causes = (ec->state.offline_causes & 0xFFFFu) | 1u << cause | (uint32_t)cause << 16;
    ec->state.offline_us = asi_port_time_us();
    ec_log(ec, ASI_EVENT_OFFLINE, 0u, cause);
    touch(ec);
    dispatch(ec, EV_STOP);
}

void ec_reactivate(asi_ec_t *ec, uint32_t pause_us)
{
    if (!ec->reactivate || pause_us != 0u) { /* a pause that runs is not cut short (FN-022) */
        ec->reactivate_from_us = asi_port_time_us();
        ec->reactivate_pause_us = pause_us;
    }
    ec->reactivate = true;
    asi_port_cycle(0);
}

/* ------------------------------------------------------------------------------------------ DETECTION */

enum { READ_IO, READ_ID, READ_ID12 }; /* ec->step */

/** Batch of this step for all of ec->todo. */
static void detection_batch(asi_ec_t *ec)
{
    ec->batch_len = 0;
    for (unsigned i = asi_list_next(&ec->todo, 0u); i < ASI_INDICES; i = asi_list_next(&ec->todo, i + 1u)) {
        if (ec->step == READ_ID12) { /* at most 32 slaves are in todo: 64 requests */
            add_request(ec, i, asi_call_command(ASI_CMD_RID1, i));
            add_request(ec, i, asi_call_command(ASI_CMD_RID2, i));
        } else {
            add_request(ec, i, asi_call_command(ec->step == READ_IO ? ASI_CMD_RDIO : ASI_CMD_RDID, i));
        }
    }
    send_batch(ec);
}

static event_t begin_detection(asi_ec_t *ec)
{
    if (ec->power_up) { /* EX-002 */
        ec->power_up = false;
        for (unsigned i = 0; i < ASI_INDICES; i++)
            ec->state.pi[i] = ec->permanent.projection.pp[i];
        ec->state.changed = (asi_list_t){{0xFFFFFFFFu, 0xFFFFFFFFu}};
    }
    if (ec->state.flags & ASI_FLAG_OFFLINE_READY) {
        ec->state.flags &= ~(uint32_t)ASI_FLAG_OFFLINE_READY;
        touch(ec);
    }
    ec->sel = false;
    ec->step = READ_IO;
    ec->extended_numbers = (asi_list_t){{0xFFFFFFFFu, 0u}}; /* until proven standard */
    ec->zero_sel = false;
    ec->todo = (asi_list_t){{0xFFFFFFFFu, 0u}};
    asi_port_line(true);
    detection_batch(ec);
    return EV_NONE;
}

/** Take the answers of one step; what stays in ec->todo goes on. */
static void detection_results(asi_ec_t *ec, const asi_result_t *results)
{
    for (unsigned k = 0; k < ec->batch_len; k++) {
        const unsigned i = ec->request_index[k];
        const bool good = results[k].error == ASI_ERR_OK;
        uint16_t *codes = &ec->codes[i];
        if (ec->step == READ_IO) {
            *codes = ASI_CODES_NONE;
            if (good) {
                put_code(codes, 0, results[k].data);
                asi_list_remove(&ec->extended_numbers, i); /* somebody is there; ID = A adds it again */
            } else {
                asi_list_remove(&ec->todo, i);
            }
        } else if (ec->step == READ_ID) {
            if (good) {
                put_code(codes, 4, results[k].data);
                if (!ec->sel && i != 0u && results[k].data == ASI_ID_EXTENDED)
                    asi_list_add(&ec->extended_numbers, i);
            } else {
                asi_list_remove(&ec->todo, i);
            }
        } else { /* ID1 at even, ID2 at odd places; EX-005: they may be missing on slaves that are not A/B */
            if (good)
                put_code(codes, (k & 1u) ? 12 : 8, results[k].data);
            else if (asi_codes_id(*codes) == ASI_ID_EXTENDED)
                asi_list_remove(&ec->todo, i);
            else if (k & 1u)
                asi_list_add(&ec->no_id2, i);
        }
    }
}

/** Slave i is read. */
static void detected(asi_ec_t *ec, unsigned i)
{
    if (i == ZERO_SEL1) {
        ec->zero_sel = true;
        if (asi_list_has(&ec->no_id2, ZERO_SEL1))
            asi_list_add(&ec->no_id2, 0u);
        asi_list_remove(&ec->no_id2, ZERO_SEL1);
    }
    ec_enter_lds(ec, i == ZERO_SEL1 ? 0u : i, ec->codes[i]);
}

static event_t detection_next(asi_ec_t *ec, const asi_result_t *results)
{
    detection_results(ec, results);
    if (ec->step == READ_ID12) {
        for (unsigned i = asi_list_next(&ec->todo, 0u); i < ASI_INDICES; i = asi_list_next(&ec->todo, i + 1u))
            detected(ec, i);
        ec->todo = ASI_LIST_EMPTY;
        ec_update_flags(ec);
    } else {
        ec->step++;
    }
    if (asi_list_is_empty(&ec->todo) && !ec->sel) { /* EX-006: the same for Sel = 1 */
        ec->sel = true;
        ec->step = READ_IO;
        ec->todo.w[1] = ec->extended_numbers.w[0];
    }
    if (!asi_list_is_empty(&ec->todo)) {
        detection_batch(ec);
        return EV_NONE;
    }
    return asi_list_is_empty(&ec->state.lds) ? EV_NOBODY : EV_FOUND;
}

/* ------------------------------------------------------------------------------------------ ACTIVATION */

/** WPAR(PI) and DEXG(F) for up to 32 slaves of ec->todo (EX-008). */
static event_t activation_batch(asi_ec_t *ec)
{
    ec->batch_len = 0;
    for (unsigned i = asi_list_next(&ec->todo, 0u); i < ASI_INDICES; i = asi_list_next(&ec->todo, i + 1u)) {
        const bool extended = ec_is_extended(ec, i);
        if (ec->batch_len == ASI_INDICES)
            break;
        add_request(ec, i, asi_call_wpar(i, ec_parameter(ec, i), extended));
        add_request(ec, i, asi_call_dexg(i, 15u, extended));
        asi_list_remove(&ec->todo, i);
    }
    if (ec->batch_len == 0u)
        return EV_TRIED;
    send_batch(ec);
    return EV_NONE;
}

static event_t begin_activation(asi_ec_t *ec)
{
    ec->todo = ASI_LIST_EMPTY;
    for (unsigned i = asi_list_next(&ec->state.lds, 1u); i < ASI_INDICES; i = asi_list_next(&ec->state.lds, i + 1u)) {
        if (ec_may_activate(ec, i))
            asi_list_add(&ec->todo, i);
    }
    return activation_batch(ec);
}

static event_t activation_next(asi_ec_t *ec, const asi_result_t *results)
{
    for (unsigned k = 0; k < ec->batch_len; k += 2u) {
        const unsigned i = ec->request_index[k];
        if (results[k].error != ASI_ERR_OK)
            continue;
        ec_set_echo(ec, i, results[k].data);
        /* the host may have changed the projection meanwhile */
        if (results[k + 1u].error == ASI_ERR_OK && ec_may_activate(ec, i))
            ec_enter_las(ec, i);
    }
    return activation_batch(ec);
}

asi_status_t asi_ec_batch_done(asi_ec_t *ec, const asi_result_t *results, unsigned n)
{
    if (!ec->batch_open || n != ec->batch_len)
        return ASI_E_STATE;
    ec->batch_open = false;
    dispatch(ec, ec->state.phase == ASI_PHASE_DETECTION ? detection_next(ec, results) : activation_next(ec, results));
    return ASI_OK;
}

/** EX-024: what LAS holds is activated as after detection; the slaves may have been reset meanwhile. */
static event_t begin_again(asi_ec_t *ec)
{
    const asi_list_t las = ec->state.las;
    end_cycle(ec);
    for (unsigned i = asi_list_next(&las, 0u); i < ASI_INDICES; i = asi_list_next(&las, i + 1u))
        ec_leave_las(ec, i);
    ec->todo = las;
    ec_send_outputs(ec);
    ec_update_flags(ec);
    return activation_batch(ec);
}

/* ------------------------------------------------------------------------------------------ normal operation */

static event_t begin_operation(asi_ec_t *ec)
{
    ec->state.flags |= ASI_FLAG_NORMAL_OPERATION_ACTIVE;
    ec->wrong = ASI_LIST_EMPTY;
    ec->poll_wait = 0;
    ec_update_flags(ec);
    ec_send_outputs(ec);
    ec_inclusion_begin(ec);
    ec_run_cycle(ec);
    return EV_NONE;
}

void ec_manage(asi_ec_t *ec, asi_owner_t owner, uint16_t call, unsigned index, unsigned retries, bool no_reply)
{
    const asi_request_t request = {.call = call, .retries = (uint8_t)retries, .tag = ++ec->management_tag,
                                   .no_reply = no_reply, .sel = index >= 32u};
    ec->owner = (uint8_t)owner;
    asi_port_management(&request);
}

/** EX-027: one status read per P_RDST_EVERY cycles that nobody else needs; never between the calls of an inclusion. */
static void poll_status(asi_ec_t *ec)
{
    if (ec->poll_wait < ASI_RDST_EVERY - 1u) {
        ec->poll_wait++;
        return;
    }
    if (ec->owner != ASI_OWNER_NONE || ec_inclusion_busy(ec) || asi_list_is_empty(&ec->state.las))
        return;
    unsigned i = asi_list_next(&ec->state.las, ec->poll_index + 1u);
    if (i == ASI_INDICES)
        i = asi_list_next(&ec->state.las, 0u);
    ec->poll_index = (uint8_t)i;
    ec->poll_wait = 0;
    ec_manage(ec, ASI_OWNER_POLL, asi_call_command(ASI_CMD_RDST, i), i, ASI_CMD_RETRY, false);
}

static void poll_result(asi_ec_t *ec, const asi_result_t *result)
{
    const unsigned i = ec->poll_index;
    const bool fault = (result->data & 2u) != 0u && !(ASI_S1_MIN_V21 && asi_list_has(&ec->no_id2, i));
    if (result->error != ASI_ERR_OK || !asi_list_has(&ec->state.las, i) || fault == asi_list_has(&ec->state.lpf, i))
        return;
    if (fault)
        asi_list_add(&ec->state.lpf, i);
    else
        asi_list_remove(&ec->state.lpf, i);
    ec_log(ec, ASI_EVENT_PERIPHERY_FAULT, i, fault);
    ec_update_flags(ec);
}

/** EX-033 */
static void auto_clear(asi_ec_t *ec)
{
    const unsigned cause = ec_auto_clear_cause(ec);
    if (cause == ASI_INDICES)
        return;
    ec_log(ec, ASI_EVENT_AUTO_CLEAR, cause, ec->permanent.auto_clear);
    ec->auto_cleared = true;
    ec->offline = true;
    ec_stop(ec, ASI_OFFLINE_AUTO_CLEAR);
}

/** A live slave, if it was called since the last look: its answer to the engine, the engine's next nibble to its
 * slot. */
static void exchange_live(asi_ec_t *ec, unsigned i, uint32_t now_us)
{
    const asi_slot_state_t slot = asi_port_slot_state(i);
    if (slot.calls == ec->calls[i])
        return; /* the other one of an A/B pair was called */
    const unsigned worked = ec->ctt.status[i] & ASI_CTT_TV;
    asi_ctt_call_t call = {.ok = slot.error == ASI_ERR_OK, .sent = slot.sent, .answer = slot.data, .now_us = now_us};
    ec->calls[i] = slot.calls;
    if (ec->ctt.kind[i] <= ASI_CTT_1_OUT) { /* no digital bits: spares some shifts, which this core does bit by bit */
        asi_port_live(i, asi_ctt_call(&ec->ctt, i, &call));
    } else {
        const unsigned w = asi_word(i), shift = asi_shift(i);
        call.outputs = (uint8_t)(ec->out_host[w] >> shift & 15u);
        asi_port_live(i, asi_ctt_call(&ec->ctt, i, &call));
        ec->live_in[w] = (ec->live_in[w] & ~(15u << shift)) | asi_ctt_inputs(&ec->ctt, i, slot.data) << shift;
    }
    if ((ec->ctt.status[i] & ASI_CTT_TV) != worked && (worked != 0u || asi_list_has(&ec->ctt_failed, i))) {
        ec_log(ec, ASI_EVENT_CTT, i, worked == 0u); /* not the first time it works: that is no news */
        if (worked != 0u)
            asi_list_add(&ec->ctt_failed, i);
        else
            asi_list_remove(&ec->ctt_failed, i);
    }
}

void asi_ec_exchange_done(asi_ec_t *ec)
{
    const asi_list_t live = ec->ctt.live;
    if (ec->state.phase != ASI_PHASE_DATA_EXCHANGE || !ec->permanent.data_exchange)
        return;
    const uint32_t now_us = asi_port_time_us();
    /* by numbers, as they will be called; a plain walk, because looking for bits costs more than the few that are
     * not live */
    for (uint32_t n = 1u, a = live.w[0] >> 1, b = live.w[1] >> 1; (a | b) != 0u; n++, a >>= 1, b >>= 1) {
        if (a & 1u)
            exchange_live(ec, n, now_us);
        if (b & 1u)
            exchange_live(ec, n + 32u, now_us);
    }
}

/** Inputs that are not the plain answer: combined transactions and safety slaves. */
static void ctt_images(asi_ec_t *ec, uint32_t in[ASI_IMAGE_WORDS])
{
    const asi_list_t groups = {{ec->ctt.groups | ec->ctt.safety, 0u}};
    asi_list_t called = ASI_LIST_EMPTY, failed = ASI_LIST_EMPTY;
    for (unsigned w = 0; w < ASI_IMAGE_WORDS; w++)
        in[w] = (in[w] & ~ec->live_mask[w]) | ec->live_in[w];
    if ((groups.w[0] | ec->ctt.grouped) == 0u)
        return;
    for (unsigned i = asi_list_next(&groups, 0u); i < ASI_INDICES; i = asi_list_next(&groups, i + 1u)) {
        const asi_slot_state_t slot = asi_port_slot_state(i);
        if (slot.calls == ec->calls[i])
            continue;
        ec->calls[i] = slot.calls;
        asi_list_add(&called, i);
        if (slot.error != ASI_ERR_OK)
            asi_list_add(&failed, i);
    }
    asi_ctt_cycle(&ec->ctt, &ec->state.las, &called, &failed, ec->state.cdi, in, ec->out_host);
}

asi_status_t asi_ec_cycle_done(asi_ec_t *ec, const asi_cycle_report_t *report)
{
    if (ec->state.phase != ASI_PHASE_DATA_EXCHANGE)
        return ASI_E_STATE;
    ec_inclusion_result(ec, &report->inclusion);
    if (ec->owner != ASI_OWNER_NONE && report->management.tag == ec->management_tag) {
        const unsigned owner = ec->owner;
        ec->owner = ASI_OWNER_NONE;
        if (owner == ASI_OWNER_JOB)
            ec_job_result(ec, &report->management);
        else
            poll_result(ec, &report->management);
    }
    ec_job_cycle(ec);
    poll_status(ec);
    for (unsigned w = 0; w < ASI_IMAGE_WORDS; w++)
        ec->state.in[w] = ec->permanent.data_exchange ? report->in[w] & ec->las_mask[w] : 0u;
    if (asi_ctt_any(&ec->ctt) && ec->permanent.data_exchange)
        ctt_images(ec, ec->state.in);
    ec_send_outputs(ec);
    auto_clear(ec);
    return ASI_OK;
}

asi_status_t asi_ec_slave_lost(asi_ec_t *ec, const asi_list_t *lost)
{
    const asi_list_t others = asi_list_without(&ec->state.las, lost);
    const asi_list_t gone = asi_list_without(&ec->state.las, &others);
    if (asi_list_is_empty(&gone))
        return ASI_E_STATE;
    for (unsigned i = asi_list_next(&gone, 0u); i < ASI_INDICES; i = asi_list_next(&gone, i + 1u))
        ec_leave_lds(ec, i); /* EX-015; found again by inclusion */
    if (ec->state.phase == ASI_PHASE_DATA_EXCHANGE)
        ec_run_cycle(ec);
    ec_update_flags(ec);
    return ASI_OK;
}

void asi_ec_quality(asi_ec_t *ec, unsigned index, uint32_t good, uint32_t silent, uint32_t garbled)
{
    uint32_t points = ec->suspicion[index];
    const bool was = asi_list_has(&ec->state.suspects, index);
    /* two slaves disturb each other; a dead or far one is silent, one on a noisy line mostly gets through */
    if (garbled > 4u * silent && 4u * garbled > good)
        points += garbled;
    else if (silent != 0u)
        points = points > 2u * silent ? points - 2u * silent : 0u;
    else if (good != 0u && points != 0u)
        points--;
    if (points > 2u * ASI_SUSPECT)
        points = 2u * ASI_SUSPECT;
    ec->suspicion[index] = (uint8_t)points;
    if (!was && points >= ASI_SUSPECT) {
        asi_list_add(&ec->state.suspects, index);
        ec_log(ec, ASI_EVENT_SUSPECT, index, 1u);
        touch(ec);
    } else if (was && points == 0u) {
        asi_list_remove(&ec->state.suspects, index);
        ec_log(ec, ASI_EVENT_SUSPECT, index, 0u);
        touch(ec);
    }
}

void asi_ec_power(asi_ec_t *ec, bool apf)
{
    if (apf == ec->apf)
        return;
    ec->apf = apf;
    ec_log(ec, ASI_EVENT_APF, 0u, apf);
    if (apf) {
        if (ec->power_up) /* the supply was not up yet: wait from its return */
            ec->settle_left_us = ASI_PWR_SETTLE_US;
        ec_stop(ec, ASI_OFFLINE_POWER); /* EX-021 */
    }
    ec_update_flags(ec);
}

void asi_ec_tick(asi_ec_t *ec, uint32_t elapsed_us)
{
    if (ec->reactivate && asi_port_idle() && asi_port_time_us() - ec->reactivate_from_us >= ec->reactivate_pause_us)
        dispatch(ec, EV_AGAIN);
    if (ec->state.phase != ASI_PHASE_OFFLINE)
        return;
    if (!ec->apf)
        ec->settle_left_us -= elapsed_us < ec->settle_left_us ? elapsed_us : ec->settle_left_us;
    if (!asi_port_idle())
        return;
    if (!(ec->state.flags & ASI_FLAG_OFFLINE_READY)) { /* shown for one tick at least, even when only passing through */
        ec->state.flags |= ASI_FLAG_OFFLINE_READY;
        touch(ec);
    } else if (!ec->offline && !ec->apf && ec->settle_left_us == 0u) {
        dispatch(ec, EV_START); /* EX-003 */
    }
}
