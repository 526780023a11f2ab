/* SPDX-License-Identifier: Apache-2.0 */
/* Generated from rdl/ctt.toml by tools/gen_ctt.py (make regs). Do not edit. */
#ifndef ASI_CTT_TABLE_H
#define ASI_CTT_TABLE_H
#define ASI_CTT1_TOGGLE_POS 3 /**< experimental: bit of the nibble that carries the control bit, both directions; else 0 */
#define ASI_CTT1_MSB_LEFT 1 /**< experimental: 1: left bit of a triple in the highest free bit */
#define ASI_CTT1_COUNT_UP 0 /**< experimental: 0: triples are numbered down, 7 or 6 first, 0 (D1 O V) last; 1: up */
#define ASI_CTT1_ECHO_INVERTED 0 /**< experimental: 1: the answer carries the inverted control bit */
#define ASI_CTT1_E_REVERSED 0 /**< experimental: 0: E1 has weight 4, channel 1 = 000; 1: E1 has weight 1 */
#define ASI_CTT1_START_TOGGLE 0 /**< experimental: control bit of the first call after activation */
#define ASI_CTT1_INVERT_OUT 0 /**< experimental: 1: the nibble is inverted on the line */
#define ASI_CTT1_TIMEOUT_MS 1000 /**< experimental: ms without an accepted triple: toggle error; 500 .. 3500 */
#define ASI_CTT1_SLAVE_TIMEOUT_MS 500 /**< ms without dialogue: an output slave drops its outputs (7.3 with P0 = 1) */
#define ASI_CTT1_ID2_TRANSPARENT 0 /**< value of bit 2 of ID2 that means transparent bits instead of an analog value */
#define ASI_CTT1_PAR_DATA 15 /**< parameter of normal data mode */
#define ASI_CTT1_PAR_ID 14 /**< experimental: parameter that selects the identification string */
#define ASI_CTT1_PAR_DIAG 13 /**< experimental: parameter that selects the diagnosis string */
#define ASI_CTT1_PAR_RD 11 /**< experimental: parameter that selects reading the parameter string */
#define ASI_CTT1_PAR_WR 7 /**< experimental: parameter that selects writing the parameter string */
#define ASI_CTT1_VALUE_TRIPLES 7 /**< triples of a value: E, five of data, D1 O V */
#define ASI_CTT1_SEQUENCE_TRIPLES 8 /**< triples of a string sequence of 3 bytes */
#define ASI_CTT1_STRING_BYTES 219 /**< longest string: 73 sequences */
#define ASI_CTT2_DO_CLOCK 0 /**< output bit that carries the master's clock */
#define ASI_CTT2_DO_DATA 1 /**< output bit that carries the master's data */
#define ASI_CTT2_DI_DATA 2 /**< experimental: input bit with the slave's data; swapped with di_clock when the ID object cannot be read */
#define ASI_CTT2_DI_CLOCK 3 /**< experimental: input bit with the slave's clock */
#define ASI_CTT2_TRY_MS 5000 /**< experimental: ms until the two are swapped */
#define ASI_CTT2_MSB_FIRST 1 /**< experimental: 1: bit 7 of a byte first */
#define ASI_CTT2_RISING_EDGE 1 /**< experimental: 1: a bit is taken at the rising clock edge; a clock period is two calls */
#define ASI_CTT2_IDLE 3 /**< experimental: level of clock (bit 0) and data (bit 1) between messages */
#define ASI_CTT2_GAP_CALLS 8 /**< experimental: calls without an edge that end a message and clear the receiver */
#define ASI_CTT2_RESPONSE_MS 10000 /**< experimental: ms for the first bit of a response */
#define ASI_CTT2_MESSAGE_BYTES 224 /**< longest message with its header */
#define ASI_CTT3_INVERT_OUT 1 /**< experimental: payload bits I1 I0 are inverted on the line; selector and ~Sel never */
#define ASI_CTT3_AA_OFFSET 0 /**< experimental: S-7.A.A: the call carries output pair s + offset */
#define ASI_CTT3_AA_INVERTED 1 /**< S-7.A.A: I2 is the inverted bit 0 of the selector */
#define ASI_CTT4_ENABLE 0 /**< experimental: 0: such slaves exchange plain bits and show transfer invalid. The wire format is not public */
#define ASI_CTT4_NIBBLES 4 /**< experimental: placeholder: call I1 I0 = number of the nibble, 3 first; the answer is that nibble */
#define ASI_CTT4_CHANNEL_BIT 2 /**< experimental: placeholder: call bit with the channel (S-7.A.9) or the output (S-7.A.8) */
#define ASI_SAFETY_VIEW_POLLS 8 /**< experimental: calls over which a channel must show a 1 to be reported closed */
#define ASI_SAFETY_WORD_HOLD_US 224 /**< us after an answered call during which a safety slave keeps its word */
#endif
