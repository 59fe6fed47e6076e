/* gtc_f32_term_nothing.c - linked only with terms.
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_f32.h"
#include "gtc_term_nothing.inl"
