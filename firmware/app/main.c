/* SPDX-License-Identifier: Apache-2.0 */
/** @file main.c  Line work in the interrupt; the host's commits and functions, diagnosis and storage in the main
 * loop. */
#include "asi_diag.h"
#include "asi_hal.h"
#include "asi_hw.h"
#include "asi_persist.h"
#include "asi_window.h"
#include "hal_vexriscv.h"

static asi_ec_t ec;
static uint32_t last_us;

void asi_interrupt(void);

/** The one interrupt (startup.S). Bounded: each event is served once, at most 64 results, slaves or codes each. */
void asi_interrupt(void)
{
    const uint32_t began = asi_port_time_us();
    const bool cycling = asi_ec_state(&ec)->phase == ASI_PHASE_DATA_EXCHANGE;
    const uint32_t events = hal_take_events();
    bool publish = false;

    if (events & HAL_APF_CHANGE)
        asi_ec_power(&ec, hal_apf()); /* first: what a power fail has spoilt is not to be used */
    if (events & HAL_EXCHANGE_DONE)
        asi_ec_exchange_done(&ec); /* before anything that takes time: the next calls are near */
    if (events & HAL_BATCH_DONE) {
        const asi_result_t *results;
        const unsigned n = hal_batch_results(&results);
        asi_window_take_outputs(&ec); /* the first cycle may follow: it sends what the host wants now, not what it did */
        (void)asi_ec_batch_done(&ec, results, n); /* refused: a batch that was given up */
    }
    if (events & HAL_SLAVE_LOST) {
        const asi_list_t lost = hal_lost_slaves();
        (void)asi_ec_slave_lost(&ec, &lost);
    }
    if (events & HAL_CYCLE_DONE) {
        asi_cycle_report_t report;
        hal_cycle_report(&report);
        asi_window_take_outputs(&ec);
        publish = asi_ec_cycle_done(&ec, &report) == ASI_OK; /* else: the last cycle before OFFLINE */
    }
    if (events & HAL_TICK) {
        const uint32_t now = asi_port_time_us();
        asi_ec_tick(&ec, now - last_us);
        last_us = now;
        if (!hal_stack_intact())
            hal_fatal();
    }
    /* outside running cycles a change of phase, flags or lists is news enough */
    if (publish || (asi_ec_state(&ec)->phase != ASI_PHASE_DATA_EXCHANGE && asi_window_is_stale(&ec)))
        asi_window_publish(&ec);
    if (cycling)
        asi_window_show_load(asi_port_time_us() - began);
    hal_leave_time();
}

/** Permanent data, step by step; the log tells how it ended. */
static void serve_storage(void)
{
    asi_status_t result;
    asi_persist_serve();
    if (!asi_persist_ended(&result) || (asi_persist_word() & STORE_R__STATE_bm) == 0u)
        return; /* without a flash the state says enough */
    hal_irq_off();
    asi_log_put(&ec.log, asi_port_time_us(), ASI_EVENT_STORED, 0u, (unsigned)-result);
    hal_irq_on();
}

int main(void)
{
    hal_init();
    const asi_permanent_t *permanent = asi_persist_open(); /* NV-009: before the first telegram */
    if (asi_ec_init(&ec, permanent) != ASI_OK)
        asi_persist_refuse(); /* factory settings, and the window shows them */
    asi_log_put(&ec.log, asi_port_time_us(), ASI_EVENT_START, 0u, asi_persist_word() & STORE_R__STATE_bm);
    asi_window_init(&ec.permanent);
    asi_ec_power(&ec, hal_apf());
    last_us = asi_port_time_us();
    asi_window_open(&ec);
    hal_start();
    for (;;) {
        while (asi_window_serve(&ec)) {
        }
        asi_diag_serve(&ec);
        serve_storage();
        hal_sleep();
    }
}
