/* SPDX-License-Identifier: Apache-2.0 */
/* Generated from rdl/ctt.toml by tools/gen_ctt.py (make regs). Do not edit. */
#ifndef ASI_CTT_TABLE_H
#define ASI_CTT_TABLE_H
/** experimental: bit of the nibble that carries the control bit, both directions; else 0 */
#ifndef ASI_CTT1_TOGGLE_POS
#define ASI_CTT1_TOGGLE_POS 3
#endif
/** experimental: 1: left bit of a triple in the highest free bit */
#ifndef ASI_CTT1_MSB_LEFT
#define ASI_CTT1_MSB_LEFT 1
#endif
/** experimental: 0: triples are numbered down, 7 or 6 first, 0 (D1 O V) last; 1: up */
#ifndef ASI_CTT1_COUNT_UP
#define ASI_CTT1_COUNT_UP 0
#endif
/** experimental: 1: the answer carries the inverted control bit */
#ifndef ASI_CTT1_ECHO_INVERTED
#define ASI_CTT1_ECHO_INVERTED 0
#endif
/** experimental: 0: E1 has weight 4, channel 1 = 000; 1: E1 has weight 1 */
#ifndef ASI_CTT1_E_REVERSED
#define ASI_CTT1_E_REVERSED 0
#endif
/** experimental: control bit of the first call after activation */
#ifndef ASI_CTT1_START_TOGGLE
#define ASI_CTT1_START_TOGGLE 0
#endif
/** experimental: 1: the nibble is inverted on the line */
#ifndef ASI_CTT1_INVERT_OUT
#define ASI_CTT1_INVERT_OUT 0
#endif
/** experimental: ms without an accepted triple: toggle error; 500 .. 3500 */
#ifndef ASI_CTT1_TIMEOUT_MS
#define ASI_CTT1_TIMEOUT_MS 1000
#endif
/** ms without dialogue: an output slave drops its outputs (7.3 with P0 = 1) */
#ifndef ASI_CTT1_SLAVE_TIMEOUT_MS
#define ASI_CTT1_SLAVE_TIMEOUT_MS 500
#endif
/** value of bit 2 of ID2 that means transparent bits instead of an analog value */
#ifndef ASI_CTT1_ID2_TRANSPARENT
#define ASI_CTT1_ID2_TRANSPARENT 0
#endif
/** parameter of normal data mode */
#ifndef ASI_CTT1_PAR_DATA
#define ASI_CTT1_PAR_DATA 15
#endif
/** experimental: parameter that selects the identification string */
#ifndef ASI_CTT1_PAR_ID
#define ASI_CTT1_PAR_ID 14
#endif
/** experimental: parameter that selects the diagnosis string */
#ifndef ASI_CTT1_PAR_DIAG
#define ASI_CTT1_PAR_DIAG 13
#endif
/** experimental: parameter that selects reading the parameter string */
#ifndef ASI_CTT1_PAR_RD
#define ASI_CTT1_PAR_RD 11
#endif
/** experimental: parameter that selects writing the parameter string */
#ifndef ASI_CTT1_PAR_WR
#define ASI_CTT1_PAR_WR 7
#endif
/** triples of a value: E, five of data, D1 O V */
#ifndef ASI_CTT1_VALUE_TRIPLES
#define ASI_CTT1_VALUE_TRIPLES 7
#endif
/** triples of a string sequence of 3 bytes */
#ifndef ASI_CTT1_SEQUENCE_TRIPLES
#define ASI_CTT1_SEQUENCE_TRIPLES 8
#endif
/** experimental: S-7.1: triples of a value with its E triple, 3 .. 7 (6 .. 18 bits beside E), left-aligned */
#ifndef ASI_CTT1_TRIPLES_71
#define ASI_CTT1_TRIPLES_71 7
#endif
/** experimental: S-7.2: the same */
#ifndef ASI_CTT1_TRIPLES_72
#define ASI_CTT1_TRIPLES_72 7
#endif
/** ms since the last value taken by an output slave until OV is 0 */
#ifndef ASI_CTT1_OUTPUT_MS
#define ASI_CTT1_OUTPUT_MS 3500
#endif
/** longest string: 73 sequences */
#ifndef ASI_CTT1_STRING_BYTES
#define ASI_CTT1_STRING_BYTES 219
#endif
/** output bit that carries the master's clock */
#ifndef ASI_CTT2_DO_CLOCK
#define ASI_CTT2_DO_CLOCK 0
#endif
/** output bit that carries the master's data */
#ifndef ASI_CTT2_DO_DATA
#define ASI_CTT2_DO_DATA 1
#endif
/** experimental: input bit with the slave's data; swapped with di_clock when the ID object cannot be read */
#ifndef ASI_CTT2_DI_DATA
#define ASI_CTT2_DI_DATA 2
#endif
/** experimental: input bit with the slave's clock */
#ifndef ASI_CTT2_DI_CLOCK
#define ASI_CTT2_DI_CLOCK 3
#endif
/** experimental: ms until the two are swapped */
#ifndef ASI_CTT2_TRY_MS
#define ASI_CTT2_TRY_MS 5000
#endif
/** experimental: 1: bit 7 of a byte first */
#ifndef ASI_CTT2_MSB_FIRST
#define ASI_CTT2_MSB_FIRST 1
#endif
/** experimental: 1: a bit is taken at the rising clock edge; a clock period is two calls */
#ifndef ASI_CTT2_RISING_EDGE
#define ASI_CTT2_RISING_EDGE 1
#endif
/** experimental: level of clock (bit 0) and data (bit 1) between messages */
#ifndef ASI_CTT2_IDLE
#define ASI_CTT2_IDLE 3
#endif
/** experimental: calls without an edge that end a message and clear the receiver */
#ifndef ASI_CTT2_GAP_CALLS
#define ASI_CTT2_GAP_CALLS 8
#endif
/** experimental: ms for the first bit of a response */
#ifndef ASI_CTT2_RESPONSE_MS
#define ASI_CTT2_RESPONSE_MS 10000
#endif
/** experimental: broken cyclic messages in a row that make the values invalid; a lost answer breaks a message */
#ifndef ASI_CTT2_TRIES
#define ASI_CTT2_TRIES 3
#endif
/** longest message with its header */
#ifndef ASI_CTT2_MESSAGE_BYTES
#define ASI_CTT2_MESSAGE_BYTES 224
#endif
/** experimental: payload bits I1 I0 are inverted on the line; selector and ~Sel never */
#ifndef ASI_CTT3_INVERT_OUT
#define ASI_CTT3_INVERT_OUT 1
#endif
/** experimental: S-7.A.A: the call carries output pair s + offset */
#ifndef ASI_CTT3_AA_OFFSET
#define ASI_CTT3_AA_OFFSET 0
#endif
/** S-7.A.A: I2 is the inverted bit 0 of the selector */
#ifndef ASI_CTT3_AA_INVERTED
#define ASI_CTT3_AA_INVERTED 1
#endif
/** experimental: ms without a whole round of all pairs: transfer invalid */
#ifndef ASI_CTT3_TIMEOUT_MS
#define ASI_CTT3_TIMEOUT_MS 1000
#endif
/** experimental: 0: such slaves exchange plain bits and show transfer invalid. The wire format is not public */
#ifndef ASI_CTT4_ENABLE
#define ASI_CTT4_ENABLE 0
#endif
/** experimental: placeholder: call I1 I0 = number of the nibble, 3 first; the answer is that nibble */
#ifndef ASI_CTT4_NIBBLES
#define ASI_CTT4_NIBBLES 4
#endif
/** experimental: placeholder: call bit with the channel (S-7.A.9) or the output (S-7.A.8) */
#ifndef ASI_CTT4_CHANNEL_BIT
#define ASI_CTT4_CHANNEL_BIT 2
#endif
/** experimental: ms without a whole value: transfer invalid */
#ifndef ASI_CTT4_TIMEOUT_MS
#define ASI_CTT4_TIMEOUT_MS 1000
#endif
/** experimental: calls over which a channel must show a 1 to be reported closed */
#ifndef ASI_SAFETY_VIEW_POLLS
#define ASI_SAFETY_VIEW_POLLS 8
#endif
/** us after an answered call during which a safety slave keeps its word */
#ifndef ASI_SAFETY_WORD_HOLD_US
#define ASI_SAFETY_WORD_HOLD_US 224
#endif
#endif
