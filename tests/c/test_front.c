/* test_front.c - samples in, correction in force out: every status, every fault. */
#include "test_image.h"

/* Window of the test table: 4 blocks; invalid blocks bridged: 2; identical samples accepted: 12. */
#define WINDOW 4
#define STEP C(0.015625) /* per sample: 1/16 C per block */

/* The test table with another guard of its temperature. */
static table_t guarded(gtc_word_t guard[GTC_GUARD_WORDS], uint_least32_t at, uint_least32_t bits)
{
    table_t table = TABLE;

    memcpy(guard, TABLE.guards, GTC_GUARD_WORDS * sizeof guard[0]);
    guard[at].bits = bits;
    table.guards = guard;
    return table;
}

#define AGREE_US 4U
#define STUCK_US 5U
#define MISSING_BLOCKS 6U

TEST(before_the_first_sample_the_correction_is_zero_and_held)
{
    state_t state = started();

    CHECK_INT(GTC_HELD, status_of(&state));
    CHECK(same(0, bias_of(&state)));
    CHECK_INT(GTC_HELD, feed(&state, MISSING, 9));
    CHECK(same(0, bias_of(&state)));
}

TEST(the_first_valid_sample_gives_the_map_at_slope_0)
{
    state_t state = started();

    CHECK_INT(GTC_HELD, feed(&state, MISSING, 3));
    CHECK_INT(GTC_WARMING, feed(&state, C(15.5), 1));
    CHECK(same(map_of(C(15.5), 0), bias_of(&state)));
}

TEST(a_correction_is_in_force_for_a_block)
{
    state_t state = started();
    num_t first;

    CHECK_INT(GTC_WARMING, feed(&state, C(15.0), 1));
    first = bias_of(&state);
    CHECK_INT(GTC_WARMING, feed(&state, C(15.25), 3));
    CHECK(same(first, bias_of(&state)));
    CHECK_INT(GTC_WARMING, feed(&state, C(15.25), 1));
    CHECK(same(map_of(C(15.1875), 0), bias_of(&state)));
}

TEST(a_full_window_gives_the_slope)
{
    state_t state = started();
    num_t temp = C(15.0);

    CHECK_INT(GTC_WARMING, ramp(&state, &temp, STEP, (int)N * WINDOW));
    CHECK_INT(GTC_OK, ramp(&state, &temp, STEP, 1));
    /* Mean of the last block: its middle, 2.5 steps before the sample just fed. */
    CHECK(same(map_of(C(15.0 + (0.015625 * 13.5)), C(0.0625)), bias_of(&state)));
}

TEST(missing_samples_are_held_and_do_not_move_the_mean)
{
    state_t state = started();

    CHECK_INT(GTC_WARMING, feed(&state, C(15.0), 2));
    CHECK_INT(GTC_WARMING | GTC_HELD, feed(&state, MISSING, 2));
    CHECK_INT(GTC_WARMING, feed(&state, C(15.0), 1));
    CHECK(same(map_of(C(15.0), 0), bias_of(&state)));
}

TEST(impossible_samples_are_held)
{
    state_t state = started();

    CHECK_INT(GTC_WARMING, feed(&state, C(15.0), 1));
    CHECK_INT(GTC_WARMING | GTC_HELD, feed(&state, C(200.5), 1));
    CHECK_INT(GTC_WARMING | GTC_HELD, feed(&state, C(-90.5), 1));
    CHECK_INT(GTC_WARMING, feed(&state, C(15.0), 1));
}

TEST(a_window_with_a_hole_still_gives_the_slope)
{
    state_t state = started();
    num_t temp = C(15.0);

    CHECK_INT(GTC_WARMING, ramp(&state, &temp, STEP, (int)N * 2));
    CHECK_INT(GTC_WARMING | GTC_HELD, missed(&state, N));
    temp += STEP * (num_t)N;
    CHECK_INT(GTC_WARMING | GTC_HELD, ramp(&state, &temp, STEP, 1));
    CHECK_INT(GTC_WARMING | GTC_HELD, ramp(&state, &temp, STEP, (int)N - 1));
    CHECK_INT(GTC_OK, ramp(&state, &temp, STEP, 1));
    CHECK(same(map_of(C(15.0 + (0.015625 * 13.5)), C(0.0625)), bias_of(&state)));
}

TEST(a_window_with_too_many_holes_warms_again)
{
    state_t state = started();
    num_t temp = C(15.0);

    CHECK_INT(GTC_WARMING, ramp(&state, &temp, 0, (int)N));
    CHECK_INT(GTC_WARMING | GTC_HELD, missed(&state, 2U * N));
    (void)feed(&state, C(15.015625), (int)N);
    /* Window: valid, hole, hole, valid. */
    CHECK_INT(GTC_OK, feed(&state, C(15.0), 1));
    CHECK_INT(GTC_HELD, missed(&state, N));
    (void)feed(&state, C(15.0), (int)N - 1);
    CHECK_INT(GTC_HELD, status_of(&state));
}

