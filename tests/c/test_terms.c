/* test_terms.c - extension terms, narrow widths and harmonics, in what they do to the correction. */
#include "test_image.h"

#define STEP C(0.015625)

static state_t started_with(const table_t *table)
{
    state_t state;

    CHECK_INT(GTC_OK, init(&state, table, PERIOD));
    return state;
}

static int sample_both(state_t *state, num_t temp, num_t supply)
{
    num_t channels[2];

    channels[0] = temp;
    channels[1] = supply;
    return feed_one(state, channels);
}

static int samples(state_t *state, num_t temp, num_t supply, int n)
{
    int status = GTC_E_ARG;
    int i;

    for (i = 0; i < n; i++) {
        status = sample_both(state, temp, supply);
    }
    return status;
}

static num_t map_with(const table_t *table, num_t temp)
{
    num_t bias = 0;

    CHECK(FN(map)(table, temp, 0, &bias) >= 0);
    return bias;
}

static int within(const table_t *table, num_t bias)
{
#if TEST_Q31
    return ((bias >= table->authority[0]) && (bias <= table->authority[1])) ? 1 : 0;
#else
    return ((bias >= table->authority[0].value) && (bias <= table->authority[1].value)) ? 1 : 0;
#endif
}

TEST(tables_with_terms_pass_their_self_test)
{
    CHECK_INT(GTC_OK, FN(check)(&TERMS));
    CHECK_INT(GTC_OK, FN(check)(&NARROW));
    CHECK_INT(GTC_OK, FN(check)(&CURVED));
}

