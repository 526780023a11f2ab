/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_ec.h  Execution control of one AS-i line: OFFLINE, DETECTION, ACTIVATION, normal operation (EX-001 ..).
 * asi_ec.c has phases and reports from below, asi_state.c lists, flags and images, asi_inclusion.c the inclusion
 * machine, asi_functions.c what the host asks for at once, asi_jobs.c what needs telegrams.
 * Layer: protocol core; knows no register. Memory: one asi_ec_t, owned by the caller, nothing else.
 * Context: not reentrant. All functions run in the interrupt, or with it masked.
 * Images are at host level here; the line level (CA-005) exists only below asi_port.h.
 */
#ifndef ASI_EC_H
#define ASI_EC_H
#include <stdbool.h>
#include <stdint.h>
#include "asi_config.h"
#include "asi_ctt.h"
#include "asi_jobs.h"
#include "asi_lists.h"
#include "asi_log.h"
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

/** What the master knows and shows; read only for users. Consistent between two calls of this interface. */
typedef struct {
    asi_phase_t phase;            /**< OFFLINE, DETECTION, ACTIVATION; DATA_EXCHANGE for all of normal operation */
    uint32_t flags;
    asi_list_t lds, las, lpf;
    uint32_t in[ASI_IMAGE_WORDS]; /**< input image; 0 for every slave not in LAS (CA-006) */
    uint16_t cdi[ASI_INDICES];
    uint8_t pi[ASI_INDICES];      /**< parameters sent at activation */
    uint8_t pecho[ASI_INDICES];   /**< last answer to WPAR */
    asi_list_t changed;           /**< indices whose cdi, pi or pecho changed since asi_ec_changes_taken */
    uint32_t version;             /**< counts changes of phase, flags, lists, history, cdi, pi and pecho */
    uint32_t permanent_version;   /**< counts changes of the permanent data */
    asi_list_t suspects;          /**< suspected duplicate addresses (EX-034) */
    asi_list_t changed_slaves;    /**< the slaves that broke Config_OK the last time (EX-036), */
    uint32_t changed_us;          /**< and when */
    uint32_t offline_causes;      /**< bits of asi_offline_cause_t: 15..0 all since start-up, 31..16 the last one (EX-037), */
    uint32_t offline_us;          /**< and when */
} asi_ec_state_t;

/** What one cycle brought. */
typedef struct {
    asi_result_t management, inclusion;
    uint32_t in[ASI_IMAGE_WORDS]; /**< answers of the cycle */
} asi_cycle_report_t;

/** What the host controls, apart from the projection. */
typedef struct {
    bool protected_mode, offline, data_exchange, auto_address;
    uint8_t auto_clear;
} asi_controls_t;

/** Whose call is in the management slot. */
typedef enum { ASI_OWNER_NONE, ASI_OWNER_JOB, ASI_OWNER_POLL } asi_owner_t;