TEST(a_long_window_needs_half_of_its_blocks)
{
    gtc_word_t guard[GTC_GUARD_WORDS];
    table_t table = guarded(guard, MISSING_BLOCKS, 9U);
    state_t state;
    int k;

    table.slope_blocks = 8U;
    CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
    (void)feed(&state, C(15.0), 5);
    (void)feed(&state, C(15.25), 4);
    /* Five holes: three valid blocks of eight, then two, then one. */
    CHECK((missed(&state, (5U * N) - 1U) & GTC_HELD) != 0);
    (void)feed(&state, C(15.5), 4);
    CHECK_INT(GTC_WARMING, feed(&state, C(15.5), 1) & ~GTC_HELD);
    CHECK((missed(&state, (8U * N) - 1U) & GTC_HELD) != 0);
    (void)feed(&state, C(15.75), 4);
    CHECK_INT(GTC_WARMING, feed(&state, C(15.75), 1) & ~GTC_HELD);
    for (k = 0; k < 3; k++) {
        (void)feed(&state, C(16.0) + (STEP * (num_t)k), 4);
    }
    CHECK_INT(GTC_OK, status_of(&state));
}

TEST(the_gap_is_counted_no_further_than_a_word)
{
    gtc_word_t guard[GTC_GUARD_WORDS];
    table_t table = guarded(guard, MISSING_BLOCKS, 100000UL);
    state_t state;

    CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
    (void)feed(&state, C(15.0), 1);
    CHECK((missed(&state, 3000UL) & GTC_HELD) != 0);
    CHECK(state.input[0].next_gap_us == 0xFFFFFFFFUL);
    CHECK((feed(&state, MISSING, 1) & GTC_HELD) != 0);
    CHECK(state.input[0].next_gap_us == 0xFFFFFFFFUL);
}

TEST(too_many_invalid_blocks_end_in_the_constant_correction_and_a_restart)
{
    state_t state = started();
    num_t temp = C(15.0);
    num_t before;

    (void)ramp(&state, &temp, STEP, ((int)N * WINDOW) + 1);
    before = bias_of(&state);
    CHECK_INT(GTC_HELD, missed(&state, (3U * N) - 1U));
    CHECK(same(before, bias_of(&state)));
    CHECK_INT(GTC_HELD | GTC_FALLBACK, missed(&state, 1U));
    CHECK(!same(before, bias_of(&state)));
    CHECK_INT(GTC_WARMING, feed(&state, C(15.0), 1));
    CHECK(same(map_of(C(15.0), 0), bias_of(&state)));
}

/* A state of the test table whose readings must agree for so long. */
static state_t agreeing(uint_least32_t agree_us)
{
    static gtc_word_t guard[GTC_GUARD_WORDS];
    static table_t table;
    state_t state;

    table = guarded(guard, AGREE_US, agree_us);
    CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
    return state;
}

TEST(a_first_conversion_alone_is_not_accepted)
{
    state_t state = agreeing(1000000UL);

    CHECK_INT(GTC_HELD, feed(&state, C(85.0), 1));
    CHECK(same(0, bias_of(&state)));
    CHECK_INT(GTC_HELD, feed(&state, C(15.0), 2));
    CHECK_INT(GTC_WARMING, feed(&state, C(15.0), 1));
    CHECK(same(map_of(C(15.0), 0), bias_of(&state)));
}

TEST(a_jump_is_held_until_samples_agree_for_long_enough)
{
    state_t state = agreeing(2UL * PERIOD);

    (void)feed(&state, C(10.0), 5);
    CHECK_INT(GTC_WARMING | GTC_HELD, feed(&state, C(30.0), 1));
    CHECK_INT(GTC_WARMING | GTC_HELD, feed(&state, C(30.25), 1));
    CHECK(same(map_of(C(10.0), 0), bias_of(&state)));
    CHECK_INT(GTC_WARMING, feed(&state, C(30.125), 1));
    CHECK(same(map_of(C(30.125), 0), bias_of(&state)));
}

/* The time counts, not the number of samples. */
TEST(agreement_takes_as_long_with_quick_samples)
{
    static gtc_word_t guard[GTC_GUARD_WORDS];
    const table_t table = guarded(guard, AGREE_US, 1000000UL);
    state_t state;

    CHECK_INT(GTC_OK, init(&state, &table, 10000UL));
    CHECK_INT(GTC_HELD, feed(&state, C(15.0), 100));
    CHECK_INT(GTC_WARMING, feed(&state, C(15.0), 1));
    CHECK_INT(GTC_WARMING | GTC_HELD, feed(&state, C(85.0), 3));
    CHECK_INT(GTC_WARMING | GTC_HELD, feed(&state, C(45.0), 100));
    CHECK_INT(GTC_WARMING, feed(&state, C(45.0), 1));
}

