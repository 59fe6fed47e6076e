/* gtc_q31_term_play.c - linked only where a table names it.
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_q31.h"
#include "gtc_term_play.inl"
