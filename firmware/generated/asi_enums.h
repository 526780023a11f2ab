/* SPDX-License-Identifier: Apache-2.0 */
/* Generated from rdl/asi.rdl by tools/gen_registers.py (make regs). Do not edit. */
#ifndef ASI_ENUMS_H
#define ASI_ENUMS_H
typedef enum {
    ASI_ERR_OK = 0, /**< Valid answer (or none expected and none came). */
    ASI_ERR_NO_RESPONSE = 1, /**< No first pulse inside P_RX_TIMEOUT. */
    ASI_ERR_START = 2, /**< First pulse after the pause is not negative. */
    ASI_ERR_ALTERNATION = 3, /**< Two neighbouring pulses of equal polarity. */
    ASI_ERR_TIMING = 4, /**< A pulse started outside every n*3 us window. */
    ASI_ERR_NO_INFORMATION = 5, /**< No pulse in an n*6 us window. */
    ASI_ERR_END_BIT = 6, /**< The pulse at 36 us is not positive. */
    ASI_ERR_PARITY = 7, /**< Odd number of ones. */
    ASI_ERR_LENGTH = 8, /**< A pulse after the end pulse, before the length window closed. */
    ASI_ERR_EARLY = 9, /**< A pulse before P_RX_OPEN: foreign sender. */
    ASI_ERR_BAD_MASTER = 10, /**< Bad master telegram: our own request did not come back from the line as it was sent. */
    ASI_ERR_ABORTED = 15, /**< Power fail or stop while the call was open. */
} asi_error_class_t;
typedef enum {
    ASI_PHASE_OFFLINE = 0, /**< No telegrams. */
    ASI_PHASE_DETECTION = 1, /**< Looking for slaves, batches. */
    ASI_PHASE_ACTIVATION = 2, /**< Activating detected slaves, batches. */
    ASI_PHASE_DATA_EXCHANGE = 3, /**< Cyclic DEXG calls. */
    ASI_PHASE_MANAGEMENT = 4, /**< The cycle's management slot. */
    ASI_PHASE_INCLUSION = 5, /**< The cycle's inclusion slot. */
} asi_phase_t;
#endif
