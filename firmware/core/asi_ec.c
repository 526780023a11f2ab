/* SPDX-License-Identifier: Apache-2.0 */
/** @file asi_ec.c  Execution control: a table of phases, batches in front of the cycle, the inclusion machine in it. */
#include "asi_ec.h"
#include "asi_calls.h"

/* ------------------------------------------------------------------------------------------ lists and flags */

static void touch(asi_ec_t *ec)
{
    ec->state.version++;
}

static bool is_extended(const asi_ec_t *ec, unsigned index)
{
    return (index & 32u) != 0u || asi_codes_id(ec->state.cdi[index]) == ASI_ID_EXTENDED;
}

/** EX-026: a B slave whose number belongs to a standard slave */
static bool clashes(const asi_ec_t *ec, unsigned index)
{
    return index > 32u && asi_list_has(&ec->state.lds, index - 32u) && !is_extended(ec, index - 32u);
}

/** detected as projected */
static bool matches(const asi_ec_t *ec, unsigned index)
{
    return asi_list_has(&ec->projection->lps, index) && ec->state.cdi[index] == ec->projection->pcd[index] &&
           !clashes(ec, index);
}

/** EX-008, EX-009, EX-026 */
static bool may_activate(const asi_ec_t *ec, unsigned index)
{
    if (index == 0u)
        return false;
    return ec->protected_mode ? matches(ec, index) : !clashes(ec, index);
}

/** Set the flags from lists, codes and controls (EX-016 .. EX-022). Called on changes only: the cycle stays short. */
static void update_flags(asi_ec_t *ec)
{
    asi_ec_state_t *s = &ec->state;
    bool all_match = true; /* no wrong, no extra slave */
    for (unsigned i = asi_list_next(&s->lds, 1u); i < ASI_INDICES && all_match; i = asi_list_next(&s->lds, i + 1u))
        all_match = matches(ec, i);
    const asi_list_t missing = asi_list_without(&ec->projection->lps, &s->lds);
    const unsigned first = asi_list_next(&missing, 0u);
    const bool one_missing = first < ASI_INDICES && asi_list_next(&missing, first + 1u) == ASI_INDICES;
    const bool slave0 = asi_list_has(&s->lds, 0u);
    uint32_t flags = s->flags & (ASI_FLAG_NORMAL_OPERATION_ACTIVE | ASI_FLAG_OFFLINE_READY);

    if (all_match && first == ASI_INDICES && !slave0)
        flags |= ASI_FLAG_CONFIG_OK;
    if (slave0)
        flags |= ASI_FLAG_LDS0;
    if (ec->auto_address && ec->protected_mode && all_match) {
        flags |= ASI_FLAG_AUTO_ADDRESS_ASSIGN;
        if (one_missing)
            flags |= ASI_FLAG_AUTO_ADDRESS_AVAILABLE;
    }
    if (!ec->protected_mode)
        flags |= ASI_FLAG_CONFIGURATION_ACTIVE;
    if (ec->apf)
        flags |= ASI_FLAG_APF;
    if (asi_list_is_empty(&s->lpf))
        flags |= ASI_FLAG_PERIPHERY_OK;
    s->flags = flags;
    touch(ec);
}

static void set_codes(asi_ec_t *ec, unsigned index, uint16_t codes)
{
    if (ec->state.cdi[index] != codes) {
        ec->state.cdi[index] = codes;
        asi_list_add(&ec->state.changed, index);
    }
}

static void set_echo(asi_ec_t *ec, unsigned index, uint8_t echo)
{
    if (ec->state.pecho[index] != echo) {
        ec->state.pecho[index] = echo;
        asi_list_add(&ec->state.changed, index);
        touch(ec);
    }
}

/* ------------------------------------------------------------------------------------------ images */

/** Line level of the outputs (CA-005): idle F, payload of active slaves inverted. I3 of A/B calls is not ours. */
static void send_outputs(asi_ec_t *ec)
{
    bool changed = false;
    for (unsigned w = 0; w < ASI_IMAGE_WORDS; w++) {
        const uint32_t host = ec->data_exchange ? ec->out_host[w] ^ ec->invert[w] : 0xFFFFFFFFu;
        const uint32_t line = host | ~ec->las_mask[w];
        changed |= line != ec->out_line[w];
        ec->out_line[w] = line;
    }
    if (changed)
        asi_port_outputs(ec->out_line);
}

