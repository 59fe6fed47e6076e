/* test_learn.c - learning in service: arguments, gates, agreement, kept words, authority.
 *
 * The numbers are compared with the mirror in tests/py/mirror/test_learning.py; here every line and branch runs. */
#include <math.h>
#include <string.h>

#include "gtc_learn.h"
#include "gtc_test.h"

/* Of a laser gyro: deg/h, C, s. */
static gtc_learn_prior_t some_prior(void)
{
    gtc_learn_prior_t prior;
    unsigned k;

    memset(&prior, 0, sizeof prior);
    prior.id = 77U;
    prior.low_c = -40.0F;
    prior.knots_per_c = 0.07F;
    prior.reference_c = 10.0F;
    prior.authority_dph = 0.03F;
    prior.power_on_var[0] = 9e-8F;
    prior.power_on_var[1] = 1e-16F;
    prior.power_on_var[2] = 1e-8F;
    prior.power_on_var[3] = 9e-10F;
    prior.memory_per_c = 0.0866F;
    prior.memory_per_s = 7e-5F;
    prior.warm_up_per_s = 1.7e-3F;
    prior.off_s = 172800.0F;
    prior.noise_var = 5.2e-5F;
    prior.noise_ratio = 9.0F;
    prior.span_c = 1.5F;
    prior.settle_s = 10.0F;
    prior.gate_square = 16.0F;
    prior.jump_square = 16.0F;
    prior.agreeing_rests = 2U;
    prior.agreeing_power_ons = 1U;
    for (k = 0U; k < GTC_LEARN_KNOT_PAIRS; k++) {
        prior.map_var[k] = 4e-8F;
        prior.ageing_var[k] = 3e-16F;
    }
    return prior;
}

static gtc_learn_stop_t some_stop(void)
{
    gtc_learn_stop_t stop;

    memset(&stop, 0, sizeof stop);
    stop.time_s = 3600.0F;
    stop.temp_c = 20.0F;
    stop.rate_dph = 2e-4F;
    stop.duration_s = 600.0F;
    return stop;
}

static gtc_learn_state_t started(const gtc_learn_prior_t *prior)
{
    gtc_learn_state_t state;

    CHECK_INT(GTC_OK, gtc_learn_start(&state, prior));
    CHECK_INT(GTC_OK, gtc_learn_power_on(&state, prior, 86400.0F, 20.0F));
    return state;
}

static float shift_at(const gtc_learn_state_t *state, const gtc_learn_prior_t *prior, float time_s, float temp_c)
{
    gtc_learn_shift_t shift = {0.0F, -1.0F};

    CHECK_INT(GTC_OK, gtc_learn_shift(state, prior, time_s, temp_c, &shift));
    CHECK(shift.sigma_dph >= 0.0F);
    return shift.dph;
}

TEST(missing_arguments_are_refused)
{
    const gtc_learn_prior_t prior = some_prior();
    gtc_learn_state_t state = started(&prior);
    gtc_learn_stop_t stop = some_stop();
    gtc_word_t words[GTC_LEARN_KEPT_WORDS];
    gtc_learn_shift_t y;

    CHECK_INT(GTC_E_ARG, gtc_learn_start(NULL, &prior));
    CHECK_INT(GTC_E_ARG, gtc_learn_start(&state, NULL));
    CHECK_INT(GTC_E_ARG, gtc_learn_power_on(NULL, &prior, 1.0F, 20.0F));
    CHECK_INT(GTC_E_ARG, gtc_learn_power_on(&state, NULL, 1.0F, 20.0F));
    CHECK_INT(GTC_E_ARG, gtc_learn_power_on(&state, &prior, 1.0F, NAN));
    CHECK_INT(GTC_E_ARG, gtc_learn_rest(NULL, &prior, &stop));
    CHECK_INT(GTC_E_ARG, gtc_learn_rest(&state, NULL, &stop));
    CHECK_INT(GTC_E_ARG, gtc_learn_rest(&state, &prior, NULL));
    CHECK_INT(GTC_E_ARG, gtc_learn_shift(NULL, &prior, 1.0F, 20.0F, &y));
    CHECK_INT(GTC_E_ARG, gtc_learn_shift(&state, NULL, 1.0F, 20.0F, &y));
    CHECK_INT(GTC_E_ARG, gtc_learn_shift(&state, &prior, 1.0F, 20.0F, NULL));
    CHECK_INT(GTC_E_ARG, gtc_learn_shift(&state, &prior, 1.0F, -91.0F, &y));
    CHECK_INT(GTC_E_ARG, gtc_learn_shift(&state, &prior, 1.0F, INFINITY, &y));
    CHECK_INT(GTC_E_ARG, gtc_learn_save(NULL, &prior, words));
    CHECK_INT(GTC_E_ARG, gtc_learn_save(&state, NULL, words));
    CHECK_INT(GTC_E_ARG, gtc_learn_save(&state, &prior, NULL));
    CHECK_INT(GTC_E_ARG, gtc_learn_restore(NULL, &prior, words));
    CHECK_INT(GTC_E_ARG, gtc_learn_restore(&state, NULL, words));
    CHECK_INT(GTC_E_ARG, gtc_learn_restore(&state, &prior, NULL));
}

