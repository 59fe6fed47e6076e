/* gtc_num_q31.h - the numbers of the fixed-point runtime: types and primitives.
 *
 * In the repository: the same names as in gtc_num_f32.h, in integers.
 *
 * Nothing here depends on the width of int, on byte order, on the right shift of a negative number, or on a
 * conversion that wraps. No operation can overflow with a table that the generator made: docs/numerics.md says
 * which range each has, and a test build asserts them (GTC_ASSERT). Two casts to 32 bits (NARROW) have no assertion;
 * the proof of run-time errors shows their range (docs/proof.md): a slope's for block means of -90 to 200 C, the ends
 * of a play's for every temperature that an envelope may have, -200 to 400 C, and every width that a table may have.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_NUM_Q31_H_INCLUDED
#define GTC_NUM_Q31_H_INCLUDED

#include "gtc_private.h"
#include "gtc_names_q31.h"
#if defined(__ARM_FEATURE_SAT)
#include <arm_acle.h>
#endif

#if GTC_WITH_SAVE
#define NUM_MOST 2147483647 /* the largest word */
#endif
#define CHANGE_ZERO 0U /* no change between readings is allowed */
#if GTC_WITH_SAVE
#define NUM_COLDEST (-200L * 65536L) /* 2^-16 C: no envelope goes beyond */
#endif
#if GTC_WITH_SAVE || GTC_WITH_MEMORY
#define NUM_HOTTEST (400L * 65536L)
#endif
#if GTC_WITH_IMAGE
#define NUM_PLAUSIBLE_MIN (-90L * 65536L) /* 2^-16 C */
#define NUM_PLAUSIBLE_MAX (200L * 65536L)
#endif
#define NUM_MISSING_BITS 0x80000000UL
#define FRAC_BITS ((uint_least32_t)GTC_BIAS_FRAC_BITS)
#define ARITHMETIC 2U /* in the second word of an image */

/* Parts of a table's scale. */
#define SCALE_TEMP 0U
#define SCALE_SLOPE 1U
#if GTC_WITH_NARROW
#define SCALE_NARROW 2U /* bits by which squares are in larger units */
#endif

#include "gtc_saturate.inl"

/* A number and its negative, of 32 bits.
 * MISRA 2.5: for assertions, which most builds leave out. */
#define IS_32_BITS(x) (((x) >= -2147483647) && ((x) <= 2147483647))

static inline uint_least32_t bits_of(int_least32_t x)
{
    return (uint_least32_t)x;
}

static inline int is_missing(int_least32_t x)
{
    return (x == GTC_TEMP_MISSING) ? 1 : 0;
}

#if GTC_WITH_RETAINED || !GTC_WITH_TIME
static inline int_least32_t missing_number(void)
{
    return GTC_TEMP_MISSING;
}
#endif

/* With H, t in 2^-24 and G in 2^-16: ((H - t)^2 + G) table[i] = 2^(-(i + t)/64) (1 + 6.7e-9), 0 <= t < 1.
 * The table also makes up for the truncation of t: its errors go to both sides alike. */
#define Q31_H 1557473452U
#define Q31_G 558709134U

/* round(2052389455 * 2^(-i/64)); docs/numerics.md,
 * section 3, says how it is made. */
