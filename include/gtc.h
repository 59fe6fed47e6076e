/* gtc.h - bias of a gyro from its temperature: the public interface of the gyrotc runtime.
 *
 * `gyrotc emit` writes one constant table for each axis of each gyro serial. The functions below read it and keep
 * their state in a struct of the caller: no heap, no libm, no I/O, no writable static data. Of a C library nothing is
 * needed but what a compiler calls of its own accord: memcpy, memset, memmove, memcmp. Each function exists in two
 * arithmetics <n>:
 *
 *   f32  float32: temperatures in C, slopes in C per block, biases in deg/h
 *   q31  fixed point: temperatures in 2^-16 C, slopes in 2^-16 C per block, biases in 2^-bias_frac_bits deg/h
 *
 * At boot gtc_<n>_check(), then gtc_<n>_init(). Then for every temperature sample
 *
 *   status = gtc_f32_sample(&state, &table, PERIOD_US, &temp_c);
 *   status = gtc_f32_bias(&state, &table, &bias_dph);    compensated = measured - bias
 *
 * Samples are averaged over blocks of the table's `block_us`. The correction of block n comes from the blocks up to
 * n-1: T is the mean of the last one, dT/dt the least-squares slope over the last `slope_blocks`. The correction is 0
 * with GTC_HELD until readings have agreed (gtc_<n>_sample()), then the map with slope 0 (GTC_WARMING) until the
 * window is full.
 *
 * Concurrency: a table is constant and may be read from anywhere. A state belongs to one task, a gtc_<n>_angle_t
 * to one task or interrupt; hand the bias from one to the other by an atomic store, a queue or with interrupts off.
 *
 * Faults: a state may hold anything. Whatever word of it was overwritten, no function reads or writes outside of state
 * and table or divides by zero, and gtc_<n>_bias() gives nothing outside of the table's authority. That the correction
 * is right again takes gtc_<n>_init(), or a loss and return of the temperature. Tables are constant: a table that
 * gtc_<n>_check() or gtc_<n>_open() has accepted is relied on.
 *
 * float32 needs C99 arithmetic (-std=c99 -ffp-contract=off, no -ffast-math), which gtc_f32_check() tests at boot.
 * Fixed point needs no flag.
 *
 * Pages and examples that comments name (docs/..., examples/...) are in gyrotc's repository.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_H_INCLUDED
#define GTC_H_INCLUDED

#include <stddef.h>
#include <stdint.h>

#include "gtc_config.h"

#ifdef __cplusplus
extern "C" {
#endif

#if (UINT_LEAST32_MAX != 4294967295U) || (INT_LEAST32_MIN + 1 != -2147483647)
#error "gtc needs least-width 32-bit integers of just 32 bits, in two's complement"
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
#define GTC_E_LAYOUT (-2)    /* another layout, or the table needs more than this runtime has. Do not compensate, report */
#define GTC_E_SELF_TEST (-3) /* wrong arithmetic or known answer: flags, library, memory. Do not compensate, report */
#define GTC_E_IMAGE (-4)     /* corrupted or torn. check: report; open: use the built-in table; restore: init */
#define GTC_E_ID (-5)        /* image, state or saved state of another table. Start again with gtc_<n>_init() */
#define GTC_E_PERIOD (-6)    /* no whole number of samples of this period makes a block. Do not compensate, report */
#define GTC_E_ABSENT (-7)    /* the table holds no uncertainties, or no re-zero. Go on without the call */
#define GTC_E_REST (-8)      /* a re-zero beyond 4 sigma: the vehicle moved, or Earth's rate is in it. Rest again */

/* A missing sample in q31. (In f32 it is a NaN.) */
#define GTC_TEMP_MISSING (-2147483647L - 1L)

/* One 32-bit word: an unsigned integer, a float32 value, or a signed integer.
 * MISRA 19.2 throughout: one array of words is table and flash image for both arithmetics. */
typedef union {
    uint_least32_t bits;
    float value;
    int_least32_t integer;
} gtc_word_t;

/* A table, and a state of the caller, whose members are private: the structs are below the functions. */
#if GTC_WITH_F32
typedef struct gtc_f32_table gtc_f32_table_t;
typedef struct gtc_f32_state gtc_f32_state_t;
#endif
#if GTC_WITH_Q31
typedef struct gtc_q31_table gtc_q31_table_t;
typedef struct gtc_q31_state gtc_q31_state_t;
#endif

/* ---- a program: check, init, then sample and bias ---- */

