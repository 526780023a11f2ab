/* SPDX-License-Identifier: Apache-2.0 */
/** @file asi_store.c  The format and the reasons for the order of the steps: docs/storage.md. */
#include "asi_store.h"

enum {
    HEADER = 16,      /* magic, sequence, payload length and version, CRC of these */
    HEADER_DATA = 12, /* bytes of it under the CRC */
    TRAILER = 4,      /* CRC of header data and payload */
    /* payload: position of each part */
    AT_LPS = 0, AT_PCD = 8, AT_PP = AT_PCD + 2 * ASI_INDICES, AT_FLAGS = AT_PP + ASI_INDICES / 2,
    AT_LENGTH = AT_FLAGS + 1, AT_OPAQUE = AT_LENGTH + 2,
    FLAG_PROTECTED = 1, FLAG_AUTO_ADDRESS = 2, FLAG_DATA_EXCHANGE = 4, CLEAR_SHIFT = 4, FLAGS_USED = 0x37,
    VERSION = 1,
    CHUNK = 32,       /* bytes read at once */
    FILL_BYTES = 64,  /* bytes prepared in one step */
};
#define MAGIC 0x50495341u /* 'ASIP' */
#define NONE 0xFFFFFFFFu

_Static_assert(HEADER + AT_OPAQUE + ASI_STORE_OPAQUE + TRAILER <= ASI_FLASH_SECTOR, "a set fits a sector");

typedef enum { IDLE, ERASE, ERASING, BLANK, FILL, PROGRAM, PROGRAMMING, VERIFY } step_t;

/* ------------------------------------------------------------------------------------------ bytes of a record */

/** CRC-32 (0x04C11DB7 reflected), a nibble at a time. */
static uint32_t crc_add(uint32_t crc, unsigned byte)
{
    static const uint32_t table[16] = {
        0x00000000u, 0x1DB71064u, 0x3B6E20C8u, 0x26D930ACu, 0x76DC4190u, 0x6B6B51F4u, 0x4DB26158u, 0x5005713Cu,
        0xEDB88320u, 0xF00F9344u, 0xD6D6A3E8u, 0xCB61B38Cu, 0x9B64C2B0u, 0x86D3D2D4u, 0xA00AE278u, 0xBDBDF21Cu};
    crc ^= byte;
    crc = crc >> 4 ^ table[crc & 15u];
    return crc >> 4 ^ table[crc & 15u];
}

/** The CRC begins with the place, so that a copy of a record, as part of the host's block too, is none. */
static uint32_t crc_begin(uint32_t address)
{
    return ~address;
}

static unsigned byte_of(uint32_t word, unsigned n)
{
    return word >> 8u * (n & 3u) & 255u;
}

static unsigned payload_get(const asi_permanent_set_t *set, unsigned at)
{
    const asi_permanent_t *m = &set->master;
    if (at < AT_PCD)
        return byte_of(m->projection.lps.w[at >> 2], at);
    if (at < AT_PP)
        return byte_of(m->projection.pcd[(at - AT_PCD) >> 1], at & 1u);
    if (at < AT_FLAGS)
        return m->projection.pp[2u * (at - AT_PP)] | (unsigned)m->projection.pp[2u * (at - AT_PP) + 1u] << 4;
    if (at < AT_LENGTH)
        return (m->protected_mode ? FLAG_PROTECTED : 0u) | (m->auto_address ? FLAG_AUTO_ADDRESS : 0u) |
               (m->data_exchange ? FLAG_DATA_EXCHANGE : 0u) | (unsigned)m->auto_clear << CLEAR_SHIFT;
    if (at < AT_OPAQUE)
        return byte_of(set->opaque_length, at - AT_LENGTH);
    return set->opaque[at - AT_OPAQUE];
}

