/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_ctt5.c  Kinds whose calls are ordinary ones: groups of 2 to 4 addresses of combined transaction type 5, and
 * safety slaves. Both are looked at once, when the calls of a cycle are over.
 */
#include "asi_ctt_private.h"

static unsigned nibble_of(const uint32_t image[ASI_IMAGE_WORDS], unsigned index)
{
    return image[asi_word(index)] >> asi_shift(index) & 15u;
}

static void nibble_set(uint32_t image[ASI_IMAGE_WORDS], unsigned index, unsigned nibble)
{
    uint32_t *word = &image[asi_word(index)];
    *word = (*word & ~(15u << asi_shift(index))) | nibble << asi_shift(index);
}

/* members of the whole group that begins here: 2 .. 4; 0: none begins, or one is missing or says another place */
static unsigned group(const asi_list_t *members, const uint16_t codes[ASI_INDICES], unsigned first)
{
    const unsigned n = ((unsigned)codes[first] >> 12) - 8u;
    if (n < 2u || n > 4u || first + n > 32u)
        return 0u;
    for (unsigned k = 1u; k < n; k++) {
        if (!asi_list_has(members, first + k) || (unsigned)codes[first + k] >> 12 != 4u + n - k)
            return 0u;
    }
    return n;
}

static asi_list_t members_of(const asi_ctt_t *c, const asi_list_t *las)
{
    return (asi_list_t){{c->groups.w[0] & las->w[0], 0u}};
}

static void group_gone(asi_ctt_t *c, unsigned first)
{
    asi_list_remove(&c->grouped, first);
    asi_ctt_show(c, first, 0u, 0u, false);
    asi_ctt_status_set(c, first, 0xFFu, 0u);
}

void asi_ctt5_close(asi_ctt_t *c, unsigned index)
{
    for (unsigned k = 0u; k < 4u && k < index; k++) {
        const unsigned first = index - k;
        if (asi_list_has(&c->grouped, first) && c->slave[first].group > k)
            group_gone(c, first);
    }
}

static void groups(asi_ctt_t *c, const asi_list_t *las, const asi_list_t *called, const asi_list_t *failed,
                   const uint16_t codes[ASI_INDICES], const uint32_t in[ASI_IMAGE_WORDS], uint32_t out[ASI_IMAGE_WORDS])
{
    const asi_list_t members = members_of(c, las);
    const asi_list_t fresh = asi_list_without(called, failed), before = c->grouped;
    c->grouped = ASI_LIST_EMPTY;
    for (unsigned i = asi_list_next(&members, 0u); i < 32u; i = asi_list_next(&members, i + 1u)) {
        const unsigned n = group(&members, codes, i);
        const unsigned output = c->ao[asi_analog_word(i)];
        bool all = true;
        unsigned value = 0u;
        if (n == 0u)
            continue;
        asi_list_add(&c->grouped, i);
        c->slave[i].group = (uint8_t)n;
        for (unsigned k = 0u; k < n; k++) { /* the highest address has the highest nibble of the word */
            all = all && asi_list_has(&fresh, i + k);
            value = value >> 4 | nibble_of(in, i + k) << 12;
            nibble_set(out, i + k, output >> (4u * (4u - n + k)) & 15u);
        }
        if (all) {
            asi_ctt_show(c, i, 0u, value, true);
            asi_ctt_status_set(c, i, 0u, ASI_CTT_TV | ASI_CTT_OV);
        }
    }
    const asi_list_t gone = asi_list_without(&before, &c->grouped);
    for (unsigned i = asi_list_next(&gone, 0u); i < 32u; i = asi_list_next(&gone, i + 1u))
        group_gone(c, i);
}

static void safety(asi_ctt_t *c, const asi_list_t *called, const asi_list_t *failed, uint32_t in[ASI_IMAGE_WORDS])
{
    const asi_list_t polled = {{c->safety.w[0] & called->w[0], 0u}}; /* ID code B has no B slaves */
    for (unsigned i = asi_list_next(&polled, 0u); i < 32u; i = asi_list_next(&polled, i + 1u)) {
        if (asi_list_has(failed, i))
            nibble_set(in, i, 0u);
        const unsigned word = nibble_of(in, i);
        for (unsigned k = 0u; k < 2u; k++) {
            uint8_t *polls = &c->slave[i].safety.polls[k];
            if ((word & (k == 0u ? 3u : 12u)) != 0u) {
                *polls = ASI_SAFETY_VIEW_POLLS;
                asi_list_add(&c->safe_in[k], i);
            } else if (*polls != 0u && --*polls == 0u) {
                asi_list_remove(&c->safe_in[k], i);
            }
        }
    }
}

void asi_ctt_cycle(asi_ctt_t *c, const asi_list_t *las, const asi_list_t *called, const asi_list_t *failed,
                   const uint16_t codes[ASI_INDICES], uint32_t in[ASI_IMAGE_WORDS], uint32_t out[ASI_IMAGE_WORDS])
{
    if ((c->groups.w[0] | c->grouped.w[0]) != 0u)
        groups(c, las, called, failed, codes, in, out);
    if (c->safety.w[0] != 0u)
        safety(c, called, failed, in);
}

asi_list_t asi_ctt_incomplete(const asi_ctt_t *c, const asi_list_t *las, const uint16_t codes[ASI_INDICES])
{
    asi_list_t members = members_of(c, las), loose = members;
    for (unsigned i = asi_list_next(&members, 0u); i < 32u; i = asi_list_next(&members, i + 1u)) {
        const unsigned n = group(&members, codes, i);
        for (unsigned k = 0u; k < n; k++)
            asi_list_remove(&loose, i + k);
    }
    return loose;
}
