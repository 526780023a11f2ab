/* SPDX-License-Identifier: Apache-2.0 */
/* Reset in the boot ROM. The jump is in assembler because the program starts at address 0, which C takes for NULL. */
        .section .text.start, "ax"
        .globl  _start
_start:
        la      sp, _stack_top
        call    boot
        jr      zero
