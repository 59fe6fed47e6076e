/* test_sigma.c - the snapshot of a correction, and a rest that moves the constant. */
#include "test_image.h"

#if TEST_Q31
#define DPH(x) ((int_least32_t)((x) * (double)(1L << TABLE.bias_frac_bits)))
#define MUCH 2147483647L
#define INFINITE (-MUCH)
#define HIGHEST 2147483647L
#define VALUE(member) (member)
#else
#define DPH(x) ((float)(x))
#define MUCH 1.0e30F
#define INFINITE (MUCH * MUCH)
#define HIGHEST 3.4e38F
#define VALUE(member) ((member).value)
#endif

static const snapshot_t nothing;

static snapshot_t snapshot_of(const state_t *state)
{
    snapshot_t snapshot = nothing;

    CHECK(get_snapshot(state, &snapshot) >= 0);
    return snapshot;
}

/* n samples about a temperature whose blocks have it as their mean; a reading that stays the same would be stuck. */
static void rest(state_t *state, num_t temp, int n)
{
    int i;

    for (i = 0; i < n; i++) {
        const num_t x = (num_t)(temp + (((i % 2) == 0) ? (C(1) / 64) : -(C(1) / 64)));

        CHECK(feed_one(state, &x) >= 0);
    }
}

TEST(bad_arguments_are_refused_and_nothing_is_written)
{
    state_t state = started();
    snapshot_t snapshot = nothing;

    rest(&state, C(15), 60);
    CHECK_INT(GTC_E_ARG, get_snapshot(NULL, &snapshot));
    CHECK_INT(GTC_E_ARG, get_snapshot(&state, NULL));
    CHECK_INT(GTC_E_ARG, rezero(NULL, DPH(0.01), 600U));
    CHECK_INT(GTC_E_ARG, rezero(&state, MISSING, 600U));
    CHECK_INT(GTC_E_ARG, rezero(NULL, 0, 0U));
    CHECK(same(bias_of(&state), map_of(C(15), 0)));
    memset(&state, 0, sizeof state);
    CHECK_INT(GTC_E_ARG, get_snapshot(&state, &snapshot));
    CHECK_INT(GTC_E_ARG, rezero(&state, DPH(0.01), 600U));
    CHECK_INT(GTC_E_ARG, rezero(&state, MISSING, 0U));
    CHECK(memcmp(&snapshot, &nothing, sizeof snapshot) == 0);
}

/* Before anything is accepted, warming, then as trained. */
TEST(sigma_falls_while_the_front_end_learns)
{
    state_t state = started();
    const snapshot_t before = snapshot_of(&state);
    snapshot_t warming;
    snapshot_t settled;

    CHECK_INT(GTC_HELD, before.status);
    rest(&state, C(15), 1);
    warming = snapshot_of(&state);
    CHECK_INT(GTC_WARMING, warming.status);
    rest(&state, C(15), 100);
    settled = snapshot_of(&state);
    CHECK(before.sigma > warming.sigma);
    CHECK(warming.sigma > settled.sigma);
    CHECK(settled.sigma > 0);
    CHECK(same(settled.bias, bias_of(&state)));
    CHECK(settled.correlation_s == 900);
}

TEST(sigma_grows_with_the_age_of_a_held_correction)
{
    state_t state = started();
    num_t temp = C(12);
    num_t last;
    uint_least32_t age;

    ramp(&state, &temp, C(1) / 64, 60);
    last = snapshot_of(&state).sigma;
    for (age = 1U; age < 4U; age++) {
        CHECK(missed(&state, (age == 1U) ? (N + 1U) : N) >= 0);
        CHECK_INT(age, snapshot_of(&state).age_blocks);
        CHECK(snapshot_of(&state).sigma > last);
        last = snapshot_of(&state).sigma;
    }
}

