/* gtc_private.h - what the parts of the runtime share and no user sees.
 *
 * Nothing here is part of the interface; it may change at any time.
 *
 * No C library is needed, not even the functions that a compiler calls of its own accord: structs are neither
 * copied nor cleared as a whole, and loops that a compiler would make into memset(), memcpy() or memmove() go
 * through pointers to volatile, which forbid it.
 *
 * MISRA 15.5 throughout: wrong arguments, and cases that end early, leave a function at once; what
 * follows need not be indented for them.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_PRIVATE_H_INCLUDED
#define GTC_PRIVATE_H_INCLUDED

#include <stddef.h>

#include "gtc.h"

/* A product and a sum stay two roundings whatever flags a build has. GCC knows the standard's pragma not in C, clang has
 * no other; a compiler that keeps to neither is found by gtc_f32_check(). */
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("fp-contract=off")
#else
#pragma STDC FP_CONTRACT OFF
#endif

#if GTC_TABLE_LAYOUT != 2
#error "these sources read table layout 2: include/ and libc/ are of different versions"
#endif

/* For what stands in the loop over the centers, and the map itself. Where a product is one instruction, a call costs more
 * than it, in time and in code; but a compiler for size makes calls of whatever has two callers. */
#if defined(__GNUC__) && defined(__OPTIMIZE__) && !GTC_HALF_MULTIPLY
#define GTC_IN_LOOP static inline __attribute__((always_inline))
#else
#define GTC_IN_LOOP static inline
#endif

/* CRC-32 (polynomial 0xEDB88320), before the final inversion. */
#define GTC_CRC_START 0xFFFFFFFFUL
#define GTC_CRC_FINAL 0xFFFFFFFFUL

/* Takes one 32-bit word into a running CRC-32, as four octets, least significant first. */
uint_least32_t gtc_crc_word(uint_least32_t crc, uint_least32_t word);

/* The same for n words of a table; n may be 0. */
uint_least32_t gtc_crc_words(uint_least32_t crc, const gtc_word_t *words, uint_least32_t n);

/* Parts of a table's scale: in float32 the center of T and the gains; in fixed point the gains, and bits by which squares
 * are in larger units. */
#define SCALE_CENTER 0U
#define SCALE_NARROW 2U

/* First of the two edges of an input. */
#define ENVELOPE_TEMP 0U
#define ENVELOPE_SLOPE 2U

/* Words of a network. */
#define NETWORK_CENTERS 0U
#define NETWORK_CONSTANT 1U
#define NETWORK_TEMP 2U
#define NETWORK_SLOPE 3U
#define NETWORK_REGION_TEMP 4U
#define NETWORK_REGION_SLOPE 6U

/* Words of a center; in fixed point the factor and the addend of an argument. */
#define CENTER_TEMP 0U
#define CENTER_TEMP_GAIN 1U
#define CENTER_SLOPE 2U
#define CENTER_SLOPE_GAIN 3U
#define CENTER_WEIGHT 4U

/* Words of a term. */
#define TERM_KIND 0U
#define TERM_CHANNEL 1U
#define TERM_PARAMETERS 2U

/* Parameters of the kinds of terms. */
#define MEMORY_GAIN 0U
#define MEMORY_AMPLITUDE 1U
#define MEMORY_RATE 2U
#define PLAY_WIDTH 0U
#define PLAY_AMPLITUDE 1U
#define PLAY_GROWTH 2U
#define PLAY_REFERENCE_TEMP 3U
#define WARM_UP_GAIN 0U
#define WARM_UP_AMPLITUDE 1U
#define HARMONIC_FREQUENCY 0U
#define HARMONIC_PHASE 1U
#define HARMONIC_AMPLITUDE 2U
#define AUXILIARY_SLOPE 0U
#define AUXILIARY_REFERENCE 1U
#define CURVE_SLOPE 0U
#define CURVE_GAIN 1U
#define CURVE_REFERENCE 2U
#define PRODUCT_SLOPE 0U
#define PRODUCT_REFERENCE 1U
#define PRODUCT_GROWTH 2U
#define PRODUCT_REFERENCE_TEMP 3U

/* Words of a known answer. */
#define PROBE_TEMP 0U
#define PROBE_SLOPE 1U
#define PROBE_BIAS 2U
#define PROBE_STATUS 3U

/* Whether a kind of term reads an auxiliary channel. */
#define READS_CHANNEL(kind) ((kind) >= GTC_TERM_AUXILIARY)

/* Words of a guard. */
#define GUARD_LOW 0U
#define GUARD_HIGH 1U
#define GUARD_STEP 2U
#define GUARD_RATE 3U
#define GUARD_AGREE 4U
#define GUARD_STUCK 5U
#define GUARD_MISSING 6U
#define GUARD_FALLBACK 7U

/* Of the readings that were taken as the edge of their range: in the running block, in the mean. */
#define CLAMPED_NOW 1U
#define CLAMPED_MEAN 2U

/* What terms make of the inputs and add to the bias. */
typedef struct {
    float temp;
    float slope;
    float added;
    int_least32_t remarks;
    uint_least32_t terms_known; /* as of an uncertainty */
    float edge_effect;          /* as of an uncertainty */
} gtc_f32_effect_t;

typedef struct {
    int_least32_t temp;
    int_least32_t slope;
    int_least64_t added;
    int_least32_t remarks;
    uint_least32_t terms_known;
    int_least32_t edge_effect;
} gtc_q31_effect_t;

/* Functions of one kind of term; i is the number of the term in its table.
 * begin: first accepted temperature x; step: a block ends, of mean temperature x; apply: changes inputs, adds to
 * the bias, at temperature x. All temperatures lie within the envelope. */
struct gtc_f32_term_code {
    uint_least32_t is_retained; /* 1: its state is taken over after a time without power */
    void (*begin)(gtc_f32_state_t *state, uint_least32_t i, float x);
    void (*step)(gtc_f32_state_t *state, uint_least32_t i, float x);
    void (*apply)(const gtc_f32_state_t *state, uint_least32_t i, float x, gtc_f32_effect_t *effect);
};

struct gtc_q31_term_code {
    uint_least32_t is_retained;
    void (*begin)(gtc_q31_state_t *state, uint_least32_t i, int_least32_t x);
    void (*step)(gtc_q31_state_t *state, uint_least32_t i, int_least32_t x);
    void (*apply)(const gtc_q31_state_t *state, uint_least32_t i, int_least32_t x,
                  gtc_q31_effect_t *effect);
};

extern const struct gtc_f32_term_code gtc_f32_term_memory;
extern const struct gtc_f32_term_code gtc_f32_term_play;
extern const struct gtc_f32_term_code gtc_f32_term_warm_up;
extern const struct gtc_f32_term_code gtc_f32_term_harmonic;
extern const struct gtc_f32_term_code gtc_f32_term_auxiliary;
extern const struct gtc_f32_term_code gtc_f32_term_curve;
extern const struct gtc_f32_term_code gtc_f32_term_product;
extern const struct gtc_q31_term_code gtc_q31_term_memory;
extern const struct gtc_q31_term_code gtc_q31_term_play;
extern const struct gtc_q31_term_code gtc_q31_term_warm_up;
extern const struct gtc_q31_term_code gtc_q31_term_harmonic;
extern const struct gtc_q31_term_code gtc_q31_term_auxiliary;
extern const struct gtc_q31_term_code gtc_q31_term_curve;
extern const struct gtc_q31_term_code gtc_q31_term_product;

#endif /* GTC_PRIVATE_H_INCLUDED */
