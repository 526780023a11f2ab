/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_jobs.c  Execution control functions that need the line: a table of steps, one call per management slot.
 * The way of an address change, of its rescue and of automatic addressing: docs/execution_control.md.
 */
#include "asi_ec_private.h"

enum {
    STEP_WRITE_PARAMETER,                                            /* FN-005 */
    STEP_EXECUTE,                                                    /* FN-022 */
    STEP_DELETE, STEP_FIND, STEP_FIND_ID,                            /* AD-002 */
    STEP_WRITE_ID1, STEP_ID1_WRITTEN, STEP_ID1_READ,                 /* AD-003, FN-024 */
    STEP_ASSIGN, STEP_LOOK,                                          /* AD-004 */
    STEP_STORED, STEP_LOOK_AGAIN,                                    /* AD-005 */
    STEP_ACTIVATE, STEP_EXCHANGE,                                    /* AD-006, FN-022 */
    STEP_STRING_BEGIN, STEP_STRING, STEP_STRING_END                  /* FN-027 .. FN-031 */
};

#define ID1_SELECT 8u   /**< bit of ID1 that is the select of an A/B slave */
#define ID1_UNKNOWN 16u
#define ANSWER_ADRA 6u
#define ANSWER_ZERO 0u  /**< DELA, WID1 */
#define ANSWER_RES 6u

static bool is_string(unsigned kind)
{
    return kind >= ASI_JOB_READ_PARAMETER_STRING && kind <= ASI_JOB_MESSAGE;
}

static bool is_extended(const asi_job_t *job) { return asi_codes_id(job->codes) == ASI_ID_EXTENDED; }
static unsigned select_of(unsigned index) { return index >> 2 & ID1_SELECT; }

static asi_job_t *open_job(asi_ec_t *ec)
{
    if (ec->job.status == ASI_E_BUSY)
        return &ec->job;
    return ec->automatic.status == ASI_E_BUSY ? &ec->automatic : 0;
}

static void go(asi_job_t *job, unsigned step)
{
    job->step = (uint8_t)step;
    job->other = false;
    job->pause_us = 0;
}

static void pause_job(asi_job_t *job, uint32_t us)
{
    job->pause_from_us = asi_port_time_us();
    job->pause_us = us;
}

/** The slave writes its memory now; ask for its status. */
static void wait_for_memory(asi_job_t *job, unsigned step)
{
    go(job, step);
    job->since_us = asi_port_time_us();
    job->answered = false;
}

static bool memory_time_over(const asi_job_t *job) { return asi_port_time_us() - job->since_us >= ASI_NVM_US; }

static void lists_changed(asi_ec_t *ec)
{
    if (!ec->reactivate)
        ec_run_cycle(ec); /* LAS may have become empty, or not be empty any more */
    ec_update_flags(ec);
}

static void finish(asi_ec_t *ec, asi_job_t *job, asi_status_t status)
{
    const asi_list_t nobody = ASI_LIST_EMPTY;
    job->status = status;
    job->waiting = false;
    if (is_string(job->kind)) { /* bytes for the host: also what a slave said to a refused message */
        const bool answered = status == ASI_OK || status == ASI_E_DEVICE;
        job->length = answered && job->kind != ASI_JOB_WRITE_PARAMETER_STRING ? ec->ctt.string.length : 0u;
        asi_ctt_release(&ec->ctt, job->index, asi_port_time_us());
    }
    if (!asi_list_is_empty(&ec->held))
        ec_inclusion_hold(ec, &nobody);
    if (job->kind == ASI_JOB_AUTO_ADDRESS) {
        ec->auto_failed = status != ASI_OK;
        ec->auto_failed_us = asi_port_time_us();
    }
    if (job->kind == ASI_JOB_AUTO_ADDRESS || job->kind == ASI_JOB_CHANGE_ADDRESS)
        ec_log(ec, ASI_EVENT_ADDRESSED, job->value, job->index | (unsigned)-status << 8);
}

/* ------------------------------------------------------------------------------------------ addresses */

