/* gtc_f32_angle.c - gtc_f32_angle(): products and sums with their rounding errors carried on.
 *
 * 1 deg/h is 1 arcsec/s. The remainder is a pair of floats (docs/numerics.md, section 6).
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_f32.h"

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

int gtc_f32_angle(gtc_f32_state_t *state, float dt, float *angle)
{
    float product;
    float error;
    float sum;
    float low;
    float out;

    if ((state == NULL) || (angle == NULL) || (state->table == NULL) || (FN(is_missing)(dt) != 0)) {
        return GTC_E_ARG;
    }
    if ((dt < 0.0F) || (dt > 1000.0F)) {
        return GTC_E_ARG;
    }
    FN(exact_product)(state->bias, dt, &product, &error);
    FN(exact_sum)(state->angle[0], product, &sum, &low);
    low = low + state->angle[1];
    low = low + error;
    FN(exact_sum)(sum, low, &sum, &low);
    out = FN(rounded)(sum);
    if (FN(is_missing)(out) != 0) {
        return GTC_E_ARG;
    }
    sum = sum - out;
    FN(exact_sum)(sum, low, &state->angle[0], &state->angle[1]);
    *angle = out;
    return (int)state->status;
}
