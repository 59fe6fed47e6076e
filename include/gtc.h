/* gtc.h - bias of a gyro from its temperature: the whole public interface of the gyrotc runtime.
 *
 * The generator (`gyrotc emit`) writes one constant table for each axis of each gyro serial. The
 * functions below read it and keep their state in a struct of the caller: no heap, no libm, no
 * I/O, no writable static data, no C library. Every function exists for each arithmetic <n>:
 *
 *   f32  float32: temperatures in C, slopes in C per block, biases in deg/h
 *   q31  fixed point: temperatures in 2^-16 C, slopes in 2^-16 C per block,
 *        biases in 2^-bias_frac_bits deg/h (a member of the table)
 *
 * Use, once for every temperature sample, in this order:
 *
 *   status = gtc_f32_sample(&state, &temp_c);    // then
 *   status = gtc_f32_bias(&state, &bias_dph);    // compensated = measured - bias
 *
 * Samples are collected in blocks of the table's `block_us`. The correction in force during block n is what the
 * blocks up to n-1 gave: T, the mean of the last block, and dT/dt, the least-squares slope over
 * the last `slope_blocks` blocks. From the first sample that others confirmed on there is a correction (the map
 * at that sample with slope 0, GTC_WARMING); before it the correction is 0 with GTC_HELD.
 *
 * Who may call what from where:
 *   - A table is constant: any number of tasks and interrupts may read one at the same time.
 *   - A state belongs to one task: all calls that take it, gtc_<n>_bias() and _save() too, come from there.
 *   - A gtc_<n>_angle_t belongs to one task or interrupt, which alone calls gtc_<n>_angle() with it.
 *   - From the one to the other goes a copy of the bias, by what the firmware has for one number: a store
 *     that is atomic on the target, a queue, or interrupts held off for the time of it.
 *
 * A float32 build must keep to C99 arithmetic (-std=c99 -ffp-contract=off, no -ffast-math);
 * gtc_f32_check() at boot proves that it does. Fixed point needs no flag.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_H_INCLUDED
#define GTC_H_INCLUDED

#include "gtc_table.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Semantic version of the functions below. The table layout has a number of its own.
 * MISRA 2.5: for users; the runtime itself does not ask for it. */
#define GTC_VERSION_MAJOR 0
#define GTC_VERSION_MINOR 1
#define GTC_VERSION_PATCH 0

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

/* What a call did. 0: done. Positive: done, with remarks as bits. Negative: nothing was written.
 * A released value keeps its meaning for ever; treat an unknown negative one as a failure. */
#define GTC_OK 0
#define GTC_WARMING 1    /* slope and mean are not full yet; slope taken as 0 */
#define GTC_CLAMPED 2    /* a channel outside its range, or a correction outside the authority: the edge */
#define GTC_UNCOVERED 4  /* inside the envelope, but no training data near: interpolated */
#define GTC_HELD 8       /* sample or block missing, stuck, impossible or not confirmed yet: last correction kept */
#define GTC_FALLBACK 16  /* temperature held too long: the table's constant correction */
#define GTC_CHANNEL_LOST 32 /* an auxiliary channel held too long: its stand-in, or the guard's value, stands for it */
#define GTC_E_ARG (-1)       /* NULL pointer, not a number, count or size out of range */
#define GTC_E_LAYOUT (-2)    /* table of another layout, or one that needs what was not compiled in */
#define GTC_E_SELF_TEST (-3) /* arithmetic or a known answer wrong: do not navigate with this build */
#define GTC_E_IMAGE (-4)     /* image or saved state corrupted, truncated or torn */
#define GTC_E_ID (-5)        /* image or saved state of another table */
#define GTC_E_PERIOD (-6)    /* no whole number of samples of this period makes a block of the table */
#define GTC_E_ABSENT (-7)    /* the table does not hold what the call needs: uncertainties, or a re-zero */
#define GTC_E_REST (-8)      /* a re-zero beyond 4 sigma of what is known: the vehicle moved, or Earth's rate is in it */

