/* test_terms.c - extension terms, narrow widths and harmonics, in what they do to the correction. */
#include "test_num.h"

#define STEP C(0.015625)

static state_t started_with(const table_t *table)
{
    state_t state;

    CHECK_INT(GTC_OK, FN(init)(&state, table, N));
    return state;
}

static int sample(state_t *state, num_t temp, num_t supply)
{
    num_t channels[2];

    channels[0] = temp;
    channels[1] = supply;
    return FN(sample)(state, channels);
}

static int samples(state_t *state, num_t temp, num_t supply, int n)
{
    int status = GTC_E_ARG;
    int i;

    for (i = 0; i < n; i++) {
        status = sample(state, temp, supply);
    }
    return status;
}

TEST(tables_with_terms_pass_their_self_test)
{
    CHECK_INT(GTC_OK, FN(check)(&TERMS));
    CHECK_INT(GTC_OK, FN(check)(&NARROW));
}

TEST(at_rest_memories_and_plays_come_to_rest_and_warm_up_fades)
{
    state_t a = started_with(&TERMS);
    num_t bias;

    CHECK_INT(GTC_WARMING, sample(&a, C(15.0), C(12.0)));
    bias = bias_of(&a);
    CHECK_INT(GTC_OK, samples(&a, C(15.0), C(12.0), 2000));
    /* Only the warm-up is left of a constant temperature, and it is over. */
    CHECK(!same(bias, bias_of(&a)));
    CHECK_INT(GTC_OK, FN(map)(&TERMS, C(15.0), C(0.0), &bias));
    CHECK(same(bias, bias_of(&a)));
}

TEST(an_auxiliary_channel_is_added_and_held_when_it_is_missing)
{
    state_t a = started_with(&TERMS);
    state_t b = started_with(&TERMS);

    (void)samples(&a, C(15.0), C(12.0), 400);
    (void)samples(&b, C(15.0), C(13.0), 400);
    CHECK(!same(bias_of(&a), bias_of(&b)));
    CHECK_INT(GTC_OK, status_of(&b));
    /* Held from the block on that has too few samples of it; the last mean stays. */
    (void)samples(&b, C(15.0), MISSING, 8);
    CHECK_INT(GTC_HELD, status_of(&b));
    (void)samples(&b, C(15.0), C(13.0), 8);
    CHECK_INT(GTC_OK, status_of(&b));
}

TEST(without_a_first_auxiliary_sample_nothing_is_added)
{
    state_t a = started_with(&TERMS);
    state_t b = started_with(&TERMS);

    CHECK_INT(GTC_WARMING | GTC_HELD, sample(&a, C(15.0), MISSING));
    CHECK_INT(GTC_WARMING, sample(&b, C(15.0), C(12.0)));
    CHECK(same(bias_of(&a), bias_of(&b)));
    /* Channel first, temperature later. */
    a = started_with(&TERMS);
    CHECK_INT(GTC_HELD, samples(&a, MISSING, C(12.0), 9));
    CHECK_INT(GTC_WARMING, sample(&a, C(15.0), MISSING));
}

TEST(a_play_moves_only_when_the_temperature_has_gone_its_way)
{
    state_t a = started_with(&TERMS);
    num_t temp = C(15.0);
    int k;

    (void)sample(&a, temp, C(12.0));
    for (k = 0; k < 100; k++) {
        temp += STEP;
        (void)sample(&a, temp, C(12.0));
    }
    CHECK(same(C(15.0), a.term[1][0]));
    for (k = 0; k < 100; k++) {
        temp += STEP;
        (void)sample(&a, temp, C(12.0));
    }
    CHECK(!same(C(15.0), a.term[1][0]));
    for (k = 0; k < 1000; k++) {
        temp -= STEP;
        (void)sample(&a, temp, C(12.0));
    }
    CHECK(a.term[1][0] < C(15.0));
}

TEST(holds_and_fallback_step_the_terms_too)
{
    state_t a = started_with(&TERMS);
    num_t temp = C(15.0);
    num_t z;
    int k;

    for (k = 0; k < 30; k++) {
        temp += STEP;
        (void)sample(&a, temp, C(12.0));
    }
    z = a.term[0][0];
    CHECK((FN(missed)(&a, 3U * N) & GTC_HELD) != 0);
    CHECK(a.term[0][0] > z);
    CHECK((FN(missed)(&a, 1000000UL) & GTC_FALLBACK) != 0);
    CHECK((FN(missed)(&a, 0xFFFFFFFFUL) & GTC_FALLBACK) != 0);
    CHECK_INT(GTC_WARMING, samples(&a, C(15.0), C(12.0), 3) & GTC_WARMING);
}

