/* SPDX-License-Identifier: Apache-2.0 */
/** @file native_store.c */
#include <stdlib.h>
#include <string.h>
#include "native_store.h"
#include "asi_flash.h"
#include "asi_persist.h"
#include "asi_spi.h"
#include "asi_store.h"
#include "../../tb/asi_tb.h"

#define BYTE_NS 500

static asi_flash *flash, *kept_flash;
static asi_store_t store, kept_store;
static asi_permanent_set_t set, loaded, wanted;
static int64_t now_ns, kept_ns, reset_ns;  /* reset_ns: st_time_us counts from here */
static uint32_t steps, longest;
static int wrong, absent;

/* ------------------------------------------------------------------------------------------ port of asi_flash.c */

void asi_spi_select(bool on)
{
    asi_flash_select(flash, now_ns, on);
}

uint8_t asi_spi_byte(uint8_t out)
{
    const uint8_t in = asi_flash_byte(flash, now_ns, out);
    now_ns += BYTE_NS;
    return absent == 0 ? in : absent == 1 ? 0xFF : absent == 2 ? 0 : 1;
}

uint32_t asi_spi_time_us(void)
{
    now_ns += BYTE_NS; /* asking takes time too */
    return (uint32_t)(now_ns / 1000);
}

/* ------------------------------------------------------------------------------------------ sets */

static uint32_t dice(uint32_t *state)
{
    *state = *state * 1664525u + 1013904223u;
    return *state >> 8;
}

static void make(asi_permanent_set_t *s, uint32_t seed, unsigned opaque)
{
    uint32_t state = seed;
    asi_permanent_t *m = &s->master;
    memset(s, 0, sizeof *s);
    for (unsigned w = 0; w < 2; w++)
        m->projection.lps.w[w] = (dice(&state) << 16 ^ dice(&state)) & ~1u;
    for (unsigned i = 0; i < ASI_INDICES; i++) {
        m->projection.pcd[i] = (uint16_t)dice(&state);
        m->projection.pp[i] = dice(&state) & 15u;
    }
    m->protected_mode = dice(&state) & 1u;
    m->auto_address = dice(&state) & 1u;
    m->data_exchange = dice(&state) & 1u;
    m->auto_clear = dice(&state) & 3u;
    s->opaque_length = (uint16_t)opaque;
    for (unsigned k = 0; k < opaque; k++)
        s->opaque[k] = (uint8_t)dice(&state);
}

static int equal(const asi_permanent_set_t *a, const asi_permanent_set_t *b)
{
    const asi_permanent_t *m = &a->master, *n = &b->master;
    return asi_list_equal(&m->projection.lps, &n->projection.lps) &&
           memcmp(m->projection.pcd, n->projection.pcd, sizeof m->projection.pcd) == 0 &&
           memcmp(m->projection.pp, n->projection.pp, sizeof m->projection.pp) == 0 &&
           m->protected_mode == n->protected_mode && m->auto_address == n->auto_address &&
           m->data_exchange == n->data_exchange && m->auto_clear == n->auto_clear &&
           a->opaque_length == b->opaque_length && memcmp(a->opaque, b->opaque, a->opaque_length) == 0;
}

/* ------------------------------------------------------------------------------------------ interface */

asi_flash *st_new(void)
{
    static uint8_t guard[ST_FLASH];
    if (!flash)
        flash = asi_flash_new(ST_FLASH), kept_flash = asi_flash_new(ST_FLASH);
    asi_flash *fresh = asi_flash_new(ST_FLASH);
    asi_flash_copy(flash, fresh);
    asi_flash_free(fresh);
    memset(guard, ST_GUARD, sizeof guard);
    (void)asi_flash_load(flash, 0, guard, ST_AREA);
    (void)asi_flash_load(flash, ST_AREA + ASI_FLASH_AREA, guard, ST_FLASH - ST_AREA - ASI_FLASH_AREA);
    asi_flash_times(flash, 6 * BYTE_NS, 12 * BYTE_NS); /* a few status reads, each of them a place to cut */
    steps = longest = 0;
    absent = 0;
    return flash;
}

void st_start(void)
{
    now_ns = reset_ns = 0;
    asi_flash_power_up(flash);
    memset(&loaded, 0x5A, sizeof loaded);
    asi_store_open(&store, &loaded);
}

