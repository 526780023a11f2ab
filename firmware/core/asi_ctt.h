/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_ctt.h  Combined transactions: values, bytes and strings over many DEXG calls (CT-001 ..).
 * Layer: protocol core. It sees nibbles at line level and the time; it knows neither execution control nor port.
 * Memory: one asi_ctt_t, owned by the caller. Context: not reentrant, in the interrupt or with it masked.
 * All choices of the bit layer: rdl/ctt.toml. Engines: asi_ctt1.c, asi_ctt2.c, asi_ctt3.c, asi_ctt4.c, asi_ctt5.c.
 */
#ifndef ASI_CTT_H
#define ASI_CTT_H
#include <stdbool.h>
#include <stdint.h>
#include "asi_config.h"
#include "asi_ctt_table.h"
#include "asi_lists.h"
#include "asi_status.h"

/** What kind of transaction a slave's codes ask for (CT-001). */
typedef enum {
    ASI_CTT_NONE,    /**< plain nibbles */
    ASI_CTT_1_IN, ASI_CTT_1_OUT,  /**< S-7.1 .. 7.4 */
    ASI_CTT_2,       /**< S-7.5.5, S-7.A.5, S-B.A.5 */
    ASI_CTT_3_4IO,   /**< S-7.A.7 */
    ASI_CTT_3_8IO,   /**< S-7.A.A */
    ASI_CTT_4,       /**< S-7.A.8, S-7.A.9 */
    ASI_CTT_5,       /**< S-6.0: member of a group of addresses */
    ASI_CTT_SAFETY,  /**< S-x.B: transported only */
} asi_ctt_kind_t;

/** Words of AIDI and AODI: 4 of a number; standard slaves have all, A slaves the first two, B slaves the last two. */
#define ASI_ANALOG_WORDS 128u
static inline unsigned asi_analog_word(unsigned index) { return (index & 31u) * 4u + (index >> 5) * 2u; }

/** Bits of asi_ctt_t.status. */
enum {
    ASI_CTT_VALID = 15u,          /**< one bit per channel: the value is the slave's, not a substitute */
    ASI_CTT_OV = 1u << 4,         /**< outputs: the slave takes new values */
    ASI_CTT_TV = 1u << 5,         /**< the transfer works: no time-out, no toggle error */
    ASI_CTT_TRANSPARENT = 1u << 6, /**< 16 plain bits, not an analog value */
    ASI_CTT_STRING = 1u << 7,     /**< a string or message is open; cyclic values of this slave pause */
};

/** One finished DEXG call to a slave. */
typedef struct {
    bool ok;           /**< answered */
    uint8_t sent;      /**< I3..I0 on the line; of an A/B slave I3 is ~Sel */
    uint8_t answer;    /**< I3..I0 */
    uint8_t outputs;   /**< host nibble of this index, host level */
    uint32_t now_us;   /**< bus time */
} asi_ctt_call_t;

/** Strings and messages: one at a time on a line. */
typedef enum {
    ASI_STRING_ID, ASI_STRING_DIAGNOSIS, ASI_STRING_READ, ASI_STRING_WRITE,  /**< S-7.4 */
    ASI_STRING_MESSAGE,  /**< CTT2: request in, response out */
} asi_string_kind_t;

typedef struct {
    bool open;
    uint8_t index, kind;
    asi_status_t status;     /**< of the last one; ASI_E_BUSY while open */
    uint16_t length, position;
    uint8_t bytes[ASI_CTT2_MESSAGE_BYTES];
} asi_string_t;

