/* gtc_selftest_f32.h - directed operands for the float32 operations that the runtime uses.
 *
 * Each row has another result on something that was met in the field: contraction to fused multiply-add,
 * excess precision kept in registers, sums taken in another order, subnormal numbers flushed to 0, a
 * software float library that rounds ties the wrong way, truncating arithmetic. All results together are known by
 * their CRC, which takes less memory than they do. The operands are read as volatile, so that the target computes,
 * not the compiler. A compiler fuses a product only where nothing else uses it; hence each sum of products has
 * products of its own, read anew.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_SELFTEST_F32_H_INCLUDED
#define GTC_SELFTEST_F32_H_INCLUDED

#define N_ARITHMETIC 12U /* rows of operands ... */
#define N_OPERATIONS 6U  /* ... each for so many operations */
#define N_JOINED 3U      /* rows of operands ... */
#define N_SHAPES 8U      /* ... for so many sums of products, as the runtime has them */
#define N_CONVERSIONS 4U

/* CRC-32 of the bits of all results: of convert(), then of operate() for each row of `operands`, then of join() for
 * each row of `joined`. */
#define RESULTS_CRC 0xF33649C0UL

/* a, b, c of operate() */
static const uint_least32_t operands[N_ARITHMETIC][3] = {
    {0x3F800800UL, 0x3F800800UL, 0xBF801000UL}, /* product and sum: 0; fused: 2^-24 */
    {0x3F800800UL, 0xBF800800UL, 0xBF801000UL}, /* the same with signs turned */
    {0xBF25C800UL, 0xBF25C800UL, 0xBED6B6D8UL}, /* a product on a tie, to even */
    {0x3F800000UL, 0x33800000UL, 0x3F000000UL}, /* a sum on a tie, down to even */
    {0x3F800001UL, 0x33800000UL, 0xBF800000UL}, /* a sum on a tie, up to even */
    {0x3F800000UL, 0x33000000UL, 0x3F800000UL}, /* a difference on a tie */
    {0x3F800000UL, 0x40400000UL, 0x3EAAAAABUL}, /* a quotient, rounded up */
    {0x3F2AAAABUL, 0x3EAAAAABUL, 0x358637BDUL}, /* a quotient near 2 */
    {0x80000000UL, 0x3F800000UL, 0x00000000UL}, /* signs of zero */
    {0x43480000UL, 0xB727C5ACUL, 0x41000000UL}, /* numbers of very different size */
    {0x00800000UL, 0x3F000000UL, 0x80800001UL}, /* subnormal results of normal numbers */
    {0x00000003UL, 0x4B800000UL, 0x00000005UL}, /* subnormal numbers as operands */
};

/* a, b, c, d of join(). In two of the rows at least, each result is another number where any product is not rounded
 * before it is added, or sums are taken in another order. */
static const uint_least32_t joined[N_JOINED][4] = {
    {0x3FA389A8UL, 0xBFE3689FUL, 0xBFCA780BUL, 0xBFEACCBAUL},
    {0xBFD3E5C8UL, 0xBFBF10C6UL, 0x3FD4A0A6UL, 0x3F910F0EUL},
    {0x40A2F24DUL, 0xBF1E1214UL, 0x4029A57CUL, 0x3F86B1E7UL},
};

/* The number with these bits, read where the compiler cannot foresee it. */
static inline float load(const volatile uint_least32_t *bits)
{
    gtc_word_t word;

    word.bits = *bits;
    return word.value;
}

/* To float rounds to nearest even, to integer cuts off. */
static inline void convert(gtc_word_t results[N_CONVERSIONS])
{
    static const uint_least32_t integers[2] = {16777217UL, 16777219UL};
    static const uint_least32_t reals[2] = {0x44FFFFFFUL, 0x3F7FFFFFUL}; /* the numbers below 2048 and below 1 */
    const volatile uint_least32_t *const integer = integers;
    uint_least32_t n;

    n = integer[0];
    results[0].value = (float)n;
    n = integer[1];
    results[1].value = (float)n;
    results[2].integer = (int_least32_t)load(&reals[0]);
    results[3].integer = (int_least32_t)load(&reals[1]);
}

static inline void operate(const volatile uint_least32_t *row, gtc_word_t results[N_OPERATIONS])
{
    const float a = load(&row[0]);
    const float b = load(&row[1]);
    const float c = load(&row[2]);
    float product;

    results[0].value = a + b;
    results[1].value = a - b;
    product = a * b;
    results[2].value = product;
    results[3].value = a / b;
    results[4].value = product + c;
    results[5].value = c - product;
}

/* Sums of products in the shapes in which the runtime has them. */
static inline void join(const volatile uint_least32_t *row, gtc_word_t results[N_SHAPES])
{
    float a;
    float b;

    a = load(&row[0]) * load(&row[1]); /* a b + c */
    results[0].value = a + load(&row[2]);
    a = load(&row[0]) * load(&row[1]); /* a b - c */
    results[1].value = a - load(&row[2]);
    a = load(&row[0]) * load(&row[1]); /* c - a b */
    results[2].value = load(&row[2]) - a;
    a = load(&row[0]) * load(&row[1]); /* a b + c d */
    b = load(&row[2]) * load(&row[3]);
    results[3].value = a + b;
    a = load(&row[0]); /* a^2 + b^2 */
    b = load(&row[1]);
    a = a * a;
    b = b * b;
    results[4].value = a + b;
    a = load(&row[0]); /* (a^2 + c) d */
    a = a * a;
    a = a + load(&row[2]);
    results[5].value = load(&row[3]) * a;
    a = load(&row[0]) * load(&row[1]); /* (a b + 8) - 8 */
    a = a + 8.0F;
    results[6].value = a - 8.0F;
    a = load(&row[0]) + F32_ROUND; /* a - ((a + 1.5 2^23) - 1.5 2^23) */
    a = a - F32_ROUND;
    results[7].value = load(&row[0]) - a;
}

/* 1 if the arithmetic of this build is IEEE float32, one rounding for each operation. */
static int arithmetic_works(void)
{
    gtc_word_t results[N_SHAPES];
    uint_least32_t crc;
    uint_least32_t row;

    convert(results);
    crc = crc_words(CRC_START, results, N_CONVERSIONS);
    for (row = 0U; row < N_ARITHMETIC; row++) {
        operate(operands[row], results);
        crc = crc_words(crc, results, N_OPERATIONS);
    }
    for (row = 0U; row < N_JOINED; row++) {
        join(joined[row], results);
        crc = crc_words(crc, results, N_SHAPES);
    }
    return (crc == (RESULTS_CRC ^ CRC_FINAL)) ? 1 : 0;
}

#endif /* GTC_SELFTEST_F32_H_INCLUDED */
