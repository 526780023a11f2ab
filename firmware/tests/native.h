/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file native.h  The protocol core as a native library for tests: a flat interface for cffi (ABI mode), and the port
 * as a record of what the core asked for. One line, global, single-threaded. Declarations between the markers are read
 * by firmware/tests/native.py.
 */
#ifndef FW_NATIVE_H
#define FW_NATIVE_H
#include <stdint.h>
/* cffi begin */
typedef struct { uint16_t call; uint8_t retries, tag, sel, no_reply; } fw_request;
typedef struct { uint8_t data, error, tag; } fw_result;

typedef struct {
    uint8_t line, cycle, two_extra, read_id, phase, idle;  /* idle: set by the test */
    uint16_t min_cycle_us;
    uint32_t time_us;             /* set by the test */
    uint32_t batches;             /* counts asi_port_batch */
    uint8_t batch_len;
    fw_request batch[64];
    uint8_t active[64], extended[64], live[64], live_nibble[64];
    uint8_t slot_data[64], slot_error[64], slot_sent[64], slot_calls[64];  /* set by the test; 0 when a slot becomes active */
    uint8_t forgotten[64];        /* set by asi_port_forget, cleared by the test */
    uint32_t managements;         /* counts asi_port_management */
    fw_request management;
    uint8_t inclusion_valid;
    fw_request inclusion;
    uint32_t outputs;             /* counts asi_port_outputs */
    uint32_t out[8];
    uint32_t violations;          /* uses of the port that its contract forbids */
} fw_port;

typedef struct {
    int32_t phase;
    uint32_t flags;
    uint32_t lds[2], las[2], lpf[2], changed[2];
    uint32_t inputs[8];
    uint16_t cdi[64];
    uint8_t pi[64], pecho[64];
    uint32_t version, permanent_version;
    uint32_t suspects[2], changed_slaves[2], changed_us, offline_causes, offline_us;
} fw_state;

typedef struct { uint8_t protected_mode, offline, data_exchange, auto_address, auto_clear; } fw_controls;
typedef struct { uint32_t lps[2]; uint16_t pcd[64]; uint8_t pp[64]; fw_controls controls; } fw_permanent;  /* offline: not part */
typedef struct { uint8_t kind, index, value, data; int32_t status; uint16_t length; } fw_job;
typedef struct { uint32_t time_us; uint8_t event, index; uint16_t data; } fw_log_entry;

fw_port *fw_port_record(void);
int fw_init(const fw_permanent *permanent);
void fw_get_permanent(fw_permanent *out);
void fw_read(fw_state *state);
void fw_changes_taken(void);
void fw_tick(uint32_t us);
void fw_power(int apf);
void fw_exchange_done(void);
int fw_batch_done(const fw_result *results, unsigned n);
int fw_cycle_done(fw_result management, fw_result inclusion, const uint32_t in[8]);
int fw_slave_lost(const uint32_t lost[2]);
void fw_quality(unsigned index, uint32_t good, uint32_t silent, uint32_t garbled);
int fw_set_controls(const fw_controls *controls);
void fw_get_controls(fw_controls *out);
int fw_set_projection(const uint32_t lps[2], const uint16_t pcd[64], const uint8_t pp[64]);
int fw_set_pp(unsigned index, unsigned parameter);
int fw_set_pcd(unsigned index, unsigned codes);
int fw_set_lps(const uint32_t lps[2]);
int fw_store_configuration(void);
void fw_store_parameters(void);
void fw_set_outputs(const uint32_t image[8]);
int fw_start(int kind, unsigned index, unsigned value, const uint8_t *bytes, unsigned length);  /* bytes: strings, else NULL */
void fw_get_job(fw_job *out);
unsigned fw_string(uint8_t *bytes, unsigned max);   /* bytes of the string read last */
void fw_set_ao(unsigned word, unsigned value);
unsigned fw_get_ai(unsigned word);
unsigned fw_ctt_status(unsigned index);
void fw_safe_in(uint32_t f1[2], uint32_t f2[2]);
unsigned fw_log(fw_log_entry *out);                 /* the last 64, oldest first; -> events logged */
unsigned fw_ec_size(void);

int fw_call(const char *name, unsigned index, unsigned data, int extended);  /* -1: no such call */
unsigned fw_call_index(unsigned call, int extended);
int fw_call_is_legal(unsigned call);
unsigned fw_list_next(const uint32_t list[2], unsigned from);
void fw_counters_write(void);  /* coverage counters to disk, now; nothing without gcov */
/* cffi end */
#endif
