/* gtc_q31_term_memory.c - linked only where a table names it.
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_q31.h"
#include "gtc_term_memory.inl"
