/* gtc_f32_front.c - gtc_f32_init(), _sample(), _missed(), _bias().
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_f32.h"
#include "gtc_front.inl"
