// SPDX-License-Identifier: Apache-2.0
// A program for the storage test on the whole Verilated chip: firmware/core/asi_store.c, its flash driver and the HAL's
// SPI port, and a mailbox at the end of the dual-port memory. Sets are made from a seed. Built by test_store_chip.py.
#include <stdint.h>
#include "asi_hw.h"
#include "asi_store.h"

typedef struct {
    volatile uint32_t op;       // host: command; core: 0 when done. 1 store this set, 2 is this the set read at start?
    volatile uint32_t seed, opaque;
    volatile uint32_t result;   // 1 yes, 0 no
    volatile uint32_t sequence;
    volatile uint32_t state;    // asi_store_state_t + 0x600D0000, written when the start is over
    volatile uint32_t open_us;  // time the start took
    volatile uint32_t longest_us, steps;  // of the steps of the last store
} mailbox_t;

#define MAIL ((mailbox_t *)0x40003F00u)

static asi_store_t store;
static asi_permanent_set_t loaded, given;
static uint32_t dice_state;

int main(void);
void asi_interrupt(void);
void hal_fatal(void);

void asi_interrupt(void) {}
void hal_fatal(void) { for (;;) {} }

static uint32_t dice(void)
{
    dice_state ^= dice_state << 13;
    dice_state ^= dice_state >> 17;
    dice_state ^= dice_state << 5;
    return dice_state;
}

static void make(uint32_t seed, uint32_t opaque)
{
    dice_state = seed;
    asi_permanent_t *m = &given.master;
    m->projection.lps = (asi_list_t){{dice() & ~1u, dice() & ~1u}};
    for (unsigned i = 0; i < ASI_INDICES; i++) {
        m->projection.pcd[i] = (uint16_t)dice();
        m->projection.pp[i] = dice() & 15u;
    }
    m->protected_mode = dice() & 1u;
    m->auto_address = dice() & 1u;
    m->data_exchange = dice() & 1u;
    m->auto_clear = dice() & 3u;
    given.opaque_length = (uint16_t)opaque;
    for (uint32_t k = 0; k < opaque; k++)
        given.opaque[k] = (uint8_t)dice();
}

static uint32_t is_loaded(void)
{
    const asi_permanent_t *a = &given.master, *b = &loaded.master;
    uint32_t same = store.state == ASI_STORE_LOADED && asi_list_equal(&a->projection.lps, &b->projection.lps) &&
                    a->protected_mode == b->protected_mode && a->auto_address == b->auto_address &&
                    a->data_exchange == b->data_exchange && a->auto_clear == b->auto_clear &&
                    given.opaque_length == loaded.opaque_length;
    for (unsigned i = 0; i < ASI_INDICES && same; i++)
        same = a->projection.pcd[i] == b->projection.pcd[i] && a->projection.pp[i] == b->projection.pp[i];
    for (unsigned k = 0; k < given.opaque_length && same; k++)
        same = given.opaque[k] == loaded.opaque[k];
    return same;
}

static uint32_t run_store(void)
{
    MAIL->longest_us = MAIL->steps = 0;
    if (asi_store_begin(&store, &given) != ASI_OK)
        return 0;
    while (store.busy) {
        const uint32_t start = REG(TIME);
        asi_store_serve(&store, start);
        const uint32_t took = REG(TIME) - start;
        if (took > MAIL->longest_us)
            MAIL->longest_us = took;
        MAIL->steps++;
    }
    return store.saved;
}

int main(void)
{
    const uint32_t start = REG(TIME);
    MAIL->op = 0;
    asi_store_open(&store, &loaded);
    MAIL->open_us = REG(TIME) - start;
    MAIL->sequence = store.sequence;
    MAIL->state = 0x600D0000u + store.state;
    for (;;) {
        if (MAIL->op == 0u)
            continue;
        make(MAIL->seed, MAIL->opaque);
        MAIL->result = MAIL->op == 1u ? run_store() : is_loaded();
        MAIL->sequence = store.sequence;
        MAIL->op = 0;
    }
}
