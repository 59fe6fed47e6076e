/* gtc_num_f32.h - the numbers of the float32 runtime: types and primitives.
 *
 * In the repository: a second header, gtc_num_q31.h, gives the same names in fixed point.
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
#include "gtc_names_f32.h"

#if defined(__FAST_MATH__)
#error "the float32 runtime needs IEEE arithmetic: compile without -ffast-math"
#endif

#if GTC_WITH_SAVE
#define NUM_MOST 0x1.fffffep+127F /* the largest number */
#endif
#define CHANGE_ZERO 0.0F /* no change between readings is allowed */
#if GTC_WITH_SAVE
#define NUM_COLDEST (-200.0F) /* C: no envelope goes beyond */
#endif
#if GTC_WITH_SAVE || GTC_WITH_MEMORY
#define NUM_HOTTEST 400.0F
#endif
#if GTC_WITH_IMAGE
#define NUM_PLAUSIBLE_MIN (-90.0F) /* C */
#define NUM_PLAUSIBLE_MAX 200.0F
#endif
#define NUM_MISSING_BITS 0x7FC00000UL /* no finite number has these */
#define FRAC_BITS 0U /* no unit but deg/h */
#define ARITHMETIC 1U /* in the second word of an image */

/* Behind the center of an input, in the words of a center: its gain. */
#define CENTER_TEMP_GAIN 1U
#define CENTER_SLOPE_GAIN 3U

/* Parts of a table's scale. */
#define SCALE_CENTER 0U
#define SCALE_TEMP 1U
#define SCALE_SLOPE 2U

#include "gtc_saturate.inl"

static inline uint_least32_t bits_of(float x)
{
    gtc_word_t word;

    word.value = x;
    return word.bits;
}

/* NaN or infinite, found by its exponent, so that no compiler option can argue it away. */
static inline int is_missing(float x)
{
    return ((bits_of(x) & 0x7F800000UL) == 0x7F800000UL) ? 1 : 0;
}

#if GTC_WITH_RETAINED || !GTC_WITH_TIME
static inline float missing_number(void)
{
    gtc_word_t word;

    word.bits = NUM_MISSING_BITS;
    return word.value;
}
#endif

/* ---- the map ---------------------------------------------------------------------------- */

/* 2^(-u/64) for u >= 0. With i the whole number nearest to u, and f = u - i, so that |f| <= 1/2:
 *
 *     2^(-u/64) = 2^(-i/64) 2^(-f/64),    2^(-f/64) = ((f - H)^2 + G) c (1 + 6.7e-9)
 *
 * The table has c 2^(-k/64) for k = i mod 64 as the bits of a float, with k 2^17 added. From these bits i 2^17 is
 * subtracted: its lower six bits take k 2^17 away again, the others lower the exponent by i / 64. */
#define F32_H 0x1.71549ep+6F
#define F32_G 0x1.0a69ccp+13F
/* docs/numerics.md, section 2, says how it is made. */
static const uint_least32_t exp2_table[64] = {
    0x3875FE11UL, 0x387557B6UL, 0x3874B8A9UL, 0x387420D7UL, 0x3873902CUL, 0x38730694UL,
    0x387283FAUL, 0x3872084DUL, 0x38719379UL, 0x3871256BUL, 0x3870BE10UL, 0x38705D57UL,
    0x3870032BUL, 0x386FAF7DUL, 0x386F6239UL, 0x386F1B4EUL, 0x386EDAABUL, 0x386EA03DUL,
    0x386E6BF5UL, 0x386E3DC1UL, 0x386E1590UL, 0x386DF352UL, 0x386DD6F6UL, 0x386DC06CUL,
    0x386DAFA5UL, 0x386DA48FUL, 0x386D9F1CUL, 0x386D9F3CUL, 0x386DA4E0UL, 0x386DAFF7UL,
    0x386DC075UL, 0x386DD648UL, 0x386DF164UL, 0x386E11B8UL, 0x386E3737UL, 0x386E61D3UL,
    0x386E917DUL, 0x386EC628UL, 0x386EFFC5UL, 0x386F3E47UL, 0x386F81A1UL, 0x386FC9C5UL,
    0x387016A6UL, 0x38706837UL, 0x3870BE6BUL, 0x38711935UL, 0x38717889UL, 0x3871DC59UL,
    0x3872449BUL, 0x3872B140UL, 0x3873223EUL, 0x38739789UL, 0x38741113UL, 0x38748ED3UL,
    0x387510BBUL, 0x387596C2UL, 0x387620DAUL, 0x3876AEFAUL, 0x38774116UL, 0x3877D722UL,
    0x38787115UL, 0x38781DC7UL, 0x38776105UL, 0x3876ABCFUL
};

