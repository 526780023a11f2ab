/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file soc.h  The soft core itself (VexRiscv Min, Verilated) with plain memories, a C++ model of asi_regs and a flash,
 * for tests of firmware images. The sequencer is played by Python while the core sleeps (firmware/tests/fake_chip.py).
 * Declarations between the markers are read by fake_chip.py.
 */
#ifndef FW_SOC_H
#define FW_SOC_H
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif
/* cffi begin */
typedef struct {
    uint32_t ctrl, event, event_en, exec, status, spi_ctrl;
    uint32_t batch_len;       /* written by the core; the test sets 0 when it has run the batch */
    uint32_t batches;         /* writes to BATCH */
    uint32_t batch_while_busy;
    uint32_t host_irqs;       /* writes to HOST_IRQ.set */
    uint32_t bad_accesses;    /* outside the memory map, or not a whole word of a register or of link RAM */
    uint32_t flash_selects;   /* SPI transactions */
    uint64_t clocks;
    uint64_t skipped_us;      /* bus time that the test let pass while the core slept */
    uint32_t awake_max;       /* clocks between leaving and re-entering WAIT, worst case since the test set it to 0 */
    uint32_t latch, monitor_ctrl, ring_head, ring_lost;
    uint32_t seq_violations;  /* published words changed while IN_SEQ was even */
    uint32_t torn_writes;     /* writes to AIDI of less than a 16-bit value */
    uint32_t analog_writes, combined_writes, safe_writes;  /* of AIDI, CTT_STATE, SAFE_IN */
    uint32_t shake_address, shake_bytes;  /* window words that are 0 or FFFFFFFF, anew at every clock */
} soc_state;

int soc_open(uint32_t reset_vector, const uint8_t *flash, uint32_t flash_base, uint32_t flash_bytes);
uint32_t *soc_ram(void);      /* 16384 words at 0 */
uint32_t *soc_rom(void);      /* 256 words at 0x1000_0000 */
uint32_t *soc_window(void);   /* 4096 words at 0x4000_0000 */
uint32_t *soc_stats(void);     /* 1024 words at 0x8002_0000 */
uint32_t *soc_ring(void);      /* 512 words at 0x8003_0000 */
uint32_t *soc_link(void);     /* 256 words at 0x8001_0000 */
soc_state *soc_regs(void);
/* Run until the core sleeps in WAIT without a pending event (-> 1), or for so many clocks (-> 0). */
int soc_run(uint32_t max_clocks);
/* Run so many clocks, asleep or not. */
void soc_clocks(uint32_t clocks);
/* cffi end */
#ifdef __cplusplus
}
#endif
#endif