#if GTC_WITH_TERMS
/* Whatever a state says: a table that does not know its covered cells has one grid, and words behind it are no sigma. */
TEST(a_table_without_coverage_has_one_sigma_for_a_cell)
{
    state_t state;
    num_t channels[3] = {0, 0, 0};
    num_t trained;
    int i;

    CHECK_INT(GTC_OK, init(&state, &CURVED, PERIOD));
    for (i = 0; i < 100; i++) {
        channels[0] = (num_t)(C(15) + (((i % 2) == 0) ? (C(1) / 64) : -(C(1) / 64)));
        channels[1] = (num_t)(C(12) + ((C(1) / 128) * (num_t)((i * 5) % 9)));
        CHECK(feed_one(&state, channels) >= 0);
    }
    CHECK_INT(0, status_of(&state));
    trained = snapshot_of(&state).sigma;
    state.status |= GTC_UNCOVERED;
    CHECK(same(trained, snapshot_of(&state).sigma));
}
#endif

TEST(sigma_grows_beyond_the_envelope)
{
    state_t state = started();
    num_t near_it = 0;
    int i;

    for (i = 0; i < 2; i++) {
        const num_t edge = VALUE(TABLE.envelope[1]);

        state = started();
        rest(&state, (num_t)(edge + C(1 + (9 * i))), 100);
        CHECK((status_of(&state) & GTC_CLAMPED) != 0);
        if (i == 0) {
            near_it = snapshot_of(&state).sigma;
        } else {
            CHECK(snapshot_of(&state).sigma > near_it);
        }
    }
}

/* A rest of an hour takes nearly all of a residual; the constant is known better then; one call takes it back. */
TEST(a_rest_moves_the_constant_and_one_call_takes_it_back)
{
    state_t state = started();
    num_t before;
    num_t moved;
    num_t sigma;

    rest(&state, C(15), 100);
    before = bias_of(&state);
    sigma = snapshot_of(&state).sigma;
    CHECK_INT(GTC_OK, rezero(&state, DPH(0.004), 3600U));
    moved = (num_t)(bias_of(&state) - before);
    CHECK((moved > 0) && (moved <= DPH(0.004)));
    CHECK(snapshot_of(&state).sigma < sigma);
    CHECK(same(bias_of(&state), snapshot_of(&state).bias));
    rest(&state, C(15), 100);
    CHECK(same(bias_of(&state), (num_t)(before + moved)));
    CHECK_INT(GTC_OK, rezero(&state, MISSING, 0U));
    CHECK(same(bias_of(&state), before));
    CHECK(same(snapshot_of(&state).sigma, sigma));
}

TEST(the_bound_holds_for_any_rate_and_any_number_of_calls)
{
    static const uint_least32_t seconds[4] = {1U, 60U, 86400U, 0xFFFFFFFFUL};
    const num_t most = VALUE(TABLE.rezero);
    num_t rates[6];
    state_t state = started();
    num_t plain;
    int clamped = 0;
    int i;

    rates[0] = MUCH;
    rates[1] = -MUCH;
    rates[2] = DPH(0.006);
    rates[3] = DPH(0.005);
    rates[4] = 0;
    rates[5] = MISSING;
    rest(&state, C(15), 100);
    plain = bias_of(&state);
    for (i = 0; i < 240; i++) {
        const int status = rezero(&state, rates[(i * 7) % 6], seconds[(i / 6) % 4]);
        const num_t shift = (num_t)(bias_of(&state) - plain);

        CHECK((status == GTC_OK) || (status == GTC_CLAMPED) || (status == GTC_E_ARG) || (status == GTC_E_REST));
        clamped += (status == GTC_CLAMPED) ? 1 : 0;
        CHECK((shift <= (most + DPH(1e-7))) && (shift >= -(most + DPH(1e-7))));
        CHECK(snapshot_of(&state).sigma > 0);
    }
    CHECK(clamped > 0);
    CHECK_INT(GTC_OK, rezero(&state, MISSING, 0U));
    CHECK(same(bias_of(&state), plain));
}

/* Earth's rate that was not taken off, or a vehicle that turns: nothing of it goes into the constant. */
TEST(a_rest_that_is_none_is_refused_and_changes_nothing)
{
    static const double wrong[3] = {0.1, -7.5, 3.0};
    state_t state = started();
    num_t before;
    num_t sigma;
    int k;

    rest(&state, C(15), 100);
    before = bias_of(&state);
    sigma = snapshot_of(&state).sigma;
    for (k = 0; k < 3; k++) {
        CHECK_INT(GTC_E_REST, rezero(&state, DPH(wrong[k]), 3600U));
        CHECK(same(bias_of(&state), before));
        CHECK(same(snapshot_of(&state).sigma, sigma));
    }
}

