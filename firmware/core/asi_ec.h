/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_ec.h  Execution control of one AS-i line: OFFLINE, DETECTION, ACTIVATION, normal operation (EX-001 .. 026).
 * Layer: protocol core; knows no register and no clock. Memory: one asi_ec_t, owned by the caller, nothing else.
 * Context: not reentrant. All functions run in the interrupt, or with it masked.
 * Images are at host level here; the line level (CA-005) exists only below asi_port.h.
 */
#ifndef ASI_EC_H
#define ASI_EC_H
#include <stdbool.h>
#include <stdint.h>
#include "asi_config.h"
#include "asi_lists.h"
#include "asi_permanent.h"
#include "asi_port.h"
#include "asi_status.h"

/** Slave codes: IO in bits 3..0, ID 7..4, ID1 11..8, ID2 15..12. */
#define ASI_CODES_NONE ((uint16_t)0xFFFF)
#define ASI_ID_EXTENDED 0xAu /**< ID code of a slave with A/B addressing */
static inline unsigned asi_codes_id(uint16_t codes) { return (unsigned)codes >> 4 & 15u; }

/** Flags, order of the classic flag word. */
enum {
    ASI_FLAG_CONFIG_OK = 1u << 0,
    ASI_FLAG_LDS0 = 1u << 1,
    ASI_FLAG_AUTO_ADDRESS_ASSIGN = 1u << 2,
    ASI_FLAG_AUTO_ADDRESS_AVAILABLE = 1u << 3,
    ASI_FLAG_CONFIGURATION_ACTIVE = 1u << 4,
    ASI_FLAG_NORMAL_OPERATION_ACTIVE = 1u << 5,
    ASI_FLAG_APF = 1u << 6,
    ASI_FLAG_OFFLINE_READY = 1u << 7,
    ASI_FLAG_PERIPHERY_OK = 1u << 8,
};

/** What the master knows and shows; read only outside asi_ec.c. Consistent between two calls of this interface. */
typedef struct {
    asi_phase_t phase;            /**< OFFLINE, DETECTION, ACTIVATION; DATA_EXCHANGE for all of normal operation */
    uint32_t flags;
    asi_list_t lds, las, lpf;
    uint32_t in[ASI_IMAGE_WORDS]; /**< input image; 0 for every slave not in LAS (CA-006) */
    uint16_t cdi[ASI_INDICES];
    uint8_t pi[ASI_INDICES];      /**< parameters sent at activation */
    uint8_t pecho[ASI_INDICES];   /**< last answer to WPAR */
    asi_list_t changed;           /**< indices whose cdi, pi or pecho changed since asi_ec_changes_taken */
    uint32_t version;             /**< counts changes of phase, flags, lists, cdi, pi and pecho */
} asi_ec_state_t;

/** What one cycle brought. */
typedef struct {
    asi_result_t management, inclusion;
    uint32_t in[ASI_IMAGE_WORDS]; /**< answers of the cycle */
} asi_cycle_report_t;

/** One line. All members but `state` are private to asi_ec.c. */
typedef struct {
    asi_ec_state_t state;
    const asi_projection_t *projection;
    /* host controls */
    bool protected_mode, offline, data_exchange, auto_address;
    /* power-up, OFFLINE */
    bool apf, power_up;
    uint32_t settle_left_us;
    /* batches of DETECTION and ACTIVATION */
    bool batch_open;
    bool sel;                     /* detection pass over Sel = 1 */
    uint8_t step;
    uint8_t batch_len;
    asi_list_t todo;              /* slaves still in question in this step */
    asi_list_t extended_numbers;  /* detection: numbers to be tested with Sel = 1 (EX-006) */
    uint16_t codes[ASI_INDICES];  /* codes as they come; in `state.cdi` only when complete (EX-004) */
    asi_request_t requests[ASI_INDICES];
    uint8_t request_index[ASI_INDICES];
    /* normal operation */
    bool inclusion_open, management_open, management_known;
    uint8_t inclusion_step, inclusion_index, inclusion_failures, inclusion_tag;
    uint16_t inclusion_codes;
    uint8_t management_tag;
    asi_result_t management;
    uint8_t miss[ASI_INDICES];    /* rounds missed by a slave in LDS, not in LAS (EX-014) */
    uint32_t out_host[ASI_IMAGE_WORDS], out_line[ASI_IMAGE_WORDS];
    uint32_t las_mask[ASI_IMAGE_WORDS];  /* F where a slave is active */
    uint32_t invert[ASI_IMAGE_WORDS];    /* payload bits of active slaves */
} asi_ec_t;