static void enter_list(asi_ec_t *ec, const asi_job_t *job, unsigned index)
{
    ec_enter_lds(ec, index, job->codes);
    if (job->no_id2)
        asi_list_add(&ec->no_id2, index);
    else
        asi_list_remove(&ec->no_id2, index);
    lists_changed(ec);
}

/** The slave is at address 0: the call that brings it on from there. */
static void from_zero(asi_ec_t *ec, asi_job_t *job)
{
    unsigned wanted = job->id1;
    if (job->kind == ASI_JOB_WRITE_ID1)
        wanted = is_extended(job) ? job->value | (job->id1 & ID1_SELECT) : job->value;
    else if (!job->rescue && is_extended(job) && job->target != 0u)
        wanted = (job->id1 & ~ID1_SELECT) | select_of(job->target);

    if (job->kind == ASI_JOB_WRITE_ID1 || job->id1_now != wanted) {
        job->wanted = (uint8_t)wanted;
        go(job, STEP_WRITE_ID1);
    } else if (job->target == 0u) {
        finish(ec, job, job->outcome);
    } else {
        go(job, STEP_ASSIGN);
    }
}

/** Begin to give the slave its old address and ID1 back; the job will end with this status (AD-004). */
static void rescue(asi_ec_t *ec, asi_job_t *job, asi_status_t status)
{
    job->outcome = status;
    job->rescue = true;
    job->target = job->index;
    job->tries = 0;
    from_zero(ec, job);
}

/** A way to the target failed: the rescue begins, or its next try. */
static void astray(asi_ec_t *ec, asi_job_t *job, asi_status_t status)
{
    if (job->kind == ASI_JOB_WRITE_ID1) {
        finish(ec, job, status);
    } else if (!job->rescue) {
        rescue(ec, job, status);
    } else if (++job->tries < ASI_RESCUE_TRIES) {
        from_zero(ec, job);
        pause_job(job, ASI_NVM_POLL_US);
    } else { /* wherever it is, inclusion finds it there */
        finish(ec, job, job->outcome);
    }
}

static void delete_done(asi_ec_t *ec, asi_job_t *job, bool good, unsigned data)
{
    (void)data;
    if (good) {
        job->at_zero = true;
        ec_leave_lds(ec, job->index);
        enter_list(ec, job, 0u);
    }
    ec->zero_sel = false; /* AD-007 */
    go(job, STEP_FIND);   /* without a good answer this tells whether the slave has heard */
}

/** The slave, and no other one, answered at address 0. */
static void found(asi_ec_t *ec, asi_job_t *job)
{
    if (!job->at_zero) { /* only the answer to Delete_Address was lost */
        job->at_zero = true;
        ec_leave_lds(ec, job->index);
        enter_list(ec, job, 0u);
    }
    from_zero(ec, job);
}

static void not_found(asi_ec_t *ec, asi_job_t *job)
{
    if (job->index == 0u) {
        finish(ec, job, ASI_E_READ_ID1);
    } else if (job->at_zero) {
        rescue(ec, job, ASI_E_READ_ID1);
    } else {
        rescue(ec, job, ASI_E_DELETE);
        go(job, STEP_LOOK); /* most likely it is where it was */
    }
}

static void find_done(asi_ec_t *ec, asi_job_t *job, bool good, unsigned data)
{
    if (good) {
        job->id1 = job->id1_now = (uint8_t)data;
        put_code(&job->codes, 8, data);
        found(ec, job);
    } else if (!is_extended(job)) {
        go(job, STEP_FIND_ID); /* a slave before 2.1 has no ID1 (EX-005) */
    } else if (!job->other) {
        ec->zero_sel = !ec->zero_sel;
        job->other = true;
    } else {
        not_found(ec, job);
    }
}

static void find_id_done(asi_ec_t *ec, asi_job_t *job, bool good, unsigned data)
{
    if (good && data == asi_codes_id(job->codes) && job->kind != ASI_JOB_WRITE_ID1)
        found(ec, job);
    else
        not_found(ec, job);
}

static void write_id1_done(asi_ec_t *ec, asi_job_t *job, bool good, unsigned data)
{
    (void)ec;
    (void)good; /* a lost answer and a refusal look alike: reading back tells */
    (void)data;
    job->id1_now = ID1_UNKNOWN;
    wait_for_memory(job, STEP_ID1_WRITTEN);
}

