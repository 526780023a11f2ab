/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_ctt2.c  Combined transaction type 2: messages, a bit per two calls, with a clock line each way.
 * The master's clock moves on only when the nibble with its last level was answered, so the slave sees every level; a
 * call that was sent twice shows the same level twice. The receiver looks at every answer. A slave whose answer was
 * lost may go on all the same: its message is a bit short then, never complete, and ends in a gap; a cyclic request is
 * sent again.
 */
#include "asi_ctt_private.h"

enum { GAP, SEND, RECEIVE, IDLE };
enum { READ_ID, GET, PUT, MESSAGE };

#define DO_CLOCK (1u << ASI_CTT2_DO_CLOCK)
#define DO_DATA (1u << ASI_CTT2_DO_DATA)
#define DO_BOTH (DO_CLOCK | DO_DATA)
#define DI_CLOCK (1u << ASI_CTT2_DI_CLOCK)
#define DI_DATA (1u << ASI_CTT2_DI_DATA)
#define IDLE_LEVEL (((ASI_CTT2_IDLE & 1) ? DO_CLOCK : 0u) | ((ASI_CTT2_IDLE & 2) ? DO_DATA : 0u))
#define TAKEN_AT (ASI_CTT2_RISING_EDGE ? 1u : 0u) /* clock level after the edge that takes a bit */

enum { ID_BYTES = 5, RESPONSE_OK = 0x40, RESPONSE_ERROR = 0x80 };
enum { REQUEST_READ = 0x10, REQUEST_WRITE, REQUEST_DEVICE_READ, REQUEST_DEVICE_WRITE, REQUEST_EXCHANGE = 0x1D };
#define ID_CODE 0x10u /* the ID object is index 0 of a read */

static CTT_ONCE uint8_t *buffer(asi_ctt_t *c, unsigned index)
{
    asi_ctt2_t *s = &c->slave[index].two;
    return s->service == MESSAGE ? c->string.bytes : s->bytes;
}

/* of the value image: two for an A or B slave; what the slave moves beyond is not shown, and 0 */
static CTT_ONCE unsigned words(const asi_ctt_t *c, unsigned index, unsigned bytes)
{
    const unsigned n = (bytes + 1u) >> 1;
    return c->slave[index].two.two_words && n > 2u ? 2u : n;
}

static CTT_ONCE void invalid(asi_ctt_t *c, unsigned index)
{
    const asi_ctt2_t *s = &c->slave[index].two;
    for (unsigned k = 0; k < words(c, index, s->in_bytes); k++)
        asi_ctt_show(c, index, k, 0u, ASI_CTT_VALID, 0u);
}

static bool message_open(const asi_ctt_t *c, unsigned index)
{
    return c->string.open && c->string.index == index;
}

static void level(asi_ctt2_t *s, unsigned clock, unsigned data)
{
    s->level = (uint8_t)((clock != 0u ? DO_CLOCK : 0u) | (data != 0u ? DO_DATA : 0u));
}

/* ---- sending */

/* first half of the next bit: the other clock level, data already there */
static CTT_ONCE void send_bit(asi_ctt2_t *s)
{
    const unsigned data = ASI_CTT2_MSB_FIRST ? s->tx & 0x80u : s->tx & 1u;
    s->tx = (uint8_t)(ASI_CTT2_MSB_FIRST ? s->tx << 1 : s->tx >> 1);
    s->tx_bits--;
    s->half = 0u;
    level(s, !TAKEN_AT, data);
}

static CTT_ONCE void send(asi_ctt_t *c, unsigned index, unsigned service, unsigned length)
{
    asi_ctt2_t *s = &c->slave[index].two;
    s->service = (uint8_t)service;
    s->step = SEND;
    s->position = 0u;
    s->length = (uint16_t)length;
    s->tx = buffer(c, index)[0];
    s->code = s->tx;
    s->reads = buffer(c, index)[2]; /* of no meaning for those that read nothing */
    s->tx_bits = 8u;
    send_bit(s);
}

