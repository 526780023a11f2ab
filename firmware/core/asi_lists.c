/* SPDX-License-Identifier: Apache-2.0 */
/** @file asi_lists.c */
#include "asi_lists.h"

unsigned asi_list_next(const asi_list_t *list, unsigned from)
{
    while (from < 64u) {
        uint32_t rest = list->w[from >> 5] >> (from & 31u);
        if (rest == 0u) {
            from = (from | 31u) + 1u; /* next word */
            continue;
        }
        while ((rest & 15u) == 0u) {
            rest >>= 4;
            from += 4u;
        }
        while ((rest & 1u) == 0u) {
            rest >>= 1;
            from++;
        }
        break;
    }
    return from;
}