/** The bytes come in rising order. @return false: this set was not written by this format */
static bool payload_put(asi_permanent_set_t *set, unsigned at, unsigned byte)
{
    asi_permanent_t *m = &set->master;
    if (at < AT_PCD) {
        uint32_t *word = &m->projection.lps.w[at >> 2];
        *word = *word >> 8 | (uint32_t)byte << 24;
        return (at & 3u) != 0u || (byte & 1u) == 0u; /* neither 0 nor 32 */
    }
    if (at < AT_PP) {
        uint16_t *codes = &m->projection.pcd[(at - AT_PCD) >> 1];
        *codes = (uint16_t)(*codes >> 8 | byte << 8);
    } else if (at < AT_FLAGS) {
        m->projection.pp[2u * (at - AT_PP)] = byte & 15u;
        m->projection.pp[2u * (at - AT_PP) + 1u] = (uint8_t)(byte >> 4);
    } else if (at < AT_LENGTH) {
        m->protected_mode = (byte & FLAG_PROTECTED) != 0u;
        m->auto_address = (byte & FLAG_AUTO_ADDRESS) != 0u;
        m->data_exchange = (byte & FLAG_DATA_EXCHANGE) != 0u;
        m->auto_clear = (uint8_t)(byte >> CLEAR_SHIFT & 3u);
        return (byte & ~(unsigned)FLAGS_USED) == 0u;
    } else if (at < AT_OPAQUE) {
        set->opaque_length = (uint16_t)(set->opaque_length >> 8 | byte << 8);
    } else {
        set->opaque[at - AT_OPAQUE] = (uint8_t)byte;
    }
    return true;
}

/** Byte of the header of the record under way, without its CRC. */
static unsigned header_get(const asi_store_t *s, unsigned at)
{
    const uint32_t payload = s->length - (uint32_t)(HEADER + TRAILER);
    return byte_of(at < 4u ? MAGIC : at < 8u ? s->next_sequence : payload | (uint32_t)VERSION << 16, at);
}

/** Next bytes of the record into store->page. @return true when the page or the record ends */
static bool fill_page(asi_store_t *s)
{
    for (unsigned n = 0; n < FILL_BYTES && s->position < s->length; n++, s->position++) {
        const unsigned at = s->position;
        unsigned byte;
        if (at >= HEADER_DATA && at < HEADER) { /* not under the CRC itself: a CRC of a CRC forgets what was before */
            byte = byte_of(~s->crc, at);
        } else if (at >= (unsigned)(s->length - TRAILER)) {
            byte = byte_of(~s->crc, at - (unsigned)(s->length - TRAILER));
        } else {
            byte = at < HEADER_DATA ? header_get(s, at) : payload_get(s->set, at - HEADER);
            s->crc = crc_add(s->crc, byte);
        }
        s->page[at % ASI_FLASH_PAGE] = (uint8_t)byte;
    }
    return s->position % ASI_FLASH_PAGE == 0u || s->position == s->length;
}

/* ------------------------------------------------------------------------------------------ start */

typedef struct {
    uint32_t address, sequence;
    unsigned length;  /* of the payload */
    bool good, blank;
} header_t;

