/* gtc_usable_q31.h - the conditions of fixed point on several words of a table.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_USABLE_Q31_H_INCLUDED
#define GTC_USABLE_Q31_H_INCLUDED

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

    for (i = 1U; i <= 3U; i++) {
        sum += FN(magnitude)(network[i].integer);
    }
    for (i = 0U; i < network[0].bits; i++) {
        const gtc_word_t *const center = &centers[i * GTC_CENTER_WORDS];

        fit &= FN(argument_fits)(&center[0]) & FN(argument_fits)(&center[2]);
        sum += FN(magnitude)(center[4].integer);
    }
    return ((fit != 0) && (sum <= LARGEST_SUM)) ? 1 : 0;
}

#endif /* GTC_USABLE_Q31_H_INCLUDED */
