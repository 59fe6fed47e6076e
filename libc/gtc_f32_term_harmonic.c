/* gtc_f32_term_harmonic.c - linked only where a table names it.
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_f32.h"
#include "gtc_term_harmonic.inl"