TEST(candidates_that_disagree_or_follow_something_impossible_start_again)
{
    state_t state = agreeing(2UL * PERIOD);

    (void)feed(&state, C(10.0), 5);
    CHECK_INT(GTC_WARMING | GTC_HELD, feed(&state, C(30.0), 1));
    CHECK_INT(GTC_WARMING | GTC_HELD, feed(&state, C(45.0), 2));
    CHECK_INT(GTC_WARMING | GTC_HELD, feed(&state, C(200.5), 1));
    CHECK_INT(GTC_WARMING | GTC_HELD, feed(&state, C(45.0), 2));
    CHECK_INT(GTC_WARMING, feed(&state, C(45.0), 1));
    state = agreeing(2UL * PERIOD);
    (void)feed(&state, C(10.0), 5);
    CHECK_INT(GTC_WARMING | GTC_HELD, feed(&state, C(45.0), 2));
    CHECK_INT(GTC_WARMING, feed(&state, C(10.0), 1));
    CHECK_INT(GTC_WARMING | GTC_HELD, feed(&state, C(45.0), 2));
    CHECK_INT(GTC_WARMING, feed(&state, C(45.0), 1));
}

TEST(candidates_that_are_stuck_start_again)
{
    static gtc_word_t guard[GTC_GUARD_WORDS];
    table_t table = guarded(guard, AGREE_US, 3UL * PERIOD);
    state_t state;

    guard[STUCK_US].bits = 2UL * PERIOD;
    CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
    CHECK_INT(GTC_HELD, feed(&state, C(15.0), 9));
    CHECK_INT(GTC_HELD, feed(&state, C(15.125), 1));
    CHECK_INT(GTC_HELD, feed(&state, C(15.25), 1));
    CHECK_INT(GTC_HELD, feed(&state, C(15.125), 1));
    CHECK_INT(GTC_WARMING, feed(&state, C(15.25), 1));
}

TEST(a_missing_sample_is_neither_for_nor_against_a_candidate)
{
    state_t state = agreeing(4UL * PERIOD);
    int k;

    (void)feed(&state, C(10.0), 5);
    for (k = 0; k < 2; k++) {
        CHECK((feed(&state, C(45.0), 1) & GTC_HELD) != 0);
        CHECK(same(map_of(C(10.0), 0), bias_of(&state)));
        CHECK((((k == 0) ? feed(&state, MISSING, 1) : missed(&state, 1U)) & GTC_HELD) != 0);
    }
    CHECK_INT(GTC_WARMING, feed(&state, C(45.0), 1));
    CHECK(same(map_of(C(45.0), 0), bias_of(&state)));
}

/* How long it took does not make up for readings. */
TEST(two_readings_are_not_accepted_however_far_apart_they_are)
{
    state_t state = agreeing(1UL);

    CHECK_INT(GTC_HELD, feed(&state, C(15.0), 1));
    CHECK_INT(GTC_HELD, missed(&state, 6U));
    CHECK_INT(GTC_HELD, feed(&state, C(15.0), 1));
    CHECK_INT(GTC_WARMING, feed(&state, C(15.0), 1));
}

/* The test table bridges 2 blocks; so a candidate counts until 3 blocks have passed. */
TEST(a_candidate_is_forgotten_when_a_channel_would_be)
{
    static gtc_word_t guard[GTC_GUARD_WORDS];
    table_t table = guarded(guard, AGREE_US, PERIOD);
    state_t state;
    int gap;

    for (gap = 3 * (int)N - 1; gap <= 3 * (int)N; gap++) {
        CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
        CHECK((feed(&state, C(15.0), 1) & GTC_HELD) != 0);
        CHECK((missed(&state, (uint_least32_t)(gap - 1)) & GTC_HELD) != 0);
        CHECK((feed(&state, C(15.0), 1) & GTC_HELD) != 0);
        CHECK((missed(&state, (uint_least32_t)(gap - 1)) & GTC_HELD) != 0);
        CHECK_INT((gap < 3 * (int)N) ? 0 : GTC_HELD, feed(&state, C(15.0), 1) & GTC_HELD);
    }
    /* Not after the longest time that is counted, either. */
    guard[MISSING_BLOCKS].bits = 100000UL;
    CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
    CHECK_INT(GTC_HELD, feed(&state, C(15.0), 2));
    CHECK_INT(GTC_HELD, missed(&state, 3000UL));
    CHECK_INT(GTC_HELD, feed(&state, C(15.0), 2));
    CHECK_INT(GTC_WARMING, feed(&state, C(15.0), 1) & ~GTC_HELD);
}

