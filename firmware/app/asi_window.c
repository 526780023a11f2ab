/* SPDX-License-Identifier: Apache-2.0 */
/** @file asi_window.c */
#include "asi_window.h"
#include "asi_diag.h"
#include "asi_functions.h"
#include "asi_hal.h"
#include "asi_hw.h"
#include "asi_persist.h"
#include "hal_vexriscv.h"

#define WIN(name) WINDOW(uint32_t, name)
#define ALL_CONTROLS (HOST_CTRL_R__PROTECTED_MODE_bm | HOST_CTRL_R__OFFLINE_bm | HOST_CTRL_R__DATA_EXCHANGE_bm | \
                      HOST_CTRL_R__AUTO_ADDRESS_ENABLE_bm | HOST_CTRL_R__MONITOR_bm | HOST_CTRL_R__AUTO_CLEAR_bm)
#define STRING_BYTES sizeof(((asi_host_t *)0)->FN_STRING)

/** Functions of the mailbox that are not in the list of 30. */
enum { FN_SET_AUTO_CLEAR = 33 };

static uint32_t longest_us, in_seq, fw_seq, fn_seq, shown_version, shown_log, shown_permanent, analog_numbers;
static bool fn_open;   /* a function with telegrams is under way */
static bool monitor;
static bool host_offline; /* what HOST_CTRL.offline says; the monitor keeps the line off without it */

/* ------------------------------------------------------------------------------------------ start */

static void show_controls(const asi_permanent_t *p)
{
    WIN(HOST_CTRL)[0] = (p->protected_mode ? HOST_CTRL_R__PROTECTED_MODE_bm : 0u) |
                        (host_offline ? HOST_CTRL_R__OFFLINE_bm : 0u) |
                        (p->data_exchange ? HOST_CTRL_R__DATA_EXCHANGE_bm : 0u) |
                        (p->auto_address ? HOST_CTRL_R__AUTO_ADDRESS_ENABLE_bm : 0u) |
                        (monitor ? HOST_CTRL_R__MONITOR_bm : 0u) |
                        (uint32_t)p->auto_clear << HOST_CTRL_R__AUTO_CLEAR_bp;
}

static void show_permanent(const asi_permanent_t *p)
{
    show_controls(p);
    WIN(LPS_CFG)[0] = p->projection.lps.w[0];
    WIN(LPS_CFG)[1] = p->projection.lps.w[1];
    for (unsigned i = 0; i < ASI_INDICES; i++) {
        WINDOW(uint16_t, PCD)[i] = p->projection.pcd[i];
        WINDOW(uint8_t, PP)[i] = p->projection.pp[i];
    }
}

void asi_window_init(const asi_permanent_t *permanent)
{
    for (unsigned w = 0; w < offsetof(asi_host_t, STAT) / 4u; w++)
        WIN(MAGIC)[w] = 0;
    asi_diag_init();
    WIN(VERSION)[0] = ASI_VERSION;
    show_permanent(permanent);
}

void asi_window_open(asi_ec_t *ec)
{
    asi_window_publish(ec);
    WIN(STORE)[0] = asi_persist_word();
    WIN(MAGIC)[0] = ASI_MAGIC;
}

/* ------------------------------------------------------------------------------------------ every cycle */

void asi_window_take_outputs(asi_ec_t *ec)
{
    uint32_t image[ASI_IMAGE_WORDS];
    for (unsigned w = 0; w < ASI_IMAGE_WORDS; w++)
        image[w] = WIN(OUT_IMG)[w];
    asi_fn_write_odi(ec, image);
    if (!asi_ctt_any(&ec->ctt))
        return;
    const volatile uint32_t *from = WIN(AODI); /* a word is two values: each is whole (CT-002) */
    uint16_t *to = ec->ctt.ao;
    for (uint32_t numbers = analog_numbers; numbers != 0u; numbers >>= 1, from += 2, to += 4) {
        if (numbers & 1u) {
            const uint32_t low = from[0], high = from[1];
            to[0] = (uint16_t)low;
            to[1] = (uint16_t)(low >> 16);
            to[2] = (uint16_t)high;
            to[3] = (uint16_t)(high >> 16);
        }
    }
}

static void show_list(volatile uint32_t *to, const asi_list_t *list)
{
    to[0] = list->w[0];
    to[1] = list->w[1];
}