static const uint_least32_t exp2_table[64] = {
    0x7A54FA4FUL, 0x7903A1B7UL, 0x77B5EB65UL, 0x766BCD55UL, 0x75253D9BUL, 0x73E2326BUL,
    0x72A2A211UL, 0x716682F3UL, 0x702DCB94UL, 0x6EF87291UL, 0x6DC66E9EUL, 0x6C97B68CUL,
    0x6B6C4143UL, 0x6A4405C6UL, 0x691EFB2EUL, 0x67FD18B0UL, 0x66DE5597UL, 0x65C2A947UL,
    0x64AA0B3AUL, 0x63947305UL, 0x6281D84FUL, 0x617232DCUL, 0x60657A82UL, 0x5F5BA730UL,
    0x5E54B0EAUL, 0x5D508FCBUL, 0x5C4F3C03UL, 0x5B50ADD7UL, 0x5A54DDA4UL, 0x595BC3DAUL,
    0x586558FCUL, 0x577195A6UL, 0x56807285UL, 0x5591E85CUL, 0x54A5F000UL, 0x53BC825CUL,
    0x52D5986EUL, 0x51F12B46UL, 0x510F3408UL, 0x502FABEBUL, 0x4F528C39UL, 0x4E77CE4FUL,
    0x4D9F6B99UL, 0x4CC95D9AUL, 0x4BF59DE3UL, 0x4B242619UL, 0x4A54EFF1UL, 0x4987F533UL,
    0x48BD2FB7UL, 0x47F49966UL, 0x472E2C3AUL, 0x4669E23EUL, 0x45A7B58DUL, 0x44E7A051UL,
    0x44299CC8UL, 0x436DA53BUL, 0x42B3B406UL, 0x41FBC393UL, 0x4145CE5DUL, 0x4091CEECUL,
    0x3FDFBFDAUL, 0x3F2F9BCCUL, 0x3E815D7AUL, 0x3DD4FFA7UL
};

/* u in 2^-24, below 32; 2^-u is 0 in 2^-29. */
#define Q31_LAST 0x1FFFFFFFU

/* ---- products, in halves of 16 bits where a core has no long multiplication */

#if GTC_HALF_MULTIPLY
/* floor(x / 2^16).
 * MISRA 10.1: what >> does to a negative number is up to the compiler; the first half asks which it is. */
static inline int_least32_t upper(int_least32_t x)
{
    return ((-1 >> 1) == -1) ? (x >> 16) : ((int_least32_t)((bits_of(x) ^ 0x80000000U) >> 16) - 32768);
}
#endif

/* Upper word of a * b; a, b < 2^31. */
static inline uint_least32_t high_word(uint_least32_t a, uint_least32_t b)
{
#if GTC_HALF_MULTIPLY
    const uint_least32_t a0 = a & 0xFFFFU;
    const uint_least32_t a1 = a >> 16;
    const uint_least32_t b0 = b & 0xFFFFU;
    const uint_least32_t b1 = b >> 16;

    return (a1 * b1) + (((a1 * b0) + (a0 * b1) + ((a0 * b0) >> 16)) >> 16);
#else
    return (uint_least32_t)(((uint_least64_t)a * b) >> 32);
#endif
}

/* Upper word of a^2; a < 2^31. */
static inline uint_least32_t high_of_square(uint_least32_t a)
{
#if GTC_HALF_MULTIPLY
    const uint_least32_t a0 = a & 0xFFFFU;
    const uint_least32_t a1 = a >> 16;

    return (a1 * a1) + (((a0 * a1) + ((a0 * a0) >> 17)) >> 15);
#else
    return high_word(a, a);
#endif
}

/* Upper word of a^2 + b^2; |a|, |b| < 2^31. */
static inline uint_least32_t high_of_squares(int_least32_t a, int_least32_t b)
{
#if GTC_HALF_MULTIPLY
    const uint_least32_t p = (uint_least32_t)((a < 0) ? -a : a);
    const uint_least32_t q = (uint_least32_t)((b < 0) ? -b : b);
    const uint_least32_t p0 = p & 0xFFFFU;
    const uint_least32_t p1 = p >> 16;
    const uint_least32_t q0 = q & 0xFFFFU;
    const uint_least32_t q1 = q >> 16;
    const uint_least32_t low_p = p0 * p0;
    const uint_least32_t low = low_p + (q0 * q0);
    const uint_least32_t carry = (uint_least32_t)(low < low_p) << 15;
    const uint_least32_t cross = (p0 * p1) + (q0 * q1) + (low >> 17) + carry;

    return (p1 * p1) + (q1 * q1) + (cross >> 15);
#else
    const int_least64_t p = (int_least64_t)a * a;
    const int_least64_t q = (int_least64_t)b * b;

    return (uint_least32_t)(((uint_least64_t)p + (uint_least64_t)q) >> 32);
#endif
}

