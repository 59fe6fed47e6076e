/* gtc.h - bias of a gyro from its temperature: the public interface of the gyrotc runtime.
 *
 * `gyrotc emit` writes one constant table for each axis of each gyro serial. The functions below read it and keep
 * their state in a struct of the caller: no heap, no libm, no I/O, no writable static data, no C library. Each
 * function exists in two arithmetics <n>:
 *
 *   f32  float32: temperatures in C, slopes in C per block, biases in deg/h
 *   q31  fixed point: temperatures in 2^-16 C, slopes in 2^-16 C per block, biases in 2^-bias_frac_bits deg/h
 *
 * At boot gtc_<n>_check(), then gtc_<n>_init(). Then for every temperature sample
 *
 *   status = gtc_f32_sample(&state, PERIOD_US, &temp_c);
 *   status = gtc_f32_bias(&state, &bias_dph);    compensated = measured - bias
 *
 * Samples are averaged over blocks of the table's `block_us`. The correction of block n comes from the blocks up to
 * n-1: T is the mean of the last one, dT/dt the least-squares slope over the last `slope_blocks`. The correction is 0
 * with GTC_HELD until readings have agreed (gtc_<n>_sample()), then the map with slope 0 (GTC_WARMING) until the
 * window is full.
 *
 * Concurrency: a table is constant and may be read from anywhere. A state belongs to one task, a gtc_<n>_angle_t
 * (gtc_angle.h) to one task or interrupt; hand the bias from one to the other by an atomic store, a queue or with interrupts off.
 *
 * float32 needs C99 arithmetic (-std=c99 -ffp-contract=off, no -ffast-math), which gtc_f32_check() tests at boot.
 * Fixed point needs no flag.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_H_INCLUDED
#define GTC_H_INCLUDED

#include <stddef.h>

#include "gtc_private_state.h"
#include "gtc_angle.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Semantic version of the functions below. The table layout has a number of its own.
 * MISRA 2.5: for users; the runtime itself does not ask for it. */
#define GTC_VERSION_MAJOR 0
#define GTC_VERSION_MINOR 1
#define GTC_VERSION_PATCH 0

/* Status. 0: done. Positive: done, with remarks as bits; subtract the correction all the same, with less confidence.
 * Negative: nothing was written; keep the last correction, or none. A released value keeps its meaning; treat an
 * unknown negative one as a failure. Behind each stands what the firmware should do. */
#define GTC_OK 0
#define GTC_WARMING 1    /* slope window not full yet, slope taken as 0. Nothing */
#define GTC_CLAMPED 2    /* a channel outside its range, or a correction outside the authority, was limited. Log it */
#define GTC_UNCOVERED 4  /* inside the envelope, but far from training data. Log it */
#define GTC_HELD 8       /* a sample or block was missing or not accepted; last correction kept. If it stays: cable */
#define GTC_FALLBACK 16  /* temperature missing too long; constant correction of the table. Report the sensor */
#define GTC_CHANNEL_LOST 32 /* an auxiliary channel missing too long; its fallback model is used. Report the sensor */
#define GTC_E_ARG (-1)       /* NULL, not a number, count or size out of range. Count it and go on */
#define GTC_E_LAYOUT (-2)    /* table of another layout or beyond the build's options. Do not compensate, report */
#define GTC_E_SELF_TEST (-3) /* wrong arithmetic or known answer: flags, library, memory. Do not compensate, report */
#define GTC_E_IMAGE (-4)     /* corrupted or torn. check: report; open: use the built-in table; restore: init */
#define GTC_E_ID (-5)        /* image or saved state of another table. As GTC_E_IMAGE; find out why */
#define GTC_E_PERIOD (-6)    /* no whole number of samples of this period makes a block. Do not compensate, report */
#define GTC_E_ABSENT (-7)    /* the table holds no uncertainties, or no re-zero. Go on without the call */
#define GTC_E_REST (-8)      /* a re-zero beyond 4 sigma: the vehicle moved, or Earth's rate is in it. Rest again */

/* A missing sample in q31. (In f32 it is a NaN.) */
#define GTC_TEMP_MISSING (-2147483647L - 1L)

/* A correction with its uncertainty; see gtc_<n>_snapshot(). */
typedef struct {
    float bias;                /* in force, deg/h */
    float sigma;               /* 1 sigma of (true bias - bias), deg/h */
    float correlation_s;       /* correlation time of that error, s */
    uint_least32_t age_blocks; /* blocks since the last valid one, at most one more than are bridged */
    int_least32_t status;      /* of the correction in force */
} gtc_f32_snapshot_t;

typedef struct {
    int_least32_t bias;          /* 2^-bias_frac_bits deg/h */
    int_least32_t sigma;         /* 2^-bias_frac_bits deg/h */
    int_least32_t correlation_s; /* s */
    uint_least32_t age_blocks;
    int_least32_t status;
} gtc_q31_snapshot_t;

