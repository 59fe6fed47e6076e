/* gtc_num_q31.h - the numbers of the fixed-point runtime: types, names and primitives.
 *
 * The same names as gtc_num_f32.h, in integers. Nothing here depends on the width of int, on byte
 * order, on the right shift of a negative number, or on a conversion that wraps. No operation
 * can overflow with a table that the generator made: docs/numerics.md says which range each has,
 * and a test build asserts every one (GTC_ASSERT_RANGE).
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_NUM_Q31_H_INCLUDED
#define GTC_NUM_Q31_H_INCLUDED

#include "gtc_private.h"

#define FN(name) gtc_q31_##name
#define TABLE gtc_q31_table_t
#define STATE gtc_q31_state_t
#define NUM int_least32_t
#define WIDE int_least64_t
#define NUM_ZERO 0
#define NUM_PLAUSIBLE_MIN (-90L * 65536L) /* 2^-16 C */
#define NUM_PLAUSIBLE_MAX (200L * 65536L)
#define NUM_MISSING_BITS 0x80000000UL
#define ARITHMETIC 2U /* in the second word of an image */

/* A table member as a number and as the word of an image; an array element as a number. */
#define MEMBER(member) (member)
#define MEMBER_BITS(member) ((uint_least32_t)(member) & 0xFFFFFFFFUL)
#define ELEMENT(word) ((word).integer)

/* Tests define it; see tests/c/gtc_checked.h. */
#ifndef GTC_ASSERT_RANGE
#define GTC_ASSERT_RANGE(claim) ((void)0)
#else
/* 1 if x and -x are numbers of 32 bits. */
static inline int gtc_q31_is_32_bits(int_least64_t x)
{
    return ((x >= -2147483647) && (x <= 2147483647)) ? 1 : 0;
}
#endif

static inline uint_least32_t FN(bits)(int_least32_t x)
{
    return (uint_least32_t)x & 0xFFFFFFFFU;
}

static inline int FN(is_missing)(int_least32_t x)
{
    return (x == GTC_TEMP_MISSING) ? 1 : 0;
}

/* ---- the map ---------------------------------------------------------------------------- */

/* 2147483603 * 2^(-i/64): just under 2^31, so that truncating u errs to both sides alike. */
static const uint_least32_t FN(exp2_table)[64] = {
    0x7FFFFFD3UL, 0x7E9F05DAUL, 0x7D41D942UL, 0x7BE86F8EUL, 0x7A92BE5FUL, 0x7940BB74UL,
    0x77F25CA4UL, 0x76A797E6UL, 0x7560634BUL, 0x741CB4FFUL, 0x72DC834BUL, 0x719FC491UL,
    0x70666F4FUL, 0x6F307A1AUL, 0x6DFDDBA5UL, 0x6CCE8ABBUL, 0x6BA27E40UL, 0x6A79AD30UL,
    0x69540EA4UL, 0x683199C9UL, 0x671245E6UL, 0x65F60A5CUL, 0x64DCDEA0UL, 0x63C6BA41UL,
    0x62B394E6UL, 0x61A3664BUL, 0x60962643UL, 0x5F8BCCBAUL, 0x5E8451AEUL, 0x5D7FAD38UL,
    0x5C7DD783UL, 0x5B7EC8D1UL, 0x5A82797AUL, 0x5988E1EAUL, 0x5891FAA2UL, 0x579DBC38UL,
    0x56AC1F57UL, 0x55BD1CBDUL, 0x54D0AD3DUL, 0x53E6C9BDUL, 0x52FF6B38UL, 0x521A8ABAUL,
    0x51382165UL, 0x5058286CUL, 0x4F7A9914UL, 0x4E9F6CB8UL, 0x4DC69CC2UL, 0x4CF022AFUL,
    0x4C1BF80EUL, 0x4B4A1681UL, 0x4A7A77BAUL, 0x49AD157EUL, 0x48E1E9A0UL, 0x4818EE08UL,
    0x47521CADUL, 0x468D6F95UL, 0x45CAE0D9UL, 0x450A6AA2UL, 0x444C0728UL, 0x438FB0B4UL,
    0x42D5619CUL, 0x421D144BUL, 0x4166C335UL, 0x40B268E3UL
};

/* 2^(-t/64) = 1 - t (B 2^-38 - C 2^-24 t) + 9.3e-9, 0 <= t < 1 */
#define Q31_B 2977018596U
#define Q31_C 979U

/* u in 2^-24 from which 2^-u is below the last bit of the sum. */
#define Q31_CUT 0x20000000U

