/* gtc_q31_map.c - gtc_q31_map().
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_q31.h"
#include "gtc_map.inl"
