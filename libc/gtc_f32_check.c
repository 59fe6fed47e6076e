/* gtc_f32_check.c - gtc_f32_check().
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_f32.h"
#include "gtc_selftest_f32.h"
#include "gtc_image.inl"
#include "gtc_check.inl"
