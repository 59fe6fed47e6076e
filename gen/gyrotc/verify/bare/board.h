/* board.h - what board_test.c may ask of an emulated board: ticks of a counter, and the stack that a call used.
 *
 * board_paint() writes a pattern into the BOARD_PAINTED bytes below the stack pointer, board_depth() returns how
 * many of them, from the stack pointer down, were written to since. Neither uses the stack itself (AVR: only the
 * return address, as the measured call does).
 */
#ifndef BOARD_H_INCLUDED
#define BOARD_H_INCLUDED

#include <stdint.h>

#define BOARD_PAINTED 512

void board_paint(void);
unsigned board_depth(void);
#define BOARD_PAINT() board_paint()
#define BOARD_DEPTH() board_depth()

#if defined(__riscv)
static inline uint_least32_t board_ticks(void)
{
    uint_least32_t count;
    __asm__ volatile(".option push\n .option arch, +zicsr\n csrr %0, minstret\n .option pop" : "=r"(count));
    return count;
}
#define BOARD_TICKS_MASK 0xFFFFFFFFUL
#elif defined(__AVR__)
#define board_ticks() ((uint_least32_t) *(volatile uint16_t *) 0x84) /* TCNT1 */
#define BOARD_TICKS_MASK 0xFFFFUL
#else
#define board_ticks() (0xFFFFFFUL - *(volatile uint32_t *) 0xE000E018UL) /* SysTick counts down */
#define BOARD_TICKS_MASK 0xFFFFFFUL
#endif
#define BOARD_TICKS() board_ticks()

#endif