static void gap(asi_ctt2_t *s)
{
    s->step = GAP;
    s->quiet = 0u;
    s->level = IDLE_LEVEL;
}

/* the next message, or idle */
static void choose(asi_ctt_t *c, unsigned index)
{
    asi_ctt2_t *s = &c->slave[index].two;
    if (!s->known) {
        s->bytes[0] = ID_CODE;
        s->bytes[1] = 0u;
        s->bytes[2] = ID_BYTES;
        send(c, index, READ_ID, 3u);
    } else if (message_open(c, index)) {
        send(c, index, MESSAGE, c->string.length);
    } else if (s->out_bytes != 0u && (s->put || s->in_bytes == 0u)) {
        const uint16_t *ao = &c->ao[asi_analog_word(index)];
        const unsigned n = words(c, index, s->out_bytes);
        s->put = false;
        s->bytes[0] = 1u;
        for (unsigned k = 0; 2u * k < s->out_bytes; k++) {
            const unsigned value = k < n ? ao[k] : 0u;
            s->bytes[1u + 2u * k] = (uint8_t)(value >> 8);
            s->bytes[2u + 2u * k] = (uint8_t)value;
        }
        if (s->out_bytes == 1u)
            s->bytes[1] = s->bytes[2];
        send(c, index, PUT, 1u + s->out_bytes);
    } else if (s->in_bytes != 0u) {
        s->put = true;
        s->bytes[0] = 0u;
        send(c, index, GET, 1u);
    } else {
        s->step = IDLE;
        s->level = IDLE_LEVEL;
    }
}

/* ---- after a message */

/* length of the response, 0: a gap ends it */
static unsigned response_length(const asi_ctt2_t *s, unsigned request, unsigned first)
{
    if (first == request + RESPONSE_OK) {
        const bool writes = request == REQUEST_WRITE || request == REQUEST_DEVICE_WRITE;
        return writes ? 1u : 1u + s->reads;
    }
    return request == REQUEST_READ || request == REQUEST_WRITE ? 2u : 0u;
}

static void message_end(asi_ctt_t *c, unsigned index, asi_status_t status, unsigned length)
{
    asi_ctt_string_end(c, status, length);
    asi_ctt_status_set(c, index, ASI_CTT_STRING, 0u);
}

/* nothing, or a broken response */
static void fail(asi_ctt_t *c, unsigned index, bool silent)
{
    asi_ctt2_t *s = &c->slave[index].two;
    if (s->service == MESSAGE) {
        message_end(c, index, ASI_E_TRANSFER, 0u);
    } else {
        asi_ctt_status_set(c, index, ASI_CTT_TV | ASI_CTT_OV, 0u);
        if (silent || ++s->fails >= ASI_CTT2_TRIES) {
            s->fails = 0u;
            invalid(c, index);
        }
    }
    gap(s);
}

static void whole(asi_ctt_t *c, unsigned index)
{
    asi_ctt2_t *s = &c->slave[index].two;
    static const uint8_t bytes_of[8] = {0, 1, 2, 4, 6, 8, 0, 0}; /* of the I/O configuration byte */
    switch (s->service) {
    case READ_ID:
        if (s->bytes[0] != ID_CODE + RESPONSE_OK) { /* the bits are right; it may be busy */
            s->try_us = s->since_us;
            gap(s);
            return;
        }
        s->known = true;
        s->in_bytes = bytes_of[s->bytes[5] & 7u];
        s->out_bytes = bytes_of[s->bytes[5] >> 4 & 7u];
        break;
    case GET: {
        const uint8_t *bytes = s->bytes;
        uint16_t *ai = &c->ai[asi_analog_word(index)];
        unsigned changed = 0u, valid = 0u;
        for (unsigned n = words(c, index, s->in_bytes); n != 0u; n--) {
            const unsigned value = s->in_bytes == 1u ? bytes[0] : (unsigned)bytes[0] << 8 | bytes[1];
            changed |= *ai ^ value;
            *ai++ = (uint16_t)value;
            bytes += 2;
            valid += valid + 1u; /* 1, 3, 7, 15 */
        }
        if (changed != 0u)
            asi_list_add(&c->changed, index);
        asi_ctt_status_set(c, index, 0u, valid);
        break;
    }
    default: { /* MESSAGE */
        const bool good = c->string.bytes[0] == s->code + RESPONSE_OK;
        message_end(c, index, good ? ASI_OK : ASI_E_DEVICE, s->position);
        break;
    }
    }
    s->fails = 0u;
    asi_ctt_status_set(c, index, 0u, ASI_CTT_TV);
    s->step = IDLE; /* the next message is chosen with the next call: both in one would be the longest call by far */
}