static void id1_written_done(asi_ec_t *ec, asi_job_t *job, bool good, unsigned data)
{
    const bool ready = good && !(data & 1u);
    if (!good && is_extended(job)) /* it may obey its new select */
        ec->zero_sel = !ec->zero_sel;
    if (!ready && !memory_time_over(job))
        pause_job(job, ASI_NVM_POLL_US);
    else if ((ready && !(data & 8u)) || job->rescue) /* the rescue is content with what does not last */
        go(job, STEP_ID1_READ);
    else
        astray(ec, job, ASI_E_ID1_TEMPORARY);
}

static void id1_read_done(asi_ec_t *ec, asi_job_t *job, bool good, unsigned data)
{
    if (good) {
        job->id1_now = (uint8_t)data;
        put_code(&job->codes, 8, data);
        enter_list(ec, job, 0u);
        if (job->kind == ASI_JOB_WRITE_ID1)
            job->data = (uint8_t)data;
        if (data != job->wanted) {
            astray(ec, job, ASI_E_WRITE_ID1);
        } else if (job->kind == ASI_JOB_WRITE_ID1) {
            finish(ec, job, ASI_OK);
        } else if (job->target == 0u) {
            finish(ec, job, job->outcome);
        } else {
            go(job, STEP_ASSIGN);
        }
    } else if (is_extended(job) && !job->other) {
        ec->zero_sel = !ec->zero_sel;
        job->other = true;
    } else {
        astray(ec, job, ASI_E_READ_ID1);
    }
}

/** The slave has the address of its target. */
static void assigned(asi_ec_t *ec, asi_job_t *job)
{
    if (asi_list_has(&ec->state.lds, 0u) && job->at_zero)
        ec_leave_lds(ec, 0u);
    enter_list(ec, job, job->target);
    wait_for_memory(job, STEP_STORED);
}

static void assign_done(asi_ec_t *ec, asi_job_t *job, bool good, unsigned data)
{
    (void)data;
    if (good)
        assigned(ec, job);
    else
        go(job, STEP_LOOK); /* only the answer may be lost */
}

static void look_done(asi_ec_t *ec, asi_job_t *job, bool good, unsigned data)
{
    if (good && data == asi_codes_id(job->codes))
        assigned(ec, job);
    else
        astray(ec, job, ASI_E_SET_ADDRESS);
}

/** WPAR and DEXG, when the slave may be active and is not (EX-008, EX-009). If they fail inclusion goes on trying. */
static void activate(asi_ec_t *ec, asi_job_t *job)
{
    if (asi_list_has(&ec->state.las, job->target) || !ec_may_activate(ec, job->target)) {
        finish(ec, job, job->outcome);
        return;
    }
    asi_port_forget(job->target); /* it may have been active before */
    go(job, STEP_ACTIVATE);
}

static void temporary(asi_ec_t *ec, asi_job_t *job)
{
    if (job->outcome == ASI_OK)
        job->outcome = ASI_E_ADDRESS_TEMPORARY;
    activate(ec, job);
}

static void stored_done(asi_ec_t *ec, asi_job_t *job, bool good, unsigned data)
{
    job->answered = job->answered || good;
    if (good && !(data & 1u)) {
        if (data & 8u)
            temporary(ec, job);
        else
            activate(ec, job);
    } else if (!memory_time_over(job)) {
        pause_job(job, ASI_NVM_POLL_US);
    } else if (job->answered) {
        temporary(ec, job);
    } else {
        go(job, STEP_LOOK_AGAIN);
    }
}

static void look_again_done(asi_ec_t *ec, asi_job_t *job, bool good, unsigned data)
{
    if (good && data == asi_codes_id(job->codes)) { /* it tells no status */
        temporary(ec, job);
        return;
    }
    ec_leave_lds(ec, job->target);
    lists_changed(ec);
    astray(ec, job, ASI_E_SET_ADDRESS);
}