/** Let the cycle run with the period that suits LAS. */
static void run_cycle(const asi_ec_t *ec)
{
    const bool empty = asi_list_is_empty(&ec->state.las);
    asi_port_cycle(true, ASI_EXTRA_CALLS == 2, empty ? ASI_EMPTY_CYCLE_US : ASI_MIN_CYCLE_US);
}

static void enter_las(asi_ec_t *ec, unsigned index)
{
    const bool extended = is_extended(ec, index);
    const unsigned w = asi_word(index), shift = asi_shift(index);
    asi_list_add(&ec->state.las, index);
    ec->las_mask[w] |= 15u << shift;
    ec->invert[w] |= (ASI_INVERT_OUT ? (extended ? 7u : 15u) : 0u) << shift;
    asi_port_slot(index, true, extended);
}

static void leave_las(asi_ec_t *ec, unsigned index)
{
    const uint32_t others = ~(15u << asi_shift(index));
    if (!asi_list_has(&ec->state.las, index))
        return;
    asi_port_slot(index, false, false);
    asi_list_remove(&ec->state.las, index);
    ec->las_mask[asi_word(index)] &= others;
    ec->invert[asi_word(index)] &= others;
    ec->state.in[asi_word(index)] &= others; /* CA-006, LK-005 */
}

/** A complete answer: into LDS and CDI (EX-004, EX-013). */
static void enter_lds(asi_ec_t *ec, unsigned index, uint16_t codes)
{
    asi_list_add(&ec->state.lds, index);
    set_codes(ec, index, codes);
    ec->miss[index] = 0;
    /* EX-026: the B slave of this number would hear the standard slave's calls with D3 = 0 */
    if (index != 0u && index < 32u && !is_extended(ec, index))
        leave_las(ec, index + 32u);
}

/** Gone (EX-014, EX-015). */
static void leave_lds(asi_ec_t *ec, unsigned index)
{
    leave_las(ec, index);
    asi_list_remove(&ec->state.lds, index);
    set_codes(ec, index, ASI_CODES_NONE);
    ec->miss[index] = 0;
}

/* ------------------------------------------------------------------------------------------ batches */

static void add_request(asi_ec_t *ec, unsigned index, uint16_t call)
{
    ec->requests[ec->batch_len] = (asi_request_t){.call = call, .retries = ASI_CMD_RETRY, .sel = index >= 32u}; /* EX-010 */
    ec->request_index[ec->batch_len] = (uint8_t)index;
    ec->batch_len++;
}

static void send_batch(asi_ec_t *ec)
{
    ec->batch_open = true;
    asi_port_batch(ec->requests, ec->batch_len);
}

static void put_code(uint16_t *codes, unsigned position, unsigned nibble)
{
    *codes = (uint16_t)((*codes & ~(15u << position)) | nibble << position);
}

/* ------------------------------------------------------------------------------------------ the phases as a table */

typedef enum { EV_NONE, EV_START, EV_STOP, EV_NOBODY, EV_FOUND, EV_TRIED } event_t;

static event_t begin_detection(asi_ec_t *ec);
static event_t begin_activation(asi_ec_t *ec);
static event_t begin_operation(asi_ec_t *ec);
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
                    touch(ec);
                }
                raised = transitions[row].action(ec);
                break;
            }
        }
        event = raised;
    }
}

/** EX-001 */
static event_t go_offline(asi_ec_t *ec)
{
    asi_port_cycle(false, false, 0);
    asi_port_inclusion(0);
    for (unsigned i = asi_list_next(&ec->state.las, 0u); i < ASI_INDICES; i = asi_list_next(&ec->state.las, i + 1u))
        leave_las(ec, i);
    for (unsigned i = asi_list_next(&ec->state.lds, 0u); i < ASI_INDICES; i = asi_list_next(&ec->state.lds, i + 1u))
        leave_lds(ec, i);
    ec->state.lpf = ASI_LIST_EMPTY;
    ec->batch_open = false;
    ec->inclusion_open = false;
    if (ec->management_open) { /* the sequencer has taken it or never will: asi_port_line(false) ends it */
        ec->management_open = false;
        ec->management_known = true;
        ec->management = (asi_result_t){.error = ASI_ERR_ABORTED};
    }
    send_outputs(ec);
    ec->state.flags &= ~(uint32_t)ASI_FLAG_NORMAL_OPERATION_ACTIVE;
    update_flags(ec);
    return EV_NONE;
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
            ec->state.pi[i] = ec->projection->pp[i];
        ec->state.changed = (asi_list_t){{0xFFFFFFFFu, 0xFFFFFFFFu}};
    }
    if (ec->state.flags & ASI_FLAG_OFFLINE_READY) {
        ec->state.flags &= ~(uint32_t)ASI_FLAG_OFFLINE_READY;
        touch(ec);
    }
    ec->sel = false;
    ec->step = READ_IO;
    ec->extended_numbers = (asi_list_t){{0xFFFFFFFEu, 0u}}; /* until proven standard; address 0 has no Sel = 1 pass */
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
        }
    }
}

