/* test_num.h - the names in which a test is written once for both arithmetics.
 *
 * TEST_Q31 = 0 or 1 chooses. Temperatures in tests are multiples of 2^-16 C, exact in both.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef TEST_NUM_H_INCLUDED
#define TEST_NUM_H_INCLUDED

#include <string.h>

#include "gtc_test.h"
#include "gtc_test_1.h"
#include "gtc_test_b.h"
#include "gtc_test_c.h"
#include "gtc_test_h.h"
#include "gtc_test_t.h"

#if TEST_Q31
typedef int_least32_t num_t;
typedef gtc_q31_table_t table_t;
typedef gtc_q31_state_t state_t;
#if GTC_WITH_UNCERTAINTY
typedef gtc_q31_snapshot_t snapshot_t;
#endif
#define FN(name) gtc_q31_##name
#define TABLE gtc_test_1_q31
#define BANK gtc_test_b_q31
#define TERMS gtc_test_t_q31
#define NARROW gtc_test_h_q31
#define CURVED gtc_test_c_q31
#define C(temperature) ((int_least32_t)((temperature) * 65536.0))
#define MISSING GTC_TEMP_MISSING
#define WORD_OF(member) (member)
#define NUMBER(word) ((word).integer)
#define MISSING_BITS 0x80000000UL
#else
typedef float num_t;
typedef gtc_f32_table_t table_t;
typedef gtc_f32_state_t state_t;
#if GTC_WITH_UNCERTAINTY
typedef gtc_f32_snapshot_t snapshot_t;
#endif
#define FN(name) gtc_f32_##name
#define TABLE gtc_test_1_f32
#define BANK gtc_test_b_f32
#define TERMS gtc_test_t_f32
#define NARROW gtc_test_h_f32
#define CURVED gtc_test_c_f32
#define C(temperature) ((float)(temperature))
#define MISSING test_nan()
#define WORD_OF(member) ((member).value)
#define NUMBER(word) ((word).value)
#define MISSING_BITS 0x7FC00000UL

static inline float test_nan(void)
{
    gtc_word_t word;

    word.bits = 0x7FC00000UL;
    return word.value;
}
#endif

#define N 4UL /* samples in a block ... */
#define PERIOD 2500000UL /* ... of 10 s, microseconds each */

static inline int same(num_t a, num_t b)
{
    return (memcmp(&a, &b, sizeof a) == 0) ? 1 : 0;
}

/* Overwrites what a state has read, as lost memory does, so that its next correction would be no number. */
static inline void spoil_input(state_t *state)
{
#if TEST_Q31
    state->window[0] = GTC_TEMP_MISSING; /* a slope of the whole range from here to 0 */
    state->input[0].base = 0;
    state->input[0].sum = 0;
    state->window_valid = 1U;
#else
    state->input[0].base = MISSING;
#endif
}

/* The tables that states were started with, the last one first: a state knows its table by the checksum alone. A test that
 * changes a table and goes on with states of the table as it was gives it another checksum. */
#define KNOWN_TABLES 8
static const table_t *test_tables[KNOWN_TABLES];
static uint_least32_t test_crcs[KNOWN_TABLES];

static inline void remember(const table_t *table)
{
    int k;

    for (k = KNOWN_TABLES - 1; k > 0; k--) {
        test_tables[k] = test_tables[k - 1];
        test_crcs[k] = test_crcs[k - 1];
    }
    test_tables[0] = table;
    test_crcs[0] = table->crc;
}

static inline const table_t *table_of(const state_t *state)
{
    int k;

    for (k = 0; (state != NULL) && (k < KNOWN_TABLES) && (test_tables[k] != NULL); k++) {
        if (test_crcs[k] == state->table_crc) {
            return test_tables[k];
        }
    }
    return &TABLE;
}

static inline int init(state_t *state, const table_t *table, uint_least32_t period_us)
{
    if (table != NULL) {
        remember(table);
    }
    return FN(init)(state, table, period_us);
}

static inline int sample(state_t *state, uint_least32_t elapsed_us, const num_t *channels)
{
    return FN(sample)(state, table_of(state), elapsed_us, channels);
}

static inline int get_bias(const state_t *state, num_t *bias)
{
    return FN(bias)(state, table_of(state), bias);
}

#if GTC_WITH_UNCERTAINTY
static inline int get_snapshot(const state_t *state, snapshot_t *snapshot)
{
    return FN(snapshot)(state, table_of(state), snapshot);
}
#endif

#if GTC_WITH_REZERO
static inline int rezero(state_t *state, num_t mean_rate, uint_least32_t seconds)
{
    return FN(rezero)(state, table_of(state), mean_rate, seconds);
}
#endif

#if GTC_WITH_SAVE
static inline int save(const state_t *state, gtc_word_t words[GTC_SAVE_WORDS])
{
    return FN(save)(state, table_of(state), words);
}

static inline int restore(state_t *state, const table_t *table, uint_least32_t period_us,
                          const gtc_word_t words[GTC_SAVE_WORDS], uint_least32_t off_blocks)
{
    if (table != NULL) {
        remember(table);
    }
    return FN(restore)(state, table, period_us, words, off_blocks);
}
#endif

/* The map of the test table; a status is not expected to be an error. */
static inline num_t map_of(num_t temp, num_t slope)
{
    num_t bias = 0;

    CHECK(FN(map)(&TABLE, temp, slope, &bias) >= 0);
    return bias;
}

static inline state_t started(void)
{
    state_t state;

    memset(&state, 0xA5, sizeof state);
    CHECK_INT(GTC_OK, init(&state, &TABLE, PERIOD));
    return state;
}

/* The next sample of the state's period. */
static inline int feed_one(state_t *state, const num_t *channels)
{
    return sample(state, state->period_us, channels);
}

/* `count` samples that did not arrive, in as few calls as take them; returns the last status, or that in force. */
static inline int missed(state_t *state, uint_least32_t count)
{
    const uint_least32_t most = 0xE0000000UL / state->period_us;
    uint_least32_t rest = count;
    int status = (int)state->status;

    while (rest > 0U) {
        const uint_least32_t now = (rest < most) ? rest : most;

        status = sample(state, now * state->period_us, NULL);
        rest -= now;
    }
    return status;
}

/* A sample at the time that a clock of microseconds shows, which wraps; *clock is its time at the call before. */
static inline int sample_at(state_t *state, uint_least32_t *clock, uint_least32_t time_us, const num_t *channels)
{
    const uint_least32_t elapsed_us = (time_us - *clock) & 0xFFFFFFFFUL;

    *clock = time_us;
    return sample(state, elapsed_us, channels);
}

/* Feeds n equal samples; returns the last status. */
static inline int feed(state_t *state, num_t temp, int n)
{
    int status = GTC_E_ARG;
    int i;

    for (i = 0; i < n; i++) {
        status = feed_one(state, &temp);
    }
    return status;
}

/* n samples that rise (or fall) by `step`, starting at *temp, which moves on. */
static inline int ramp(state_t *state, num_t *temp, num_t step, int n)
{
    int status = GTC_E_ARG;
    int i;

    for (i = 0; i < n; i++) {
        status = feed_one(state, temp);
        *temp += step;
    }
    return status;
}

static inline num_t bias_of(const state_t *state)
{
    num_t bias = 0;

    CHECK(get_bias(state, &bias) >= 0);
    return bias;
}

static inline int status_of(const state_t *state)
{
    num_t bias = 0;

    return get_bias(state, &bias);
}

#endif /* TEST_NUM_H_INCLUDED */
