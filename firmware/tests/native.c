/* SPDX-License-Identifier: Apache-2.0 */
/** @file native.c  See native.h. */
#include "native.h"
#include <string.h>
#include "asi_calls.h"
#include "asi_ec.h"

static asi_ec_t ec;
static fw_port port;
static asi_projection_t projections[2]; /* the core keeps a reference, so a new one goes into the other */
static unsigned used;

static fw_request record(const asi_request_t *request)
{
    if (request->call >= 0x800u || request->retries > 3u || request->no_reply)
        port.violations++;
    return (fw_request){.call = request->call, .retries = request->retries, .tag = request->tag, .sel = request->sel};
}

/* ---- asi_port.h */
void asi_port_line(bool on) { port.line = on; }
bool asi_port_idle(void) { return port.idle != 0; }

void asi_port_batch(const asi_request_t *requests, unsigned n)
{
    if (n < 1 || n > 64 || !port.line || port.cycle || !port.idle)
        port.violations++;
    port.batches++;
    port.batch_len = (uint8_t)n;
    for (unsigned k = 0; k < n; k++)
        port.batch[k] = record(&requests[k]);
    port.idle = 0;
}

void asi_port_cycle(bool run, bool two_extra, uint16_t min_cycle_us)
{
    if (run && (!port.line || (!port.cycle && !port.idle)))
        port.violations++;
    port.cycle = run;
    port.two_extra = two_extra;
    port.min_cycle_us = min_cycle_us;
    if (run)
        port.idle = 0;
}

void asi_port_slot(unsigned index, bool active, bool extended)
{
    const bool known = index < 64 && index != 0 && index != 32;
    if (!known || port.active[index] == active || (index > 32 && active && !extended)) {
        port.violations++;
        return;
    }
    port.active[index] = active;
    port.extended[index] = extended;
}

void asi_port_forget(unsigned index)
{
    if (index >= 64 || port.active[index])
        port.violations++;
    else
        port.forgotten[index] = 1;
}

void asi_port_management(const asi_request_t *request)
{
    if (port.managements && request->tag == port.management.tag)
        port.violations++;
    port.managements++;
    port.management = record(request);
}

void asi_port_inclusion(const asi_request_t *request)
{
    if (request && port.inclusion_valid && request->tag == port.inclusion.tag)
        port.violations++;
    port.inclusion_valid = request != 0;
    if (request)
        port.inclusion = record(request);
}

void asi_port_outputs(const uint32_t image[ASI_IMAGE_WORDS])
{
    port.outputs++;
    memcpy(port.out, image, sizeof port.out);
}

void asi_port_phase(asi_phase_t phase)
{
    if (phase == ASI_PHASE_OFFLINE && port.line) /* a telegram could start */
        port.violations++;
    port.phase = (uint8_t)phase;
}

/* ---- flat interface */
fw_port *fw_port_record(void) { return &port; }
unsigned fw_ec_size(void) { return sizeof ec; }

static asi_projection_t *fill(const uint32_t lps[2], const uint16_t pcd[64], const uint8_t pp[64])
{
    asi_projection_t *p = &projections[used ^= 1u];
    memcpy(p->lps.w, lps, sizeof p->lps.w);
    memcpy(p->pcd, pcd, sizeof p->pcd);
    memcpy(p->pp, pp, sizeof p->pp);
    return p;
}

void fw_init(const uint32_t lps[2], const uint16_t pcd[64], const uint8_t pp[64])
{
    memset(&port, 0, sizeof port);
    port.idle = 1;
    asi_ec_init(&ec, fill(lps, pcd, pp));
}

void fw_read(fw_state *out)
{
    const asi_ec_state_t *s = asi_ec_state(&ec);
    out->phase = (int32_t)s->phase;
    out->flags = s->flags;
    memcpy(out->lds, s->lds.w, sizeof out->lds);
    memcpy(out->las, s->las.w, sizeof out->las);
    memcpy(out->lpf, s->lpf.w, sizeof out->lpf);
    memcpy(out->changed, s->changed.w, sizeof out->changed);
    memcpy(out->inputs, s->in, sizeof out->inputs);
    memcpy(out->cdi, s->cdi, sizeof out->cdi);
    memcpy(out->pi, s->pi, sizeof out->pi);
    memcpy(out->pecho, s->pecho, sizeof out->pecho);
    out->version = s->version;
}

