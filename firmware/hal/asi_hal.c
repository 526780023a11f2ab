/* SPDX-License-Identifier: Apache-2.0 */
/** @file asi_hal.c  The port of the core on registers and link RAM, and the events. */
#include "asi_hal.h"
#include "asi_hw.h"
#include "hal_vexriscv.h"

_Static_assert(HAL_CYCLE_DONE == ASI_REGS__EVENT__CYCLE_DONE_bm && HAL_BATCH_DONE == ASI_REGS__EVENT__BATCH_DONE_bm &&
               HAL_SLAVE_LOST == ASI_REGS__EVENT__SLAVE_LOST_bm && HAL_APF_CHANGE == ASI_REGS__EVENT__APF_CHANGE_bm &&
               HAL_TICK == ASI_REGS__EVENT__TICK_bm && HAL_HOST_ATTN == ASI_REGS__EVENT__HOST_ATTN_bm &&
               HAL_EFAULT_CHANGE == ASI_REGS__EVENT__EFAULT_CHANGE_bm &&
               HAL_EXCHANGE_DONE == ASI_REGS__EVENT__EXCHANGE_DONE_bm &&
               HAL_ALL_EVENTS == ASI_REGS__EVENT_EN__MASK_bm, "rdl/asi.rdl and asi_hal.h differ");

static uint32_t ctrl;      /* CTRL as written */
static asi_list_t slots;   /* SLOT.active as written */
static uint32_t wanted;    /* events that raise the interrupt */
static asi_list_t live_slots;
static uint32_t live_mask[ASI_IMAGE_WORDS]; /* their nibbles */
static unsigned batch_len;
static asi_result_t results[ASI_INDICES];

static uint32_t request_word(const asi_request_t *request)
{
    return request->call | (request->no_reply ? REQUEST_R__NO_REPLY_bm : 0u) | (request->sel ? REQUEST_R__SEL_bm : 0u) |
           (uint32_t)request->retries << REQUEST_R__RETRIES_bp | (uint32_t)request->tag << REQUEST_R__TAG_bp;
}

static asi_result_t result_of(uint32_t word)
{
    return (asi_result_t){.data = word & RESULT_R__DATA_bm,
                          .error = (uint8_t)((word & RESULT_R__LAST_bm) >> RESULT_R__LAST_bp),
                          .tag = (uint8_t)((word & RESULT_R__TAG_bm) >> RESULT_R__TAG_bp)};
}

/* ------------------------------------------------------------------------------------------ port of the core */

void asi_port_line(bool on)
{
    ctrl = on ? ctrl | ASI_REGS__CTRL__LINE_EN_bm : ctrl & ~(uint32_t)ASI_REGS__CTRL__LINE_EN_bm;
    REG(CTRL) = ctrl;
}

bool asi_port_idle(void)
{
    return (REG(STATUS) & (ASI_REGS__STATUS__BATCH_BUSY_bm | ASI_REGS__STATUS__CYCLE_BUSY_bm)) == 0u;
}

void asi_port_batch(const asi_request_t *requests, unsigned n)
{
    REG(EVENT) = HAL_BATCH_DONE; /* of a batch that was given up */
    for (unsigned k = 0; k < n; k++)
        LINK(BATCH)[k] = request_word(&requests[k]);
    batch_len = n;
    REG(BATCH) = n;
}

void asi_port_cycle(const asi_cycle_mode_t *mode)
{
    const bool starts = mode && !(ctrl & ASI_REGS__CTRL__CYCLE_EN_bm);
    ctrl &= ASI_REGS__CTRL__LINE_EN_bm;
    if (mode)
        ctrl |= ASI_REGS__CTRL__CYCLE_EN_bm | (mode->two_extra ? ASI_REGS__CTRL__TWO_EXTRA_bm : 0u) |
                (mode->read_id ? ASI_REGS__CTRL__READ_ID_bm : 0u) |
                (uint32_t)mode->min_cycle_us << ASI_REGS__CTRL__MIN_CYCLE_US_bp;
    if (starts) { /* nothing of an earlier session may show: the sequencer is idle, so its words are ours */
        REG(EVENT) = HAL_CYCLE_DONE | HAL_SLAVE_LOST | HAL_EXCHANGE_DONE;
        LINK(MGMT_REQ)[0] = LINK(MGMT_RES)[0] & RESULT_R__TAG_bm; /* withdraws an open request */
        for (unsigned w = 0; w < ASI_IMAGE_WORDS; w++) {
            LINK(IN_WORK)[w] = 0;
            LINK(IN_IMG)[w] = 0;
        }
    }
    REG(CTRL) = ctrl;
}