/* Upper word of a product. */
static inline uint_least32_t FN(high)(uint_least32_t a, uint_least32_t b)
{
#if GTC_HALF_MULTIPLY
    const uint_least32_t a0 = a & 0xFFFFU;
    const uint_least32_t a1 = a >> 16;
    const uint_least32_t b0 = b & 0xFFFFU;
    const uint_least32_t b1 = b >> 16;
    const uint_least32_t middle = (a1 * b0) + ((a0 * b0) >> 16);
    const uint_least32_t other = (a0 * b1) + (middle & 0xFFFFU);

    return (a1 * b1) + (middle >> 16) + (other >> 16);
#else
    return (uint_least32_t)(((uint_least64_t)a * b) >> 32);
#endif
}

/* Upper word of a^2 + b^2; |a|, |b| < 2^31. */
static inline uint_least32_t FN(high_of_squares)(int_least32_t a, int_least32_t b)
{
#if GTC_HALF_MULTIPLY
    const uint_least32_t p = (uint_least32_t)((a < 0) ? -a : a);
    const uint_least32_t q = (uint_least32_t)((b < 0) ? -b : b);
    const uint_least32_t p0 = p & 0xFFFFU;
    const uint_least32_t p1 = p >> 16;
    const uint_least32_t q0 = q & 0xFFFFU;
    const uint_least32_t q1 = q >> 16;
    const uint_least32_t low_p = p0 * p0;
    const uint_least32_t low_q = q0 * q0;
    const uint_least32_t carry = ((low_p & 0xFFFFU) + (low_q & 0xFFFFU)) >> 16;
    const uint_least32_t low = (low_p >> 16) + (low_q >> 16) + carry;
    const uint_least32_t cross = (p0 * p1) + (q0 * q1) + (low >> 1);

    return (p1 * p1) + (q1 * q1) + (cross >> 15);
#else
    const uint_least64_t sum = (uint_least64_t)((int_least64_t)a * a)
                               + (uint_least64_t)((int_least64_t)b * b);

    return (uint_least32_t)(sum >> 32);
#endif
}

/* sum + w * e, in two's complement; 0 <= e < 2^31 */
static inline uint_least64_t FN(accumulate)(uint_least64_t sum, int_least32_t w, uint_least32_t e)
{
    return sum + (uint_least64_t)((int_least64_t)w * (int_least32_t)e);
}

/* 2^-u in 2^-31, u in 2^-24, below Q31_CUT. */
static inline uint_least32_t FN(exp2)(uint_least32_t u)
{
    const uint_least32_t t = (u << 14) & 0xFFFFFFFFU; /* 2^-32 of a step of the table */
    const uint_least32_t slope = Q31_B - (Q31_C * ((u >> 4) & 0x3FFFU));
    const uint_least32_t drop = FN(high)(t, slope);
    const uint_least32_t entry = FN(exp2_table)[(u >> 18) & 63U];

    GTC_ASSERT_RANGE((u < Q31_CUT) && (slope < Q31_B + 1U) && ((FN(high)(entry, drop) >> 6) < entry));
    return (entry - (FN(high)(entry, drop) >> 6)) >> (u >> 24);
}

/* The inputs of a network: 0 ... 2^16 - 1 over the envelope. */
typedef struct {
    uint_least32_t x_temp;
    uint_least32_t x_slope;
} FN(point_t);
#define POINT FN(point_t)

/* Position of an input in its range, clamped; gain in 2^-26. Returns GTC_OK, GTC_CLAMPED or, for the
 * mark of a missing number, which lies below every range, GTC_E_ARG. */
static inline int FN(position)(int_least32_t x, const int_least32_t range[2], int_least32_t gain,
                               uint_least32_t *position)
{
    const uint_least32_t span = (uint_least32_t)range[1] - (uint_least32_t)range[0];
    uint_least32_t offset = (uint_least32_t)x - (uint_least32_t)range[0];
    int status = GTC_OK;

    GTC_ASSERT_RANGE(span < 0x4000000U);
    if (offset > span) {
        status = (x == GTC_TEMP_MISSING) ? GTC_E_ARG : GTC_CLAMPED;
        offset = (x < range[0]) ? 0U : span;
    }
    *position = FN(high)(offset << 6, (uint_least32_t)gain);
    return status;
}

/* Where the inputs lie. */
static inline int FN(locate)(const TABLE *table, int_least32_t temp, int_least32_t slope, POINT *in)
{
    const int status = FN(position)(temp, &table->envelope[0], table->scale[0], &in->x_temp);

    return status | FN(position)(slope, &table->envelope[2], table->scale[1], &in->x_slope);
}

/* Cells of the inputs, T and slope, among n each. */
static inline void FN(cells)(const TABLE *table, const POINT *in, const uint_least32_t n[2],
                             uint_least32_t cell[2])
{
    (void)table;
    cell[0] = (in->x_temp * n[0]) >> 16;
    cell[1] = (in->x_slope * n[1]) >> 16;
}

