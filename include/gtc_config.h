/* gtc_config.h - every option of the gyrotc runtime, with its default and the reason for it.
 *
 * To change one, define it on the compiler's command line, or name a header of your own in
 * GTC_CONFIG_HEADER (for example -DGTC_CONFIG_HEADER='"my_gtc.h"'); it is read first. All
 * translation units of one program must see the same options: they set the size of the state.
 * The files that `gyrotc emit` writes have no options: they are made for their tables.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_CONFIG_H_INCLUDED
#define GTC_CONFIG_H_INCLUDED

#ifdef GTC_CONFIG_HEADER
#include GTC_CONFIG_HEADER
#endif

/* Arithmetics: 1 is there, 0 is not declared. */
#ifndef GTC_WITH_F32
#define GTC_WITH_F32 1
#endif
#ifndef GTC_WITH_Q31
#define GTC_WITH_Q31 1
#endif

/* Longest slope window in blocks. 20 blocks of 10 s are 200 s, the longest window that `fit`
 * chooses. Each block costs one number of RAM in the state; a table that needs more is refused. */
#ifndef GTC_MAX_SLOPE_BLOCKS
#define GTC_MAX_SLOPE_BLOCKS 20
#endif

/* Most extension terms of one table, and most auxiliary channels. Diagnosis ships at most three causes; four leaves
 * room for one that is known beforehand. 0 leaves the code of terms and channels out. */
#ifndef GTC_MAX_TERMS
#define GTC_MAX_TERMS 4
#endif
#if GTC_MAX_TERMS > 0
#define GTC_WITH_TERMS 1
#else
#define GTC_WITH_TERMS 0
#endif

/* Kinds of terms: 1 is there, 0 is not compiled, and a table that needs it is refused. */
#ifndef GTC_WITH_MEMORY
#define GTC_WITH_MEMORY GTC_WITH_TERMS
#endif
#ifndef GTC_WITH_PLAY
#define GTC_WITH_PLAY GTC_WITH_TERMS
#endif
#ifndef GTC_WITH_WARM_UP
#define GTC_WITH_WARM_UP GTC_WITH_TERMS
#endif
#ifndef GTC_WITH_HARMONIC
#define GTC_WITH_HARMONIC GTC_WITH_TERMS
#endif
#ifndef GTC_WITH_AUXILIARY
#define GTC_WITH_AUXILIARY GTC_WITH_TERMS
#endif
#ifndef GTC_WITH_CURVE
#define GTC_WITH_CURVE GTC_WITH_TERMS
#endif
#ifndef GTC_WITH_PRODUCT
#define GTC_WITH_PRODUCT GTC_WITH_TERMS
#endif

/* Parts of the runtime: 1 is there, 0 is not compiled, and a table that needs it is refused. `gyrotc emit` writes a
 * runtime that consists of what its tables need. */

/* A table may hold several networks, chosen by temperature and slope (a model bank). One network over the whole
 * envelope is the default of the generator, hence 0. */
#ifndef GTC_WITH_BANK
#define GTC_WITH_BANK 0
#endif

/* Fixed point: Gaussians narrower than about an eighth of the envelope's half range. */
#ifndef GTC_WITH_NARROW
#define GTC_WITH_NARROW 1
#endif

/* The uncertainty of a correction: gtc_<n>_snapshot(). */
#ifndef GTC_WITH_UNCERTAINTY
#define GTC_WITH_UNCERTAINTY 1
#endif

/* gtc_<n>_rezero(), which needs the uncertainty. */
#ifndef GTC_WITH_REZERO
#define GTC_WITH_REZERO GTC_WITH_UNCERTAINTY
#endif

/* Where training data was: GTC_UNCOVERED. */
#ifndef GTC_WITH_COVERAGE
#define GTC_WITH_COVERAGE 1
#endif

/* Known answers of a table in gtc_<n>_check(). */
#ifndef GTC_WITH_PROBES
#define GTC_WITH_PROBES 1
#endif

/* gtc_<n>_open() and gtc_<n>_check_words(). */
#ifndef GTC_WITH_IMAGE
#define GTC_WITH_IMAGE 1
#endif

/* gtc_<n>_save() and gtc_<n>_restore(). */
#ifndef GTC_WITH_SAVE
#define GTC_WITH_SAVE 1
#endif

/* Any time in gtc_<n>_sample(). 0: only the sample period, GTC_E_ARG for another time; NULL is then one missed
 * sample. */
#ifndef GTC_WITH_TIME
#define GTC_WITH_TIME 1
#endif

/* Fraction bits of a bias in fixed point: one number for a product, so that firmware decodes every table alike.
 * gtc_q31_check() and gtc_q31_open() refuse a table in another unit. */
#ifndef GTC_BIAS_FRAC_BITS
#define GTC_BIAS_FRAC_BITS 24
#endif

/* What follows from the options above. */
#if GTC_WITH_AUXILIARY || GTC_WITH_CURVE || GTC_WITH_PRODUCT
#define GTC_WITH_CHANNELS 1
#else
#define GTC_WITH_CHANNELS 0
#endif
#if GTC_WITH_MEMORY || GTC_WITH_PLAY /* terms with a state */
#define GTC_WITH_RETAINED 1
#else
#define GTC_WITH_RETAINED 0
#endif
#define GTC_MAX_CHANNELS (1U + ((uint_least32_t)GTC_MAX_TERMS * (uint_least32_t)GTC_WITH_CHANNELS))

