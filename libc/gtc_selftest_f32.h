/* gtc_selftest_f32.h - directed vectors for the float32 operations that the runtime uses.
 *
 * Each vector fails on something that was met in the field: contraction to fused multiply-add,
 * excess precision kept in registers, a software float library that rounds ties the wrong way,
 * truncating arithmetic. The operands are read as volatile, so that the target computes, not the
 * compiler.
 * Subnormal numbers are not tested: no emitted table makes one.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_SELFTEST_F32_H_INCLUDED
#define GTC_SELFTEST_F32_H_INCLUDED

#define N_ARITHMETIC 10U

/* a, b, c and then a + b, a - b, a * b, a / b, a * b + c, c - a * b */
static const uint_least32_t FN(vectors)[N_ARITHMETIC][9] = {
    /* product and sum: 0; fused: 2^-24 */
    {0x3F800800UL, 0x3F800800UL, 0xBF801000UL, 0x40000800UL, 0x00000000UL,
     0x3F801000UL, 0x3F800000UL, 0x00000000UL, 0xC0001000UL},
    /* the same with signs turned */
    {0x3F800800UL, 0xBF800800UL, 0xBF801000UL, 0x00000000UL, 0x40000800UL,
     0xBF801000UL, 0xBF800000UL, 0xC0001000UL, 0x00000000UL},
    /* a product on a tie, to even */
    {0xBF25C800UL, 0xBF25C800UL, 0xBED6B6D8UL, 0xBFA5C800UL, 0x00000000UL,
     0x3ED6B6D8UL, 0x3F800000UL, 0x00000000UL, 0xBF56B6D8UL},
    /* a sum on a tie, down to even */
    {0x3F800000UL, 0x33800000UL, 0x3F000000UL, 0x3F800000UL, 0x3F7FFFFFUL,
     0x33800000UL, 0x4B800000UL, 0x3F000001UL, 0x3EFFFFFEUL},
    /* a sum on a tie, up to even */
    {0x3F800001UL, 0x33800000UL, 0xBF800000UL, 0x3F800002UL, 0x3F800000UL,
     0x33800001UL, 0x4B800001UL, 0xBF7FFFFFUL, 0xBF800001UL},
    /* a difference on a tie */
    {0x3F800000UL, 0x33000000UL, 0x3F800000UL, 0x3F800000UL, 0x3F800000UL,
     0x33000000UL, 0x4C000000UL, 0x3F800000UL, 0x3F800000UL},
    /* a quotient, rounded up */
    {0x3F800000UL, 0x40400000UL, 0x3EAAAAABUL, 0x40800000UL, 0xC0000000UL,
     0x40400000UL, 0x3EAAAAABUL, 0x40555555UL, 0xC02AAAABUL},
    /* a quotient near 2 */
    {0x3F2AAAABUL, 0x3EAAAAABUL, 0x358637BDUL, 0x3F800000UL, 0x3EAAAAABUL,
     0x3E638E3AUL, 0x40000000UL, 0x3E638E7DUL, 0xBE638DF7UL},
    /* signs of zero */
    {0x80000000UL, 0x3F800000UL, 0x00000000UL, 0x3F800000UL, 0xBF800000UL,
     0x80000000UL, 0x80000000UL, 0x00000000UL, 0x00000000UL},
    /* numbers of very different size */
    {0x43480000UL, 0xB727C5ACUL, 0x41000000UL, 0x4347FFFFUL, 0x43480001UL,
     0xBB03126EUL, 0xCB989680UL, 0x40FFEF9EUL, 0x41000831UL},
};

/* The number with these bits, read where the compiler cannot foresee it. */
static inline float FN(load)(const volatile uint_least32_t *bits)
{
    gtc_word_t word;

    word.bits = *bits;
    return word.value;
}

static inline int FN(is_expected)(float x, uint_least32_t row, uint_least32_t column)
{
    return (FN(bits)(x) == FN(vectors)[row][column]) ? 1 : 0;
}

static inline int FN(row_works)(uint_least32_t row)
{
    const float a = FN(load)(&FN(vectors)[row][0]);
    const float b = FN(load)(&FN(vectors)[row][1]);
    const float c = FN(load)(&FN(vectors)[row][2]);
    float sum;
    float difference;
    float product;
    float quotient;
    float added;
    float taken;

    sum = a + b;
    difference = a - b;
    product = a * b;
    quotient = a / b;
    added = product + c;
    taken = c - product;
    return FN(is_expected)(sum, row, 3U) & FN(is_expected)(difference, row, 4U)
           & FN(is_expected)(product, row, 5U) & FN(is_expected)(quotient, row, 6U)
           & FN(is_expected)(added, row, 7U) & FN(is_expected)(taken, row, 8U);
}

/* Conversions: to float rounds to nearest even, to integer cuts off. */
static inline int FN(conversions_work)(void)
{
    static const uint_least32_t integers[2] = {16777217UL, 16777219UL};
    static const uint_least32_t reals[2] = {0x44FFFFFFUL, 0x3F7FFFFFUL};
    const volatile uint_least32_t *const integer = integers;
    uint_least32_t n;
    float x;
    int works = 1;

    n = integer[0];
    x = (float)n;
    works &= (FN(bits)(x) == 0x4B800000UL) ? 1 : 0;
    n = integer[1];
    x = (float)n;
    works &= (FN(bits)(x) == 0x4B800002UL) ? 1 : 0;
    works &= ((int_least32_t)FN(load)(&reals[0]) == 2047) ? 1 : 0;
    works &= ((int_least32_t)FN(load)(&reals[1]) == 0) ? 1 : 0;
    return works;
}

/* 1 if the arithmetic of this build is IEEE float32, one rounding for each operation. */
static int FN(primitives_work)(void)
{
    uint_least32_t row;
    int works = FN(conversions_work)();

    for (row = 0U; row < N_ARITHMETIC; row++) {
        works &= FN(row_works)(row);
    }
    return works;
}

#endif /* GTC_SELFTEST_F32_H_INCLUDED */