static void activate_done(asi_ec_t *ec, asi_job_t *job, bool good, unsigned data)
{
    if (!good || !ec_may_activate(ec, job->target)) {
        finish(ec, job, job->outcome);
        return;
    }
    ec_set_echo(ec, job->target, (uint8_t)data);
    go(job, STEP_EXCHANGE);
}

static void exchange_done(asi_ec_t *ec, asi_job_t *job, bool good, unsigned data)
{
    (void)data;
    if (good && ec_may_activate(ec, job->target) && asi_list_has(&ec->state.lds, job->target) &&
        !asi_list_has(&ec->state.las, job->target)) {
        ec_enter_las(ec, job->target);
        lists_changed(ec);
    }
    finish(ec, job, job->outcome);
}

/* ------------------------------------------------------------------------------------------ single calls */

static void write_parameter_done(asi_ec_t *ec, asi_job_t *job, bool good, unsigned data)
{
    if (good) {
        ec_set_pi(ec, job->index, job->value);
        ec_set_echo(ec, job->index, (uint8_t)data);
        job->data = (uint8_t)data;
    }
    finish(ec, job, good ? ASI_OK : ASI_E_NO_ANSWER);
}

/** FN-022. A reset slave takes no data until it has got a parameter: it, or everybody, is activated anew. */
static void execute_done(asi_ec_t *ec, asi_job_t *job, bool good, unsigned data)
{
    const uint16_t call = asi_call_execute(job->index, job->value);
    const unsigned index = asi_call_index(call, false);
    if (call == ASI_CALL_BR01) {
        finish(ec, job, ASI_OK);
        ec_reactivate(ec, ASI_RESET_US);
        return;
    }
    job->data = (uint8_t)data;
    job->outcome = good ? ASI_OK : ASI_E_NO_ANSWER;
    if (good && data == ANSWER_RES && call == asi_call_command(ASI_CMD_RES, index) &&
        asi_list_has(&ec->state.las, index)) {
        asi_list_t held = ASI_LIST_EMPTY;
        asi_list_add(&held, index);
        ec_inclusion_hold(ec, &held); /* the job activates it, nobody else */
        job->target = (uint8_t)index;
        ec_leave_las(ec, index);
        lists_changed(ec);
        activate(ec, job);
        pause_job(job, ASI_RESET_US);
    } else {
        finish(ec, job, job->outcome);
    }
}

/* ------------------------------------------------------------------------------------------ strings */

static void string_end(asi_ec_t *ec, asi_job_t *job, asi_status_t status)
{
    job->outcome = status;
    job->tries = 0;
    if (job->kind == ASI_JOB_MESSAGE || !asi_list_has(&ec->state.las, job->index)) /* activation sets the parameter */
        finish(ec, job, status);
    else
        go(job, STEP_STRING_END);
}

static asi_status_t string_open(asi_ec_t *ec, const asi_job_t *job)
{
    static const uint8_t kinds[] = {ASI_STRING_READ, ASI_STRING_WRITE, ASI_STRING_DIAGNOSIS, ASI_STRING_ID,
                                    ASI_STRING_MESSAGE};
    return asi_ctt_string(&ec->ctt, job->index, (asi_string_kind_t)kinds[job->kind - ASI_JOB_READ_PARAMETER_STRING],
                          job->length, asi_port_time_us());
}

static void string_begin_done(asi_ec_t *ec, asi_job_t *job, bool good, unsigned data)
{
    asi_status_t status = ASI_E_NO_ANSWER;
    if (good) {
        ec_set_echo(ec, job->index, (uint8_t)data);
        status = ec->permanent.data_exchange ? string_open(ec, job) : ASI_E_ABORTED; /* it may have stopped meanwhile */
    }
    if (status == ASI_OK)
        go(job, STEP_STRING);
    else
        string_end(ec, job, status);
}

/** The engine moves the bytes with the cyclic calls; here only its end is awaited. */
static void string_watch(asi_ec_t *ec, asi_job_t *job)
{
    const asi_string_t *string = &ec->ctt.string;
    if (!string->open)
        string_end(ec, job, string->status);
}