static uint32_t word_at(const uint8_t *bytes)
{
    return bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

static header_t read_header(uint32_t address)
{
    uint8_t bytes[HEADER];
    uint32_t crc = crc_begin(address), all = NONE;
    header_t h = {.address = address};

    asi_flash_read(address, bytes, HEADER);
    for (unsigned k = 0; k < HEADER_DATA; k++)
        crc = crc_add(crc, bytes[k]);
    for (unsigned k = 0; k < HEADER; k += 4u)
        all &= word_at(&bytes[k]);
    h.blank = all == NONE;
    h.sequence = word_at(&bytes[4]);
    h.length = bytes[8] | (unsigned)bytes[9] << 8;
    h.good = word_at(&bytes[0]) == MAGIC && bytes[10] == VERSION && bytes[11] == 0u && h.length >= AT_OPAQUE &&
             address % ASI_FLASH_SECTOR + HEADER + h.length + TRAILER <= ASI_FLASH_SECTOR &&
             word_at(&bytes[HEADER_DATA]) == ~crc;
    return h;
}

/** Sequence numbers wrap. An attempt that a cut has spoilt may have used the number that the next one uses: of equal
 * numbers the one farther on in the ring of sectors is newer. */
static bool is_newer(const header_t *a, const header_t *b)
{
    const uint32_t ahead = a->sequence - b->sequence, beyond = (a->address - b->address) % ASI_FLASH_AREA;
    return ahead != 0u ? ahead < 0x80000000u : beyond < ASI_FLASH_AREA / 2u;
}

static bool is_rejected(const uint32_t *rejected, unsigned n, uint32_t address)
{
    while (n-- != 0u) {
        if (rejected[n] == address)
            return true;
    }
    return false;
}

/** Newest record that is not rejected. @return good = false: none; blank then tells that there is nothing at all */
static header_t find_newest(const uint32_t *rejected, unsigned n)
{
    header_t best = {.good = false, .blank = true};
    for (uint32_t sector = 0; sector < ASI_FLASH_AREA; sector += ASI_FLASH_SECTOR) {
        uint32_t page = 0;
        while (page < ASI_FLASH_SECTOR) {
            const header_t h = read_header(sector + page);
            if (h.blank)
                break; /* a sector is filled in rising order */
            page += ASI_FLASH_PAGE;
            best.blank = false;
            if (!h.good)
                continue; /* a spoilt header must not hide the records behind it */
            page += (HEADER + h.length + TRAILER - 1u) / ASI_FLASH_PAGE * ASI_FLASH_PAGE;
            if (!is_rejected(rejected, n, h.address) && (!best.good || is_newer(&h, &best)))
                best = h;
        }
    }
    return best;
}

/** What is checked is what is used: one pass over the flash, whose doubtful cells may read differently next time. */
static bool read_set(const header_t *h, asi_permanent_set_t *set, uint8_t *page)
{
    const unsigned end = HEADER + h->length + TRAILER;
    uint32_t crc = crc_begin(h->address), trailer = 0;
    bool good = true;

    for (unsigned at = 0; at < end; at += ASI_FLASH_PAGE) {
        const unsigned n = end - at < ASI_FLASH_PAGE ? end - at : ASI_FLASH_PAGE;
        asi_flash_read(h->address + at, page, n);
        for (unsigned k = 0; k < n; k++) {
            const unsigned position = at + k;
            if (position >= end - TRAILER) {
                trailer = trailer >> 8 | (uint32_t)page[k] << 24;
            } else if (position < HEADER_DATA || position >= HEADER) {
                crc = crc_add(crc, page[k]);
                if (position >= HEADER && position - HEADER < AT_OPAQUE + ASI_STORE_OPAQUE)
                    good = payload_put(set, position - HEADER, page[k]) && good;
            }
        }
    }
    return good && trailer == ~crc && set->opaque_length <= ASI_STORE_OPAQUE &&
           set->opaque_length == h->length - AT_OPAQUE;
}

void asi_store_open(asi_store_t *s, asi_permanent_set_t *set)
{
    uint32_t rejected[ASI_STORE_CANDIDATES];

    *s = (asi_store_t){.state = ASI_STORE_ABSENT, .newest = NONE, .sector = ASI_FLASH_SECTORS - 1u};
    if (!asi_flash_open())
        return;
    s->state = ASI_STORE_CORRUPT;
    for (unsigned n = 0; n < ASI_STORE_CANDIDATES; n++) {
        const header_t h = find_newest(rejected, n);
        if (!h.good) {
            if (h.blank)
                s->state = ASI_STORE_EMPTY;
            break;
        }
        if (n == 0u)
            s->next_sequence = h.sequence; /* new sets count on from here even if this one is spoilt */
        if (read_set(&h, set, s->page)) {
            s->state = ASI_STORE_LOADED;
            s->saved = true;
            s->sequence = h.sequence;
            s->newest = h.address;
            s->sector = (uint8_t)(h.address / ASI_FLASH_SECTOR);
            break;
        }
        rejected[n] = h.address;
    }
}

/* ------------------------------------------------------------------------------------------ store */

static void begin_record(asi_store_t *s, uint32_t address)
{
    s->at = address;
    s->position = 0;
    s->crc = crc_begin(address);
    s->step = FILL;
}

/** The newest whole set is never erased. */
static void begin_sector(asi_store_t *s)
{
    s->open = false;
    s->sector = (uint8_t)((s->sector + 1u) % ASI_FLASH_SECTORS);
    if (s->newest != NONE && s->newest / ASI_FLASH_SECTOR == s->sector)
        s->sector = (uint8_t)((s->sector + 1u) % ASI_FLASH_SECTORS);
    s->step = ERASE;
}

static void end(asi_store_t *s, bool good)
{
    s->busy = false;
    s->failed = !good;
    s->saved = good;
    s->step = IDLE;
}

/** This sector does not take the data. */
static void give_up_sector(asi_store_t *s)
{
    s->open = false;
    if (++s->tries < ASI_STORE_TRIES)
        begin_sector(s);
    else
        end(s, false);
}

static uint32_t pages_of(unsigned bytes)
{
    return (bytes + ASI_FLASH_PAGE - 1u) / ASI_FLASH_PAGE * ASI_FLASH_PAGE;
}

static bool in_range(const asi_permanent_set_t *set)
{
    const asi_permanent_t *m = &set->master;
    unsigned parameters = 0;
    for (unsigned i = 0; i < ASI_INDICES; i++)
        parameters |= m->projection.pp[i];
    return set->opaque_length <= ASI_STORE_OPAQUE && parameters <= 15u && m->auto_clear <= ASI_AUTO_CLEAR_BOTH &&
           ((m->projection.lps.w[0] | m->projection.lps.w[1]) & 1u) == 0u;
}

asi_status_t asi_store_begin(asi_store_t *s, const asi_permanent_set_t *set)
{
    if (s->state == ASI_STORE_ABSENT)
        return ASI_E_STORE;
    if (s->busy)
        return ASI_E_BUSY;
    if (!in_range(set))
        return ASI_E_ARG;
    s->set = set;
    s->length = (uint16_t)(HEADER + AT_OPAQUE + set->opaque_length + TRAILER);
    if (++s->next_sequence == 0u)
        s->next_sequence = 1u; /* 0 says that there is none */
    s->tries = 0;
    s->busy = true;
    s->failed = s->saved = false;
    if (s->open && s->at % ASI_FLASH_SECTOR != 0u && s->at % ASI_FLASH_SECTOR + s->length <= ASI_FLASH_SECTOR)
        begin_record(s, s->at);
    else
        begin_sector(s);
    return ASI_OK;
}

/** Whether flash content is store->page, or blank. */
static bool reads_as(const asi_store_t *s, uint32_t address, unsigned bytes, bool blank)
{
    uint8_t chunk[CHUNK];
    for (unsigned at = 0; at < bytes; at += CHUNK) {
        const unsigned n = bytes - at < CHUNK ? bytes - at : CHUNK;
        asi_flash_read(address + at, chunk, n);
        for (unsigned k = 0; k < n; k++) {
            if (chunk[k] != (blank ? 255u : s->page[at + k]))
                return false;
        }
    }
    return true;
}

/** An operation under way: @return true when it has ended; gives the sector up when it takes too long */
static bool has_ended(asi_store_t *s, uint32_t now_us, uint32_t limit_us)
{
    if (!asi_flash_busy())
        return true;
    if (now_us - s->since_us > limit_us)
        give_up_sector(s);
    return false;
}

void asi_store_serve(asi_store_t *s, uint32_t now_us)
{
    const uint32_t sector = s->sector * ASI_FLASH_SECTOR;
    const uint32_t done = s->position == 0u ? 0u : (s->position - 1u) / ASI_FLASH_PAGE * ASI_FLASH_PAGE; /* last page */

    switch ((step_t)s->step) {
    case ERASE: /* also when it reads as blank: a broken off erase can do so and forget later */
        if (!has_ended(s, now_us, ASI_STORE_ERASE_US))
            break; /* of a sector given up: a busy flash would not hear the erase */
        asi_flash_erase(sector);
        s->since_us = now_us;
        s->position = 0;
        s->step = ERASING;
        break;
    case ERASING:
        if (has_ended(s, now_us, ASI_STORE_ERASE_US))
            s->step = BLANK;
        break;
    case BLANK:
        if (!reads_as(s, sector + s->position, ASI_FLASH_PAGE, true)) {
            give_up_sector(s);
        } else if ((s->position = (uint16_t)(s->position + ASI_FLASH_PAGE)) == ASI_FLASH_SECTOR) {
            s->open = true;
            begin_record(s, sector);
        }
        break;
    case FILL:
        if (fill_page(s))
            s->step = PROGRAM;
        break;
    case PROGRAM:
        asi_flash_program(s->at + done, s->page, s->position - done);
        s->since_us = now_us;
        s->step = PROGRAMMING;
        break;
    case PROGRAMMING:
        if (has_ended(s, now_us, ASI_STORE_PROGRAM_US))
            s->step = VERIFY;
        break;
    case VERIFY:
        if (!reads_as(s, s->at + done, s->position - done, false)) {
            give_up_sector(s);
        } else if (s->position < s->length) {
            s->step = FILL;
        } else {
            s->newest = s->at;
            s->sequence = s->next_sequence;
            s->at += pages_of(s->length); /* at the sector's end: the start of the next, which asks for an erase */
            end(s, true);
        }
        break;
    case IDLE:
        break;
    }
}