/** Power-up: configuration mode, data exchange on, outputs 0. The projection is kept by reference; it must be valid. */
void asi_ec_init(asi_ec_t *ec, const asi_projection_t *projection);

/* ---- from below ---- */
/** Time passes; at least every few ms. elapsed_us since the last call. */
void asi_ec_tick(asi_ec_t *ec, uint32_t elapsed_us);
/** The line voltage became too low (apf) or good again. */
void asi_ec_power(asi_ec_t *ec, bool apf);
/** The batch ended. @return ASI_E_STATE: no batch of that length was open, nothing changed */
asi_status_t asi_ec_batch_done(asi_ec_t *ec, const asi_result_t *results, unsigned n);
/** A cycle ended. @return ASI_E_STATE: not in normal operation, nothing changed */
asi_status_t asi_ec_cycle_done(asi_ec_t *ec, const asi_cycle_report_t *report);
/** These slaves failed P_FAIL_CYCLES cycles and are no longer called: all at once, as after a broken cable.
 * @return ASI_E_STATE: none of them is in LAS, nothing changed */
asi_status_t asi_ec_slave_lost(asi_ec_t *ec, const asi_list_t *lost);

/* ---- from above ---- */
/** Protected or configuration mode; a change passes through OFFLINE (EX-023). */
void asi_ec_set_mode(asi_ec_t *ec, bool protected_mode);
/** Offline phase on demand. */
void asi_ec_set_offline(asi_ec_t *ec, bool offline);
/** false: slaves are polled with line value F (EX-024). */
void asi_ec_set_data_exchange(asi_ec_t *ec, bool active);
/** Automatic addressing allowed (EX-018). */
void asi_ec_set_auto_address(asi_ec_t *ec, bool enable);
/** Whether this projection would be taken. Reads nothing but its argument, so it may run with the interrupt open.
 * @return ASI_E_ARG: LPS holds 0 or 32, or a parameter is above F */
ASI_MUST_USE asi_status_t asi_ec_check_projection(const asi_projection_t *projection);
/** Use a projection; it stays referenced. In protected mode slaves that it does not allow leave LAS at once (EX-009).
 * @return as asi_ec_check_projection; nothing changed then */
ASI_MUST_USE asi_status_t asi_ec_set_projection(asi_ec_t *ec, const asi_projection_t *projection);
/** Output image of the host, for the cycles from now on. */
void asi_ec_set_outputs(asi_ec_t *ec, const uint32_t image[ASI_IMAGE_WORDS]);
/** One call to one slave in the next management slot, P_CMD_RETRY repetitions: WPAR, RES, RDIO, RDID, RID1, RID2, RDST.
 * @return ASI_E_ARG: another call; ASI_E_STATE: no normal operation; ASI_E_BUSY: one is open */
ASI_MUST_USE asi_status_t asi_ec_manage(asi_ec_t *ec, uint16_t call);
/** Result of the last asi_ec_manage.
 * @return ASI_E_BUSY: not yet; ASI_E_STATE: none was asked for; ASI_E_ABORTED: the line went offline first */
ASI_MUST_USE asi_status_t asi_ec_manage_result(const asi_ec_t *ec, asi_result_t *result);
/** What the master knows and shows. */
static inline const asi_ec_state_t *asi_ec_state(const asi_ec_t *ec) { return &ec->state; }
/** The codes and parameters named in state.changed have been shown. */
static inline void asi_ec_changes_taken(asi_ec_t *ec) { ec->state.changed = ASI_LIST_EMPTY; }
#endif
