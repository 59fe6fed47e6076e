/* cortexm_stack.S - board_paint(), board_depth(): see board.h. Runs on every Cortex-M; no stack used. */
    .syntax unified
    .thumb
#define PAINTED 512
#define PATTERN 0xA5C3

    .section .text.board_paint, "ax"
    .global board_paint
    .thumb_func
board_paint:
    mov   r1, sp
    ldr   r2, =PAINTED
    subs  r0, r1, r2
    ldr   r2, =PATTERN
1:  str   r2, [r0]
    adds  r0, #4
    cmp   r0, r1
    bne   1b
    bx    lr
    .pool

    .section .text.board_depth, "ax"
    .global board_depth
    .thumb_func
board_depth:
    mov   r1, sp
    ldr   r2, =PAINTED
    subs  r0, r1, r2
    ldr   r2, =PATTERN
1:  ldr   r3, [r0]
    cmp   r3, r2
    bne   2f
    adds  r0, #4
    cmp   r0, r1
    bne   1b
2:  subs  r0, r1, r0
    bx    lr
    .pool
