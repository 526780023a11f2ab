/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_lists.h  Slave lists (LDS, LAS, LPS, LPF ...) as 64 bits in two words, bit = slave index; and image words.
 * No 64-bit arithmetic and no bit-count instruction: the soft core is a plain RV32I.
 */
#ifndef ASI_LISTS_H
#define ASI_LISTS_H
#include <stdbool.h>
#include <stdint.h>

typedef struct { uint32_t w[2]; } asi_list_t;

#define ASI_LIST_EMPTY ((asi_list_t){{0u, 0u}})
/** every index a slave may have but 0: 1..31, 33..63 */
#define ASI_LIST_SLAVES ((asi_list_t){{0xFFFFFFFEu, 0xFFFFFFFEu}})

static inline bool asi_list_has(const asi_list_t *list, unsigned index)
{
    return (list->w[index >> 5 & 1u] >> (index & 31u) & 1u) != 0u;
}

static inline void asi_list_add(asi_list_t *list, unsigned index)
{
    list->w[index >> 5 & 1u] |= 1u << (index & 31u);
}

static inline void asi_list_remove(asi_list_t *list, unsigned index)
{
    list->w[index >> 5 & 1u] &= ~(1u << (index & 31u));
}

static inline bool asi_list_is_empty(const asi_list_t *list)
{
    return (list->w[0] | list->w[1]) == 0u;
}

static inline bool asi_list_equal(const asi_list_t *a, const asi_list_t *b)
{
    return a->w[0] == b->w[0] && a->w[1] == b->w[1];
}

/** members of a that are not in b */
static inline asi_list_t asi_list_without(const asi_list_t *a, const asi_list_t *b)
{
    return (asi_list_t){{a->w[0] & ~b->w[0], a->w[1] & ~b->w[1]}};
}

/** Smallest member >= from, or 64 when there is none. Iterate: for (i = next(l, 0); i < 64; i = next(l, i + 1)). */
unsigned asi_list_next(const asi_list_t *list, unsigned from);

/** Image word and bit position of an index. */
static inline unsigned asi_word(unsigned index) { return index >> 3; }
static inline unsigned asi_shift(unsigned index) { return (index & 7u) << 2; }
#endif
