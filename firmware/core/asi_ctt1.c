/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_ctt1.c  Combined transaction type 1: values of up to 16 bits and strings, a triple of bits per call.
 * The receiver of the data names the triple it wants: an input slave is called with {control bit, number} and answers
 * {control bit, triple}; an output slave is called with {control bit, triple} and answers {control bit, wanted number}.
 * A triple is accepted when the answer's control bit is that of the call; only then does the control bit toggle. A call
 * that was lost, or sent twice, therefore changes nothing. Numbers inside count down, 0 = the triple with O and V.
 */
#include "asi_ctt_private.h"

enum { HELD, VALUE, STRING_READ, STRING_WRITE };
enum { FIRST_OF_STRING = ASI_CTT1_SEQUENCE_TRIPLES - 1 };

#define CONTROL (1u << ASI_CTT1_TOGGLE_POS)
#define LINE (ASI_CTT1_INVERT_OUT ? 15u : 0u)
#define VALID_AND_NO_OVERFLOW 1u /* last triple without its data bit: O V */

_Static_assert(ASI_CTT1_TOGGLE_POS == 3 || ASI_CTT1_TOGGLE_POS == 0, "three neighbouring bits are left");
_Static_assert(ASI_CTT1_TRIPLES_71 >= 3 && ASI_CTT1_TRIPLES_71 <= 7, "E and 6 .. 18 bits");
_Static_assert(ASI_CTT1_TRIPLES_72 >= 3 && ASI_CTT1_TRIPLES_72 <= 7, "E and 6 .. 18 bits");
_Static_assert(ASI_CTT1_STRING_BYTES % 3 == 0, "whole sequences");
_Static_assert(FIRST_OF_STRING == 7 && ASI_CTT1_VALUE_TRIPLES == 7, "a triple's number has three bits");

static unsigned reversed(unsigned three)
{
    static const uint8_t table[8] = {0, 4, 2, 6, 1, 5, 3, 7};
    return table[three & 7u];
}

/* between three bits and the nibble around them */
static inline unsigned put(unsigned three) { return ASI_CTT1_TOGGLE_POS == 0 ? three << 1 : three; }
static inline unsigned get(unsigned nibble) { return (ASI_CTT1_TOGGLE_POS == 0 ? nibble >> 1 : nibble) & 7u; }
/* between the triple as written, left bit first, and its order in the nibble */
static inline unsigned triple(unsigned three) { return ASI_CTT1_MSB_LEFT ? three : reversed(three); }
/* between the number that counts down and that on the line */
static inline unsigned number(unsigned t) { return ASI_CTT1_COUNT_UP ? 7u - t : t; }
/* between the channel and E1 E2 E3 */
static inline unsigned extension(unsigned e) { return ASI_CTT1_E_REVERSED ? reversed(e) : e; }

/* the next nibble: three bits with the other control bit */
static CTT_ONCE void next(asi_ctt1_t *s, unsigned three)
{
    s->nibble = (uint8_t)(((s->nibble & CONTROL) ^ CONTROL) | put(three));
    s->quiet = false;
}

static CTT_ONCE void ask(asi_ctt1_t *s, unsigned t)
{
    s->t = (uint8_t)t;
    next(s, number(t));
}

static CTT_ONCE void say(asi_ctt1_t *s, unsigned t)
{
    s->t = (uint8_t)t;
    next(s, triple(s->frame >> (3u * t) & 7u));
}

/* bits of a value that its triples carry */
static unsigned data_mask(const asi_ctt1_t *s)
{
    return 0xFFFFu << s->align & 0xFFFFu;
}

/* outputs: take the value of this channel; it is sent whole, whatever the host writes meanwhile */
static CTT_ONCE void latch(asi_ctt1_t *s, const asi_ctt_t *c, unsigned index)
{
    const unsigned value = c->ao[asi_analog_word(index) + s->channel];
    s->frame = (extension(s->channel) << 18 | (value & data_mask(s)) << 2) >> s->align | VALID_AND_NO_OVERFLOW;
}

static void substitute(asi_ctt_t *c, unsigned index)
{
    const asi_ctt1_t *s = &c->slave[index].one;
    for (unsigned k = 0; !s->output && k < s->channels; k++)
        asi_ctt_show(c, index, k, s->transparent ? 0u : CTT_SUBSTITUTE, ASI_CTT_VALID, 0u);
}

