/* gtc_q31_usable.c - whether this build can use a table.
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_q31.h"
#include "gtc_usable_q31.h"
#include "gtc_limits.inl"
#include "gtc_usable.inl"