/* What the map is wrong by at this temperature is in every rest: it does not average out. */
TEST(many_rests_leave_no_less_uncertainty_than_the_map_has)
{
    state_t state = started();
    num_t once;
    int k;

    rest(&state, C(15), 100);
    CHECK_INT(GTC_OK, rezero(&state, DPH(0.004), 0xFFFFFFFFUL));
    once = snapshot_of(&state).sigma;
    for (k = 0; k < 100; k++) {
        CHECK_INT(GTC_OK, rezero(&state, 0, 0xFFFFFFFFUL));
    }
    CHECK((snapshot_of(&state).sigma >= (num_t)(once - (once / 100))) && (snapshot_of(&state).sigma <= once));
}

TEST(a_shift_is_kept_without_a_pause_of_power_and_dropped_with_one)
{
    gtc_word_t words[GTC_SAVE_WORDS];
    state_t state = started();
    state_t fresh = started();
    state_t other;
    int k;

    rest(&fresh, C(15), 100);
    for (k = 0; k < 2; k++) {
        rest(&state, C(15), 100);
        CHECK_INT(GTC_OK, rezero(&state, (k == 0) ? DPH(0.004) : -DPH(0.004), 3600U));
        CHECK_INT(GTC_OK, save(&state, words));
        CHECK_INT(GTC_OK, restore(&other, &TABLE, PERIOD, words, 0U));
        CHECK(same(bias_of(&state), bias_of(&other)));
        CHECK(same(snapshot_of(&state).sigma, snapshot_of(&other).sigma));
        CHECK_INT(GTC_OK, restore(&other, &TABLE, PERIOD, words, 100U));
        rest(&other, C(15), 100);
        CHECK(same(bias_of(&fresh), bias_of(&other)));
        CHECK(same(snapshot_of(&fresh).sigma, snapshot_of(&other).sigma));
        state = started();
    }
}

TEST(a_table_that_grants_no_shift_keeps_its_constant)
{
    table_t table = TABLE;
    state_t state;
    num_t before;

#if TEST_Q31
    table.rezero = 0;
#else
    table.rezero.value = 0.0F;
#endif
    CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
    rest(&state, C(15), 100);
    before = bias_of(&state);
    CHECK_INT(GTC_E_ABSENT, rezero(&state, DPH(0.01), 3600U));
    CHECK(same(bias_of(&state), before));
}

/* n samples of a table with a channel: from *temp on, which moves by `step`. */
static void terms_ramp(state_t *state, num_t *temp, num_t step, num_t supply, int n)
{
    int i;

    for (i = 0; i < n; i++) {
        num_t channels[2];

        channels[0] = *temp;
        channels[1] = supply;
        CHECK(feed_one(state, channels) >= 0);
        *temp = (num_t)(*temp + step);
    }
}

/* While the window fills, the slope that the correction lacks is known from the second block on. */
TEST(sigma_while_warming_grows_with_the_slope)
{
    num_t sigma[2];
    int k;

    for (k = 0; k < 2; k++) {
        state_t state = started();
        num_t temp = C(12);

        ramp(&state, &temp, (k == 0) ? 0 : (num_t)(C(1) / 64), 10);
        CHECK((status_of(&state) & GTC_WARMING) != 0);
        sigma[k] = snapshot_of(&state).sigma;
    }
    CHECK(sigma[1] > sigma[0]);
}

TEST(sigma_grows_below_the_envelope_too)
{
    state_t state = started();
    state_t colder = started();
    const num_t edge = VALUE(TABLE.envelope[0]);

    rest(&state, (num_t)(edge - C(1)), 100);
    rest(&colder, (num_t)(edge - C(10)), 100);
    CHECK(snapshot_of(&colder).sigma > snapshot_of(&state).sigma);
}

