/* gtc_q31.c - the runtime in fixed point.
 *
 * Read from top to bottom: each function is before its callers. Pages that comments name (docs/...) are in
 * gyrotc's repository.
 *
 * In the repository: the algorithm is written once for both arithmetics, in the .inl files, in the names of
 * gtc_names_q31.h. MISRA 20.1 throughout: the texts use what is above them.
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_private.h"
#include "gtc_num_q31.h"

#include "gtc_map.inl"
#include "gtc_terms.inl"
#include "gtc_sigma.inl"
#include "gtc_front.inl"
#include "gtc_rezero.inl"
#include "gtc_crc.inl"

/* ==== Angle increments. */

#define MICROSECONDS 1000000 /* in a second */

/* The rest of the division is carried on. 1 deg/h is 1 arcsec/s. */
int PUBLIC(angle)(ANGLE *angle, int_least32_t bias, int_least32_t dt, int_least32_t *increment)
{
    int_least64_t total;
    int_least64_t out;
    int_least64_t sum;

    if ((angle == NULL) || (increment == NULL) || (is_missing(bias) != 0)) {
        return GTC_E_ARG;
    }
    if ((dt < 0) || (dt > 1000000000)) {
        return GTC_E_ARG;
    }
    total = angle->rest + ((int_least64_t)bias * dt);
    out = rounded_quotient(total, MICROSECONDS);
    sum = *increment + out;
    if ((sum > 2147483647) || (sum < -2147483647)) {
        return GTC_E_ARG;
    }
    angle->rest = total - (out * MICROSECONDS);
    *increment = (int_least32_t)sum;
    return GTC_OK;
}

#if GTC_WITH_SAVE
/* ==== Wide numbers as words of a saved state. */

static void to_words(int_least64_t x, gtc_word_t words[2])
{
    const uint_least64_t bits = (uint_least64_t)x;

    words[0].bits = (uint_least32_t)(bits & 0xFFFFFFFFU);
    words[1].bits = (uint_least32_t)((bits >> 32) & 0xFFFFFFFFU);
}

static int_least64_t from_words(const gtc_word_t words[2])
{
    return ((int_least64_t)words[1].integer * 4294967296) + (int_least64_t)words[0].bits;
}

/* The mean of the running block lies in the range. */
static int sum_fits(const INPUT *in, int_least32_t low, int_least32_t high)
{
    const int_least64_t n = (int_least64_t)in->valid;
    const int_least64_t least = ((int_least64_t)low - (int_least64_t)in->base) * n;
    const int_least64_t most = ((int_least64_t)high - (int_least64_t)in->base) * n;

    return ((in->valid == 0U) || ((in->sum >= least) && (in->sum <= most))) ? 1 : 0;
}

#if GTC_WITH_RETAINED
/* What a memory keeps for more digits, 2^-32 C. */
static int is_fraction(int_least32_t x)
{
    return (is_missing(x) || ((x >= 0) && (x <= 65535))) ? 1 : 0;
}
#endif
#endif

#include "gtc_save.inl"
#include "gtc_selftest_q31.h"
#include "gtc_check.inl"
#include "gtc_limits.inl"

#if GTC_WITH_IMAGE
/* ==== Conditions on several words of a table. */

#define LARGEST_SUM 1073741824U /* of magnitudes of a network's weights: bias and sums keep to their words */
#define LAST_POSITION 65535U
#define LARGEST_SPAN 0x3FFFFFFU /* of an envelope, in 2^-16 C: five bits more are 31 */

static uint_least32_t magnitude_of(int_least32_t x)
{
    return (x < 0) ? (0U - (uint_least32_t)x) : (uint_least32_t)x;
}

/* Positions that are different. */
static int is_width(int_least32_t low, int_least32_t high)
{
    return (low < high) ? 1 : 0;
}

/* Each input has one value or a range, and its positions end with the last one. */
static int envelope_fits(const TABLE *table)
{
    int fit = 1;
    uint_least32_t i;

    for (i = 0U; i < 2U; i++) {
        const int_least32_t low = table->envelope[2U * i];
        const int_least32_t high = table->envelope[(2U * i) + 1U];
        const uint_least32_t span = (uint_least32_t)high - (uint_least32_t)low;

        fit &= ((low <= high) && (span <= LARGEST_SPAN)
                && (high_word(span << 5, (uint_least32_t)table->scale[i]) <= LAST_POSITION)) ? 1 : 0;
    }
    return fit;
}

/* The argument s x + k at the last position is a number whose negative is one. */
static int argument_fits(const gtc_word_t *center)
{
    const int_least64_t last = ((int_least64_t)center[0].integer * (int_least64_t)LAST_POSITION) + center[1].integer;

    return ((last >= -2147483647) && (last <= 2147483647)) ? 1 : 0;
}

/* Arguments and the sum of all magnitudes keep to their words. */
static int sums_fit(const gtc_word_t *network, const gtc_word_t *centers)
{
    uint_least64_t sum = 0U;
    uint_least32_t i;
    int fit = 1;

    for (i = NETWORK_CONSTANT; i <= NETWORK_SLOPE; i++) {
        sum += magnitude_of(network[i].integer);
    }
    for (i = 0U; i < network[NETWORK_CENTERS].bits; i++) {
        const gtc_word_t *const center = &centers[i * GTC_CENTER_WORDS];

        fit &= argument_fits(&center[CENTER_TEMP]) & argument_fits(&center[CENTER_SLOPE]);
        sum += magnitude_of(center[CENTER_WEIGHT].integer);
    }
    return ((fit != 0) && (sum <= LARGEST_SUM)) ? 1 : 0;
}
#endif

#include "gtc_open.inl"
