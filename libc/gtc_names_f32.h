/* gtc_names_f32.h - the names in which the algorithm is written, for float32.
 *
 * The algorithm is written once, for both arithmetics, in the types and words below; `gyrotc emit` writes it with what
 * they stand for.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_NAMES_F32_H_INCLUDED
#define GTC_NAMES_F32_H_INCLUDED

/* A public function. MISRA 20.10: one text gives its names to both arithmetics. */
#define PUBLIC(name) gtc_f32_##name

#define TABLE gtc_f32_table_t
#define STATE gtc_f32_state_t
#define INPUT gtc_f32_input_t
#define SNAPSHOT gtc_f32_snapshot_t
#define ANGLE gtc_f32_angle_t
#define POINT f32_point_t
#define EFFECT f32_effect_t
#define BLEND f32_blend_t
#define NUM float    /* a number */
#define WIDE float   /* a sum of numbers */
#define SHARE float  /* 0 ... 1 */
#define SQUARE float /* (deg/h)^2 */
#define NUM_ZERO 0.0F

/* A sum as the number that it fits in, and as a factor of a product: in float32 both are the sum itself. */
#define NARROW(sum) sum
#define FACTOR(sum) sum

#define HAS_SUM_LIMITS 0 /* 1: words in their ranges may have sums that are too large, which sums_fit() finds */

/* A table member as a number and as the word of an image; an array element as a number.
 * MISRA 20.7: every argument is a member, an element or a constant; parentheses would be in the emitted text. */
#define MEMBER(member) member.value
#define ELEMENT(word) word.value

/* A row of gtc_limits.inl. MISRA 20.7: the arguments are between commas. */
#define RANGE(f32_least, f32_most, q31_least, q31_most) {f32_least, f32_most}

#endif /* GTC_NAMES_F32_H_INCLUDED */
