/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_hal.h  Registers, link RAM and interrupts for the application. asi_hal.c also holds the port of the core.
 * Context: everything but hal_init, hal_sleep and hal_fatal runs in the interrupt or with it masked.
 */
#ifndef ASI_HAL_H
#define ASI_HAL_H
#include <stdbool.h>
#include <stdint.h>
#include "asi_port.h"
#include "asi_ec.h"

/** Events, bits of EVENT. */
enum {
    HAL_CYCLE_DONE = 1u << 0,
    HAL_BATCH_DONE = 1u << 1,
    HAL_SLAVE_LOST = 1u << 2,
    HAL_APF_CHANGE = 1u << 3,
    HAL_TICK = 1u << 4,
    HAL_HOST_ATTN = 1u << 5,
    HAL_EFAULT_CHANGE = 1u << 6,
    HAL_EXCHANGE_DONE = 1u << 7,
    HAL_ALL_EVENTS = 0xFFu,
};

typedef struct { uint32_t cycles, sent, repeated, failed; } hal_counters_t;

/** Line quiet, link RAM cleared, no events; the interrupt stays masked. */
void hal_init(void);
/** Enable all events and unmask the interrupt. */
void hal_start(void);
/** Take what happened: the bits are cleared before this returns, so what is read afterwards is at least as new. */
uint32_t hal_take_events(void);
/** Results of the batch that ended, in order of the requests. @return their number */
unsigned hal_batch_results(const asi_result_t **results);
/** Results and inputs of the last cycle. */
void hal_cycle_report(asi_cycle_report_t *report);
/** Active slaves that are no longer called. */
asi_list_t hal_lost_slaves(void);
/** Filtered power fail. */
bool hal_apf(void);
hal_counters_t hal_counters(void);
enum { HAL_STAT_WORDS = 16 };
/** Statistics of an index, HAL_STAT_WORDS words of stat_r in rdl/asi.rdl; each word is right, two of them may be an
 * attempt apart. */
const volatile uint32_t *hal_stat(unsigned index);
/** The same, and reading a word clears it; no count is lost (ST-004). */
const volatile uint32_t *hal_stat_take(unsigned index);
/** Line faults: bits 0..2 actual, 8..10 latched: APF, earth fault, jabber (LT-017). */
uint32_t hal_line_faults(void);
/** Forget the latched line faults; what is still there comes back at once. */
void hal_forget_line_faults(void);
/** Record all telegrams of the line, or stop. Starts with an empty ring. Main loop. */
void hal_monitor(bool on);
/** Oldest record of the ring, words of telegram_r in rdl/asi.rdl. Main loop. @return false: there is none */
bool hal_monitor_take(uint32_t words[2]);
/** Records that found the ring full since hal_monitor. */
uint32_t hal_monitor_lost(void);
/** Clocks per us: the unit of delays and deviations. */
uint32_t hal_clock_mhz(void);
/** Raise the host's interrupt. */
void hal_host_interrupt(void);
/** End of the interrupt: when the next cycle has ended already, it waits until the main loop has been round once, so
 * that the shortest cycles on the slowest clock do not keep the host's commits from being served (HW-002). */
void hal_leave_time(void);
/** Sleep until an event is pending, and let it be served; when a cycle waits for the main loop, only the latter.
 * Main loop, with the interrupt open. */
void hal_sleep(void);
/** False when the stack has run over its guard. */
bool hal_stack_intact(void);
/** The program is broken: line off, window marked dead (MAGIC 0), for ever. */
_Noreturn void hal_fatal(void);
#endif