TEST(at_rest_memories_and_plays_come_to_rest_and_warm_up_fades)
{
    state_t a = started_with(&TERMS);
    num_t bias;

    CHECK_INT(GTC_WARMING, sample_both(&a, C(15.0), C(12.0)));
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

/* What the terms of CURVED add at a temperature and a supply within their envelope and guard, deg/h. */
static double added_at(num_t temp, num_t supply)
{
    state_t state = started_with(&CURVED);
#if TEST_Q31
    const double unit = 1.0 / (double)(1UL << CURVED.bias_frac_bits);
#else
    const double unit = 1.0;
#endif

    CHECK_INT(GTC_OK, samples(&state, temp, supply, 40));
    return ((double)bias_of(&state) - (double)map_with(&CURVED, temp)) * unit;
}

static int is_about(double want, double found)
{
    return ((found - want < 2.0e-6) && (want - found < 2.0e-6)) ? 1 : 0;
}

/* tests/c/model_curve.json: 0.125 (u - 11) + 0.25 e^-((u - 11) / 0.5)^2 - 0.0625 e^-((u - 13) / 0.5)^2, and
 * (0.0625 + 0.03125 (T - 15)) (u - 12). */
TEST(a_curve_is_a_line_and_two_gaussians)
{
    CHECK(is_about(0.25 - 0.0625, added_at(C(15.0), C(11.0))));
    CHECK(is_about(0.125 + (0.1875 * 0.01831563889), added_at(C(15.0), C(12.0))));
    CHECK(is_about(0.25 - 0.0625 + 0.0625, added_at(C(15.0), C(13.0))));
    /* far from both centers: one is cut off, or both */
    CHECK(is_about(-0.25 + (0.25 * 1.125351747e-07) - 0.1875, added_at(C(15.0), C(9.0))));
    CHECK(is_about(0.5 - (0.0625 * 1.125351747e-07) + 0.1875, added_at(C(15.0), C(15.0))));
}

TEST(a_product_has_another_slope_at_another_temperature)
{
    const double at_15 = added_at(C(15.0), C(14.0)) - added_at(C(15.0), C(12.0));
    const double at_17 = added_at(C(17.0), C(14.0)) - added_at(C(17.0), C(12.0));

    CHECK(is_about(2.0 * 2.0 * 0.03125, at_17 - at_15));
}

TEST(a_curve_of_a_lost_channel_is_that_of_its_fallback)
{
    state_t a = started_with(&CURVED);
    state_t b = started_with(&CURVED);

    (void)samples(&a, C(15.0), C(12.5), 400);
    (void)samples(&b, C(15.0), C(9.5), 400);
    CHECK(!same(bias_of(&a), bias_of(&b)));
    (void)samples(&b, C(15.0), MISSING, 40);
    CHECK((status_of(&b) & GTC_CHANNEL_LOST) != 0);
    CHECK(same(bias_of(&a), bias_of(&b)));
}

#if TEST_Q31
/* With any guard, center, gain and weight that `open` takes: the sums keep to their words. */
TEST(a_curve_at_the_ends_of_all_ranges_stays_a_number)
{
    static const int_least32_t ends[3] = {-1073741823, 0, 1073741823};
    gtc_word_t guards[2U * GTC_GUARD_WORDS];
    gtc_word_t terms[2U * GTC_TERM_WORDS];
    table_t table = CURVED;
    unsigned k;

    memcpy(guards, CURVED.guards, sizeof guards);
    memcpy(terms, CURVED.terms, sizeof terms);
    guards[GTC_GUARD_WORDS].integer = -2147483647;
    guards[GTC_GUARD_WORDS + 1U].integer = 2147483647;
    guards[GTC_GUARD_WORDS + 2U].integer = 2147483647;
    table.guards = guards;
    table.terms = terms;
    for (k = 0U; k < 81U; k++) {
        state_t state;

        terms[2].integer = ends[k % 3U];
        terms[3].integer = ((k & 1U) != 0U) ? 2147483647 : 1;
        terms[4].integer = ends[(k / 3U) % 3U];
        terms[5].integer = ends[(k / 9U) % 3U] / 2;
        terms[6].integer = ends[(k / 27U) % 3U];
        terms[7].integer = 536870912;
        terms[10].integer = ends[k % 3U];
        terms[12].integer = ends[(k / 3U) % 3U];
        terms[13].integer = ends[(k / 9U) % 3U];
        state = started_with(&table);
        (void)sample_both(&state, C(15.0), ((k & 2U) != 0U) ? 2147483647 : -2147483647);
        CHECK((bias_of(&state) >= CURVED.authority[0]) && (bias_of(&state) <= CURVED.authority[1]));
    }
}
#endif

TEST(a_play_moves_only_when_the_temperature_has_gone_its_way)
{
    state_t a = started_with(&TERMS);
    num_t temp = C(15.0);
    int k;

    (void)sample_both(&a, temp, C(12.0));
    for (k = 0; k < 100; k++) {
        temp += STEP;
        (void)sample_both(&a, temp, C(12.0));
    }
    CHECK(same(C(15.0), a.term[1][0]));
    for (k = 0; k < 100; k++) {
        temp += STEP;
        (void)sample_both(&a, temp, C(12.0));
    }
    CHECK(!same(C(15.0), a.term[1][0]));
    for (k = 0; k < 1000; k++) {
        temp -= STEP;
        (void)sample_both(&a, temp, C(12.0));
    }
    CHECK(a.term[1][0] < C(15.0));
}

/* The bias with the play's strength, growth and reference of T, after some way down. */
static num_t played_with(double strength, double growth, double middle, num_t temp)
{
    gtc_word_t terms[4U * GTC_TERM_WORDS];
    gtc_word_t *const play = &terms[GTC_TERM_WORDS];
    table_t table = TERMS;
    state_t state;
    int k;

    memcpy(terms, TERMS.terms, sizeof(gtc_word_t) * table.n_terms * GTC_TERM_WORDS);
    CHECK_INT((int)GTC_TERM_PLAY, (int)play[0].bits);
#if TEST_Q31
    play[3].integer = (int_least32_t)(strength * (double)(1UL << table.bias_frac_bits));
    play[4].integer = (int_least32_t)(growth * (double)(1UL << table.bias_frac_bits));
    play[5].integer = C(middle);
#else
    play[3].value = (float)strength;
    play[4].value = (float)growth;
    play[5].value = (float)middle;
#endif
    table.terms = terms;
    state = started_with(&table);
    for (k = 256; k > 0; k--) {
        (void)sample_both(&state, temp + ((num_t)k * STEP), C(12.0));
    }
    (void)samples(&state, temp, C(12.0), 4000);
    return bias_of(&state);
}

TEST(a_play_may_have_another_strength_at_another_temperature)
{
    CHECK(same(played_with(0.03125, 0.0, 0.0, C(15.0)), played_with(0.03125, 0.0009765625, 15.0, C(15.0))));
    CHECK(same(played_with(0.0390625, 0.0, 0.0, C(23.0)), played_with(0.03125, 0.0009765625, 15.0, C(23.0))));
    CHECK(same(played_with(0.0, 0.0, 0.0, C(7.0)), played_with(0.03125, 0.00390625, 15.0, C(7.0))));
    CHECK(!same(played_with(0.03125, 0.0, 0.0, C(23.0)), played_with(0.03125, 0.0009765625, 15.0, C(23.0))));
}

TEST(holds_and_fallback_step_the_terms_too)
{
    state_t a = started_with(&TERMS);
    num_t temp = C(15.0);
    num_t z;
    int k;

    for (k = 0; k < 30; k++) {
        temp += STEP;
        (void)sample_both(&a, temp, C(12.0));
    }
    z = a.term[0][0];
    CHECK((missed(&a, 3U * N) & GTC_HELD) != 0);
    CHECK(a.term[0][0] > z);
    CHECK((missed(&a, 1000000UL) & GTC_FALLBACK) != 0);
    CHECK((missed(&a, 0xFFFFFFFFUL) & GTC_FALLBACK) != 0);
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
        (void)sample_both(&state, temp, 0);
        CHECK(FN(map)(&NARROW, temp, 0, &map) >= 0);
        at[k] = bias_of(&state) - map;
    }
    CHECK(at[0] - at[4] < C(0.0001));
    CHECK(at[4] - at[0] < C(0.0001));
    CHECK(at[1] - at[5] < C(0.0001));
    CHECK(at[1] > 0);
    CHECK(at[3] < 0);
    state = started_with(&NARROW);
    (void)sample_both(&state, C(-17.5), 0);
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

TEST(memories_and_plays_are_kept_over_a_time_without_power)
{
    gtc_word_t words[GTC_SAVE_WORDS];
    state_t a = started_with(&TERMS);
    state_t fresh = started_with(&TERMS);
    state_t soon;
    state_t late;
    int k;

    for (k = 0; k < 40; k++) {
        (void)sample_both(&a, C(15.0) + (STEP * (num_t)(4 * k)), C(12.0));
    }
    CHECK_INT(GTC_OK, save(&a, words));
    CHECK_INT(GTC_OK, restore(&soon, &TERMS, PERIOD, words, 3U));
    CHECK_INT(GTC_OK, restore(&late, &TERMS, PERIOD, words, 100000UL));
    CHECK_INT(GTC_HELD, status_of(&soon));
    CHECK((sample_both(&soon, C(12.0), C(12.0)) & GTC_WARMING) != 0);
    (void)sample_both(&late, C(12.0), C(12.0));
    (void)sample_both(&fresh, C(12.0), C(12.0));
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

    CHECK_INT(GTC_OK, save(&a, words));
    CHECK_INT(GTC_OK, restore(&a, &TERMS, PERIOD, words, 5U));
    CHECK_INT(GTC_OK, save(&a, words));
    CHECK_INT(GTC_OK, restore(&a, &TERMS, PERIOD, words, 6U));
    CHECK_INT(11, a.off_blocks);
    CHECK_INT(GTC_OK, save(&a, words));
    CHECK_INT(GTC_OK, restore(&a, &TERMS, PERIOD, words, 0xFFFFFFFAUL));
    CHECK(a.off_blocks == 0xFFFFFFFFUL);
    (void)sample_both(&a, C(12.0), C(12.0));
    CHECK_INT(GTC_OK, save(&a, words));
    CHECK_INT(GTC_OK, restore(&a, &TERMS, PERIOD, words, 6U));
    CHECK_INT(6, a.off_blocks);
}

/* Before: sums of numbers that no call leaves overflowed, with a right CRC. */
TEST(a_forged_state_is_refused_before_anything_is_computed_of_it)
{
    gtc_word_t words[GTC_SAVE_WORDS];
    const state_t fresh = started_with(&TERMS);
    state_t a = started_with(&TERMS);
    state_t b;

    CHECK_INT(GTC_WARMING, samples(&a, C(15.0), C(12.0), 3));
    b = a;
    CHECK_INT(GTC_OK, save(&b, words));
    CHECK_INT(GTC_OK, restore(&b, &TERMS, PERIOD, words, 0U));
    b = a;
    b.term[0][0] = fresh.term[0][0]; /* a memory that has begun and remembers nothing */
    CHECK_INT(GTC_OK, save(&b, words));
    CHECK_INT(GTC_E_IMAGE, restore(&b, &TERMS, PERIOD, words, 0U));
    b = a;
    b.input[0].valid = 0xFFFFFFFFUL; /* more readings than samples */
    b.position = 0xFFFFFFFFUL;
    CHECK_INT(GTC_OK, save(&b, words));
    CHECK_INT(GTC_E_IMAGE, restore(&b, &TERMS, PERIOD, words, 0U));
}

/* ---- what a sensor of a channel can deliver ---- */

/* Edges of the guard of the supply: 9 and 15 V; fallback 12.5 V after 4 blocks. */
TEST(a_reading_beyond_its_range_is_taken_as_the_edge_and_said)
{
    static const double readings[4] = {0.0, -300.0, 4095.0, 20000.0};
    int k;

    for (k = 0; k < 4; k++) {
        state_t a = started_with(&TERMS);
        state_t b = started_with(&TERMS);
        const num_t edge = (readings[k] < 9.0) ? C(9.0) : C(15.0);

        (void)samples(&a, C(15.0), C(12.0), 401);
        (void)samples(&b, C(15.0), C(12.0), 401);
        CHECK_INT(GTC_OK, status_of(&a));
        (void)samples(&a, C(15.0), C(readings[k]), 9);
        (void)samples(&b, C(15.0), edge, 9);
        CHECK_INT(GTC_CLAMPED, status_of(&a));
        CHECK_INT(GTC_OK, status_of(&b));
        CHECK(same(bias_of(&a), bias_of(&b)));
        (void)samples(&a, C(15.0), C(12.0), 9);
        CHECK_INT(GTC_OK, status_of(&a));
    }
}

#if !TEST_Q31
TEST(no_reading_makes_a_correction_that_is_no_number)
{
    static const float readings[4] = {1.0e20F, -3.0e38F, 3.0e38F, 1.0e-40F};
    int k;

    for (k = 0; k < 4; k++) {
        state_t state = started_with(&TERMS);
        const num_t low = TERMS.authority[0].value;
        const num_t high = TERMS.authority[1].value;
        int j;

        for (j = 0; j < 40; j++) {
            (void)sample_both(&state, C(15.0), readings[(j + k) % 4]);
            CHECK((bias_of(&state) >= low) && (bias_of(&state) <= high));
        }
        CHECK((status_of(&state) & GTC_CLAMPED) != 0);
    }
}
#endif

/* The test table, where the guard's fallback stands for the channel. */
static table_t without_fallback_model(gtc_word_t terms[4U * GTC_TERM_WORDS])
{
    table_t table = TERMS;

    memcpy(terms, TERMS.terms, 4U * GTC_TERM_WORDS * sizeof terms[0]);
    terms[(3U * GTC_TERM_WORDS) + 1U].bits = 1U;
    table.terms = terms;
    table.n_fallback_models = 0U;
    table.n_centers = TERMS.networks[0].bits;
    return table;
}

/* The fallback model of the test table's channel, as a map. */
static table_t fallback_model_alone(void)
{
    table_t table = TERMS;

    table.networks = &TERMS.networks[GTC_NETWORK_WORDS];
    table.centers = &TERMS.centers[TERMS.networks[0].bits * GTC_CENTER_WORDS];
    table.n_fallback_models = 0U;
    table.n_centers = table.networks[0].bits;
    return table;
}

TEST(a_fallback_model_is_added_while_nothing_of_its_channel_is_accepted)
{
    const table_t alone = fallback_model_alone();
    const num_t plain = map_with(&TERMS, C(15.0));
    const num_t instead = plain + map_with(&alone, C(15.0));
    state_t a = started_with(&TERMS);
    state_t b = started_with(&TERMS);

    CHECK(!same(plain, instead));
    (void)samples(&a, C(15.0), MISSING, 2001);
    CHECK_INT(GTC_HELD | GTC_CHANNEL_LOST, status_of(&a));
    CHECK(same(instead, bias_of(&a)));
    /* It comes back: the term is there again. Then it stays away, held first. */
    (void)samples(&a, C(15.0), C(12.0), (int)N);
    CHECK_INT(GTC_OK, status_of(&a));
    CHECK(same(plain, bias_of(&a)));
    (void)samples(&a, C(15.0), MISSING, (int)(4U * N));
    CHECK_INT(GTC_HELD, status_of(&a));
    CHECK(same(plain, bias_of(&a)));
    (void)samples(&a, C(15.0), MISSING, (int)N);
    CHECK(same(instead, bias_of(&a)));
    /* And at another temperature. */
    (void)samples(&b, C(40.0), MISSING, 2001);
    CHECK(same(map_with(&TERMS, C(40.0)) + map_with(&alone, C(40.0)), bias_of(&b)));
}

/* A reading at either edge of its range is doubtful by what it adds beyond the fallback model, or beyond nothing. */
TEST(a_reading_at_the_edge_says_how_far_it_may_be_wrong)
{
    gtc_word_t terms[4U * GTC_TERM_WORDS];
    const table_t without = without_fallback_model(terms);
    int k;

    for (k = 0; k < 4; k++) {
        state_t a = started_with((k < 2) ? &TERMS : &without);
        const num_t reading = ((k % 2) == 0) ? C(-300.0) : C(300.0);

        (void)samples(&a, C(15.0), C(12.0), 401);
        CHECK(a.uncertainty.edge_effect == 0);
        (void)samples(&a, C(15.0), reading, 20);
        CHECK_INT(GTC_CLAMPED, status_of(&a));
        CHECK(a.uncertainty.edge_effect > 0);
    }
}

/* CURVED with two fallback models, both the map's own network. */
TEST(bent_lines_and_products_have_fallback_models_too)
{
    const uint_least32_t n = CURVED.networks[0].bits;
    gtc_word_t networks[3U * GTC_NETWORK_WORDS];
    gtc_word_t centers[3U * 64U * GTC_CENTER_WORDS];
    gtc_word_t terms[2U * GTC_TERM_WORDS];
    table_t table = CURVED;
    state_t state;
    num_t map;
    uint_least32_t k;

    CHECK((n <= 64U) && (CURVED.n_networks == 1U));
    memcpy(terms, CURVED.terms, sizeof terms);
    for (k = 0U; k < 3U; k++) {
        memcpy(&networks[k * GTC_NETWORK_WORDS], CURVED.networks, GTC_NETWORK_WORDS * sizeof networks[0]);
        memcpy(&centers[k * n * GTC_CENTER_WORDS], CURVED.centers, n * GTC_CENTER_WORDS * sizeof centers[0]);
    }
    terms[1].bits = 1U + (2UL << 16);
    terms[GTC_TERM_WORDS + 1U].bits = 1U + (3UL << 16);
    table.networks = networks;
    table.centers = centers;
    table.terms = terms;
    table.n_fallback_models = 2U;
    table.n_centers = 3U * n;
    state = started_with(&table);
    (void)samples(&state, C(15.0), MISSING, 2001);
    CHECK((status_of(&state) & GTC_CHANNEL_LOST) != 0);
    map = map_with(&CURVED, C(15.0));
    CHECK(same((num_t)(map + map + map), bias_of(&state)) || ((status_of(&state) & GTC_CLAMPED) != 0));
    CHECK(!same(map, bias_of(&state)));
}

/* What comes of a block that was overwritten lies within the authority; in float32 it is no temperature. */
TEST(a_block_that_was_overwritten_stays_within_the_authority)
{
    gtc_word_t terms[4U * GTC_TERM_WORDS];
    table_t table = TERMS;
    state_t state;
    num_t bias = 0;

    memcpy(terms, TERMS.terms, sizeof terms);
    terms[4].bits = 0U; /* the map sees the temperature, not its memory */
    table.terms = terms;
    state = started_with(&table);
    (void)samples(&state, C(15.0), MISSING, 2001 + (int)(N / 2U));
    state.input[0].base = TEST_Q31 ? C(-32767.0) : MISSING;
    state.input[0].sum = 0;
    (void)samples(&state, MISSING, MISSING, (int)(N / 2U));
    CHECK(get_bias(&state, &bias) != GTC_OK);
    CHECK(within(&TERMS, bias));
}

/* What something else wrote over the state of a term is left behind by the end of the block: a memory begins again at
 * the temperature, a play is no farther from it than it is wide. */
TEST(a_term_that_was_overwritten_is_back_by_the_end_of_the_block)
{
    const num_t written[] = {MISSING, C(-32767.0), C(32767.0), C(401.0), C(-401.0)};
    const num_t x = C(15.0);
    size_t k;

    for (k = 0U; k < (sizeof written / sizeof written[0]); k++) {
        state_t state = started_with(&TERMS);
        uint_least32_t i;

        (void)samples(&state, x, C(12.0), 2001);
        for (i = 0U; i < TERMS.n_terms; i++) {
            state.term[i][0] = written[k];
            state.term[i][1] = written[k];
        }
        (void)samples(&state, x, C(12.0), (int)N);
        for (i = 0U; i < TERMS.n_terms; i++) {
            const gtc_word_t *const term = &TERMS.terms[i * GTC_TERM_WORDS];
            const num_t z = state.term[i][0];
            const num_t width = NUMBER(term[2]);

            CHECK((term[0].bits != GTC_TERM_MEMORY) || same(x, z));
            CHECK((term[0].bits != GTC_TERM_PLAY) || ((z >= x - width) && (z <= x + width)));
        }
    }
}

TEST(networks_that_no_term_names_or_that_are_not_there_are_refused)
{
    gtc_word_t terms[4U * GTC_TERM_WORDS];
    gtc_word_t *const head = &terms[(3U * GTC_TERM_WORDS) + 1U];
    table_t table = without_fallback_model(terms);

    CHECK(checked(&table) != GTC_E_LAYOUT);
    table.n_centers = TERMS.n_centers;
    table.n_fallback_models = 1U;
    CHECK_INT(GTC_E_LAYOUT, checked(&table));
    head->bits = 1U + (2UL << 16);
    CHECK(checked(&table) != GTC_E_LAYOUT);
    head->bits = 1U + (1UL << 16); /* the map's own */
    CHECK_INT(GTC_E_LAYOUT, checked(&table));
    head->bits = 1U + (3UL << 16);
    CHECK_INT(GTC_E_LAYOUT, checked(&table));
    head->bits = 1U + (0xFFFFUL << 16);
    CHECK_INT(GTC_E_LAYOUT, checked(&table));
    head->bits = 1U;
    terms[1].bits = 2UL << 16; /* of a term without a channel */
    CHECK_INT(GTC_E_LAYOUT, checked(&table));
    terms[1].bits = 0U;
    head->bits = 1U + (2UL << 16);
    table.n_networks = 0U;
    table.n_fallback_models = 2U;
    CHECK_INT(GTC_E_LAYOUT, checked(&table));
    table.n_networks = 0xFFFFFFFFUL;
    CHECK_INT(GTC_E_LAYOUT, checked(&table));
    head->bits = 1U + (1UL << 16); /* a fallback model, and no network of the map before it */
    table.n_networks = 0U;
    table.n_fallback_models = 1U;
    table.n_centers = TERMS.networks[0].bits;
    CHECK_INT(GTC_E_LAYOUT, checked(&table));
}

TEST(a_channel_that_stays_away_falls_back_with_a_bit_of_its_own)
{
    gtc_word_t terms[4U * GTC_TERM_WORDS];
    const table_t table = without_fallback_model(terms);
    state_t a = started_with(&table);
    state_t b = started_with(&table);

    (void)samples(&a, C(15.0), C(14.0), 401);
    (void)samples(&b, C(15.0), C(12.5), 401);
    (void)samples(&a, C(15.0), MISSING, (int)(4U * N));
    CHECK_INT(GTC_HELD, status_of(&a));
    CHECK(!same(bias_of(&a), bias_of(&b)));
    (void)samples(&a, C(15.0), MISSING, (int)N);
    (void)samples(&b, C(15.0), C(12.5), (int)(5U * N));
    CHECK_INT(GTC_HELD | GTC_CHANNEL_LOST, status_of(&a));
    CHECK(same(bias_of(&a), bias_of(&b)));
    (void)samples(&a, C(15.0), C(12.5), (int)N);
    CHECK_INT(GTC_OK, status_of(&a));
}

TEST(a_channel_that_never_came_is_taken_as_its_fallback)
{
    gtc_word_t terms[4U * GTC_TERM_WORDS];
    const table_t table = without_fallback_model(terms);
    state_t a = started_with(&table);
    state_t b = started_with(&table);

    (void)samples(&a, C(15.0), MISSING, 41);
    (void)samples(&b, C(15.0), C(12.5), 41);
    CHECK(same(bias_of(&a), bias_of(&b)));
    CHECK_INT(GTC_HELD | GTC_CHANNEL_LOST, status_of(&a));
}

/* ---- terms see what the map sees ---- */

/* The test table's terms whose readings must agree for 10 s, and hold for two blocks. */
static table_t agreeing(gtc_word_t guards[2U * GTC_GUARD_WORDS], uint_least32_t agree_us)
{
    table_t table = TERMS;

    memcpy(guards, TERMS.guards, 2U * GTC_GUARD_WORDS * sizeof guards[0]);
    guards[4].bits = agree_us;
    table.guards = guards;
    return table;
}

TEST(a_wrong_first_conversion_leaves_no_trace_in_the_terms)
{
    static const double wrong[2] = {85.0, -90.0};
    gtc_word_t guards[2U * GTC_GUARD_WORDS];
    const table_t table = agreeing(guards, 1000000UL);
    int k;

    for (k = 0; k < 2; k++) {
        state_t a = started_with(&table);
        state_t b = started_with(&table);

        (void)sample_both(&a, C(wrong[k]), C(12.0));
        (void)sample_both(&b, MISSING, C(12.0));
        (void)samples(&a, C(15.0), C(12.0), 400);
        (void)samples(&b, C(15.0), C(12.0), 400);
        CHECK(same(bias_of(&a), bias_of(&b)));
        CHECK(same(C(15.0), a.term[1][0]));
    }
}

TEST(terms_begin_again_with_the_map)
{
    gtc_word_t guards[2U * GTC_GUARD_WORDS];
    const table_t table = agreeing(guards, 5000000UL);
    state_t a = started_with(&table);

    (void)samples(&a, C(15.0), C(12.0), 100);
    (void)samples(&a, C(45.0), C(12.0), 3);
    CHECK(same(C(45.0), a.term[0][0]));
    CHECK(same(C(45.0), a.term[1][0]));
    CHECK((missed(&a, 100UL * N) & GTC_FALLBACK) != 0);
    (void)samples(&a, C(20.0), C(12.0), 3);
    CHECK(same(C(20.0), a.term[0][0]));
    CHECK(same(C(20.0), a.term[1][0]));
}

TEST(three_samples_of_150_degrees_are_nothing_and_an_hour_of_them_is_the_edge)
{
    gtc_word_t guards[2U * GTC_GUARD_WORDS];
    const table_t table = agreeing(guards, 10000000UL);
    state_t a = started_with(&table);
    state_t b = started_with(&table);

    (void)samples(&a, C(15.0), C(12.0), 100);
    (void)samples(&b, C(15.0), C(12.0), 100);
    (void)samples(&a, C(150.0), C(12.0), 3);
    (void)samples(&b, MISSING, C(12.0), 3);
    CHECK(same(bias_of(&a), bias_of(&b)));
    (void)samples(&a, C(150.0), C(12.0), 360);
    CHECK((status_of(&a) & GTC_CLAMPED) != 0);
    CHECK(same(C(60.0), a.term[0][0]));
    CHECK(same(C(60.0), a.term[1][0]));
}

/* What all terms together add keeps to what they may. */
TEST(effects_are_bounded_and_that_is_said)
{
    table_t table = TERMS;
    state_t a;
    state_t b = started_with(&TERMS);

    WORD_OF(table.effect[0]) = 0;
    WORD_OF(table.effect[1]) = 0;
    table.crc ^= 1U;
    a = started_with(&table);
    (void)sample_both(&a, C(15.0), C(14.0));
    (void)sample_both(&b, C(15.0), C(14.0));
    CHECK((status_of(&a) & GTC_CLAMPED) != 0);
    CHECK_INT(GTC_WARMING, status_of(&b));
    CHECK(same(map_with(&TERMS, C(15.0)), bias_of(&a)));
    CHECK(!same(bias_of(&a), bias_of(&b)));
    /* Below, too: a supply of 9 V takes off more than the warm-up adds. */
    a = started_with(&table);
    (void)samples(&a, C(15.0), C(9.0), 400);
    CHECK((status_of(&a) & GTC_CLAMPED) != 0);
    CHECK(same(map_with(&TERMS, C(15.0)), bias_of(&a)));
}

#if TEST_Q31
/* A guard that lets every reading of the supply pass. */
static table_t open_channel(gtc_word_t guards[2U * GTC_GUARD_WORDS])
{
    table_t table = TERMS;

    memcpy(guards, TERMS.guards, 2U * GTC_GUARD_WORDS * sizeof guards[0]);
    guards[8].integer = -0x7FFFFFFF;
    guards[9].integer = 0x7FFFFFFF;
    guards[10].integer = 0x7FFFFFFF;
    guards[11].integer = 0x7FFFFFFF;
    table.guards = guards;
    table.authority[0] = -0x7FFFFFFF;
    table.authority[1] = 0x7FFFFFFF;
    table.effect[0] = -0x7FFFFFFF;
    table.effect[1] = 0x7FFFFFFF;
    return table;
}

/* Differences within a block of 2^31. */
TEST(an_auxiliary_channel_has_the_mean_of_its_extremes)
{
    gtc_word_t guards[2U * GTC_GUARD_WORDS];
    const table_t table = open_channel(guards);
    state_t state = started_with(&table);

    (void)samples(&state, C(15.0), 0, (int)N);
    (void)sample_both(&state, C(15.0), -0x40000000);
    (void)samples(&state, C(15.0), 0x40000000, (int)N - 1);
    (void)sample_both(&state, C(15.0), 0);
    CHECK_INT(0x20000000, state.input[1].mean);
    /* After so long any change is accepted. */
    (void)samples(&state, C(15.0), MISSING, 8);
    (void)sample_both(&state, C(15.0), 0x7FFFFFFF);
    CHECK_INT(0x7FFFFFFF, state.input[1].last);
}

TEST(what_terms_add_saturates)
{
    gtc_word_t guards[2U * GTC_GUARD_WORDS];
    table_t table = open_channel(guards);
    gtc_word_t terms[4 * GTC_TERM_WORDS];
    state_t state;

    memcpy(terms, TERMS.terms, sizeof terms);
    terms[(3 * GTC_TERM_WORDS) + 2].integer = 0x3FFFFFFF; /* slope of the auxiliary term */
    table.terms = terms;
    state = started_with(&table);
    (void)sample_both(&state, C(15.0), C(30000.0));
    CHECK_INT(0x7FFFFFFF + map_with(&table, C(15.0)), bias_of(&state));
    CHECK((status_of(&state) & GTC_CLAMPED) != 0);
    state = started_with(&table);
    (void)sample_both(&state, C(15.0), C(-30000.0));
    CHECK_INT(-0x7FFFFFFF, bias_of(&state));
}
#endif

TEST(a_reading_of_a_channel_that_sticks_or_jumps_is_held)
{
    gtc_word_t guards[2U * GTC_GUARD_WORDS];
    table_t table = agreeing(guards, 0U);
    state_t a;

    guards[GTC_GUARD_WORDS + 4U].bits = 2U * PERIOD;
    guards[GTC_GUARD_WORDS + 5U].bits = 16U * PERIOD;
    a = started_with(&table);
    (void)samples(&a, C(15.0), C(12.0), 9);
    (void)samples(&a, C(15.0), C(14.5), 2);
    CHECK(same(C(12.0), a.input[1].last));
    (void)sample_both(&a, C(15.0), C(-5.0));
    CHECK(same(C(12.0), a.input[1].last));
    (void)samples(&a, C(15.0), C(12.5), 40);
    CHECK_INT(GTC_HELD, status_of(&a) & GTC_HELD);
    table.guards = guards;
    guards[GTC_GUARD_WORDS + 7U] = guards[GTC_GUARD_WORDS + 1U];
#if TEST_Q31
    guards[GTC_GUARD_WORDS + 7U].integer++;
    CHECK_INT(GTC_E_LAYOUT, checked(&table));
    guards[GTC_GUARD_WORDS + 7U].integer = guards[GTC_GUARD_WORDS].integer - 1;
#else
    guards[GTC_GUARD_WORDS + 7U].value += 1.0F;
    CHECK_INT(GTC_E_LAYOUT, checked(&table));
    guards[GTC_GUARD_WORDS + 7U].value = guards[GTC_GUARD_WORDS].value - 1.0F;
#endif
    CHECK_INT(GTC_E_LAYOUT, checked(&table));
}

#if TEST_Q31
/* A memory that stays where it was, at -90 C, and a temperature of 200 C, and the other way. */
TEST(a_slope_that_a_memory_makes_saturates)
{
    gtc_word_t guards[2U * GTC_GUARD_WORDS];
    gtc_word_t terms[4 * GTC_TERM_WORDS];
    gtc_word_t words[GTC_SAVE_WORDS];
    table_t table = open_channel(guards);
    int k;

    memcpy(terms, TERMS.terms, sizeof terms);
    terms[2].integer = 0;
    terms[2 + 2].integer = 0x7FFFFFFF;
    table.terms = terms;
    table.scale[0] = 0;
    table.envelope[0] = C(-90.0);
    table.envelope[1] = C(200.0);
    guards[2].integer = 0x7FFFFFFF;
    guards[3].integer = 0x7FFFFFFF;
    for (k = 0; k < 2; k++) {
        state_t state = started_with(&table);

        (void)sample_both(&state, (k == 0) ? C(-90.0) : C(200.0), C(12.0));
        CHECK_INT(GTC_OK, save(&state, words));
        CHECK_INT(GTC_OK, restore(&state, &table, PERIOD, words, 1U));
        CHECK((sample_both(&state, (k == 0) ? C(200.0) : C(-90.0), C(12.0)) & GTC_CLAMPED) != 0);
    }
}
#endif

#ifndef GTC_CHECKED_H_INCLUDED
/* No such table passes check() or open(); should one be used all the same, the term adds nothing. */
TEST(a_kind_that_nobody_knows_adds_nothing)
{
    gtc_word_t terms[4U * GTC_TERM_WORDS];
    table_t table = TERMS;
    table_t none = TERMS;
    state_t a;
    state_t b;

    memcpy(terms, TERMS.terms, TERMS.n_terms * GTC_TERM_WORDS * sizeof terms[0]);
    terms[0].bits = GTC_N_KINDS + 1U;
    table.terms = terms;
    table.n_terms = 1U;
    table.crc ^= 1U;
    none.n_terms = 0U;
    none.crc ^= 2U;
    a = started_with(&table);
    b = started_with(&none);
    (void)samples(&a, C(15.0), C(12.0), 9);
    (void)samples(&b, C(15.0), C(12.0), 9);
    CHECK(same(bias_of(&a), bias_of(&b)));
}
#endif

TEST(terms_of_an_unknown_kind_or_without_their_channel_are_refused)
{
    gtc_word_t terms[4U * GTC_TERM_WORDS];
    table_t table = TERMS;

    CHECK_INT(GTC_OK, checked(&table));
    table.parts &= (uint_least32_t)~GTC_PART_TERM(TERMS.terms[0].bits);
    CHECK_INT(GTC_E_LAYOUT, checked(&table));
    table.parts = TERMS.parts;
    memcpy(terms, TERMS.terms, TERMS.n_terms * GTC_TERM_WORDS * sizeof terms[0]);
    table.terms = terms;
    terms[0].bits = 0U;
    CHECK_INT(GTC_E_LAYOUT, checked(&table));
    terms[0].bits = GTC_N_KINDS + 1U;
    CHECK_INT(GTC_E_LAYOUT, checked(&table));
    table = TERMS;
    table.n_channels = 1U;
    CHECK_INT(GTC_E_LAYOUT, checked(&table));
    table.n_channels = GTC_MAX_TERMS + 2U;
    CHECK_INT(GTC_E_LAYOUT, checked(&table));
}

int main(void)
{
    RUN(tables_with_terms_pass_their_self_test);
    RUN(at_rest_memories_and_plays_come_to_rest_and_warm_up_fades);
    RUN(an_auxiliary_channel_is_added_and_held_when_it_is_missing);
    RUN(a_curve_is_a_line_and_two_gaussians);
    RUN(a_product_has_another_slope_at_another_temperature);
    RUN(a_curve_of_a_lost_channel_is_that_of_its_fallback);
#if TEST_Q31
    RUN(a_curve_at_the_ends_of_all_ranges_stays_a_number);
#endif
    RUN(a_reading_beyond_its_range_is_taken_as_the_edge_and_said);
#if !TEST_Q31
    RUN(no_reading_makes_a_correction_that_is_no_number);
#endif
    RUN(a_fallback_model_is_added_while_nothing_of_its_channel_is_accepted);
    RUN(a_reading_at_the_edge_says_how_far_it_may_be_wrong);
    RUN(bent_lines_and_products_have_fallback_models_too);
    RUN(a_block_that_was_overwritten_stays_within_the_authority);
    RUN(a_term_that_was_overwritten_is_back_by_the_end_of_the_block);
    RUN(networks_that_no_term_names_or_that_are_not_there_are_refused);
    RUN(a_channel_that_stays_away_falls_back_with_a_bit_of_its_own);
    RUN(a_channel_that_never_came_is_taken_as_its_fallback);
    RUN(a_wrong_first_conversion_leaves_no_trace_in_the_terms);
    RUN(terms_begin_again_with_the_map);
    RUN(three_samples_of_150_degrees_are_nothing_and_an_hour_of_them_is_the_edge);
    RUN(effects_are_bounded_and_that_is_said);
    RUN(a_reading_of_a_channel_that_sticks_or_jumps_is_held);
    RUN(a_play_moves_only_when_the_temperature_has_gone_its_way);
    RUN(a_play_may_have_another_strength_at_another_temperature);
    RUN(holds_and_fallback_step_the_terms_too);
    RUN(a_harmonic_repeats_itself_after_its_period);
    RUN(narrow_gaussians_are_there_where_they_are);
    RUN(memories_and_plays_are_kept_over_a_time_without_power);
    RUN(times_without_power_add_up);
    RUN(a_forged_state_is_refused_before_anything_is_computed_of_it);
#if TEST_Q31
    RUN(an_auxiliary_channel_has_the_mean_of_its_extremes);
    RUN(what_terms_add_saturates);
    RUN(a_slope_that_a_memory_makes_saturates);
#endif
#ifndef GTC_CHECKED_H_INCLUDED
    RUN(a_kind_that_nobody_knows_adds_nothing);
#endif
    RUN(terms_of_an_unknown_kind_or_without_their_channel_are_refused);
    return test_end();
}
