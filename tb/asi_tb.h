/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file asi_tb.h  C interface of the native simulation: slaves on a line, the Verilated chip with them, a flash.
 * Used from Python through cffi (host/python/asi/native.py, which reads the declarations between the cffi markers).
 * Units: times in ns of bus time since reset (int64_t); indices as in docs/architecture.md (number + 32 * Sel).
 * Errors: functions returning int give 0 or a count on success, a negative number on failure.
 */
#ifndef ASI_TB_H
#define ASI_TB_H
#include <stddef.h>
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif
/* cffi begin */
typedef struct asi_net asi_net;    /* slaves on one line */
typedef struct asi_chip asi_chip;  /* Verilated asi_master with an asi_net on its pins */

typedef struct { int64_t t_ns; int32_t width_ns; int32_t polarity; } asi_pulse;  /* polarity -1 or +1 */

/* what a slave is; address as index, 0 allowed */
typedef struct {
    uint8_t address, io, id, id1, id2;
    uint8_t inputs;       /* input nibble, line level = host level */
    uint8_t watchdog;     /* 1: resets itself after 94.2 ms without DEXG or WPAR */
    uint8_t present;      /* 0: not (yet) connected */
} asi_slave_cfg;

/* what a slave shows */
typedef struct {
    uint8_t address, outputs, parameter, dexg_disabled, synchronous, present, status, reserved;
    uint32_t requests, answers;
} asi_slave_state;

/* faults of one slave's answers; probabilities in 1/65536 per answer (65535: always), all may be active together */
typedef struct {
    uint16_t p_no_answer, p_parity, p_missing_pulse, p_shifted_pulse, p_extra_pulse;
    int32_t  shift_ns;     /* shift used by p_shifted_pulse, e.g. -2000 .. 2000 */
    int32_t  delay_ns;     /* added to every answer's start */
} asi_slave_faults;

asi_net *asi_net_new(uint64_t seed);
void     asi_net_free(asi_net *net);
int      asi_net_add(asi_net *net, const asi_slave_cfg *cfg);                  /* -> slave handle >= 0 */
int      asi_net_set_inputs(asi_net *net, int slave, uint8_t inputs);
int      asi_net_set_present(asi_net *net, int slave, uint8_t present);        /* 1 after 0 = power-up reset */
int      asi_net_set_periphery_fault(asi_net *net, int slave, uint8_t fault);  /* status bit S1 */
int      asi_net_set_faults(asi_net *net, int slave, const asi_slave_faults *faults);
int      asi_net_get(const asi_net *net, int slave, asi_slave_state *state);
/* options of one slave (SL-010); all 0 but write_ns = 15 ms by default */
typedef struct {
    int64_t write_ns;     /* time of a memory write after ADRA or WID1 */
    uint8_t write_fails;  /* 1: a write that begins now ends with S3 = 1 and the old content in the memory; the new
                             address or ID1 works until the next reset. S3 stays until a write goes well */
    uint8_t id1_locked;   /* 1: WID1 that changes the low three bits of ID1 is not answered */
    uint8_t old;          /* 1: RID1 and RID2 are not answered */
    uint8_t sel_at_zero;  /* 1: at address 0 an A/B slave obeys the select of its ID1 bit 3; 0: it obeys Sel = 0 */
    uint8_t di_swapped;   /* CTT2: clock on DI2 and data on DI3, the other way round than in the table */
    uint8_t busy;         /* CTT2: so many acyclic requests from now on are refused with standard error 4 */
} asi_slave_options;
int      asi_net_set_options(asi_net *net, int slave, const asi_slave_options *options);
/* Combined transactions (SL-009): the slave's kind follows from its codes, as in CT-001. Plain slaves, and kinds that
   have no such thing, refuse. Channels 0..3. CTT1: 16-bit values. CTT2: words of the cyclic images (an image of a byte:
   low byte of word 0); DI0, DI1 come from set_inputs. S-7.A.7: outputs in channel 0, inputs come from set_inputs.
   S-7.A.A: bytes in channel 0. Digital outputs are at host level. */
