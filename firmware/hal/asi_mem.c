/* SPDX-License-Identifier: Apache-2.0 */
/** @file asi_mem.c  The two functions a freestanding C compiler may call on its own (built with -fno-builtin). */
#include <stddef.h>
#include <stdint.h>

void *memset(void *destination, int value, size_t n);
void *memcpy(void *restrict destination, const void *restrict source, size_t n);

void *memset(void *destination, int value, size_t n)
{
    uint8_t *d = destination;
    while (n-- != 0u)
        *d++ = (uint8_t)value;
    return destination;
}

void *memcpy(void *restrict destination, const void *restrict source, size_t n)
{
    uint8_t *d = destination;
    const uint8_t *s = source;
    while (n-- != 0u)
        *d++ = *s++;
    return destination;
}