/* The argument s x + k of one input; the product may wrap, their sum does not. */
static inline int_least32_t FN(argument)(const gtc_word_t *center, uint_least32_t x)
{
    gtc_word_t argument;

    argument.bits = (center[0].bits * x) + center[1].bits;
    GTC_ASSERT_RANGE(argument.integer
                     == ((int_least64_t)center[0].bits * x) + center[1].integer);
    GTC_ASSERT_RANGE(argument.bits != 0x80000000U);
    return argument.integer;
}

/* Takes one Gaussian into the sum. */
static inline uint_least64_t FN(gaussian)(uint_least64_t sum, const gtc_word_t *center, const POINT *in)
{
    const uint_least32_t u = FN(high_of_squares)(FN(argument)(&center[0], in->x_temp),
                                                 FN(argument)(&center[2], in->x_slope));

    return (u < Q31_CUT) ? FN(accumulate)(sum, center[4].integer, FN(exp2)(u)) : sum;
}

/* The same for all centers of a table with narrow widths, whose squares are in units 2^narrow times
 * larger. A file of its own, because few tables need it. */
uint_least64_t FN(narrow)(uint_least64_t sum, const gtc_word_t *center, const gtc_word_t *end,
                          POINT in, uint_least32_t narrow);

/* One network: w0 + linear part + its Gaussians. */
static inline int_least32_t FN(network)(const TABLE *table, const gtc_word_t *network,
                                        const gtc_word_t *center, const POINT *in)
{
    const gtc_word_t *const end = &center[network[0].bits * GTC_CENTER_WORDS];
    uint_least64_t sum;
    gtc_word_t bias;

    /* In 2^-31 of the result's unit; half a unit rounds it. */
    sum = ((uint_least64_t)(int_least64_t)network[1].integer << 31) | 0x40000000U;
    sum = FN(accumulate)(sum, network[2].integer, in->x_temp << 15);
    sum = FN(accumulate)(sum, network[3].integer, in->x_slope << 15);
    if (table->scale[2] != 0) {
        sum = FN(narrow)(sum, center, end, *in, (uint_least32_t)table->scale[2]);
    } else {
#if GTC_UNROLL
        if ((network[0].bits & 1U) != 0U) {
            sum = FN(gaussian)(sum, center, in);
            center = &center[GTC_CENTER_WORDS];
        }
        for (; center != end; center = &center[2 * GTC_CENTER_WORDS]) {
            sum = FN(gaussian)(sum, center, in);
            sum = FN(gaussian)(sum, &center[GTC_CENTER_WORDS], in);
        }
#else
        for (; center != end; center = &center[GTC_CENTER_WORDS]) {
            sum = FN(gaussian)(sum, center, in);
        }
#endif
    }
    GTC_ASSERT_RANGE((sum + 0x4000000000000000ULL) < 0x8000000000000000ULL);
    bias.bits = (uint_least32_t)((sum >> 31) & 0xFFFFFFFFU);
    return bias.integer;
}

/* ---- the front end ---------------------------------------------------------------------- */

/* num / den, rounded to nearest, halves away from zero; den > 0. */
static inline int_least64_t FN(divided)(int_least64_t num, uint_least32_t den)
{
    const uint_least64_t magnitude = (num < 0) ? (uint_least64_t)(-num) : (uint_least64_t)num;
    const int_least64_t q = (int_least64_t)((magnitude + (den / 2U)) / den);

    return (num < 0) ? -q : q;
}

static inline int_least32_t FN(step_per_sample)(const TABLE *table, uint_least32_t samples_per_block)
{
    return (int_least32_t)FN(divided)(table->max_slope, samples_per_block);
}

/* |a - b| <= max_step + samples * step_per_sample */
static inline int FN(is_near)(const STATE *state, int_least32_t a, int_least32_t b,
                              uint_least32_t samples)
{
    const int_least64_t limit = state->table->max_step
                                + ((int_least64_t)samples * state->step_per_sample);
    const int_least64_t d = (int_least64_t)a - b;

    return (((d < 0) ? -d : d) <= limit) ? 1 : 0;
}

static inline int_least64_t FN(add)(int_least64_t sum, int_least64_t d)
{
    return sum + d;
}

static inline int_least64_t FN(diff)(int_least64_t a, int_least64_t b)
{
    return a - b;
}

static inline int_least64_t FN(scaled)(uint_least32_t k, int_least64_t x)
{
    return (int_least64_t)k * x;
}

/* base + sum / n */
static inline int_least32_t FN(mean)(int_least32_t base, int_least64_t sum, uint_least32_t n)
{
    GTC_ASSERT_RANGE(gtc_q31_is_32_bits(base + FN(divided)(sum, n)));
    return base + (int_least32_t)FN(divided)(sum, n);
}

/* num / den */
static inline int_least32_t FN(quotient)(int_least64_t num, uint_least32_t den)
{
    GTC_ASSERT_RANGE(gtc_q31_is_32_bits(FN(divided)(num, den)));
    return (int_least32_t)FN(divided)(num, den);
}

#endif /* GTC_NUM_Q31_H_INCLUDED */