/* 1.5 * 2^23: what is added to it is rounded to an integer, which then stands in the low bits. */
#define F32_ROUND 12582912.0F
#define F32_ROUND_BITS 0x4B400000U
#define F32_CUT 2048U /* from this u on, 2^-32, a Gaussian is 0 */

/* The inputs of a network, as they are and normalised. */
typedef struct {
    float temp;
    float slope;
    float z_temp;
    float z_slope;
} f32_point_t;

/* Adding and subtracting 8 leaves a multiple of 2^-21; every center is one of 2^-20, so that
 * differences from centers are exact. */
static inline float on_grid(float z)
{
    float shifted;

    shifted = z + 8.0F;
    shifted = shifted - 8.0F;
    return shifted;
}

/* Where the inputs lie. Returns GTC_OK, GTC_CLAMPED or, for a missing one, GTC_E_ARG: then at some legal place. */
static inline int locate(const TABLE *table, float temp, float slope, POINT *in)
{
    const gtc_word_t *const edge = table->envelope;
    int_least32_t remarks = GTC_OK;
    float z;

    if (is_missing(temp) || is_missing(slope)) {
        in->temp = 0.0F;
        in->slope = 0.0F;
        in->z_temp = 0.0F;
        in->z_slope = 0.0F;
        return GTC_E_ARG;
    }
    in->temp = saturate(temp, edge[ENVELOPE_TEMP].value, edge[ENVELOPE_TEMP + 1U].value, &remarks);
    in->slope = saturate(slope, edge[ENVELOPE_SLOPE].value, edge[ENVELOPE_SLOPE + 1U].value, &remarks);
    z = in->temp - table->scale[SCALE_CENTER].value;
    z = z * table->scale[SCALE_TEMP].value;
    in->z_temp = on_grid(z);
    z = in->slope * table->scale[SCALE_SLOPE].value;
    in->z_slope = on_grid(z);
    return (int)remarks;
}

/* 2^(-u/64), u >= 0; 0 from F32_CUT on, and where u is not a number. */
static inline float exp2_of_minus(float u)
{
    gtc_word_t whole;
    gtc_word_t e;
    float f;

    whole.value = u + F32_ROUND;
    if (whole.bits >= (F32_ROUND_BITS + F32_CUT)) {
        return 0.0F;
    }
    e.bits = exp2_table[whole.bits & 63U] - (whole.bits << 17);
    f = whole.value - F32_ROUND;
    f = u - f;
    f = f - F32_H;
    f = f * f;
    f = f + F32_G;
    f = e.value * f;
    return f;
}

/* acc + weight * 2^(-u/64), u of the center's record. */
static inline float gaussian(float acc, const gtc_word_t *center, const POINT *in)
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
    f = exp2_of_minus(u);
    f = center[CENTER_WEIGHT].value * f;
    f = acc + f;
    return f;
}

/* One network: w0 + linear part + its Gaussians. */
static inline float network_value(const TABLE *table, const gtc_word_t *network,
                              const gtc_word_t *centers, const POINT *in)
{
    const gtc_word_t *center = centers;
    const gtc_word_t *const end = &centers[network[NETWORK_CENTERS].bits * GTC_CENTER_WORDS];
    float acc = network[NETWORK_CONSTANT].value;
    float term;

    (void)table; /* only fixed point needs it */
    term = network[NETWORK_TEMP].value * in->z_temp;
    acc = acc + term;
    term = network[NETWORK_SLOPE].value * in->z_slope;
    acc = acc + term;
    while (center != end) {
        acc = gaussian(acc, center, in);
        center = &center[GTC_CENTER_WORDS];
    }
    return acc;
}