/* A memory forgets by time, a play by temperatures seen; a lost channel stays unknown. */
TEST(terms_whose_past_is_not_known_say_so_until_they_have_forgotten_it)
{
    state_t state;
    num_t temp = C(15);
    num_t begun;
    num_t rested;
    num_t moved;

    CHECK_INT(GTC_OK, init(&state, &TERMS, PERIOD));
    terms_ramp(&state, &temp, 0, C(12), 20); /* the window is full */
    CHECK_INT(0, status_of(&state) & GTC_WARMING);
    begun = snapshot_of(&state).sigma;
    terms_ramp(&state, &temp, 0, C(12), 4000); /* the memory has settled, the play has not moved */
    rested = snapshot_of(&state).sigma;
    CHECK(rested < begun);
    terms_ramp(&state, &temp, C(1) / 64, C(12), 400); /* by 6 C, more than twice its width */
    temp = (num_t)(temp - C(1) / 64);
    terms_ramp(&state, &temp, 0, C(12), 40);
    moved = snapshot_of(&state).sigma;
    CHECK(moved < rested);
    terms_ramp(&state, &temp, 0, MISSING, 40);
    CHECK((status_of(&state) & GTC_CHANNEL_LOST) != 0);
    CHECK(snapshot_of(&state).sigma > moved);
}

/* A supply of 300 V where the range ends at less is the edge: the supply may be there, or the sensor at fault. */
TEST(a_channel_beyond_its_range_or_held_is_not_sure)
{
    state_t right;
    state_t state;
    num_t temp = C(15);
    int k;

    CHECK_INT(GTC_OK, init(&right, &TERMS, PERIOD));
    terms_ramp(&right, &temp, 0, C(12), 4000);
    for (k = 0; k < 3; k++) {
        const num_t reading = (k == 0) ? C(300) : ((k == 1) ? -C(300) : MISSING);

        state = right;
        terms_ramp(&state, &temp, 0, reading, (k == 2) ? (2 * (int)N) : 400);
        CHECK((status_of(&state) & ((k == 2) ? GTC_HELD : GTC_CLAMPED)) != 0);
        CHECK(snapshot_of(&state).sigma > snapshot_of(&right).sigma);
    }
}

/* ... but what was saved a block ago is known. */
TEST(terms_that_go_on_from_where_they_were_are_sure)
{
    gtc_word_t words[GTC_SAVE_WORDS];
    state_t state;
    state_t other;
    state_t fresh;
    num_t temp = C(15);

    CHECK_INT(GTC_OK, init(&state, &TERMS, PERIOD));
    terms_ramp(&state, &temp, 0, C(12), 4000);
    CHECK_INT(GTC_OK, save(&state, words));
    CHECK_INT(GTC_OK, restore(&other, &TERMS, PERIOD, words, 1U));
    CHECK_INT(GTC_OK, init(&fresh, &TERMS, PERIOD));
    terms_ramp(&other, &temp, 0, C(12), 20);
    terms_ramp(&fresh, &temp, 0, C(12), 20);
    CHECK(snapshot_of(&other).sigma < snapshot_of(&fresh).sigma);
}

TEST(a_table_without_uncertainties_gives_neither_snapshot_nor_shift)
{
    state_t state;
    snapshot_t snapshot = nothing;

    CHECK_INT(GTC_OK, init(&state, &NARROW, PERIOD));
    CHECK_INT(GTC_E_ABSENT, get_snapshot(&state, &snapshot));
    CHECK(memcmp(&snapshot, &nothing, sizeof snapshot) == 0);
    CHECK_INT(GTC_E_ABSENT, rezero(&state, DPH(0.01), 3600U));
}

TEST(words_of_uncertainty_are_all_there_or_none)
{
    table_t table = TABLE;

    table.n_sigma = TABLE.n_sigma - 1U;
    CHECK_INT(GTC_E_LAYOUT, checked(&table));
    table.n_sigma = TABLE.n_sigma;
    table.sigma_cells[0] = 0U;
    table.sigma_cells[1] = 0U;
    CHECK_INT(GTC_E_LAYOUT, checked(&table));
    table.n_sigma = GTC_SIGMA_RULES; /* as many as rules alone are */
    CHECK_INT(GTC_E_LAYOUT, checked(&table));
}