int      asi_net_set_value(asi_net *net, int slave, int channel, uint16_t value);  /* input word of the slave */
int      asi_net_set_invalid(asi_net *net, int slave, uint8_t v0, uint8_t overflow);  /* bits: V = 0; O = 1 */
int      asi_net_get_value(const asi_net *net, int slave, int channel, uint16_t *value);  /* output; 1, none (yet): 0 */
/* Strings. CTT1: kind 0 ID, 1 diagnosis, 2 parameters, in sequences of 3 bytes; the slave sets F and V itself, an empty
   string goes out as V = 0. CTT2: kind = index of an object, 0 = ID object, which also says how long the images are */
int      asi_net_set_string(asi_net *net, int slave, int kind, const uint8_t *bytes, int n);
int      asi_net_get_string(const asi_net *net, int slave, int kind, uint8_t *bytes, int max);  /* -> length <= max */
/* closed: bits 0, 1 = channels 1, 2. Before: 0001 0101 0110 1001 1110 1011 1100 0111, both closed */
int      asi_net_set_safety(asi_net *net, int slave, const uint8_t table[8], uint8_t closed);
int      asi_net_power(asi_net *net, uint8_t good);                            /* 0: all slaves lose power */
/* without a chip: a pulse of the master; then advance to t_ns and collect the slaves' pulses that start until then */
int      asi_net_master_pulse(asi_net *net, int64_t t_ns, int32_t polarity);
int      asi_net_advance(asi_net *net, int64_t t_ns, asi_pulse *out, int max);
/* a pulse of a foreign sender, t_ns not in the past: master and monitor get it, the slaves do not listen to it */
int      asi_net_inject(asi_net *net, int64_t t_ns, int32_t polarity, int32_t width_ns);

/* one call on the line as the passive monitor (independent of the chip) saw it */
typedef struct {
    int64_t  t_ns;         /* first pulse of the request */
    int32_t  delay_ns;     /* last request pulse to first answer pulse, -1 without answer */
    uint16_t call;         /* CB A4..A0 I4..I0 */
    uint8_t  error_class;  /* error_class_e of the answer */
    uint8_t  data;         /* answer nibble, valid when error_class is OK */
    uint8_t  phase;        /* phase_e when the request began */
    uint8_t  repeated;     /* 1: immediate repetition of the call before */
    uint8_t  request_ok;   /* 0: the request itself was not a legal telegram */
    uint8_t  reserved;
    int16_t  request_dev_ns, answer_dev_ns;  /* of a good telegram: its pulse farthest from the 3 us grid, with sign;
                                                -32768: none, or not good */
} asi_telegram;
int      asi_net_log(asi_net *net, asi_telegram *out, int max);                /* drains, -> count; keeps 2^20 */

/* All pulses of requests and answers, good or not, but each first one (it defines the grid): where in a bit time they
   begin and end. [0 master, 1 slaves][0 negative, 1 positive][bin]: bin 0 begins 1 us before the grid, 25 ns each */
typedef struct { uint32_t starts[2][2][240], ends[2][2][240]; } asi_pulse_counts;
void     asi_net_pulse_counts(const asi_net *net, asi_pulse_counts *out);     /* since reset */

typedef struct {
    uint64_t clocks, telegrams, repeated, failed;           /* failed: every answer that was not OK */
    int64_t  phase_ns[8];                  /* bus time spent with phase_o = n */
    uint64_t cycles, cycle_periods;        /* sync_o pulses; periods between two of them without a phase < 3 between */
    int64_t  cycle_min_ns, cycle_max_ns, cycle_sum_ns;      /* of these periods */
    uint64_t irq_count, irq_clocks_max;    /* core busy between leaving and re-entering WAIT, worst case */
    uint64_t irq_clocks_max_cycle;         /* the same while cycles run */
} asi_chip_stats;

/* SPI NOR flash (NV-008): JEDEC commands 02 03 04 05 06 20 9F AB B9, mode 0. Programming makes 1 to 0 only and wraps in
   its page, an erase makes FF, both need the write-enable latch and take time, in which only 05 is answered. As on
   boards whose FPGA has put its flash to sleep, it wakes up from power-off in deep power-down: AB first.
   Its content outlives the chip. When power fails in the middle of a program or an erase the cells are left anyhow,
   some of them in doubt: they read as 0 or 1, each time anew. */
