/* gtc_private_state.h - what a compiler needs to know of the runtime's states, and no user reads or writes.
 *
 * Read by gtc.h alone. Everything here may change at any time.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_PRIVATE_STATE_H_INCLUDED
#define GTC_PRIVATE_STATE_H_INCLUDED

#include "gtc.h"

#if GTC_WITH_F32
/* State of one channel of a table: temperature or auxiliary. */
typedef struct {
    uint_least32_t next_gap_us;  /* from the last accepted reading to the next sample; 0: none was accepted */
    uint_least32_t series_us;    /* since the first of the readings that agree and do not follow it */
    uint_least32_t candidate_us; /* since the last of these; 2^32 - 1: there is none */
    uint_least32_t same_us;      /* for how long the reading has been the same */
    uint_least32_t received;     /* last reading, its bits */
    uint_least32_t valid;        /* accepted readings of the running block */
    uint_least32_t held_blocks;  /* blocks in a row with too few of them */
#if GTC_WITH_CHANNELS
    uint_least32_t clamped; /* whether any was taken as the edge of its range */
#endif
    float max_change; /* largest that follows: between readings of one period */
    float last;      /* last accepted reading */
    float candidate; /* last reading that does not follow it */
    float base;      /* first accepted reading of the block */
    float mean;      /* of the last block with enough of them, or what stands for it */
    float sum;       /* of differences from base */
} gtc_f32_input_t;

#if GTC_WITH_UNCERTAINTY
/* What the uncertainty of a correction is computed from. */
typedef struct {
    float input[2];             /* of the map: C, C/block */
    float slope;                /* as far as it is known, C/block */
    float first_temp;           /* sample with which the front end began, C */
    uint_least32_t slope_known; /* 0: there was no correction yet, 1: nothing is known of the slope, 2: `slope` is */
    uint_least32_t missing;     /* samples of the block that the correction was made of */
#if GTC_WITH_TERMS
    float lowest;               /* lowest ... */
    float highest;              /* ... and highest temperature that the terms saw since they began, C */
    float edge_effect;          /* what terms add of readings at the edge of their range, less their fallback */
    uint_least32_t terms_since; /* blocks since init when the terms began */
    uint_least32_t terms_known; /* one bit a term: its memory was retained, or its channel is read */
#endif
} gtc_f32_uncertainty_t;
#endif

/* State of one table, owned by the caller. Contents are private; copying it copies the state. */
struct gtc_f32_state {
    uint_least32_t table_crc; /* of the table that it was started for */
    uint_least32_t period_us;
    uint_least32_t samples_per_block; /* 0: never started */
    uint_least32_t position;          /* samples of the running block so far */
    uint_least32_t filled;            /* blocks in the window since the last restart */
    uint_least32_t window_valid;      /* bit `age`: 1 if the block of window[age] had enough readings */
    int_least32_t status;             /* of the correction in force */
    float bias;                       /* in force, deg/h */
    uint_least32_t phase_us;          /* time of the last call less its slot on the grid, modulo 2^32: may be negative */
    uint_least32_t repeated;          /* calls in a row that fell into a slot already taken */
#if GTC_WITH_TERMS
    uint_least32_t elapsed;    /* blocks since init */
    uint_least32_t off_blocks; /* blocks without power before it */
#endif
#if GTC_WITH_REZERO
    float unshifted;   /* correction without the shift */
    float shift;       /* of the constant: gtc_f32_rezero() */
    float shift_sigma; /* 1 sigma of the constant with it */
#endif
#if GTC_WITH_UNCERTAINTY
    gtc_f32_uncertainty_t uncertainty;
#endif
    float window[GTC_MAX_SLOPE_BLOCKS]; /* [age]: block mean; age 0 is the newest */
#if GTC_WITH_RETAINED
    float term[GTC_MAX_TERMS][2]; /* states of the terms */
#endif
    gtc_f32_input_t input[GTC_MAX_CHANNELS]; /* temperature, auxiliary channels */
};
#endif