TEST(a_harmonic_repeats_itself_after_its_period)
{
    state_t state;
    num_t at[6];
    num_t map = 0;
    int k;

    /* Period 8 C, amplitude 0.25 deg/h; the memory is at its first temperature. */
    for (k = 0; k < 6; k++) {
        const num_t temp = C(22.0) + ((num_t)k * C(2.0));

        state = started_with(&NARROW);
        (void)sample(&state, temp, 0);
        CHECK(FN(map)(&NARROW, temp, 0, &map) >= 0);
        at[k] = bias_of(&state) - map;
    }
    CHECK(at[0] - at[4] < C(0.0001));
    CHECK(at[4] - at[0] < C(0.0001));
    CHECK(at[1] - at[5] < C(0.0001));
    CHECK(at[1] > 0);
    CHECK(at[3] < 0);
    state = started_with(&NARROW);
    (void)sample(&state, C(-17.5), 0);
    CHECK_INT(GTC_WARMING, status_of(&state));
}

TEST(narrow_gaussians_are_there_where_they_are)
{
    num_t at = 0;
    num_t beside = 0;

    CHECK_INT(GTC_OK, FN(map)(&NARROW, C(-10.0), C(0.0625), &at));
    CHECK_INT(GTC_OK, FN(map)(&NARROW, C(-14.0), C(0.0625), &beside));
    CHECK(at > beside);
    CHECK_INT(GTC_OK, FN(map)(&NARROW, C(55.0), C(-0.4), &at));
}

TEST(memories_and_plays_outlast_a_time_without_power)
{
    gtc_word_t words[GTC_SAVE_WORDS];
    state_t a = started_with(&TERMS);
    state_t fresh = started_with(&TERMS);
    state_t soon;
    state_t late;
    int k;

    for (k = 0; k < 40; k++) {
        (void)sample(&a, C(15.0) + (STEP * (num_t)(4 * k)), C(12.0));
    }
    CHECK_INT(GTC_OK, FN(save)(&a, words));
    CHECK_INT(GTC_OK, FN(restore)(&soon, &TERMS, N, words, 3U));
    CHECK_INT(GTC_OK, FN(restore)(&late, &TERMS, N, words, 100000UL));
    CHECK_INT(GTC_HELD, status_of(&soon));
    CHECK((sample(&soon, C(12.0), C(12.0)) & GTC_WARMING) != 0);
    (void)sample(&late, C(12.0), C(12.0));
    (void)sample(&fresh, C(12.0), C(12.0));
    /* Three blocks are not enough to forget; a hundred thousand are, but not for the play. */
    CHECK(soon.term[0][0] > C(12.5));
    CHECK(late.term[0][0] - C(12.0) < C(0.001));
    CHECK(C(12.0) - late.term[0][0] < C(0.001));
    CHECK(same(C(14.0), late.term[1][0]));
    CHECK(same(C(12.0), fresh.term[1][0]));
}

TEST(times_without_power_add_up)
{
    gtc_word_t words[GTC_SAVE_WORDS];
    state_t a = started_with(&TERMS);

    CHECK_INT(GTC_OK, FN(save)(&a, words));
    CHECK_INT(GTC_OK, FN(restore)(&a, &TERMS, N, words, 5U));
    CHECK_INT(GTC_OK, FN(save)(&a, words));
    CHECK_INT(GTC_OK, FN(restore)(&a, &TERMS, N, words, 6U));
    CHECK_INT(11, a.off_blocks);
    CHECK_INT(GTC_OK, FN(save)(&a, words));
    CHECK_INT(GTC_OK, FN(restore)(&a, &TERMS, N, words, 0xFFFFFFFAUL));
    CHECK(a.off_blocks == 0xFFFFFFFFUL);
    (void)sample(&a, C(12.0), C(12.0));
    CHECK_INT(GTC_OK, FN(save)(&a, words));
    CHECK_INT(GTC_OK, FN(restore)(&a, &TERMS, N, words, 6U));
    CHECK_INT(6, a.off_blocks);
}

/* No block ends before the first believed temperature; the sum of the channel must not grow for ever. */
TEST(a_channel_is_not_summed_without_end_where_the_temperature_is_missing)
{
    state_t state = started_with(&TERMS);

    (void)samples(&state, MISSING, C(13.0), 100);
    CHECK_INT(N, state.channel_valid[3]);
    CHECK_INT(GTC_WARMING, sample(&state, C(15.0), C(12.0)));
}

