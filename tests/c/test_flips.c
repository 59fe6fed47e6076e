/* test_flips.c - a state may hold anything: every single bit of a running state is flipped, and the program goes on.
 *
 * Whatever was flipped, no call traps or reads outside (the sanitizers of tests/fuzz watch), and no correction lies outside
 * of the authority. Tables have every kind of term, a bank and narrow widths.
 *
 * SPDX-License-Identifier: MIT
 */
#include "test_num.h"

static int is_within_authority(const table_t *table, num_t bias)
{
    return ((bias >= WORD_OF(table->authority[0])) && (bias <= WORD_OF(table->authority[1]))) ? 1 : 0;
}

static int is_status(int status)
{
    return (status >= GTC_E_REST) ? 1 : 0;
}

static void channels_at(int k, num_t channels[3])
{
    channels[0] = (num_t)(C(12) + ((C(1) / 64) * (num_t)((k * 7) % 50)) + ((C(1) / 32) * (num_t)k));
    channels[1] = (num_t)(C(12) + ((C(1) / 128) * (num_t)((k * 5) % 9)));
    channels[2] = channels[1];
}

/* A state in the middle of a recording: corrections, a hole, a re-zero. */
static state_t running(const table_t *table)
{
    state_t state;
    int k;

    memset(&state, 0, sizeof state);
    CHECK_INT(GTC_OK, FN(init)(&state, table, PERIOD));
    for (k = 0; k < 60; k++) {
        num_t channels[3];

        channels_at(k, channels);
        CHECK(FN(sample)(&state, table, PERIOD, ((k % 13) == 12) ? NULL : channels) >= 0);
    }
    CHECK(is_status(FN(rezero)(&state, table, 0, 3600U)));
    return state;
}

/* Everything that a program may ask of a state. A status or GTC_E_ARG, GTC_E_ID: nothing else. */
static void use(state_t *state, const table_t *table)
{
    gtc_word_t words[GTC_SAVE_WORDS];
    snapshot_t snapshot;
    int k;

    for (k = 0; k < 14; k++) {
        num_t channels[3];
        num_t bias = 0;
        int status;

        channels_at(60 + k, channels);
        status = FN(sample)(state, table, (k == 9) ? (7UL * PERIOD) : PERIOD, ((k % 5) == 4) ? NULL : channels);
        CHECK((status >= 0) || (status == GTC_E_ARG) || (status == GTC_E_ID));
        status = FN(bias)(state, table, &bias);
        CHECK((status < 0) ? same(bias, 0) : is_within_authority(table, bias));
    }
    CHECK(is_status(FN(snapshot)(state, table, &snapshot)));
    CHECK(is_status(FN(rezero)(state, table, 0, 60U)));
    if (FN(save)(state, table, words) == GTC_OK) {
        CHECK(is_status(FN(restore)(state, table, PERIOD, words, 0U)));
    }
}

static void flip_all(const table_t *table)
{
    const state_t before = running(table);
    size_t bit;

    for (bit = 0U; bit < (sizeof before * 8U); bit++) {
        state_t state = before;
        unsigned char octets[sizeof state];

        memcpy(octets, &state, sizeof state);
        octets[bit / 8U] = (unsigned char)(octets[bit / 8U] ^ (1U << (bit % 8U)));
        memcpy(&state, octets, sizeof state);
        use(&state, table);
    }
}

TEST(no_flipped_bit_leaves_the_authority)
{
    flip_all(&TABLE);
    flip_all(&TERMS);
    flip_all(&NARROW);
    flip_all(&CURVED);
#if GTC_WITH_BANK
    flip_all(&BANK);
#endif
}

/* The largest and the smallest words, and what is no number, in every place. */
TEST(no_word_leaves_the_authority)
{
    static const uint_least32_t extremes[8] = {0U, 1U, 0x7FFFFFFFUL, 0x80000000UL,
                                                  0xFFFFFFFFUL, 0x7F800000UL, 0x7FC00000UL, 0xFF7FFFFFUL};
    const table_t *const tables[3] = {&TABLE, &TERMS, &CURVED};
    size_t t;

    for (t = 0U; t < 3U; t++) {
        const state_t before = running(tables[t]);
        size_t at;

        for (at = 0U; (at + sizeof extremes[0]) <= sizeof before; at += sizeof extremes[0]) {
            size_t k;

            for (k = 0U; k < 8U; k++) {
                state_t state = before;

                memcpy((unsigned char *)&state + at, &extremes[k], sizeof extremes[0]);
                use(&state, tables[t]);
            }
        }
    }
}

/* A copy of a state for another table, or for the same gyro's next calibration. */
TEST(a_state_of_another_table_is_refused_by_every_function)
{
    state_t state = running(&TABLE);
    table_t next = TABLE;
    gtc_word_t words[GTC_SAVE_WORDS];
    snapshot_t snapshot;
    num_t temp = C(20);
    num_t bias = 7;

    next.crc ^= 1U;
    CHECK_INT(GTC_E_ID, FN(sample)(&state, &next, PERIOD, &temp));
    CHECK_INT(GTC_E_ID, FN(bias)(&state, &next, &bias));
    CHECK_INT(GTC_E_ID, FN(snapshot)(&state, &next, &snapshot));
    CHECK_INT(GTC_E_ID, FN(rezero)(&state, &next, 0, 60U));
    CHECK_INT(GTC_E_ID, FN(save)(&state, &next, words));
    CHECK(same(7, bias));
    CHECK_INT(GTC_E_ARG, FN(sample)(&state, NULL, PERIOD, &temp));
    CHECK_INT(GTC_E_ARG, FN(bias)(&state, NULL, &bias));
    CHECK(FN(bias)(&state, &TABLE, &bias) >= 0);
}

int main(void)
{
    RUN(no_flipped_bit_leaves_the_authority);
    RUN(no_word_leaves_the_authority);
    RUN(a_state_of_another_table_is_refused_by_every_function);
    return test_end();
}