/* A sum of products, in 2^-29 of the result's unit: as it begins for w0, with w * e added, and in units as it ends;
 * |w0| <= 2^30, |w| < 2^30, 0 <= e < 2^30. A wide sum has w0 in it from the start, so that no register waits with
 * the network's address for the end of the loop; in halves it costs less to add w0 last. */
#if GTC_HALF_MULTIPLY
typedef struct {
    uint_least32_t low;
    uint_least32_t high;
} sum_t;

static inline sum_t begun(int_least32_t w0)
{
    sum_t sum;

    (void)w0;
    sum.low = 0U;
    sum.high = 0U;
    return sum;
}

static inline sum_t accumulate(sum_t sum, int_least32_t w, int_least32_t e)
{
    const uint_least32_t w0 = bits_of(w) & 0xFFFFU;
    const int_least32_t w1 = upper(w);
    const uint_least32_t e0 = bits_of(e) & 0xFFFFU;
    const int_least32_t e1 = upper(e);
    const uint_least32_t carry = (w0 * e0) >> 16;
    const int_least32_t middle = (w1 * (int_least32_t)e0) + ((int_least32_t)w0 * e1) + (int_least32_t)carry;
    const int_least32_t high = (w1 * e1) + upper(middle);
    const uint_least32_t low = (uint_least32_t)w * (uint_least32_t)e;

    sum.high += (uint_least32_t)high;
    sum.low += low;
    sum.high += (sum.low < low) ? 1U : 0U;
    return sum;
}

static inline uint_least32_t units(sum_t sum)
{
    return (sum.high << 3) | (sum.low >> 29);
}

static inline uint_least32_t ended(sum_t sum, const gtc_word_t *network)
{
    return network[NETWORK_CONSTANT].bits + units(sum);
}
#else
typedef int_least64_t sum_t;

static inline sum_t begun(int_least32_t w0)
{
    return (int_least64_t)w0 * 0x20000000;
}

static inline sum_t accumulate(sum_t sum, int_least32_t w, int_least32_t e)
{
    return sum + ((int_least64_t)w * e);
}

/* Its value in units of the result, rounded down, in two's complement. */
static inline uint_least32_t units(sum_t sum)
{
    GTC_ASSERT((sum >= -0x1000000000000000LL) && (sum < 0x1000000000000000LL));
    return (uint_least32_t)(((uint_least64_t)sum >> 29) & 0xFFFFFFFFU);
}

static inline uint_least32_t ended(sum_t sum, const gtc_word_t *network)
{
    (void)network;
    return units(sum);
}
#endif

/* ---- the map ---------------------------------------------------------------------------- */

/* 2^-u in 2^-29, u in 2^-24, up to Q31_LAST. */
static inline int_least32_t exp2_of_minus(uint_least32_t u)
{
    const uint_least32_t v = Q31_H - ((u << 14) >> 8);
    const uint_least32_t s = high_of_square(v) + Q31_G;
    const uint_least32_t e = high_word(exp2_table[(u >> 18) & 63U], s) >> (u >> 24);

    GTC_ASSERT((u <= Q31_LAST) && (v <= Q31_H) && (s >= Q31_G));
    return (int_least32_t)e;
}

/* The inputs of a network: 0 ... 2^16 - 1 over the envelope. */
typedef struct {
    uint_least32_t x_temp;
    uint_least32_t x_slope;
} q31_point_t;

/* Position of an input in its range, clamped; gain in 2^-27. Returns GTC_OK, GTC_CLAMPED or, for the
 * mark of a missing number, which lies below every range, GTC_E_ARG. */
