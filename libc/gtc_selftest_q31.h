/* gtc_selftest_q31.h - the fixed-point operations that a compiler could get wrong.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_SELFTEST_Q31_H_INCLUDED
#define GTC_SELFTEST_Q31_H_INCLUDED

/* 1 if long products come out whole; the operands are read where the compiler cannot foresee them. */
static int arithmetic_works(void)
{
    static const uint_least32_t operands[2] = {0x7FFFFFFFUL, 0x3FFFFFFFUL};
    const volatile uint_least32_t *const operand = operands;
    const uint_least32_t a = operand[0];
    const uint_least32_t b = operand[1];
    const int_least32_t c = (int_least32_t)a;
    const int_least32_t d = (int_least32_t)b;
    const sum_t zero = begun(0);

    int works = 1;

    works &= (high_word(a, b) == 0x1FFFFFFFUL) ? 1 : 0;
    works &= (high_of_square(a) == 0x3FFFFFFFUL) ? 1 : 0;
    works &= (high_of_squares(c, -c) == 0x7FFFFFFEUL) ? 1 : 0;
    works &= (units(accumulate(zero, -d, d)) == 0x80000003UL) ? 1 : 0;
    return works;
}

#endif /* GTC_SELFTEST_Q31_H_INCLUDED */
