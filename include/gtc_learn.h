/* gtc_learn.h - learning in service: a shift of the table's correction from rests of the vehicle, with its uncertainty.
 *
 * Optional: copy gtc_learn.c and gtc_learn.h beside the other files. One state belongs to one axis; its numbers are
 * float32 whatever arithmetic the table has (a rest comes once in minutes). The bias of the gyro is taken as
 *
 *   b(T, t) = table(T, dT/dt) + m(T) + d + e (T - T0) + w exp(-t/tw) + f(T, t)
 *
 * with m on knots over the envelope, kept over power-offs and ageing; d, e, w drawn anew at each power-on; and f a
 * Gaussian process of T (Matern 3/2) that is forgotten in time. A rest is a Kalman update of these 13 states. Between
 * rests nothing is computed: a shift follows from the state of the last one.
 *
 *   boot     gtc_learn_restore() of the kept words, or gtc_learn_start(); then gtc_learn_power_on()
 *   rest     gtc_learn_rest(): the mean rate of a stop, Earth's rate and the table's bias taken off
 *   always   gtc_learn_shift(): compensated = measured - bias - shift
 *   sometimes and at power-off   gtc_learn_save()
 *
 * The shift never leaves the prior's authority, whatever the state holds.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_LEARN_H_INCLUDED
#define GTC_LEARN_H_INCLUDED

#include "gtc.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GTC_LEARN_KNOTS 8U          /* one for each 14 C of an envelope of 100 C */
#define GTC_LEARN_STATES 13U        /* the knots, d, e, w, f, df/dT */
#define GTC_LEARN_DRAWN 4U          /* d, e, w, f: drawn anew at each power-on */
#define GTC_LEARN_KNOT_PAIRS 36U    /* packed rows of a symmetric matrix: (0,0), (1,0), (1,1), (2,0), ... */
#define GTC_LEARN_PAIRS 91U
#define GTC_LEARN_KEPT_WORDS 48U    /* of gtc_learn_save() */

#define GTC_DISAGREES 64 /* rests contradicted what was learned at several power-ons, and were accepted. Report the gyro */

/* What is known of the type of gyro before it learns: constant, written by the generator for one table. */
typedef struct {
    uint_least32_t id;          /* the table's CRC: words of an older one are refused */
    float low_c;                /* knot k lies at low_c + k / knots_per_c */
    float knots_per_c;          /* 1/C */
    float reference_c;          /* T0 */
    float authority_dph;        /* |shift| is at most this, and each knot's */
    float power_on_var[GTC_LEARN_DRAWN]; /* variances of d, e, w, f at power-on, (deg/h)^2, of e per C^2 */
    float memory_per_c;         /* sqrt(3) / length of f along T, 1/C */
    float memory_per_s;         /* 1 / time in which f is forgotten, 1/s */
    float warm_up_per_s;        /* 1 / tw, 1/s */
    float off_s;                /* time without power where the caller knows none, s */
    float noise_var;            /* variance of a mean over 1 s of rest, (deg/h)^2 */
    float noise_ratio;          /* a measured variance of the mean may be this many times what noise_var says */
    float span_c;               /* T may change by this in a rest, C */
    float settle_s;             /* rests before this time since power-on are refused */
    float gate_square;          /* innovations are accepted up to this many variances, */
    float jump_square;          /* up to this many as a new offset; equal: none are */
    uint_least32_t agreeing_rests;     /* so many refused rests that agree are accepted as a new level of the knots, */
    uint_least32_t agreeing_power_ons; /* if so many power-ons lie between the first and the last of them */
    float map_var[GTC_LEARN_KNOT_PAIRS];    /* covariance of the knots, (deg/h)^2 */
    float ageing_var[GTC_LEARN_KNOT_PAIRS]; /* what it gains each second */
} gtc_learn_prior_t;

/* The state of an axis: 444 bytes. */
typedef struct {
    float x[GTC_LEARN_STATES];
    float p[GTC_LEARN_PAIRS];    /* covariance of x, packed rows; of f and df/dT less that of power-on */
    float time_s;                /* of the last rest, since power-on */
    float temp_c;
    float refused_dph;           /* innovation of the last refused rest; 0: one was accepted since */
    float service_s;             /* time in service, with and without power */
    uint_least32_t power_ons;
    uint_least32_t since_refused; /* power-ons since the first of the refused rests that agree */
    uint_least32_t refused;       /* how many agree */
} gtc_learn_state_t;

/* A stop of the vehicle. */
typedef struct {
    float time_s;       /* end of it, since power-on */
    float temp_c;       /* mean temperature */
    float span_c;       /* largest less smallest temperature */
    float rate_dph;     /* mean rate less Earth's rate less the table's bias */
    float duration_s;
    float mean_var;     /* variance of the mean as the samples scatter, (deg/h)^2; 0: not known */
    float earth_var;    /* variance of the Earth rate that was taken off, (deg/h)^2; NaN: not known, the rest is refused */
    int_least32_t confirmed; /* not 0: other sensors, too, say that the vehicle stands: a jump of any size is accepted */
} gtc_learn_stop_t;

/* What is to be added to the table's bias, and 1 sigma of what is then wrong. */
typedef struct {
    float dph;
    float sigma_dph;
} gtc_learn_shift_t;

/* A gyro that has learned nothing. Returns 0 or GTC_E_ARG. */
GTC_MUST_CHECK int gtc_learn_start(gtc_learn_state_t *state, const gtc_learn_prior_t *prior);

/* After each switching on. off_s: time without power; NaN: not known. temp_c: -90 ... 200 C.
 * Returns 0 or GTC_E_ARG. */
GTC_MUST_CHECK int gtc_learn_power_on(gtc_learn_state_t *state, const gtc_learn_prior_t *prior, float off_s,
                                      float temp_c);

/* Learns from a rest. Returns 0, GTC_DISAGREES, GTC_E_REST (refused: too early, temperature or scatter too large, Earth's
 * rate not known, beyond the authority, beyond the gate, or a member is no number; nothing is learned) or GTC_E_ARG.
 * Cost: 2,670 instructions on a Cortex-M4F at -O2, 2,940 at -Os. */
GTC_MUST_CHECK int gtc_learn_rest(gtc_learn_state_t *state, const gtc_learn_prior_t *prior,
                                  const gtc_learn_stop_t *stop);

/* The shift at an instant and a temperature of -90 ... 200 C, the same until the next rest. Sigma is at most that of a
 * gyro at power-on that has aged as long and learned nothing (between two knots the weighted mean of their variances).
 * Returns 0 or GTC_E_ARG. */
GTC_MUST_CHECK int gtc_learn_shift(const gtc_learn_state_t *state, const gtc_learn_prior_t *prior, float time_s,
                                   float temp_c, gtc_learn_shift_t *shift);

/* What is kept over power-off, with the table's id and a CRC. Keep two copies: a torn one is refused.
 * Returns 0 or GTC_E_ARG. */
GTC_MUST_CHECK int gtc_learn_save(const gtc_learn_state_t *state, const gtc_learn_prior_t *prior,
                                  gtc_word_t words[GTC_LEARN_KEPT_WORDS]);

/* Takes it back. Returns 0, GTC_E_ARG, GTC_E_IMAGE (torn, or not of numbers) or GTC_E_ID (another table's). Nothing is
 * written then. */
GTC_MUST_CHECK int gtc_learn_restore(gtc_learn_state_t *state, const gtc_learn_prior_t *prior,
                                     const gtc_word_t words[GTC_LEARN_KEPT_WORDS]);

#ifdef __cplusplus
}
#endif

#endif
