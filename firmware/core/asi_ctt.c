/* SPDX-License-Identifier: Apache-2.0 */
/** @file asi_ctt.c  See asi_ctt.h: which slave needs which engine, and the way to it. */
#include "asi_ctt_private.h"

_Static_assert(sizeof(asi_ctt_slave_t) <= 48u, "one per index: RAM");
_Static_assert(ASI_CTT2_MESSAGE_BYTES >= ASI_CTT1_STRING_BYTES, "strings and messages share a buffer");

asi_ctt_kind_t asi_ctt_kind(uint16_t codes)
{
    const unsigned id2 = (unsigned)codes >> 12;
    switch (codes & 0xFFu) { /* ID, IO: a switch, because activation asks it of every slave */
    case 0x17u: case 0x27u: case 0x37u:
    case 0x47u:
        if ((codes & 0xFFu) == 0x47u && id2 == 0u)
            return ASI_CTT_NONE; /* 4I/4O mode */
        return id2 & 8u ? ASI_CTT_1_IN : ASI_CTT_1_OUT;
    case 0x57u:
    case 0xABu: return id2 == 5u ? ASI_CTT_2 : ASI_CTT_NONE;
    case 0xA7u:
        return id2 == 5u   ? ASI_CTT_2
               : id2 == 7u ? ASI_CTT_3_4IO
               : id2 == 8u || id2 == 9u ? ASI_CTT_4
               : id2 == 10u ? ASI_CTT_3_8IO : ASI_CTT_NONE;
    case 0x06u: /* a member says its place in the group: first = 8 + n, others 4 + those still to come */
        return (id2 >= 5u && id2 <= 7u) || (id2 >= 10u && id2 <= 12u) ? ASI_CTT_5 : ASI_CTT_NONE;
    default: return (codes & 0xF0u) == 0xB0u ? ASI_CTT_SAFETY : ASI_CTT_NONE;
    }
}

void asi_ctt_init(asi_ctt_t *c)
{
    *c = (asi_ctt_t){0};
}

/* ---- what the engines share */

void asi_ctt_status_set(asi_ctt_t *c, unsigned index, unsigned clear, unsigned set)
{
    const unsigned status = (c->status[index] & ~clear) | set;
    if (status != c->status[index]) {
        c->status[index] = (uint8_t)status;
        asi_list_add(&c->changed, index);
    }
}

void asi_ctt_show(asi_ctt_t *c, unsigned index, unsigned channel, unsigned value, unsigned clear, unsigned set)
{
    uint16_t *const ai = &c->ai[asi_analog_word(index) + channel];
    const unsigned status = (c->status[index] & ~clear) | set;
    if (*ai != value || status != c->status[index]) {
        *ai = (uint16_t)value;
        c->status[index] = (uint8_t)status;
        asi_list_add(&c->changed, index);
    }
}

void asi_ctt_string_end(asi_ctt_t *c, asi_status_t status, unsigned length)
{
    c->string.open = false;
    c->string.status = status;
    c->string.length = (uint16_t)length;
}

/* ---- interface */

bool asi_ctt_open(asi_ctt_t *c, unsigned index, uint16_t codes, uint32_t now_us)
{
    const asi_ctt_kind_t kind = asi_ctt_kind(codes);
    const bool extended = ((unsigned)codes >> 4 & 15u) == 0xAu;
    if (index >= ASI_INDICES || (index & 31u) == 0u || (index > 32u && !extended))
        return false;
    asi_ctt_close(c, index);
    c->kind[index] = (uint8_t)kind;
    c->slave[index] = (asi_ctt_slave_t){0};
    switch (kind) {
    case ASI_CTT_1_IN:
    case ASI_CTT_1_OUT: asi_ctt1_open(c, index, codes, now_us); break;
    case ASI_CTT_2: asi_ctt2_open(c, index, codes, now_us); break;
    case ASI_CTT_3_4IO:
    case ASI_CTT_3_8IO: asi_ctt3_open(c, index, now_us); break;
    case ASI_CTT_4:
        asi_ctt4_open(c, index, codes, now_us);
        if (!ASI_CTT4_ENABLE)
            return false; /* plain bits, transfer invalid */
        break;
    case ASI_CTT_5: c->groups |= 1u << index; return false; /* index < 32 */
    case ASI_CTT_SAFETY: c->safety |= 1u << index; return false;
    default: return false;
    }
    asi_list_add(&c->live, index);
    return true;
}

