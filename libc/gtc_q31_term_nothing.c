/* gtc_q31_term_nothing.c - linked only with terms.
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_q31.h"
#include "gtc_term_nothing.inl"
