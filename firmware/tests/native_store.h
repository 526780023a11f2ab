/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file native_store.h  The permanent storage with its flash driver on the byte-wise flash model (tb/asi_flash.cpp),
 * as a library for cffi. One store, one flash, global. Sets are made from a seed: a test names a set by a number.
 * "Start" is power-up of flash and firmware. Declarations between the markers are read by test_store.py.
 */
#ifndef FW_NATIVE_STORE_H
#define FW_NATIVE_STORE_H
#include <stdint.h>
/* cffi begin */
enum { ST_FLASH = 131072, ST_AREA = 32768, ST_GUARD = 0xA5 };  /* bytes of flash, offset of the area, around it */
typedef struct asi_flash asi_flash;
typedef struct {
    int32_t state;
    uint8_t busy, failed, saved;
    uint32_t sequence, newest;  /* newest: address in the area, FFFFFFFF: none */
    uint32_t steps;             /* calls of asi_store_serve since st_new */
    uint32_t longest_step;      /* SPI bytes of the longest of them */
} st_state;

asi_flash *st_new(void);                 /* a fresh flash, not started */
void st_start(void);                     /* power-up, open */
void st_reset(void);                     /* the firmware starts again, the flash goes on */
void st_absent(int level);               /* MISO from now on: 0 the flash, 1 always 1, 2 always 0, 3 each byte is 01 */
void st_read(st_state *state);
int st_loaded(uint32_t seed, unsigned opaque);  /* the set read at start is this one */
int st_begin(uint32_t seed, unsigned opaque);   /* -> asi_status_t */
int st_serve(uint32_t us);               /* one step, so much later; -> busy */
int st_store(uint32_t seed, unsigned opaque);   /* begin, and serve to the end: 1 saved, 0 failed, -1 power failed,
                                                   -2 refused, -3 without end */
void st_set_sequence(uint32_t sequence); /* as if so many had been stored */
uint32_t st_time_us(void);
void st_spoil(int what);                 /* the next st_begin gets a wrong set: 1 slave 0, 2 slave 32, 3 parameter,
                                            4 auto clear, 5 opaque length */
uint32_t st_field(const char *name, unsigned index);  /* of the set read: lps, pcd, pp, flags, length, opaque */

typedef struct {
    uint32_t cuts;      /* tried */
    uint32_t was_old, was_new;  /* found after the cut */
    uint32_t at;        /* first wrong one: bytes until the cut */
    uint32_t reason;    /* 0: all good; 1 neither old nor new, 2 next store failed, 3 it was not found, 4 outside
                           touched, 5 no end, 6 second cut: neither, 7 the third store, 8 it was not found later */
} st_cuts_result;
/** Power cut after every n-th SPI byte (first, first + step ..) of storing set `next`, from the present situation,
 * in this session; old_seed 0: nothing is stored. Then a start, a store with a second cut, a start, a store. */
void st_cuts(uint32_t old_seed, unsigned old_opaque, uint32_t next_seed, unsigned next_opaque, uint32_t first,
             uint32_t step, uint32_t dice, st_cuts_result *result);

/* the glue of the application on the same flash (firmware/app/asi_persist.c); set numbers as above, without opaque */
int st_persist_open(void);                      /* power-up; -> 1: the defaults, 0: something else */
int st_persist_is(uint32_t seed);               /* what st_persist_open gave is this set */
void st_persist_request(uint32_t seed);
void st_persist_serve(unsigned times);
int st_persist_ended(void);                     /* -> 1: none has ended, else its asi_status_t */
uint32_t st_persist_word(void);
int st_persist_opaque_is(uint32_t seed, unsigned length);
int st_persist_opaque_set(uint32_t seed, unsigned length);  /* -> asi_status_t */
void st_counters_write(void);  /* coverage counters to disk, now; nothing without gcov */
/* cffi end */
#endif
