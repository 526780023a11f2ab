/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file fuzz.c  The core fed with what a string of bytes says: slaves, answers, reports that do not fit, host functions.
 * Under the address and undefined-behaviour sanitizers, so it is a program of its own.
 * With libFuzzer (FUZZ_LIBFUZZER, `make fuzz`) the bytes are found by coverage. Else: fuzz SEED INPUTS runs random
 * strings, fuzz FILE... runs those; exit 0 when all held; prints how many cycles of normal operation there were.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "native.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static const uint8_t *bytes;
static size_t left;
static uint16_t plant[64];        /* codes of the slaves, 0: none */
static uint8_t streak[64];
static unsigned raw;              /* so many answers come from the bytes */
static uint32_t answers, in[8];
static uint32_t batches, managements;
static fw_result management, inclusion;
static long cycles;

static unsigned take(void)
{
    if (left == 0)
        return 0;
    left--;
    return *bytes++;
}

static void check(int holds, const char *what)
{
    if (!holds) {
        printf("fails: %s\n", what);
        fflush(stdout);
        abort();
    }
}

/** Answer to a call: from the bytes, or as a slave with these codes would. */
static fw_result answer(uint16_t call, unsigned sel, uint8_t tag)
{
    const unsigned index = (call >> 5 & 31u) + 32u * sel;
    const uint16_t codes = plant[index];
    unsigned data = answers & 15u;
    if (raw != 0u) {
        const unsigned b = take();
        raw--;
        return (fw_result){.data = b & 15u, .error = (uint8_t)(b >> 4), .tag = tag};
    }
    answers = answers * 1664525u + 1013904223u + (answers >> 16);
    if (codes == 0u)
        return (fw_result){.error = 1, .tag = tag};
    if ((call & 0x414u) == 0x410u) /* RDIO RDID RID1 RID2 */
        data = codes >> 4u * (call & 3u) & 15u;
    else if ((call & 0x414u) == 0x414u) /* RDST, RES */
        data = call & 2u ? data & 2u : 6u;
    return (fw_result){.data = (uint8_t)data, .tag = tag};
}

static void run_batch(fw_port *p)
{
    fw_result results[64] = {0};
    for (unsigned k = 0; k < p->batch_len; k++)
        results[k] = answer(p->batch[k].call, p->batch[k].sel, 0);
    batches = p->batches;
    p->idle = 1;
    fw_batch_done(results, p->batch_len);
}

static void run_cycle(fw_port *p)
{
    uint32_t lost[2] = {0, 0};
    for (unsigned i = 1; i < 64; i++) {
        if (!p->active[i]) {
            streak[i] = 0;
            continue;
        }
        const fw_result r = answer((uint16_t)((i & 31u) << 5 | p->live_nibble[i]), i >> 5, 0);
        p->time_us += 154;
        p->slot_error[i] = r.error;
        p->slot_sent[i] = p->live_nibble[i];
        p->slot_calls[i] = (p->slot_calls[i] + 1) & 15;
        streak[i] = r.error ? (uint8_t)(streak[i] + 1) : 0;
        if (!r.error)
            p->slot_data[i] = r.data;
        if (streak[i] >= 3) {
            p->slot_data[i] = 0;
            lost[i >> 5] |= 1u << (i & 31u);
        }
        in[i >> 3] = (in[i >> 3] & ~(15u << (i & 7u) * 4u)) | (uint32_t)p->slot_data[i] << (i & 7u) * 4u;
    }
    if (lost[0] | lost[1])
        fw_slave_lost(lost);
    fw_exchange_done();
    if (managements != p->managements) {
        managements = p->managements;
        management = answer(p->management.call, p->management.sel, p->management.tag);
    } else if (p->inclusion_valid) {
        inclusion = answer(p->inclusion.call, p->inclusion.sel, p->inclusion.tag);
    }
    if (!p->cycle)
        p->idle = 1;
    fw_cycle_done(management, inclusion, in);
    cycles++;
}

/** What the sequencer does next, or time. */
static void go_on(fw_port *p)
{
    if (!p->line) {
        p->idle = 1;
        batches = p->batches;
        managements = p->managements;
    }
    if (p->line && batches != p->batches)
        run_batch(p);
    else if (p->line && !p->idle)
        run_cycle(p);
    else {
        p->time_us += 1024;
        fw_tick(1024);
    }
}

static int projection(void)
{
    uint32_t lps[2] = {0, 0};
    uint16_t pcd[64];
    uint8_t pp[64];
    const unsigned how = take();
    for (unsigned i = 0; i < 64; i++) {
        pcd[i] = plant[i] ? plant[i] : 0xFFFF;
        pp[i] = (uint8_t)(how >> 4);
        if (plant[i] && i != 0u)
            lps[i >> 5] |= 1u << (i & 31u);
    }
    if (how & 1u)
        lps[how >> 1 & 1u] ^= 1u << (take() & 31u);
    if (how & 4u)
        pcd[take() & 63u] = (uint16_t)(take() << 8 | 1u);
    if (how & 8u)
        pp[take() & 63u] = (uint8_t)take();
    return fw_set_projection(lps, pcd, pp);
}