/* the slave has seen the last level of the request */
static void sent(asi_ctt_t *c, unsigned index, uint32_t now_us)
{
    asi_ctt2_t *s = &c->slave[index].two;
    if (s->service == PUT) { /* no answer to it */
        asi_ctt_status_set(c, index, 0u, ASI_CTT_OV | ASI_CTT_TV);
        choose(c, index);
        return;
    }
    s->step = RECEIVE;
    s->level = IDLE_LEVEL;
    s->since_us = now_us;
    s->position = 0u;
    s->rx_bits = 0u;
    s->length = s->service == GET ? s->in_bytes : 1u;
}

static void advance(asi_ctt_t *c, unsigned index, uint32_t now_us)
{
    asi_ctt2_t *s = &c->slave[index].two;
    if (s->half == 0u) {
        s->half = 1u;
        s->level ^= DO_CLOCK;
    } else if (s->tx_bits != 0u) {
        send_bit(s);
    } else if (++s->position < s->length) {
        s->tx = buffer(c, index)[s->position];
        s->tx_bits = 8u;
        send_bit(s);
    } else {
        sent(c, index, now_us);
    }
}

/* ---- receiving */

static void byte(asi_ctt_t *c, unsigned index)
{
    asi_ctt2_t *s = &c->slave[index].two;
    uint8_t *bytes = buffer(c, index);
    const unsigned most = s->service == MESSAGE ? ASI_CTT2_MESSAGE_BYTES : sizeof s->bytes;
    if (s->position == 0u && s->service != GET) {
        if (s->rx != s->code + RESPONSE_OK && s->rx != s->code + RESPONSE_ERROR) {
            fail(c, index, false);
            return;
        }
        s->length = (uint16_t)response_length(s, s->code, s->rx);
    }
    if (s->position >= most) { /* an endless error response */
        fail(c, index, false);
        return;
    }
    bytes[s->position++] = s->rx;
    if (s->position == s->length)
        whole(c, index);
}

static void receive(asi_ctt_t *c, unsigned index, unsigned answer)
{
    asi_ctt2_t *s = &c->slave[index].two;
    const bool swapped = asi_list_has(&c->swapped, index);
    const unsigned clock = (answer & (swapped ? DI_DATA : DI_CLOCK)) != 0u;
    const unsigned data = (answer & (swapped ? DI_CLOCK : DI_DATA)) != 0u;
    if (clock == s->clock) {
        if (s->still < ASI_CTT2_GAP_CALLS && ++s->still == ASI_CTT2_GAP_CALLS && s->step == RECEIVE
            && (s->position | s->rx_bits) != 0u) {
            if (s->length == 0u && s->position >= 2u && s->rx_bits == 0u)
                whole(c, index);
            else
                fail(c, index, false);
        }
        return;
    }
    s->clock = (uint8_t)clock;
    s->still = 0u;
    s->quiet = 0u;
    if (clock != TAKEN_AT || s->step != RECEIVE)
        return;
    const unsigned rx = s->rx;
    s->rx = (uint8_t)(ASI_CTT2_MSB_FIRST ? rx << 1 | data : rx >> 1 | data << 7);
    if (++s->rx_bits == 8u) {
        s->rx_bits = 0u;
        byte(c, index);
    }
}