TEST(a_rest_moves_the_shift_towards_it)
{
    const gtc_learn_prior_t prior = some_prior();
    const float steps[] = {0.0F, 1e-3F, -3.0F, 40.0F, -130.0F, 200.0F};
    gtc_learn_state_t state = started(&prior);
    gtc_learn_stop_t stop = some_stop();
    unsigned k;

    for (k = 0U; k < (sizeof steps / sizeof steps[0]); k++) {
        stop.time_s = (k == 1U) ? stop.time_s : (stop.time_s + 600.0F);
        stop.temp_c += steps[k];
        stop.mean_var = (k == 2U) ? 2e-7F : 0.0F;
        CHECK_INT(GTC_OK, gtc_learn_rest(&state, &prior, &stop));
        CHECK((shift_at(&state, &prior, stop.time_s, stop.temp_c) > 0.0F));
    }
    CHECK_INT(GTC_OK, gtc_learn_power_on(&state, &prior, NAN, 20.0F));
    CHECK_INT(GTC_OK, gtc_learn_power_on(&state, &prior, -1.0F, 20.0F));
    CHECK_INT(GTC_OK, gtc_learn_power_on(&state, &prior, INFINITY, 20.0F));
    CHECK(shift_at(&state, &prior, -5.0F, 20.0F) > 0.0F);
}

TEST(each_gate_refuses)
{
    const gtc_learn_prior_t prior = some_prior();
    gtc_learn_state_t state = started(&prior);
    gtc_learn_stop_t stop;
    unsigned k;
    unsigned member;
    const float wrong[][5] = {
        {1.0F, NAN},              /* time_s: before settle_s */
        {-91.0F, 201.0F, NAN},    /* temp_c */
        {2.0F, NAN},              /* span_c */
        {-0.5F, 0.02F, NAN, INFINITY}, /* rate_dph: beyond the authority, beyond the gate */
        {0.0F, NAN, -1.0F, INFINITY},  /* duration_s */
        {1.0F, NAN},              /* mean_var */
        {-1.0F, NAN, INFINITY},   /* earth_var */
    };

    for (member = 0U; member < (sizeof wrong / sizeof wrong[0]); member++) {
        for (k = 0U; (k < 5U) && (wrong[member][k] != 0.0F || (k == 0U)); k++) {
            stop = some_stop();
            (&stop.time_s)[member] = wrong[member][k];
            CHECK_INT(GTC_E_REST, gtc_learn_rest(&state, &prior, &stop));
            CHECK(shift_at(&state, &prior, 3600.0F, 20.0F) == 0.0F);
        }
    }
    stop = some_stop();
    stop.rate_dph = 0.02F;
    stop.confirmed = 1;
    CHECK_INT(GTC_OK, gtc_learn_rest(&state, &prior, &stop));
    CHECK(shift_at(&state, &prior, 3600.0F, 20.0F) > 0.015F);
}

