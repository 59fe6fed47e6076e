/* gtc_q31_save.c - gtc_q31_save(), gtc_q31_restore().
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_q31.h"
#include "gtc_save_q31.h"
#include "gtc_save.inl"
