/* SPDX-License-Identifier: Apache-2.0 */
/* Reset and trap entry, RV32I. RAM is loaded with the whole image; no variable has an initial value other than 0
   (firmware.ld checks it), so the program may start again without being loaded again. */
#include "hal_vexriscv.h"

        .section .text.start, "ax"
        .globl  _start
_start:
        csrci   mstatus, HAL_MSTATUS_MIE
        la      sp, _stack_top
        la      t0, trap
        csrw    mtvec, t0
        la      t0, _bss_start
        la      t1, _bss_end
1:      bgeu    t0, t1, 2f
        sw      zero, 0(t0)
        addi    t0, t0, 4
        j       1b
2:      la      t0, _stack_guard        /* checked by hal_stack_intact() */
        li      t1, 0x57AC6A4D
        sw      t1, 0(t0)
        call    main
        j       _start

/* One interrupt, no nesting, on the stack of the main loop. C saves what it must; the rest is saved here. */
        .section .text.trap, "ax"
        .align  2
trap:
        addi    sp, sp, -64
        sw      ra, 0(sp)
        sw      t0, 4(sp)
        sw      t1, 8(sp)
        sw      t2, 12(sp)
        sw      a0, 16(sp)
        sw      a1, 20(sp)
        sw      a2, 24(sp)
        sw      a3, 28(sp)
        sw      a4, 32(sp)
        sw      a5, 36(sp)
        sw      a6, 40(sp)
        sw      a7, 44(sp)
        sw      t3, 48(sp)
        sw      t4, 52(sp)
        sw      t5, 56(sp)
        sw      t6, 60(sp)
        csrr    t0, mcause
        bltz    t0, 1f
        call    hal_fatal               /* an exception: a fault of the program; does not return */
1:      call    asi_interrupt
        lw      ra, 0(sp)
        lw      t0, 4(sp)
        lw      t1, 8(sp)
        lw      t2, 12(sp)
        lw      a0, 16(sp)
        lw      a1, 20(sp)
        lw      a2, 24(sp)
        lw      a3, 28(sp)
        lw      a4, 32(sp)
        lw      a5, 36(sp)
        lw      a6, 40(sp)
        lw      a7, 44(sp)
        lw      t3, 48(sp)
        lw      t4, 52(sp)
        lw      t5, 56(sp)
        lw      t6, 60(sp)
        addi    sp, sp, 64
        mret
