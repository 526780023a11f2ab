/* SPDX-License-Identifier: Apache-2.0 */
/** @file asi_window.c */
#include "asi_window.h"
#include "asi_diag.h"
#include "asi_hal.h"
#include "asi_hw.h"
#include "hal_vexriscv.h"

#define WIN(name) WINDOW(uint32_t, name)
#define ALL_CONTROLS (HOST_CTRL_R__PROTECTED_MODE_bm | HOST_CTRL_R__OFFLINE_bm | HOST_CTRL_R__DATA_EXCHANGE_bm | \
                      HOST_CTRL_R__AUTO_ADDRESS_ENABLE_bm | HOST_CTRL_R__MONITOR_bm)

static asi_projection_t projections[2]; /* the core keeps the one in use; a commit fills the other */
static unsigned in_use;
static uint32_t in_seq, fw_seq, shown_version;

const asi_projection_t *asi_window_init(void)
{
    WIN(MAGIC)[0] = 0;
    for (unsigned w = 1; w < offsetof(asi_host_t, CDI) / 4u; w++)
        WIN(MAGIC)[w] = 0;
    asi_diag_init();
    WIN(VERSION)[0] = ASI_VERSION;
    WIN(HOST_CTRL)[0] = HOST_CTRL_R__DATA_EXCHANGE_bm;
    for (unsigned i = 0; i < ASI_INDICES; i++) {
        WINDOW(uint16_t, PCD)[i] = ASI_CODES_NONE;
        WINDOW(uint8_t, PP)[i] = 15;
        projections[0].pcd[i] = ASI_CODES_NONE;
        projections[0].pp[i] = 15;
    }
    return &projections[0];
}

void asi_window_take_outputs(asi_ec_t *ec)
{
    uint32_t image[ASI_IMAGE_WORDS];
    for (unsigned w = 0; w < ASI_IMAGE_WORDS; w++)
        image[w] = WIN(OUT_IMG)[w];
    asi_ec_set_outputs(ec, image);
}

static void show_list(volatile uint32_t *to, const asi_list_t *list)
{
    to[0] = list->w[0];
    to[1] = list->w[1];
}

bool asi_window_is_stale(const asi_ec_t *ec)
{
    return asi_ec_state(ec)->version != shown_version;
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
    if (asi_window_is_stale(ec)) {
        shown_version = s->version;
        WIN(FLAGS)[0] = s->flags;
        WIN(PHASE)[0] = (uint32_t)s->phase;
        show_list(WIN(LDS), &s->lds);
        show_list(WIN(LAS), &s->las);
        show_list(WIN(LPS), &projections[in_use].lps);
        show_list(WIN(LPF), &s->lpf);
        for (unsigned i = asi_list_next(&s->changed, 0); i < ASI_INDICES; i = asi_list_next(&s->changed, i + 1u)) {
            WINDOW(uint16_t, CDI)[i] = s->cdi[i];
            WINDOW(uint8_t, PI)[i] = s->pi[i];
            WINDOW(uint8_t, PECHO)[i] = s->pecho[i];
        }
        asi_ec_changes_taken(ec);
    }
    WIN(IN_SEQ)[0] = ++in_seq;
    hal_host_interrupt();
}

void asi_window_open(asi_ec_t *ec)
{
    asi_window_publish(ec);
    WIN(MAGIC)[0] = ASI_MAGIC;
}

bool asi_window_serve(asi_ec_t *ec)
{
    const uint32_t seq = WIN(HOST_SEQ)[0];
    if (seq == fw_seq)
        return false;

    const unsigned next = in_use ^ 1u;
    asi_projection_t *p = &projections[next];
    const uint32_t controls = WIN(HOST_CTRL)[0];
    p->lps = (asi_list_t){{WIN(LPS_CFG)[0], WIN(LPS_CFG)[1]}};
    for (unsigned i = 0; i < ASI_INDICES; i++) {
        p->pcd[i] = WINDOW(uint16_t, PCD)[i];
        p->pp[i] = WINDOW(uint8_t, PP)[i];
    }
    if (WIN(HOST_SEQ)[0] != seq)
        return true; /* what was copied may be half of the next commit */

    asi_status_t status = (controls & ~(uint32_t)ALL_CONTROLS) ? ASI_E_ARG : asi_ec_check_projection(p);
    hal_irq_off();
    if (status == ASI_OK)
        status = asi_ec_set_projection(ec, p);
    if (status == ASI_OK) {
        in_use = next;
        /* ST-007: a monitor is silent */
        asi_ec_set_offline(ec, (controls & (HOST_CTRL_R__OFFLINE_bm | HOST_CTRL_R__MONITOR_bm)) != 0u);
        asi_ec_set_mode(ec, (controls & HOST_CTRL_R__PROTECTED_MODE_bm) != 0u);
        asi_window_take_outputs(ec); /* data exchange may begin */
        asi_ec_set_data_exchange(ec, (controls & HOST_CTRL_R__DATA_EXCHANGE_bm) != 0u);
        asi_ec_set_auto_address(ec, (controls & HOST_CTRL_R__AUTO_ADDRESS_ENABLE_bm) != 0u);
        asi_window_publish(ec);
    }
    if (status == ASI_OK)
        asi_diag_commit((controls & HOST_CTRL_R__MONITOR_bm) != 0u);
    fw_seq = seq;
    WIN(FW_RESULT)[0] = (uint32_t)status;
    WIN(FW_SEQ)[0] = seq; /* last: the host waits for it */
    hal_irq_on();
    return false;
}