/* The guard grants 0.5 C and 0.1 C in a second: 2.5 C in the 8 periods between two readings. */
TEST(candidates_may_lie_as_far_apart_as_accepted_readings)
{
    static gtc_word_t guard[GTC_GUARD_WORDS];
    table_t table = guarded(guard, AGREE_US, PERIOD);
    num_t temp;
    state_t state;
    int k;
    int far;

    for (far = 0; far < 2; far++) {
        CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
        for (k = 0; k < 3; k++) {
            temp = C(15.0) + ((num_t)k * ((far != 0) ? C(2.75) : C(2.25)));
            if (k > 0) {
                (void)missed(&state, 7U);
            }
            (void)feed_one(&state, &temp);
        }
        CHECK_INT((far != 0) ? GTC_HELD : 0, status_of(&state) & GTC_HELD);
    }
}

/* After a loss the last accepted temperature proves nothing: a sensor that was plugged in again shows 85 C first. */
TEST(after_a_loss_readings_must_agree_again)
{
    state_t state = agreeing(1000000UL);

    (void)feed(&state, C(15.0), 9);
    CHECK_INT(GTC_HELD | GTC_FALLBACK, missed(&state, 100UL * N));
    CHECK_INT(GTC_HELD | GTC_FALLBACK, feed(&state, C(55.0), 1));
    CHECK_INT(GTC_HELD | GTC_FALLBACK, feed(&state, C(15.0), 2));
    CHECK_INT(GTC_WARMING, feed(&state, C(15.0), 1));
    CHECK(same(map_of(C(15.0), 0), bias_of(&state)));
}

TEST(a_sensor_dead_from_power_up_ends_in_the_constant_correction)
{
    state_t state = started();
    int k;

    /* Two blocks are bridged. */
    CHECK_INT(GTC_HELD, feed(&state, MISSING, (int)(3U * N)));
    CHECK(same(0, bias_of(&state)));
    CHECK_INT(GTC_HELD | GTC_FALLBACK, feed(&state, MISSING, 1));
    for (k = 0; k < 9; k++) {
        CHECK_INT(GTC_HELD | GTC_FALLBACK, feed(&state, MISSING, 3));
        CHECK(same(WORD_OF(TABLE.fallback), bias_of(&state)));
    }
    CHECK_INT(GTC_WARMING, feed(&state, C(15.0), 1));
}

/* A table for other blocks must not scale the slope in silence. */
TEST(a_period_of_which_no_whole_number_makes_a_block_is_refused)
{
    table_t table = TABLE;
    state_t state;

    CHECK_INT(GTC_E_PERIOD, init(&state, &TABLE, 3000000UL));
    CHECK_INT(GTC_E_PERIOD, init(&state, &TABLE, 20000000UL));
    CHECK_INT(GTC_E_PERIOD, init(&state, &TABLE, 9UL));
    CHECK_INT(GTC_OK, init(&state, &TABLE, 10000000UL));
    CHECK_INT(GTC_OK, init(&state, &TABLE, 10010000UL));
    CHECK_INT(GTC_E_PERIOD, init(&state, &TABLE, 10010001UL));
    CHECK_INT(GTC_OK, init(&state, &TABLE, 33333UL));
    CHECK_INT(300, state.samples_per_block);
    CHECK_INT(GTC_OK, init(&state, &TABLE, 10UL));
    table.block_us = 20000000UL;
    CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
    CHECK_INT(8, state.samples_per_block);
}

/* However calls are grouped. */
TEST(a_long_time_without_samples_is_the_same_in_one_call_and_in_many)
{
    static const uint_least32_t parts[5] = {1U, 3U, 4U, 5U, 977U};
    gtc_word_t whole[GTC_SAVE_WORDS];
    gtc_word_t split[GTC_SAVE_WORDS];
    uint_least32_t k;
    int start;

    for (start = 0; start < 6; start++) {
        for (k = 0U; k < 5U; k++) {
            state_t a = started();
            state_t b = started();
            uint_least32_t rest = 8640U;
            int status = 0;

            (void)feed(&a, C(15.0), start);
            (void)feed(&b, C(15.0), start);
            while (rest > 0U) {
                const uint_least32_t now = (parts[k] < rest) ? parts[k] : rest;

                status = missed(&b, now);
                rest -= now;
            }
            CHECK_INT(status, missed(&a, 8640U));
            CHECK_INT(GTC_OK, save(&a, whole));
            CHECK_INT(GTC_OK, save(&b, split));
            CHECK(memcmp(whole, split, sizeof whole) == 0);
            CHECK_INT(feed(&a, C(20.0), 9), feed(&b, C(20.0), 9));
            CHECK(same(bias_of(&a), bias_of(&b)));
        }
    }
}

