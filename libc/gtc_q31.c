/* gtc_q31.c - the runtime in fixed point: every public function, by its name.
 *
 * What they do is written once for both arithmetics, in the .inl files, in the names that gtc_num_q31.h and
 * this file give to numbers.
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_q31.h"

/* round(2052389455 * 2^(-i/64)), then Q31_G, which a function reads together with it; docs/numerics.md,
 * section 3, says how it is made. */
const uint_least32_t FN(exp2_table)[65] = {
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
    0x3FDFBFDAUL, 0x3F2F9BCCUL, 0x3E815D7AUL, 0x3DD4FFA7UL,
    Q31_G,
};

/* ---- conditions on several words of a table ---------------------------------------------- */

/* A row of gtc_limits.inl. */
#define RANGE(f32_least, f32_most, q31_least, q31_most) {(q31_least), (q31_most)}

#define LARGEST_SUM 1073741824U /* of magnitudes of a network's weights: bias and sums keep to their words */
#define LAST_POSITION 65535U
#define LARGEST_SPAN 0x3FFFFFFU /* of an envelope, in 2^-16 C: five bits more are 31 */

static uint_least32_t FN(magnitude)(int_least32_t x)
{
    return (x < 0) ? (0U - (uint_least32_t)x) : (uint_least32_t)x;
}

/* Positions that are different. */
static int FN(is_width)(int_least32_t low, int_least32_t high)
{
    return (low < high) ? 1 : 0;
}

/* Each input has one value or a range, and its positions end with the last one. */
static int FN(envelope_fits)(const TABLE *table)
{
    int fit = 1;
    uint_least32_t i;

    for (i = 0U; i < 2U; i++) {
        const int_least32_t low = table->envelope[2U * i];
        const int_least32_t high = table->envelope[(2U * i) + 1U];
        const uint_least32_t span = (uint_least32_t)high - (uint_least32_t)low;

        fit &= ((low <= high) && (span <= LARGEST_SPAN)
                && (FN(high)(span << 5, (uint_least32_t)table->scale[i]) <= LAST_POSITION)) ? 1 : 0;
    }
    return fit;
}

/* The argument s x + k at the last position is a number whose negative is one. */
static int FN(argument_fits)(const gtc_word_t *center)
{
    const int_least64_t last = ((int_least64_t)center[0].integer * (int_least64_t)LAST_POSITION) + center[1].integer;

    return ((last >= -2147483647) && (last <= 2147483647)) ? 1 : 0;
}

/* Arguments and the sum of all magnitudes keep to their words. */
static int FN(sums_fit)(const gtc_word_t *network, const gtc_word_t *centers)
{
    uint_least64_t sum = 0U;
    uint_least32_t i;
    int fit = 1;

    for (i = NETWORK_CONSTANT; i <= NETWORK_SLOPE; i++) {
        sum += FN(magnitude)(network[i].integer);
    }
    for (i = 0U; i < network[NETWORK_CENTERS].bits; i++) {
        const gtc_word_t *const center = &centers[i * GTC_CENTER_WORDS];

        fit &= FN(argument_fits)(&center[CENTER_TEMP]) & FN(argument_fits)(&center[CENTER_SLOPE]);
        sum += FN(magnitude)(center[CENTER_WEIGHT].integer);
    }
    return ((fit != 0) && (sum <= LARGEST_SUM)) ? 1 : 0;
}

#if GTC_WITH_SAVE
/* ---- wide numbers as words of a saved state ---------------------------------------------- */

static void FN(to_words)(int_least64_t x, gtc_word_t words[2])
{
    const uint_least64_t bits = (uint_least64_t)x;

    words[0].bits = (uint_least32_t)(bits & 0xFFFFFFFFU);
    words[1].bits = (uint_least32_t)((bits >> 32) & 0xFFFFFFFFU);
}

static int_least64_t FN(from_words)(const gtc_word_t words[2])
{
    return ((int_least64_t)words[1].integer * 4294967296) + (int_least64_t)words[0].bits;
}

#endif

/* ---- narrow widths ------------------------------------------------------------------------------- */

/* Gaussians of tables with narrow widths: arguments with fewer fraction bits. */
FN(sum_t) FN(narrow)(FN(sum_t) start, const gtc_word_t *centers, const gtc_word_t *end,
                     uint_least32_t x_temp, uint_least32_t x_slope, uint_least32_t narrow)
{
    FN(sum_t) sum = start;
    const gtc_word_t *center;

    for (center = centers; center != end; center = &center[GTC_CENTER_WORDS]) {
        const int_least64_t a = FN(argument)(&center[CENTER_TEMP], x_temp);
        const int_least64_t b = FN(argument)(&center[CENTER_SLOPE], x_slope);
        const int_least64_t p = a * a;
        const int_least64_t q = b * b;
        const uint_least64_t u = ((uint_least64_t)p + (uint_least64_t)q) >> (32U - narrow);

        if (u <= Q31_LAST) {
            sum = FN(accumulate)(sum, center[CENTER_WEIGHT].integer, FN(exp2)((uint_least32_t)u, Q31_G));
        }
    }
    return sum;
}