static inline int position_of(int_least32_t x, const int_least32_t range[2], int_least32_t gain,
                               uint_least32_t *position)
{
    const uint_least32_t span = (uint_least32_t)range[1] - (uint_least32_t)range[0];
    uint_least32_t offset = (uint_least32_t)x - (uint_least32_t)range[0];
    int status = GTC_OK;

    GTC_ASSERT(span < 0x4000000U);
    if (offset > span) {
        offset = span & (0U - (uint_least32_t)(x > range[0]));
        status = GTC_CLAMPED;
        if (x == GTC_TEMP_MISSING) {
            status = GTC_E_ARG;
        }
    }
    *position = high_word(offset << 5, (uint_least32_t)gain);
    return status;
}

/* Where the inputs lie. Returns GTC_OK, GTC_CLAMPED or, for a missing one, GTC_E_ARG: then at some legal place. */
static inline int locate(const TABLE *table, int_least32_t temp, int_least32_t slope, POINT *in)
{
    const int status = position_of(temp, &table->envelope[ENVELOPE_TEMP], table->scale[SCALE_TEMP], &in->x_temp);
    const int other = position_of(slope, &table->envelope[ENVELOPE_SLOPE], table->scale[SCALE_SLOPE], &in->x_slope);

    return ((status < 0) || (other < 0)) ? GTC_E_ARG : (status | other);
}

#if GTC_WITH_COVERAGE || GTC_WITH_UNCERTAINTY
/* Cells of the inputs, T and slope, among n each. */
static inline void cells_of(const TABLE *table, const POINT *in, const uint_least32_t n[2],
                             uint_least32_t cell[2])
{
    (void)table;
    cell[0] = (in->x_temp * n[0]) >> 16;
    cell[1] = (in->x_slope * n[1]) >> 16;
}
#endif

/* The argument s x + k of one input; the product may wrap, their sum does not. */
static inline int_least32_t argument_of(const gtc_word_t *center, uint_least32_t x)
{
    gtc_word_t argument;

    argument.bits = (center[0].bits * x) + center[1].bits;
    GTC_ASSERT(argument.integer
                     == ((int_least64_t)center[0].bits * x) + center[1].integer);
    GTC_ASSERT(argument.bits != 0x80000000U);
    return argument.integer;
}

/* Takes weight * 2^-u into the sum. */
static inline sum_t weighted(sum_t sum, int_least32_t weight, uint_least32_t u)
{
#if defined(__ARM_FEATURE_SAT)
    return accumulate(sum, weight, exp2_of_minus(__usat((int_least32_t)u, 29)));
#else
    return (u <= Q31_LAST) ? accumulate(sum, weight, exp2_of_minus(u)) : sum;
#endif
}

/* Takes one Gaussian into the sum. */
static inline sum_t gaussian(sum_t sum, const gtc_word_t *center,
                                          const POINT *in)
{
    const uint_least32_t u = high_of_squares(argument_of(&center[CENTER_TEMP], in->x_temp),
                                                 argument_of(&center[CENTER_SLOPE], in->x_slope));

    return weighted(sum, center[CENTER_WEIGHT].integer, u);
}

#if GTC_WITH_NARROW
/* The same for all centers of a table with narrow widths, whose arguments have fewer fraction bits: squares are in
 * units 2^narrow times larger. */
static sum_t narrow_sum(sum_t start, const gtc_word_t *centers, const gtc_word_t *end,
                     uint_least32_t x_temp, uint_least32_t x_slope, uint_least32_t narrow)
{
    sum_t sum = start;
    const gtc_word_t *center;

    for (center = centers; center != end; center = &center[GTC_CENTER_WORDS]) {
        const int_least64_t a = argument_of(&center[CENTER_TEMP], x_temp);
        const int_least64_t b = argument_of(&center[CENTER_SLOPE], x_slope);
        const int_least64_t p = a * a;
        const int_least64_t q = b * b;
        const uint_least64_t u = ((uint_least64_t)p + (uint_least64_t)q) >> (32U - narrow);

        if (u <= Q31_LAST) {
            sum = accumulate(sum, center[CENTER_WEIGHT].integer, exp2_of_minus((uint_least32_t)u));
        }
    }
    return sum;
}
#endif

