/* gtc_num_f32.h - the numbers of the float32 runtime: types, names and primitives.
 *
 * The algorithm (gtc_map.inl, gtc_front.inl, ...) is written once in the names below; a second
 * header, gtc_num_q31.h, gives the same names in fixed point.
 *
 * Every IEEE operation is a statement of its own, assigned to a float. An assignment rounds to
 * float whatever FLT_EVAL_METHOD is, and a strict compiler contracts nothing across statements;
 * so the same bits come out on every target. gtc_f32_check() proves it on the target.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_NUM_F32_H_INCLUDED
#define GTC_NUM_F32_H_INCLUDED

#include "gtc_private.h"

#if defined(__FAST_MATH__)
#error "the float32 runtime needs IEEE arithmetic: compile without -ffast-math"
#endif

#define FN(name) gtc_f32_##name
#define TABLE gtc_f32_table_t
#define STATE gtc_f32_state_t
#define NUM float
#define WIDE float
#define NUM_ZERO 0.0F
#define NUM_PLAUSIBLE_MIN (-90.0F) /* C */
#define NUM_PLAUSIBLE_MAX 200.0F
#define NUM_MISSING_BITS 0x7FC00000UL /* no finite number has these */
#define ARITHMETIC 1U /* in the second word of an image */


/* A table member as a number and as the word of an image; an array element as a number. */
#define MEMBER(member) ((member).value)
#define MEMBER_BITS(member) ((member).bits)
#define ELEMENT(word) ((word).value)

static inline uint_least32_t FN(bits)(float x)
{
    gtc_word_t word;

    word.value = x;
    return word.bits & 0xFFFFFFFFUL;
}

/* NaN or infinite, found by its exponent, so that no compiler option can argue it away. */
static inline int FN(is_missing)(float x)
{
    return ((FN(bits)(x) & 0x7F800000UL) == 0x7F800000UL) ? 1 : 0;
}

/* ---- the map ---------------------------------------------------------------------------- */

/* 2^(-i/64) */
static const uint_least32_t FN(exp2_table)[64] = {
    0x3F800000UL, 0x3F7D3E0CUL, 0x3F7A83B3UL, 0x3F77D0DFUL, 0x3F75257DUL, 0x3F728177UL,
    0x3F6FE4BAUL, 0x3F6D4F30UL, 0x3F6AC0C7UL, 0x3F68396AUL, 0x3F65B907UL, 0x3F633F89UL,
    0x3F60CCDFUL, 0x3F5E60F5UL, 0x3F5BFBB8UL, 0x3F599D16UL, 0x3F5744FDUL, 0x3F54F35BUL,
    0x3F52A81EUL, 0x3F506334UL, 0x3F4E248CUL, 0x3F4BEC15UL, 0x3F49B9BEUL, 0x3F478D75UL,
    0x3F45672AUL, 0x3F4346CDUL, 0x3F412C4DUL, 0x3F3F179AUL, 0x3F3D08A4UL, 0x3F3AFF5BUL,
    0x3F38FBAFUL, 0x3F36FD92UL, 0x3F3504F3UL, 0x3F3311C4UL, 0x3F3123F6UL, 0x3F2F3B79UL,
    0x3F2D583FUL, 0x3F2B7A3AUL, 0x3F29A15BUL, 0x3F27CD94UL, 0x3F25FED7UL, 0x3F243516UL,
    0x3F227043UL, 0x3F20B051UL, 0x3F1EF532UL, 0x3F1D3EDAUL, 0x3F1B8D3AUL, 0x3F19E046UL,
    0x3F1837F0UL, 0x3F16942DUL, 0x3F14F4F0UL, 0x3F135A2BUL, 0x3F11C3D3UL, 0x3F1031DCUL,
    0x3F0EA43AUL, 0x3F0D1ADFUL, 0x3F0B95C2UL, 0x3F0A14D5UL, 0x3F08980FUL, 0x3F071F62UL,
    0x3F05AAC3UL, 0x3F043A29UL, 0x3F02CD87UL, 0x3F0164D2UL
};

/* 2^(-f/64) = 1 - f (P1 - f P2) + 8.4e-9, 0 <= f < 1 */
#define F32_P1 0x1.62e36cp-7F
#define F32_P2 0x1.e98446p-15F

/* 2^(-u/64); 0 for u >= 2048, where the result would be below 2^-32. */
static inline float FN(gauss)(float u)
{
    gtc_word_t e;
    int_least32_t n;
    float f;
    float h;

    if (!(u < 2048.0F)) {
        return 0.0F;
    }
    n = (int_least32_t)u;
    f = (float)n;
    f = u - f;
    h = f * F32_P2;
    h = F32_P1 - h;
    h = f * h;
    h = 1.0F - h;
    e.bits = FN(exp2_table)[(uint_least32_t)n & 63U] - (((uint_least32_t)n >> 6) << 23);
    e.value = e.value * h;
    return e.value;
}

