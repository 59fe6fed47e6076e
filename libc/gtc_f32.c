/* gtc_f32.c - the runtime in float32: every public function, by its name.
 *
 * What they do is written once for both arithmetics, in the .inl files, in the names that gtc_num_f32.h and
 * this file give to numbers.
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_f32.h"

/* Bits of c * 2^(-i/64), with i * 2^17 added; docs/numerics.md, section 2, says how it is made. */
const uint_least32_t FN(exp2_table)[64] = {
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

/* ---- conditions on several words of a table ---------------------------------------------- */

/* A row of gtc_limits.inl. */
#define RANGE(f32_least, f32_most, q31_least, q31_most) {(f32_least), (f32_most)}

/* Numbers that are different, and no quotient by their difference is infinite. */
static int FN(is_width)(float low, float high)
{
    float width;

    width = high - low;
    return (width >= 0x1p-100F) ? 1 : 0;
}

/* The inputs reach no farther than 8 half ranges, so that on_grid() keeps their digits. */
static int FN(is_reach)(float x, float offset, float gain)
{
    float z;

    z = x - offset;
    z = z * gain;
    return ((z >= -8.0F) && (z <= 8.0F)) ? 1 : 0;
}

/* Each input has one value or a range. */
static int FN(envelope_fits)(const TABLE *table)
{
    const gtc_word_t *const edges = table->envelope;
    int fit = 1;
    uint_least32_t i;

    for (i = 0U; i < 4U; i += 2U) {
        const float low = edges[i].value;
        const float high = edges[i + 1U].value;

        fit &= (FN(is_width)(low, high) || (FN(bits)(low) == FN(bits)(high))) ? 1 : 0;
    }
    for (i = 0U; i < 2U; i++) {
        fit &= FN(is_reach)(edges[i].value, table->scale[SCALE_CENTER].value, table->scale[SCALE_TEMP].value);
        fit &= FN(is_reach)(edges[ENVELOPE_SLOPE + i].value, 0.0F, table->scale[SCALE_SLOPE].value);
    }
    return fit;
}

/* With every word in its range no sum leaves float32. */
static int FN(sums_fit)(const gtc_word_t *network, const gtc_word_t *centers)
{
    (void)network;
    (void)centers;
    return 1;
}

#if GTC_WITH_SAVE
/* ---- wide numbers as words of a saved state ---------------------------------------------- */

static void FN(to_words)(float x, gtc_word_t words[2])
{
    words[0].value = x;
    words[1].bits = 0U;
}

static float FN(from_words)(const gtc_word_t words[2])
{
    return words[0].value;
}

/* The mean of the running block is a number. */
static int FN(sum_fits)(const INPUT *in, float low, float high)
{
    float most;

    most = high - low;
    most = most * (float)in->valid;
    most = most + most;
    return ((in->valid == 0U) || ((in->sum >= -most) && (in->sum <= most))) ? 1 : 0;
}

/* What a memory keeps for more digits: nothing. */
static int FN(is_fraction)(float x)
{
    return (FN(is_missing)(x) || (FN(bits)(x) == 0U)) ? 1 : 0;
}

#endif

/* ---- the algorithm ----------------------------------------------------------------------- */

/* MISRA 20.1: the texts use what stands above. */
#include "gtc_selftest_f32.h"
#include "gtc_limits.inl"
#include "gtc_map.inl"
#include "gtc_terms.inl"
#include "gtc_sigma.inl"
#include "gtc_table.inl"
#include "gtc_front.inl"
#include "gtc_rezero.inl"
#include "gtc_save.inl"

/* ---- angle increments -------------------------------------------------------------------- */

/* Products and sums with their rounding errors carried on. 1 deg/h is 1 arcsec/s. The rest is a pair of floats
 * (docs/numerics.md, section 6). */

/* a as the sum of two numbers of 12 bits. */
static void FN(split)(float a, float *high, float *low)
{
    float c;
    float d;

    c = 4097.0F * a;
    d = c - a;
    *high = c - d;
    *low = a - *high;
}

/* a * b = *product + *error, exactly. */
static void FN(exact_product)(float a, float b, float *product, float *error)
{
    float a1;
    float a0;
    float b1;
    float b0;
    float part;

    FN(split)(a, &a1, &a0);
    FN(split)(b, &b1, &b0);
    *product = a * b;
    part = a1 * b1;
    *error = part - *product;
    part = a1 * b0;
    *error = *error + part;
    part = a0 * b1;
    *error = *error + part;
    part = a0 * b0;
    *error = *error + part;
}

/* a + b = *sum + *error, exactly. */
static void FN(exact_sum)(float a, float b, float *sum, float *error)
{
    float back;
    float other;

    *sum = a + b;
    back = *sum - a;
    other = *sum - back;
    back = b - back;
    other = a - other;
    *error = other + back;
}

/* The nearest multiple of 2^-16; from 64 on, where a float has few digits more, x itself. */
static float FN(rounded)(float x)
{
    float y = x;

    if ((x < 64.0F) && (x > -64.0F)) {
        y = x + 192.0F;
        y = y - 192.0F;
    }
    return y;
}

int gtc_f32_angle(gtc_f32_angle_t *angle, float bias, float dt, float *increment)
{
    float product;
    float error;
    float sum;
    float low;
    float out;

    if ((angle == NULL) || (increment == NULL) || (FN(is_missing)(bias) != 0) || (FN(is_missing)(dt) != 0)) {
        return GTC_E_ARG;
    }
    if ((dt < 0.0F) || (dt > 1000.0F)) {
        return GTC_E_ARG;
    }
    FN(exact_product)(bias, dt, &product, &error);
    FN(exact_sum)(angle->rest[0], product, &sum, &low);
    low = low + angle->rest[1];
    low = low + error;
    FN(exact_sum)(sum, low, &sum, &low);
    out = FN(rounded)(sum);
    if (FN(is_missing)(out) != 0) {
        return GTC_E_ARG;
    }
    sum = sum - out;
    FN(exact_sum)(sum, low, &angle->rest[0], &angle->rest[1]);
    *increment = out;
    return GTC_OK;
}

/* ---- the other public functions ---------------------------------------------------------- */

int gtc_f32_check(const gtc_f32_table_t *table)
{
    return FN(run_check)(table);
}

#if GTC_WITH_IMAGE
int gtc_f32_open(gtc_f32_table_t *table, const gtc_word_t *words, uint_least32_t n_words,
                 uint_least32_t expected_id)
{
    return FN(run_open)(table, words, n_words, expected_id);
}
#endif

int gtc_f32_map(const gtc_f32_table_t *table, float temp, float slope, float *bias)
{
    return FN(run_map)(table, temp, slope, bias);
}

int gtc_f32_init(gtc_f32_state_t *state, const gtc_f32_table_t *table, uint_least32_t period_us)
{
    return FN(run_init)(state, table, period_us);
}

int gtc_f32_sample(gtc_f32_state_t *state, uint_least32_t elapsed_us, const float *channels)
{
    return FN(run_sample)(state, elapsed_us, channels);
}

int gtc_f32_bias(const gtc_f32_state_t *state, float *bias)
{
    return FN(run_bias)(state, bias);
}

#if GTC_WITH_SAVE
int gtc_f32_save(const gtc_f32_state_t *state, gtc_word_t words[GTC_SAVE_WORDS])
{
    return FN(run_save)(state, words);
}
#endif

#if GTC_WITH_SAVE
int gtc_f32_restore(gtc_f32_state_t *state, const gtc_f32_table_t *table,
                    uint_least32_t period_us, const gtc_word_t words[GTC_SAVE_WORDS],
                    uint_least32_t off_blocks)
{
    return FN(run_restore)(state, table, period_us, words, off_blocks);
}
#endif

#if GTC_WITH_UNCERTAINTY
int gtc_f32_snapshot(const gtc_f32_state_t *state, gtc_f32_snapshot_t *snapshot)
{
    return FN(run_snapshot)(state, snapshot);
}
#endif

#if GTC_WITH_REZERO
int gtc_f32_rezero(gtc_f32_state_t *state, float mean_rate, uint_least32_t seconds)
{
    return FN(run_rezero)(state, mean_rate, seconds);
}
#endif
