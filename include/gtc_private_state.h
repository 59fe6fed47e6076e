/* gtc_private_state.h - what a compiler needs to know of the runtime's states, and no user reads or writes.
 *
 * Read by gtc.h alone. Everything here may change at any time.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_PRIVATE_STATE_H_INCLUDED
#define GTC_PRIVATE_STATE_H_INCLUDED

#include "gtc_table.h"

/* The options that set the size of a state are part of the linked name of what starts one (gtc_f32_init is
 * gtc_f32_init_20blocks_4terms to the linker), so that units which were compiled with different ones do not
 * link: "undefined reference to gtc_f32_init_20blocks_1terms" says what the unit was compiled with.
 * MISRA 20.10: a name is made of the options. */
#if GTC_WITH_UNCERTAINTY
#define GTC_LINKED_AS(name, b, t) name##_##b##blocks_##t##terms
#else
#define GTC_LINKED_AS(name, b, t) name##_##b##blocks_##t##terms_plain
#endif
#define GTC_LINKED_WITH(name, b, t) GTC_LINKED_AS(name, b, t)
#define GTC_LINKED(name) GTC_LINKED_WITH(name, GTC_MAX_SLOPE_BLOCKS, GTC_MAX_TERMS)
#define gtc_f32_init GTC_LINKED(gtc_f32_init)
#define gtc_q31_init GTC_LINKED(gtc_q31_init)
#define gtc_f32_restore GTC_LINKED(gtc_f32_restore)
#define gtc_q31_restore GTC_LINKED(gtc_q31_restore)

#if GTC_WITH_UNCERTAINTY
/* What the uncertainty of a correction is computed from. */
typedef struct {
    float input[2];             /* of the map: C, C/block */
    float slope;                /* as far as it is known, C/block */
    float first_temp;           /* sample with which the front end began, C */
    float lowest;               /* lowest ... */
    float highest;              /* ... and highest temperature that the terms saw since they began, C */
    float unshifted;            /* correction without the re-zero, deg/h */
    float edge_effect;          /* what terms add of readings at the edge of their range, less their fallback, deg/h */
    uint_least32_t terms_since; /* blocks since init when the terms began */
    uint_least32_t terms_known; /* one bit a term: its memory was retained, or its channel is read */
    uint_least32_t slope_known; /* 0: there was no correction yet, 1: nothing is known of the slope, 2: `slope` is */
    uint_least32_t missing;     /* samples of the block that the correction was made of */
} gtc_f32_uncertainty_t;

typedef struct {
    int_least32_t input[2];
    int_least32_t slope;
    int_least32_t first_temp;
    int_least32_t lowest;
    int_least32_t highest;
    int_least32_t unshifted;
    int_least32_t edge_effect;
    uint_least32_t terms_since;
    uint_least32_t terms_known;
    uint_least32_t slope_known;
    uint_least32_t missing;
} gtc_q31_uncertainty_t;
#endif

/* State of one channel of a table: temperature or auxiliary. */
typedef struct {
    uint_least32_t gap_us;       /* since the last accepted reading; 0: none was */
    uint_least32_t series_us;    /* since the first of the readings that agree and do not follow it */
    uint_least32_t candidate_us; /* since the last of these; 2^32 - 1: there is none */
    uint_least32_t same_us;      /* for how long the reading has been the same */
    uint_least32_t received;     /* last reading, its bits */
    uint_least32_t valid;        /* accepted readings of the running block */
    uint_least32_t held_blocks;  /* blocks in a row with too few of them */
    uint_least32_t clamped;      /* whether any was taken as the edge of its range */
    float near;                  /* limit of a change between samples */
    float last;                  /* last accepted reading */
    float candidate;             /* last reading that does not follow it */
    float base;                  /* first accepted reading of the block */
    float mean;                  /* of the last block with enough of them, or what stands for it */
    float sum;                   /* of differences from base */
} gtc_f32_input_t;

typedef struct {
    uint_least32_t gap_us;
    uint_least32_t series_us;
    uint_least32_t candidate_us;
    uint_least32_t same_us;
    uint_least32_t received;
    uint_least32_t valid;
    uint_least32_t held_blocks;
    uint_least32_t clamped;
    uint_least32_t near; /* 2^-16 of the channel's unit, as the others */
    int_least32_t last;
    int_least32_t candidate;
    int_least32_t base;
    int_least32_t mean;
    int_least64_t sum;
} gtc_q31_input_t;

/* State of one table, owned by the caller. Contents are private; copying it copies the state. */
typedef struct {
    const gtc_f32_table_t *table;
    uint_least32_t period_us;
    uint_least32_t samples_per_block;
    uint_least32_t position;       /* samples of the running block so far */
    uint_least32_t filled;         /* blocks in the window since the last restart */
    uint_least32_t window_valid;   /* one bit a block, newest lowest */
    int_least32_t status;          /* of the correction in force */
    float bias;                    /* in force, deg/h */
    uint_least32_t elapsed;        /* blocks since init */
    uint_least32_t off_blocks;     /* blocks without power before it */
    uint_least32_t late_us;        /* from the slot of the last sample to the last call, modulo 2^32 */
    uint_least32_t unused;         /* calls in a row whose time had not moved on */
#if GTC_WITH_UNCERTAINTY
    float shift;                   /* of the constant, deg/h: gtc_f32_rezero() */
    float shift_sigma;             /* 1 sigma of the constant with it, deg/h */
    gtc_f32_uncertainty_t uncertainty;
#endif
    float window[GTC_MAX_SLOPE_BLOCKS];        /* block means, newest first, C */
    float term[GTC_TERM_SLOTS][2];              /* states of the terms */
    gtc_f32_input_t input[GTC_MAX_TERMS + 1];  /* temperature, auxiliary channels */
} gtc_f32_state_t;

typedef struct {
    const gtc_q31_table_t *table;
    uint_least32_t period_us;
    uint_least32_t samples_per_block;
    uint_least32_t position;
    uint_least32_t filled;
    uint_least32_t window_valid;
    int_least32_t status;
    int_least32_t bias; /* 2^-bias_frac_bits deg/h */
    uint_least32_t elapsed;
    uint_least32_t off_blocks;
    uint_least32_t late_us;
    uint_least32_t unused;
#if GTC_WITH_UNCERTAINTY
    int_least32_t shift;
    int_least32_t shift_sigma;
    gtc_q31_uncertainty_t uncertainty;
#endif
    int_least32_t window[GTC_MAX_SLOPE_BLOCKS]; /* 2^-16 C */
    int_least32_t term[GTC_TERM_SLOTS][2];
    gtc_q31_input_t input[GTC_MAX_TERMS + 1];
} gtc_q31_state_t;

#ifdef __cplusplus
extern "C" {
#endif

/* For tests: the static map without terms at a temperature and a slope (C per block), within the authority. Stateless.
 * Returns 0, GTC_CLAMPED, GTC_UNCOVERED, or GTC_E_ARG. */
int gtc_f32_map(const gtc_f32_table_t *table, float temp, float slope, float *bias);
int gtc_q31_map(const gtc_q31_table_t *table, int_least32_t temp, int_least32_t slope, int_least32_t *bias);

#ifdef __cplusplus
}
#endif

#endif /* GTC_PRIVATE_STATE_H_INCLUDED */