void fw_changes_taken(void) { asi_ec_changes_taken(&ec); }
void fw_tick(uint32_t us) { asi_ec_tick(&ec, us); }
void fw_power(int apf) { asi_ec_power(&ec, apf != 0); }

static asi_result_t result_of(fw_result r)
{
    return (asi_result_t){.data = r.data, .error = r.error, .tag = r.tag};
}

int fw_batch_done(const fw_result *results, unsigned n)
{
    asi_result_t copy[64] = {0};
    for (unsigned k = 0; k < n && k < 64; k++)
        copy[k] = result_of(results[k]);
    return asi_ec_batch_done(&ec, copy, n);
}

int fw_cycle_done(fw_result management, fw_result inclusion, const uint32_t in[8])
{
    asi_cycle_report_t report = {.management = result_of(management), .inclusion = result_of(inclusion)};
    memcpy(report.in, in, sizeof report.in);
    return asi_ec_cycle_done(&ec, &report);
}

int fw_slave_lost(const uint32_t lost[2])
{
    const asi_list_t list = {{lost[0], lost[1]}};
    return asi_ec_slave_lost(&ec, &list);
}

void fw_set_mode(int protected_mode) { asi_ec_set_mode(&ec, protected_mode != 0); }
void fw_set_offline(int offline) { asi_ec_set_offline(&ec, offline != 0); }
void fw_set_data_exchange(int active) { asi_ec_set_data_exchange(&ec, active != 0); }
void fw_set_auto_address(int enable) { asi_ec_set_auto_address(&ec, enable != 0); }

int fw_set_projection(const uint32_t lps[2], const uint16_t pcd[64], const uint8_t pp[64])
{
    const int status = asi_ec_set_projection(&ec, fill(lps, pcd, pp));
    if (status != ASI_OK)
        used ^= 1u; /* the core still uses the other one */
    return status;
}

void fw_set_outputs(const uint32_t image[8]) { asi_ec_set_outputs(&ec, image); }
int fw_manage(uint16_t call) { return asi_ec_manage(&ec, call); }

int fw_manage_result(fw_result *out)
{
    asi_result_t r = {0};
    const int status = asi_ec_manage_result(&ec, &r);
    *out = (fw_result){.data = r.data, .error = r.error, .tag = r.tag};
    return status;
}

int fw_call(const char *name, unsigned index, unsigned data, int extended)
{
    static const struct { const char *name; asi_command_t command; } commands[] = {
        {"DELA", ASI_CMD_DELA}, {"RES", ASI_CMD_RES}, {"RDIO", ASI_CMD_RDIO}, {"RDID", ASI_CMD_RDID},
        {"RID1", ASI_CMD_RID1}, {"RID2", ASI_CMD_RID2}, {"RDST", ASI_CMD_RDST},
    };
    for (unsigned k = 0; k < sizeof commands / sizeof commands[0]; k++) {
        if (strcmp(name, commands[k].name) == 0)
            return asi_call_command(commands[k].command, index);
    }
    if (strcmp(name, "DEXG") == 0)
        return asi_call_dexg(index, data, extended != 0);
    if (strcmp(name, "WPAR") == 0)
        return asi_call_wpar(index, data, extended != 0);
    if (strcmp(name, "ADRA") == 0)
        return asi_call_adra(data);
    if (strcmp(name, "WID1") == 0)
        return asi_call_wid1(data);
    if (strcmp(name, "BR01") == 0)
        return ASI_CALL_BR01;
    return -1;
}

unsigned fw_call_index(unsigned call, int extended) { return asi_call_index((uint16_t)call, extended != 0); }
int fw_call_is_legal(unsigned call) { return asi_call_is_legal((uint16_t)call); }

unsigned fw_list_next(const uint32_t list[2], unsigned from)
{
    asi_list_t l = {{list[0], list[1]}};
    return asi_list_next(&l, from);
}

#ifdef FW_GCOV
void __gcov_dump(void);
void fw_counters_write(void) { __gcov_dump(); }
#else
void fw_counters_write(void) {}
#endif