typedef struct asi_flash asi_flash;
typedef struct {
    uint64_t bytes;             /* on SPI */
    uint32_t programs, erases;  /* begun */
    uint32_t refused;           /* frames that did nothing: unknown, asleep, busy, no write enable, not whole bytes */
} asi_flash_counts;
asi_flash *asi_flash_new(uint32_t bytes);            /* erased; bytes: a power of 2, 64 KB .. 16 MB. NULL: refused */
void     asi_flash_free(asi_flash *flash);           /* after the chip it is attached to */
int      asi_flash_load(asi_flash *flash, uint32_t address, const uint8_t *bytes, uint32_t n);
int      asi_flash_peek(const asi_flash *flash, uint32_t address, uint8_t *bytes, uint32_t n);   /* as cells tend */
int      asi_flash_doubt(const asi_flash *flash, uint32_t address, uint8_t *bytes, uint32_t n);  /* 1: in doubt */
void     asi_flash_copy(asi_flash *to, const asi_flash *from);                 /* all of it; equal sizes */
void     asi_flash_times(asi_flash *flash, int64_t program_ns, int64_t erase_ns);  /* default 0.4 ms, 45 ms */
void     asi_flash_cut_after(asi_flash *flash, int64_t bytes, uint32_t seed);  /* power fails after so many more bytes;
                                                                 -1: never. seed: of what is left of an operation */
int      asi_flash_is_dead(const asi_flash *flash);  /* 1: power has failed */
void     asi_flash_power_up(asi_flash *flash);       /* off and on again; time starts at 0 */
int      asi_flash_worn(asi_flash *flash, uint32_t address, int kind);         /* a sector: 1 erases leave a bit, 2 a
                                                                 page's first byte takes no zeros, 0 good again */
void     asi_flash_get_counts(const asi_flash *flash, asi_flash_counts *counts);
uint32_t asi_flash_erases(const asi_flash *flash, uint32_t address);           /* of the sector there */
/* the two ways to talk to it, not mixed within a frame: whole bytes, or pins (-> MISO). Times do not go back */
void     asi_flash_select(asi_flash *flash, int64_t t_ns, int on);
uint8_t  asi_flash_byte(asi_flash *flash, int64_t t_ns, uint8_t out);          /* -> what came back */
int      asi_flash_pins(asi_flash *flash, int64_t t_ns, int cs_n, int sck, int mosi);

/* firmware_path: RAM image as $readmemh text, wave_path: NULL = no waves (only the library built with tracing can);
   NULL on failure: a file that cannot be read or written, waves asked of the wrong library */
asi_chip *asi_chip_new(const char *firmware_path, const char *wave_path, uint64_t seed);
void      asi_chip_free(asi_chip *chip);                       /* closes the waveform */
asi_net  *asi_chip_net(asi_chip *chip);
uint32_t  asi_chip_clk_hz(const asi_chip *chip);
int64_t   asi_chip_time(const asi_chip *chip);
int64_t   asi_chip_run(asi_chip *chip, int64_t until_ns);      /* -> time reached */
int64_t   asi_chip_run_irq(asi_chip *chip, int64_t until_ns);  /* as run, stops when host_irq_o is high */
uint32_t  asi_chip_host_read(asi_chip *chip, uint32_t byte_addr);                       /* a real bus cycle */
void      asi_chip_host_write(asi_chip *chip, uint32_t byte_addr, uint32_t data, uint8_t byte_enable);
void      asi_chip_apf(asi_chip *chip, uint8_t low);           /* pin apf_ni; the slaves follow asi_net_power */
void      asi_chip_efault(asi_chip *chip, uint8_t fault);      /* pin efault_i */
void      asi_chip_attach_flash(asi_chip *chip, asi_flash *flash);  /* powers it up; NULL: none, MISO is 1 */
int       asi_chip_log(asi_chip *chip, asi_telegram *out, int max);                     /* as asi_net_log */
void      asi_chip_get_stats(asi_chip *chip, asi_chip_stats *out);
/* cffi end */
#ifdef __cplusplus
}
#endif
#endif
