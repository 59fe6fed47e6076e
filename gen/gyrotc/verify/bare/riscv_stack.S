/* riscv_stack.S - board_paint(), board_depth(): see board.h. No stack used. */
#define PAINTED 512
#define PATTERN 0xA5C3

    .section .text.board_paint, "ax"
    .global board_paint
board_paint:
    addi  t0, sp, -PAINTED
    li    t1, PATTERN
1:  sw    t1, 0(t0)
    addi  t0, t0, 4
    bne   t0, sp, 1b
    ret

    .section .text.board_depth, "ax"
    .global board_depth
board_depth:
    addi  a0, sp, -PAINTED
    li    t1, PATTERN
1:  lw    t2, 0(a0)
    bne   t2, t1, 2f
    addi  a0, a0, 4
    bne   a0, sp, 1b
2:  sub   a0, sp, a0
    ret
