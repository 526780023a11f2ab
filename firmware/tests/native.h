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
typedef struct { uint16_t call; uint8_t retries, tag, sel; } fw_request;
typedef struct { uint8_t data, error, tag; } fw_result;

typedef struct {
    uint8_t line, cycle, two_extra, phase, idle;  /* idle: set by the test */
    uint16_t min_cycle_us;
    uint32_t batches;             /* counts asi_port_batch */
    uint8_t batch_len;
    fw_request batch[64];
    uint8_t active[64], extended[64];
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
    uint32_t version;
} fw_state;

fw_port *fw_port_record(void);
void fw_init(const uint32_t lps[2], const uint16_t pcd[64], const uint8_t pp[64]);
void fw_read(fw_state *state);
void fw_changes_taken(void);
void fw_tick(uint32_t us);
void fw_power(int apf);
int fw_batch_done(const fw_result *results, unsigned n);
int fw_cycle_done(fw_result management, fw_result inclusion, const uint32_t in[8]);
int fw_slave_lost(const uint32_t lost[2]);
void fw_set_mode(int protected_mode);
void fw_set_offline(int offline);
void fw_set_data_exchange(int active);
void fw_set_auto_address(int enable);
int fw_set_projection(const uint32_t lps[2], const uint16_t pcd[64], const uint8_t pp[64]);
void fw_set_outputs(const uint32_t image[8]);
int fw_manage(uint16_t call);
int fw_manage_result(fw_result *result);
unsigned fw_ec_size(void);

int fw_call(const char *name, unsigned index, unsigned data, int extended);  /* -1: no such call */
unsigned fw_call_index(unsigned call, int extended);
int fw_call_is_legal(unsigned call);
unsigned fw_list_next(const uint32_t list[2], unsigned from);
void fw_counters_write(void);  /* coverage counters to disk, now; nothing without gcov */
/* cffi end */
#endif
