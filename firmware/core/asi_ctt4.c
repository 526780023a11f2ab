/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_ctt4.c  Combined transaction type 4: a placeholder, as its wire format is not public; off unless
 * ASI_CTT4_ENABLE. The call names a nibble of the value (and the channel, S-7.A.9, or carries the output, S-7.A.8), the
 * answer is that nibble. A call whose nibble was not the one meant brings nothing.
 */
#include "asi_ctt_private.h"

#define EXTRA (1u << ASI_CTT4_CHANNEL_BIT)
enum { FIRST = ASI_CTT4_NIBBLES - 1 };

static void compose(asi_ctt4_t *s, unsigned outputs)
{
    const bool extra = s->two ? s->channel != 0u : ((outputs ^ CTT_INVERT) & 1u) != 0u;
    s->nibble = (uint8_t)(s->number | (extra ? EXTRA : 0u));
}

static void substitute(asi_ctt_t *c, unsigned index)
{
    asi_ctt_show(c, index, 0u, CTT_SUBSTITUTE, 0xFFu, 0u);
    if (c->slave[index].four.two)
        asi_ctt_show(c, index, 1u, CTT_SUBSTITUTE, 0xFFu, 0u);
}

void asi_ctt4_open(asi_ctt_t *c, unsigned index, uint16_t codes, uint32_t now_us)
{
    asi_ctt4_t *s = &c->slave[index].four;
    s->two = (unsigned)codes >> 12 == 9u;
    s->number = FIRST;
    s->last_us = now_us;
    substitute(c, index);
}

void asi_ctt4_close(asi_ctt_t *c, unsigned index)
{
    substitute(c, index);
}

unsigned asi_ctt4_first(asi_ctt_t *c, unsigned index, unsigned outputs)
{
    asi_ctt4_t *s = &c->slave[index].four;
    compose(s, outputs);
    return s->nibble;
}

unsigned asi_ctt4_call(asi_ctt_t *c, unsigned index, const asi_ctt_call_t *call)
{
    asi_ctt4_t *s = &c->slave[index].four;
    if (call->ok && (call->sent & 7u) == s->nibble) {
        s->value = (uint16_t)(s->value << 4 | call->answer);
        if (s->number != 0u) {
            s->number--;
        } else {
            s->number = FIRST;
            s->last_us = call->now_us;
            asi_ctt_show(c, index, s->channel, s->value, 0u,
                         ctt_valid(s->channel) | ASI_CTT_TV | (s->two ? 0u : ASI_CTT_OV));
            if (s->two)
                s->channel ^= 1u;
        }
    } else if ((c->status[index] & ASI_CTT_TV) != 0u && ctt_elapsed(call->now_us, s->last_us, ASI_CTT4_TIMEOUT_MS)) {
        substitute(c, index);
    }
    compose(s, call->outputs);
    return s->nibble;
}