/* One network: w0 + linear part + its Gaussians. */
static inline int_least32_t network_value(const TABLE *table, const gtc_word_t *network,
                                      const gtc_word_t *centers, const POINT *in)
{
    const gtc_word_t *center = centers;
    const gtc_word_t *const end = &centers[network[NETWORK_CENTERS].bits * GTC_CENTER_WORDS];
    sum_t sum = begun(network[NETWORK_CONSTANT].integer);
    gtc_word_t bias;

    sum = accumulate(sum, network[NETWORK_TEMP].integer, (int_least32_t)(in->x_temp << 13));
    sum = accumulate(sum, network[NETWORK_SLOPE].integer, (int_least32_t)(in->x_slope << 13));
#if GTC_WITH_NARROW
    if (table->scale[SCALE_NARROW] != 0) {
        sum = narrow_sum(sum, center, end, in->x_temp, in->x_slope, (uint_least32_t)table->scale[SCALE_NARROW]);
        center = end;
    }
#else
    (void)table;
#endif
    while (center != end) {
        sum = gaussian(sum, center, in);
        center = &center[GTC_CENTER_WORDS];
    }
    bias.bits = ended(sum, network);
    return bias.integer;
}

/* num / den, rounded to nearest, halves away from zero; den > 0. */
static inline int_least64_t rounded_quotient(int_least64_t num, uint_least32_t den)
{
    const uint_least64_t magnitude = (num < 0) ? (uint_least64_t)(-num) : (uint_least64_t)num;
    const uint_least64_t q = (magnitude + (den / 2U)) / den;

    return (num < 0) ? -(int_least64_t)q : (int_least64_t)q;
}

#if GTC_WITH_BANK
/* ---- the bank of networks --------------------------------------------------------------- */

#define FULL_SHARE 0x1000000 /* 1 in 2^-24 */
#define IN_TEMP(in) ((int_least32_t)(in)->x_temp)
#define IN_SLOPE(in) ((int_least32_t)(in)->x_slope)

/* Sum of shares times results, and of shares. */
typedef struct {
    int_least64_t total;
    uint_least32_t share;
} q31_blend_t;

/* Regions are in positions; so are the edges of the envelope. */
static inline void get_edges(const TABLE *table, int_least32_t edges[4])
{
    (void)table;
    edges[0] = 0;
    edges[1] = 65535;
    edges[2] = 0;
    edges[3] = 65535;
}

static inline int_least32_t lesser(int_least32_t a, int_least32_t b)
{
    return (a < b) ? a : b;
}

/* Where x is on the way between two different positions, in 2^-24; 0 before `from`, 1 behind `to`. */
static inline int_least32_t fraction(int_least32_t from, int_least32_t x, int_least32_t to)
{
    int_least32_t way = x - from;
    int_least32_t whole = to - from;

    if (whole < 0) {
        way = -way;
        whole = -whole;
    }
    if (way >= whole) {
        return FULL_SHARE; /* no share is larger, and a narrow region's would not fit */
    }
    return (way > 0) ? (int_least32_t)(((int_least64_t)way * FULL_SHARE) / whole) : 0;
}

static inline void mix(BLEND *blend, int_least32_t share, int_least32_t bias)
{
    blend->total += (int_least64_t)share * bias;
    blend->share += (uint_least32_t)share;
}

static inline int_least32_t unmixed(const BLEND *blend, int_least32_t otherwise)
{
    return (blend->share != 0U) ? (int_least32_t)rounded_quotient(blend->total, blend->share) : otherwise;
}
#endif

/* ---- the front end ---------------------------------------------------------------------- */

/* max_step + max_rate * time, or the largest number */
static inline uint_least32_t largest_change(const gtc_word_t *guard, uint_least32_t us)
{
    const uint_least64_t limit = guard[GUARD_STEP].bits + (((uint_least64_t)guard[GUARD_RATE].bits * us) >> 24);

    return (limit < 0xFFFFFFFFU) ? (uint_least32_t)limit : 0xFFFFFFFFU;
}