static event_t detection_next(asi_ec_t *ec, const asi_result_t *results)
{
    detection_results(ec, results);
    if (ec->step == READ_ID12) {
        for (unsigned i = asi_list_next(&ec->todo, 0u); i < ASI_INDICES; i = asi_list_next(&ec->todo, i + 1u))
            enter_lds(ec, i, ec->codes[i]);
        ec->todo = ASI_LIST_EMPTY;
        update_flags(ec);
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
        const bool extended = is_extended(ec, i);
        if (ec->batch_len == ASI_INDICES)
            break;
        add_request(ec, i, asi_call_wpar(i, ec->state.pi[i], extended));
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
        if (may_activate(ec, i))
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
        set_echo(ec, i, results[k].data);
        /* the host may have changed the projection meanwhile */
        if (results[k + 1u].error == ASI_ERR_OK && may_activate(ec, i))
            enter_las(ec, i);
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

/* ------------------------------------------------------------------------------------------ INCLUSION */

enum { PROBE, INCLUDE_ID, INCLUDE_ID1, INCLUDE_ID2, INCLUDE_WPAR, INCLUDE_DEXG }; /* ec->inclusion_step */

/** The request of this step, for all slots until the next one. A repetition is a further slot (EX-013). */
static void inclusion_request(asi_ec_t *ec, unsigned step)
{
    static const uint8_t read[] = {ASI_CMD_RDIO, ASI_CMD_RDID, ASI_CMD_RID1, ASI_CMD_RID2};
    const unsigned i = ec->inclusion_index;
    asi_request_t request = {.tag = ++ec->inclusion_tag, .sel = i >= 32u};
    if (step != ec->inclusion_step)
        ec->inclusion_failures = 0;
    ec->inclusion_step = (uint8_t)step;
    if (step == INCLUDE_WPAR)
        request.call = asi_call_wpar(i, ec->state.pi[i], is_extended(ec, i));
    else if (step == INCLUDE_DEXG)
        request.call = asi_call_dexg(i, 15u, is_extended(ec, i));
    else
        request.call = asi_call_command((asi_command_t)read[step], i);
    asi_port_inclusion(&request);
    ec->inclusion_open = true;
}

/** EX-012: the next address not in LAS, 0 included, all of Sel = 0, then all of Sel = 1, wrapping. */
static void probe_next(asi_ec_t *ec)
{
    const asi_list_t all = {{0xFFFFFFFFu, 0xFFFFFFFEu}};
    const asi_list_t candidates = asi_list_without(&all, &ec->state.las);
    unsigned i = asi_list_next(&candidates, ec->inclusion_index + 1u);
    if (i == ASI_INDICES)
        i = 0; /* always a candidate: never in LAS */
    ec->inclusion_index = (uint8_t)i;
    ec->inclusion_failures = 0;
    inclusion_request(ec, PROBE);
}

/** No complete answer from the candidate in this round (EX-014). */
static void candidate_missed(asi_ec_t *ec)
{
    const unsigned i = ec->inclusion_index;
    if (asi_list_has(&ec->state.lds, i) && ++ec->miss[i] >= ASI_INCL_MISS) {
        leave_lds(ec, i);
        update_flags(ec);
    }
    probe_next(ec);
}

/** All codes are read (EX-013). */
static void candidate_read(asi_ec_t *ec)
{
    const unsigned i = ec->inclusion_index;
    const asi_list_t lds = ec->state.lds, las = ec->state.las;
    const uint16_t codes = ec->state.cdi[i];
    enter_lds(ec, i, ec->inclusion_codes);
    if (codes != ec->inclusion_codes || !asi_list_equal(&lds, &ec->state.lds) ||
        !asi_list_equal(&las, &ec->state.las)) {
        run_cycle(ec); /* LAS may have become empty (EX-026) */
        update_flags(ec);
    }
    if (may_activate(ec, i)) {
        asi_port_forget(i); /* it may have been active before */
        inclusion_request(ec, INCLUDE_WPAR);
    } else {
        probe_next(ec);
    }
}

static void inclusion_result(asi_ec_t *ec, const asi_result_t *result)
{
    const unsigned i = ec->inclusion_index, step = ec->inclusion_step;
    const bool good = result->error == ASI_ERR_OK;
    const bool last_try = step == PROBE || ec->inclusion_failures >= ASI_CMD_RETRY;

    if (!good && !last_try) { /* EX-010, one call per slot */
        ec->inclusion_failures++;
        inclusion_request(ec, step);
        return;
    }
    switch (step) {
    case PROBE:
        ec->inclusion_codes = (uint16_t)(0xFFF0u | result->data);
        if (good)
            inclusion_request(ec, INCLUDE_ID);
        else
            candidate_missed(ec);
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
        if (step == INCLUDE_ID2)
            candidate_read(ec);
        else
            inclusion_request(ec, step + 1u);
        break;
    case INCLUDE_WPAR:
        if (good && may_activate(ec, i)) { /* the projection may have changed meanwhile */
            set_echo(ec, i, result->data);
            inclusion_request(ec, INCLUDE_DEXG);
        } else {
            probe_next(ec);
        }
        break;
    default: /* INCLUDE_DEXG */
        if (good && may_activate(ec, i)) {
            enter_las(ec, i);
            run_cycle(ec);
            update_flags(ec);
        }
        probe_next(ec);
        break;
    }
}

/* ------------------------------------------------------------------------------------------ normal operation */

static event_t begin_operation(asi_ec_t *ec)
{
    ec->state.flags |= ASI_FLAG_NORMAL_OPERATION_ACTIVE;
    update_flags(ec);
    send_outputs(ec);
    ec->inclusion_index = ASI_INDICES - 1u; /* the first probe goes to 0 */
    probe_next(ec);
    run_cycle(ec);
    return EV_NONE;
}

asi_status_t asi_ec_cycle_done(asi_ec_t *ec, const asi_cycle_report_t *report)
{
    if (ec->state.phase != ASI_PHASE_DATA_EXCHANGE)
        return ASI_E_STATE;
    if (ec->inclusion_open && report->inclusion.tag == ec->inclusion_tag) /* else a repeat of an older probe */
        inclusion_result(ec, &report->inclusion);
    if (ec->management_open && report->management.tag == ec->management_tag) {
        ec->management_open = false;
        ec->management_known = true;
        ec->management = report->management;
    }
    for (unsigned w = 0; w < ASI_IMAGE_WORDS; w++)
        ec->state.in[w] = report->in[w] & ec->las_mask[w];
    send_outputs(ec);
    return ASI_OK;
}

asi_status_t asi_ec_slave_lost(asi_ec_t *ec, const asi_list_t *lost)
{
    const asi_list_t others = asi_list_without(&ec->state.las, lost);
    const asi_list_t gone = asi_list_without(&ec->state.las, &others);
    if (asi_list_is_empty(&gone))
        return ASI_E_STATE;
    for (unsigned i = asi_list_next(&gone, 0u); i < ASI_INDICES; i = asi_list_next(&gone, i + 1u))
        leave_lds(ec, i); /* EX-015; found again by inclusion */
    run_cycle(ec);
    update_flags(ec);
    return ASI_OK;
}

void asi_ec_power(asi_ec_t *ec, bool apf)
{
    if (apf == ec->apf)
        return;
    ec->apf = apf;
    if (apf) {
        if (ec->power_up) /* the supply was not up yet: wait from its return */
            ec->settle_left_us = ASI_PWR_SETTLE_US;
        dispatch(ec, EV_STOP); /* EX-021 */
    }
    update_flags(ec);
}

void asi_ec_tick(asi_ec_t *ec, uint32_t elapsed_us)
{
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

/* ------------------------------------------------------------------------------------------ host */

void asi_ec_init(asi_ec_t *ec, const asi_projection_t *projection)
{
    *ec = (asi_ec_t){.projection = projection, .data_exchange = true, .power_up = true,
                     .settle_left_us = ASI_PWR_SETTLE_US};
    for (unsigned i = 0; i < ASI_INDICES; i++) {
        ec->state.cdi[i] = ASI_CODES_NONE;
        ec->state.pi[i] = projection->pp[i];
        ec->state.pecho[i] = 15u;
    }
    ec->state.changed = (asi_list_t){{0xFFFFFFFFu, 0xFFFFFFFFu}};
    asi_port_phase(ASI_PHASE_OFFLINE);
    send_outputs(ec); /* line value F */
    update_flags(ec);
}

void asi_ec_set_mode(asi_ec_t *ec, bool protected_mode)
{
    if (ec->protected_mode == protected_mode)
        return;
    ec->protected_mode = protected_mode;
    dispatch(ec, EV_STOP); /* EX-023 */
    update_flags(ec);
}

void asi_ec_set_offline(asi_ec_t *ec, bool offline)
{
    ec->offline = offline;
    if (offline)
        dispatch(ec, EV_STOP);
}

void asi_ec_set_data_exchange(asi_ec_t *ec, bool active)
{
    ec->data_exchange = active;
    send_outputs(ec);
}

void asi_ec_set_auto_address(asi_ec_t *ec, bool enable)
{
    ec->auto_address = enable;
    update_flags(ec);
}

asi_status_t asi_ec_check_projection(const asi_projection_t *projection)
{
    const asi_list_t slaves = ASI_LIST_SLAVES;
    const asi_list_t alien = asi_list_without(&projection->lps, &slaves);
    unsigned parameters = 0;
    for (unsigned i = 0; i < ASI_INDICES; i++)
        parameters |= projection->pp[i];
    return asi_list_is_empty(&alien) && parameters <= 15u ? ASI_OK : ASI_E_ARG;
}

asi_status_t asi_ec_set_projection(asi_ec_t *ec, const asi_projection_t *projection)
{
    const asi_status_t status = asi_ec_check_projection(projection);
    if (status != ASI_OK)
        return status;
    ec->projection = projection;
    if (ec->protected_mode && ec->state.phase == ASI_PHASE_DATA_EXCHANGE) { /* EX-009 */
        const asi_list_t las = ec->state.las;
        for (unsigned i = asi_list_next(&las, 0u); i < ASI_INDICES; i = asi_list_next(&las, i + 1u)) {
            if (!may_activate(ec, i))
                leave_las(ec, i);
        }
        run_cycle(ec);
    }
    update_flags(ec);
    return ASI_OK;
}

void asi_ec_set_outputs(asi_ec_t *ec, const uint32_t image[ASI_IMAGE_WORDS])
{
    for (unsigned w = 0; w < ASI_IMAGE_WORDS; w++)
        ec->out_host[w] = image[w];
}

asi_status_t asi_ec_manage(asi_ec_t *ec, uint16_t call)
{
    const bool is_wpar = (call & 0x410u) == 0x010u && (call & 0x3E0u) != 0u;
    const bool is_read_or_reset = (call & 0x410u) == 0x410u && call != ASI_CALL_BR01;
    if (!asi_call_is_legal(call) || !(is_wpar || is_read_or_reset))
        return ASI_E_ARG;
    if (ec->state.phase != ASI_PHASE_DATA_EXCHANGE)
        return ASI_E_STATE;
    if (ec->management_open)
        return ASI_E_BUSY;
    const unsigned number = (unsigned)call >> 5 & 31u;
    const bool extended = is_extended(ec, number) || asi_list_has(&ec->state.lds, number + 32u);
    const asi_request_t request = {.call = call, .retries = ASI_CMD_RETRY, .tag = ++ec->management_tag, /* EX-010 */
                                   .sel = asi_call_index(call, extended) >= 32u};
    ec->management_open = true;
    ec->management_known = false;
    asi_port_management(&request);
    return ASI_OK;
}

asi_status_t asi_ec_manage_result(const asi_ec_t *ec, asi_result_t *result)
{
    if (ec->management_open)
        return ASI_E_BUSY;
    if (!ec->management_known)
        return ASI_E_STATE;
    if (ec->management.error == ASI_ERR_ABORTED)
        return ASI_E_ABORTED;
    *result = ec->management;
    return ASI_OK;
}