TEST(stamped_samples_are_the_samples_of_their_slots)
{
    /* Jitter of less than half a period, and a counter that wraps. */
    static const long jitter[8] = {0, 900000, -900000, 1200000, -1200000, 1, -1, 0};
    state_t a = started();
    state_t b = started();
    num_t temp = C(15.0);
    uint_least32_t time = 0xFFFFFFFFUL - (5UL * PERIOD);
    uint_least32_t clock = (uint_least32_t)((time - PERIOD) & 0xFFFFFFFFUL);
    int k;

    for (k = 0; k < 60; k++) {
        const uint_least32_t stamp = (time + (uint_least32_t)((k == 0) ? 0 : jitter[k % 8])) & 0xFFFFFFFFUL;

        CHECK_INT(feed_one(&a, &temp), sample_at(&b, &clock, stamp, &temp));
        CHECK(same(bias_of(&a), bias_of(&b)));
        temp += STEP;
        time = (time + PERIOD) & 0xFFFFFFFFUL;
    }
}

/* A clock that stands still: samples go on, their time does not. A few in a row are jitter, a block of them is a fault, which
 * ends as a sensor does that is missing; when the clock goes on the front end begins again. */
TEST(a_clock_that_stands_still_ends_in_the_fallback)
{
    state_t a = started();
    num_t temps[2];
    uint_least32_t time_us = 0UL;
    uint_least32_t clock = 0UL;
    uint_least32_t k;

    temps[0] = C(15.0);
    temps[1] = C(15.0) + STEP;
    for (k = 0UL; k < 30UL * N; k++) {
        time_us += PERIOD;
        CHECK(sample_at(&a, &clock, time_us, &temps[k & 1UL]) >= 0);
    }
    CHECK_INT(GTC_OK, status_of(&a));
    for (k = 0UL; k < N; k++) {
        CHECK((sample_at(&a, &clock, time_us, &temps[k & 1UL]) & GTC_HELD) != 0);
        CHECK_INT(GTC_OK, status_of(&a));
    }
    for (k = 0UL; k < 2UL * N; k++) {
        CHECK((sample_at(&a, &clock, time_us, &temps[k & 1UL]) & GTC_HELD) != 0);
    }
    CHECK((status_of(&a) & GTC_HELD) != 0);
    for (k = 0UL; (k < 200UL * N) && ((status_of(&a) & GTC_FALLBACK) == 0); k++) {
        CHECK((sample_at(&a, &clock, (uint_least32_t)(time_us - (k % 3UL)), &temps[k & 1UL]) & GTC_HELD) != 0);
    }
    CHECK((status_of(&a) & GTC_FALLBACK) != 0);
    for (k = 0UL; k < 30UL * N; k++) {
        time_us += PERIOD;
        CHECK(sample_at(&a, &clock, time_us, &temps[k & 1UL]) >= 0);
    }
    CHECK_INT(GTC_OK, status_of(&a));
    /* A caller that is twice as fast as its period loses nothing. */
    for (k = 0UL; k < 60UL * N; k++) {
        time_us += (uint_least32_t)((PERIOD / 2UL) + (k & 1UL));
        CHECK(sample_at(&a, &clock, time_us, &temps[(k / 2UL) & 1UL]) >= 0);
        CHECK_INT(GTC_OK, status_of(&a));
    }
}

TEST(stamps_tell_lost_samples_late_ones_and_a_clock_that_is_off)
{
    state_t a = started();
    state_t b = started();
    num_t temp = C(15.0);
    uint_least32_t clock = (uint_least32_t)((1000UL - PERIOD) & 0xFFFFFFFFUL);
    uint_least32_t elapsed = 0UL;
    int k;

    CHECK_INT(feed_one(&a, &temp), sample_at(&b, &clock, 1000UL, &temp));
    /* Three are lost. */
    CHECK((missed(&a, 3U) & GTC_HELD) != 0);
    CHECK_INT(feed_one(&a, &temp), sample_at(&b, &clock, 1000UL + (4UL * PERIOD), &temp));
    /* One that comes twice, and one that comes late, change nothing. */
    CHECK_INT(status_of(&b) | GTC_HELD, sample_at(&b, &clock, 1000UL + (4UL * PERIOD) + 5UL, &temp));
    CHECK_INT(status_of(&b) | GTC_HELD, sample_at(&b, &clock, 1000UL + PERIOD, &temp));
    CHECK_INT(feed_one(&a, &temp), sample_at(&b, &clock, 1000UL + (5UL * PERIOD), &temp));
    CHECK(a.position == b.position);
    /* A sensor that is a tenth too slow: each tenth slot stays empty, so the blocks are those of the time. */
    a = started();
    for (k = 0; k < 100; k++) {
        CHECK(sample(&a, (k == 0) ? PERIOD : 2750000UL, &temp) >= 0);
        elapsed += (uint_least32_t)((k == 0) ? PERIOD : 2750000UL);
        temp += STEP;
    }
#if GTC_WITH_TERMS
    CHECK(((a.elapsed * N) + a.position) == ((elapsed + (PERIOD / 2UL)) / PERIOD));
    CHECK_INT((99L * 11L / 10L) / (long)N, a.elapsed);
#else
    CHECK(a.position == (((elapsed + (PERIOD / 2UL)) / PERIOD) % N));
#endif
    /* The slope is that of the time, not of the samples: 11 samples' rise in 10 of its blocks. */
}