/* |a - b| <= limit */
static inline int is_near(int_least32_t a, int_least32_t b, uint_least32_t limit)
{
    const uint_least32_t up = ((uint_least32_t)a - (uint_least32_t)b) & 0xFFFFFFFFU;
    const uint_least32_t distance = (a < b) ? ((0U - up) & 0xFFFFFFFFU) : up;

    return (distance <= limit) ? 1 : 0;
}

static inline int_least64_t add(int_least64_t sum, int_least64_t d)
{
    return sum + d;
}

static inline int_least64_t diff(int_least64_t a, int_least64_t b)
{
    return a - b;
}

static inline int_least64_t scaled(uint_least32_t k, int_least64_t x)
{
    return (int_least64_t)k * x;
}

/* base + sum / n */
static inline int_least32_t mean_of(int_least32_t base, int_least64_t sum, uint_least32_t n)
{
    const int_least64_t mean = base + rounded_quotient(sum, n);

    GTC_ASSERT(IS_32_BITS(mean));
    return (int_least32_t)mean;
}

/* The nearest number of 32 bits, the mark of a missing one left out. */
static inline int_least32_t narrowed(int_least64_t x)
{
    int_least32_t ignored = GTC_OK;

    return saturate(x, -2147483647, 2147483647, &ignored);
}

/* Where a temperature is after so many blocks. */
static inline int_least32_t ahead(int_least32_t temp, int_least32_t slope, uint_least32_t blocks)
{
    return narrowed(temp + ((int_least64_t)slope * (int_least64_t)blocks));
}

/* ---- terms and uncertainty ------------------------------------------------------------- */

#if GTC_WITH_TERMS || GTC_WITH_UNCERTAINTY
/* floor(x / 2^n) */
static inline int_least64_t floored(int_least64_t x, uint_least32_t n)
{
    const int_least64_t magnitude = (x >= 0) ? x : (-1 - x);
    const uint_least64_t whole = (uint_least64_t)magnitude >> n;

    return (x >= 0) ? (int_least64_t)whole : (-1 - (int_least64_t)whole);
}
#endif

#if GTC_WITH_UNCERTAINTY || GTC_WITH_PLAY || GTC_WITH_CURVE || GTC_WITH_PRODUCT
/* A factor: the nearest number of magnitude 2^30 at most, so that products of two keep to 63 bits with room for a
 * sum. */
static inline int_least64_t limit_factor(int_least64_t x)
{
    int_least32_t ignored = GTC_OK;

    return saturate(x, -1073741824, 1073741824, &ignored);
}
#endif

#if GTC_WITH_UNCERTAINTY || GTC_WITH_RETAINED || GTC_WITH_CHANNELS
/* factor (a - b), factor in units of the bias for each C */
static inline int_least64_t scaled_difference(int_least32_t a, int_least32_t b, int_least32_t factor)
{
    return floored(((int_least64_t)a - b) * factor, 16U);
}
#endif

#if GTC_WITH_TERMS
static inline int_least32_t parameter(const TABLE *table, uint_least32_t term, uint_least32_t k)
{
    return table->terms[(term * GTC_TERM_WORDS) + TERM_PARAMETERS + k].integer;
}
#endif

#if GTC_WITH_MEMORY
/* First-order memory: z in 2^-16 C, and its fraction in 2^-32 C. */
static inline void settle_memory(int_least32_t z[2], int_least32_t x)
{
    z[0] = x;
    z[1] = 0;
}

/* z + gain (x - z), gain in 2^-31 */
static inline void follow_memory(int_least32_t z[2], int_least32_t x, int_least32_t gain)
{
    int_least64_t fine = ((int_least64_t)z[0] * 65536) + z[1];
    const int_least64_t d = ((int_least64_t)x * 65536) - fine;

    fine += floored(floored(d, 10U) * gain, 21U);
    z[0] = (int_least32_t)floored(fine, 16U);
    z[1] = (int_least32_t)(fine - ((int_least64_t)z[0] * 65536));
}

