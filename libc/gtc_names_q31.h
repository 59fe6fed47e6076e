/* gtc_names_q31.h - the names in which the algorithm is written, for fixed point.
 *
 * The algorithm is written once, for both arithmetics, in the types and words below; `gyrotc emit` writes it with what
 * they stand for.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_NAMES_Q31_H_INCLUDED
#define GTC_NAMES_Q31_H_INCLUDED

/* A public function. MISRA 20.10: one text gives its names to both arithmetics. */
#define PUBLIC(name) gtc_q31_##name

#define TABLE gtc_q31_table_t
#define STATE gtc_q31_state_t
#define INPUT gtc_q31_input_t
#define SNAPSHOT gtc_q31_snapshot_t
#define ANGLE gtc_q31_angle_t
#define POINT q31_point_t
#define EFFECT q31_effect_t
#define BLEND q31_blend_t
#define NUM int_least32_t     /* a number */
#define WIDE int_least64_t    /* a sum of numbers */
#define SHARE int_least32_t   /* 0 ... 1 in 2^-24 */
#define SQUARE uint_least64_t /* square of the bias' unit; fewer than 16 squares of 2^30 are added */
#define NUM_ZERO 0

/* A sum as the number that it fits in, and as a factor of a product. MISRA 20.7: every argument is a name or a call. */
#define NARROW(sum) (int_least32_t)sum
#define FACTOR(sum) (int_least32_t)limit_factor(sum)

#define HAS_SUM_LIMITS 1 /* 1: words in their ranges may have sums that are too large, which sums_fit() finds */

/* A table member as a number and as the word of an image; an array element as a number.
 * MISRA 20.7: every argument is a member, an element or a constant; parentheses would be in the emitted text. */
#define MEMBER(member) member
#define ELEMENT(word) word.integer

/* A row of gtc_limits.inl. MISRA 20.7: the arguments are between commas. */
#define RANGE(f32_least, f32_most, q31_least, q31_most) {q31_least, q31_most}

#endif /* GTC_NAMES_Q31_H_INCLUDED */