/* The widest words that `init` accepts: sums of squares stay within their numbers, the root is a sigma. */
TEST(the_largest_words_give_a_sigma)
{
    gtc_word_t words[16];
    table_t table = TABLE;
    state_t state;
    num_t temp = (num_t)(VALUE(TABLE.envelope[1]) + C(9));
    num_t shift;
    uint_least32_t i;

    for (i = 0U; i < 16U; i++) {
        words[i] = TABLE.sigma[i];
#if TEST_Q31
        words[i].integer = 2147483647L;
#else
        words[i].value = 7.5e6F;
#endif
    }
    table.sigma = words;
    CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
    feed(&state, temp, 3);
    CHECK(missed(&state, 2U * N) >= 0);
    CHECK(snapshot_of(&state).sigma > VALUE(TABLE.rezero));
    for (i = 0U; i < 2U; i++) { /* slopes to either side, beyond the largest product */
        ramp(&state, &temp, (num_t)((i == 0U) ? -(C(1) / 8) : (C(1) / 8)), 100);
        CHECK(missed(&state, 2U * N) >= 0);
        CHECK(snapshot_of(&state).sigma > VALUE(TABLE.rezero));
    }
    CHECK(rezero(&state, DPH(0.001), 1U) >= 0);
    shift = (num_t)(bias_of(&state) - state.unshifted);
    CHECK((shift >= -VALUE(TABLE.rezero)) && (shift <= VALUE(TABLE.rezero)));
}

/* Numbers that no call leaves, as after an upset of the memory. */
TEST(a_state_that_was_overwritten_gives_a_correction_within_the_authority_and_no_shift)
{
    state_t state = started();
    snapshot_t snapshot;

    rest(&state, C(15), 100);
    state.shift_sigma = MUCH;
    state.uncertainty.input[0] = MISSING;
    snapshot = snapshot_of(&state);
    CHECK(same(snapshot.bias, bias_of(&state)));
    state.bias = MISSING;
    CHECK(bias_of(&state) >= VALUE(TABLE.authority[0]));
    CHECK(bias_of(&state) <= VALUE(TABLE.authority[1]));
}

/* No number that is none makes a correction sure: a filter would follow it alone. */
TEST(a_state_that_was_overwritten_is_as_uncertain_as_one_that_knows_nothing)
{
    const state_t right = started();
    const num_t unknown = snapshot_of(&right).sigma;
    num_t none[2];
    int k;

    none[0] = MISSING;
    none[1] = MUCH;
    for (k = 0; k < 2; k++) {
        state_t rested = right;
        state_t map;
        state_t drift;
        state_t constant;
        num_t before;

        rest(&rested, C(15), 100);
        CHECK(snapshot_of(&rested).sigma < unknown);
        map = drift = constant = rested;
        map.uncertainty.input[0] = none[k];
        CHECK(snapshot_of(&map).sigma >= unknown);
        drift.uncertainty.slope = none[k];
        drift.input[0].held_blocks = 2U;
        CHECK(snapshot_of(&drift).sigma >= unknown);
        constant.shift_sigma = none[k];
        before = snapshot_of(&constant).sigma;
        CHECK(before >= snapshot_of(&rested).sigma);
        CHECK(rezero(&constant, DPH(0.004), 3600U) >= 0);
        CHECK(snapshot_of(&constant).sigma > 0);
        CHECK(snapshot_of(&constant).sigma <= before);
    }
}

/* Each number that the uncertainty goes by, in turn. */
static num_t *number_of(state_t *state, int k)
{
    num_t *const numbers[11] = {&state->uncertainty.input[0], &state->uncertainty.input[1], &state->uncertainty.slope, &state->uncertainty.first_temp,
                                &state->uncertainty.lowest,   &state->uncertainty.highest,  &state->unshifted, &state->bias,
                                &state->shift_sigma,    &state->shift,       &state->uncertainty.edge_effect};

    return numbers[k];
}

/* What no call leaves, in a number that the uncertainty goes by, while the correction is held and terms are not sure of
 * their past: a filter would trust a sigma of 0 for ever, and fail at one that is none. */
