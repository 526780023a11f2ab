/* SPDX-License-Identifier: Apache-2.0 */
/** @file asi_mem.c  The two functions a freestanding C compiler may call on its own (built with -fno-builtin). */
#include <stddef.h>
#include <stdint.h>

void *memset(void *destination, int value, size_t n);
void *memcpy(void *restrict destination, const void *restrict source, size_t n);

/** All on word boundaries: structures mostly are. */
static int words_fit(uintptr_t a, uintptr_t b, size_t n)
{
    return ((a | b | n) & 3u) == 0u;
}

void *memset(void *destination, int value, size_t n)
{
    uint8_t *d = destination;
    if (words_fit((uintptr_t)d, 0u, n)) {
        const uint32_t byte = (uint8_t)value, four = byte | byte << 8 | byte << 16 | byte << 24;
        for (volatile uint32_t *w = destination; n != 0u; n -= 4u) /* volatile: not to become a call of memset */
            *w++ = four;
        return destination;
    }
    while (n-- != 0u)
        *d++ = (uint8_t)value;
    return destination;
}

void *memcpy(void *restrict destination, const void *restrict source, size_t n)
{
    uint8_t *d = destination;
    const uint8_t *s = source;
    if (words_fit((uintptr_t)d, (uintptr_t)s, n)) {
        const uint32_t *from = source;
        for (volatile uint32_t *w = destination; n != 0u; n -= 4u)
            *w++ = *from++;
        return destination;
    }
    while (n-- != 0u)
        *d++ = *s++;
    return destination;
}
