/* avr_stack.S - board_paint(), board_depth(): see board.h. Only the return address is on the stack. */
#define PAINTED 512
#define PATTERN 0xA5

    .section .text.board_paint, "ax", @progbits
    .global board_paint
board_paint:
    in    r26, 0x3D            ; X = stack pointer, which points below the last byte used
    in    r27, 0x3E
    ldi   r24, lo8(PAINTED)
    ldi   r25, hi8(PAINTED)
    adiw  r26, 1
    ldi   r18, PATTERN
1:  st    -X, r18
    sbiw  r24, 1
    brne  1b
    ret

    .section .text.board_depth, "ax", @progbits
    .global board_depth
board_depth:
    in    r26, 0x3D
    in    r27, 0x3E
    adiw  r26, 1
    subi  r26, lo8(PAINTED)
    sbci  r27, hi8(PAINTED)
    ldi   r24, lo8(PAINTED)
    ldi   r25, hi8(PAINTED)
1:  ld    r18, X+
    cpi   r18, PATTERN
    brne  2f
    sbiw  r24, 1
    brne  1b
2:  ret