static void string_end_done(asi_ec_t *ec, asi_job_t *job, bool good, unsigned data)
{
    const bool active = asi_list_has(&ec->state.las, job->index);
    if (good) {
        ec_set_echo(ec, job->index, (uint8_t)data);
    } else if (active && ++job->tries < ASI_RESCUE_TRIES) {
        pause_job(job, ASI_NVM_POLL_US);
        return;
    } else if (active) { /* it would go on talking of strings: inclusion activates it anew, with the right parameter */
        ec_leave_las(ec, job->index);
        lists_changed(ec);
    }
    finish(ec, job, job->outcome);
}

/* ------------------------------------------------------------------------------------------ the steps as a table */

typedef enum { TO_INDEX, TO_ZERO, TO_TARGET } receiver_t;
enum { CALL_EXECUTE = 0x20, CALL_WPAR, CALL_DEXG, CALL_WID1, CALL_ADRA, CALL_NONE }; /* beside asi_command_t */
#define ANY 16u

static const struct {
    uint8_t call, to;
    uint8_t answer; /* what the slave must answer */
    void (*done)(asi_ec_t *ec, asi_job_t *job, bool good, unsigned data);
} steps[] = {
    [STEP_WRITE_PARAMETER] = {CALL_WPAR, TO_INDEX, ANY, write_parameter_done},
    [STEP_EXECUTE] = {CALL_EXECUTE, TO_INDEX, ANY, execute_done},
    [STEP_DELETE] = {ASI_CMD_DELA, TO_INDEX, ANSWER_ZERO, delete_done},
    [STEP_FIND] = {ASI_CMD_RID1, TO_ZERO, ANY, find_done},
    [STEP_FIND_ID] = {ASI_CMD_RDID, TO_ZERO, ANY, find_id_done},
    [STEP_WRITE_ID1] = {CALL_WID1, TO_ZERO, ANSWER_ZERO, write_id1_done},
    [STEP_ID1_WRITTEN] = {ASI_CMD_RDST, TO_ZERO, ANY, id1_written_done},
    [STEP_ID1_READ] = {ASI_CMD_RID1, TO_ZERO, ANY, id1_read_done},
    [STEP_ASSIGN] = {CALL_ADRA, TO_ZERO, ANSWER_ADRA, assign_done},
    [STEP_LOOK] = {ASI_CMD_RDID, TO_TARGET, ANY, look_done},
    [STEP_STORED] = {ASI_CMD_RDST, TO_TARGET, ANY, stored_done},
    [STEP_LOOK_AGAIN] = {ASI_CMD_RDID, TO_TARGET, ANY, look_again_done},
    [STEP_ACTIVATE] = {CALL_WPAR, TO_TARGET, ANY, activate_done},
    [STEP_EXCHANGE] = {CALL_DEXG, TO_TARGET, ANY, exchange_done},
    [STEP_STRING_BEGIN] = {CALL_WPAR, TO_INDEX, ANY, string_begin_done},
    [STEP_STRING] = {CALL_NONE, TO_INDEX, ANY, 0},
    [STEP_STRING_END] = {CALL_WPAR, TO_INDEX, ANY, string_end_done},
};

static unsigned parameter_of(const asi_ec_t *ec, const asi_job_t *job)
{
    static const uint8_t select[] = {ASI_CTT1_PAR_RD, ASI_CTT1_PAR_WR, ASI_CTT1_PAR_DIAG, ASI_CTT1_PAR_ID};
    switch (job->step) {
    case STEP_WRITE_PARAMETER: return job->value;
    case STEP_STRING_BEGIN: return select[job->kind - ASI_JOB_READ_PARAMETER_STRING];
    case STEP_STRING_END: return ASI_CTT1_PAR_DATA;
    default: return ec_parameter(ec, job->target);
    }
}