/* The map is evaluated where the temperature will be. */
TEST(a_table_with_a_lead_looks_a_block_ahead)
{
    table_t table = TABLE;
    state_t state;
    num_t temp = C(15.0);

    table.lead_blocks = 1U;
    CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
    (void)ramp(&state, &temp, STEP, ((int)N * WINDOW) + 1);
    CHECK(same(map_of(C(15.0 + (0.015625 * 13.5) + 0.0625), C(0.0625)), bias_of(&state)));
}

TEST(a_block_of_one_or_two_samples_counts_with_one)
{
    num_t temp = C(15.0);
    state_t state;
    int k;

    for (k = 1; k <= 2; k++) {
        CHECK_INT(GTC_OK, init(&state, &TABLE, 10000000UL / (uint_least32_t)k));
        CHECK((ramp(&state, &temp, STEP, 9 * k) & ~GTC_HELD) == GTC_OK);
    }
    CHECK_INT(GTC_HELD, missed(&state, 1U));
    CHECK_INT(GTC_OK, ramp(&state, &temp, STEP, 2));
    CHECK_INT(GTC_OK, status_of(&state));
}

/* Whatever a state holds, and whatever the map says. */
TEST(no_correction_leaves_the_authority)
{
    table_t table = TABLE;
    state_t state;
    num_t bias = 0;
    num_t low;
    num_t high;

    WORD_OF(table.authority[0]) = 0;
    WORD_OF(table.authority[1]) = WORD_OF(TABLE.fallback);
    low = WORD_OF(table.authority[0]);
    high = WORD_OF(table.authority[1]);
    CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
    for (bias = C(-20.0); bias <= C(60.0); bias += C(1.0)) {
        num_t temp = bias;
        num_t map = 0;
        int status;

        state = started();
        CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
        status = feed_one(&state, &temp);
        CHECK((bias_of(&state) >= low) && (bias_of(&state) <= high));
        CHECK(((status & GTC_CLAMPED) != 0) == (!same(bias_of(&state), map_of(temp, 0))));
        CHECK(FN(map)(&table, temp, 0, &map) >= 0);
        CHECK(same(map, bias_of(&state)));
    }
    state.bias = high + high;
    CHECK((get_bias(&state, &bias) & GTC_CLAMPED) != 0);
    CHECK(same(high, bias));
    state.bias = low - high;
    CHECK((get_bias(&state, &bias) & GTC_CLAMPED) != 0);
    CHECK(same(low, bias));
}

TEST(the_longer_the_gap_the_larger_the_accepted_step)
{
    state_t state = agreeing(2UL * PERIOD);

    /* max_step 0.5 C, and 0.25 C for each sample since the last one. */
    (void)feed(&state, C(10.0), 7);
    CHECK_INT(GTC_WARMING | GTC_HELD, feed(&state, C(10.8125), 1));
    state = agreeing(2UL * PERIOD);
    (void)feed(&state, C(10.0), 7);
    CHECK_INT(GTC_WARMING | GTC_HELD, feed(&state, MISSING, 1));
    CHECK_INT(GTC_WARMING, feed(&state, C(10.8125), 1));
    state = agreeing(2UL * PERIOD);
    (void)feed(&state, C(0.0), 3);
    CHECK_INT(GTC_HELD | GTC_FALLBACK, missed(&state, 100000UL));
    CHECK_INT(GTC_WARMING | GTC_CLAMPED, feed(&state, C(-21.0), 3));
    CHECK(same(map_of(C(-20.0), 0), bias_of(&state)));
}

TEST(a_stuck_sensor_is_held_after_as_many_samples_as_the_table_says)
{
    state_t state = started();

    CHECK_INT(GTC_WARMING, feed(&state, C(10.0), 11));
    CHECK_INT(GTC_WARMING, feed(&state, C(10.0), 1));
    CHECK_INT(GTC_WARMING | GTC_HELD, feed(&state, C(10.0), 1));
    CHECK_INT(GTC_WARMING | GTC_HELD, feed(&state, MISSING, 1));
    CHECK_INT(GTC_WARMING | GTC_HELD, feed(&state, C(10.0), 1));
    CHECK_INT(GTC_WARMING, feed(&state, C(10.015625), 1));
}

TEST(a_table_that_accepts_any_number_of_identical_samples)
{
    gtc_word_t guard[GTC_GUARD_WORDS];
    table_t table = guarded(guard, STUCK_US, 0U);
    state_t state;

    CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
    CHECK_INT(GTC_OK, feed(&state, C(10.0), 100));
}

