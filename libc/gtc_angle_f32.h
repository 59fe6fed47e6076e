/* gtc_angle_f32.h - bias times time in float32: an exact product, and an exact remainder.
 *
 * The product of two floats is the sum of two, a sum of two floats likewise; both are found with
 * rounded operations alone. No number here is subnormal: everything is a multiple of 2^-120.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_ANGLE_F32_H_INCLUDED
#define GTC_ANGLE_F32_H_INCLUDED

#define NUM_LONGEST_DT 1000.0F /* s */

/* Products below are taken as 0: in 24 h at 1 kHz they make less than 2^-43 arcsec. */
#define F32_NOTHING 0x1p-70F
#define F32_UNITS 65536.0F /* in an arcsec */
#define F32_UNIT 0x1p-16F

/* Numbers from here on are multiples of the unit as they are. */
#define F32_WHOLE 128.0F

/* A number in two parts, the second below the last place of the first. */
typedef struct {
    float high;
    float low;
} FN(pair_t);

/* a + b, exactly. */
static FN(pair_t) FN(two_sum)(float a, float b)
{
    FN(pair_t) sum;
    float part_a;
    float part_b;

    sum.high = a + b;
    part_b = sum.high - a;
    part_a = sum.high - part_b;
    part_b = b - part_b;
    part_a = a - part_a;
    sum.low = part_a + part_b;
    return sum;
}

/* x in two parts of at most 12 bits. */
static FN(pair_t) FN(halves)(float x)
{
    FN(pair_t) half;
    float scaled;

    scaled = 4097.0F * x;
    half.high = scaled - x;
    half.high = scaled - half.high;
    half.low = x - half.high;
    return half;
}

/* a * b, exactly; 0 if it is next to nothing. */
static FN(pair_t) FN(two_product)(float a, float b)
{
    const FN(pair_t) x = FN(halves)(a);
    const FN(pair_t) y = FN(halves)(b);
    FN(pair_t) product;
    float part;

    product.high = a * b;
    if ((product.high < F32_NOTHING) && (product.high > -F32_NOTHING)) {
        product.high = 0.0F;
        product.low = 0.0F;
        return product;
    }
    part = x.high * y.high;
    product.low = part - product.high;
    part = x.high * y.low;
    product.low = product.low + part;
    part = x.low * y.high;
    product.low = product.low + part;
    part = x.low * y.low;
    product.low = product.low + part;
    return product;
}

/* x as a multiple of the unit, to the nearest. */
static float FN(in_units)(float x)
{
    float units;

    if (!((x < F32_WHOLE) && (x > -F32_WHOLE))) {
        return x;
    }
    units = x * F32_UNITS;
    units = units + ((units < 0.0F) ? -0.5F : 0.5F);
    units = (float)(int_least32_t)units;
    units = units * F32_UNIT;
    return units;
}

/* bias * dt and what was left over, in whole units. Returns 1: it always fits. */
static int FN(advance)(STATE *state, float dt, float *angle)
{
    const FN(pair_t) product = FN(two_product)(state->bias, dt);
    FN(pair_t) rest;
    float sum;
    float low;

    sum = product.low + state->angle[0];
    sum = product.high + sum;
    *angle = FN(in_units)(sum);
    rest = FN(two_sum)(product.high, -*angle);
    low = rest.low + state->angle[1];
    rest = FN(two_sum)(rest.high, product.low);
    low = low + rest.low;
    rest = FN(two_sum)(rest.high, state->angle[0]);
    low = low + rest.low;
    rest = FN(two_sum)(rest.high, low);
    state->angle[0] = rest.high;
    state->angle[1] = rest.low;
    return 1;
}

#endif /* GTC_ANGLE_F32_H_INCLUDED */