#if GTC_WITH_COVERAGE || GTC_WITH_UNCERTAINTY
/* Cell of `x` among n equal ones over [low, high]; n >= 1. */
static inline uint_least32_t cell_of(float x, const gtc_word_t *range, uint_least32_t n)
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
static inline void cells_of(const TABLE *table, const POINT *in, const uint_least32_t n[2],
                             uint_least32_t cell[2])
{
    cell[0] = cell_of(in->temp, &table->envelope[ENVELOPE_TEMP], n[0]);
    cell[1] = cell_of(in->slope, &table->envelope[ENVELOPE_SLOPE], n[1]);
}
#endif

#if GTC_WITH_BANK
/* ---- the bank of networks --------------------------------------------------------------- */

#define FULL_SHARE 1.0F
#define IN_TEMP(in) ((in)->temp)
#define IN_SLOPE(in) ((in)->slope)

/* Sum of shares times results, and of shares. */
typedef struct {
    float total;
    float share;
} f32_blend_t;

static inline void get_edges(const TABLE *table, float edges[4])
{
    uint_least32_t i;

    for (i = 0U; i < 4U; i++) {
        edges[i] = table->envelope[i].value;
    }
}

static inline float lesser(float a, float b)
{
    return (a < b) ? a : b;
}

/* Where x is on the way between two different numbers; 0 before `from`. */
static inline float fraction(float from, float x, float to)
{
    float way;
    float whole;

    way = x - from;
    whole = to - from;
    way = way / whole;
    return (way > 0.0F) ? way : 0.0F;
}

static inline void mix(BLEND *blend, float share, float bias)
{
    float product;

    product = share * bias;
    blend->total = blend->total + product;
    blend->share = blend->share + share;
}

static inline float unmixed(const BLEND *blend, float otherwise)
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
static inline float largest_change(const gtc_word_t *guard, uint_least32_t us)
{
    const float time = (float)us;
    float limit;

    limit = guard[GUARD_RATE].value * time;
    limit = guard[GUARD_STEP].value + limit;
    return limit;
}

/* |a - b| <= limit */
static inline int is_near(float a, float b, float limit)
{
    float distance;

    distance = a - b;
    if (distance < 0.0F) {
        distance = -distance;
    }
    return (distance <= limit) ? 1 : 0;
}

/* Where a temperature is after so many blocks. */
static inline float ahead(float temp, float slope, uint_least32_t blocks)
{
    const float n = (float)blocks;
    float way;

    way = slope * n;
    way = temp + way;
    return way;
}

static inline float add(float sum, float d)
{
    float next;

    next = sum + d;
    return next;
}

static inline float diff(float a, float b)
{
    float d;

    d = a - b;
    return d;
}

static inline float scaled(uint_least32_t k, float x)
{
    const float factor = (float)k;
    float product;

    product = factor * x;
    return product;
}

/* base + sum / n */
static inline float mean_of(float base, float sum, uint_least32_t n)
{
    const float count = (float)n;
    float mean;

    mean = sum / count;
    mean = base + mean;
    return mean;
}

/* num / den */
static inline float rounded_quotient(float num, uint_least32_t den)
{
    const float divisor = (float)den;
    float q;

    q = num / divisor;
    return q;
}

/* ---- terms and uncertainty ------------------------------------------------------------- */

#if GTC_WITH_UNCERTAINTY || GTC_WITH_RETAINED || GTC_WITH_CHANNELS
/* factor (a - b) */
static inline float scaled_difference(float a, float b, float factor)
{
    float d;

    d = a - b;
    d = factor * d;
    return d;
}
#endif

#if GTC_WITH_TERMS
static inline float parameter(const TABLE *table, uint_least32_t term, uint_least32_t k)
{
    return table->terms[(term * GTC_TERM_WORDS) + TERM_PARAMETERS + k].value;
}
#endif

#if GTC_WITH_MEMORY
/* First-order memory: z, and the number kept for more digits (here none). */
static inline void settle_memory(float z[2], float x)
{
    z[0] = x;
    z[1] = 0.0F;
}

