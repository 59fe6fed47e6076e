/* gtc_q31_narrow.c - Gaussians of tables with narrow widths: arguments with fewer fraction bits.
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_q31.h"

uint_least64_t FN(narrow)(uint_least64_t sum, const gtc_word_t *center, const gtc_word_t *end,
                          POINT in, uint_least32_t narrow)
{
    for (; center != end; center = &center[GTC_CENTER_WORDS]) {
        const int_least64_t a = FN(argument)(&center[0], in.x_temp);
        const int_least64_t b = FN(argument)(&center[2], in.x_slope);
        const uint_least64_t square = (uint_least64_t)(a * a) + (uint_least64_t)(b * b);
        const uint_least64_t u = square >> (32U - narrow);

        if (u < Q31_CUT) {
            sum = FN(accumulate)(sum, center[4].integer, FN(exp2)((uint_least32_t)u));
        }
    }
    return sum;
}