/* Words of a saved state, see gtc_<n>_save(). */
#define GTC_SAVE_WORDS (26 + GTC_MAX_SLOPE_BLOCKS + (2 * GTC_TERM_SLOTS) + (14 * GTC_MAX_TERMS) + (14 * GTC_WITH_UNCERTAINTY))

/* Bytes on a Cortex-M4F at -O2, the larger of arm-none-eabi-gcc 12.2 and 14.2, rounded up: code with all that it
 * calls (linked once) and stack of the deepest call, whatever terms a table has. `gyrotc verify` measures both with
 * the compiler that is installed; docs/results.md of gyrotc has other targets.
 *               f32 code  stack   q31 code  stack
 *   check           4520    460       3650    480
 *   open            2810    500       2600    520
 *   init             530     60        550     70
 *   sample          6350    320       6970    490
 *   bias              90      0         90     10
 *   snapshot        1310     50       2190    150
 *   rezero          1770     50       2990    180
 *   save            2180     80       1660    100
 *   restore         2990    620       2480    680 */

/* Boot self-test of a compiled-in table, before gtc_<n>_init(), which relies on it: layout, arithmetic (f32:
 * rounding, ties, no fused products, no excess precision, order of sums, subnormals), checksum, range of every word
 * (docs/FORMAT.md, section 3), known answers.
 * Returns 0, GTC_E_ARG, GTC_E_LAYOUT (also: a word out of range), GTC_E_IMAGE (checksum) or GTC_E_SELF_TEST.
 * Cost: n_probes + 2 evaluations of the map, about 40 operations a word. */
GTC_MUST_CHECK int gtc_f32_check(const gtc_f32_table_t *table);
GTC_MUST_CHECK int gtc_q31_check(const gtc_q31_table_t *table);

/* Makes a table from a binary image (gtc_<id>.bin) in flash: a new calibration without a new executable. `table`
 * gets pointers into `words`, which must stay in place, aligned as 32-bit words are; the file is little-endian, and a
 * core of the other byte order swaps the octets of each word first. `expected_id` is GTC_<ID>_ID of the emitted header. Nothing
 * is written unless the whole image is sound; then no function traps or reads outside, whoever made it. A CRC does
 * not authenticate: that the numbers are this gyro's, the firmware must know.
 * Returns 0, GTC_E_ARG, GTC_E_IMAGE (magic, byte order, length, CRC), GTC_E_LAYOUT (layout, options of the build, a
 * word out of range) or GTC_E_ID. Cost: about 50 operations a word. */
GTC_MUST_CHECK int gtc_f32_open(gtc_f32_table_t *table, const gtc_word_t *words,
                                uint_least32_t n_words, uint_least32_t expected_id);
GTC_MUST_CHECK int gtc_q31_open(gtc_q31_table_t *table, const gtc_word_t *words,
                                uint_least32_t n_words, uint_least32_t expected_id);

/* Starts a state for a table that gtc_<n>_check() or gtc_<n>_open() accepted; its words are not tested again.
 * period_us: microseconds between samples; a whole number of them, at most 2^20, must make a block, to a thousandth.
 * Returns 0, GTC_E_ARG, GTC_E_LAYOUT (another layout, or beyond the options of this build) or GTC_E_PERIOD. */
GTC_MUST_CHECK int gtc_f32_init(gtc_f32_state_t *state, const gtc_f32_table_t *table, uint_least32_t period_us);
GTC_MUST_CHECK int gtc_q31_init(gtc_q31_state_t *state, const gtc_q31_table_t *table, uint_least32_t period_us);

/* What was read, `elapsed_us` after the call before (the first one: after init): the sample period, or the difference
 * of a microsecond counter that wraps at 2^32. channels[0] is the temperature, then the table's auxiliary channels in
 * the order of their names (q31: 2^-16 of their unit); NULL: nothing was read. No reading is an error:
 *   - A missing or stuck reading, one too far from those before it, and a temperature outside the guard's range are
 *     held; an auxiliary reading outside its range counts as the edge (GTC_CLAMPED).
 *   - After start, a jump or a loss, a reading is accepted if it is at least the third of readings that agree, and comes
 *     the guard's time (1 s by default) or more after the first of them. Missing ones in between are neither for nor
 *     against them, as long as two lie less than the time apart after which the channel is lost. One that is stuck or
 *     outside the range begins them anew: so hand over a lost reading as missing, not as a number.
 *   - Missing too long: GTC_FALLBACK for the temperature, GTC_CHANNEL_LOST for an auxiliary channel.
 *   - Times are put on a grid of periods, and periods without a reading count as missed: jitter below half a period does
 *     no harm, lost samples leave the slope right. A reading whose period is taken, or that comes up to 268 s before the
 *     last one, is not used (GTC_HELD); after a block of such calls each counts as a missed period, so a stopped clock
 *     ends in GTC_FALLBACK. Longer than an hour: in several calls with NULL.
 * Returns the status of the correction in force, with GTC_HELD if this temperature was not accepted; GTC_E_ARG for a
 * state that is NULL or was never started. Cost: about 40 operations a channel; the first call of a block also makes
 * the correction (one map, slope_blocks multiplications, the terms), a longer gap at most missing_blocks + 1 of them. */