#if !TEST_Q31
/* A sum of such samples could be infinite, and the correction no number. */
TEST(a_sample_of_a_channel_that_no_sensor_gives_is_a_missing_one)
{
    state_t a = started_with(&TERMS);
    state_t b = started_with(&TERMS);
    int k;

    (void)samples(&a, C(15.0), C(12.0), (int)N);
    (void)samples(&b, C(15.0), C(12.0), (int)N);
    for (k = 0; k < 40; k++) {
        (void)sample(&a, C(15.0), ((k % 2) != 0) ? 3.0e38F : -3.0e38F);
        (void)sample(&b, C(15.0), MISSING);
        CHECK(same(bias_of(&a), bias_of(&b)));
    }
}
#endif

#if TEST_Q31
/* Differences within a block of up to 2^32. */
TEST(an_auxiliary_channel_has_the_mean_of_its_extremes)
{
    state_t state = started_with(&TERMS);

    (void)samples(&state, C(15.0), 0, (int)N);
    (void)sample(&state, C(15.0), -0x7FFFFFFF);
    (void)samples(&state, C(15.0), 0x7FFFFFFF, (int)N - 1);
    (void)sample(&state, C(15.0), 0);
    CHECK_INT(0x40000000, state.term[3][0]);
}

TEST(what_terms_add_saturates)
{
    table_t table = TERMS;
    gtc_word_t terms[4 * GTC_TERM_WORDS];
    state_t state;

    memcpy(terms, TERMS.terms, sizeof terms);
    terms[(3 * GTC_TERM_WORDS) + 2].integer = 0x3FFFFFFF; /* slope of the auxiliary term */
    table.terms = terms;
    state = started_with(&table);
    (void)sample(&state, C(15.0), C(30000.0));
    CHECK_INT(0x7FFFFFFF, bias_of(&state));
    state = started_with(&table);
    (void)sample(&state, C(15.0), C(-30000.0));
    CHECK_INT(-0x7FFFFFFF, bias_of(&state));
    /* And so does a slope that a memory makes. */
    terms[2 + 2].integer = 0x7FFFFFFF;
    state = started_with(&table);
    (void)sample(&state, C(15.0), C(12.0));
    CHECK((FN(missed)(&state, 1000UL) & GTC_FALLBACK) != 0);
    (void)samples(&state, C(190.0), C(12.0), 3);
    CHECK((status_of(&state) & GTC_CLAMPED) != 0);
}
#endif

TEST(terms_without_their_code_or_channel_are_refused)
{
    table_t table = TERMS;
    state_t state;

    table.term_code[1] = NULL;
    CHECK_INT(GTC_E_LAYOUT, FN(init)(&state, &table, N));
    table.term_code[1] = TERMS.term_code[0];
    CHECK_INT(GTC_E_LAYOUT, FN(init)(&state, &table, N));
    table = TERMS;
    table.n_channels = 1U;
    CHECK_INT(GTC_E_LAYOUT, FN(init)(&state, &table, N));
    table.n_channels = GTC_MAX_TERMS + 2U;
    CHECK_INT(GTC_E_LAYOUT, FN(init)(&state, &table, N));
}

int main(void)
{
    RUN(tables_with_terms_pass_their_self_test);
    RUN(at_rest_memories_and_plays_come_to_rest_and_warm_up_fades);
    RUN(an_auxiliary_channel_is_added_and_held_when_it_is_missing);
    RUN(a_channel_is_not_summed_without_end_where_the_temperature_is_missing);
#if !TEST_Q31
    RUN(a_sample_of_a_channel_that_no_sensor_gives_is_a_missing_one);
#endif
    RUN(without_a_first_auxiliary_sample_nothing_is_added);
    RUN(a_play_moves_only_when_the_temperature_has_gone_its_way);
    RUN(holds_and_fallback_step_the_terms_too);
    RUN(a_harmonic_repeats_itself_after_its_period);
    RUN(narrow_gaussians_are_there_where_they_are);
    RUN(memories_and_plays_outlast_a_time_without_power);
    RUN(times_without_power_add_up);
#if TEST_Q31
    RUN(an_auxiliary_channel_has_the_mean_of_its_extremes);
    RUN(what_terms_add_saturates);
#endif
    RUN(terms_without_their_code_or_channel_are_refused);
    return test_end();
}
