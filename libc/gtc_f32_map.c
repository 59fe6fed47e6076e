/* gtc_f32_map.c - gtc_f32_map().
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_f32.h"
#include "gtc_map.inl"