void asi_port_slot(unsigned index, bool active, bool extended, bool live)
{
    if (live != asi_list_has(&live_slots, index)) {
        live_mask[asi_word(index)] ^= 15u << asi_shift(index);
        if (live)
            asi_list_add(&live_slots, index);
        else
            asi_list_remove(&live_slots, index);
        /* without one the core is spared an interrupt per cycle */
        wanted = asi_list_is_empty(&live_slots) ? HAL_ALL_EVENTS & ~(uint32_t)HAL_EXCHANGE_DONE : HAL_ALL_EVENTS;
        if (REG(EVENT_EN) != 0u)
            REG(EVENT_EN) = wanted;
    }
    if (active) {
        asi_list_add(&slots, index);
        LINK(SLOT_STATE)[index] = 0; /* before active: the sequencer skips a slot with a full streak */
    } else {
        asi_list_remove(&slots, index);
    }
    LINK(SLOT)[index] = (active ? SLOT_R__ACTIVE_bm : 0u) | (extended ? SLOT_R__EXTENDED_bm : 0u) |
                        (live ? SLOT_R__LIVE_bm : 0u);
}

void asi_port_live(unsigned index, unsigned nibble)
{
    const unsigned w = asi_word(index), shift = asi_shift(index);
    LINK(OUT_IMG)[w] = (LINK(OUT_IMG)[w] & ~(15u << shift)) | (nibble & 15u) << shift;
}

asi_slot_state_t asi_port_slot_state(unsigned index)
{
    const uint32_t word = LINK(SLOT_STATE)[index];
    return (asi_slot_state_t){.data = word & SLOT_STATE_R__DATA_bm,
                              .error = (uint8_t)((word & SLOT_STATE_R__LAST_bm) >> SLOT_STATE_R__LAST_bp),
                              .sent = (uint8_t)((word & SLOT_STATE_R__SENT_bm) >> SLOT_STATE_R__SENT_bp),
                              .calls = (uint8_t)(word >> SLOT_STATE_R__CALLS_bp)};
}

uint32_t asi_port_time_us(void)
{
    return REG(TIME);
}

/** Inputs of a word of slots as they should stand in IN_WORK: last answers of the slots that are called. */
static uint32_t inputs_of(unsigned word)
{
    uint32_t inputs = 0;
    for (unsigned i = 8u * word; i < 8u * word + 8u; i++) {
        const uint32_t state = asi_list_has(&slots, i) ? LINK(SLOT_STATE)[i] : 0u;
        if ((state & SLOT_STATE_R__STREAK_bm) >> SLOT_STATE_R__STREAK_bp < ASI_FAIL_CYCLES)
            inputs |= (state & SLOT_STATE_R__DATA_bm) << asi_shift(i);
    }
    return inputs;
}

/** The sequencer keeps the nibble of a slot that was switched off (LK-005). It writes the neighbours while we do, but
 * SLOT_STATE and IN_WORK without a free clock between: what holds after our write was written. */
void asi_port_forget(unsigned index)
{
    uint32_t inputs = inputs_of(asi_word(index)), written;
    do {
        written = inputs;
        LINK(IN_WORK)[asi_word(index)] = written;
        inputs = inputs_of(asi_word(index));
    } while (inputs != written); /* once more at most: a call takes longer */
}

void asi_port_management(const asi_request_t *request)
{
    LINK(MGMT_REQ)[0] = request_word(request);
}

void asi_port_inclusion(const asi_request_t *request)
{
    LINK(INCL_REQ)[0] = request ? request_word(request) | REQUEST_R__VALID_bm : 0u;
}

void asi_port_outputs(const uint32_t image[ASI_IMAGE_WORDS])
{
    REG(CTRL) = ctrl | ASI_REGS__CTRL__OUT_HOLD_bm; /* a cycle that starts meanwhile keeps its last snapshot */
    for (unsigned w = 0; w < ASI_IMAGE_WORDS; w++)
        LINK(OUT_IMG)[w] = (image[w] & ~live_mask[w]) | (LINK(OUT_IMG)[w] & live_mask[w]);
    REG(CTRL) = ctrl;
}

void asi_port_phase(asi_phase_t phase)
{
    REG(EXEC) = (uint32_t)phase;
}

/* ------------------------------------------------------------------------------------------ application */

void hal_init(void)
{
    REG(EVENT_EN) = 0;
    wanted = HAL_ALL_EVENTS & ~HAL_EXCHANGE_DONE;
    ctrl = 0;
    REG(CTRL) = 0;
    while (!asi_port_idle()) { /* only after a restart of the program: the open batch or cycle runs out */
    }
    for (unsigned w = 0; w < sizeof(asi_link_ram_t) / 4u; w++)
        LINK(SLOT)[w] = 0;
    REG(EVENT) = HAL_ALL_EVENTS;
}

void hal_start(void)
{
    REG(EVENT_EN) = wanted;
    hal_irq_unmask();
    hal_irq_on();
}

uint32_t hal_take_events(void)
{
    const uint32_t events = REG(EVENT);
    REG(EVENT) = events;
    return events;
}

unsigned hal_batch_results(const asi_result_t **out)
{
    for (unsigned k = 0; k < batch_len; k++)
        results[k] = result_of(LINK(BATCH)[k]);
    *out = results;
    return batch_len;
}

