/* gtc_f32_save.c - gtc_f32_save(), gtc_f32_restore().
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_f32.h"
#include "gtc_save_f32.h"
#include "gtc_save.inl"