/** Private to asi_ctt1.c: one input or output slave. */
typedef struct {
    uint32_t frame;          /**< triples received, or value or sequence to send; the last triple in bits 2..0 */
    uint32_t last_us;        /**< last accepted triple */
    uint32_t update_us;      /**< outputs: last value taken by the slave */
    uint8_t nibble;          /**< on its way until accepted, before invert_out */
    uint8_t mode, t, first;  /**< t: triple on its way, 0 = last; first: triple a value begins with */
    uint8_t channel, channels, align;
    bool output, transparent, strings;
    bool drop;               /**< the triple on its way is to be thrown away, then a value begins */
    bool quiet;              /**< held, and the nibble was accepted: the slave has served all it has seen */
    bool other_mode;         /**< the slave was in a string mode since asi_ctt_hold */
    uint8_t wanted;          /**< outputs: triple the slave asked for while held */
    uint16_t budget;         /**< accepted triples until a string must be over */
} asi_ctt1_t;

/** Private to asi_ctt2.c. */
typedef struct {
    uint32_t since_us, try_us;  /**< begin of waiting for a response; of the attempts to read the ID object */
    uint16_t position, length;  /**< bytes sent or received of the message; length 0: a gap ends it */
    uint8_t step, service, level, half;  /**< level: clock and data bits on their way */
    uint8_t tx, tx_bits, rx, rx_bits;
    uint8_t clock, still;    /**< slave's clock bit; calls without an edge of it */
    uint8_t quiet;           /**< calls of a gap */
    uint8_t fails;
    uint8_t in_bytes, out_bytes, in_mask, out_mask;
    uint8_t code;            /**< first byte of the request */
    uint8_t reads;           /**< data bytes that the request asks for */
    bool two_words;          /**< A or B slave */
    bool known, put;         /**< the ID object was read; the next cyclic service is put */
    uint8_t bytes[10];
} asi_ctt2_t;

/** Private to asi_ctt3.c. */
typedef struct {
    uint32_t last_us;        /**< last whole round */
    uint8_t nibble, snapshot, inputs;
    uint8_t selector;        /**< 8 I/O: of the last answer; 4 = none yet. 4 I/O: 1 = pair 3, 2 is on its way */
    uint8_t run;             /**< 8 I/O: next selector of an unbroken run; 8 = broken */
} asi_ctt3_t;

/** Private to asi_ctt4.c. */
typedef struct {
    uint32_t last_us;
    uint16_t value;
    uint8_t nibble, number, channel;
    bool two;
} asi_ctt4_t;

/** Private to asi_ctt5.c: polls left during which a safety channel counts as closed. */
typedef struct {
    uint8_t polls[2];
} asi_safety_t;

typedef union {
    asi_ctt2_t two;          /**< the largest, so that {0} clears all */
    asi_ctt1_t one;
    asi_ctt3_t three;
    asi_ctt4_t four;
    asi_safety_t safety;
    uint8_t group;           /**< CTT5: members of the group that begins here */
} asi_ctt_slave_t;

typedef struct {
    /* what the host sees */
    uint16_t ai[ASI_ANALOG_WORDS];   /**< AIDI; a substitute value wherever status says not valid */
    uint8_t status[ASI_INDICES];
    asi_list_t safe_in[2];           /**< non-safe view: F-IN1, F-IN2 */
    asi_list_t changed;              /**< indices whose ai or status changed; cleared by the reader */
    /* what the host gives */
    uint16_t ao[ASI_ANALOG_WORDS];   /**< AODI */
    asi_string_t string;
    /* private */
    uint8_t kind[ASI_INDICES];       /**< asi_ctt_kind_t; NONE while not open */
    asi_list_t live;
    uint32_t groups, safety;         /**< indices 1 .. 31: open members of CTT5 groups; open safety slaves */
    uint32_t grouped;                /**< first members of groups whose value is shown */
    asi_list_t swapped;              /**< CTT2 slaves with data and clock swapped; kept over close and open */
    asi_ctt_slave_t slave[ASI_INDICES];
} asi_ctt_t;

/** Whether any slave is open: else images and calls are plain. */
static inline bool asi_ctt_any(const asi_ctt_t *c)
{
    return (c->live.w[0] | c->live.w[1] | c->groups | c->grouped | c->safety) != 0u;
}

/** Whether a string to write is whole sequences of 3 bytes, n up to 255. The core cannot divide, and a loop that
 * subtracts becomes a division in some compilers. */