/* z + gain (x - z) */
static inline void follow_memory(float z[2], float x, float gain)
{
    float d;

    d = x - z[0];
    d = gain * d;
    z[0] = z[0] + d;
}

/* Share of a difference that is gone after so many blocks, each of which takes the share `gain` of what is left. */
static inline float relaxed_share(float gain, uint_least32_t blocks)
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

/* rate (a - b), a slope. */
static inline float slope_of(float a, float b, float rate)
{
    return scaled_difference(a, b, rate);
}
#endif

#if GTC_WITH_WARM_UP
/* amplitude * exp(-blocks * gain) */
static inline float warm_up_value(uint_least32_t blocks, float gain, float amplitude)
{
    const float n = (float)blocks;
    float value;

    value = n * gain;
    value = exp2_of_minus(value);
    value = amplitude * value;
    return value;
}
#endif

#if GTC_WITH_HARMONIC
/* amplitude * cos(2 pi (x * frequency + phase)): the phase in turns, reduced to its fraction. */
static inline float harmonic_value(float x, float frequency, float phase, float amplitude)
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
#endif

#if GTC_WITH_CURVE
/* weight * 2^(-((x - center) gain)^2 / 64); bell: center, weight */
static inline float gaussian_of_channel(float x, float gain, const gtc_word_t *bell)
{
    float u;

    u = x - bell[0].value;
    u = u * gain;
    u = u * u;
    u = exp2_of_minus(u);
    u = bell[1].value * u;
    return u;
}

/* Two of one gain: gain; center, weight; center, weight. */
static inline float gaussians_of_channel(float x, const gtc_word_t *bells)
{
    const float first = gaussian_of_channel(x, bells[0].value, &bells[1]);
    float sum;

    sum = gaussian_of_channel(x, bells[0].value, &bells[3]);
    sum = first + sum;
    return sum;
}
#endif

/* ---- the uncertainty -------------------------------------------------------------------- */

#if GTC_WITH_UNCERTAINTY
#define NO_SQUARE 0.0F

static inline float squared(float x)
{
    float square;

    square = x * x;
    return square;
}

static inline float add_squares(float a, float b)
{
    return add(a, b);
}

/* The square; `other` where a state was overwritten so that it is none, or so large that the sum of two is infinite. */
static inline float square_or(float square, float other)
{
    return ((square >= 0.0F) && (square <= 1.0e38F)) ? square : other;
}

/* Square root, 0.6 units of the last place: half the exponent, then Newton's rule. x >= 0 */
static inline float square_root(float x)
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
#endif

#if GTC_WITH_REZERO
/* square / n */
static inline float divide_square(float square, uint_least32_t n)
{
    const float count = (float)n;
    float share;

    share = square / count;
    return share;
}

/* a / (a + b), 0 where both are */
static inline float share_of(float a, float b)
{
    float whole;

    whole = a + b;
    if (!(whole > 0.0F)) {
        return 0.0F;
    }
    whole = a / whole;
    return (whole < 1.0F) ? whole : 1.0F;
}

static inline float share_of_number(float share, float x)
{
    float product;

    product = share * x;
    return product;
}

static inline float part_of_square(float share, float x)
{
    return share_of_number(share, x);
}
#endif

#if GTC_WITH_UNCERTAINTY && GTC_WITH_MEMORY
/* word (1 - gain)^blocks */
static inline float remaining(float word, float gain, uint_least32_t blocks)
{
    float left;

    left = relaxed_share(gain, blocks);
    left = 1.0F - left;
    left = word * left;
    return left;
}
#endif

#if GTC_WITH_UNCERTAINTY && GTC_WITH_PLAY
/* word (2 width - (high - low)), 0 where that is negative; no number where low or high is none */
static inline float unsettled(float width, float low, float high, float word)
{
    float range;
    float left;

    range = high - low;
    left = width + width;
    left = left - range;
    left = word * left;
    return (left <= 0.0F) ? 0.0F : left;
}
#endif

#endif /* GTC_NUM_F32_H_INCLUDED */
