/* SPDX-License-Identifier: Apache-2.0 */
/** @file asi_ctt3.c  Combined transaction type 3: multiplexed bits of A/B slaves, S-7.A.7 (4 I/O), S-7.A.A (8 I/O). */
#include "asi_ctt_private.h"

#define LINE (ASI_CTT3_INVERT_OUT ? 3u : 0u)
enum { NO_ANSWER = 4, BROKEN = 8 };

void asi_ctt3_open(asi_ctt_t *c, unsigned index, uint32_t now_us)
{
    asi_ctt3_t *s = &c->slave[index].three;
    s->nibble = 7u;
    s->selector = NO_ANSWER;
    s->run = BROKEN;
    s->last_us = now_us;
}

/* ---- S-7.A.7: outputs 3, 2 with I2 = 1, then 1, 0 with I2 = 0; the slave sets all four at that edge */

unsigned asi_ctt3_first_4io(asi_ctt_t *c, unsigned index, unsigned outputs)
{
    asi_ctt3_t *s = &c->slave[index].three;
    s->snapshot = (uint8_t)outputs;
    s->selector = 1u;
    s->nibble = (uint8_t)(4u | ((outputs >> 2 ^ LINE) & 3u));
    return s->nibble;
}

unsigned asi_ctt3_call_4io(asi_ctt_t *c, unsigned index, const asi_ctt_call_t *call)
{
    asi_ctt3_t *s = &c->slave[index].three;
    if (!call->ok || (call->sent & 7u) != s->nibble)
        return s->nibble;
    if (s->selector == 0u) {
        asi_ctt_status_set(c, index, 0u, ASI_CTT_OV | ASI_CTT_TV);
        return asi_ctt3_first_4io(c, index, call->outputs);
    }
    s->selector = 0u;
    s->nibble = (uint8_t)((s->snapshot ^ LINE) & 3u);
    return s->nibble;
}

/* ---- S-7.A.A: the slave leads; each answer names the pair that it brings and takes next */

unsigned asi_ctt3_first_8io(const asi_ctt_t *c, unsigned index)
{
    return c->slave[index].three.nibble;
}

unsigned asi_ctt3_call_8io(asi_ctt_t *c, unsigned index, const asi_ctt_call_t *call)
{
    asi_ctt3_t *s = &c->slave[index].three;
    static const uint8_t keep[4] = {0xFC, 0xF3, 0xCF, 0x3F};
    if (call->ok) {
        const unsigned selector = call->answer >> 2 & 3u;
        if (selector != s->selector) { /* else the slave repeats itself: it has not seen the last nibble */
            s->selector = (uint8_t)selector;
            if (selector == 0u) {
                s->snapshot = (uint8_t)c->ao[asi_analog_word(index)];
                s->run = 0u;
            } else if ((call->sent & 7u) != s->nibble) {
                s->snapshot = 0u; /* it took the very first nibble, sent again, as pair 0: all bits 0 */
            }
            s->run = selector == s->run ? (uint8_t)(selector + 1u) : (uint8_t)BROKEN;
            s->inputs = (uint8_t)((s->inputs & keep[selector]) | (call->answer & 3u) << (2u * selector));
            if (s->run == 4u) { /* 0, 1, 2, 3 */
                s->last_us = call->now_us;
                asi_ctt_show(c, index, 0u, s->inputs, 0u, 1u | ASI_CTT_OV | ASI_CTT_TV);
            }
            const unsigned pair = (selector + ASI_CTT3_AA_OFFSET) & 3u;
            const unsigned clock = (selector ^ (ASI_CTT3_AA_INVERTED ? 1u : 0u)) & 1u;
            s->nibble = (uint8_t)(clock << 2 | (((unsigned)s->snapshot >> (2u * pair) ^ LINE) & 3u));
        }
    }
    if ((c->status[index] & ASI_CTT_TV) != 0u && ctt_elapsed(call->now_us, s->last_us, ASI_CTT3_TIMEOUT_MS)) {
        asi_ctt_show(c, index, 0u, 0u, 0xFFu, 0u);
    }
    return s->nibble;
}