bool asi_window_is_stale(const asi_ec_t *ec)
{
    return asi_ec_state(ec)->version != shown_version || ec->log.head != shown_log;
}

static void show_analog(asi_ec_t *ec)
{
    asi_list_t *changed = &ec->ctt.changed;
    for (unsigned i = asi_list_next(changed, 0u); i < ASI_INDICES; i = asi_list_next(changed, i + 1u)) {
        const unsigned word = asi_analog_word(i), words = (i & 32u) ? 2u : 4u;
        for (unsigned w = word; w < word + words; w++)
            WINDOW(uint16_t, AIDI)[w] = ec->ctt.ai[w];
        WINDOW(uint8_t, CTT_STATE)[i] = ec->ctt.status[i];
    }
    *changed = ASI_LIST_EMPTY;
    show_list(WIN(SAFE_IN), &ec->ctt.safe_in[0]);
    show_list(WIN(SAFE_IN) + 2, &ec->ctt.safe_in[1]);
}

static void show_log(const asi_log_t *log)
{
    if (log->head - shown_log > ASI_LOG_ENTRIES)
        shown_log = log->head - ASI_LOG_ENTRIES;
    for (; shown_log != log->head; shown_log++) {
        const unsigned n = shown_log % ASI_LOG_ENTRIES;
        const asi_log_entry_t *e = &log->ring[n];
        WIN(LOG)[2u * n] = e->time_us;
        WIN(LOG)[2u * n + 1u] = e->event | (uint32_t)e->index << 8 | (uint32_t)e->data << 16;
    }
    WIN(LOG_HEAD)[0] = shown_log; /* last */
}

/** EX-033: the end state of auto clear lasts until the host leaves the offline phase, so no commit may do that in
 * passing. Before the host sees the phase, and one bit at once: it may be preparing a commit. */
static void follow_auto_clear(const asi_ec_t *ec)
{
    if (host_offline || monitor || !asi_fn_controls(ec).offline)
        return;
    host_offline = true;
    WIN(HOST_CTRL)[0] |= HOST_CTRL_R__OFFLINE_bm;
}

/** What seldom changes: lists, codes, history, log. */
static void show_state(asi_ec_t *ec)
{
    const asi_ec_state_t *s = asi_ec_state(ec);
    shown_version = s->version;
    follow_auto_clear(ec);
    WIN(FLAGS)[0] = s->flags;
    WIN(PHASE)[0] = (uint32_t)s->phase;
    show_list(WIN(LDS), &s->lds);
    show_list(WIN(LAS), &s->las);
    show_list(WIN(LPS), &asi_fn_projection(ec)->lps);
    show_list(WIN(LPF), &s->lpf);
    show_list(WIN(SUSPECTS), &s->suspects);
    show_list(WIN(CHANGED_SLAVES), &s->changed_slaves);
    WIN(CHANGED_TIME)[0] = s->changed_us;
    WIN(OFFLINE_CAUSES)[0] = s->offline_causes;
    WIN(OFFLINE_TIME)[0] = s->offline_us;
    for (unsigned i = asi_list_next(&s->changed, 0); i < ASI_INDICES; i = asi_list_next(&s->changed, i + 1u)) {
        WINDOW(uint16_t, CDI)[i] = s->cdi[i];
        WINDOW(uint8_t, PI)[i] = s->pi[i];
        WINDOW(uint8_t, PECHO)[i] = s->pecho[i];
    }
    asi_ec_changes_taken(ec);
    analog_numbers = ec->ctt.live.w[0] | ec->ctt.live.w[1] | ec->ctt.groups;
    show_log(&ec->log);
}

void asi_window_publish(asi_ec_t *ec)
{
    const asi_ec_state_t *s = asi_ec_state(ec);
    const hal_counters_t counters = hal_counters();
    WIN(IN_SEQ)[0] = ++in_seq;
    for (unsigned w = 0; w < ASI_IMAGE_WORDS; w++)
        WIN(IN_IMG)[w] = s->in[w];
    WIN(CYCLES)[0] = counters.cycles;
    WIN(SENT)[0] = counters.sent;
    WIN(REPEATED)[0] = counters.repeated;
    WIN(FAILED)[0] = counters.failed;
    WIN(TIME_US)[0] = asi_port_time_us();
    if (asi_ctt_any(&ec->ctt) || !asi_list_is_empty(&ec->ctt.changed))
        show_analog(ec);
    if (asi_window_is_stale(ec))
        show_state(ec);
    WIN(IN_SEQ)[0] = ++in_seq;
    hal_host_interrupt();
}

