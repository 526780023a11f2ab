/* SPDX-License-Identifier: Apache-2.0 */
/** @file native_ctt.c  See native_ctt.h. */
#include "native_ctt.h"
#include "asi_ctt.h"

static asi_ctt_t c;

static asi_list_t list_of(const uint32_t w[2]) { return (asi_list_t){{w[0], w[1]}}; }

static void copy(uint32_t out[2], asi_list_t list)
{
    out[0] = list.w[0];
    out[1] = list.w[1];
}

void fc_init(void) { asi_ctt_init(&c); }
int fc_kind(uint16_t codes) { return (int)asi_ctt_kind(codes); }
int fc_open(unsigned index, uint16_t codes, uint32_t now_us) { return asi_ctt_open(&c, index, codes, now_us); }
void fc_close(unsigned index) { asi_ctt_close(&c, index); }
unsigned fc_first(unsigned index, unsigned outputs) { return asi_ctt_first(&c, index, outputs); }

unsigned fc_call(unsigned index, int ok, unsigned sent, unsigned answer, unsigned outputs, uint32_t now_us)
{
    const asi_ctt_call_t call = {.ok = ok != 0, .sent = (uint8_t)sent, .answer = (uint8_t)answer,
                                 .outputs = (uint8_t)outputs, .now_us = now_us};
    return asi_ctt_call(&c, index, &call);
}

unsigned fc_inputs(unsigned index, unsigned answer) { return asi_ctt_inputs(&c, index, answer); }
int fc_hold(unsigned index) { return asi_ctt_hold(&c, index); }
void fc_release(unsigned index, uint32_t now_us) { asi_ctt_release(&c, index, now_us); }

int fc_string(unsigned index, int kind, unsigned length, uint32_t now_us)
{
    return (int)asi_ctt_string(&c, index, (asi_string_kind_t)kind, length, now_us);
}

void fc_cycle(const uint32_t las[2], const uint32_t called[2], const uint32_t failed[2], const uint16_t codes[64],
              uint32_t in[8], uint32_t out[8])
{
    const asi_list_t a = list_of(las), b = list_of(called), f = list_of(failed);
    asi_ctt_cycle(&c, &a, &b, &f, codes, in, out);
}

void fc_incomplete(const uint32_t las[2], const uint16_t codes[64], uint32_t result[2])
{
    const asi_list_t a = list_of(las);
    copy(result, asi_ctt_incomplete(&c, &a, codes));
}

uint16_t *fc_ai(void) { return c.ai; }
uint16_t *fc_ao(void) { return c.ao; }
uint8_t *fc_status(void) { return c.status; }
uint8_t *fc_string_bytes(void) { return c.string.bytes; }
int fc_string_open(void) { return c.string.open; }
int fc_string_status(void) { return (int)c.string.status; }
unsigned fc_string_length(void) { return c.string.length; }
void fc_safe_in(unsigned channel, uint32_t list[2]) { copy(list, c.safe_in[channel & 1u]); }
void fc_live(uint32_t list[2]) { copy(list, c.live); }
unsigned fc_word(unsigned index) { return asi_analog_word(index); }
unsigned fc_size(void) { return sizeof c; }

void fc_changed(uint32_t list[2])
{
    copy(list, c.changed);
    c.changed = ASI_LIST_EMPTY;
}

#ifdef FW_GCOV
void __gcov_dump(void);
void fc_counters_write(void) { __gcov_dump(); }
#else
void fc_counters_write(void) {}
#endif