static inline bool asi_ctt_whole_sequences(unsigned n)
{
    n = (n & 3u) + (n >> 2 & 3u) + (n >> 4 & 3u) + (n >> 6 & 3u); /* 4 leaves 1 */
    return (0x1249u >> n & 1u) != 0u; /* 0, 3, 6, 9, 12 */
}

/** Kind for these codes (IO 3..0, ID 7..4, ID1 11..8, ID2 15..12). */
asi_ctt_kind_t asi_ctt_kind(uint16_t codes);
/** Nothing open; all values 0. */
void asi_ctt_init(asi_ctt_t *c);
/** The slave entered LAS. @return true when its slot must be live: asi_ctt_call then gives each next nibble */
bool asi_ctt_open(asi_ctt_t *c, unsigned index, uint16_t codes, uint32_t now_us);
/** The slave left LAS: substitute values, an open string ends with ASI_E_ABORTED. */
void asi_ctt_close(asi_ctt_t *c, unsigned index);
/** First nibble of a live slave after asi_ctt_open, line level. */
unsigned asi_ctt_first(asi_ctt_t *c, unsigned index, unsigned outputs);
/** One call of a live slave is over. @return nibble of its next call, line level (I3 of an A/B slave is not used) */
unsigned asi_ctt_call(asi_ctt_t *c, unsigned index, const asi_ctt_call_t *call);
/** Digital inputs of a live slave for IDI, from its last answer, host level. */
unsigned asi_ctt_inputs(const asi_ctt_t *c, unsigned index, unsigned answer);
/** End of a cycle for the kinds that are not live: groups of CTT5 and safety slaves. failed: indices called in this
 * cycle without an answer. in: input image, corrected in place (a failed safety slave is 0). out: host image; CTT5
 * members get their nibbles of AODI in it. codes: CDI. */
void asi_ctt_cycle(asi_ctt_t *c, const asi_list_t *las, const asi_list_t *called, const asi_list_t *failed,
                   const uint16_t codes[ASI_INDICES], uint32_t in[ASI_IMAGE_WORDS], uint32_t out[ASI_IMAGE_WORDS]);
/** Members of incomplete CTT5 groups in LAS: a configuration error (CT-052). */
asi_list_t asi_ctt_incomplete(const asi_ctt_t *c, const asi_list_t *las, const uint16_t codes[ASI_INDICES]);
/** Before the WPAR that selects a string mode of a CTT1 slave: cyclic values pause. A slave that changes its mode
 * between two triples would else mix a value of both. Call it until true, about once per cycle, then send WPAR.
 * @return true: the slave has served all calls so far (or has no CTT1) and WPAR may go out */
ASI_MUST_USE bool asi_ctt_hold(asi_ctt_t *c, unsigned index);
/** After the WPAR that selects normal data again, or when a string was given up: values go on with their first triple.
 * A string still open ends with ASI_E_ABORTED. Nothing for other kinds. */
void asi_ctt_release(asi_ctt_t *c, unsigned index, uint32_t now_us);
/** Begin a string or message of c->string.bytes (length: bytes to write). Strings: between asi_ctt_hold and
 * asi_ctt_release, the caller has set the slave's parameter; whole sequences of 3 bytes, F and V are made here.
 * Messages need no hold.
 * @return ASI_E_NOT_ACTIVE, ASI_E_PROFILE, ASI_E_BUSY, ASI_E_STATE (not held), ASI_E_OVERFLOW, ASI_E_ARG (not whole
 * sequences; no request code of CTT2 or a length that does not go with it); else progress shows in c->string: status
 * ASI_OK, ASI_E_TRANSFER, ASI_E_OVERFLOW (the slave has more), ASI_E_DEVICE (bytes: its error response), ASI_E_ABORTED;
 * length: bytes of the result */
ASI_MUST_USE asi_status_t asi_ctt_string(asi_ctt_t *c, unsigned index, asi_string_kind_t kind, unsigned length,
                                         uint32_t now_us);
#endif
