/* gtc_private.h - what the parts of the runtime share and no user sees.
 *
 * Nothing here is part of the interface; it may change at any time.
 *
 * MISRA 15.5 throughout: wrong arguments, and cases that end early, leave a function at once; what
 * follows need not be indented for them.
 * MISRA 5.9 throughout: the two arithmetics are one text, so that their functions have the same names.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_PRIVATE_H_INCLUDED
#define GTC_PRIVATE_H_INCLUDED

#include "gtc.h"

#if GTC_TABLE_LAYOUT != 3
#error "these sources read table layout 3: gtc.h is of another version"
#endif

/* First of the two edges of an input. */
#define ENVELOPE_TEMP 0U
#define ENVELOPE_SLOPE 2U

/* Words of a network. */
#define NETWORK_CENTERS 0U
#define NETWORK_CONSTANT 1U
#define NETWORK_TEMP 2U
#define NETWORK_SLOPE 3U
#if GTC_WITH_BANK || GTC_WITH_IMAGE
#define NETWORK_REGION_TEMP 4U
#define NETWORK_REGION_SLOPE 6U
#endif

/* Words of a center: a pair for T, a pair for the slope, the weight. */
#define CENTER_TEMP 0U
#define CENTER_SLOPE 2U
#define CENTER_WEIGHT 4U

#if GTC_WITH_TERMS
/* Words of a term. */
#define TERM_KIND 0U
#define TERM_CHANNEL 1U
#define TERM_PARAMETERS 2U

#if GTC_WITH_MEMORY
/* Parameters of memory terms. */
#define MEMORY_GAIN 0U
#define MEMORY_AMPLITUDE 1U
#define MEMORY_RATE 2U
#endif
#if GTC_WITH_PLAY
/* Parameters of play terms. */
#define PLAY_WIDTH 0U
#define PLAY_AMPLITUDE 1U
#define PLAY_GROWTH 2U
#define PLAY_REFERENCE_TEMP 3U
#endif
#if GTC_WITH_WARM_UP
/* Parameters of warm-up terms. */
#define WARM_UP_GAIN 0U
#define WARM_UP_AMPLITUDE 1U
#endif
#if GTC_WITH_HARMONIC
/* Parameters of harmonic terms. */
#define HARMONIC_FREQUENCY 0U
#define HARMONIC_PHASE 1U
#define HARMONIC_AMPLITUDE 2U
#endif
#if GTC_WITH_AUXILIARY
/* Parameters of auxiliary terms. */
#define AUXILIARY_SLOPE 0U
#define AUXILIARY_REFERENCE 1U
#endif
#if GTC_WITH_CURVE
/* Parameters of curve terms. */
#define CURVE_SLOPE 0U
#define CURVE_GAIN 1U
#define CURVE_REFERENCE 2U
#endif
#if GTC_WITH_PRODUCT
/* Parameters of product terms. */
#define PRODUCT_SLOPE 0U
#define PRODUCT_REFERENCE 1U
#define PRODUCT_GROWTH 2U
#define PRODUCT_REFERENCE_TEMP 3U
#endif
#endif

#if GTC_WITH_PROBES
/* Words of a known answer. */
#define PROBE_TEMP 0U
#define PROBE_SLOPE 1U
#define PROBE_BIAS 2U
#define PROBE_STATUS 3U
#endif

#if GTC_WITH_TERMS
/* Kinds of terms that read an auxiliary channel, one bit a kind. */
#define CHANNEL_KINDS \
    (GTC_PART_TERM(GTC_TERM_AUXILIARY) | GTC_PART_TERM(GTC_TERM_CURVE) | GTC_PART_TERM(GTC_TERM_PRODUCT))
#endif

/* Words of a guard. */
#define GUARD_LOW 0U
#define GUARD_HIGH 1U
#define GUARD_STEP 2U
#define GUARD_RATE 3U
#define GUARD_AGREE 4U
#define GUARD_STUCK 5U
#define GUARD_MISSING 6U
#if GTC_WITH_CHANNELS || GTC_WITH_IMAGE
#define GUARD_FALLBACK 7U
#endif

#if GTC_WITH_CHANNELS
/* Of the readings that were taken as the edge of their range: in the running block, in the mean. */
#define CLAMPED_NOW 1U
#define CLAMPED_MEAN 2U
#endif

#endif /* GTC_PRIVATE_H_INCLUDED */
