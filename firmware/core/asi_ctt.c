/* SPDX-License-Identifier: Apache-2.0 */
/** @file asi_ctt.c  Combined transactions. */
#include "asi_ctt.h"

asi_ctt_kind_t asi_ctt_kind(uint16_t codes) { (void)codes; return ASI_CTT_NONE; }
void asi_ctt_init(asi_ctt_t *c) { (void)c; }
bool asi_ctt_open(asi_ctt_t *c, unsigned index, uint16_t codes, uint32_t now_us) { (void)c; (void)index; (void)codes; (void)now_us; return false; }
void asi_ctt_close(asi_ctt_t *c, unsigned index) { (void)c; (void)index; }
unsigned asi_ctt_first(asi_ctt_t *c, unsigned index, unsigned outputs) { (void)c; (void)index; (void)outputs; return 15u; }
unsigned asi_ctt_call(asi_ctt_t *c, unsigned index, const asi_ctt_call_t *call) { (void)c; (void)index; (void)call; return 15u; }
unsigned asi_ctt_inputs(const asi_ctt_t *c, unsigned index, unsigned answer) { (void)c; (void)index; return answer; }
void asi_ctt_cycle(asi_ctt_t *c, const asi_list_t *las, const asi_list_t *called, const asi_list_t *failed, const uint16_t codes[ASI_INDICES], uint32_t in[ASI_IMAGE_WORDS], uint32_t out[ASI_IMAGE_WORDS]) { (void)c; (void)las; (void)called; (void)failed; (void)codes; (void)in; (void)out; }
asi_list_t asi_ctt_incomplete(const asi_ctt_t *c, const asi_list_t *las, const uint16_t codes[ASI_INDICES]) { (void)c; (void)las; (void)codes; return ASI_LIST_EMPTY; }
asi_status_t asi_ctt_string(asi_ctt_t *c, unsigned index, asi_string_kind_t kind, unsigned length, uint32_t now_us) { (void)c; (void)index; (void)kind; (void)length; (void)now_us; return ASI_E_PROFILE; }