#if GTC_WITH_Q31
/* State of one channel of a table: temperature or auxiliary. */
typedef struct {
    uint_least32_t next_gap_us;  /* from the last accepted reading to the next sample; 0: none was accepted */
    uint_least32_t series_us;    /* since the first of the readings that agree and do not follow it */
    uint_least32_t candidate_us; /* since the last of these; 2^32 - 1: there is none */
    uint_least32_t same_us;      /* for how long the reading has been the same */
    uint_least32_t received;     /* last reading, its bits */
    uint_least32_t valid;        /* accepted readings of the running block */
    uint_least32_t held_blocks;  /* blocks in a row with too few of them */
#if GTC_WITH_CHANNELS
    uint_least32_t clamped; /* whether any was taken as the edge of its range */
#endif
    uint_least32_t max_change; /* largest that follows: between readings of one period; all in 2^-16 of the unit */
    int_least32_t last;      /* last accepted reading */
    int_least32_t candidate; /* last reading that does not follow it */
    int_least32_t base;      /* first accepted reading of the block */
    int_least32_t mean;      /* of the last block with enough of them, or what stands for it */
    int_least64_t sum;       /* of differences from base */
} gtc_q31_input_t;

#if GTC_WITH_UNCERTAINTY
/* What the uncertainty of a correction is computed from. */
typedef struct {
    int_least32_t input[2];     /* of the map: C, C/block */
    int_least32_t slope;        /* as far as it is known, C/block */
    int_least32_t first_temp;   /* sample with which the front end began, C */
    uint_least32_t slope_known; /* 0: there was no correction yet, 1: nothing is known of the slope, 2: `slope` is */
    uint_least32_t missing;     /* samples of the block that the correction was made of */
#if GTC_WITH_TERMS
    int_least32_t lowest;       /* lowest ... */
    int_least32_t highest;      /* ... and highest temperature that the terms saw since they began, C */
    int_least32_t edge_effect;  /* what terms add of readings at the edge of their range, less their fallback */
    uint_least32_t terms_since; /* blocks since init when the terms began */
    uint_least32_t terms_known; /* one bit a term: its memory was retained, or its channel is read */
#endif
} gtc_q31_uncertainty_t;
#endif

/* State of one table, owned by the caller. Contents are private; copying it copies the state. */
struct gtc_q31_state {
    uint_least32_t table_crc; /* of the table that it was started for */
    uint_least32_t period_us;
    uint_least32_t samples_per_block; /* 0: never started */
    uint_least32_t position;          /* samples of the running block so far */
    uint_least32_t filled;            /* blocks in the window since the last restart */
    uint_least32_t window_valid;      /* bit `age`: 1 if the block of window[age] had enough readings */
    int_least32_t status;             /* of the correction in force */
    int_least32_t bias;               /* in force, 2^-bias_frac_bits deg/h */
    uint_least32_t phase_us;          /* time of the last call less its slot on the grid, modulo 2^32: may be negative */
    uint_least32_t repeated;          /* calls in a row that fell into a slot already taken */
#if GTC_WITH_TERMS
    uint_least32_t elapsed;    /* blocks since init */
    uint_least32_t off_blocks; /* blocks without power before it */
#endif
#if GTC_WITH_REZERO
    int_least32_t unshifted;   /* correction without the shift */
    int_least32_t shift;       /* of the constant: gtc_q31_rezero() */
    int_least32_t shift_sigma; /* 1 sigma of the constant with it */
#endif
#if GTC_WITH_UNCERTAINTY
    gtc_q31_uncertainty_t uncertainty;
#endif
    int_least32_t window[GTC_MAX_SLOPE_BLOCKS]; /* [age]: block mean; age 0 is the newest */
#if GTC_WITH_RETAINED
    int_least32_t term[GTC_MAX_TERMS][2]; /* states of the terms */
#endif
    gtc_q31_input_t input[GTC_MAX_CHANNELS]; /* temperature, auxiliary channels */
};
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* For tests: the static map without terms at a temperature and a slope (C per block), within the authority. Stateless.
 * Returns 0, GTC_CLAMPED, GTC_UNCOVERED, or GTC_E_ARG. */
#if GTC_WITH_F32
int gtc_f32_map(const gtc_f32_table_t *table, float temp, float slope, float *bias);
#endif
#if GTC_WITH_Q31
int gtc_q31_map(const gtc_q31_table_t *table, int_least32_t temp, int_least32_t slope, int_least32_t *bias);
#endif

#ifdef __cplusplus
}
#endif

#endif /* GTC_PRIVATE_STATE_H_INCLUDED */
