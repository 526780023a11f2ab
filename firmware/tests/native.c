/* SPDX-License-Identifier: Apache-2.0 */
/** @file native.c  See native.h. */
#include "native.h"
#include <string.h>
#include "asi_calls.h"
#include "asi_ec.h"
#include "asi_functions.h"

static asi_ec_t ec;
static fw_port port;
static fw_request record(const asi_request_t *request)
{
    if (!asi_call_is_legal(request->call) || request->retries > 3u || request->no_reply != (request->call == ASI_CALL_BR01))
        port.violations++;
    return (fw_request){.call = request->call, .retries = request->retries, .tag = request->tag, .sel = request->sel,
                        .no_reply = request->no_reply};
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

void asi_port_cycle(const asi_cycle_mode_t *mode)
{
    if (mode && (!port.line || (!port.cycle && !port.idle)))
        port.violations++;
    port.cycle = mode != 0;
    if (mode) {
        port.two_extra = mode->two_extra;
        port.read_id = mode->read_id;
        port.min_cycle_us = mode->min_cycle_us;
        port.idle = 0;
    }
}

void asi_port_slot(unsigned index, bool active, bool extended, bool live)
{
    const bool known = index < 64 && index != 0 && index != 32;
    if (!known || port.active[index] == active || (index > 32 && active && !extended)) {
        port.violations++;
        return;
    }
    port.active[index] = active;
    port.extended[index] = extended;
    port.live[index] = live;
    if (active)
        port.slot_data[index] = port.slot_error[index] = port.slot_sent[index] = port.slot_calls[index] = 0;
}

void asi_port_live(unsigned index, unsigned nibble)
{
    if (index >= 64 || nibble > 15)
        port.violations++;
    else
        port.live_nibble[index] = (uint8_t)nibble;
}

asi_slot_state_t asi_port_slot_state(unsigned index)
{
    if (index >= 64 || !port.active[index])
        port.violations++;
    return (asi_slot_state_t){.data = port.slot_data[index & 63], .error = port.slot_error[index & 63],
                              .sent = port.slot_sent[index & 63], .calls = port.slot_calls[index & 63] & 15};
}

uint32_t asi_port_time_us(void) { return port.time_us; }

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

int fw_init(const fw_permanent *in)
{
    asi_permanent_t p = {.protected_mode = in->controls.protected_mode, .auto_address = in->controls.auto_address,
                         .data_exchange = in->controls.data_exchange, .auto_clear = in->controls.auto_clear};
    memset(&port, 0, sizeof port);
    port.idle = 1;
    memcpy(p.projection.lps.w, in->lps, sizeof in->lps);
    memcpy(p.projection.pcd, in->pcd, sizeof in->pcd);
    memcpy(p.projection.pp, in->pp, sizeof in->pp);
    return asi_ec_init(&ec, &p);
}

void fw_get_permanent(fw_permanent *out)
{
    memcpy(out->lps, ec.permanent.projection.lps.w, sizeof out->lps);
    memcpy(out->pcd, ec.permanent.projection.pcd, sizeof out->pcd);
    memcpy(out->pp, ec.permanent.projection.pp, sizeof out->pp);
    fw_get_controls(&out->controls);
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
    out->permanent_version = s->permanent_version;
    memcpy(out->suspects, s->suspects.w, sizeof out->suspects);
    memcpy(out->changed_slaves, s->changed_slaves.w, sizeof out->changed_slaves);
    out->changed_us = s->changed_us;
    out->offline_causes = s->offline_causes;
    out->offline_us = s->offline_us;
}

void fw_changes_taken(void) { asi_ec_changes_taken(&ec); }
void fw_tick(uint32_t us) { asi_ec_tick(&ec, us); }
void fw_exchange_done(void) { asi_ec_exchange_done(&ec); }
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

void fw_quality(unsigned index, uint32_t good, uint32_t silent, uint32_t garbled)
{
    asi_ec_quality(&ec, index, good, silent, garbled);
}

int fw_set_controls(const fw_controls *c)
{
    const asi_controls_t controls = {.protected_mode = c->protected_mode, .offline = c->offline,
                                     .data_exchange = c->data_exchange, .auto_address = c->auto_address,
                                     .auto_clear = c->auto_clear};
    return asi_fn_set_controls(&ec, &controls);
}

void fw_get_controls(fw_controls *out)
{
    const asi_controls_t c = asi_fn_controls(&ec);
    *out = (fw_controls){c.protected_mode, c.offline, c.data_exchange, c.auto_address, c.auto_clear};
}

int fw_set_projection(const uint32_t lps[2], const uint16_t pcd[64], const uint8_t pp[64])
{
    asi_projection_t p;
    memcpy(p.lps.w, lps, sizeof p.lps.w);
    memcpy(p.pcd, pcd, sizeof p.pcd);
    memcpy(p.pp, pp, sizeof p.pp);
    return asi_fn_set_projection(&ec, &p);
}

int fw_set_pp(unsigned index, unsigned parameter) { return asi_fn_set_permanent_parameter(&ec, index, parameter); }
int fw_set_pcd(unsigned index, unsigned codes) { return asi_fn_set_permanent_configuration(&ec, index, codes); }
int fw_store_configuration(void) { return asi_fn_store_actual_configuration(&ec); }
void fw_store_parameters(void) { asi_fn_store_actual_parameters(&ec); }

int fw_set_lps(const uint32_t lps[2])
{
    const asi_list_t list = {{lps[0], lps[1]}};
    return asi_fn_set_lps(&ec, &list);
}

void fw_set_outputs(const uint32_t image[8]) { asi_fn_write_odi(&ec, image); }

int fw_start(int kind, unsigned index, unsigned value, const uint8_t *bytes, unsigned length)
{
    if (bytes && length <= sizeof ec.ctt.string.bytes && !ec.ctt.string.open)
        memcpy(ec.ctt.string.bytes, bytes, length);
    return asi_fn_start(&ec, (asi_job_kind_t)kind, index, value, length);
}

void fw_get_job(fw_job *out)
{
    const asi_job_t *j = asi_fn_job(&ec);
    *out = (fw_job){.kind = j->kind, .index = j->index, .value = j->value, .data = j->data, .status = j->status,
                    .length = j->length};
}

unsigned fw_string(uint8_t *bytes, unsigned max)
{
    const unsigned n = ec.ctt.string.length < max ? ec.ctt.string.length : max;
    memcpy(bytes, ec.ctt.string.bytes, n);
    return n;
}

void fw_set_ao(unsigned word, unsigned value) { ec.ctt.ao[word % ASI_ANALOG_WORDS] = (uint16_t)value; }
unsigned fw_get_ai(unsigned word) { return ec.ctt.ai[word % ASI_ANALOG_WORDS]; }
unsigned fw_ctt_status(unsigned index) { return ec.ctt.status[index & 63]; }

void fw_safe_in(uint32_t f1[2], uint32_t f2[2])
{
    memcpy(f1, ec.ctt.safe_in[0].w, sizeof ec.ctt.safe_in[0].w);
    memcpy(f2, ec.ctt.safe_in[1].w, sizeof ec.ctt.safe_in[1].w);
}

unsigned fw_log(fw_log_entry *out)
{
    for (unsigned k = 0; k < ASI_LOG_ENTRIES; k++) {
        const asi_log_entry_t *e = &ec.log.ring[(ec.log.head + k) % ASI_LOG_ENTRIES];
        out[k] = (fw_log_entry){e->time_us, e->event, e->index, e->data};
    }
    return ec.log.head;
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