GTC_MUST_CHECK int gtc_f32_sample(gtc_f32_state_t *state, uint_least32_t elapsed_us, const float *channels);
GTC_MUST_CHECK int gtc_q31_sample(gtc_q31_state_t *state, uint_least32_t elapsed_us, const int_least32_t *channels);

/* The correction in force; compensated = measured - bias. Never outside the table's authority, whatever the state
 * holds. Returns its status or GTC_E_ARG. */
GTC_MUST_CHECK int gtc_f32_bias(const gtc_f32_state_t *state, float *bias);
GTC_MUST_CHECK int gtc_q31_bias(const gtc_q31_state_t *state, int_least32_t *bias);

/* The correction with 1 sigma, the correlation time of its error, status and age: for the bias state of a filter, a
 * first-order process with variance sigma^2. Sigma grows while the correction is held, with readings missing from its block, the slope is not known,
 * inputs lie outside envelope or training data, a channel is lost or limited, and until terms have forgotten the time
 * before the start (docs/design.md). It excludes the noise of the rate. Where it grows at once, add
 * sigma_new^2 - sigma_old^2 to the filter's variance (examples/nav_loop).
 * Returns the status of the correction, GTC_E_ARG (NULL) or GTC_E_ABSENT (no uncertainties in the table).
 * Cost: 220 instructions in float32, 770 in fixed point on a Cortex-M4F, without terms; no map. */
GTC_MUST_CHECK int gtc_f32_snapshot(const gtc_f32_state_t *state, gtc_f32_snapshot_t *snapshot);
GTC_MUST_CHECK int gtc_q31_snapshot(const gtc_q31_state_t *state, gtc_q31_snapshot_t *snapshot);

/* Re-zero at rest: moves the constant of the correction, now and in the fallback.
 *   mean_rate  mean of (measured - bias) over the rest, Earth's rate along the axis taken off, deg/h (q31:
 *              2^-bias_frac_bits deg/h); 1 mrad of heading error at the equator is 0.015 deg/h
 *   seconds    length of the rest, s; 0: takes every re-zero back, whatever mean_rate is
 * The rest is weighed against the spread from power-on to power-on that training saw, the uncertainty of the
 * correction and the noise of the rate. All shifts together stay within the table's `rezero` (GTC_CLAMPED at its
 * edge). A mean rate beyond 4 sigma is refused. The shift is of this power-on: gtc_<n>_restore() keeps it over 0
 * blocks without power, not over more.
 * Returns 0, GTC_CLAMPED, GTC_E_ARG, GTC_E_ABSENT or GTC_E_REST; negative: nothing was changed. */
GTC_MUST_CHECK int gtc_f32_rezero(gtc_f32_state_t *state, float mean_rate, uint_least32_t seconds);
GTC_MUST_CHECK int gtc_q31_rezero(gtc_q31_state_t *state, int_least32_t mean_rate, uint_least32_t seconds);

/* State over power cycles. `save` writes GTC_SAVE_WORDS words with version, the table's checksum and a CRC. `restore`
 * starts `state` as gtc_<n>_init() does and takes over what is kept over `off_blocks` whole blocks without power:
 *   0: everything, bit for bit, even within a block; the first elapsed_us then counts from the last sample. With
 *      another period_us only what is kept longer.
 *   more: the memories, which go on relaxing towards the first temperature, and plays.
 * A torn or foreign image, or one with numbers that no call leaves, leaves `state` unwritten: it is read into a state
 * on the stack first. examples/two_slots keeps it over power cuts.
 * Returns 0, GTC_E_ARG, GTC_E_LAYOUT (also: another arithmetic or version), GTC_E_IMAGE, GTC_E_ID or GTC_E_PERIOD.
 * Cost: about 40 operations a word. */
GTC_MUST_CHECK int gtc_f32_save(const gtc_f32_state_t *state, gtc_word_t words[GTC_SAVE_WORDS]);
GTC_MUST_CHECK int gtc_q31_save(const gtc_q31_state_t *state, gtc_word_t words[GTC_SAVE_WORDS]);
GTC_MUST_CHECK int gtc_f32_restore(gtc_f32_state_t *state, const gtc_f32_table_t *table, uint_least32_t period_us,
                                   const gtc_word_t words[GTC_SAVE_WORDS], uint_least32_t off_blocks);
GTC_MUST_CHECK int gtc_q31_restore(gtc_q31_state_t *state, const gtc_q31_table_t *table, uint_least32_t period_us,
                                   const gtc_word_t words[GTC_SAVE_WORDS], uint_least32_t off_blocks);

#ifdef __cplusplus
}
#endif

#endif /* GTC_H_INCLUDED */
