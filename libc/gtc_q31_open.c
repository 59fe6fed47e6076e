/* gtc_q31_open.c - gtc_q31_open().
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_q31.h"
#include "gtc_image.inl"
#include "gtc_open.inl"