TEST(refused_rests_that_agree_are_accepted)
{
    const float second[] = {-5e-3F, 5e-2F, 2e-3F, 5e-3F};
    gtc_learn_prior_t prior = some_prior();
    gtc_learn_state_t state;
    gtc_learn_stop_t stop = some_stop();
    unsigned k;

    for (k = 0U; k < 4U; k++) {
        prior.authority_dph = 0.1F;
        state = started(&prior);
        stop.rate_dph = 5e-3F;
        CHECK_INT(GTC_E_REST, gtc_learn_rest(&state, &prior, &stop));
        CHECK_INT(GTC_E_REST, gtc_learn_rest(&state, &prior, &stop)); /* of the same power-on */
        CHECK_INT(GTC_OK, gtc_learn_power_on(&state, &prior, 1.0F, 20.0F));
        stop.rate_dph = second[k];
        CHECK_INT((k == 3U) ? GTC_DISAGREES : GTC_E_REST, gtc_learn_rest(&state, &prior, &stop));
    }
    state = started(&prior);
    stop.rate_dph = 5e-3F;
    for (k = 0U; k < 300U; k++) {
        CHECK_INT(GTC_E_REST, gtc_learn_rest(&state, &prior, &stop));
    }
    prior.jump_square = 1.0e6F;
    CHECK_INT(GTC_OK, gtc_learn_rest(&state, &prior, &stop));
}

TEST(kept_words_are_taken_back_or_refused)
{
    gtc_learn_prior_t prior = some_prior();
    gtc_learn_state_t state = started(&prior);
    gtc_learn_state_t back;
    gtc_learn_stop_t stop = some_stop();
    gtc_word_t words[GTC_LEARN_KEPT_WORDS];
    gtc_word_t again[GTC_LEARN_KEPT_WORDS];
    unsigned k;

    CHECK_INT(GTC_OK, gtc_learn_rest(&state, &prior, &stop));
    CHECK_INT(GTC_OK, gtc_learn_save(&state, &prior, words));
    CHECK_INT(GTC_OK, gtc_learn_restore(&back, &prior, words));
    CHECK(memcmp(state.x, back.x, GTC_LEARN_KNOTS * sizeof(float)) == 0);
    CHECK(memcmp(state.p, back.p, GTC_LEARN_KNOT_PAIRS * sizeof(float)) == 0);
    CHECK_INT(GTC_OK, gtc_learn_save(&back, &prior, again));
    CHECK(memcmp(words, again, sizeof words) == 0);
    for (k = 0U; k < GTC_LEARN_KEPT_WORDS; k++) {
        words[k].bits ^= 64U;
        CHECK_INT(GTC_E_IMAGE, gtc_learn_restore(&back, &prior, words));
        words[k].bits ^= 64U;
    }
    prior.id = 78U;
    CHECK_INT(GTC_E_ID, gtc_learn_restore(&back, &prior, words));
    prior.id = 77U;
    state.p[1] = NAN;
    CHECK_INT(GTC_OK, gtc_learn_save(&state, &prior, words));
    CHECK_INT(GTC_E_IMAGE, gtc_learn_restore(&back, &prior, words));
}

TEST(a_broken_state_stays_within_the_authority)
{
    const gtc_learn_prior_t prior = some_prior();
    gtc_learn_state_t state = started(&prior);
    gtc_learn_stop_t stop = some_stop();

    state.x[8] = 1e30F;
    CHECK(shift_at(&state, &prior, 3600.0F, 20.0F) == 0.03F);
    state.x[8] = -1e30F;
    CHECK(shift_at(&state, &prior, 3600.0F, 20.0F) == -0.03F);
    state.x[8] = NAN;
    CHECK(shift_at(&state, &prior, 3600.0F, 20.0F) == 0.0F);
    state = started(&prior);
    state.p[44] = 1e30F; /* variance of the offset: more than any prior's */
    CHECK(shift_at(&state, &prior, 3600.0F, 20.0F) == 0.0F);
    state.p[44] = -1e-3F; /* not a variance */
    stop.rate_dph = 1e-5F;
    CHECK_INT(GTC_OK, gtc_learn_rest(&state, &prior, &stop)); /* h P h counts as 0 */
    CHECK(fabsf(shift_at(&state, &prior, 3600.0F, 20.0F)) <= 0.03F);
}

int main(void)
{
    RUN(missing_arguments_are_refused);
    RUN(a_rest_moves_the_shift_towards_it);
    RUN(each_gate_refuses);
    RUN(refused_rests_that_agree_are_accepted);
    RUN(kept_words_are_taken_back_or_refused);
    RUN(a_broken_state_stays_within_the_authority);
    return test_end();
}