static void send_call(asi_ec_t *ec, asi_job_t *job)
{
    const unsigned kind = steps[job->step].call, to = steps[job->step].to;
    unsigned index = to == TO_INDEX ? job->index : to == TO_TARGET ? job->target : 0u;
    bool no_reply = false;
    uint16_t call;
    switch (kind) {
    case CALL_EXECUTE:
        call = asi_call_execute(job->index, job->value);
        no_reply = call == ASI_CALL_BR01;
        index = no_reply ? 0u : asi_call_index(call, false);
        break;
    case CALL_WPAR: call = asi_call_wpar(index, parameter_of(ec, job), ec_is_extended(ec, index)); break;
    case CALL_DEXG: call = asi_call_dexg(index, 15u, ec_is_extended(ec, index)); break;
    case CALL_WID1: call = asi_call_wid1(job->wanted); break;
    case CALL_ADRA: call = asi_call_adra(job->target & 31u); break;
    default: call = asi_call_command((asi_command_t)kind, to == TO_ZERO && ec->zero_sel ? 32u : index); break;
    }
    job->waiting = true;
    ec_manage(ec, ASI_OWNER_JOB, call, index, no_reply ? 0u : ASI_CMD_RETRY, no_reply);
}

/** Send the job's next call, if it is due and the slot is free. */
static void advance(asi_ec_t *ec)
{
    asi_job_t *job = open_job(ec);
    if (job && job->step == STEP_STRING)
        string_watch(ec, job);
    if (!job || job->status != ASI_E_BUSY || job->step == STEP_STRING || job->waiting || ec->owner != ASI_OWNER_NONE ||
        ec->reactivate)
        return;
    if (asi_port_time_us() - job->pause_from_us < job->pause_us)
        return;
    if (job->step == STEP_STRING_BEGIN && !asi_ctt_hold(&ec->ctt, job->index)) { /* the value under way first */
        if (asi_port_time_us() - job->since_us >= ASI_CTT1_TIMEOUT_MS * 1000u)
            finish(ec, job, ASI_E_TRANSFER);
        return;
    }
    send_call(ec, job);
}

void ec_job_result(asi_ec_t *ec, const asi_result_t *result)
{
    asi_job_t *job = open_job(ec);
    if (!job || !job->waiting)
        return;
    const unsigned answer = steps[job->step].answer;
    const bool good = result->error == ASI_ERR_OK && (answer == ANY || result->data == answer);
    job->waiting = false;
    steps[job->step].done(ec, job, good, result->data);
    advance(ec);
}

void ec_job_abort(asi_ec_t *ec)
{
    asi_job_t *job = open_job(ec);
    ec->held = ASI_LIST_EMPTY; /* inclusion has ended before */
    if (job)
        finish(ec, job, ASI_E_ABORTED);
    ec->auto_failed = false; /* slave 0 is not to blame: no wait (AD-009) */
}

/* ------------------------------------------------------------------------------------------ beginning */

static void begin(asi_ec_t *ec, asi_job_t *job, asi_job_kind_t kind, unsigned index, unsigned value, unsigned step)
{
    const uint8_t id1 = (uint8_t)(ec->state.cdi[index] >> 8 & 15u);
    asi_list_t held = ASI_LIST_EMPTY;
    *job = (asi_job_t){.kind = (uint8_t)kind, .index = (uint8_t)index, .value = (uint8_t)value, .status = ASI_E_BUSY,
                       .codes = ec->state.cdi[index], .no_id2 = asi_list_has(&ec->no_id2, index),
                       .id1 = id1, .id1_now = id1, .since_us = asi_port_time_us()};
    if (step == STEP_DELETE || step == STEP_FIND) {
        asi_list_add(&held, 0u);
        asi_list_add(&held, index);
        job->at_zero = index == 0u;
        if (kind != ASI_JOB_WRITE_ID1) {
            job->target = (uint8_t)value;
            asi_list_add(&held, value);
        }
        ec_inclusion_hold(ec, &held);
    }
    go(job, step);
}

/** Addresses that the slave with these codes takes from its own upward: 1, or those of a combined transaction 5. */
static unsigned width_of(uint16_t codes)
{
    const unsigned id2 = (unsigned)codes >> 12;
    return (codes & 0xFFu) == 0x06u && id2 >= 0xAu && id2 <= 0xCu ? id2 - 8u : 1u;
}