void asi_ctt_close(asi_ctt_t *c, unsigned index)
{
    if (index >= ASI_INDICES || c->kind[index] == ASI_CTT_NONE)
        return;
    if (c->string.open && c->string.index == index)
        asi_ctt_string_end(c, ASI_E_ABORTED, 0u);
    switch (c->kind[index]) {
    case ASI_CTT_1_IN:
    case ASI_CTT_1_OUT: asi_ctt1_close(c, index); break;
    case ASI_CTT_2: asi_ctt2_close(c, index); break;
    case ASI_CTT_3_8IO: asi_ctt_show(c, index, 0u, 0u, 0xFFu, 0u); break;
    case ASI_CTT_4: asi_ctt4_close(c, index); break;
    case ASI_CTT_5: asi_ctt5_close(c, index); break;
    default: break;
    }
    asi_ctt_status_set(c, index, 0xFFu, 0u);
    asi_list_remove(&c->live, index);
    if (index < 32u) {
        const uint32_t others = ~(1u << index);
        c->groups &= others;
        c->safety &= others;
        c->safe_in[0].w[0] &= others;
        c->safe_in[1].w[0] &= others;
    }
    c->kind[index] = ASI_CTT_NONE;
}

unsigned asi_ctt_first(asi_ctt_t *c, unsigned index, unsigned outputs)
{
    switch (c->kind[index]) {
    case ASI_CTT_1_IN:
    case ASI_CTT_1_OUT: return asi_ctt1_first(c, index);
    case ASI_CTT_2: return asi_ctt2_first(c, index, outputs);
    case ASI_CTT_3_4IO: return asi_ctt3_first_4io(c, index, outputs);
    case ASI_CTT_3_8IO: return asi_ctt3_first_8io(c, index);
    case ASI_CTT_4:
        if (ASI_CTT4_ENABLE)
            return asi_ctt4_first(c, index, outputs);
        break;
    default: break;
    }
    return outputs ^ CTT_INVERT;
}

unsigned asi_ctt_call(asi_ctt_t *c, unsigned index, const asi_ctt_call_t *call)
{
    switch (c->kind[index]) {
    case ASI_CTT_1_IN:
    case ASI_CTT_1_OUT: return asi_ctt1_call(c, index, call);
    case ASI_CTT_2: return asi_ctt2_call(c, index, call);
    case ASI_CTT_3_4IO: return asi_ctt3_call_4io(c, index, call);
    case ASI_CTT_3_8IO: return asi_ctt3_call_8io(c, index, call);
    case ASI_CTT_4:
        if (ASI_CTT4_ENABLE)
            return asi_ctt4_call(c, index, call);
        break;
    default: break;
    }
    return call->outputs ^ CTT_INVERT;
}

unsigned asi_ctt_inputs(const asi_ctt_t *c, unsigned index, unsigned answer)
{
    switch (c->kind[index]) {
    case ASI_CTT_1_IN:
    case ASI_CTT_1_OUT: return 0u;
    case ASI_CTT_2: return answer & c->slave[index].two.in_mask;
    case ASI_CTT_3_8IO: return c->ai[asi_analog_word(index)] & 15u;
    case ASI_CTT_4: return ASI_CTT4_ENABLE ? 0u : answer;
    default: return answer;
    }
}

bool asi_ctt_hold(asi_ctt_t *c, unsigned index)
{
    const unsigned kind = c->kind[index];
    return (kind != ASI_CTT_1_IN && kind != ASI_CTT_1_OUT) || asi_ctt1_hold(c, index);
}

void asi_ctt_release(asi_ctt_t *c, unsigned index, uint32_t now_us)
{
    const unsigned kind = c->kind[index];
    if (kind == ASI_CTT_1_IN || kind == ASI_CTT_1_OUT)
        asi_ctt1_release(c, index, now_us);
}

asi_status_t asi_ctt_string(asi_ctt_t *c, unsigned index, asi_string_kind_t kind, unsigned length, uint32_t now_us)
{
    asi_status_t status = ASI_E_NOT_ACTIVE;
    if (index >= ASI_INDICES || c->kind[index] == ASI_CTT_NONE)
        return status;
    if (c->string.open)
        return ASI_E_BUSY;
    switch (c->kind[index]) {
    case ASI_CTT_1_IN:
    case ASI_CTT_1_OUT:
        status = kind == ASI_STRING_MESSAGE ? ASI_E_PROFILE : asi_ctt1_string(c, index, kind, length, now_us);
        break;
    case ASI_CTT_2: status = kind == ASI_STRING_MESSAGE ? asi_ctt2_string(c, length) : ASI_E_PROFILE; break;
    default: status = ASI_E_PROFILE; break;
    }
    if (status == ASI_OK) {
        c->string.open = true;
        c->string.index = (uint8_t)index;
        c->string.kind = (uint8_t)kind;
        c->string.status = ASI_E_BUSY;
        c->string.length = (uint16_t)length;
        c->string.position = 0u;
        asi_ctt_status_set(c, index, 0u, ASI_CTT_STRING);
    }
    return status;
}
