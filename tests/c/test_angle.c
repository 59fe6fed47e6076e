/* test_angle.c - bias times time as an angle, and what rounding leaves. */
#include "test_num.h"

#if TEST_Q31
typedef gtc_q31_angle_t angle_t;
#define ANGLE_0 {0}
#else
typedef gtc_f32_angle_t angle_t;
#define ANGLE_0 {{0.0F, 0.0F}}
#endif

/* The correction of the test table at 17.5 C. */
static num_t some_bias(void)
{
    state_t state = started();

    CHECK(feed(&state, C(17.5), 1) >= 0);
    return bias_of(&state);
}

/* What a call left over, exactly: a product of two floats fits in a double, one of two integers of
 * 32 bits in 64. LIMIT: half a unit of the angle and, in float32, half a last place of an angle
 * below 128 arcsec. */
#if TEST_Q31
typedef long long exact_t;
#define MS 1000
#define LONGEST 1000000000
#define LIMIT 500000
#define REST(bias, dt, angle) (((exact_t)(bias) * (dt)) - ((exact_t)(angle) * 1000000))
#define IS_ON_GRID(angle) 1
#else
typedef double exact_t;
#define MS 0.001F
#define LONGEST 1000.0F
#define LIMIT (0.7501 / 65536.0)
#define REST(bias, dt, angle) (((exact_t)(bias) * (exact_t)(dt)) - (exact_t)(angle))
#define IS_ON_GRID(angle) (((double)(angle) * 65536.0) == (double)(long)((double)(angle) * 65536.0))
#endif

/* Asks `calls` times, with the steps in turn: the sum is never further than LIMIT from
 * bias * t. */
static void sums_to_bias_times_time(const num_t *steps, int n_steps, long calls)
{
    const num_t bias = some_bias();
    angle_t sum = ANGLE_0;
    exact_t rest = 0;
    long i;

    for (i = 0; i < calls; i++) {
        const num_t dt = steps[i % n_steps];
        num_t angle = 0;

        CHECK_INT(GTC_OK, FN(angle)(&sum, bias, dt, &angle));
        CHECK(IS_ON_GRID(angle));
        rest += REST(bias, dt, angle);
        CHECK((rest <= LIMIT) && (rest >= -LIMIT));
    }
}

TEST(the_sum_stays_within_a_unit)
{
    static const num_t steps[7] = {MS, 10 * MS, MS / 7, 0, 1000 * MS, MS / 3, 6000 * MS};
    int i;

    for (i = 0; i < 7; i++) {
        sums_to_bias_times_time(&steps[i], 1, 50000);
    }
    sums_to_bias_times_time(steps, 7, 100000);
}

TEST(over_24_hours_the_sum_is_bias_times_time)
{
    static const num_t step = 50 * MS;

    sums_to_bias_times_time(&step, 1, 24L * 3600L * 20L);
}

/* A task that comes late reads what several interrupts have added. */
TEST(increments_that_are_not_read_yet_add_up)
{
    const num_t bias = some_bias();
    angle_t one = ANGLE_0;
    angle_t other = ANGLE_0;
    num_t read_each = 0;
    num_t read_once = 0;
    int k;

    for (k = 0; k < 1000; k++) {
        num_t angle = 0;

        CHECK_INT(GTC_OK, FN(angle)(&one, bias, 7 * MS, &angle));
        read_each += angle;
        CHECK_INT(GTC_OK, FN(angle)(&other, bias, 7 * MS, &read_once));
    }
    CHECK(same(read_each, read_once));
    CHECK(read_once != 0);
}

