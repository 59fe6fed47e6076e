/* gtc_q31_angle.c - gtc_q31_angle(): the remainder of the division is carried on.
 *
 * 1 deg/h is 1 arcsec/s.
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_q31.h"

#define MICROSECONDS 1000000

int gtc_q31_angle(gtc_q31_state_t *state, int_least32_t dt, int_least32_t *angle)
{
    int_least64_t total;
    int_least64_t out;

    if ((state == NULL) || (angle == NULL) || (state->table == NULL)) {
        return GTC_E_ARG;
    }
    if ((dt < 0) || (dt > 1000000000)) {
        return GTC_E_ARG;
    }
    total = state->angle + ((int_least64_t)state->bias * dt);
    out = FN(divided)(total, MICROSECONDS);
    if ((out > 2147483647) || (out < -2147483647)) {
        return GTC_E_ARG;
    }
    state->angle = total - (out * MICROSECONDS);
    *angle = (int_least32_t)out;
    return (int)state->status;
}