#if GTC_WITH_SAVE
/* The mean of the running block lies in the range. */
static int FN(sum_fits)(const INPUT *in, int_least32_t low, int_least32_t high)
{
    const int_least64_t n = (int_least64_t)in->valid;
    const int_least64_t least = ((int_least64_t)low - (int_least64_t)in->base) * n;
    const int_least64_t most = ((int_least64_t)high - (int_least64_t)in->base) * n;

    return ((in->valid == 0U) || ((in->sum >= least) && (in->sum <= most))) ? 1 : 0;
}

/* What a memory keeps for more digits, 2^-32 C. */
static int FN(is_fraction)(int_least32_t x)
{
    return (FN(is_missing)(x) || ((x >= 0) && (x <= 65535))) ? 1 : 0;
}

#endif

/* ---- the algorithm ----------------------------------------------------------------------- */

/* MISRA 20.1: the texts use what stands above. */
#include "gtc_selftest_q31.h"
#include "gtc_limits.inl"
#include "gtc_map.inl"
#include "gtc_terms.inl"
#include "gtc_sigma.inl"
#include "gtc_table.inl"
#include "gtc_front.inl"
#include "gtc_rezero.inl"
#include "gtc_save.inl"

/* ---- angle increments -------------------------------------------------------------------- */

#define MICROSECONDS 1000000 /* in a second */

/* The rest of the division is carried on. 1 deg/h is 1 arcsec/s. */
int gtc_q31_angle(gtc_q31_angle_t *angle, int_least32_t bias, int_least32_t dt, int_least32_t *increment)
{
    int_least64_t total;
    int_least64_t out;

    if ((angle == NULL) || (increment == NULL) || (FN(is_missing)(bias) != 0)) {
        return GTC_E_ARG;
    }
    if ((dt < 0) || (dt > 1000000000)) {
        return GTC_E_ARG;
    }
    total = angle->rest + ((int_least64_t)bias * dt);
    out = FN(divided)(total, MICROSECONDS);
    if ((out > 2147483647) || (out < -2147483647)) {
        return GTC_E_ARG;
    }
    angle->rest = total - (out * MICROSECONDS);
    *increment = (int_least32_t)out;
    return GTC_OK;
}

/* ---- the other public functions ---------------------------------------------------------- */

int gtc_q31_check(const gtc_q31_table_t *table)
{
    return FN(run_check)(table);
}

#if GTC_WITH_IMAGE
int gtc_q31_open(gtc_q31_table_t *table, const gtc_word_t *words, uint_least32_t n_words,
                 uint_least32_t expected_id)
{
    return FN(run_open)(table, words, n_words, expected_id);
}
#endif

int gtc_q31_map(const gtc_q31_table_t *table, int_least32_t temp, int_least32_t slope, int_least32_t *bias)
{
    return FN(run_map)(table, temp, slope, bias);
}

int gtc_q31_init(gtc_q31_state_t *state, const gtc_q31_table_t *table, uint_least32_t period_us)
{
    return FN(run_init)(state, table, period_us);
}

int gtc_q31_sample(gtc_q31_state_t *state, uint_least32_t elapsed_us, const int_least32_t *channels)
{
    return FN(run_sample)(state, elapsed_us, channels);
}

int gtc_q31_bias(const gtc_q31_state_t *state, int_least32_t *bias)
{
    return FN(run_bias)(state, bias);
}

#if GTC_WITH_SAVE
int gtc_q31_save(const gtc_q31_state_t *state, gtc_word_t words[GTC_SAVE_WORDS])
{
    return FN(run_save)(state, words);
}
#endif

#if GTC_WITH_SAVE
int gtc_q31_restore(gtc_q31_state_t *state, const gtc_q31_table_t *table,
                    uint_least32_t period_us, const gtc_word_t words[GTC_SAVE_WORDS],
                    uint_least32_t off_blocks)
{
    return FN(run_restore)(state, table, period_us, words, off_blocks);
}
#endif

#if GTC_WITH_UNCERTAINTY
int gtc_q31_snapshot(const gtc_q31_state_t *state, gtc_q31_snapshot_t *snapshot)
{
    return FN(run_snapshot)(state, snapshot);
}
#endif

#if GTC_WITH_REZERO
int gtc_q31_rezero(gtc_q31_state_t *state, int_least32_t mean_rate, uint_least32_t seconds)
{
    return FN(run_rezero)(state, mean_rate, seconds);
}
#endif