/* Words of a saved state, see gtc_<n>_save(). */
#define GTC_SAVE_WORDS                                                                                             \
    (10 + (2 * GTC_WITH_TERMS) + GTC_MAX_SLOPE_BLOCKS                                                              \
     + ((1 + (GTC_MAX_TERMS * GTC_WITH_CHANNELS)) * (13 + GTC_WITH_CHANNELS))                                      \
     + (2 * GTC_MAX_TERMS * GTC_WITH_RETAINED) + (GTC_WITH_UNCERTAINTY * (6 + (5 * GTC_WITH_TERMS)))               \
     + (3 * GTC_WITH_REZERO))

/* What of it sets the layout of a saved state. */
#define GTC_SAVE_OPTIONS                                                                                           \
    ((64UL * (uint_least32_t)GTC_WITH_CHANNELS)                                                                    \
     + (128UL * (uint_least32_t)GTC_WITH_UNCERTAINTY)                                                              \
     + (256UL * (uint_least32_t)GTC_MAX_TERMS)                                                                     \
     + (4096UL * (uint_least32_t)GTC_WITH_RETAINED)                                                                \
     + (8192UL * (uint_least32_t)GTC_WITH_REZERO)                                                                  \
     + (65536UL * (uint_least32_t)GTC_MAX_SLOPE_BLOCKS))

/* What this runtime holds, in the bits of a table's `parts` (gtc_table.h). */
#define GTC_PARTS                                                                                                  \
    (((uint_least32_t)GTC_WITH_BANK * GTC_PART_BANK)                                                               \
     | ((uint_least32_t)GTC_WITH_MEMORY * GTC_PART_TERM(GTC_TERM_MEMORY))                                          \
     | ((uint_least32_t)GTC_WITH_PLAY * GTC_PART_TERM(GTC_TERM_PLAY))                                              \
     | ((uint_least32_t)GTC_WITH_WARM_UP * GTC_PART_TERM(GTC_TERM_WARM_UP))                                        \
     | ((uint_least32_t)GTC_WITH_HARMONIC * GTC_PART_TERM(GTC_TERM_HARMONIC))                                      \
     | ((uint_least32_t)GTC_WITH_AUXILIARY * GTC_PART_TERM(GTC_TERM_AUXILIARY))                                    \
     | ((uint_least32_t)GTC_WITH_CURVE * GTC_PART_TERM(GTC_TERM_CURVE))                                            \
     | ((uint_least32_t)GTC_WITH_PRODUCT * GTC_PART_TERM(GTC_TERM_PRODUCT))                                        \
     | ((uint_least32_t)GTC_WITH_COVERAGE * GTC_PART_COVERAGE)                                                     \
     | ((uint_least32_t)GTC_WITH_UNCERTAINTY * GTC_PART_UNCERTAINTY)                                               \
     | ((uint_least32_t)GTC_WITH_PROBES * GTC_PART_PROBES)                                                         \
     | ((uint_least32_t)GTC_WITH_NARROW * GTC_PART_NARROW)                                                         \
     | ((uint_least32_t)GTC_WITH_REZERO * GTC_PART_REZERO))

/* 1: multiply 32 x 32 -> 64 bits in 16-bit halves. The bits are the same; it is faster on cores
 * without a long multiply (Cortex-M0, AVR) and slower on all others. */
#ifndef GTC_HALF_MULTIPLY
#if defined(__AVR__) || defined(__ARM_ARCH_6M__)
#define GTC_HALF_MULTIPLY 1
#else
#define GTC_HALF_MULTIPLY 0
#endif
#endif

/* What an assertion of a precondition or of a number's range becomes; a test build gives it an abort(). The default
 * is nothing: with a table that gtc_<n>_check() or gtc_<n>_open() accepted, and a state that only the functions
 * wrote, each of them holds. */
#ifndef GTC_ASSERT
#define GTC_ASSERT(claim) ((void)0)
#endif

/* A compiler warns where a status is not looked at. */
#if defined(__GNUC__) || defined(__clang__)
#define GTC_MUST_CHECK __attribute__((warn_unused_result))
#else
#define GTC_MUST_CHECK
#endif

#if (GTC_MAX_SLOPE_BLOCKS < 2) || (GTC_MAX_SLOPE_BLOCKS > 32)
#error "GTC_MAX_SLOPE_BLOCKS must lie in 2 ... 32 (one bit of a 32-bit word each)"
#endif
#if (GTC_MAX_TERMS < 0) || (GTC_MAX_TERMS > 8)
#error "GTC_MAX_TERMS must lie in 0 ... 8"
#endif

#if GTC_WITH_REZERO && !GTC_WITH_UNCERTAINTY
#error "GTC_WITH_REZERO needs GTC_WITH_UNCERTAINTY"
#endif
#if (GTC_MAX_TERMS == 0) && (GTC_WITH_MEMORY || GTC_WITH_PLAY || GTC_WITH_WARM_UP || GTC_WITH_HARMONIC || GTC_WITH_CHANNELS)
#error "kinds of terms need GTC_MAX_TERMS"
#endif

#endif /* GTC_CONFIG_H_INCLUDED */
