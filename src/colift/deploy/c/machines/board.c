// A Cortex-M on one of Arm's MPS2 boards, as QEMU emulates it: files by semihosting, instructions by SysTick.
// QEMU is told that an instruction takes 64 ns (-icount shift=6); a tick of the 25 MHz clock takes 40 ns.

#include "machine.h"

#include <stdint.h>

#define AT(address) (*(volatile uint32_t *)(address))
#define MARK 0xC0117F7Du
#define PAINTED 4096 // words

extern uint32_t stack_top;
extern int main(void);

void reset(void);

__attribute__((section(".vectors"), used)) static void *const vectors[2] = {&stack_top, (void *)(uintptr_t)reset};

static int32_t semihost(int32_t operation, const void *block)
{
    register int32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = block;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static void end(void)
{
    static const uint32_t done[2] = {0x20026u, 0}; // the application has ended
    semihost(0x20, done);
    for (;;) {
    }
}

static int32_t open_file(const char *name, uint32_t length, uint32_t mode)
{
    const uintptr_t block[3] = {(uintptr_t)name, mode, length};
    return semihost(0x01, block);
}

static int32_t calls, answers;

void machine_begin(void)
{
    calls = open_file("calls.bin", 9, 1);
    answers = open_file("answers.bin", 11, 5);
}

void machine_take(void *to, int bytes)
{
    const uintptr_t block[3] = {(uintptr_t)calls, (uintptr_t)to, (uintptr_t)bytes};
    if (semihost(0x06, block) != 0) {
        end();
    }
}

void machine_give(const void *from, int bytes)
{
    const uintptr_t block[3] = {(uintptr_t)answers, (uintptr_t)from, (uintptr_t)bytes};
    semihost(0x05, block);
}

double machine_instructions(void)
{
    static uint32_t last = 0xFFFFFFu;
    static double ticks;
    const uint32_t now = AT(0xE000E018u); // counts down
    ticks += (double)((last - now) & 0xFFFFFFu);
    last = now;
    return ticks * (40.0 / 64.0);
}

__attribute__((noinline)) void machine_paint(void)
{
    volatile uint32_t here;
    volatile uint32_t *below = &here - 16;
    for (int k = 0; k < PAINTED; ++k) {
        *(below - k) = MARK;
    }
}

__attribute__((noinline)) int machine_used(void)
{
    volatile uint32_t here;
    volatile uint32_t *below = &here - 16;
    int k = PAINTED - 1;
    while (k > 0 && *(below - k) == MARK) {
        --k;
    }
    return 4 * (k + 16);
}

void machine_end(void)
{
    const uintptr_t block[1] = {(uintptr_t)answers};
    semihost(0x02, block);
    end();
}

void reset(void)
{
    AT(0xE000ED88u) |= 0xFu << 20; // the floating-point unit
    __asm__ volatile("dsb\n\tisb");
    AT(0xE000E014u) = 0xFFFFFFu; // SysTick: all its 24 bits, of the processor's clock
    AT(0xE000E018u) = 0;
    AT(0xE000E010u) = 5;
    main();
    end();
}
