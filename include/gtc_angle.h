/* gtc_angle.h - angle increments less a bias, without the loss of a rounding error.
 *
 * For gyros that put out angles over a time in place of rates. It reads no table and no state: an interrupt may call it
 * with a copy of the bias.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_ANGLE_H_INCLUDED
#define GTC_ANGLE_H_INCLUDED

#include <stdint.h>

#include "gtc_config.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Sum of angle increments. Starts as 0: `= {0}`, or static. */
typedef struct {
    float rest[2]; /* what rounding left, arcsec */
} gtc_f32_angle_t;

typedef struct {
    int_least64_t rest; /* 10^-6 of a unit of the angle */
} gtc_q31_angle_t;

/* The angle to subtract from an angle increment over dt, for a copy of the bias; the rounding error is carried on.
 * f32: dt in s, increment in arcsec, a multiple of 2^-16 while below 64. q31: dt in microseconds, increment in
 * 2^-bias_frac_bits arcsec. Over 24 h the sum stays within one such unit of bias * t (f32 from 64 arcsec on: or one
 * last place of the largest increment), t being the sum of the dt given: 0.001F is off by 4e-8, 2^-10 s is exact.
 * Returns 0 or GTC_E_ARG (NULL, not a number, dt not in 0 ... 1000 s, increment beyond the numbers of the arithmetic),
 * which leaves the carried error as it was.
 * Bytes on a Cortex-M4F at -O2, code and stack: f32 340 and 0, q31 180 and 30. */
GTC_MUST_CHECK int gtc_f32_angle(gtc_f32_angle_t *angle, float bias, float dt, float *increment);
GTC_MUST_CHECK int gtc_q31_angle(gtc_q31_angle_t *angle, int_least32_t bias, int_least32_t dt,
                                 int_least32_t *increment);

#ifdef __cplusplus
}
#endif

#endif /* GTC_ANGLE_H_INCLUDED */