/* Boot self-test of a compiled-in table, before gtc_<n>_init(), which relies on it: layout and parts, arithmetic (f32:
 * rounding, ties, no fused products, no excess precision, order of sums, subnormals), checksum, known answers. Of a
 * constant table that the linker placed these find whatever memory lost.
 * Returns 0, GTC_E_ARG, GTC_E_LAYOUT, GTC_E_IMAGE (checksum) or GTC_E_SELF_TEST.
 * Cost: n_probes + 2 evaluations of the map, and a CRC-32 over the table, 32 steps a word. */
#if GTC_WITH_F32
GTC_MUST_CHECK int gtc_f32_check(const gtc_f32_table_t *table);
#endif
#if GTC_WITH_Q31
GTC_MUST_CHECK int gtc_q31_check(const gtc_q31_table_t *table);
#endif

/* Starts a state for a table that gtc_<n>_check() or gtc_<n>_open() accepted; its words are not tested again. The
 * state keeps the table's checksum: every other function takes the same table, and returns GTC_E_ID for another one.
 * period_us: microseconds between samples; a whole number of them, at most 2^20, must make a block, to a thousandth.
 * Returns 0, GTC_E_ARG, GTC_E_LAYOUT (another layout, or it needs more than this runtime has) or GTC_E_PERIOD. */
#if GTC_WITH_F32
GTC_MUST_CHECK int gtc_f32_init(gtc_f32_state_t *state, const gtc_f32_table_t *table, uint_least32_t period_us);
#endif
#if GTC_WITH_Q31
GTC_MUST_CHECK int gtc_q31_init(gtc_q31_state_t *state, const gtc_q31_table_t *table, uint_least32_t period_us);
#endif

/* What was read, `elapsed_us` after the call before (the first one: after init): the sample period, or the
 * difference of a microsecond counter that wraps at 2^32. channels[0] is the temperature, then the table's auxiliary
 * channels in the order of their names (q31: 2^-16 of their unit); NULL: nothing was read. No reading is an error:
 *   - A missing or stuck reading, one too far from those before it, and a temperature outside the guard's range are
 *     held; an auxiliary reading outside its range counts as the edge (GTC_CLAMPED).
 *   - After start, a jump or a loss, a reading is accepted if it is at least the third of readings that agree, and
 *     comes the guard's time (1 s by default) or more after the first of them. Missing ones in between are neither
 *     for nor against them, as long as two lie less than the time apart after which the channel is lost. One that
 *     is stuck or outside the range begins them anew: so hand over a lost reading as missing, not as a number.
 *   - Missing too long: GTC_FALLBACK for the temperature, GTC_CHANNEL_LOST for an auxiliary channel.
 *   - Times are put on a grid of periods, and periods without a reading count as missed: jitter below half a period
 *     does no harm, lost samples leave the slope right. A reading whose period is taken, or that comes up to 268 s
 *     before the last one, is not used (GTC_HELD); after a block of such calls each counts as a missed period, so a
 *     stopped clock ends in GTC_FALLBACK. Longer than an hour: in several calls with NULL.
 * Returns the status of the correction in force, with GTC_HELD if this temperature was not accepted; GTC_E_ARG for a
 * state that is NULL or was never started, GTC_E_ID for one of another table.
 * Cost: no loop but over the channels; the first call of a block also makes the correction (one map, slope_blocks
 * multiplications, the terms), a longer gap at most missing_blocks + 1 of them. */
#if GTC_WITH_F32
GTC_MUST_CHECK int gtc_f32_sample(gtc_f32_state_t *state, const gtc_f32_table_t *table, uint_least32_t elapsed_us,
                                  const float *channels);
#endif
#if GTC_WITH_Q31
GTC_MUST_CHECK int gtc_q31_sample(gtc_q31_state_t *state, const gtc_q31_table_t *table, uint_least32_t elapsed_us,
                                  const int_least32_t *channels);
#endif

/* The correction in force; compensated = measured - bias. Never outside the table's authority, whatever the state
 * holds. Returns its status, GTC_E_ARG or GTC_E_ID. */
#if GTC_WITH_F32
GTC_MUST_CHECK int gtc_f32_bias(const gtc_f32_state_t *state, const gtc_f32_table_t *table, float *bias);
#endif
#if GTC_WITH_Q31
GTC_MUST_CHECK int gtc_q31_bias(const gtc_q31_state_t *state, const gtc_q31_table_t *table, int_least32_t *bias);
#endif

#if GTC_WITH_UNCERTAINTY
/* ---- the uncertainty of a correction ---- */

