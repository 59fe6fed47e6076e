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

/* MISRA 20.10: one text gives its names to both arithmetics. */
#define FN(name) gtc_f32_##name

#define TABLE gtc_f32_table_t
#define STATE gtc_f32_state_t
#define EFFECT gtc_f32_effect_t
#define INPUT gtc_f32_input_t
#define CODE struct gtc_f32_term_code
#define NUM float
#define WIDE float
#define NUM_ZERO 0.0F
#define NUM_MOST 0x1.fffffep+127F /* the largest number */
#define LIMIT_ZERO 0.0F
#define NUM_PLAUSIBLE_MIN (-90.0F) /* C */
#define NUM_PLAUSIBLE_MAX 200.0F
#define NUM_MISSING_BITS 0x7FC00000UL /* no finite number has these */
#define ARITHMETIC 1U /* in the second word of an image */
#define SCALE_TEMP 1U
#define SCALE_SLOPE 2U


/* A table member as a number and as the word of an image; an array element as a number. */
#define MEMBER(member) ((member).value)
#define ELEMENT(word) ((word).value)

#include "gtc_saturate.inl"

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

static inline float FN(missing)(void)
{
    gtc_word_t word;

    word.bits = NUM_MISSING_BITS;
    return word.value;
}

/* ---- the map ---------------------------------------------------------------------------- */

/* With H and G: ((f - H)^2 + G) c = 2^(-f/64) (1 + 6.7e-9), |f| <= 1/2. The table holds the bits of
 * c 2^(-i/64), and i in the bits from which i is subtracted again with the exponent. */
#define F32_H 0x1.71549ep+6F
#define F32_G 0x1.0a69ccp+13F
extern const uint_least32_t FN(exp2_table)[64];

/* 1.5 * 2^23: what is added to it is rounded to an integer, which then stands in the low bits. */
#define F32_ROUND 12582912.0F
#define F32_ROUND_BITS 0x4B400000U
#define F32_CUT 2048U

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

/* Where the inputs lie. Returns GTC_OK, GTC_CLAMPED or, for a missing one, GTC_E_ARG: then at some legal place. */
static inline int FN(locate)(const TABLE *table, float temp, float slope, POINT *in)
{
    const gtc_word_t *const edge = table->envelope;
    int_least32_t remarks = GTC_OK;
    float z;

    if (FN(is_missing)(temp) || FN(is_missing)(slope)) {
        in->temp = 0.0F;
        in->slope = 0.0F;
        in->z_temp = 0.0F;
        in->z_slope = 0.0F;
        return GTC_E_ARG;
    }
    in->temp = FN(saturate)(temp, edge[ENVELOPE_TEMP].value, edge[ENVELOPE_TEMP + 1U].value, &remarks);
    in->slope = FN(saturate)(slope, edge[ENVELOPE_SLOPE].value, edge[ENVELOPE_SLOPE + 1U].value, &remarks);
    z = in->temp - table->scale[SCALE_CENTER].value;
    z = z * table->scale[SCALE_TEMP].value;
    in->z_temp = FN(on_grid)(z);
    z = in->slope * table->scale[SCALE_SLOPE].value;
    in->z_slope = FN(on_grid)(z);
    return (int)remarks;
}

/* 2^(-u/64), u >= 0; 0 from 2048 on, and where u is not a number. */
GTC_IN_LOOP float FN(exp2)(float u)
{
    gtc_word_t whole;
    gtc_word_t e;
    float f;

    whole.value = u + F32_ROUND;
    if (whole.bits >= (F32_ROUND_BITS + F32_CUT)) {
        return 0.0F;
    }
    e.bits = FN(exp2_table)[whole.bits & 63U] - ((whole.bits << 17) & 0xFFFFFFFFU);
    f = whole.value - F32_ROUND;
    f = u - f;
    f = f - F32_H;
    f = f * f;
    f = f + F32_G;
    f = e.value * f;
    return f;
}

/* acc + weight * 2^(-u/64), u of the center's record. */
GTC_IN_LOOP float FN(gaussian)(float acc, const gtc_word_t *center, const POINT *in)
{
    float u;
    float f;

    u = in->z_temp - center[CENTER_TEMP].value;
    u = u * center[CENTER_TEMP_GAIN].value;
    u = u * u;
    f = in->z_slope - center[CENTER_SLOPE].value;
    f = f * center[CENTER_SLOPE_GAIN].value;
    f = f * f;
    u = u + f;
    f = FN(exp2)(u);
    f = center[CENTER_WEIGHT].value * f;
    f = acc + f;
    return f;
}

