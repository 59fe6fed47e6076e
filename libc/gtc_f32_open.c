/* gtc_f32_open.c - gtc_f32_open().
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_f32.h"
#include "gtc_image.inl"
#include "gtc_open.inl"
