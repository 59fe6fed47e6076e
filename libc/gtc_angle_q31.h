/* gtc_angle_q31.h - bias times time in fixed point: a quotient, and what it leaves.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_ANGLE_Q31_H_INCLUDED
#define GTC_ANGLE_Q31_H_INCLUDED

#define NUM_LONGEST_DT 1000000000L /* microseconds */
#define Q31_SECOND 1000000L

/* bias * dt and what was left over, in whole units. Returns 0, with nothing written, if they do not
 * fit in 32 bits. |bias * dt| < 2^61, and at most half a unit is left over. */
static int FN(advance)(STATE *state, int_least32_t dt, int_least32_t *angle)
{
    const int_least64_t sum = ((int_least64_t)state->bias * dt) + state->angle;
    const int_least64_t units = FN(divided)(sum, Q31_SECOND);

    if ((units > 2147483647L) || (units < -2147483647L)) {
        return 0;
    }
    state->angle = sum - (units * Q31_SECOND);
    *angle = (int_least32_t)units;
    return 1;
}

#endif /* GTC_ANGLE_Q31_H_INCLUDED */
