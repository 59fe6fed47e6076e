/* test_map.c - the static map: clamping, coverage, arguments. */
#include "test_num.h"

TEST(inside_it_answers_without_remark)
{
    num_t bias;

    CHECK_INT(GTC_OK, FN(map)(&TABLE, C(-15.0), C(-0.4), &bias));
}

TEST(outside_it_gives_the_value_at_the_edge)
{
    num_t bias;

    CHECK_INT(GTC_CLAMPED, FN(map)(&TABLE, C(-60.0), C(0.0), &bias));
    CHECK(same(bias, map_of(C(-20.0), C(0.0))));
    CHECK_INT(GTC_CLAMPED, FN(map)(&TABLE, C(100.0), C(0.25), &bias));
    CHECK(same(bias, map_of(C(60.0), C(0.25))));
    CHECK_INT(GTC_CLAMPED, FN(map)(&TABLE, C(-15.0), C(-9.0), &bias));
    CHECK(same(bias, map_of(C(-15.0), C(-0.5))));
    CHECK_INT(GTC_CLAMPED, FN(map)(&TABLE, C(45.0), C(9.0), &bias));
    CHECK(same(bias, map_of(C(45.0), C(0.5))));
}

TEST(cells_without_training_data_are_reported)
{
    num_t bias;

    /* Cells are 10 C by 1/3 C per block; rows of coverage: 11110000, 11111110, 00111111. */
    CHECK_INT(GTC_OK, FN(map)(&TABLE, C(19.0), C(-0.4), &bias));
    CHECK_INT(GTC_UNCOVERED, FN(map)(&TABLE, C(21.0), C(-0.4), &bias));
    CHECK_INT(GTC_UNCOVERED, FN(map)(&TABLE, C(55.0), C(0.0), &bias));
    CHECK_INT(GTC_UNCOVERED, FN(map)(&TABLE, C(-1.0), C(0.4), &bias));
    CHECK_INT(GTC_OK, FN(map)(&TABLE, C(1.0), C(0.4), &bias));
    CHECK_INT(GTC_UNCOVERED | GTC_CLAMPED, FN(map)(&TABLE, C(61.0), C(0.0), &bias));
}

TEST(without_a_coverage_map_nothing_is_uncovered)
{
    table_t table = TABLE;
    num_t bias;

    table.coverage = NULL;
    table.coverage_cells[0] = 0U;
    table.coverage_cells[1] = 0U;
    CHECK_INT(GTC_OK, FN(map)(&table, C(21.0), C(-0.4), &bias));
}

TEST(an_envelope_without_extent_has_one_cell)
{
    table_t table = TABLE;
    num_t bias;

    table.envelope[1] = table.envelope[0];
    table.envelope[3] = table.envelope[2];
    CHECK_INT(GTC_CLAMPED, FN(map)(&table, C(21.0), C(0.4), &bias));
    CHECK_INT(GTC_OK, FN(map)(&table, C(-20.0), C(-0.5), &bias));
}

TEST(far_from_a_center_its_gaussian_is_nothing)
{
    table_t table = TABLE;
    gtc_word_t centers[15];
    num_t a = 0;
    num_t b = 0;

    /* The first center is 5.4 widths away: its weight does not matter. */
    memcpy(centers, TABLE.centers, sizeof centers);
    table.centers = centers;
    centers[4].bits ^= 0x00100000UL;
    CHECK_INT(GTC_OK, FN(map)(&TABLE, C(55.0), C(0.4), &a));
    CHECK_INT(GTC_OK, FN(map)(&table, C(55.0), C(0.4), &b));
    CHECK(same(a, b));
    CHECK(FN(map)(&TABLE, C(-10.0), C(0.0), &a) >= 0);
    CHECK(FN(map)(&table, C(-10.0), C(0.0), &b) >= 0);
    CHECK(!same(a, b));
}

TEST(bad_arguments_write_nothing)
{
    num_t bias = C(7.0);

    CHECK_INT(GTC_E_ARG, FN(map)(NULL, C(1.0), C(0.0), &bias));
    CHECK_INT(GTC_E_ARG, FN(map)(&TABLE, MISSING, C(0.0), &bias));
    CHECK_INT(GTC_E_ARG, FN(map)(&TABLE, C(1.0), MISSING, &bias));
    CHECK_INT(GTC_E_ARG, FN(map)(&TABLE, C(1.0), C(0.0), NULL));
    CHECK(same(bias, C(7.0)));
}

int main(void)
{
    RUN(inside_it_answers_without_remark);
    RUN(outside_it_gives_the_value_at_the_edge);
    RUN(cells_without_training_data_are_reported);
    RUN(without_a_coverage_map_nothing_is_uncovered);
    RUN(an_envelope_without_extent_has_one_cell);
    RUN(far_from_a_center_its_gaussian_is_nothing);
    RUN(bad_arguments_write_nothing);
    return test_end();
}