void st_reset(void)
{
    asi_spi_select(false);
    now_ns = (now_ns / 1000 + 1) * 1000;
    const int64_t start = now_ns;
    memset(&loaded, 0x5A, sizeof loaded);
    asi_store_open(&store, &loaded);
    reset_ns = start;
}

void st_absent(int level)
{
    absent = level;
}

uint32_t st_time_us(void)
{
    return (uint32_t)((now_ns - reset_ns) / 1000);
}

void st_read(st_state *s)
{
    *s = (st_state){.state = (int32_t)store.state, .busy = store.busy, .failed = store.failed, .saved = store.saved,
                    .sequence = store.sequence, .newest = store.newest, .steps = steps, .longest_step = longest};
}

static int is_loaded(uint32_t seed, unsigned opaque)
{
    if (seed == 0)
        return store.state == ASI_STORE_EMPTY || store.state == ASI_STORE_CORRUPT;
    make(&wanted, seed, opaque);
    return store.state == ASI_STORE_LOADED && equal(&loaded, &wanted);
}

int st_loaded(uint32_t seed, unsigned opaque)
{
    return is_loaded(seed, opaque);
}

void st_spoil(int what)
{
    wrong = what;
}

int st_begin(uint32_t seed, unsigned opaque)
{
    if (!store.busy)
        make(&set, seed, opaque);
    if (wrong == 1 || wrong == 2)
        set.master.projection.lps.w[wrong - 1] |= 1u;
    if (wrong == 3)
        set.master.projection.pp[63] = 16;
    if (wrong == 4)
        set.master.auto_clear = 4;
    if (wrong == 5)
        set.opaque_length = ASI_STORE_OPAQUE + 1;
    wrong = 0;
    return (int)asi_store_begin(&store, &set);
}

int st_serve(uint32_t us)
{
    asi_flash_counts before, after;
    now_ns += (int64_t)us * 1000;
    asi_flash_get_counts(flash, &before);
    asi_store_serve(&store, (uint32_t)(now_ns / 1000));
    asi_flash_get_counts(flash, &after);
    if (after.bytes - before.bytes > longest)
        longest = (uint32_t)(after.bytes - before.bytes);
    steps++;
    return store.busy;
}

int st_store(uint32_t seed, unsigned opaque)
{
    if (st_begin(seed, opaque) != ASI_OK)
        return -2;
    for (unsigned k = 0; k < 100000; k++) {
        if (asi_flash_is_dead(flash))
            return -1;
        if (!st_serve(0))
            return store.saved ? 1 : 0;
    }
    return -3;
}

void st_set_sequence(uint32_t sequence)
{
    store.next_sequence = sequence;
}

uint32_t st_field(const char *name, unsigned index)
{
    const asi_permanent_t *m = &loaded.master;
    if (strcmp(name, "lps") == 0)
        return m->projection.lps.w[index];
    if (strcmp(name, "pcd") == 0)
        return m->projection.pcd[index];
    if (strcmp(name, "pp") == 0)
        return m->projection.pp[index];
    if (strcmp(name, "flags") == 0)
        return m->protected_mode | (unsigned)m->auto_address << 1 | (unsigned)m->data_exchange << 2 |
               (unsigned)m->auto_clear << 3;
    return strcmp(name, "length") == 0 ? loaded.opaque_length : loaded.opaque[index];
}

/* ------------------------------------------------------------------------------------------ power cuts */

static int outside_untouched(void)
{
    static uint8_t bytes[ST_FLASH], guard[ST_FLASH];
    (void)asi_flash_peek(flash, 0, bytes, ST_FLASH);
    memset(guard, ST_GUARD, sizeof guard);
    memcpy(guard + ST_AREA, bytes + ST_AREA, ASI_FLASH_AREA);
    return memcmp(bytes, guard, sizeof bytes) == 0;
}

