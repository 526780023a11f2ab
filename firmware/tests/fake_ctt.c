/* SPDX-License-Identifier: Apache-2.0 */
/** @file fake_ctt.c  In place of the combined transactions: strings that begin and end as the test says (asi_ctt.h). */
#include "asi_ctt.h"

int fake_holds;       /* calls of asi_ctt_hold until it lets go */
int fake_released;    /* calls of asi_ctt_release */
int fake_refuse;      /* status of the next asi_ctt_string */
unsigned fake_kind;   /* of the string begun last */
static asi_ctt_t *line;

asi_ctt_kind_t asi_ctt_kind(uint16_t codes)
{
    const unsigned io = codes & 15u, id = (unsigned)codes >> 4 & 15u, id2 = (unsigned)codes >> 12;
    if (io != 7u)
        return ASI_CTT_NONE;
    return id == 4u ? ASI_CTT_1_IN : id == 5u && id2 == 5u ? ASI_CTT_2 : ASI_CTT_NONE;
}
void asi_ctt_init(asi_ctt_t *c) { line = c; c->string = (asi_string_t){.open = false}; }
bool asi_ctt_open(asi_ctt_t *c, unsigned index, uint16_t codes, uint32_t now_us)
{
    (void)c; (void)index; (void)codes; (void)now_us;
    return false;
}
void asi_ctt_close(asi_ctt_t *c, unsigned index)
{
    if (c->string.open && c->string.index == index) {
        c->string.open = false;
        c->string.status = ASI_E_ABORTED;
    }
}
unsigned asi_ctt_first(asi_ctt_t *c, unsigned index, unsigned outputs) { (void)c; (void)index; return outputs; }
unsigned asi_ctt_call(asi_ctt_t *c, unsigned index, const asi_ctt_call_t *call) 
{
    (void)c; (void)index;
    return call->outputs;
}
unsigned asi_ctt_inputs(const asi_ctt_t *c, unsigned index, unsigned answer) { (void)c; (void)index; return answer; }
void asi_ctt_cycle(asi_ctt_t *c, const asi_list_t *las, const asi_list_t *called, const asi_list_t *failed,
                   const uint16_t codes[ASI_INDICES], uint32_t in[ASI_IMAGE_WORDS], uint32_t out[ASI_IMAGE_WORDS])
{
    (void)c; (void)las; (void)called; (void)failed; (void)codes; (void)in; (void)out;
}
asi_list_t asi_ctt_incomplete(const asi_ctt_t *c, const asi_list_t *las, const uint16_t codes[ASI_INDICES])
{
    (void)c; (void)las; (void)codes;
    return ASI_LIST_EMPTY;
}
asi_status_t asi_ctt_string(asi_ctt_t *c, unsigned index, asi_string_kind_t kind, unsigned length, uint32_t now_us)
{
    (void)now_us;
    if (fake_refuse)
        return (asi_status_t)fake_refuse;
    c->string.open = true;
    c->string.index = (uint8_t)index;
    c->string.kind = (uint8_t)kind;
    c->string.length = (uint16_t)length;
    c->string.status = ASI_E_BUSY;
    fake_kind = kind;
    return ASI_OK;
}
bool asi_ctt_hold(asi_ctt_t *c, unsigned index) { (void)c; (void)index; return !fake_holds || --fake_holds == 0; }
void asi_ctt_release(asi_ctt_t *c, unsigned index, uint32_t now_us) { (void)c; (void)index; (void)now_us; fake_released++; }
/** The transfer ends with this status; so many bytes 0, 1, 2 ... were read. */
void fake_end(int status, unsigned length)
{
    line->string.open = false;
    line->string.status = (asi_status_t)status;
    line->string.length = (uint16_t)length;
    for (unsigned k = 0; k < length; k++)
        line->string.bytes[k] = (uint8_t)k;
}
int fake_open(void) { return line->string.open; }