TEST(missed_is_the_same_as_missing_samples)
{
    state_t a = started();
    state_t b = started();
    int k;

    for (k = 0; k < 40; k++) {
        num_t temp = C(15.0) + (STEP * (num_t)k);
        const int count = (k * k) % 13;

        if (count > 0) {
            CHECK_INT(feed(&a, MISSING, count), missed(&b, (uint_least32_t)count));
        }
        CHECK_INT(feed(&a, temp, 2), feed(&b, temp, 2));
        CHECK(same(bias_of(&a), bias_of(&b)));
    }
    CHECK_INT(status_of(&b), missed(&b, 0U));
}

/* A table holds nothing that it does not name among its parts. */
TEST(a_part_that_a_table_does_not_name_is_refused)
{
    const uint_least32_t parts[3] = {GTC_PART_COVERAGE, GTC_PART_UNCERTAINTY, GTC_PART_PROBES};
    uint_least32_t i;

    for (i = 0U; i < 3U; i++) {
        table_t table = TABLE;

        table.parts &= ~parts[i];
        CHECK_INT(GTC_E_LAYOUT, checked(&table));
    }
}

/* Without uncertainties and known answers a table is one. */
TEST(a_table_with_the_map_alone_is_usable)
{
    table_t table = TABLE;

    table.sigma_cells[0] = 0U;
    table.sigma_cells[1] = 0U;
    CHECK_INT(GTC_E_LAYOUT, checked(&table)); /* words, but no cells */
    table.n_sigma = 0U;
    table.sigma = NULL;
    table.n_probes = 0U;
    table.probes = NULL;
    table.parts = GTC_PART_COVERAGE;
    CHECK_INT(GTC_OK, checked(&table));
}

/* Of a state that was overwritten, so that the next correction would be no number: the constant correction. */
#ifndef GTC_CHECKED_H_INCLUDED
TEST(a_correction_that_is_no_number_is_the_fallback)
{
    state_t state = started();
    num_t temp = C(15);

    (void)ramp(&state, &temp, C(0.015625), (int)N * 5);
    spoil_input(&state);
    CHECK_INT(GTC_HELD | GTC_FALLBACK, feed(&state, temp, 1) & (GTC_HELD | GTC_FALLBACK));
    CHECK(same(bias_of(&state), WORD_OF(TABLE.fallback)));
}
#endif

TEST(a_table_that_this_build_cannot_use_is_refused)
{
    table_t table;

#define REFUSED(change)                           \
    do {                                          \
        table = TABLE;                            \
        change;                                   \
        CHECK_INT(GTC_E_LAYOUT, checked(&table)); \
    } while (0)

    REFUSED(table.layout = 1U);
    REFUSED(table.quantity = 1U);
    REFUSED(table.unit = 1U);
    REFUSED(table.slope_blocks = 1U);
    REFUSED(table.slope_blocks = GTC_MAX_SLOPE_BLOCKS + 1U);
    REFUSED(table.lead_blocks = 2U);
    REFUSED(table.block_us = 0U);
    REFUSED(table.serial = NULL);
    REFUSED(table.guards = NULL);
    REFUSED(table.n_sigma = 0U);
    REFUSED(table.sigma_cells[0] = 0U);
    REFUSED(table.n_sigma = 0U; table.sigma_cells[0] = 0U; table.sigma_cells[1] = 0U);
    REFUSED(table.n_networks = 0U);
    REFUSED(table.n_networks = 17U);
    REFUSED(table.networks = NULL);
    REFUSED(table.n_centers = 2U);
    REFUSED(table.n_centers = 513U);
    REFUSED(table.n_centers = 0U);
    REFUSED(table.centers = NULL);
    REFUSED(table.n_terms = 1U);
    REFUSED(table.n_channels = 0U);
    REFUSED(table.probes = NULL);
    REFUSED(table.n_probes = 4097U);
    REFUSED(table.coverage = NULL);
    REFUSED(table.coverage_cells[0] = 257U);
    REFUSED(table.coverage_cells[1] = 257U);
    REFUSED(table.coverage_cells[1] = 0U);
    REFUSED(table.sigma = NULL);
    REFUSED(table.envelope[0] = table.envelope[1]; table.envelope[1] = TABLE.envelope[0]);
    REFUSED(table.envelope[2] = table.envelope[3]; table.envelope[3] = TABLE.envelope[2]);
#undef REFUSED
}

/* What no array of a state has room for, whether it was checked or not. */
TEST(a_state_is_not_started_for_a_table_beyond_the_options_of_the_build)
{
    state_t state;
    table_t table;

#define REFUSED(change)                                            \
    do {                                                           \
        table = TABLE;                                             \
        change;                                                    \
        CHECK_INT(GTC_E_LAYOUT, init(&state, &table, PERIOD)); \
    } while (0)

    REFUSED(table.layout = GTC_TABLE_LAYOUT + 1U);
    REFUSED(table.slope_blocks = GTC_MAX_SLOPE_BLOCKS + 1U);
    REFUSED(table.n_terms = GTC_MAX_TERMS + 1U);
    REFUSED(table.n_channels = GTC_MAX_TERMS + 2U);
#undef REFUSED
}