void asi_ctt1_open(asi_ctt_t *c, unsigned index, uint16_t codes, uint32_t now_us)
{
    asi_ctt1_t *s = &c->slave[index].one;
    const unsigned id = (unsigned)codes >> 4 & 15u, id2 = (unsigned)codes >> 12;
    unsigned triples = ASI_CTT1_VALUE_TRIPLES;
    s->mode = VALUE;
    s->output = (id2 & 8u) == 0u;
    s->strings = id == 4u;
    s->transparent = id == 3u && (id2 >> 2 & 1u) == ASI_CTT1_ID2_TRANSPARENT;
    s->channels = (uint8_t)((id2 & 2u) != 0u ? 4u : 1u + (id2 & 1u));
    if (id <= 2u) /* shorter values, left-aligned */
        triples = id == 1u ? ASI_CTT1_TRIPLES_71 : ASI_CTT1_TRIPLES_72;
    s->align = (uint8_t)(3u * (7u - triples));
    s->first = (uint8_t)(triples - 1u);
    s->last_us = now_us;
    substitute(c, index);
    asi_ctt_status_set(c, index, 0u, s->transparent ? ASI_CTT_TRANSPARENT : 0u);
    asi_ctt1_first(c, index);
}

void asi_ctt1_close(asi_ctt_t *c, unsigned index)
{
    substitute(c, index);
}

unsigned asi_ctt1_first(asi_ctt_t *c, unsigned index)
{
    asi_ctt1_t *s = &c->slave[index].one;
    s->nibble = ASI_CTT1_START_TOGGLE ? 0u : CONTROL; /* next() toggles it */
    if (s->output) {
        latch(s, c, index);
        say(s, s->first);
    } else {
        ask(s, s->first);
    }
    return s->nibble ^ LINE;
}

/* ---- values */

static void value_in(asi_ctt_t *c, unsigned index, unsigned three)
{
    asi_ctt1_t *s = &c->slave[index].one;
    unsigned t = s->first;
    s->frame = s->frame << 3 | triple(three);
    if (s->drop) {
        s->drop = false;
    } else if (s->t != 0u) {
        t = s->t - 1u;
    } else {
        const uint32_t frame = s->frame << s->align; /* E in bits 20..18, D16 in bit 17 */
        const unsigned channel = extension(frame >> 18 & 7u);
        if (channel < s->channels) { /* else nobody knows whose value it is */
            const bool valid = (s->frame & 3u) == VALID_AND_NO_OVERFLOW;
            const unsigned value = frame >> 2 & data_mask(s);
            if (valid)
                asi_ctt_show(c, index, channel, value, 0u, ctt_valid(channel) | ASI_CTT_TV);
            else
                asi_ctt_show(c, index, channel, s->transparent ? 0u : CTT_SUBSTITUTE, ctt_valid(channel), ASI_CTT_TV);
        }
    }
    ask(s, t);
}

/* wanted: number in the answer; above the first one it means the first one */
static void value_out(asi_ctt_t *c, unsigned index, unsigned wanted, uint32_t now_us)
{
    asi_ctt1_t *s = &c->slave[index].one;
    if (wanted >= s->first) {
        wanted = s->first;
        if (s->t == 0u) {
            s->update_us = now_us;
            asi_ctt_status_set(c, index, 0u, ASI_CTT_OV | ASI_CTT_TV);
            s->channel = (uint8_t)((s->channel + 1u) & (s->channels - 1u));
        }
        latch(s, c, index);
    }
    say(s, wanted);
}

/* ---- strings */

static CTT_ONCE void string_end(asi_ctt_t *c, unsigned index, asi_status_t status)
{
    asi_ctt1_t *s = &c->slave[index].one;
    asi_ctt_string_end(c, status, c->string.position);
    s->mode = HELD;
}

static void string_in(asi_ctt_t *c, unsigned index, unsigned three)
{
    asi_ctt1_t *s = &c->slave[index].one;
    asi_string_t *string = &c->string;
    s->frame = s->frame << 3 | triple(three);
    if (s->t != 0u) {
        ask(s, s->t - 1u);
        return;
    }
    s->quiet = true; /* when it ends here, this nibble stays and has been served */
    if ((s->frame & 1u) == 0u) {
        string_end(c, index, ASI_E_TRANSFER);
        return;
    }
    uint8_t *bytes = &string->bytes[string->position];
    bytes[0] = (uint8_t)(s->frame >> 16);
    bytes[1] = (uint8_t)(s->frame >> 8);
    bytes[2] = (uint8_t)s->frame;
    string->position = (uint16_t)(string->position + 3u);
    if ((s->frame & 2u) == 0u)
        string_end(c, index, ASI_OK);
    else if (string->position >= ASI_CTT1_STRING_BYTES)
        string_end(c, index, ASI_E_OVERFLOW);
    else
        ask(s, FIRST_OF_STRING);
}

static void sequence(asi_ctt1_t *s, const asi_string_t *string)
{
    const uint8_t *bytes = &string->bytes[string->position];
    const unsigned more = string->position + 3u < string->length ? 2u : 0u;
    s->frame = (uint32_t)bytes[0] << 16 | (uint32_t)bytes[1] << 8 | (bytes[2] & 0xFCu) | more | 1u;
}

