/* gtc_q31_check.c - gtc_q31_check().
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_q31.h"
#include "gtc_selftest_q31.h"
#include "gtc_image.inl"
#include "gtc_check.inl"