TEST(a_number_that_was_overwritten_never_makes_the_correction_sure)
{
    const num_t wrong[4] = {MISSING, MUCH, (num_t)-MUCH, INFINITE};
    state_t whole;
    num_t temp = C(15);
    num_t sure;
    int k;

    CHECK_INT(GTC_OK, init(&whole, &TERMS, PERIOD));
    terms_ramp(&whole, &temp, C(1) / 64, C(12), 10);
    CHECK(missed(&whole, 2U * N) >= 0);
    sure = NUMBER(TERMS.sigma[(TERMS.n_sigma - TERMS.n_terms - GTC_SIGMA_RULES) + 9U]); /* of the constant alone */
    for (k = 0; k < 44; k++) {
        state_t state = whole;
        num_t shift;

        *number_of(&state, k / 4) = wrong[k % 4];
        CHECK((snapshot_of(&state).sigma > sure) && (snapshot_of(&state).sigma <= HIGHEST));
        CHECK(rezero(&state, DPH(0.001), 60U) >= 0);
        CHECK((snapshot_of(&state).sigma > 0) && (snapshot_of(&state).sigma <= HIGHEST));
        shift = state.shift;
        CHECK((shift >= -VALUE(TERMS.rezero)) && (shift <= VALUE(TERMS.rezero)));
    }
}

/* The most that a motion which was taken for a rest can do: the header says it. */
TEST(a_false_rest_within_the_gate_moves_the_correction_by_less_than_four_sigma_of_the_constant)
{
    const uint_least32_t seconds[3] = {1U, 60U, 7200U};
    int accepted = 0;
    int i;
    int k;

    for (i = 0; i < 3; i++) {
        for (k = -400; k <= 400; k++) {
            state_t state = started();
            num_t before;
            num_t sigma;
            num_t moved;

            rest(&state, C(15), 60);
            before = bias_of(&state);
            sigma = state.shift_sigma;
            if (rezero(&state, (num_t)(DPH(0.0005) * (num_t)k), seconds[i]) == GTC_OK) {
                accepted++;
                moved = (num_t)(bias_of(&state) - before);
                moved = (moved < 0) ? (num_t)-moved : moved;
                CHECK(moved < (num_t)(4 * sigma));
                CHECK(state.shift_sigma <= sigma);
            }
        }
    }
    CHECK((accepted > 30) && (accepted < 2400));
}

/* Without noise and without an uncertain constant a rest says nothing. */
TEST(a_table_that_is_sure_of_everything_takes_no_rest)
{
    gtc_word_t words[16];
    table_t table = TABLE;
    state_t state;
    num_t before;
    uint_least32_t i;

    for (i = 0U; i < 16U; i++) {
        words[i].bits = 0U;
    }
    table.sigma = words;
    CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
    rest(&state, C(15), 100);
    before = bias_of(&state);
    CHECK_INT(GTC_E_REST, rezero(&state, DPH(0.004), 3600U));
    CHECK_INT(GTC_OK, rezero(&state, 0, 3600U));
    CHECK(same(bias_of(&state), before));
    CHECK(snapshot_of(&state).sigma == 0);
}

/* ... but for the constant: the rest is it. */
TEST(a_table_that_is_sure_of_all_but_the_constant_takes_the_whole_rest)
{
    gtc_word_t words[16];
    table_t table = TABLE;
    state_t state;
    num_t before;
    num_t moved;
    uint_least32_t i;

    for (i = 0U; i < 16U; i++) {
        words[i].bits = 0U;
    }
    i = (2U * TABLE.sigma_cells[0] * TABLE.sigma_cells[1]) + 9U; /* from power-on to power-on */
    words[i] = TABLE.sigma[i];
    table.sigma = words;
    CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
    rest(&state, C(15), 100);
    before = bias_of(&state);
    CHECK(snapshot_of(&state).sigma > 0);
    CHECK_INT(GTC_OK, rezero(&state, DPH(0.001), 3600U));
    moved = (num_t)(bias_of(&state) - before);
    CHECK((moved >= DPH(0.00099)) && (moved <= DPH(0.00101)));
    CHECK(snapshot_of(&state).sigma == 0);
}

/* A state without uncertainties is saved and restored as others are. */
TEST(a_state_without_uncertainties_is_kept_over_a_time_without_power)
{
    gtc_word_t words[GTC_SAVE_WORDS];
    state_t state;

    CHECK_INT(GTC_OK, init(&state, &NARROW, PERIOD));
    CHECK_INT(GTC_OK, save(&state, words));
    CHECK_INT(GTC_OK, restore(&state, &NARROW, PERIOD, words, 100U));
    CHECK_INT(GTC_HELD, status_of(&state));
}