void asi_window_show_load(uint32_t us)
{
    if (us > longest_us) {
        longest_us = us;
        WIN(CORE_LOAD)[0] = us;
    }
}

/* ------------------------------------------------------------------------------------------ commits */

/** Permanent data to flash, when it changed; the interrupt is masked by the caller. */
static void keep_permanent(const asi_ec_t *ec)
{
    if (asi_ec_state(ec)->permanent_version == shown_permanent)
        return;
    shown_permanent = asi_ec_state(ec)->permanent_version;
    asi_persist_request(&ec->permanent);
    WIN(STORE)[0] = asi_persist_word(); /* before the answer: who has that never reads `saved` of the data before */
}

/** @return true: what was copied may be half of the next commit */
static bool serve_commit(asi_ec_t *ec)
{
    static asi_projection_t p;
    const uint32_t seq = WIN(HOST_SEQ)[0];
    if (seq == fw_seq)
        return false;
    p.lps = (asi_list_t){{WIN(LPS_CFG)[0], WIN(LPS_CFG)[1]}};
    for (unsigned i = 0; i < ASI_INDICES; i++) {
        p.pcd[i] = WINDOW(uint16_t, PCD)[i];
        p.pp[i] = WINDOW(uint8_t, PP)[i];
    }
    asi_status_t status = asi_check_projection(&p);
    hal_irq_off();
    const uint32_t word = WIN(HOST_CTRL)[0]; /* with auto clear's bit, if that has just stopped the line */
    if (WIN(HOST_SEQ)[0] != seq) {
        hal_irq_on();
        return true;
    }

    const bool monitors = (word & HOST_CTRL_R__MONITOR_bm) != 0u; /* ST-007: a monitor is silent */
    const bool offline = (word & HOST_CTRL_R__OFFLINE_bm) != 0u;
    const asi_controls_t controls = {
        .protected_mode = (word & HOST_CTRL_R__PROTECTED_MODE_bm) != 0u,
        .offline = offline || monitors,
        .data_exchange = (word & HOST_CTRL_R__DATA_EXCHANGE_bm) != 0u,
        .auto_address = (word & HOST_CTRL_R__AUTO_ADDRESS_ENABLE_bm) != 0u,
        .auto_clear = (word & HOST_CTRL_R__AUTO_CLEAR_bm) >> HOST_CTRL_R__AUTO_CLEAR_bp,
    };
    if (word & ~(uint32_t)ALL_CONTROLS)
        status = ASI_E_ARG;
    asi_window_take_outputs(ec); /* data exchange may begin */
    if (status == ASI_OK)
        status = asi_fn_set_controls(ec, &controls);
    if (status == ASI_OK) {
        monitor = monitors;
        host_offline = offline;
        status = asi_fn_set_projection(ec, &p);
        asi_window_publish(ec);
        keep_permanent(ec);
        asi_diag_commit(monitor);
    }
    fw_seq = seq;
    WIN(FW_RESULT)[0] = (uint32_t)status;
    WIN(FW_SEQ)[0] = seq; /* last: the host waits for it */
    hal_irq_on();
    return false;
}

/* ------------------------------------------------------------------------------------------ functions (HW-008) */

/** 17, 18, 19, 21, 33: one of the controls. */
static asi_status_t set_control(asi_ec_t *ec, unsigned code, uint32_t value)
{
    asi_controls_t c = asi_fn_controls(ec);
    const bool on = value == 1u;
    asi_status_t status;
    if (code == 18u ? value != 1u && value != 2u : code == FN_SET_AUTO_CLEAR ? value > 3u : value > 1u)
        return ASI_E_ARG;
    switch (code) {
    case 17u: c.protected_mode = on; break;
    case 18u: c.offline = on || monitor; break; /* ST-007: in a monitor it says what comes after it */
    case 19u: c.data_exchange = on; break;
    case 21u: c.auto_address = on; break;
    default: c.auto_clear = (uint8_t)value; break;
    }
    status = asi_fn_set_controls(ec, &c);
    if (status == ASI_OK && code == 18u)
        host_offline = on;
    return status;
}

