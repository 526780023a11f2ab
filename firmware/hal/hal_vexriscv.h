/* SPDX-License-Identifier: Apache-2.0 */
/**
 * @file hal_vexriscv.h  All that is special to VexRiscv, for C and assembler. Another core: another file like this one.
 * The Min build has no mscratch and no mcycle, mtvec is write-only and direct, wfi does nothing (hence register WAIT).
 * External interrupts pass a mask CSR of the core's own before mie.MEIE.
 */
#ifndef HAL_VEXRISCV_H
#define HAL_VEXRISCV_H
#define HAL_CSR_IRQ_MASK 0xBC0 /* one bit per external interrupt input, 1 = let through */
#define HAL_MIE_MEIE 0x800
#define HAL_MSTATUS_MIE 8

#ifndef __ASSEMBLER__
#define HAL_STR2(x) #x
#define HAL_STR(x) HAL_STR2(x)

/** Let interrupts in. */
static inline void hal_irq_on(void)
{
    __asm__ volatile("csrsi mstatus, " HAL_STR(HAL_MSTATUS_MIE) ::: "memory");
}

/** Keep interrupts out. */
static inline void hal_irq_off(void)
{
    __asm__ volatile("csrci mstatus, " HAL_STR(HAL_MSTATUS_MIE) ::: "memory");
}

/** Open the core's own masks; hal_irq_on decides from then on. The chip has one interrupt, whatever input it is on. */
static inline void hal_irq_unmask(void)
{
    __asm__ volatile("csrw " HAL_STR(HAL_CSR_IRQ_MASK) ", %0" ::"r"(0xFFFFFFFFu));
    __asm__ volatile("csrw mie, %0" ::"r"(HAL_MIE_MEIE));
}
#endif
#endif