/** One line. All members but `state`, `ctt` and `log` are private to the core. */
typedef struct {
    asi_ec_state_t state;
    asi_ctt_t ctt;
    asi_log_t log;
    asi_permanent_t permanent;
    asi_job_t job, automatic;     /* the host's; automatic addressing. At most one is open */
    bool offline, auto_cleared;   /* asked for by the host; the auto-clear end state */
    /* power-up, OFFLINE */
    bool apf, power_up;
    uint32_t settle_left_us;
    /* batches of DETECTION and ACTIVATION */
    bool batch_open, reactivate;
    uint32_t reactivate_from_us, reactivate_pause_us;  /* reset slaves are given time (FN-022) */
    bool sel;                     /* detection pass over Sel = 1 */
    uint8_t step;
    uint8_t batch_len;
    asi_list_t todo;              /* slaves still in question in this step */
    asi_list_t extended_numbers;  /* detection: numbers to be tested with Sel = 1 (EX-006) */
    asi_list_t no_id2;            /* slaves that did not answer RID2 (EX-028) */
    uint16_t codes[ASI_INDICES];  /* codes as they come; in `state.cdi` only when complete (EX-004) */
    asi_request_t requests[ASI_INDICES];
    uint8_t request_index[ASI_INDICES];
    /* normal operation */
    bool inclusion_open;
    uint8_t inclusion_step, inclusion_index, inclusion_failures, inclusion_tag;
    uint16_t inclusion_codes;
    bool inclusion_no_id2;
    asi_list_t held;              /* indices inclusion keeps away from: an address is being changed */
    bool zero_sel, zero_other;    /* the select a slave at address 0 answers (AD-007); the probe was sent with both */
    bool auto_failed;             /* automatic addressing failed with this slave 0, */
    uint32_t auto_failed_us;      /* and when (AD-009) */
    uint8_t owner, management_tag;
    uint8_t poll_index, poll_wait;
    asi_list_t wrong;             /* slaves that are not as projected */
    uint8_t suspicion[ASI_INDICES];
    uint8_t miss[ASI_INDICES];    /* rounds missed by a slave in LDS, not in LAS (EX-014) */
    uint8_t calls[ASI_INDICES];   /* asi_slot_state_t.calls seen last, of combined transactions */
    asi_list_t ctt_failed;        /* combined transactions that stopped working (ASI_EVENT_CTT) */
    uint32_t live_mask[ASI_IMAGE_WORDS], live_in[ASI_IMAGE_WORDS]; /* digital inputs of combined transactions */
    uint32_t out_host[ASI_IMAGE_WORDS], out_line[ASI_IMAGE_WORDS];
    uint32_t las_mask[ASI_IMAGE_WORDS];  /* F where a slave is active */
    uint32_t invert[ASI_IMAGE_WORDS];    /* payload bits of active slaves */
} asi_ec_t;

/** Power-up with this permanent data, outputs 0. @return ASI_E_ARG, ASI_E_AUTO_CLEAR_MODE: it makes no sense, factory
 * settings are used instead */
asi_status_t asi_ec_init(asi_ec_t *ec, const asi_permanent_t *permanent);

/* ---- from below ---- */
/** Time passes; at least every few ms. elapsed_us since the last call. */
void asi_ec_tick(asi_ec_t *ec, uint32_t elapsed_us);
/** The line voltage became too low (apf) or good again. */
void asi_ec_power(asi_ec_t *ec, bool apf);
/** The batch ended. @return ASI_E_STATE: no batch of that length was open, nothing changed */
asi_status_t asi_ec_batch_done(asi_ec_t *ec, const asi_result_t *results, unsigned n);
/** The slots of a cycle have been called; the extra slots are on the line. Gives live slots their next nibbles. */
void asi_ec_exchange_done(asi_ec_t *ec);
/** A cycle ended. @return ASI_E_STATE: not in normal operation, nothing changed */
asi_status_t asi_ec_cycle_done(asi_ec_t *ec, const asi_cycle_report_t *report);
/** These slaves failed P_FAIL_CYCLES cycles and are no longer called: all at once, as after a broken cable.
 * @return ASI_E_STATE: none of them is in LAS, nothing changed */
asi_status_t asi_ec_slave_lost(asi_ec_t *ec, const asi_list_t *lost);
/** Attempts of an index since the last call of this function for it: good, without answer, garbled (EX-034). */
void asi_ec_quality(asi_ec_t *ec, unsigned index, uint32_t good, uint32_t silent, uint32_t garbled);

/* ---- from above: see asi_functions.h ---- */
/** What the master knows and shows. */
static inline const asi_ec_state_t *asi_ec_state(const asi_ec_t *ec) { return &ec->state; }
/** The codes and parameters named in state.changed have been shown. */
static inline void asi_ec_changes_taken(asi_ec_t *ec) { ec->state.changed = ASI_LIST_EMPTY; }
#endif