/* One network: w0 + linear part + its Gaussians. In the loop, so that a fallback model costs the map no call. */
GTC_IN_LOOP float FN(network)(const TABLE *table, const gtc_word_t *network,
                              const gtc_word_t *centers, const POINT *in)
{
    const gtc_word_t *center = centers;
    const gtc_word_t *const end = &centers[network[NETWORK_CENTERS].bits * GTC_CENTER_WORDS];
    float acc = network[NETWORK_CONSTANT].value;
    float term;

    (void)table;
    term = network[NETWORK_TEMP].value * in->z_temp;
    acc = acc + term;
    term = network[NETWORK_SLOPE].value * in->z_slope;
    acc = acc + term;
#if GTC_UNROLL
    if ((network[NETWORK_CENTERS].bits & 1U) != 0U) {
        acc = FN(gaussian)(acc, center, in);
        center = &center[GTC_CENTER_WORDS];
    }
#endif
    while (center != end) {
        acc = FN(gaussian)(acc, center, in);
        center = &center[GTC_CENTER_WORDS];
#if GTC_UNROLL
        acc = FN(gaussian)(acc, center, in);
        center = &center[GTC_CENTER_WORDS];
#endif
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
    cell[0] = FN(cell)(in->temp, &table->envelope[ENVELOPE_TEMP], n[0]);
    cell[1] = FN(cell)(in->slope, &table->envelope[ENVELOPE_SLOPE], n[1]);
}

/* ---- the bank of networks --------------------------------------------------------------- */

#if GTC_WITH_BANK
#define SHARE float
#define FULL_SHARE 1.0F
#define IN_TEMP(in) ((in)->temp)
#define IN_SLOPE(in) ((in)->slope)

/* Sum of shares times results, and of shares. */
typedef struct {
    float total;
    float share;
} FN(blend_t);
#define BLEND FN(blend_t)

/* Result of a table with several networks. */
float FN(blend)(const TABLE *table, const POINT *in);

static inline void FN(edges)(const TABLE *table, float edges[4])
{
    const volatile gtc_word_t *const envelope = table->envelope; /* no memcpy() */
    uint_least32_t i;

    for (i = 0U; i < 4U; i++) {
        edges[i] = envelope[i].value;
    }
}

static inline float FN(lesser)(float a, float b)
{
    return (a < b) ? a : b;
}

/* Where x is on the way between two different numbers; 0 before `from`. */
static inline float FN(fraction)(float from, float x, float to)
{
    float way;
    float whole;

    way = x - from;
    whole = to - from;
    way = way / whole;
    return (way > 0.0F) ? way : 0.0F;
}

static inline void FN(mix)(BLEND *blend, float share, float bias)
{
    float product;

    product = share * bias;
    blend->total = blend->total + product;
    blend->share = blend->share + share;
}

static inline float FN(unmixed)(const BLEND *blend, float otherwise)
{
    float bias = otherwise;

    if (blend->share > 0.0F) {
        bias = blend->total / blend->share;
    }
    return bias;
}
#endif

/* ---- the front end ---------------------------------------------------------------------- */

/* max_step + max_rate * time */
static inline float FN(limit)(const gtc_word_t *guard, uint_least32_t us)
{
    const float time = (float)us;
    float limit;

    limit = guard[GUARD_RATE].value * time;
    limit = guard[GUARD_STEP].value + limit;
    return limit;
}

/* |a - b| <= limit */
static inline int FN(is_near)(float a, float b, float limit)
{
    float distance;

    distance = a - b;
    if (distance < 0.0F) {
        distance = -distance;
    }
    return (distance <= limit) ? 1 : 0;
}

/* Where a temperature is after so many blocks. */
static inline float FN(ahead)(float temp, float slope, uint_least32_t blocks)
{
    const float n = (float)blocks;
    float way;

    way = slope * n;
    way = temp + way;
    return way;
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

/* ---- the terms -------------------------------------------------------------------------- */

static inline float FN(parameter)(const STATE *state, uint_least32_t term, uint_least32_t k)
{
    return state->table->terms[(term * GTC_TERM_WORDS) + TERM_PARAMETERS + k].value;
}

/* First-order memory: z, and the number kept for more digits (here none). */
static inline void FN(settle)(float z[2], float x)
{
    z[0] = x;
    z[1] = 0.0F;
}

/* z + gain (x - z) */
static inline void FN(follow)(float z[2], float x, float gain)
{
    float d;

    d = x - z[0];
    d = gain * d;
    z[0] = z[0] + d;
}

/* What is left of a difference after so many blocks, each of which takes the share `gain`. */
static inline float FN(power)(float gain, uint_least32_t blocks)
{
    uint_least32_t rest = blocks;
    float factor;
    float left = 1.0F;

    factor = 1.0F - gain;
    while (rest != 0U) {
        if ((rest & 1U) != 0U) {
            left = left * factor;
        }
        factor = factor * factor;
        rest >>= 1;
        if (left <= 0x1p-30F) {
            rest = 0U;
        }
    }
    left = 1.0F - left;
    return left;
}

/* factor (a - b) */
static inline float FN(scaled_difference)(float a, float b, float factor)
{
    float d;

    d = a - b;
    d = factor * d;
    return d;
}

/* rate (a - b), a slope. */
static inline float FN(slope_of)(float a, float b, float rate)
{
    return FN(scaled_difference)(a, b, rate);
}

/* amplitude * cos(2 pi (x * frequency + phase)): the phase in turns, reduced to its fraction. */
static inline float FN(wave)(float x, float frequency, float phase, float amplitude)
{
    float turns;
    float whole;
    float t;
    float s;
    float h;

    turns = x * frequency;
    turns = turns + phase;
    whole = turns + F32_ROUND;
    whole = whole - F32_ROUND;
    t = turns - whole;
    if (t < 0.0F) {
        t = -t;
    }
    t = 4.0F * t;
    t = 1.0F - t;
    /* sin(pi/2 t) = cos(2 pi turns), 3.4e-9 */
    s = t * t;
    h = 0x1.3c4b2cp-13F * s;
    h = h - 0x1.3232fap-8F;
    h = h * s;
    h = h + 0x1.46676ep-4F;
    h = h * s;
    h = h - 0x1.4abbb6p-1F;
    h = h * s;
    h = h + 0x1.921fb4p+0F;
    h = h * t;
    h = amplitude * h;
    return h;
}

/* amplitude * exp(-blocks * gain) */
static inline float FN(fading)(uint_least32_t blocks, float gain, float amplitude)
{
    const float n = (float)blocks;
    float value;

    value = n * gain;
    value = FN(exp2)(value);
    value = amplitude * value;
    return value;
}

/* weight * 2^(-((x - center) gain)^2 / 64); bell: center, weight */
GTC_IN_LOOP float FN(gaussian_of_channel)(float x, float gain, const gtc_word_t *bell)
{
    float u;

    u = x - bell[0].value;
    u = u * gain;
    u = u * u;
    u = FN(exp2)(u);
    u = bell[1].value * u;
    return u;
}

/* Two of one gain: gain; center, weight; center, weight. */
static inline float FN(gaussians_of_channel)(float x, const gtc_word_t *bells)
{
    const float first = FN(gaussian_of_channel)(x, bells[0].value, &bells[1]);
    float sum;

    sum = FN(gaussian_of_channel)(x, bells[0].value, &bells[3]);
    sum = first + sum;
    return sum;
}

/* ---- the uncertainty -------------------------------------------------------------------- */

#define SNAPSHOT gtc_f32_snapshot_t
#define SQUARE float /* (deg/h)^2 */
#define NO_SQUARE 0.0F

/* A factor: every number is one. */
static inline float FN(factor)(float x)
{
    return x;
}

static inline float FN(squared)(float x)
{
    float square;

    square = x * x;
    return square;
}

static inline float FN(plus)(float a, float b)
{
    return FN(add)(a, b);
}

/* A square, or what stands for it where a state was overwritten so that it is none; the sum of two is one */
static inline float FN(square_or)(float square, float other)
{
    return ((square >= 0.0F) && (square <= 1.0e38F)) ? square : other;
}

/* square / n */
static inline float FN(shared_out)(float square, uint_least32_t n)
{
    const float count = (float)n;
    float share;

    share = square / count;
    return share;
}

/* a / (a + b), 0 where both are */
static inline float FN(share_of)(float a, float b)
{
    float whole;

    whole = a + b;
    if (!(whole > 0.0F)) {
        return 0.0F;
    }
    whole = a / whole;
    return (whole < 1.0F) ? whole : 1.0F;
}

static inline float FN(part)(float share, float x)
{
    float product;

    product = share * x;
    return product;
}

static inline float FN(part_of_square)(float share, float x)
{
    return FN(part)(share, x);
}

/* Square root, 0.6 units of the last place: half the exponent, then Newton's rule. x >= 0 */
static inline float FN(root)(float x)
{
    gtc_word_t guess;
    float y;
    uint_least32_t i;

    if (!(x > 0.0F)) {
        return 0.0F;
    }
    guess.value = x;
    guess.bits = (guess.bits >> 1) + 0x1FBB4F2EUL;
    y = guess.value;
    for (i = 0U; i < 4U; i++) {
        float quotient;

        quotient = x / y;
        quotient = y + quotient;
        y = 0.5F * quotient;
    }
    return y;
}

/* word (1 - gain)^blocks */
static inline float FN(remaining)(float word, float gain, uint_least32_t blocks)
{
    float left;

    left = FN(power)(gain, blocks);
    left = 1.0F - left;
    left = word * left;
    return left;
}

/* word (2 width - (high - low)), 0 where that is negative; no number where low or high is none */
static inline float FN(unsettled)(float width, float low, float high, float word)
{
    float range;
    float left;

    range = high - low;
    left = width + width;
    left = left - range;
    left = word * left;
    return (left <= 0.0F) ? 0.0F : left;
}

#endif /* GTC_NUM_F32_H_INCLUDED */
