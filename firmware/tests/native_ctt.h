/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file native_ctt.h  The engines of the combined transactions as a native library for tests: flat, global,
 * single-threaded. Declarations between the markers are read by firmware/tests/native_ctt.py.
 */
#ifndef FW_NATIVE_CTT_H
#define FW_NATIVE_CTT_H
#include <stdint.h>
/* cffi begin */
void fc_init(void);
int fc_kind(uint16_t codes);
int fc_open(unsigned index, uint16_t codes, uint32_t now_us);
void fc_close(unsigned index);
unsigned fc_first(unsigned index, unsigned outputs);
unsigned fc_call(unsigned index, int ok, unsigned sent, unsigned answer, unsigned outputs, uint32_t now_us);
unsigned fc_inputs(unsigned index, unsigned answer);
int fc_hold(unsigned index);
void fc_release(unsigned index, uint32_t now_us);
int fc_string(unsigned index, int kind, unsigned length, uint32_t now_us);
void fc_cycle(const uint32_t las[2], const uint32_t called[2], const uint32_t failed[2], const uint16_t codes[64],
              uint32_t in[8], uint32_t out[8]);
void fc_incomplete(const uint32_t las[2], const uint16_t codes[64], uint32_t result[2]);
uint16_t *fc_ai(void);            /* 128 words */
uint16_t *fc_ao(void);
uint8_t *fc_status(void);         /* 64 */
uint8_t *fc_string_bytes(void);   /* 224 */
int fc_string_open(void);
int fc_string_status(void);
unsigned fc_string_length(void);
void fc_safe_in(unsigned channel, uint32_t list[2]);
void fc_changed(uint32_t list[2]);  /* and clears it */
void fc_live(uint32_t list[2]);
unsigned fc_word(unsigned index);
unsigned fc_size(void);
void fc_counters_write(void);     /* coverage counters to disk, now; nothing without gcov */
/* cffi end */
#endif
