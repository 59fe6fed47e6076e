/* arithmetic.h - names of one arithmetic (-DF32 or not), arbitrary numbers, and what states may hold. */
#ifndef ARITHMETIC_H_INCLUDED
#define ARITHMETIC_H_INCLUDED

#include "__fc_builtin.h"
#include "gtc_rlg_0042.h"

/* The text under analysis has no options; what it was made with is on the command line. */
#define WITH_TERMS (GTC_MAX_TERMS > 0)
#define WITH_CHANNELS (GTC_MAX_CHANNELS > 1U)
#define WITH_RETAINED (GTC_WITH_MEMORY || GTC_WITH_PLAY)

#if defined(F32)
#define RUNTIME "gtc_f32.c"
#define NAME(x) gtc_f32_##x
#define EFFECT f32_effect_t
#define THE_TABLE gtc_rlg_0042_f32
typedef float num_t;
typedef float wide_t;
#define LOWEST (-90.0F)
#define HIGHEST 200.0F
#define ENVELOPE_LEAST (-200.0F) /* libc/gtc_limits.inl: no envelope goes beyond */
#define ENVELOPE_MOST 400.0F
#define STEEPEST 100000.0F /* C per block: far more than any slope of plausible means */
#define FOLLOWED 400.0F /* a memory beyond it begins again */
#define FINITE(x) \is_finite(x)
#define NUMBER(word) ((word).value)
#define MEMBER_NUMBER(member) ((member).value)
#define ANY_PLAUSIBLE() Frama_C_float_interval(LOWEST, HIGHEST)
#define ANY_IN_ENVELOPE() Frama_C_float_interval(ENVELOPE_LEAST, ENVELOPE_MOST)
/* What tests/prove/primitives_f32.c shows for every float32. */
/*@ assigns \result \from x;
    behavior number: assumes \is_finite(x); ensures \result == 0;
    behavior missing: assumes !\is_finite(x); ensures \result == 1;
    complete behaviors; */
static inline int is_missing(float x);
#if defined(RANGES_BY_CONTRACT) /* Eva lets a NaN through `x >= least`; these for every float32, too */
/*@ assigns \result \from x, least, most;
    assigns *remarks \from *remarks, x, least, most;
    ensures \is_finite(\result);
    ensures least <= most ==> least <= \result <= most;
    ensures *remarks == \old(*remarks) || *remarks == (\old(*remarks) | GTC_CLAMPED); */
static inline float saturate(float x, float least, float most, int_least32_t *remarks);
/*@ requires !(x > 0x1.fffffep127);
    assigns \result \from x;
    ensures \is_finite(\result) && \result >= 0; */
static inline float square_root(float x);
/*@ requires 0 <= other <= 1.0e38;
    assigns \result \from square, other;
    ensures \is_finite(\result) && 0 <= \result <= 1.0e38F; */
static inline float square_or(float square, float other);
#endif
#else
#define RUNTIME "gtc_q31.c"
#define NAME(x) gtc_q31_##x
#define EFFECT q31_effect_t
#define THE_TABLE gtc_rlg_0042_q31
typedef int_least32_t num_t;
typedef int_least64_t wide_t;
#define LOWEST (-90L * 65536L)
#define HIGHEST (200L * 65536L)
#define ENVELOPE_LEAST (-200L * 65536L)
#define ENVELOPE_MOST (400L * 65536L)
#define STEEPEST 2147483647L
#define FOLLOWED (400L * 65536L)
#define FINITE(x) \true
#define NUMBER(word) ((word).integer)
#define MEMBER_NUMBER(member) (member)
#define ANY_PLAUSIBLE() (int_least32_t)Frama_C_long_interval(LOWEST, HIGHEST)
#define ANY_IN_ENVELOPE() (int_least32_t)Frama_C_long_interval(ENVELOPE_LEAST, ENVELOPE_MOST)
#endif

#if defined(ANY_TABLE)
#undef THE_TABLE
#define THE_TABLE any
static NAME(table_t) any; /* any_table.h */
#endif

#define MAX_BLOCK 1048576UL /* samples_per_block at most; `init` refuses more */

/* Any number at all, in KINDS parts that are analysed apart: those that are one, and those that mark a missing
 * sample (in float32 every infinity and NaN of either sign, by their bits). */
#if defined(F32)
#define KINDS 3
static inline float any_number(unsigned kind)
{
    union {
        uint_least32_t bits;
        float number;
    } word;
    if (kind == 0U) {
        return Frama_C_float_interval(-0x1.fffffep127F, 0x1.fffffep127F);
    }
    word.bits = (kind == 1U) ? Frama_C_unsigned_long_interval(0x7F800000U, 0x7FFFFFFFU)
                             : Frama_C_unsigned_long_interval(0xFF800000U, 0xFFFFFFFFUL);
    return word.number;
}
#else
#define KINDS 2
static inline int_least32_t any_number(unsigned kind)
{
    return (kind == 0U) ? (int_least32_t)Frama_C_long_interval(-2147483647L, 2147483647L)
                        : (-2147483647L - 1L);
}
#endif

#endif