/* Of ten samples a second four arrive: blocks count, none is held, and the correction is less certain on a ramp. */
TEST(blocks_with_few_readings_count_with_their_uncertainty)
{
    static const int arrives[10] = {1, 0, 0, 1, 0, 1, 0, 0, 1, 0};
    state_t whole = started();
    state_t lossy = started();
    num_t sigma = 0;
    int k;

    CHECK_INT(GTC_OK, init(&whole, &TABLE, 100000UL));
    CHECK_INT(GTC_OK, init(&lossy, &TABLE, 100000UL));
    for (k = 0; k < 1201; k++) {
        const num_t temp = C(15.0) + ((num_t)(k / 4) * C(0.0078125));

        CHECK(feed_one(&whole, &temp) >= 0);
        CHECK(sample(&lossy, 100000UL, (arrives[k % 10] != 0) ? &temp : NULL) >= 0);
        if (k > 500) {
            CHECK_INT(GTC_OK, status_of(&lossy));
        }
    }
    CHECK_INT(60, lossy.uncertainty.missing);
    CHECK_INT(0, whole.uncertainty.missing);
    sigma = snapshot_of(&whole).sigma;
    CHECK(snapshot_of(&lossy).sigma > sigma);
    /* Two readings are a mean, one is none. */
    for (k = 0; k < 201; k++) {
        const num_t temp = C(17.34375);

        CHECK(sample(&lossy, 100000UL, (((k % 100) == 3) || ((k % 200) == 4)) ? &temp : NULL) >= 0);
        if (k == 100) {
            CHECK_INT(97, lossy.uncertainty.missing); /* with the one that was read above */
        }
    }
    CHECK((status_of(&lossy) & GTC_HELD) != 0);
    lossy.uncertainty.missing = 0xFFFFFFFFUL; /* something else wrote there */
    CHECK(snapshot_of(&lossy).sigma > sigma);
    lossy.samples_per_block = 0U;
    {
        snapshot_t none;

        CHECK_INT(GTC_E_ARG, get_snapshot(&lossy, &none));
        CHECK_INT(GTC_E_ARG, rezero(&lossy, 0, 60U));
    }
}

int main(void)
{
    RUN(blocks_with_few_readings_count_with_their_uncertainty);
    RUN(sigma_while_warming_grows_with_the_slope);
    RUN(sigma_grows_below_the_envelope_too);
    RUN(terms_whose_past_is_not_known_say_so_until_they_have_forgotten_it);
    RUN(a_channel_beyond_its_range_or_held_is_not_sure);
    RUN(terms_that_go_on_from_where_they_were_are_sure);
    RUN(a_table_without_uncertainties_gives_neither_snapshot_nor_shift);
    RUN(words_of_uncertainty_are_all_there_or_none);
    RUN(the_largest_words_give_a_sigma);
    RUN(a_state_that_was_overwritten_gives_a_correction_within_the_authority_and_no_shift);
    RUN(a_state_that_was_overwritten_is_as_uncertain_as_one_that_knows_nothing);
    RUN(a_number_that_was_overwritten_never_makes_the_correction_sure);
    RUN(a_false_rest_within_the_gate_moves_the_correction_by_less_than_four_sigma_of_the_constant);
    RUN(a_table_that_is_sure_of_everything_takes_no_rest);
    RUN(a_table_that_is_sure_of_all_but_the_constant_takes_the_whole_rest);
    RUN(a_state_without_uncertainties_is_kept_over_a_time_without_power);
    RUN(bad_arguments_are_refused_and_nothing_is_written);
    RUN(sigma_falls_while_the_front_end_learns);
    RUN(sigma_grows_with_the_age_of_a_held_correction);
#if GTC_WITH_TERMS
    RUN(a_table_without_coverage_has_one_sigma_for_a_cell);
#endif
    RUN(sigma_grows_beyond_the_envelope);
    RUN(a_rest_moves_the_constant_and_one_call_takes_it_back);
    RUN(the_bound_holds_for_any_rate_and_any_number_of_calls);
    RUN(a_rest_that_is_none_is_refused_and_changes_nothing);
    RUN(many_rests_leave_no_less_uncertainty_than_the_map_has);
    RUN(a_shift_is_kept_without_a_pause_of_power_and_dropped_with_one);
    RUN(a_table_that_grants_no_shift_keeps_its_constant);
    return test_end();
}
