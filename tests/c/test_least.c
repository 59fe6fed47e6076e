/* test_least.c - a build without any of the parts that can be left out: the same corrections, and no more. */
#include "test_num.h"

/* The test table as `emit` writes it where every part is left out. */
static table_t plain(void)
{
    table_t table = TABLE;

    table.parts = 0U;
    table.coverage = NULL;
    table.coverage_cells[0] = 0U;
    table.coverage_cells[1] = 0U;
    table.sigma = NULL;
    table.sigma_cells[0] = 0U;
    table.sigma_cells[1] = 0U;
    table.n_sigma = 0U;
    table.probes = NULL;
    table.n_probes = 0U;
    return table;
}

TEST(a_table_that_needs_a_part_is_refused)
{
    state_t state;
    uint_least32_t part;

    CHECK_INT(GTC_E_LAYOUT, init(&state, &TABLE, PERIOD));
    CHECK_INT(GTC_E_LAYOUT, FN(check)(&TABLE));
    for (part = 1U; part < 0x2000U; part <<= 1) {
        table_t table = plain();

        table.parts = part;
        CHECK_INT((part == GTC_PART_NARROW) ? GTC_OK : GTC_E_LAYOUT, init(&state, &table, PERIOD));
    }
}

TEST(a_table_with_more_channels_is_refused)
{
    state_t state;
    table_t table = plain();

    table.n_channels = GTC_MAX_CHANNELS + 1U;
    CHECK_INT(GTC_E_LAYOUT, init(&state, &table, PERIOD));
}

TEST(the_correction_is_that_of_the_whole_runtime)
{
    const table_t table = plain();
    state_t state;
    num_t temp = C(15.0);
    num_t bias = 0;
    num_t map = 0;

    CHECK_INT(GTC_E_IMAGE, FN(check)(&table)); /* all but the checksum, which is of the whole table */
    CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
    CHECK_INT(GTC_WARMING, ramp(&state, &temp, C(0.015625), (int)N * 4));
    CHECK_INT(GTC_OK, feed(&state, temp, 1));
    CHECK_INT(GTC_OK, get_bias(&state, &bias));
    CHECK_INT(GTC_OK, FN(map)(&table, C(15.0 + (0.015625 * 13.5)), C(0.0625), &map));
    CHECK(same(map, bias));
    CHECK_INT(GTC_CLAMPED, FN(map)(&table, C(95.0), 0, &map));
}

TEST(a_correction_that_is_no_number_is_the_fallback)
{
    const table_t table = plain();
    state_t state;
    num_t temp = C(15.0);

    CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
    (void)ramp(&state, &temp, C(0.015625), (int)N * 5);
    spoil_input(&state);
    (void)feed(&state, temp, 1);
    CHECK(same(bias_of(&state), WORD_OF(table.fallback)));
}

TEST(a_call_is_a_period_and_null_is_a_missed_sample)
{
    const table_t table = plain();
    const num_t temp = C(15.0);
    state_t state;

    memset(&state, 0, sizeof state);
    CHECK_INT(GTC_E_ARG, sample(NULL, PERIOD, &temp));
    CHECK_INT(GTC_E_ARG, sample(&state, PERIOD, &temp));
    CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
    CHECK_INT(GTC_E_ARG, sample(&state, 2UL * PERIOD, &temp));
    CHECK_INT(GTC_WARMING, sample(&state, PERIOD, &temp));
    CHECK_INT(GTC_WARMING | GTC_HELD, sample(&state, PERIOD, NULL));
    CHECK_INT(2, state.position);
}

TEST(a_stuck_sensor_is_held_here_too)
{
    const table_t table = plain();
    state_t state;

    CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
    CHECK_INT(GTC_WARMING, feed(&state, C(10.0), 12));
    CHECK_INT(GTC_WARMING | GTC_HELD, feed(&state, C(10.0), 1));
}

int main(void)
{
    RUN(a_table_that_needs_a_part_is_refused);
    RUN(a_table_with_more_channels_is_refused);
    RUN(the_correction_is_that_of_the_whole_runtime);
    RUN(a_correction_that_is_no_number_is_the_fallback);
    RUN(a_call_is_a_period_and_null_is_a_missed_sample);
    RUN(a_stuck_sensor_is_held_here_too);
    return test_end();
}
