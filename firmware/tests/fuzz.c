/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file fuzz.c  The core fed with random reports in random order, also ones that do not fit, under the address and
 * undefined-behaviour sanitizers. A program of its own, because a sanitized library does not load into a plain Python.
 * usage: fuzz SEED STEPS; exit 0 when all held; prints how often normal operation was reached.
 */
#include <stdio.h>
#include <stdlib.h>
#include "native.h"

static uint32_t state;

static uint32_t dice(uint32_t n)
{
    state = state * 1664525u + 1013904223u;
    return (state >> 8) % n;
}

static fw_result any_result(uint8_t tag)
{
    static const uint8_t errors[] = {0, 0, 0, 0, 0, 0, 1, 7, 15, 9};
    return (fw_result){.data = (uint8_t)dice(16), .error = errors[dice(sizeof errors)], .tag = tag};
}

int main(int argc, char **argv)
{
    const long steps = argc == 3 ? strtol(argv[2], 0, 10) : 0;
    const fw_port *port = fw_port_record();
    uint32_t lps[2] = {0, 0}, images[8];
    uint16_t pcd[64] = {0};
    uint8_t pp[64] = {0};
    long operations = 0;
    fw_state s, before;
    if (argc != 3)
        return 2;
    state = (uint32_t)strtoul(argv[1], 0, 10);
    fw_init(lps, pcd, pp);
    for (long step = 0; step < steps; step++) {
        fw_result results[64];
        int status = 0;
        fw_read(&before);
        switch (dice(24)) {
        case 0: fw_power((int)dice(4) == 0); break;
        case 1: fw_set_mode((int)dice(4) == 0); break;
        case 2: fw_set_offline((int)dice(6) == 0); break;
        case 3: fw_set_data_exchange((int)dice(2)); break;
        case 4: fw_set_auto_address((int)dice(2)); break;
        case 5:
            for (unsigned k = 0; k < 2; k++)
                lps[k] = dice(2) ? before.lds[k] & ~1u : dice(0x1000000) << dice(9);
            for (unsigned k = 0; k < 64; k++) {
                pcd[k] = dice(8) ? before.cdi[k] : (uint16_t)dice(0x10000);
                pp[k] = (uint8_t)dice(dice(8) ? 16 : 17);
            }
            status = fw_set_projection(lps, pcd, pp);
            break;
        case 6: {
            const uint32_t lost[2] = {dice(0x1000000) & dice(0x1000000), dice(0x1000000) & dice(0x1000000)};
            status = fw_slave_lost(lost);
            break;
        }
        case 7: status = fw_manage((uint16_t)dice(0x900)); break;
        default:
            for (unsigned k = 0; k < 64; k++)
                results[k] = any_result(0);
            for (unsigned k = 0; k < 8; k++)
                images[k] = dice(0x1000000) * 0x101u;
            if (!port->idle && port->batch_len && !port->cycle) {
                fw_port *p = fw_port_record();
                const unsigned n = port->batch_len;
                if (dice(16) == 0) {
                    status = fw_batch_done(results, n + 1u); /* not the batch that was asked for */
                } else {
                    p->idle = 1;
                    fw_batch_done(results, n);
                }
            } else if (port->cycle) {
                fw_set_outputs(images);
                fw_cycle_done(any_result(dice(4) ? port->management.tag : (uint8_t)dice(256)),
                              any_result(dice(4) ? port->inclusion.tag : (uint8_t)dice(256)), images);
                operations++;
            } else {
                fw_port_record()->idle = 1;
                fw_tick(dice(2000000));
            }
        }
        if (!port->line && dice(4) == 0)
            fw_port_record()->idle = 1;
        fw_read(&s);
        for (unsigned k = 0; k < 2; k++) {
            if ((s.las[k] & ~s.lds[k]) || (s.las[k] & 1u) || (k && (s.lds[k] & 1u)))
                return printf("step %ld: lists %08x %08x\n", step, (unsigned)s.las[k], (unsigned)s.lds[k]), 1;
        }
        if (status < 0 && (s.version != before.version || s.flags != before.flags))
            return printf("step %ld: refused (%d), yet something changed\n", step, status), 1;
        if (port->violations)
            return printf("step %ld: port misused\n", step), 1;
    }
    printf("%ld cycles in %ld steps\n", operations, steps);
    return operations > steps / 20 ? 0 : 1;
}
