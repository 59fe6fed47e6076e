/* gtc_q31_front.c - gtc_q31_init(), _sample(), _missed(), _bias().
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_q31.h"
#include "gtc_front.inl"