static void string_out(asi_ctt_t *c, unsigned index, unsigned wanted)
{
    asi_ctt1_t *s = &c->slave[index].one;
    asi_string_t *string = &c->string;
    if (s->t == 0u && (wanted == FIRST_OF_STRING || (s->frame & 2u) == 0u)) {
        string->position = (uint16_t)(string->position + 3u);
        if (string->position >= string->length) {
            s->quiet = true;
            string_end(c, index, ASI_OK);
            return;
        }
        sequence(s, string);
        wanted = FIRST_OF_STRING;
    }
    if (s->budget-- == 0u) { /* the slave always wants something again */
        s->quiet = true;
        string_end(c, index, ASI_E_TRANSFER);
        return;
    }
    say(s, wanted);
}

bool asi_ctt1_hold(asi_ctt_t *c, unsigned index)
{
    asi_ctt1_t *s = &c->slave[index].one;
    if (s->mode == VALUE) {
        s->mode = HELD;
        s->drop = false;
        s->quiet = false;
        s->other_mode = false;
        s->wanted = s->first;
        asi_ctt_status_set(c, index, 0u, ASI_CTT_STRING);
    }
    return s->mode == HELD && s->quiet;
}

asi_status_t asi_ctt1_string(asi_ctt_t *c, unsigned index, asi_string_kind_t kind, unsigned length, uint32_t now_us)
{
    asi_ctt1_t *s = &c->slave[index].one;
    if (!s->strings)
        return ASI_E_PROFILE;
    if (s->mode != HELD || !s->quiet)
        return ASI_E_STATE;
    if (kind == ASI_STRING_WRITE) {
        if (length > ASI_CTT1_STRING_BYTES)
            return ASI_E_OVERFLOW;
        if (length == 0u || !asi_ctt_whole_sequences(length))
            return ASI_E_ARG;
        c->string.position = 0u;
        c->string.length = (uint16_t)length;
        s->mode = STRING_WRITE;
        s->budget = (uint16_t)(8u * length); /* three times the undisturbed number */
        sequence(s, &c->string);
        say(s, FIRST_OF_STRING);
    } else {
        s->mode = STRING_READ;
        ask(s, FIRST_OF_STRING);
    }
    s->last_us = now_us;
    s->other_mode = true;
    return ASI_OK;
}

void asi_ctt1_release(asi_ctt_t *c, unsigned index, uint32_t now_us)
{
    asi_ctt1_t *s = &c->slave[index].one;
    if (s->mode == VALUE)
        return;
    if (s->mode != HELD)
        string_end(c, index, ASI_E_ABORTED);
    s->mode = VALUE;
    s->last_us = now_us;
    asi_ctt_status_set(c, index, ASI_CTT_STRING, 0u);
    if (!s->output) {
        if (s->quiet)
            ask(s, s->first);
        else
            s->drop = true;
    } else {
        /* after another mode the slave begins anew; else it still wants what it named last */
        const unsigned wanted = s->other_mode || s->wanted > s->first ? s->first : s->wanted;
        if (wanted == s->first)
            latch(s, c, index);
        if (s->quiet)
            say(s, wanted);
        else
            s->t = s->first; /* its answer will name the triple; it ends no value */
    }
}

/* ---- calls */

static void overdue(asi_ctt_t *c, unsigned index, uint32_t now_us)
{
    asi_ctt1_t *s = &c->slave[index].one;
    s->last_us = now_us;
    if (s->mode == VALUE) { /* toggle error. The nibble stays: the slave may have served it and would mistake another */
        s->drop = !s->output;
        substitute(c, index);
        asi_ctt_status_set(c, index, ASI_CTT_OV | ASI_CTT_TV, 0u);
    } else if (s->mode != HELD) {
        string_end(c, index, ASI_E_TRANSFER);
    }
}

unsigned asi_ctt1_call(asi_ctt_t *c, unsigned index, const asi_ctt_call_t *call)
{
    asi_ctt1_t *s = &c->slave[index].one;
    const unsigned echo = (call->answer ^ s->nibble ^ (ASI_CTT1_ECHO_INVERTED ? CONTROL : 0u)) & CONTROL;
    if (call->ok && call->sent == (s->nibble ^ LINE) && echo == 0u) {
        const unsigned three = get(call->answer);
        s->last_us = call->now_us;
        switch (s->mode) {
        case VALUE:
            if (s->output)
                value_out(c, index, number(three), call->now_us);
            else
                value_in(c, index, three);
            break;
        case STRING_READ: string_in(c, index, three); break;
        case STRING_WRITE: string_out(c, index, number(three)); break;
        default: /* HELD: the nibble stays */
            s->quiet = true;
            if (!s->other_mode)
                s->wanted = (uint8_t)number(three);
            break;
        }
    } else if (ctt_elapsed(call->now_us, s->last_us, ASI_CTT1_TIMEOUT_MS)) {
        overdue(c, index, call->now_us);
    }
    if ((c->status[index] & ASI_CTT_OV) != 0u && ctt_elapsed(call->now_us, s->update_us, ASI_CTT1_OUTPUT_MS))
        asi_ctt_status_set(c, index, ASI_CTT_OV, 0u);
    return s->nibble ^ LINE;
}