/* What the firmware should do. Every correction with a positive status is to be subtracted:
 *   GTC_WARMING    nothing more; the filter may take the bias as less certain
 *   GTC_CLAMPED    log it: the unit works outside its calibration, or a sensor lies; the filter as above
 *   GTC_UNCOVERED  log it; the filter as above
 *   GTC_HELD       nothing, while it comes and goes; look for the sensor's cable if it stays
 *   GTC_FALLBACK   report the temperature sensor as failed; the correction is a constant now
 *   GTC_CHANNEL_LOST  report the sensor of an auxiliary channel as failed; the correction goes on without it
 * With a negative one keep the last correction, or none:
 *   GTC_E_ARG        a fault of the caller; at run time count it and go on
 *   GTC_E_LAYOUT     table and runtime were not built together: do not compensate, report
 *   GTC_E_SELF_TEST  wrong flags, library or memory: do not compensate, report
 *   GTC_E_IMAGE      from check: memory fails, report; from open: use the table compiled in; from
 *                    restore: start with gtc_<n>_init()
 *   GTC_E_ID         of another unit: as GTC_E_IMAGE, and see how it came there
 *   GTC_E_PERIOD     wrong sample period, or a table for another block: do not compensate, report
 *   GTC_E_ABSENT     go on without the call: the correction stands as it is
 *   GTC_E_REST       as GTC_E_ABSENT; take another rest */

/* The q31 mark of a sample that did not arrive. (In f32 a NaN is one.) */
#define GTC_TEMP_MISSING (-2147483647L - 1L)

#if defined(__GNUC__) || defined(__clang__)
#define GTC_MUST_CHECK __attribute__((warn_unused_result))
#else
#define GTC_MUST_CHECK
#endif

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
    float term[GTC_MAX_TERMS][2];              /* states of the terms */
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
    int_least32_t term[GTC_MAX_TERMS][2];
    gtc_q31_input_t input[GTC_MAX_TERMS + 1];
} gtc_q31_state_t;

/* Sum of angle increments, owned by the caller, apart from any state. Starts as 0: `= {0}`, or static. */
typedef struct {
    float rest[2]; /* what rounding left, arcsec */
} gtc_f32_angle_t;

typedef struct {
    int_least64_t rest; /* 10^-6 of a unit of the angle */
} gtc_q31_angle_t;