/** Whether one of the further addresses of a wide slave at `index` would belong to another slave (AD-001, AD-009). */
static bool overlaps(const asi_ec_t *ec, uint16_t codes, unsigned from, unsigned index)
{
    const unsigned width = width_of(codes);
    for (unsigned k = 1; k < width; k++) {
        const unsigned i = index + k;
        const bool own = from != 0u && i >= from && i < from + width;
        if (i > 31u || (!own && (asi_list_has(&ec->state.lds, i) || asi_list_has(&ec->state.lds, i + 32u))))
            return true;
    }
    return false;
}

static bool is_slave(unsigned index)
{
    const asi_list_t slaves = ASI_LIST_SLAVES;
    return index < ASI_INDICES && asi_list_has(&slaves, index);
}

/** AD-001 */
static asi_status_t check_change(const asi_ec_t *ec, unsigned from, unsigned to)
{
    const asi_list_t *lds = &ec->state.lds;
    const unsigned number = to & 31u, twin = to ^ 32u;
    const bool extended = from < ASI_INDICES && asi_codes_id(ec->state.cdi[from]) == ASI_ID_EXTENDED;
    if (!asi_list_has(lds, from))
        return ASI_E_NOT_DETECTED;
    if (to > 31u && !extended)
        return ASI_E_ARG; /* a standard slave has no select */
    if (from != 0u && asi_list_has(lds, 0u))
        return ASI_E_SLAVE0;
    if (asi_list_has(lds, to))
        return ASI_E_ADDRESS_USED;
    if ((ec->permanent.auto_clear & ASI_AUTO_CLEAR_MISSING) && asi_list_has(&ec->permanent.projection.lps, from))
        return ASI_E_AUTO_CLEAR_MODE; /* it would be missing at once: OFFLINE in the middle of the way */
    if (to != 0u && twin != from && asi_list_has(lds, twin) && (!extended || (to > 31u && !ec_is_extended(ec, number))))
        return ASI_E_ADDRESS_USED; /* a standard and an A/B slave on one number */
    return to != 0u && overlaps(ec, ec->state.cdi[from], from, to) ? ASI_E_ADDRESS_USED : ASI_OK;
}

/** What is wrong with the arguments whatever the line does. */
static asi_status_t check_arguments(const asi_ec_t *ec, asi_job_kind_t kind, unsigned index, unsigned value,
                                    unsigned length)
{
    bool good;
    switch (kind) {
    case ASI_JOB_WRITE_PARAMETER: good = is_slave(index) && value <= (ec_is_extended(ec, index) ? 7u : 15u); break;
    case ASI_JOB_CHANGE_ADDRESS:
        good = (index == 0u || is_slave(index)) && (value == 0u || is_slave(value)) && index != value;
        break;
    case ASI_JOB_EXECUTE: good = asi_call_execute(index, value) != 0u; break;
    case ASI_JOB_WRITE_ID1: /* bit 3 of an A/B slave's ID1 belongs to its address */
        good = index == 0u && value <= (asi_codes_id(ec->state.cdi[0]) == ASI_ID_EXTENDED ? 7u : 15u);
        break;
    default:
        good = is_string((unsigned)kind) && is_slave(index);
        if (good && kind == ASI_JOB_WRITE_PARAMETER_STRING && length > ASI_CTT1_STRING_BYTES)
            return ASI_E_OVERFLOW;
        if (kind == ASI_JOB_WRITE_PARAMETER_STRING)
            good = good && length != 0u && asi_ctt_whole_sequences(length);
        if (good && kind == ASI_JOB_MESSAGE && length > ASI_CTT2_MESSAGE_BYTES)
            return ASI_E_OVERFLOW;
        break;
    }
    return good ? ASI_OK : ASI_E_ARG;
}

static asi_status_t check_state(const asi_ec_t *ec)
{
    if (ec->apf)
        return ASI_E_POWER;
    if (ec->offline)
        return ASI_E_OFFLINE;
    if (ec->state.phase != ASI_PHASE_DATA_EXCHANGE || ec->reactivate)
        return ASI_E_STATE;
    return asi_fn_busy(ec) ? ASI_E_BUSY : ASI_OK;
}