TEST(bad_arguments_are_refused)
{
    state_t state = started();
    const num_t temp = C(15.0);
    num_t bias = 0;

    CHECK_INT(GTC_E_ARG, init(NULL, &TABLE, PERIOD));
    CHECK_INT(GTC_E_ARG, init(&state, NULL, PERIOD));
    CHECK_INT(GTC_E_ARG, init(&state, &TABLE, 0U));
    CHECK_INT(GTC_E_ARG, sample(NULL, PERIOD, &temp));
    CHECK_INT(GTC_E_ARG, sample(NULL, PERIOD, NULL));
    CHECK_INT(GTC_E_ARG, get_bias(NULL, &bias));
    CHECK_INT(GTC_E_ARG, get_bias(&state, NULL));
    memset(&state, 0, sizeof state);
    CHECK_INT(GTC_E_ARG, sample(&state, PERIOD, &temp));
    CHECK_INT(GTC_E_ARG, sample(&state, PERIOD, NULL));
    CHECK_INT(GTC_E_ARG, get_bias(&state, &bias));
}

/* A flipped bit can make a period of one microsecond, or a block of one sample, 0. */
TEST(a_state_that_lost_its_times_is_refused_and_ends)
{
    const num_t temp = C(15.0);
    int lost;

    for (lost = 0; lost < 2; lost++) {
        state_t state = started();

        if (lost == 0) {
            state.samples_per_block = 0U;
        } else {
            state.period_us = 0U;
        }
        CHECK_INT(GTC_E_ARG, sample(&state, 0xE0000000UL, NULL));
        CHECK_INT(GTC_E_ARG, sample(&state, 0UL, &temp));
    }
}

int main(void)
{
    RUN(a_block_of_one_or_two_samples_counts_with_one);
    RUN(before_the_first_sample_the_correction_is_zero_and_held);
    RUN(the_first_valid_sample_gives_the_map_at_slope_0);
    RUN(a_correction_is_in_force_for_a_block);
    RUN(a_full_window_gives_the_slope);
    RUN(missing_samples_are_held_and_do_not_move_the_mean);
    RUN(impossible_samples_are_held);
    RUN(a_window_with_a_hole_still_gives_the_slope);
    RUN(a_window_with_too_many_holes_warms_again);
    RUN(a_long_window_needs_half_of_its_blocks);
    RUN(the_gap_is_counted_no_further_than_a_word);
    RUN(too_many_invalid_blocks_end_in_the_constant_correction_and_a_restart);
    RUN(a_first_conversion_alone_is_not_accepted);
    RUN(a_jump_is_held_until_samples_agree_for_long_enough);
    RUN(agreement_takes_as_long_with_quick_samples);
    RUN(after_a_loss_readings_must_agree_again);
    RUN(a_sensor_dead_from_power_up_ends_in_the_constant_correction);
    RUN(a_period_of_which_no_whole_number_makes_a_block_is_refused);
    RUN(a_long_time_without_samples_is_the_same_in_one_call_and_in_many);
    RUN(stamped_samples_are_the_samples_of_their_slots);
    RUN(a_clock_that_stands_still_ends_in_the_fallback);
    RUN(stamps_tell_lost_samples_late_ones_and_a_clock_that_is_off);
    RUN(a_table_with_a_lead_looks_a_block_ahead);
    RUN(no_correction_leaves_the_authority);
    RUN(candidates_that_disagree_or_follow_something_impossible_start_again);
    RUN(candidates_that_are_stuck_start_again);
    RUN(a_missing_sample_is_neither_for_nor_against_a_candidate);
    RUN(two_readings_are_not_accepted_however_far_apart_they_are);
    RUN(a_candidate_is_forgotten_when_a_channel_would_be);
    RUN(candidates_may_lie_as_far_apart_as_accepted_readings);
    RUN(the_longer_the_gap_the_larger_the_accepted_step);
    RUN(a_stuck_sensor_is_held_after_as_many_samples_as_the_table_says);
    RUN(a_table_that_accepts_any_number_of_identical_samples);
    RUN(missed_is_the_same_as_missing_samples);
    RUN(a_part_that_a_table_does_not_name_is_refused);
    RUN(a_table_with_the_map_alone_is_usable);
#ifndef GTC_CHECKED_H_INCLUDED
    RUN(a_correction_that_is_no_number_is_the_fallback);
#endif
    RUN(a_table_that_this_build_cannot_use_is_refused);
    RUN(a_state_is_not_started_for_a_table_beyond_the_options_of_the_build);
    RUN(bad_arguments_are_refused);
    RUN(a_state_that_lost_its_times_is_refused_and_ends);
    return test_end();
}