/* A correction with its uncertainty; see gtc_<n>_snapshot(). */
#if GTC_WITH_F32
typedef struct {
    float bias;                /* in force, deg/h */
    float sigma;               /* 1 sigma of (true bias - bias), deg/h */
    float correlation_s;       /* correlation time of that error, s */
    uint_least32_t age_blocks; /* blocks since the last valid one, at most one more than are bridged */
    int_least32_t status;      /* of the correction in force */
} gtc_f32_snapshot_t;
#endif
#if GTC_WITH_Q31
typedef struct {
    int_least32_t bias;          /* 2^-bias_frac_bits deg/h */
    int_least32_t sigma;         /* 2^-bias_frac_bits deg/h */
    int_least32_t correlation_s; /* s */
    uint_least32_t age_blocks;
    int_least32_t status;
} gtc_q31_snapshot_t;
#endif

/* The correction with 1 sigma, the correlation time of its error, status and age: for the bias state of a filter, a
 * first-order process with variance sigma^2. Sigma grows while the correction is held, with readings missing from
 * its block, the slope is not known, inputs lie outside envelope or training data, a channel is lost or limited, and
 * until terms have forgotten the time before the start (docs/design.md). It excludes the noise of the rate. Where it
 * grows at once, add sigma_new^2 - sigma_old^2 to the filter's variance (examples/nav_loop).
 * Returns the status of the correction, GTC_E_ARG (NULL), GTC_E_ID or GTC_E_ABSENT (no uncertainties in the table).
 * Cost: some squares and two square roots of a loop of bounded length, one step a term; no map. */
#if GTC_WITH_F32
GTC_MUST_CHECK int gtc_f32_snapshot(const gtc_f32_state_t *state, const gtc_f32_table_t *table,
                                    gtc_f32_snapshot_t *snapshot);
#endif
#if GTC_WITH_Q31
GTC_MUST_CHECK int gtc_q31_snapshot(const gtc_q31_state_t *state, const gtc_q31_table_t *table,
                                    gtc_q31_snapshot_t *snapshot);
#endif
#endif

#if GTC_WITH_REZERO
/* Re-zero at rest: moves the constant of the correction, now and in the fallback.
 *   mean_rate  mean of (measured - bias) over the rest, Earth's rate along the axis taken off, deg/h (q31:
 *              2^-bias_frac_bits deg/h); 1 mrad of heading error at the equator is 0.015 deg/h
 *   seconds    length of the rest, s; 0: takes every re-zero back, whatever mean_rate is
 * The rest is weighed against the spread from power-on to power-on that training saw, the
 * uncertainty of the correction and the noise of the rate. All shifts together stay within the table's `rezero`
 * (GTC_CLAMPED at its edge). A mean rate beyond 4 sigma is refused; what is within, a slow motion or Earth's rate that
 * was left in, moves the correction by less than 4 sigma of the constant: 4 times the spread from power-on to power-on
 * at first, less after each rest. The shift is of this power-on: gtc_<n>_restore() keeps it over 0
 * blocks without power, not over more.
 * Returns 0, GTC_CLAMPED, GTC_E_ARG, GTC_E_ID, GTC_E_ABSENT or GTC_E_REST; negative: nothing was changed. */
#if GTC_WITH_F32
GTC_MUST_CHECK int gtc_f32_rezero(gtc_f32_state_t *state, const gtc_f32_table_t *table, float mean_rate,
                                  uint_least32_t seconds);
#endif
#if GTC_WITH_Q31
GTC_MUST_CHECK int gtc_q31_rezero(gtc_q31_state_t *state, const gtc_q31_table_t *table, int_least32_t mean_rate,
                                  uint_least32_t seconds);
#endif
#endif

/* ---- angle increments ---- */

/* Sum of angle increments. Starts as 0: `= {0}`, or static. */
#if GTC_WITH_F32
typedef struct {
    float rest[2]; /* what rounding left, arcsec */
} gtc_f32_angle_t;
#endif
#if GTC_WITH_Q31
typedef struct {
    int_least64_t rest; /* 10^-6 of a unit of the angle */
} gtc_q31_angle_t;
#endif

/* Adds to *increment the angle to subtract from an angle increment over dt, for a copy of the bias; set *increment to 0
 * when it was used. So what an interrupt adds is not lost if the task that reads it comes late. The rounding error is
 * carried on. f32: dt in s, increment in arcsec, a multiple of 2^-16 while below 64. q31: dt in microseconds,
 * increment in 2^-bias_frac_bits arcsec. Over 24 h the sum of increments stays within one such unit of bias * t (f32
 * from 64 arcsec on: or one last place of the largest increment), t being the sum of the dt given: 0.001F is off by
 * 4e-8, 2^-10 s is exact.
 * Returns 0 or GTC_E_ARG (NULL, not a number, dt not in 0 ... 1000 s, increment beyond the numbers of the arithmetic),
 * which leaves increment and carried error as they were. Reads no table and no state. */