/* Share of a difference that is gone after so many blocks, each of which takes the share `gain` of what is left. */
static inline int_least32_t relaxed_share(int_least32_t gain, uint_least32_t blocks)
{
    uint_least32_t factor = 0x7FFFFFFFU - (uint_least32_t)gain;
    uint_least32_t left = 0x7FFFFFFFU;
    uint_least32_t rest;

    for (rest = blocks; rest != 0U; rest >>= 1) {
        if ((rest & 1U) != 0U) {
            left = (uint_least32_t)(((uint_least64_t)left * factor) >> 31);
        }
        factor = (uint_least32_t)(((uint_least64_t)factor * factor) >> 31);
    }
    return 0x7FFFFFFF - (int_least32_t)left;
}

/* rate (a - b), a slope; rate in 2^-24 */
static inline int_least32_t slope_of(int_least32_t a, int_least32_t b, int_least32_t rate)
{
    return narrowed(floored(((int_least64_t)a - b) * rate, 24U));
}
#endif

#if GTC_WITH_WARM_UP
/* amplitude * exp(-blocks * gain), gain in 2^-28 of a factor 1/2 */
static inline int_least64_t warm_up_value(uint_least32_t blocks, int_least32_t gain, int_least32_t amplitude)
{
    const uint_least64_t u = ((uint_least64_t)blocks * (uint_least32_t)gain) >> 4;

    if (u > Q31_LAST) {
        return 0;
    }
    return floored((int_least64_t)amplitude * exp2_of_minus((uint_least32_t)u), 29U);
}
#endif

#if GTC_WITH_HARMONIC
/* amplitude * cos(2 pi (x * frequency + phase)); frequency in 2^-32 turns for each C, phase in 2^-32. */
static inline int_least64_t harmonic_value(int_least32_t x, int_least32_t frequency, int_least32_t phase,
                                     int_least32_t amplitude)
{
    const int_least64_t turns = floored((int_least64_t)x * frequency, 16U) + phase;
    const uint_least32_t part = (uint_least32_t)((uint_least64_t)turns & 0xFFFFFFFFU);
    /* A quarter turn less the distance from the nearest whole turn. */
    const uint_least32_t back = (0U - part) & 0xFFFFFFFFU;
    const int_least64_t t = 1073741824 - (int_least64_t)((part > 0x80000000U) ? back : part);
    const int_least64_t s = floored(t * t, 30U);
    int_least64_t h = 161942;

    h = floored(h * s, 30U) - 5016767;
    h = floored(h * s, 30U) + 85564854;
    h = floored(h * s, 30U) - 693597876;
    h = floored(h * s, 30U) + 1686629674;
    h = floored(h * t, 30U);
    return floored(amplitude * h, 30U);
}
#endif

#if GTC_WITH_CURVE
/* Takes weight * 2^-((x - center) gain)^2 into the sum; bell: center, weight. gain in 2^-24 for each unit of x;
 * |x| <= 2^30, |center| < 2^30, gain >= 0. From 6 on it is 0, as the square is then 36 octaves. */
static inline sum_t gaussian_of_channel(sum_t sum, int_least32_t x, int_least32_t gain, const gtc_word_t *bell)
{
    const int_least32_t d = x - bell[0].integer;
    const int_least64_t product = (int_least64_t)d * gain;
    const uint_least64_t way = (uint_least64_t)product;
    const uint_least32_t whole = (uint_least32_t)(way >> 32);
    gtc_word_t argument; /* in 2^-28 */

    GTC_ASSERT((d >= -2147483647) && (gain >= 0));
    if (((whole + 0x600U) & 0xFFFFFFFFU) >= 0xC00U) {
        return sum;
    }
    argument.bits = ((whole << 20) & 0xFFFFFFFFU) | ((uint_least32_t)(way & 0xFFFFFFFFU) >> 12);
    return weighted(sum, bell[1].integer, high_of_squares(argument.integer, 0));
}