/* ---- interface */

void asi_ctt2_open(asi_ctt_t *c, unsigned index, uint16_t codes, uint32_t now_us)
{
    asi_ctt2_t *s = &c->slave[index].two;
    const unsigned io = codes & 15u, id = (unsigned)codes >> 4 & 15u;
    s->two_words = id == 0xAu;
    s->in_mask = io == 7u ? (uint8_t)(15u & ~(DI_CLOCK | DI_DATA)) : 0u;
    s->out_mask = io != 7u ? 0u : (uint8_t)((id == 0xAu ? 7u : 15u) & ~DO_BOTH);
    s->clock = ASI_CTT2_IDLE & 1u;
    s->try_us = now_us;
    gap(s); /* the slave may have been in the middle of something */
}

void asi_ctt2_close(asi_ctt_t *c, unsigned index)
{
    invalid(c, index);
}

unsigned asi_ctt2_first(const asi_ctt_t *c, unsigned index, unsigned outputs)
{
    const asi_ctt2_t *s = &c->slave[index].two;
    return s->level | (((outputs & s->out_mask) ^ CTT_INVERT) & 15u & ~DO_BOTH);
}

unsigned asi_ctt2_call(asi_ctt_t *c, unsigned index, const asi_ctt_call_t *call)
{
    asi_ctt2_t *s = &c->slave[index].two;
    if (call->ok) {
        const unsigned before = s->step;
        receive(c, index, call->answer);
        /* a late nibble shows the old level: nothing happened */
        if (s->step == before && ((call->sent ^ s->level) & DO_BOTH) == 0u) {
            if (s->step == SEND)
                advance(c, index, call->now_us);
            else if (s->step == IDLE || (s->step == GAP && ++s->quiet > ASI_CTT2_GAP_CALLS))
                choose(c, index);
        }
    }
    if (s->known && s->step != GAP)
        s->try_us = call->now_us; /* known: when the gap began */
    if (ctt_elapsed(call->now_us, s->try_us, s->known ? ASI_CTT2_RESPONSE_MS : ASI_CTT2_TRY_MS)) {
        s->try_us = call->now_us;
        if (s->known)
            s->service = GET; /* its clock never rests: no gap comes, so nothing can be asked */
        else if (asi_list_has(&c->swapped, index))
            asi_list_remove(&c->swapped, index);
        else
            asi_list_add(&c->swapped, index);
        if (message_open(c, index))
            message_end(c, index, ASI_E_TRANSFER, 0u);
        fail(c, index, true);
    } else if (s->step == RECEIVE && (s->position | s->rx_bits) == 0u
               && ctt_elapsed(call->now_us, s->since_us, ASI_CTT2_RESPONSE_MS)) {
        fail(c, index, true);
    }
    return asi_ctt2_first(c, index, call->outputs);
}

asi_status_t asi_ctt2_string(const asi_ctt_t *c, unsigned length)
{
    const uint8_t *bytes = c->string.bytes;
    unsigned need = 3u, reads = bytes[2];
    if (length > ASI_CTT2_MESSAGE_BYTES)
        return ASI_E_OVERFLOW;
    if (length < 3u)
        return ASI_E_ARG;
    switch (bytes[0]) {
    case REQUEST_READ:
    case REQUEST_DEVICE_READ: break;
    case REQUEST_WRITE:
    case REQUEST_DEVICE_WRITE:
        need += reads;
        reads = 0u;
        break;
    case REQUEST_EXCHANGE: need = 4u + (length > 3u ? bytes[3] : 0u); break;
    default: return ASI_E_ARG;
    }
    if (length != need)
        return ASI_E_ARG;
    if (1u + reads > ASI_CTT2_MESSAGE_BYTES)
        return ASI_E_OVERFLOW;
    return ASI_OK;
}
