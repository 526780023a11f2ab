/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_line_rx.h  The chip's receivers behind arrays of comparator levels, for the analog line model.
 * Read by the C++ side and by cffi; units are receiver clocks (16 MHz). Times are those of the strobes: a level that
 * changes in clock k gives its strobe in clock k + asi_timing_pkg::strobe_delay.
 */
#ifndef ASI_LINE_RX_H
#define ASI_LINE_RX_H
#ifdef __cplusplus
#include <cstdint>
extern "C" {
#else
#include <stdint.h>
#endif

#define ASI_LINE_RX_STROBES 256

typedef struct asi_line_rx_result {
    int32_t first;        /**< clock of the first pulse while listening, -1: none */
    int32_t done;         /**< clock of the first decision, -1: none */
    int32_t error_class;  /**< of that decision (error_class_e), -1: none */
    int32_t data;         /**< its payload */
    int32_t strobes;      /**< accepted pulses of the whole run, at most ASI_LINE_RX_STROBES are kept */
    int32_t strobe[ASI_LINE_RX_STROBES]; /**< clock << 2 | positive << 1 | negative */
} asi_line_rx_result;

/** Reset the receivers and run them over levels[clocks] (bit 0: negative, bit 1: positive comparator).
 * @param enable  clock from which the receiver listens
 * @param bits    7: receiver of answers; 14: of requests
 * @return 0; -1: a bad argument, nothing was run */
int asi_line_rx_run(const uint8_t *levels, int clocks, int enable, int bits, asi_line_rx_result *result);

#ifdef __cplusplus
}
#endif
#endif