/** A function of the host. -> status */
static int function(void)
{
    const unsigned which = take();
    uint8_t text[256];
    switch (which & 7u) {
    case 0: return fw_set_pp(take(), take() & 31u);
    case 1: return fw_set_pcd(take(), take() << 8 | take());
    case 2: {
        const uint32_t lps[2] = {take() << 1, take() << 1 | take() << 20};
        return fw_set_lps(lps);
    }
    case 3: return fw_store_configuration();
    case 4: fw_store_parameters(); return 0;
    case 5: return projection();
    case 6: fw_set_ao(take(), take() * 0x101u); return 0;
    default:
        memset(text, (int)take(), sizeof text);
        return fw_start((int)(which >> 3), take(), take(), text, take());
    }
}

static int controls(void)
{
    const unsigned b = take();
    const fw_controls c = {.protected_mode = b & 1u, .offline = (b >> 1 & 7u) == 7u, .data_exchange = b >> 4 & 1u,
                           .auto_address = b >> 5 & 1u, .auto_clear = (uint8_t)(b >> 6)};
    return fw_set_controls(&c);
}

/** One thing. -> status of a function, else 0 */
static int one(fw_port *p)
{
    const unsigned op = take();
    const fw_result odd = {.data = (uint8_t)(op & 15u), .error = op & 16u ? 1 : 0, .tag = (uint8_t)(op * 7u)};
    fw_result results[64] = {0};
    switch (op & 15u) {
    case 0: fw_power((int)(take() & 1u)); return 0;
    case 1: return controls();
    case 2: case 3: {
        const unsigned index = take() & 63u;
        plant[index] = (uint16_t)(take() << 8 | take());
        return 0;
    }
    case 4: plant[take() & 63u] = 0; return 0;
    case 5: return function();
    case 6: {
        const uint32_t lost[2] = {take() | take() << 24, take() | take() << 24};
        return fw_slave_lost(lost);
    }
    case 7: fw_quality(take() & 63u, take(), take() & 7u, take()); return 0;
    case 8: raw = take(); return 0;
    case 9: answers = take() * 0x01000193u; return 0;
    case 10: return fw_batch_done(results, op >> 4 ? p->batch_len + 1u : 0u); /* not the batch that was asked for */
    case 11:
        if (p->cycle)
            fw_cycle_done(odd, odd, in);
        return 0;
    case 12: p->time_us += take() << 16; return 0;
    default:
        for (unsigned k = 0; k < (op >> 4 & 15u) * 4u + 1u; k++)
            go_on(p);
        return 0;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fw_port *p = fw_port_record();
    fw_permanent permanent = {.controls = {.data_exchange = 1}};
    fw_state s, before;
    uint8_t text[256];
    bytes = data;
    left = size;
    memset(plant, 0, sizeof plant);
    memset(streak, 0, sizeof streak);
    memset(in, 0, sizeof in);
    memset(permanent.pcd, 0xFF, sizeof permanent.pcd);
    memset(permanent.pp, 15, sizeof permanent.pp);
    management = inclusion = (fw_result){0};
    raw = batches = managements = 0;
    answers = 1;
    fw_init(&permanent);
    fw_tick(1000000);
    while (left != 0u) {
        fw_read(&before);
        const int status = one(p);
        fw_read(&s);
        for (unsigned k = 0; k < 2; k++)
            check(!(s.las[k] & ~s.lds[k]) && !(s.lpf[k] & ~s.las[k]) && !(s.las[k] & 1u) && !(k && (s.lds[k] & 1u)), "lists");
        if (status < 0)
            check(s.version == before.version && s.flags == before.flags &&
                  s.permanent_version == before.permanent_version, "refused, yet something changed");
        check(p->violations == 0u, "port misused");
    }
    (void)fw_string(text, sizeof text);
    return 0;
}

#ifndef FUZZ_LIBFUZZER
static int run_file(const char *name)
{
    static uint8_t data[1 << 16];
    FILE *file = fopen(name, "rb");
    if (!file)
        return printf("%s: cannot be read\n", name), 1;
    LLVMFuzzerTestOneInput(data, fread(data, 1, sizeof data, file));
    fclose(file);
    return 0;
}

int main(int argc, char **argv)
{
    static uint8_t data[600];
    if (argc == 3 && argv[1][0] >= '0' && argv[1][0] <= '9') {
        uint32_t state = (uint32_t)strtoul(argv[1], 0, 10);
        for (long k = strtol(argv[2], 0, 10); k > 0; k--) {
            for (size_t b = 0; b < sizeof data; b++) {
                state = state * 1664525u + 1013904223u;
                data[b] = (uint8_t)(state >> 24);
            }
            LLVMFuzzerTestOneInput(data, sizeof data);
        }
    } else {
        for (int k = 1; k < argc; k++) {
            if (run_file(argv[k]) != 0)
                return 2;
        }
    }
    printf("%ld cycles\n", cycles);
    return cycles > 0 ? 0 : 1;
}
#endif
