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

/* Lists are single words here: both kinds have standard addresses only, and 64 bits cost much code. */

/* members of the whole group that begins here: 2 .. 4; 0: none begins, or one is missing or says another place */
static unsigned group(uint32_t members, const uint16_t codes[ASI_INDICES], unsigned first)
{
    const unsigned n = ((unsigned)codes[first] >> 12) - 8u;
    if ((members >> first & 1u) == 0u || n < 2u || n > 4u || first + n > 32u)
        return 0u;
    for (unsigned k = 1u; k < n; k++) {
        if ((members >> (first + k) & 1u) == 0u || (unsigned)codes[first + k] >> 12 != 4u + n - k)
            return 0u;
    }
    return n;
}

static void group_gone(asi_ctt_t *c, unsigned first)
{
    c->grouped &= ~(1u << first);
    asi_ctt_show(c, first, 0u, 0u, 0xFFu, 0u);
}

void asi_ctt5_close(asi_ctt_t *c, unsigned index)
{
    for (unsigned k = 0u; k < 4u && k < index; k++) {
        if ((c->grouped >> (index - k) & 1u) != 0u && c->slave[index - k].group > k)
            group_gone(c, index - k);
    }
}

static void show_group(asi_ctt_t *c, unsigned first, unsigned n, uint32_t fresh, const uint32_t in[ASI_IMAGE_WORDS],
                       uint32_t out[ASI_IMAGE_WORDS])
{
    const uint32_t all = ((1u << n) - 1u) << first;
    unsigned value = 0u, output = c->ao[asi_analog_word(first)];
    c->grouped |= 1u << first;
    c->slave[first].group = (uint8_t)n;
    for (unsigned k = n; k-- != 0u;) { /* the highest address has the highest nibble of the word */
        value = value << 4 | nibble_of(in, first + k);
        nibble_set(out, first + k, output >> 12 & 15u);
        output <<= 4;
    }
    if ((fresh & all) == all)
        asi_ctt_show(c, first, 0u, value << 4u * (4u - n), 0u, 1u | ASI_CTT_TV | ASI_CTT_OV);
}

static void safety(asi_ctt_t *c, uint32_t called, uint32_t failed, uint32_t in[ASI_IMAGE_WORDS])
{
    uint32_t polled = c->safety & called, bit = 1u;
    for (unsigned i = 0u; polled != 0u; i++, polled >>= 1, bit <<= 1) {
        if ((polled & 1u) == 0u)
            continue;
        if ((failed & bit) != 0u)
            nibble_set(in, i, 0u);
        const unsigned word = nibble_of(in, i);
        for (unsigned k = 0u; k < 2u; k++) {
            uint8_t *polls = &c->slave[i].safety.polls[k];
            if ((word & (k == 0u ? 3u : 12u)) != 0u) {
                *polls = ASI_SAFETY_VIEW_POLLS;
                c->safe_in[k].w[0] |= bit;
            } else if (*polls != 0u && --*polls == 0u) {
                c->safe_in[k].w[0] &= ~bit;
            }
        }
    }
}

void asi_ctt_cycle(asi_ctt_t *c, const asi_list_t *las, const asi_list_t *called, const asi_list_t *failed,
                   const uint16_t codes[ASI_INDICES], uint32_t in[ASI_IMAGE_WORDS], uint32_t out[ASI_IMAGE_WORDS])
{
    if ((c->groups | c->grouped) != 0u) {
        for (unsigned i = 1u; i < 32u; i++) {
            const unsigned n = group(c->groups & las->w[0], codes, i);
            if (n != 0u)
                show_group(c, i, n, called->w[0] & ~failed->w[0], in, out);
            else if ((c->grouped >> i & 1u) != 0u)
                group_gone(c, i);
        }
    }
    if (c->safety != 0u)
        safety(c, called->w[0], failed->w[0], in);
}

asi_list_t asi_ctt_incomplete(const asi_ctt_t *c, const asi_list_t *las, const uint16_t codes[ASI_INDICES])
{
    const uint32_t members = c->groups & las->w[0];
    uint32_t loose = members;
    for (unsigned i = 1u; members != 0u && i < 32u; i++)
        loose &= ~(((1u << group(members, codes, i)) - 1u) << i);
    return (asi_list_t){{loose, 0u}};
}
