/* test_bank.c - several networks in one table: hand-over without a jump, where it is compiled in. */
#include "test_image.h"

/* 0.08 deg/h for 1/16 C: four times the steepest that the blend is. */
#if TEST_Q31
#define BIAS_STEP ((int_least32_t)(0.08 * (double)(1UL << BANK.bias_frac_bits)))
#else
#define BIAS_STEP 0.08F
#endif

#if GTC_WITH_BANK
TEST(a_bank_passes_its_self_test)
{
    CHECK_INT(GTC_OK, FN(check)(&BANK));
}

/* Regions: T below 30 C; above 10 C with slopes below 1 C/min; above 10 C with slopes above -1. */
TEST(the_hand_over_has_no_jump)
{
    num_t last = 0;
    num_t bias = 0;
    num_t step = 0;
    long k;

    for (k = 0; k <= 1280; k++) {
        CHECK(FN(map)(&BANK, C(-20.0) + (C(0.0625) * (num_t)k), C(0.0), &bias) >= 0);
        step = (bias > last) ? (bias - last) : (last - bias);
        if (k > 0) {
            CHECK(step < BIAS_STEP);
        }
        last = bias;
    }
}

TEST(away_from_the_overlap_one_network_answers_alone)
{
    table_t one = BANK;
    num_t a = 0;
    num_t b = 0;

    one.n_networks = 1U;
    one.n_centers = BANK.networks[0].bits;
    CHECK_INT(FN(map)(&one, C(0.0), C(0.125), &a), FN(map)(&BANK, C(0.0), C(0.125), &b));
    CHECK(same(a, b));
}

TEST(where_no_network_is_the_constant_correction_answers)
{
    table_t table = BANK;
    gtc_word_t networks[3 * GTC_NETWORK_WORDS];
    num_t bias = 0;

    memcpy(networks, BANK.networks, sizeof networks);
#if TEST_Q31
    networks[5].integer = 800; /* the first network's region ends near -19 C, the others begin at 10 C */
#else
    networks[5].value = -19.0F;
#endif
    table.networks = networks;
    CHECK(FN(map)(&table, C(0.0), C(0.0), &bias) >= 0);
#if TEST_Q31
    CHECK(same(BANK.fallback, bias));
#else
    CHECK(same(BANK.fallback.value, bias));
#endif
}
#endif

TEST(a_bank_is_refused_by_a_build_without_it)
{
    state_t state;

    CHECK_INT(GTC_WITH_BANK ? GTC_OK : GTC_E_LAYOUT, init(&state, &BANK, PERIOD));
}

TEST(networks_that_do_not_share_out_the_centers_are_refused)
{
    table_t table = BANK;
    gtc_word_t networks[3 * GTC_NETWORK_WORDS];

    memcpy(networks, BANK.networks, sizeof networks);
    networks[GTC_NETWORK_WORDS].bits = 0xFFFFFFFFUL;
    table.networks = networks;
    CHECK_INT(GTC_E_LAYOUT, checked(&table));
}

int main(void)
{
#if GTC_WITH_BANK
    RUN(a_bank_passes_its_self_test);
    RUN(the_hand_over_has_no_jump);
    RUN(away_from_the_overlap_one_network_answers_alone);
    RUN(where_no_network_is_the_constant_correction_answers);
#endif
    RUN(a_bank_is_refused_by_a_build_without_it);
    RUN(networks_that_do_not_share_out_the_centers_are_refused);
    return test_end();
}
