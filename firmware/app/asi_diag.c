/* SPDX-License-Identifier: Apache-2.0 */
/** @file asi_diag.c */
#include "asi_diag.h"
#include "asi_hal.h"
#include "asi_hw.h"
#include "hal_vexriscv.h"

#define WIN(name) WINDOW(uint32_t, name)
#define RING_RECORDS (sizeof(((asi_host_t *)0)->RING) / 8u)
#define STAT_PERIOD_US 1024u
#define TAKE_MAX 64u /* records in one call, so that commits are served in between */

static bool monitoring, gap; /* gap: records were lost before the next one */
static uint32_t head, dropped, last_us, stat_index;

void asi_diag_init(void)
{
    WIN(LINE_FAULTS)[0] = 0;
    WIN(RING_HEAD)[0] = 0;
    WIN(RING_TAIL)[0] = 0;
    WIN(RING_LOST)[0] = 0;
    WIN(CLOCK_MHZ)[0] = hal_clock_mhz();
    for (unsigned w = 0; w < HAL_STAT_WORDS * ASI_INDICES; w++)
        WIN(STAT)[w] = 0;
}

void asi_diag_commit(bool monitor)
{
    hal_forget_line_faults();
    if (monitor == monitoring)
        return;
    monitoring = monitor;
    hal_monitor(monitor);
    if (monitor) {
        head = 0;
        dropped = 0;
        gap = false;
        WIN(RING_HEAD)[0] = 0;
        WIN(RING_TAIL)[0] = 0;
        WIN(RING_LOST)[0] = 0;
    }
}

/** ST-008: a full ring loses the newest telegrams; the host moves RING_TAIL. */
static void show_telegrams(void)
{
    uint32_t record[2];
    for (unsigned k = 0; k < TAKE_MAX && hal_monitor_take(record); k++) {
        const uint32_t next = (head + 1u) % RING_RECORDS;
        if (next == WIN(RING_TAIL)[0] % RING_RECORDS) {
            dropped++;
            gap = true;
            continue;
        }
        WIN(RING)[2u * head] = record[0];
        WIN(RING)[2u * head + 1u] = record[1] | (gap ? RECORD_R__LOST_bm : 0u);
        gap = false;
        head = next;
        WIN(RING_HEAD)[0] = head; /* last */
    }
    WIN(RING_LOST)[0] = dropped + hal_monitor_lost();
}

/** The statistics of an index to the window; what is new of them to the core, for the suspicion of duplicates. */
static void show_statistics(asi_ec_t *ec, volatile uint32_t *shown)
{
    const volatile uint32_t *counted = hal_stat(stat_index);
    uint32_t news[3] = {0, 0, 0}; /* good, silent, garbled */
    for (unsigned k = 0; k < HAL_STAT_WORDS; k++) {
        const uint32_t value = counted[k];
        if (value != shown[k]) {
            if (k < ASI_ERR_EARLY)
                news[k < 2u ? k : 2u] += value - shown[k];
            shown[k] = value;
        }
    }
    if (news[0] == 0u && news[2] == 0u)
        return; /* nothing that could change anything */
    hal_irq_off();
    asi_ec_quality(ec, stat_index, news[0], news[1], news[2]);
    hal_irq_on();
}

void asi_diag_serve(asi_ec_t *ec)
{
    const uint32_t now = asi_port_time_us();
    if (monitoring)
        show_telegrams();
    if (now - last_us < STAT_PERIOD_US)
        return;
    last_us = now;
    WIN(LINE_FAULTS)[0] = hal_line_faults();
    show_statistics(ec, WIN(STAT) + HAL_STAT_WORDS * stat_index);
    stat_index = (stat_index + 1u) % ASI_INDICES;
}
