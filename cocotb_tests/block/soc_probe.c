// SPDX-License-Identifier: Apache-2.0
// A program for the block test of asi_soc: does single accesses with the real core, on command of the host.
// The mailbox is at the end of the dual-port memory. Built by rv_build.py, linked at RAM or boot ROM.
#include <stdint.h>

typedef struct {
    volatile uint32_t op;      // host: command; core: 0 when done
    volatile uint32_t addr, data, result;
    volatile uint32_t irqs;    // interrupts taken
    volatile uint32_t events;  // EVENT bits seen in them
    volatile uint32_t alive;   // core: written once at start
} mailbox_t;

#define MAIL  ((mailbox_t *)0x40003F00u)
#define EVENT (*(volatile uint32_t *)0x80000010u)
static const uint32_t alive = 0x600DB007u;  // read through the data side: from the boot ROM when linked there

__attribute__((interrupt("machine"), aligned(4))) static void on_irq(void)
{
    uint32_t e = EVENT;
    EVENT = e;
    MAIL->events |= e;
    MAIL->irqs++;
}

__attribute__((noreturn)) void probe(void)
{
    __asm__ volatile("csrw mtvec, %0\n\tcsrw 0xBC0, %1\n\tcsrw mie, %2" ::"r"(on_irq), "r"(1u), "r"(0x800u));
    MAIL->op = 0;
    MAIL->irqs = 0;
    MAIL->events = 0;
    MAIL->alive = *(const volatile uint32_t *)&alive;
    for (;;) {
        const uint32_t op = MAIL->op;
        const uint32_t a = MAIL->addr, d = MAIL->data;
        uint32_t r = 0;
        if (op == 0) continue;
        if (op == 1) r = *(volatile uint8_t *)a;
        if (op == 2) r = *(volatile uint16_t *)a;
        if (op == 3) r = *(volatile uint32_t *)a;
        if (op == 4) *(volatile uint8_t *)a = (uint8_t)d;
        if (op == 5) *(volatile uint16_t *)a = (uint16_t)d;
        if (op == 6) *(volatile uint32_t *)a = d;
        if (op == 7) r = ((uint32_t(*)(uint32_t))a)(d);
        if (op == 8) __asm__ volatile("csrsi mstatus, 8");
        if (op == 9) __asm__ volatile("csrci mstatus, 8");
        MAIL->result = r;
        MAIL->op = 0;
    }
}

__attribute__((naked, noreturn, used, section(".start"))) void _start(void)
{
    __asm__ volatile("li sp, 0x3000\n\tj probe");
}