/** One cut, and what follows. @return reason, 0 good; *finished: the store ended before the cut */
static uint32_t one_cut(uint32_t old_seed, unsigned old_opaque, uint32_t next_seed, unsigned next_opaque, uint32_t n,
                        uint32_t *random, int *finished, int *is_new)
{
    const uint32_t third = dice(random) | 1u << 24, fourth = third + 1u;
    asi_flash_cut_after(flash, n, dice(random) + 1u);
    const int result = st_store(next_seed, next_opaque);
    *finished = result == 1;
    if (result == 0 || result < -1)
        return 5;
    st_start();
    *is_new = is_loaded(next_seed, next_opaque);
    if (!*is_new && (*finished || !is_loaded(old_seed, old_opaque)))
        return 1;
    /* a second store, cut anywhere or not */
    asi_flash_cut_after(flash, dice(random) % 6000u + 1u, dice(random) + 1u);
    const int second = st_store(third, 40);
    if (second == 0 || second < -1)
        return second == 0 ? 2 : 5;
    st_start();
    if (!is_loaded(third, 40)) {
        if (second == 1)
            return 3;
        if (!is_loaded(next_seed, next_opaque) && !is_loaded(old_seed, old_opaque))
            return 6;
    }
    /* a third in peace, and it stays however often the flash is read */
    if (st_store(fourth, 7) != 1)
        return 7;
    for (unsigned k = 0; k < 2; k++) {
        st_start();
        if (!is_loaded(fourth, 7))
            return 8;
    }
    return 0;
}

void st_cuts(uint32_t old_seed, unsigned old_opaque, uint32_t next_seed, unsigned next_opaque, uint32_t first,
             uint32_t step, uint32_t seed, st_cuts_result *r)
{
    uint32_t random = seed;
    int finished = 0, is_new = 0;
    *r = (st_cuts_result){0};
    asi_flash_copy(kept_flash, flash);
    kept_store = store;
    kept_ns = now_ns;
    for (uint32_t n = first; !finished; n += step) {
        asi_flash_copy(flash, kept_flash);
        store = kept_store;
        now_ns = kept_ns;
        r->cuts++;
        r->reason = one_cut(old_seed, old_opaque, next_seed, next_opaque, n, &random, &finished, &is_new);
        if (r->reason == 0u && n % 64u == 0u && !outside_untouched())
            r->reason = 4;
        if (r->reason != 0u) {
            r->at = n;
            break;
        }
        if (is_new)
            r->was_new++;
        else
            r->was_old++;
    }
    if (r->reason == 0u && !outside_untouched())
        r->reason = 4;
    asi_flash_copy(flash, kept_flash);
    store = kept_store;
    now_ns = kept_ns;
}

/* ------------------------------------------------------------------------------------------ application glue */

static const asi_permanent_t *given;

int st_persist_open(void)
{
    asi_permanent_t m;
    memset(&m, 0, sizeof m);
    now_ns = reset_ns = 0;
    asi_flash_power_up(flash);
    given = asi_persist_open();
    for (unsigned i = 0; i < ASI_INDICES; i++) {
        if (given->projection.pcd[i] != 0xFFFF || given->projection.pp[i] != 15)
            return 0;
    }
    return asi_list_is_empty(&given->projection.lps) && !given->protected_mode && !given->auto_address &&
           given->data_exchange && given->auto_clear == ASI_AUTO_CLEAR_OFF;
}

int st_persist_is(uint32_t seed)
{
    static asi_permanent_set_t a, b;
    make(&a, seed, 0);
    make(&b, seed, 0);
    a.master = *given;
    return equal(&a, &b);
}

void st_persist_request(uint32_t seed)
{
    static asi_permanent_set_t s;
    make(&s, seed, 0);
    asi_persist_request(&s.master);
    memset(&s, 0xEE, sizeof s); /* it has been copied */
}

void st_persist_serve(unsigned times)
{
    while (times-- != 0u)
        asi_persist_serve();
}

int st_persist_ended(void)
{
    asi_status_t status;
    return asi_persist_ended(&status) ? (int)status : 1;
}

uint32_t st_persist_word(void)
{
    return asi_persist_word();
}

int st_persist_opaque_is(uint32_t seed, unsigned length)
{
    static asi_permanent_set_t s;
    unsigned has;
    const uint8_t *bytes = asi_persist_opaque(&has);
    if (has != length)
        return 0;
    make(&s, seed, length);
    return memcmp(s.opaque, bytes, length) == 0;
}

int st_persist_opaque_set(uint32_t seed, unsigned length)
{
    static asi_permanent_set_t s;
    make(&s, seed, length <= ASI_STORE_OPAQUE ? length : 0u);
    return (int)asi_persist_opaque_set(s.opaque, length);
}

#ifdef FW_GCOV
void __gcov_dump(void);
void st_counters_write(void) { __gcov_dump(); }
#else
void st_counters_write(void) {}
#endif