/* Moves x into a range; returns GTC_OK or GTC_CLAMPED. */
static inline int FN(clamp)(float *x, const gtc_word_t range[2])
{
    int status = GTC_CLAMPED;

    if (*x < range[0].value) {
        *x = range[0].value;
    } else if (*x > range[1].value) {
        *x = range[1].value;
    } else {
        status = GTC_OK;
    }
    return status;
}

/* The inputs of a network, as they are and normalised. */
typedef struct {
    float temp;
    float slope;
    float z_temp;
    float z_slope;
} FN(point_t);
#define POINT FN(point_t)

/* Adding and subtracting 8 leaves a multiple of 2^-21; every center is one of 2^-20, so that
 * differences from centers are exact. */
static inline float FN(on_grid)(float z)
{
    float shifted;

    shifted = z + 8.0F;
    shifted = shifted - 8.0F;
    return shifted;
}

/* Where the inputs lie. Returns GTC_OK, GTC_CLAMPED or GTC_E_ARG. */
static inline int FN(locate)(const TABLE *table, float temp, float slope, POINT *in)
{
    int status;
    float z;

    if (FN(is_missing)(temp) || FN(is_missing)(slope)) {
        return GTC_E_ARG;
    }
    status = FN(clamp)(&temp, &table->envelope[0]) | FN(clamp)(&slope, &table->envelope[2]);
    in->temp = temp;
    in->slope = slope;
    z = temp - table->scale[0].value;
    z = z * table->scale[1].value;
    in->z_temp = FN(on_grid)(z);
    z = slope * table->scale[2].value;
    in->z_slope = FN(on_grid)(z);
    return status;
}

/* One network: w0 + linear part + its Gaussians. */
static inline float FN(network)(const TABLE *table, const gtc_word_t *network,
                                const gtc_word_t *center, const POINT *in)
{
    const gtc_word_t *const end = &center[network[0].bits * GTC_CENTER_WORDS];
    float acc = network[1].value;
    float term;

    (void)table;
    term = network[2].value * in->z_temp;
    acc = acc + term;
    term = network[3].value * in->z_slope;
    acc = acc + term;
    for (; center != end; center = &center[GTC_CENTER_WORDS]) {
        float u;
        float q;

        u = in->z_temp - center[0].value;
        u = u * center[1].value;
        u = u * u;
        q = in->z_slope - center[2].value;
        q = q * center[3].value;
        q = q * q;
        u = u + q;
        q = FN(gauss)(u);
        q = center[4].value * q;
        acc = acc + q;
    }
    return acc;
}

/* Cell of `x` among n equal ones over [low, high]; n >= 1. */
static inline uint_least32_t FN(cell)(float x, const gtc_word_t *range, uint_least32_t n)
{
    const float cells = (float)n;
    const uint_least32_t last = n - 1U;
    const float last_edge = (float)last;
    float span;
    float position;

    span = range[1].value - range[0].value;
    if (!(span > 0.0F)) {
        return 0U;
    }
    position = cells / span;
    span = x - range[0].value;
    position = span * position;
    return (position < last_edge) ? (uint_least32_t)position : last;
}

/* Cells of the inputs, T and slope, among n each. */
static inline void FN(cells)(const TABLE *table, const POINT *in, const uint_least32_t n[2],
                             uint_least32_t cell[2])
{
    cell[0] = FN(cell)(in->temp, &table->envelope[0], n[0]);
    cell[1] = FN(cell)(in->slope, &table->envelope[2], n[1]);
}

/* ---- the front end ---------------------------------------------------------------------- */

static inline float FN(step_per_sample)(const TABLE *table, uint_least32_t samples_per_block)
{
    const float n = (float)samples_per_block;
    float step;

    step = table->max_slope.value / n;
    return step;
}

/* |a - b| <= max_step + samples * step_per_sample */
static inline int FN(is_near)(const STATE *state, float a, float b, uint_least32_t samples)
{
    const float n = (float)samples;
    float limit;
    float distance;

    limit = n * state->step_per_sample;
    limit = state->table->max_step.value + limit;
    distance = a - b;
    if (distance < 0.0F) {
        distance = -distance;
    }
    return (distance <= limit) ? 1 : 0;
}

static inline float FN(add)(float sum, float d)
{
    float next;

    next = sum + d;
    return next;
}

static inline float FN(diff)(float a, float b)
{
    float d;

    d = a - b;
    return d;
}

static inline float FN(scaled)(uint_least32_t k, float x)
{
    const float factor = (float)k;
    float product;

    product = factor * x;
    return product;
}

/* base + sum / n */
static inline float FN(mean)(float base, float sum, uint_least32_t n)
{
    const float count = (float)n;
    float mean;

    mean = sum / count;
    mean = base + mean;
    return mean;
}

/* num / den */
static inline float FN(quotient)(float num, uint_least32_t den)
{
    const float divisor = (float)den;
    float q;

    q = num / divisor;
    return q;
}

#endif /* GTC_NUM_F32_H_INCLUDED */
