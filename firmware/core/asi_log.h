/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_log.h  Event log with bus-time stamps: a ring of the last events (EX-038). Memory of the caller.
 */
#ifndef ASI_LOG_H
#define ASI_LOG_H
#include <stdint.h>

/** Events; a number is never reused. data: see each. */
typedef enum {
    ASI_EVENT_START = 1,          /**< firmware started; data: state of the storage (store_r.state) */
    ASI_EVENT_PHASE = 2,          /**< new phase; data: phase_e */
    ASI_EVENT_OFFLINE = 3,        /**< offline phase; data: asi_offline_cause_t */
    ASI_EVENT_DETECTED = 4,       /**< index entered LDS; data: codes */
    ASI_EVENT_GONE = 5,           /**< index left LDS; data: 0 */
    ASI_EVENT_ACTIVATED = 6,      /**< index entered LAS */
    ASI_EVENT_DEACTIVATED = 7,    /**< index left LAS */
    ASI_EVENT_CONFIG_OK = 8,      /**< Config_OK changed; data: new value; index: first slave that broke it */
    ASI_EVENT_PERIPHERY_FAULT = 9, /**< data: 1 fault, 0 gone */
    ASI_EVENT_ADDRESSED = 10,     /**< address change or automatic addressing; index: new, data: old | status (negated) << 8 */
    ASI_EVENT_APF = 11,           /**< data: 1 power fail, 0 power is back */
    ASI_EVENT_SUSPECT = 12,       /**< suspected duplicate address */
    ASI_EVENT_AUTO_CLEAR = 13,    /**< auto clear stopped the line; index: the slave */
    ASI_EVENT_STORED = 14,        /**< permanent data stored; data: 0 or status negated */
    ASI_EVENT_CTT = 15,           /**< combined transaction: data 1 works, 0 time-out or toggle error */
} asi_event_kind_t;

/** Why the line is offline. */
typedef enum {
    ASI_OFFLINE_START = 0, ASI_OFFLINE_HOST = 1, ASI_OFFLINE_POWER = 2, ASI_OFFLINE_MODE = 3,
    ASI_OFFLINE_AUTO_CLEAR = 4,
} asi_offline_cause_t;

#define ASI_LOG_ENTRIES 64u /**< a power of two */

typedef struct { uint32_t time_us; uint8_t event, index; uint16_t data; } asi_log_entry_t;
typedef struct {
    uint32_t head;  /**< events logged so far, wraps; event n is at n % ASI_LOG_ENTRIES */
    asi_log_entry_t ring[ASI_LOG_ENTRIES];
} asi_log_t;

static inline void asi_log_put(asi_log_t *log, uint32_t time_us, asi_event_kind_t event, unsigned index, unsigned data)
{
    log->ring[log->head % ASI_LOG_ENTRIES] = (asi_log_entry_t){time_us, (uint8_t)event, (uint8_t)index, (uint16_t)data};
    log->head++;
}
#endif