TEST(bad_arguments_write_nothing)
{
    const num_t bias = some_bias();
    angle_t sum = ANGLE_0;
    angle_t before;
    num_t angle = 7;

    CHECK_INT(GTC_OK, FN(angle)(&sum, bias, MS, &angle));
    before = sum;
    angle = 7;
    CHECK_INT(GTC_E_ARG, FN(angle)(NULL, bias, MS, &angle));
    CHECK_INT(GTC_E_ARG, FN(angle)(&sum, bias, MS, NULL));
    CHECK_INT(GTC_E_ARG, FN(angle)(&sum, MISSING, MS, &angle));
    CHECK_INT(GTC_E_ARG, FN(angle)(&sum, bias, MISSING, &angle));
    CHECK_INT(GTC_E_ARG, FN(angle)(&sum, bias, -MS, &angle));
    CHECK_INT(GTC_E_ARG, FN(angle)(&sum, bias, LONGEST + MS, &angle));
    CHECK(same(7, angle));
    CHECK(memcmp(&before, &sum, sizeof sum) == 0);
}

#if TEST_Q31
TEST(an_angle_beyond_32_bits_is_refused)
{
    angle_t sum = ANGLE_0;
    num_t angle = 7;

    /* 2147484 units a second are too many for 1000 s, and just not for 999.999 s. */
    CHECK_INT(GTC_E_ARG, FN(angle)(&sum, 2147484, LONGEST, &angle));
    CHECK_INT(7, angle);
    angle = 0;
    CHECK_INT(GTC_OK, FN(angle)(&sum, 2147484, 999999000, &angle));
    CHECK_INT(2147481853L, angle);
    CHECK_INT(GTC_E_ARG, FN(angle)(&sum, 2147484, 999999000, &angle));
    angle = 0;
    CHECK_INT(GTC_E_ARG, FN(angle)(&sum, -2147484, LONGEST, &angle));
    CHECK_INT(GTC_OK, FN(angle)(&sum, -2147484, 999999000, &angle));
}
#else
TEST(large_angles_carry_what_a_float_cannot_hold)
{
    static const float biases[4] = {7.5e6F, -7.4999995e6F, 1.0e5F, -123456.7F};
    static const float steps[3] = {0.001F, 0.01F, 1000.0F};
    int i;
    int k;

    for (i = 0; i < 12; i++) {
        angle_t sum = {{0.0F, 0.0F}};
        double rest = 0.0;

        for (k = 0; k < 20000; k++) {
            float angle = 0.0F;
            double size;

            CHECK_INT(GTC_OK, FN(angle)(&sum, biases[i % 4], steps[i % 3], &angle));
            size = (angle < 0.0F) ? -(double)angle : (double)angle;
            /* The product of two floats is exact in float64, and so is every rest. */
            rest += ((double)biases[i % 4] * (double)steps[i % 3]) - (double)angle;
            CHECK((rest <= (size / 16777216.0 * 1.0001)) && (rest >= (-size / 16777216.0 * 1.0001)));
        }
        CHECK(((double)sum.rest[0] + (double)sum.rest[1]) == rest);
    }
}

TEST(an_angle_that_is_no_number_is_refused_and_leaves_no_trace)
{
    angle_t sum = {{0.25F, 0.0F}};
    num_t angle = 7.0F;

    CHECK_INT(GTC_E_ARG, FN(angle)(&sum, 3.0e38F, 1000.0F, &angle));
    CHECK_INT(GTC_E_ARG, FN(angle)(&sum, 3.0e38F, 0.001F, &angle));
    CHECK(same(angle, 7.0F));
    angle = 3.4e38F;
    CHECK_INT(GTC_E_ARG, FN(angle)(&sum, 3.0e34F, 1000.0F, &angle));
    CHECK(same(angle, 3.4e38F));
    angle = 7.0F;
    CHECK(same(sum.rest[0], 0.25F) && same(sum.rest[1], 0.0F));
}
#endif

int main(void)
{
    RUN(the_sum_stays_within_a_unit);
    RUN(over_24_hours_the_sum_is_bias_times_time);
    RUN(increments_that_are_not_read_yet_add_up);
    RUN(bad_arguments_write_nothing);
#if TEST_Q31
    RUN(an_angle_beyond_32_bits_is_refused);
#else
    RUN(large_angles_carry_what_a_float_cannot_hold);
    RUN(an_angle_that_is_no_number_is_refused_and_leaves_no_trace);
#endif
    return test_end();
}
