/* gtc_f32.c - the runtime in float32.
 *
 * Read from top to bottom: each function is before its callers. Pages that comments name (docs/...) are in
 * gyrotc's repository.
 *
 * In the repository: the algorithm is written once for both arithmetics, in the .inl files, in the names of
 * gtc_names_f32.h. MISRA 20.1 throughout: the texts use what is above them.
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_private.h"
#include "gtc_num_f32.h"

#include "gtc_map.inl"
#include "gtc_terms.inl"
#include "gtc_sigma.inl"
#include "gtc_front.inl"
#include "gtc_rezero.inl"
#include "gtc_crc.inl"

/* ==== Angle increments. */

/* Products and sums with their rounding errors carried on. 1 deg/h is 1 arcsec/s. The rest is a pair of floats
 * (docs/numerics.md, section 6). */

/* a as the sum of two numbers of 12 bits. */
static void split_float(float a, float *high, float *low)
{
    float c;
    float d;

    c = 4097.0F * a;
    d = c - a;
    *high = c - d;
    *low = a - *high;
}

/* a * b = *product + *error, exactly. */
static void exact_product(float a, float b, float *product, float *error)
{
    float a1;
    float a0;
    float b1;
    float b0;
    float part;

    split_float(a, &a1, &a0);
    split_float(b, &b1, &b0);
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
static void exact_sum(float a, float b, float *sum, float *error)
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
static float to_increment(float x)
{
    float y = x;

    if ((x < 64.0F) && (x > -64.0F)) {
        y = x + 192.0F;
        y = y - 192.0F;
    }
    return y;
}

int PUBLIC(angle)(ANGLE *angle, float bias, float dt, float *increment)
{
    float product;
    float error;
    float sum;
    float low;
    float out;
    float total;

    if ((angle == NULL) || (increment == NULL) || (is_missing(bias) != 0) || (is_missing(dt) != 0)) {
        return GTC_E_ARG;
    }
    if ((dt < 0.0F) || (dt > 1000.0F)) {
        return GTC_E_ARG;
    }
    exact_product(bias, dt, &product, &error);
    exact_sum(angle->rest[0], product, &sum, &low);
    low = low + angle->rest[1];
    low = low + error;
    exact_sum(sum, low, &sum, &low);
    out = to_increment(sum);
    if (is_missing(out) != 0) {
        return GTC_E_ARG;
    }
    total = *increment + out;
    if (is_missing(total) != 0) {
        return GTC_E_ARG;
    }
    sum = sum - out;
    exact_sum(sum, low, &angle->rest[0], &angle->rest[1]);
    *increment = total;
    return GTC_OK;
}

#if GTC_WITH_SAVE
/* ==== Wide numbers as words of a saved state. */

static void to_words(float x, gtc_word_t words[2])
{
    words[0].value = x;
    words[1].bits = 0U;
}

static float from_words(const gtc_word_t words[2])
{
    return words[0].value;
}

/* The mean of the running block is a number. */
static int sum_fits(const INPUT *in, float low, float high)
{
    float most;

    most = high - low;
    most = most * (float)in->valid;
    most = most + most;
    return ((in->valid == 0U) || ((in->sum >= -most) && (in->sum <= most))) ? 1 : 0;
}

#if GTC_WITH_RETAINED
/* What a memory keeps for more digits: nothing. */
static int is_fraction(float x)
{
    return (is_missing(x) || (bits_of(x) == 0U)) ? 1 : 0;
}
#endif
#endif

#include "gtc_save.inl"
#include "gtc_selftest_f32.h"
#include "gtc_check.inl"
#include "gtc_limits.inl"

#if GTC_WITH_IMAGE
/* ==== Conditions on several words of a table. */

/* Numbers that are different, and no quotient by their difference is infinite. */
static int is_width(float low, float high)
{
    float width;

    width = high - low;
    return (width >= 0x1p-100F) ? 1 : 0;
}

/* The inputs reach no farther than 8 half ranges, so that on_grid() keeps their digits. */
static int is_reach(float x, float offset, float gain)
{
    float z;

    z = x - offset;
    z = z * gain;
    return ((z >= -8.0F) && (z <= 8.0F)) ? 1 : 0;
}

/* Each input has one value or a range. */
static int envelope_fits(const TABLE *table)
{
    const gtc_word_t *const edges = table->envelope;
    int fit = 1;
    uint_least32_t i;

    for (i = 0U; i < 4U; i += 2U) {
        const float low = edges[i].value;
        const float high = edges[i + 1U].value;

        fit &= (is_width(low, high) || (bits_of(low) == bits_of(high))) ? 1 : 0;
    }
    for (i = 0U; i < 2U; i++) {
        fit &= is_reach(edges[i].value, table->scale[SCALE_CENTER].value, table->scale[SCALE_TEMP].value);
        fit &= is_reach(edges[ENVELOPE_SLOPE + i].value, 0.0F, table->scale[SCALE_SLOPE].value);
    }
    return fit;
}
#endif

#include "gtc_open.inl"
