/* gtc_f32_usable.c - whether this build can use a table.
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_f32.h"
#include "gtc_usable_f32.h"
#include "gtc_limits.inl"
#include "gtc_usable.inl"
