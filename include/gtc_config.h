/* gtc_config.h - every option of the gyrotc runtime, with its default and the reason for it.
 *
 * To change one, define it on the compiler's command line, or name a header of your own in
 * GTC_CONFIG_HEADER (for example -DGTC_CONFIG_HEADER='"my_gtc.h"'); it is read first. All
 * translation units of one program must see the same options: they set the size of the state.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_CONFIG_H_INCLUDED
#define GTC_CONFIG_H_INCLUDED

#ifdef GTC_CONFIG_HEADER
#include GTC_CONFIG_HEADER
#endif

/* Longest slope window in blocks. 20 blocks of 10 s are 200 s, the longest window that `fit`
 * chooses. Each block costs one number of RAM in the state; a table that needs more is refused. */
#ifndef GTC_MAX_SLOPE_BLOCKS
#define GTC_MAX_SLOPE_BLOCKS 20
#endif

/* Most extension terms of one table, and most auxiliary channels. Diagnosis ships at most three causes; four leaves
 * room for one that is known beforehand. Each costs 64 bytes of RAM in the state; 0 leaves the code of terms and
 * channels out. */
#ifndef GTC_MAX_TERMS
#define GTC_MAX_TERMS 4
#endif

/* 1: a table may hold several networks, chosen by temperature and slope (a model bank).
 * 0: such a table is refused, and the code of the hand-over is not compiled. One network over the
 * whole envelope is the default of the generator, hence 0. */
#ifndef GTC_WITH_BANK
#define GTC_WITH_BANK 0
#endif

/* 1: gtc_<n>_open() accepts images that carry extension terms, which links every term's code.
 * 0: such an image is refused. A table compiled in links only the terms that it names, always. */
#ifndef GTC_OPEN_TERMS
#define GTC_OPEN_TERMS 0
#endif

/* Parts of the runtime: 1 is there, 0 is not compiled, and a table that needs it is refused. `gyrotc emit` writes a
 * gtc_config.h with what a table needs, and what each of them costs. */

/* The uncertainty of a correction: gtc_<n>_snapshot(), gtc_<n>_rezero(). Without it a table's words of it are not read. */
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

/* Known answers of a table in gtc_<n>_check(). Without it those of a table are not asked. */
#ifndef GTC_WITH_PROBES
#define GTC_WITH_PROBES 1
#endif

/* gtc_<n>_open(). */
#ifndef GTC_WITH_IMAGE
#define GTC_WITH_IMAGE 1
#endif

/* gtc_<n>_save() and gtc_<n>_restore(). */
#ifndef GTC_WITH_SAVE
#define GTC_WITH_SAVE 1
#endif

/* Any time in gtc_<n>_sample(). 0: only the sample period, GTC_E_ARG for another time; NULL is then one missed sample. */
#ifndef GTC_WITH_TIME
#define GTC_WITH_TIME 1
#endif

/* 1: multiply 32 x 32 -> 64 bits in 16-bit halves. The bits are the same; it is faster on cores
 * without a long multiply (Cortex-M0, AVR) and slower on all others. */
#ifndef GTC_HALF_MULTIPLY
#if defined(__AVR__) || defined(__ARM_ARCH_6M__)
#define GTC_HALF_MULTIPLY 1
#else
#define GTC_HALF_MULTIPLY 0
#endif
#endif

/* Fraction bits of a bias in fixed point that this firmware decodes: GTC_<ID>_Q31_BIAS_FRAC_BITS of the emitted header.
 * Where it is defined, gtc_q31_check() and gtc_q31_open() refuse a table in another unit. Else each table has its own. */
#ifdef GTC_BIAS_FRAC_BITS
#define GTC_FRAC_BITS_LEAST GTC_BIAS_FRAC_BITS
#define GTC_FRAC_BITS_MOST GTC_BIAS_FRAC_BITS
#else
#define GTC_FRAC_BITS_LEAST 0
#define GTC_FRAC_BITS_MOST 60
#endif

/* What an assertion of a precondition or of a number's range becomes; a test build gives it an abort(). The default is
 * nothing: with a table that gtc_<n>_check() or gtc_<n>_open() accepted, and a state that only the functions wrote, each
 * of them holds. */
#ifndef GTC_ASSERT
#define GTC_ASSERT(claim) ((void)0)
#endif

/* 1: two Gaussians in each turn of the loop of the fixed-point map. The bits are the same; it takes
 * 6 % fewer instructions and 90 bytes more. The default follows the compiler's -Os. */
#ifndef GTC_UNROLL
#if defined(__OPTIMIZE_SIZE__) || GTC_HALF_MULTIPLY
#define GTC_UNROLL 0
#else
#define GTC_UNROLL 1
#endif
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

/* Places for terms in tables and states: C has no arrays without any. */
#define GTC_TERM_SLOTS ((GTC_MAX_TERMS > 0) ? GTC_MAX_TERMS : 1)

#endif /* GTC_CONFIG_H_INCLUDED */