/* Two of one gain: gain; center, weight; center, weight. |weight| <= 2^29 */
static inline int_least64_t gaussians_of_channel(int_least32_t x, const gtc_word_t *bells)
{
    sum_t sum = begun(0);
    gtc_word_t total;

    sum = gaussian_of_channel(sum, x, bells[0].integer, &bells[1]);
    sum = gaussian_of_channel(sum, x, bells[0].integer, &bells[3]);
    total.bits = units(sum);
    return total.integer;
}
#endif

/* ---- the uncertainty -------------------------------------------------------------------- */

#if GTC_WITH_UNCERTAINTY
#define NO_SQUARE 0U

static inline uint_least64_t squared(int_least64_t x)
{
    const int_least64_t y = limit_factor(x);
    const int_least64_t square = y * y;

    return (uint_least64_t)square;
}

/* All ones where the sum carries beyond 64 bits. */
static inline uint_least64_t add_squares(uint_least64_t a, uint_least64_t b)
{
    const uint_least64_t sum = a + b;
    const uint_least64_t carry = ((a & b) | ((a | b) & ~sum)) >> 63;

    return sum | ((uint_least64_t)0U - carry);
}

/* Every number of a state has a square */
static inline uint_least64_t square_or(uint_least64_t square, uint_least64_t other)
{
    (void)other;
    return square;
}

/* Square root, rounded down; 2^31 - 1 at most. */
static inline int_least32_t square_root(uint_least64_t x)
{
    uint_least64_t rest = x;
    uint_least64_t root = 0U;
    uint_least64_t bit = (uint_least64_t)1U << 62;

    while (bit != 0U) {
        if (rest >= (root + bit)) {
            rest -= root + bit;
            root = (root >> 1) + bit;
        } else {
            root >>= 1;
        }
        bit >>= 2;
    }
    return (root > 0x7FFFFFFFU) ? 0x7FFFFFFF : (int_least32_t)root;
}
#endif

#if GTC_WITH_REZERO
/* square / n */
static inline uint_least64_t divide_square(uint_least64_t square, uint_least32_t n)
{
    return square / n;
}

/* a / (a + b), 0 where both are */
static inline uint_least64_t share_of(uint_least64_t a, uint_least64_t b)
{
    uint_least64_t part = a;
    uint_least64_t whole = a + b;

    while (whole > 0xFFFFFFFFU) {
        part >>= 1;
        whole >>= 1;
    }
    if (whole == 0U) {
        return 0U;
    }
    part = (part << 31) / whole;
    return (part > 0x80000000U) ? 0x80000000U : part;
}

static inline int_least64_t share_of_number(uint_least64_t share, int_least32_t x)
{
    return floored((int_least64_t)share * x, 31U);
}

static inline uint_least64_t part_of_square(uint_least64_t share, uint_least64_t x)
{
    return ((x >> 31) * share) + (((x & 0x7FFFFFFFU) * share) >> 31);
}
#endif

#if GTC_WITH_UNCERTAINTY && GTC_WITH_MEMORY
/* word (1 - gain)^blocks */
static inline int_least64_t remaining(int_least32_t word, int_least32_t gain, uint_least32_t blocks)
{
    const int_least32_t left = 0x7FFFFFFF - relaxed_share(gain, blocks);

    return floored((int_least64_t)word * left, 31U);
}
#endif

#if GTC_WITH_UNCERTAINTY && GTC_WITH_PLAY
/* word (2 width - (high - low)), 0 where that is negative */
static inline int_least64_t unsettled(int_least32_t width, int_least32_t low, int_least32_t high, int_least32_t word)
{
    const int_least64_t left = (2 * (int_least64_t)width) - ((int_least64_t)high - low);

    return (left > 0) ? floored(limit_factor(left) * word, 16U) : 0;
}
#endif

#endif /* GTC_NUM_Q31_H_INCLUDED */