/* A correction with its uncertainty, all of one moment; see gtc_<n>_snapshot(). */
typedef struct {
    float bias;                /* in force, deg/h */
    float sigma;               /* 1 sigma of (true bias - bias), deg/h */
    float correlation_s;       /* correlation time of that error, s */
    uint_least32_t age_blocks; /* blocks since the last valid one, one more than are bridged at most */
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
#define GTC_SAVE_WORDS (38 + GTC_MAX_SLOPE_BLOCKS + (15 * GTC_MAX_TERMS))

/* What the functions below take on a Cortex-M4F with arm-none-eabi-gcc 12.2 or 14.2 and -O2, the larger of the two
 * rounded up, bytes: code with all that it calls, which is linked once; stack at the deepest call, whatever terms
 * a table has. Another release or option makes other code: `gyrotc verify` measures it with the compiler that is
 * installed, and the report shows it. Other targets: docs/results.md of gyrotc.
 *               f32 code  stack   q31 code  stack
 *   check           4460    450       3570    470
 *   open            2760    500       2540    520
 *   map              920     20        790    120
 *   init             550     70        570     70
 *   sample          5830    250       6230    420
 *   sample_at       6230    270       6660    450
 *   missed          5030    240       5630    410
 *   bias              80      0         80     10
 *   snapshot        1210     50       2030    140
 *   rezero          1640     60       2960    170
 *   unzero           120     10        120     10
 *   angle            340      0        180     30
 *   save             630     40        630     40
 *   restore         2260    620       2050    660 */

/* Boot self-test of a table that is compiled in; before gtc_<n>_init(), which relies on it: layout, arithmetic (f32: rounding, ties, products not fused into sums, no
 * excess precision, sums in their order, subnormals not flushed to 0), checksum over its values, every
 * word within its range (docs/FORMAT.md, section 3), its known answers, which the generator chooses to
 * differ where a product is fused.
 * Returns 0, GTC_E_ARG, GTC_E_LAYOUT (also: a word outside its range), GTC_E_IMAGE (checksum) or
 * GTC_E_SELF_TEST.
 * Cost: n_probes + 2 evaluations of the map and about 40 operations for each word of the table. */
GTC_MUST_CHECK int gtc_f32_check(const gtc_f32_table_t *table);
GTC_MUST_CHECK int gtc_q31_check(const gtc_q31_table_t *table);

/* Makes a table from a binary image (gtc_<id>.bin) in flash: a new calibration without a new
 * executable. `table` receives pointers into `words`, which must stay in place. `expected_id` is
 * GTC_<ID>_ID of the emitted header. Nothing is written unless the whole image is sound: with a table
 * that was opened no function traps or reads outside, whoever made the image. Who made it, a CRC does
 * not say: the numbers are still to be those of this gyro.
 * Returns 0, GTC_E_ARG, GTC_E_IMAGE (magic, byte order, length, CRC, sizes), GTC_E_LAYOUT (another
 * layout, it needs what was not compiled in, or a word lies outside its range) or GTC_E_ID.
 * Cost: about 50 operations a word. */
GTC_MUST_CHECK int gtc_f32_open(gtc_f32_table_t *table, const gtc_word_t *words,
                                uint_least32_t n_words, uint_least32_t expected_id);
GTC_MUST_CHECK int gtc_q31_open(gtc_q31_table_t *table, const gtc_word_t *words,
                                uint_least32_t n_words, uint_least32_t expected_id);

/* The static map without terms: bias at a temperature and a slope (C per block), stateless, within the authority.
 * Returns 0, GTC_CLAMPED, GTC_UNCOVERED, or GTC_E_ARG (NULL, not a number). */
GTC_MUST_CHECK int gtc_f32_map(const gtc_f32_table_t *table, float temp, float slope, float *bias);
GTC_MUST_CHECK int gtc_q31_map(const gtc_q31_table_t *table, int_least32_t temp,
                               int_least32_t slope, int_least32_t *bias);

/* Starts a state. period_us: time from sample to sample on this target, microseconds; a whole number of them,
 * at most 2^20, must make a block of the table, to a thousandth of it.
 * The table is one that gtc_<n>_check() or gtc_<n>_open() accepted: its words are not tested again.
 * Returns 0, GTC_E_ARG, GTC_E_LAYOUT (another layout, or more than this build was compiled for) or GTC_E_PERIOD. */
GTC_MUST_CHECK int gtc_f32_init(gtc_f32_state_t *state, const gtc_f32_table_t *table, uint_least32_t period_us);
GTC_MUST_CHECK int gtc_q31_init(gtc_q31_state_t *state, const gtc_q31_table_t *table, uint_least32_t period_us);

/* One sample: channels[0] is the temperature, further ones (n_channels of the table) are the
 * auxiliary channels, in the order of their names (q31: in 2^-16 of their unit). No reading is an error:
 *   - One that is missing (f32: not finite), stuck, or too far from those before it is held; so is a temperature
 *     outside the guard's range. An auxiliary reading outside of its range is taken as the edge (GTC_CLAMPED).
 *   - At start, after a jump and after a loss readings must agree with one another for the guard's time.
 *   - Missing for too long: GTC_FALLBACK for the temperature, GTC_CHANNEL_LOST for an auxiliary channel.
 * Returns the status of the correction in force, with GTC_HELD if this temperature was not believed;
 * GTC_E_ARG for a NULL pointer.
 * Cost: about 40 operations a channel; the call that opens a block also makes the correction (one
 * evaluation of the map, slope_blocks multiplications, the terms). */
GTC_MUST_CHECK int gtc_f32_sample(gtc_f32_state_t *state, const float *channels);
GTC_MUST_CHECK int gtc_q31_sample(gtc_q31_state_t *state, const int_least32_t *channels);

/* The same with the time at which it was taken: a counter of microseconds that wraps at 2^32. The sample takes the
 * slot of the period in which its time lies, counted from the first one; slots that were passed count as
 * gtc_<n>_missed(). So jitter of less than half a period does no harm, lost samples and a clock that is off leave
 * the slope right. A sample whose slot is taken, or that comes late (up to 268 s before the last one), is not used:
 * GTC_HELD; from as many in a row on as make a block, each is a period in which nothing came, so that a clock that stands
 * still ends in GTC_FALLBACK as a sensor does that is missing. Where no sample comes for longer, call it with readings that are missing, at least once an hour.
 * Keep to either this or gtc_<n>_sample(), gtc_<n>_missed(). After gtc_<n>_restore() time begins anew. */
GTC_MUST_CHECK int gtc_f32_sample_at(gtc_f32_state_t *state, uint_least32_t time_us, const float *channels);
GTC_MUST_CHECK int gtc_q31_sample_at(gtc_q31_state_t *state, uint_least32_t time_us, const int_least32_t *channels);

/* `count` samples that did not arrive, in one call or in many: the results are the same bits. Same statuses as a
 * sample that is held; GTC_E_ARG, as from gtc_<n>_sample_at(), for NULL and for a state whose period or count of
 * samples in a block is 0. Cost: that of the blocks that end, at most missing_blocks + 1 of the guards. */
GTC_MUST_CHECK int gtc_f32_missed(gtc_f32_state_t *state, uint_least32_t count);
GTC_MUST_CHECK int gtc_q31_missed(gtc_q31_state_t *state, uint_least32_t count);

/* The correction in force; compensated = measured - bias. Never outside the table's authority, whatever the state
 * holds. Returns its status or GTC_E_ARG. */
GTC_MUST_CHECK int gtc_f32_bias(const gtc_f32_state_t *state, float *bias);
GTC_MUST_CHECK int gtc_q31_bias(const gtc_q31_state_t *state, int_least32_t *bias);

/* The correction in force with its 1 sigma, the correlation time of its error, its status and its age, all of one
 * moment: for the bias state of a filter, a first-order process with variance sigma^2 and this correlation time.
 * Sigma grows while the correction is held, the slope is not known yet, inputs lie outside the envelope or where
 * training was not, and until terms have forgotten the time before the start; docs/design.md gives the rules. It is
 * of the bias: the noise of the rate comes on top. Where sigma grows at once, add sigma_new^2 - sigma_old^2 to the
 * filter's variance (examples/nav_loop). A table without uncertainties is refused.
 * Returns the status of the correction, GTC_E_ARG (NULL) or GTC_E_ABSENT (no uncertainties in the table).
 * Cost: on a Cortex-M4F 220 instructions in float32, 770 in fixed point, without terms; other cores: docs/results.md
 * of gyrotc. The map is not evaluated. */
GTC_MUST_CHECK int gtc_f32_snapshot(const gtc_f32_state_t *state, gtc_f32_snapshot_t *snapshot);
GTC_MUST_CHECK int gtc_q31_snapshot(const gtc_q31_state_t *state, gtc_q31_snapshot_t *snapshot);

/* Re-zero at rest: moves the constant of the correction by a rest of known length.
 *   mean_rate  mean of the compensated rate (measured - bias) over the rest, Earth's rate along the axis taken off,
 *              deg/h (q31: 2^-bias_frac_bits deg/h). A heading error of 1 mrad at the equator is 0.015 deg/h:
 *              what is not known of Earth's rate goes into the constant.
 *   seconds    length of the rest, s
 * The rest is weighed against what training saw from power-on to power-on, with the uncertainty of the correction and
 * the noise of the rate over its length; a table that saw no turn-on offsets moves next to nothing. The shift of all
 * calls together stays within the table's `rezero`; what would go beyond ends there, with GTC_CLAMPED. A mean rate
 * beyond 4 sigma of what table, correction and noise allow is refused. The shift is in the correction at once, in the
 * fallback, too, and gtc_<n>_unzero() takes it back. It is of this power-on: restore keeps it over 0 blocks without
 * power, not over more, as power-ons are independent of one another in what training saw.
 * Returns 0, GTC_CLAMPED, GTC_E_ARG (NULL, not a number, 0 s), GTC_E_ABSENT (the table grants no shift) or GTC_E_REST;
 * negative: nothing was changed. */
GTC_MUST_CHECK int gtc_f32_rezero(gtc_f32_state_t *state, float mean_rate, uint_least32_t seconds);
GTC_MUST_CHECK int gtc_q31_rezero(gtc_q31_state_t *state, int_least32_t mean_rate, uint_least32_t seconds);

/* Takes every re-zero back. Returns 0 or GTC_E_ARG. */
GTC_MUST_CHECK int gtc_f32_unzero(gtc_f32_state_t *state);
GTC_MUST_CHECK int gtc_q31_unzero(gtc_q31_state_t *state);

/* The angle to subtract from an angle increment over dt, of a bias that gtc_<n>_bias() gave; what rounding
 * leaves is carried on. f32: dt in s, increment in arcsec, a multiple of 2^-16 while it is below 64. q31: dt
 * in microseconds, increment in 2^-bias_frac_bits arcsec. Over 24 h the sum stays within one such unit of
 * bias * t; in f32, where increments reach 64 arcsec, within one unit or one last place of the largest. t is
 * the sum of the dt given: 0.001F is not quite a millisecond (4 parts in 10^8), 2^-10 s is exact. No state is
 * read or written: an interrupt may call it with a gtc_<n>_angle_t and a copy of the bias of its own.
 * Returns GTC_OK or GTC_E_ARG (NULL, a bias that is none, dt not in 0 ... 1000 s, or an increment beyond the
 * numbers of the arithmetic); then nothing is lost, the rest is as it was. */
GTC_MUST_CHECK int gtc_f32_angle(gtc_f32_angle_t *angle, float bias, float dt, float *increment);
GTC_MUST_CHECK int gtc_q31_angle(gtc_q31_angle_t *angle, int_least32_t bias, int_least32_t dt,
                                 int_least32_t *increment);

/* State over power cycles. `save` writes GTC_SAVE_WORDS words with version, the table's checksum
 * and a CRC. `restore` starts `state` for `table` as gtc_<n>_init() would, then takes over what
 * survives `off_blocks` whole blocks without power:
 *   0: everything. The state goes on bit for bit where it was saved, in the middle of a block, too;
 *      tell it the samples in between by gtc_<n>_missed(). With another period_us than it
 *      was saved with, only what survives longer.
 *   more: memories, which go on relaxing towards the first temperature, and plays.
 * A torn or foreign image, or one with numbers that no call leaves, leaves `state` unwritten: restore reads it into
 * a state on the stack first. examples/two_slots keeps it over power cuts.
 * Returns 0, GTC_E_ARG, GTC_E_LAYOUT (also: saved by another arithmetic or version), GTC_E_IMAGE,
 * GTC_E_ID or GTC_E_PERIOD. Cost: about 40 operations a word. */
GTC_MUST_CHECK int gtc_f32_save(const gtc_f32_state_t *state, gtc_word_t words[GTC_SAVE_WORDS]);
GTC_MUST_CHECK int gtc_q31_save(const gtc_q31_state_t *state, gtc_word_t words[GTC_SAVE_WORDS]);
GTC_MUST_CHECK int gtc_f32_restore(gtc_f32_state_t *state, const gtc_f32_table_t *table,
                                   uint_least32_t period_us,
                                   const gtc_word_t words[GTC_SAVE_WORDS],
                                   uint_least32_t off_blocks);
GTC_MUST_CHECK int gtc_q31_restore(gtc_q31_state_t *state, const gtc_q31_table_t *table,
                                   uint_least32_t period_us,
                                   const gtc_word_t words[GTC_SAVE_WORDS],
                                   uint_least32_t off_blocks);

#ifdef __cplusplus
}
#endif

#endif /* GTC_H_INCLUDED */