/** What the slave, or the place of the function, must be like. */
static asi_status_t check_slave(const asi_ec_t *ec, asi_job_kind_t kind, unsigned index, unsigned value)
{
    switch (kind) {
    case ASI_JOB_CHANGE_ADDRESS: return check_change(ec, index, value);
    case ASI_JOB_EXECUTE: return ASI_OK;
    case ASI_JOB_WRITE_ID1: return asi_list_has(&ec->state.lds, 0u) ? ASI_OK : ASI_E_NOT_DETECTED;
    default: break;
    }
    if (!asi_list_has(&ec->state.las, index))
        return ASI_E_NOT_ACTIVE;
    if (is_string((unsigned)kind) && !ec->permanent.data_exchange)
        return ASI_E_STATE; /* the bytes move with the data */
    if (kind == ASI_JOB_WRITE_PARAMETER)
        return ec_has_strings(ec, index) ? ASI_E_PROFILE : ASI_OK;
    if (kind == ASI_JOB_MESSAGE)
        return asi_ctt_kind(ec->state.cdi[index]) == ASI_CTT_2 ? ASI_OK : ASI_E_PROFILE;
    return ec_has_strings(ec, index) ? ASI_OK : ASI_E_PROFILE;
}

asi_status_t asi_fn_start(asi_ec_t *ec, asi_job_kind_t kind, unsigned index, unsigned value, unsigned length)
{
    unsigned step = STEP_STRING_BEGIN;
    asi_status_t status = check_arguments(ec, kind, index, value, length);
    if (status == ASI_OK)
        status = check_state(ec);
    if (status == ASI_OK)
        status = check_slave(ec, kind, index, value);
    if (status != ASI_OK)
        return status;
    switch (kind) {
    case ASI_JOB_WRITE_PARAMETER: step = STEP_WRITE_PARAMETER; break;
    case ASI_JOB_CHANGE_ADDRESS: step = index ? STEP_DELETE : STEP_FIND; break;
    case ASI_JOB_EXECUTE: step = STEP_EXECUTE; break;
    case ASI_JOB_WRITE_ID1: step = STEP_FIND; break;
    default: break;
    }
    asi_job_t before = ec->job;
    begin(ec, &ec->job, kind, index, value, step);
    ec->job.length = (uint16_t)length;
    if (kind == ASI_JOB_MESSAGE) { /* needs no parameter */
        status = string_open(ec, &ec->job);
        go(&ec->job, STEP_STRING);
        if (status != ASI_OK) {
            ec->job = before;
            return status;
        }
    }
    advance(ec);
    return ASI_OK;
}

/** AD-008, AD-009: the slave at address 0 is the missing one but for its address. -> index, or 64 */
static unsigned wanted_address(const asi_ec_t *ec)
{
    const asi_projection_t *p = &ec->permanent.projection;
    const uint32_t needed = ASI_FLAG_AUTO_ADDRESS_AVAILABLE | ASI_FLAG_LDS0;
    if ((ec->state.flags & needed) != needed)
        return ASI_INDICES;
    const asi_list_t missing = asi_list_without(&p->lps, &ec->state.lds);
    const unsigned index = asi_list_next(&missing, 0u);
    const uint16_t codes = ec->state.cdi[0];
    const bool extended = asi_codes_id(codes) == ASI_ID_EXTENDED;
    const unsigned differs = (unsigned)codes ^ p->pcd[index];
    if ((differs & (extended ? 0xF7FFu : 0xFFFFu)) != 0u)
        return ASI_INDICES;
    return check_change(ec, 0u, index) == ASI_OK ? index : ASI_INDICES;
}

void ec_job_cycle(asi_ec_t *ec)
{
    if (!asi_fn_busy(ec)) {
        if (!(ec->state.flags & ASI_FLAG_LDS0))
            ec->auto_failed = false;
        if (ec->auto_failed && asi_port_time_us() - ec->auto_failed_us >= ASI_AUTO_WAIT_US)
            ec->auto_failed = false;
        const unsigned index = ec->auto_failed || ec->reactivate ? ASI_INDICES : wanted_address(ec);
        if (index < ASI_INDICES)
            begin(ec, &ec->automatic, ASI_JOB_AUTO_ADDRESS, 0u, index, STEP_FIND);
    }
    advance(ec);
}
