/* SPDX-License-Identifier: Apache-2.0 */
/** @file asi_persist.c */
#include "asi_persist.h"
#include "asi_ec.h"
#include "asi_host.h"
#include "asi_spi.h"
#include "asi_store.h"

static asi_store_t store;
static asi_permanent_set_t set;  /* in flash, or on its way there; else the defaults */
static asi_permanent_t wanted;   /* newest request */
static bool requested, opaque_changed, ended;
static bool in_flash;            /* set is */
static asi_status_t result;      /* of the last store */

static bool equal(const asi_permanent_t *a, const asi_permanent_t *b)
{
    bool same = asi_list_equal(&a->projection.lps, &b->projection.lps) && a->protected_mode == b->protected_mode &&
                a->auto_address == b->auto_address && a->data_exchange == b->data_exchange &&
                a->auto_clear == b->auto_clear;
    for (unsigned i = 0; i < ASI_INDICES && same; i++)
        same = a->projection.pcd[i] == b->projection.pcd[i] && a->projection.pp[i] == b->projection.pp[i];
    return same;
}

static void set_defaults(void)
{
    asi_permanent_t *m = &set.master;
    m->projection.lps = ASI_LIST_EMPTY;
    for (unsigned i = 0; i < ASI_INDICES; i++) {
        m->projection.pcd[i] = ASI_CODES_NONE;
        m->projection.pp[i] = 15;
    }
    m->protected_mode = m->auto_address = false;
    m->data_exchange = true;
    m->auto_clear = ASI_AUTO_CLEAR_OFF;
    set.opaque_length = 0;
}

const asi_permanent_t *asi_persist_open(void)
{
    requested = opaque_changed = ended = false;
    result = ASI_OK;
    asi_store_open(&store, &set);
    in_flash = store.state == ASI_STORE_LOADED;
    if (store.state != ASI_STORE_LOADED)
        set_defaults();
    return &set.master;
}

void asi_persist_refuse(void)
{
    store.state = ASI_STORE_CORRUPT;
    in_flash = false;
    set_defaults();
}

void asi_persist_request(const asi_permanent_t *now)
{
    wanted = *now;
    requested = true;
}

static void finish(asi_status_t status)
{
    result = status;
    ended = true;
    in_flash = status == ASI_OK;
}

void asi_persist_serve(void)
{
    if (store.busy) {
        asi_store_serve(&store, asi_spi_time_us());
        if (!store.busy)
            finish(store.saved ? ASI_OK : ASI_E_STORE);
        return;
    }
    if (!requested && !opaque_changed)
        return;
    const bool is_new = opaque_changed || !in_flash || (requested && !equal(&wanted, &set.master));
    if (is_new) {
        if (requested)
            set.master = wanted;
        const asi_status_t status = asi_store_begin(&store, &set);
        if (status != ASI_OK)
            finish(status);
        else
            in_flash = false;
    }
    requested = opaque_changed = false;
}

bool asi_persist_ended(asi_status_t *status)
{
    const bool has = ended;
    *status = result;
    ended = false;
    return has;
}

uint32_t asi_persist_word(void)
{
    const bool open = requested && !(in_flash && !store.busy && equal(&wanted, &set.master));
    const bool busy = store.busy || open || opaque_changed;
    return (uint32_t)store.state << STORE_R__STATE_bp | (busy ? STORE_R__BUSY_bm : 0u) |
           (result != ASI_OK ? STORE_R__FAILED_bm : 0u) | (in_flash && !busy ? STORE_R__SAVED_bm : 0u) |
           (store.sequence << STORE_R__SEQUENCE_bp & STORE_R__SEQUENCE_bm);
}

const uint8_t *asi_persist_opaque(unsigned *length)
{
    *length = set.opaque_length;
    return set.opaque;
}

asi_status_t asi_persist_opaque_set(const uint8_t *bytes, unsigned length)
{
    if (length > ASI_STORE_OPAQUE)
        return ASI_E_OVERFLOW;
    if (store.busy)
        return ASI_E_BUSY;
    opaque_changed = opaque_changed || length != set.opaque_length || !in_flash;
    for (unsigned k = 0; k < length; k++) {
        opaque_changed = opaque_changed || bytes[k] != set.opaque[k];
        set.opaque[k] = bytes[k];
    }
    set.opaque_length = (uint16_t)length;
    return ASI_OK;
}
