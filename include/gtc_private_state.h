/* gtc_private_state.h - what a compiler needs to know of the runtime's states, and no user reads or writes.
 *
 * Read by gtc.h alone. Everything here may change at any time.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_PRIVATE_STATE_H_INCLUDED
#define GTC_PRIVATE_STATE_H_INCLUDED

#include "gtc_table.h"

/* The options that set the size of structs are part of every linked name (gtc_f32_init is
 * gtc_f32_init_20blocks_4terms to the linker), so that units which were compiled with different ones do not
 * link: "undefined reference to gtc_f32_init_20blocks_1terms" says what the unit was compiled with.
 * MISRA 20.10: a name is made of the options. */
#define GTC_LINKED_AS(name, b, t) name##_##b##blocks_##t##terms
#define GTC_LINKED_WITH(name, b, t) GTC_LINKED_AS(name, b, t)
#define GTC_LINKED(name) GTC_LINKED_WITH(name, GTC_MAX_SLOPE_BLOCKS, GTC_MAX_TERMS)
#define gtc_f32_check GTC_LINKED(gtc_f32_check)
#define gtc_f32_open GTC_LINKED(gtc_f32_open)
#define gtc_f32_map GTC_LINKED(gtc_f32_map)
#define gtc_f32_init GTC_LINKED(gtc_f32_init)
#define gtc_f32_sample GTC_LINKED(gtc_f32_sample)
#define gtc_f32_sample_at GTC_LINKED(gtc_f32_sample_at)
#define gtc_f32_missed GTC_LINKED(gtc_f32_missed)
#define gtc_f32_bias GTC_LINKED(gtc_f32_bias)
#define gtc_f32_snapshot GTC_LINKED(gtc_f32_snapshot)
#define gtc_f32_rezero GTC_LINKED(gtc_f32_rezero)
#define gtc_f32_unzero GTC_LINKED(gtc_f32_unzero)
#define gtc_f32_save GTC_LINKED(gtc_f32_save)
#define gtc_f32_restore GTC_LINKED(gtc_f32_restore)
#define gtc_f32_term_memory GTC_LINKED(gtc_f32_term_memory)
#define gtc_f32_term_play GTC_LINKED(gtc_f32_term_play)
#define gtc_f32_term_warm_up GTC_LINKED(gtc_f32_term_warm_up)
#define gtc_f32_term_harmonic GTC_LINKED(gtc_f32_term_harmonic)
#define gtc_f32_term_auxiliary GTC_LINKED(gtc_f32_term_auxiliary)
#define gtc_f32_term_curve GTC_LINKED(gtc_f32_term_curve)
#define gtc_f32_term_product GTC_LINKED(gtc_f32_term_product)
#define gtc_q31_check GTC_LINKED(gtc_q31_check)
#define gtc_q31_open GTC_LINKED(gtc_q31_open)
#define gtc_q31_map GTC_LINKED(gtc_q31_map)
#define gtc_q31_init GTC_LINKED(gtc_q31_init)
#define gtc_q31_sample GTC_LINKED(gtc_q31_sample)
#define gtc_q31_sample_at GTC_LINKED(gtc_q31_sample_at)
#define gtc_q31_missed GTC_LINKED(gtc_q31_missed)
#define gtc_q31_bias GTC_LINKED(gtc_q31_bias)
#define gtc_q31_snapshot GTC_LINKED(gtc_q31_snapshot)
#define gtc_q31_rezero GTC_LINKED(gtc_q31_rezero)
#define gtc_q31_unzero GTC_LINKED(gtc_q31_unzero)
#define gtc_q31_save GTC_LINKED(gtc_q31_save)
#define gtc_q31_restore GTC_LINKED(gtc_q31_restore)
#define gtc_q31_term_memory GTC_LINKED(gtc_q31_term_memory)
#define gtc_q31_term_play GTC_LINKED(gtc_q31_term_play)
#define gtc_q31_term_warm_up GTC_LINKED(gtc_q31_term_warm_up)
#define gtc_q31_term_harmonic GTC_LINKED(gtc_q31_term_harmonic)
#define gtc_q31_term_auxiliary GTC_LINKED(gtc_q31_term_auxiliary)
#define gtc_q31_term_curve GTC_LINKED(gtc_q31_term_curve)
#define gtc_q31_term_product GTC_LINKED(gtc_q31_term_product)

/* What the uncertainty of a correction goes by; part of a state, as private. */
typedef struct {
    float at[2];           /* where the map was asked: C, C/block */
    float drift;           /* slope as far as it is known, C/block */
    float start;           /* sample with which the front end began, C */
    float low;             /* lowest ... */
    float high;            /* ... and highest temperature that the terms saw since they began, C */
    float plain;           /* correction without the shift, deg/h */
    float edge;            /* what terms add of readings at the edge of their range, beyond their stand-ins, deg/h */
    uint_least32_t begun;  /* blocks since init when the terms began */
    uint_least32_t known;  /* one bit a term: it went on from where it was, or its channel is read */
    uint_least32_t sure;   /* 0: there was no correction yet, 1: nothing is known of the slope, 2: drift is known */
} gtc_f32_doubt_t;

typedef struct {
    int_least32_t at[2];
    int_least32_t drift;
    int_least32_t start;
    int_least32_t low;
    int_least32_t high;
    int_least32_t plain;
    int_least32_t edge;
    uint_least32_t begun;
    uint_least32_t known;
    uint_least32_t sure;
} gtc_q31_doubt_t;

/* State of one channel of a table: temperature or auxiliary. */
typedef struct {
    uint_least32_t gap_us;      /* since the last believed reading; 0: none was */
    uint_least32_t agreed_us;   /* for how long readings agree that do not follow it */
    uint_least32_t same_us;     /* for how long the reading has been the same */
    uint_least32_t received;    /* last reading, its bits */
    uint_least32_t valid;       /* believed readings of the running block */
    uint_least32_t held_blocks; /* blocks in a row with too few of them */
    uint_least32_t clamped;     /* whether any was taken as the edge of its range */
    float near;                 /* limit of a change between samples */
    float last;                 /* last believed reading */
    float candidate;            /* last one that does not follow it */
    float base;                 /* first believed reading of the block */
    float mean;                 /* of the last block with enough of them, or what stands for it */
    float sum;                  /* of differences from base */
} gtc_f32_input_t;

typedef struct {
    uint_least32_t gap_us;
    uint_least32_t agreed_us;
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
    uint_least32_t is_stamped;     /* 1: a sample with a time came, and ... */
    uint_least32_t time_us;        /* ... this is the last one's, on the grid of sample periods */
    uint_least32_t unused;         /* samples in a row whose time had not moved on */
    float shift;                   /* of the constant, deg/h: gtc_f32_rezero() */
    float constant;                /* 1 sigma of the constant with it, deg/h */
    gtc_f32_doubt_t doubt;
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
    uint_least32_t is_stamped;
    uint_least32_t time_us;
    uint_least32_t unused;
    int_least32_t shift;
    int_least32_t constant;
    gtc_q31_doubt_t doubt;
    int_least32_t window[GTC_MAX_SLOPE_BLOCKS]; /* 2^-16 C */
    int_least32_t term[GTC_TERM_SLOTS][2];
    gtc_q31_input_t input[GTC_MAX_TERMS + 1];
} gtc_q31_state_t;

#endif /* GTC_PRIVATE_STATE_H_INCLUDED */
