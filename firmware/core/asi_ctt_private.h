/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_ctt_private.h  What the engines of the combined transactions share. Only asi_ctt*.c include it.
 * An engine's `call` gets the ended call and returns the next nibble at line level; I3 of A/B slaves stays 0.
 */
#ifndef ASI_CTT_PRIVATE_H
#define ASI_CTT_PRIVATE_H
#include "asi_ctt.h"

/** Inversion of payload bits between host and line (CA-005). */
#define CTT_INVERT (ASI_INVERT_OUT ? 15u : 0u)
/** The compiler would copy it to every place of use, and memory is short. */
#define CTT_ONCE __attribute__((noinline))
#define CTT_SUBSTITUTE 0x7FFFu /* of an analog value (CT-011) */

void asi_ctt_status_set(asi_ctt_t *c, unsigned index, unsigned clear, unsigned set);
/** Show a value of a channel (0..3), with changes of the status: the slave's sets the channel's bit. */
void asi_ctt_show(asi_ctt_t *c, unsigned index, unsigned channel, unsigned value, unsigned clear, unsigned set);
/** Status bit of a channel. */
static inline unsigned ctt_valid(unsigned channel)
{
    return channel < 2u ? channel + 1u : channel * 4u - 4u; /* 1, 2, 4, 8: cheaper than a shift */
}
/** The open string is over. */
void asi_ctt_string_end(asi_ctt_t *c, asi_status_t status, unsigned length);

static inline bool ctt_elapsed(uint32_t now_us, uint32_t since_us, uint32_t ms)
{
    return now_us - since_us >= ms * 1000u; /* ms is a constant */
}

void asi_ctt1_open(asi_ctt_t *c, unsigned index, uint16_t codes, uint32_t now_us);
void asi_ctt1_close(asi_ctt_t *c, unsigned index);
unsigned asi_ctt1_first(asi_ctt_t *c, unsigned index);
unsigned asi_ctt1_call(asi_ctt_t *c, unsigned index, const asi_ctt_call_t *call);
bool asi_ctt1_hold(asi_ctt_t *c, unsigned index);
void asi_ctt1_release(asi_ctt_t *c, unsigned index, uint32_t now_us);
asi_status_t asi_ctt1_string(asi_ctt_t *c, unsigned index, asi_string_kind_t kind, unsigned length, uint32_t now_us);

void asi_ctt2_open(asi_ctt_t *c, unsigned index, uint16_t codes, uint32_t now_us);
void asi_ctt2_close(asi_ctt_t *c, unsigned index);
unsigned asi_ctt2_first(const asi_ctt_t *c, unsigned index, unsigned outputs);
unsigned asi_ctt2_call(asi_ctt_t *c, unsigned index, const asi_ctt_call_t *call);
asi_status_t asi_ctt2_string(const asi_ctt_t *c, unsigned length);

void asi_ctt3_open(asi_ctt_t *c, unsigned index, uint32_t now_us);
unsigned asi_ctt3_first_4io(asi_ctt_t *c, unsigned index, unsigned outputs);
unsigned asi_ctt3_call_4io(asi_ctt_t *c, unsigned index, const asi_ctt_call_t *call);
unsigned asi_ctt3_first_8io(const asi_ctt_t *c, unsigned index);
unsigned asi_ctt3_call_8io(asi_ctt_t *c, unsigned index, const asi_ctt_call_t *call);

void asi_ctt4_open(asi_ctt_t *c, unsigned index, uint16_t codes, uint32_t now_us);
void asi_ctt4_close(asi_ctt_t *c, unsigned index);
unsigned asi_ctt4_first(asi_ctt_t *c, unsigned index, unsigned outputs);
unsigned asi_ctt4_call(asi_ctt_t *c, unsigned index, const asi_ctt_call_t *call);
void asi_ctt5_close(asi_ctt_t *c, unsigned index);
#endif