/** @return ASI_E_BUSY: it needs telegrams and has begun; else what it ends with. The interrupt is masked. */
static asi_status_t start_function(asi_ec_t *ec, unsigned code, uint32_t a, uint32_t b, uint32_t length)
{
    const asi_list_t list = {{a, b}};
    asi_status_t status;
    switch (code) {
    case 3u: return asi_fn_set_permanent_parameter(ec, a, b);
    case 7u: asi_fn_store_actual_parameters(ec); return ASI_OK;
    case 8u: return asi_fn_set_permanent_configuration(ec, a, b);
    case 10u: return asi_fn_store_actual_configuration(ec);
    case 12u: return asi_fn_set_lps(ec, &list);
    case 17u: case 18u: case 19u: case 21u: case FN_SET_AUTO_CLEAR: return set_control(ec, code, a);
    case ASI_JOB_WRITE_ID1: b = a; a = 0; break; /* its one argument is the value */
    case ASI_JOB_WRITE_PARAMETER: case ASI_JOB_CHANGE_ADDRESS: case ASI_JOB_EXECUTE: case ASI_JOB_READ_PARAMETER_STRING:
    case ASI_JOB_WRITE_PARAMETER_STRING: case ASI_JOB_READ_DIAGNOSIS_STRING: case ASI_JOB_READ_ID_STRING:
    case ASI_JOB_MESSAGE: break;
    default: return ASI_E_ARG;
    }
    status = asi_fn_start(ec, (asi_job_kind_t)code, a, b, length);
    return status == ASI_OK ? ASI_E_BUSY : status;
}

static void end_function(asi_status_t status, uint32_t data, uint32_t length)
{
    WIN(FN_LEN)[0] = length;
    WIN(FN_STATUS)[0] = (uint32_t)status;
    WIN(FN_DATA)[0] = data;
    WIN(FN_DONE)[0] = fn_seq; /* last */
}

static void end_job(const asi_job_t *job, const asi_string_t *string)
{
    unsigned length = 0;
    if (job->kind >= ASI_JOB_READ_PARAMETER_STRING && job->kind <= ASI_JOB_MESSAGE && job->length <= STRING_BYTES)
        length = job->length;
    for (unsigned k = 0; k < length; k++)
        WINDOW(uint8_t, FN_STRING)[k] = string->bytes[k];
    end_function(job->status, job->data, length);
}

static void serve_function(asi_ec_t *ec)
{
    const asi_job_t *job = asi_fn_job(ec);
    asi_string_t *string = &ec->ctt.string;
    if (fn_open) {
        if (job->status == ASI_E_BUSY)
            return;
        fn_open = false;
        if (WIN(FN_SEQ)[0] == fn_seq) /* else the words are the next function's, and nobody waits for this answer */
            end_job(job, string);
    }
    const uint32_t seq = WIN(FN_SEQ)[0];
    if (seq == fn_seq)
        return;
    const uint32_t code = WIN(FN_CODE)[0], a = WIN(FN_ARG)[0], b = WIN(FN_ARG)[1], length = WIN(FN_LEN)[0];
    asi_status_t status = ASI_E_OVERFLOW;
    if (length <= sizeof string->bytes && length <= STRING_BYTES) {
        if (code == ASI_JOB_WRITE_PARAMETER_STRING || code == ASI_JOB_MESSAGE) /* no job is open: the buffer is ours */
            for (unsigned k = 0; k < length; k++)
                string->bytes[k] = WINDOW(uint8_t, FN_STRING)[k];
        hal_irq_off();
        if (asi_fn_busy(ec)) { /* automatic addressing, which begins in the interrupt: the function waits */
            hal_irq_on();
            return;
        }
        asi_window_take_outputs(ec); /* as in a commit */
        status = start_function(ec, code, a, b, length);
        if (asi_ec_state(ec)->permanent_version != shown_permanent || (code == 18u && status == ASI_OK))
            show_permanent(&ec->permanent); /* the host's own words follow: its next commit keeps the change */
        keep_permanent(ec);
        if (asi_window_is_stale(ec))
            asi_window_publish(ec);
        hal_irq_on();
    }
    fn_seq = seq;
    fn_open = status == ASI_E_BUSY;
    if (!fn_open)
        end_function(status, 0u, 0u);
}

bool asi_window_serve(asi_ec_t *ec)
{
    if (serve_commit(ec))
        return true;
    serve_function(ec);
    WIN(STORE)[0] = asi_persist_word();
    return false;
}
