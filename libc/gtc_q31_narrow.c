/* gtc_q31_narrow.c - Gaussians of tables with narrow widths: arguments with fewer fraction bits.
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_q31.h"

FN(sum_t) FN(narrow)(FN(sum_t) start, const gtc_word_t *centers, const gtc_word_t *end,
                     uint_least32_t x_temp, uint_least32_t x_slope, uint_least32_t narrow)
{
    FN(sum_t) sum = start;
    const gtc_word_t *center;

    for (center = centers; center != end; center = &center[GTC_CENTER_WORDS]) {
        const int_least64_t a = FN(argument)(&center[0], x_temp);
        const int_least64_t b = FN(argument)(&center[2], x_slope);
        const int_least64_t p = a * a;
        const int_least64_t q = b * b;
        const uint_least64_t u = ((uint_least64_t)p + (uint_least64_t)q) >> (32U - narrow);

        if (u <= Q31_LAST) {
            sum = FN(accumulate)(sum, center[4].integer, FN(exp2)((uint_least32_t)u, Q31_G));
        }
    }
    return sum;
}