void hal_cycle_report(asi_cycle_report_t *report)
{
    for (unsigned attempt = 0; attempt < 2u; attempt++) { /* a cycle that ended while we read: read again, once */
        const uint32_t cycle = LINK(CYCLES)[0];
        for (unsigned w = 0; w < ASI_IMAGE_WORDS; w++)
            report->in[w] = LINK(IN_IMG)[w];
        report->management = result_of(LINK(MGMT_RES)[0]);
        report->inclusion = result_of(LINK(INCL_RES)[0]);
        if (LINK(CYCLES)[0] == cycle)
            break;
    }
}

asi_list_t hal_lost_slaves(void)
{
    asi_list_t lost = ASI_LIST_EMPTY;
    for (unsigned i = asi_list_next(&slots, 0u); i < ASI_INDICES; i = asi_list_next(&slots, i + 1u)) {
        if ((LINK(SLOT_STATE)[i] & SLOT_STATE_R__STREAK_bm) >> SLOT_STATE_R__STREAK_bp >= ASI_FAIL_CYCLES)
            asi_list_add(&lost, i);
    }
    return lost;
}

bool hal_apf(void)
{
    return (REG(STATUS) & ASI_REGS__STATUS__APF_bm) != 0u;
}

hal_counters_t hal_counters(void)
{
    return (hal_counters_t){.cycles = LINK(CYCLES)[0], .sent = LINK(SENT)[0], .repeated = LINK(REPEATED)[0],
                            .failed = LINK(FAILED)[0]};
}

const volatile uint32_t *hal_stat(unsigned index)
{
    return (const volatile uint32_t *)(ASI_STATS_BASE + 4u * HAL_STAT_WORDS * index);
}

const volatile uint32_t *hal_stat_take(unsigned index)
{
    return (const volatile uint32_t *)(ASI_STATS_CLEAR_BASE + 4u * HAL_STAT_WORDS * index);
}

uint32_t hal_line_faults(void)
{
    const uint32_t status = REG(STATUS);
    return (status & ASI_REGS__STATUS__APF_bm ? 1u : 0u) | (status & ASI_REGS__STATUS__EFAULT_bm ? 2u : 0u) |
           REG(LATCH) << 8; /* jabber has no actual state: the guard lets go by itself */
}

void hal_forget_line_faults(void)
{
    REG(LATCH) = ASI_REGS__LATCH__APF_bm | ASI_REGS__LATCH__EFAULT_bm | ASI_REGS__LATCH__JABBER_bm;
}

static uint32_t monitor_tail;

void hal_monitor(bool on)
{
    REG(MONITOR_CTRL) = 0;
    REG(MONITOR_CTRL) = ASI_REGS__MONITOR_CTRL__CLEAR_bm;
    monitor_tail = 0;
    REG(MONITOR_CTRL) = on ? ASI_REGS__MONITOR_CTRL__ENABLE_bm : 0u;
}

bool hal_monitor_take(uint32_t words[2])
{
    const uint32_t head = (REG(MONITOR) & ASI_REGS__MONITOR__HEAD_bm) >> ASI_REGS__MONITOR__HEAD_bp;
    const volatile uint32_t *record = (const volatile uint32_t *)(ASI_RING_BASE + 8u * monitor_tail);
    if (head == monitor_tail)
        return false;
    words[0] = record[0];
    words[1] = record[1];
    monitor_tail = (monitor_tail + 1u) % ASI_RING_RECORDS;
    REG(MONITOR_CTRL) = ASI_REGS__MONITOR_CTRL__ENABLE_bm | monitor_tail << ASI_REGS__MONITOR_CTRL__TAIL_bp;
    return true;
}

uint32_t hal_monitor_lost(void)
{
    return (REG(MONITOR) & ASI_REGS__MONITOR__LOST_bm) >> ASI_REGS__MONITOR__LOST_bp;
}

uint32_t hal_clock_mhz(void)
{
    return REG(CLOCK) & ASI_REGS__CLOCK__MHZ_bm;
}

void hal_host_interrupt(void)
{
    REG(HOST_IRQ) = 1;
}

void hal_leave_time(void)
{
    if (REG(EVENT) & HAL_CYCLE_DONE)
        REG(EVENT_EN) = wanted & ~(uint32_t)HAL_CYCLE_DONE;
}

void hal_sleep(void)
{
    hal_irq_off(); /* hal_leave_time may not come between the question and WAIT; WAIT ends without the interrupt too */
    if (REG(EVENT_EN) == wanted)
        (void)REG(WAIT);
    REG(EVENT_EN) = wanted;
    hal_irq_on();
}

extern uint32_t _stack_guard[]; /* firmware.ld; startup.S writes the pattern */

bool hal_stack_intact(void)
{
    return *(volatile uint32_t *)_stack_guard == 0x57AC6A4Du;
}

_Noreturn void hal_fatal(void)
{
    hal_irq_off();
    REG(CTRL) = 0;
    WINDOW(uint32_t, MAGIC)[0] = 0;
    for (;;) {
    }
}
