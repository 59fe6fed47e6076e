/* gtc_selftest_f32.h - directed vectors for the float32 operations that the runtime uses.
 *
 * Each vector fails on something that was met in the field: contraction to fused multiply-add,
 * excess precision kept in registers, sums taken in another order, subnormal numbers flushed to 0, a
 * software float library that rounds ties the wrong way, truncating arithmetic. The operands are read as
 * volatile, so that the target computes, not the compiler. A compiler fuses a product only where nothing
 * else uses it; hence each sum of products has products of its own, read anew.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_SELFTEST_F32_H_INCLUDED
#define GTC_SELFTEST_F32_H_INCLUDED

#define N_ARITHMETIC 12U /* rows of vectors ... */
#define N_OPERATIONS 6U  /* ... each with the results of so many operations */
#define N_JOINED 3U /* rows of operands ... */
#define N_SHAPES 8U /* ... for so many sums of products, as the runtime has them */

/* a, b, c and then a + b, a - b, a * b, a / b, a * b + c, c - a * b */
static const uint_least32_t vectors[N_ARITHMETIC][3U + N_OPERATIONS] = {
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
    /* subnormal results of normal numbers */
    {0x00800000UL, 0x3F000000UL, 0x80800001UL, 0x3F000000UL, 0xBF000000UL,
     0x00400000UL, 0x01000000UL, 0x80400001UL, 0x80C00001UL},
    /* subnormal numbers as operands */
    {0x00000003UL, 0x4B800000UL, 0x00000005UL, 0x4B800000UL, 0xCB800000UL,
     0x01C00000UL, 0x00000000UL, 0x01C00001UL, 0x81BFFFFFUL},
};

/* a, b, c, d and then what join() makes of them. In two of the rows at least, each is another number where any
 * product is not rounded before it is added, or sums are taken in another order. */
static const uint_least32_t joined[N_JOINED][4U + N_SHAPES] = {
    {0x3FA389A8UL, 0xBFE3689FUL, 0xBFCA780BUL, 0xBFEACCBAUL,
     0xC07681EAUL, 0xBF30277EUL, 0x3F30277EUL, 0x3F21B700UL,
     0x40993DA6UL, 0xBDBDFCADUL, 0xC01145E4UL, 0x3E8E26A0UL},
    {0xBFD3E5C8UL, 0xBFBF10C6UL, 0x3FD4A0A6UL, 0x3F910F0EUL,
     0x40843B52UL, 0x3F4F57FCUL, 0xBF4F57FCUL, 0x408B50E8UL,
     0x409EFF50UL, 0x409FA008UL, 0x401E2650UL, 0x3EB068E0UL},
    {0x40A2F24DUL, 0xBF1E1214UL, 0x4029A57CUL, 0x3F86B1E7UL,
     0xBEFCA4F8UL, 0xC0B96FCCUL, 0x40B96FCCUL, 0xBEB5A8A0UL,
     0x41D27BF1UL, 0x41F09943UL, 0xC0493A1CUL, 0x3DBC9340UL},
};

/* The number with these bits, read where the compiler cannot foresee it. */
static inline float load(const volatile uint_least32_t *bits)
{
    gtc_word_t word;

    word.bits = *bits;
    return word.value;
}

/* Whether n numbers have these bits. */
static int are_bits(const float *numbers, const uint_least32_t *bits, uint_least32_t n)
{
    uint_least32_t i;
    int equal = 1;

    for (i = 0U; i < n; i++) {
        equal &= (bits_of(numbers[i]) == bits[i]) ? 1 : 0;
    }
    return equal;
}

static inline int row_works(uint_least32_t row)
{
    const float a = load(&vectors[row][0]);
    const float b = load(&vectors[row][1]);
    const float c = load(&vectors[row][2]);
    float results[N_OPERATIONS];
    float product;

    results[0] = a + b;
    results[1] = a - b;
    product = a * b;
    results[2] = product;
    results[3] = a / b;
    results[4] = product + c;
    results[5] = c - product;
    return are_bits(results, &vectors[row][3], N_OPERATIONS);
}

/* The results that the runtime's sums of products have, in the shapes in which it has them. */
static inline void join(const volatile uint_least32_t *row, float results[N_SHAPES])
{
    float a;
    float b;

    a = load(&row[0]) * load(&row[1]); /* a b + c */
    results[0] = a + load(&row[2]);
    a = load(&row[0]) * load(&row[1]); /* a b - c */
    results[1] = a - load(&row[2]);
    a = load(&row[0]) * load(&row[1]); /* c - a b */
    results[2] = load(&row[2]) - a;
    a = load(&row[0]) * load(&row[1]); /* a b + c d */
    b = load(&row[2]) * load(&row[3]);
    results[3] = a + b;
    a = load(&row[0]); /* a^2 + b^2 */
    b = load(&row[1]);
    a = a * a;
    b = b * b;
    results[4] = a + b;
    a = load(&row[0]); /* (a^2 + c) d */
    a = a * a;
    a = a + load(&row[2]);
    results[5] = load(&row[3]) * a;
    a = load(&row[0]) * load(&row[1]); /* (a b + 8) - 8 */
    a = a + 8.0F;
    results[6] = a - 8.0F;
    a = load(&row[0]) + F32_ROUND; /* a - ((a + 1.5 2^23) - 1.5 2^23) */
    a = a - F32_ROUND;
    results[7] = load(&row[0]) - a;
}

static inline int joined_works(uint_least32_t row)
{
    float results[N_SHAPES];

    join(joined[row], results);
    return are_bits(results, &joined[row][4], N_SHAPES);
}

/* Conversions: to float rounds to nearest even, to integer cuts off. */
static inline int conversions_work(void)
{
    static const uint_least32_t integers[2] = {16777217UL, 16777219UL};
    static const uint_least32_t reals[2] = {0x44FFFFFFUL, 0x3F7FFFFFUL};
    const volatile uint_least32_t *const integer = integers;
    uint_least32_t n;
    float x;
    int works = 1;

    n = integer[0];
    x = (float)n;
    works &= (bits_of(x) == 0x4B800000UL) ? 1 : 0;
    n = integer[1];
    x = (float)n;
    works &= (bits_of(x) == 0x4B800002UL) ? 1 : 0;
    works &= ((int_least32_t)load(&reals[0]) == 2047) ? 1 : 0;
    works &= ((int_least32_t)load(&reals[1]) == 0) ? 1 : 0;
    return works;
}

/* 1 if the arithmetic of this build is IEEE float32, one rounding for each operation. */
static int arithmetic_works(void)
{
    uint_least32_t row;
    int works = conversions_work();

    for (row = 0U; row < N_ARITHMETIC; row++) {
        works &= row_works(row);
    }
    for (row = 0U; row < N_JOINED; row++) {
        works &= joined_works(row);
    }
    return works;
}

#endif /* GTC_SELFTEST_F32_H_INCLUDED */