#if GTC_WITH_F32
GTC_MUST_CHECK int gtc_f32_angle(gtc_f32_angle_t *angle, float bias, float dt, float *increment);
#endif
#if GTC_WITH_Q31
GTC_MUST_CHECK int gtc_q31_angle(gtc_q31_angle_t *angle, int_least32_t bias, int_least32_t dt,
                                 int_least32_t *increment);
#endif

#if GTC_WITH_IMAGE
/* ---- a table from outside of the program ---- */

/* Makes a table from a binary image (gtc_<id>.bin) in flash: a new calibration without a new executable. `table`
 * gets pointers into `words`, which must stay in place, aligned as 32-bit words are; the file is little-endian, and
 * a core of the other byte order swaps the octets of each word first. `expected_id` is GTC_<ID>_ID of the emitted
 * header. Nothing is written unless the whole image is sound; then no function traps or reads outside, whoever made
 * it. A CRC does not authenticate: that the numbers are this gyro's, the firmware must know.
 * Returns 0, GTC_E_ARG, GTC_E_IMAGE (magic, byte order, length, CRC), GTC_E_LAYOUT (layout, options of the build, a
 * word out of range) or GTC_E_ID. Cost: a CRC-32, 32 steps a word, then the ranges once. */
#if GTC_WITH_F32
GTC_MUST_CHECK int gtc_f32_open(gtc_f32_table_t *table, const gtc_word_t *words,
                                uint_least32_t n_words, uint_least32_t expected_id);
#endif
#if GTC_WITH_Q31
GTC_MUST_CHECK int gtc_q31_open(gtc_q31_table_t *table, const gtc_word_t *words,
                                uint_least32_t n_words, uint_least32_t expected_id);
#endif

/* Tests a table as gtc_<n>_open() does an image: the range of every word (docs/FORMAT.md, section 3), and what relates
 * several words. For a table that did not come with the program; gtc_<n>_check() comes first.
 * Returns 0, GTC_E_ARG or GTC_E_LAYOUT. Cost: one pass over the words. */
#if GTC_WITH_F32
GTC_MUST_CHECK int gtc_f32_check_words(const gtc_f32_table_t *table);
#endif
#if GTC_WITH_Q31
GTC_MUST_CHECK int gtc_q31_check_words(const gtc_q31_table_t *table);
#endif
#endif

#if GTC_WITH_SAVE
/* ---- a state over power cycles ---- */

/* State over power cycles. `save` writes GTC_SAVE_WORDS words with version, the table's checksum and a CRC. `restore`
 * starts `state` as gtc_<n>_init() does and takes over what is kept over `off_blocks` whole blocks without power:
 *   0: everything, bit for bit, even within a block; the first elapsed_us then counts from the last sample. With
 *      another period_us only what is kept longer.
 *   more: the memories, which go on relaxing towards the first temperature, and plays.
 * A torn or foreign image, or one with numbers that no call leaves, leaves `state` unwritten: it is read into a state
 * on the stack first. examples/two_slots keeps it over power cuts.
 * Returns 0, GTC_E_ARG, GTC_E_LAYOUT (also: another arithmetic or version), GTC_E_IMAGE, GTC_E_ID or GTC_E_PERIOD.
 * Cost: a CRC-32 over the saved words, 32 steps a word. */
#if GTC_WITH_F32
GTC_MUST_CHECK int gtc_f32_save(const gtc_f32_state_t *state, const gtc_f32_table_t *table,
                                gtc_word_t words[GTC_SAVE_WORDS]);
GTC_MUST_CHECK int gtc_f32_restore(gtc_f32_state_t *state, const gtc_f32_table_t *table, uint_least32_t period_us,
                                   const gtc_word_t words[GTC_SAVE_WORDS], uint_least32_t off_blocks);
#endif
#if GTC_WITH_Q31
GTC_MUST_CHECK int gtc_q31_save(const gtc_q31_state_t *state, const gtc_q31_table_t *table,
                                gtc_word_t words[GTC_SAVE_WORDS]);
GTC_MUST_CHECK int gtc_q31_restore(gtc_q31_state_t *state, const gtc_q31_table_t *table, uint_least32_t period_us,
                                   const gtc_word_t words[GTC_SAVE_WORDS], uint_least32_t off_blocks);
#endif
#endif

#ifdef __cplusplus
}
#endif

/* What follows is for the compiler: no member of a state is read or written by its owner. */
#include "gtc_table.h"
#include "gtc_private_state.h"

#endif /* GTC_H_INCLUDED */
