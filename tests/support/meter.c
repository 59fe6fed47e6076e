/* meter.c - measures two functions whose cost is known by counting: the meter of board.h on trial. */
#include "board.h"

#include <stdio.h>

void counted(void);
void stacked(void);
void nothing(void);

#if defined(__AVR__)
/* 1000 turns of 4 cycles, the last one 3, after 2; 40 bytes of stack. */
__asm__(".text\n.global counted\ncounted:\n ldi r24, lo8(1000)\n ldi r25, hi8(1000)\n1: sbiw r24, 1\n brne 1b\n ret\n"
        ".global nothing\nnothing:\n ret\n"
        ".global stacked\nstacked:\n ldi r24, 40\n1: push r1\n dec r24\n brne 1b\n ldi r24, 40\n"
        "2: pop r25\n dec r24\n brne 2b\n ret\n");
#elif defined(__riscv)
/* 1 + 2 * 1000 instructions more than nothing. */
__asm__(".text\n.global counted\ncounted:\n li t0, 1000\n1: addi t0, t0, -1\n bnez t0, 1b\n ret\n"
        ".global nothing\nnothing:\n ret\n"
        ".global stacked\nstacked:\n addi sp, sp, -40\n sw x0, 0(sp)\n addi sp, sp, 40\n ret\n");
#else
__asm__(".syntax unified\n.text\n.thumb\n"
        ".global counted\n.thumb_func\ncounted:\n ldr r0, =1000\n1: subs r0, #1\n bne 1b\n bx lr\n .pool\n"
        ".global nothing\n.thumb_func\nnothing:\n bx lr\n"
        ".global stacked\n.thumb_func\nstacked:\n sub sp, #40\n movs r0, #0\n str r0, [sp]\n add sp, #40\n bx lr\n");
#endif

static void put(unsigned long number)
{
    int digit;
    for (digit = 28; digit >= 0; digit -= 4) {
        (void)putchar("0123456789abcdef"[(number >> digit) & 15U]);
    }
    (void)putchar('\n');
}

__attribute__((noinline)) static void measure(void (*volatile function)(void))
{
    uint_least32_t start;
    uint_least32_t stop;
    unsigned depth;
    BOARD_PAINT();
    start = BOARD_TICKS();
    function();
    stop = BOARD_TICKS();
    depth = BOARD_DEPTH();
    put((stop - start) & BOARD_TICKS_MASK);
    put(depth);
}

int main(void)
{
    measure(nothing);
    measure(counted);
    measure(nothing);
    measure(stacked);
    return 0;
}
