/* test_save.c - a state over power cycles: it goes on bit for bit, or nothing is taken over. */
#include "test_num.h"

#define WORDS GTC_SAVE_WORDS

/* A temperature history with faults in it, the same for every state. */
static void walk(state_t *state, int from, int to)
{
    int i;

    for (i = from; i < to; i++) {
        num_t temp = (num_t)(C(15) + ((C(1) / 64) * (num_t)i));

        if ((i % 11) == 7) {
            temp = MISSING;
        } else if ((i % 17) == 5) {
            temp += C(3);
        } else {
            /* as it is */
        }
        if ((i % 29) == 13) {
            CHECK(missed(state, (uint_least32_t)i % 7U) >= 0);
        }
        CHECK(feed_one(state, &temp) >= 0);
    }
}

static void saved(const state_t *state, gtc_word_t words[WORDS])
{
    memset(words, 0x5A, WORDS * sizeof words[0]);
    CHECK_INT(GTC_OK, save(state, words));
}

/* Restores; an error must leave the state unwritten. */
static int restored(state_t *state, const gtc_word_t words[WORDS], uint_least32_t off_blocks)
{
    state_t before;
    int status;

    memset(state, 0xA5, sizeof *state);
    memcpy(&before, state, sizeof before);
    status = restore(state, &TABLE, PERIOD, words, off_blocks);
    CHECK(status <= 0);
    CHECK((status == GTC_OK) || (memcmp(state, &before, sizeof before) == 0));
    return status;
}

/* At every sample of three windows, so at every place of a block. */
TEST(a_restored_state_goes_on_as_if_nothing_had_happened)
{
    gtc_word_t words[WORDS];
    int cut;
    int i;

    for (cut = 0; cut < 60; cut++) {
        state_t state = started();
        state_t other;

        walk(&state, 0, cut);
        saved(&state, words);
        CHECK_INT(GTC_OK, restored(&other, words, 0U));
        for (i = cut; i < (cut + 60); i++) {
            CHECK_INT(status_of(&state), status_of(&other));
            CHECK(same(bias_of(&state), bias_of(&other)));
            walk(&state, i, i + 1);
            walk(&other, i, i + 1);
        }
    }
}

TEST(a_saved_state_is_the_same_words_again)
{
    gtc_word_t words[WORDS];
    gtc_word_t again[WORDS];
    state_t state = started();
    state_t other;

    walk(&state, 0, 47);
    saved(&state, words);
    CHECK_INT(GTC_OK, restored(&other, words, 0U));
    saved(&other, again);
    CHECK(memcmp(words, again, sizeof words) == 0);
}

TEST(after_a_time_without_power_the_window_starts_again)
{
    gtc_word_t words[WORDS];
    state_t state = started();
    state_t fresh = started();
    state_t other;
    int i;

    walk(&state, 0, 47);
    saved(&state, words);
    CHECK_INT(GTC_OK, restored(&other, words, 3U));
    for (i = 47; i < 100; i++) {
        CHECK_INT(status_of(&fresh), status_of(&other));
        CHECK(same(bias_of(&fresh), bias_of(&other)));
        walk(&fresh, i, i + 1);
        walk(&other, i, i + 1);
    }
}

TEST(another_sample_rate_starts_the_window_again)
{
    gtc_word_t words[WORDS];
    state_t state = started();

    walk(&state, 0, 47);
    saved(&state, words);
    CHECK_INT(GTC_OK, restore(&state, &TABLE, 2UL * PERIOD, words, 0U));
    CHECK_INT(GTC_HELD, status_of(&state));
    CHECK_INT(GTC_WARMING, feed(&state, C(15), 1));
}

TEST(every_flipped_bit_is_refused)
{
    gtc_word_t words[WORDS];
    state_t state = started();
    uint_least32_t i;

    walk(&state, 0, 47);
    saved(&state, words);
    for (i = 0; i < (WORDS * 32U); i++) {
        words[i / 32U].bits ^= 1UL << (i % 32U);
        CHECK_INT(GTC_E_IMAGE, restored(&state, words, 0U));
        CHECK_INT(GTC_E_IMAGE, restored(&state, words, 1U));
        words[i / 32U].bits ^= 1UL << (i % 32U);
    }
    CHECK_INT(GTC_OK, restored(&state, words, 0U));
}

/* One word of another saved state, or all up to one: what a power cut leaves. */
TEST(torn_images_are_refused)
{
    gtc_word_t words[WORDS];
    gtc_word_t later[WORDS];
    gtc_word_t torn[WORDS];
    state_t state = started();
    int i;

    walk(&state, 0, 47);
    saved(&state, words);
    walk(&state, 47, 94);
    saved(&state, later);
    for (i = 0; i < WORDS; i++) {
        if (words[i].bits != later[i].bits) {
            memcpy(torn, words, sizeof torn);
            torn[i] = later[i];
            CHECK_INT(GTC_E_IMAGE, restored(&state, torn, 0U));
            memcpy(torn, words, sizeof torn);
            memcpy(torn, later, (size_t)i * sizeof torn[0]);
            CHECK((memcmp(torn, words, sizeof torn) == 0)
                  || (restored(&state, torn, 0U) == GTC_E_IMAGE));
        }
    }
}

TEST(a_state_of_another_table_is_refused)
{
    gtc_word_t words[WORDS];
    state_t state = started();
    table_t other = TABLE;

    saved(&state, words);
    other.crc ^= 1U;
    CHECK_INT(GTC_E_ID, restore(&state, &other, PERIOD, words, 0U));
    CHECK(state.table_crc == TABLE.crc);
}

TEST(erased_memory_is_refused)
{
    gtc_word_t words[WORDS];
    state_t state;

    memset(words, 0xFF, sizeof words);
    CHECK_INT(GTC_E_IMAGE, restored(&state, words, 0U));
    memset(words, 0, sizeof words);
    CHECK_INT(GTC_E_IMAGE, restored(&state, words, 0U));
}

TEST(a_state_of_the_other_arithmetic_is_refused)
{
    gtc_word_t words[WORDS];
    state_t state;
#if TEST_Q31
    gtc_f32_state_t other;

    CHECK_INT(GTC_OK, gtc_f32_init(&other, &gtc_test_1_f32, PERIOD));
    CHECK_INT(GTC_OK, gtc_f32_save(&other, &gtc_test_1_f32, words));
#else
    gtc_q31_state_t other;

    CHECK_INT(GTC_OK, gtc_q31_init(&other, &gtc_test_1_q31, PERIOD));
    CHECK_INT(GTC_OK, gtc_q31_save(&other, &gtc_test_1_q31, words));
#endif
    CHECK_INT(GTC_E_LAYOUT, restored(&state, words, 0U));
}

/* Words of a saved state: docs/numerics.md, section 7. */
#define STATUS 3
#define POSITION 5
#define FILLED 6
#define ELAPSED 8
#define BIAS 10
#define WINDOW_AT 11
#define INPUT_AT (WINDOW_AT + GTC_MAX_SLOPE_BLOCKS)
#define TERM_AT (INPUT_AT + (14 * (GTC_MAX_TERMS + 1)))
#define UNCERTAINTY_AT (TERM_AT + (2 * GTC_MAX_TERMS))
#define UNSHIFTED_AT (UNCERTAINTY_AT + 11)
#define SHIFT_AT (UNSHIFTED_AT + 1)

/* CRC of a saved state, bit by bit: over all words before it. */
static void resealed(gtc_word_t words[WORDS])
{
    uint_least32_t crc = 0xFFFFFFFFUL;
    int i;

    for (i = 0; i < ((WORDS - 1) * 32); i++) {
        const uint_least32_t bit = (words[i / 32].bits >> (i % 32)) & 1U;

        crc = (((crc ^ bit) & 1U) != 0U) ? ((crc >> 1) ^ 0xEDB88320UL) : (crc >> 1);
    }
    words[WORDS - 1].bits = crc ^ 0xFFFFFFFFUL;
}

/* Whoever wrote it: a CRC says nothing of that. */
TEST(numbers_that_no_call_leaves_are_refused_with_a_right_crc)
{
    static const int at[20] = {
        STATUS, STATUS, POSITION, FILLED, ELAPSED, BIAS, WINDOW_AT + 3, INPUT_AT + 5, INPUT_AT + 6, INPUT_AT + 7,
        INPUT_AT + 8, INPUT_AT + 9, INPUT_AT + 10, INPUT_AT + 11, INPUT_AT + 11, INPUT_AT + 8, TERM_AT, TERM_AT + 1,
        TERM_AT + 1, TERM_AT,
    };
    static const uint_least32_t to[20] = {
        0xFFFFFFFFUL, 64UL, 5UL, 5UL, 0x1000000UL, MISSING_BITS, 0x70000000UL, 5UL, 4UL, 4UL,
        0x70000000UL, 0x70000000UL, 0x70000000UL, 0x70000000UL, 0xF0000000UL, MISSING_BITS, 0x70000000UL, 0xF0000000UL,
        70000UL, 0xF0000000UL,
    };
    gtc_word_t words[WORDS];
    gtc_word_t forged[WORDS];
    state_t state = started();
    int k;

    walk(&state, 0, 30);
    saved(&state, words);
    for (k = 0; k < 20; k++) {
        memcpy(forged, words, sizeof forged);
        if (at[k] == (TERM_AT + 1)) {
            forged[TERM_AT].bits = 0U;
        }
        forged[at[k]].bits = to[k];
        resealed(forged);
        CHECK_INT(GTC_E_IMAGE, restored(&state, forged, 0U));
    }
    /* A sum that is not one of so many readings, above and below. */
    for (k = 0; k < 2; k++) {
        memcpy(forged, words, sizeof forged);
        forged[POSITION].bits = 1U;
        forged[INPUT_AT + 5].bits = 1U;
        forged[INPUT_AT + 12].bits = (k == 0) ? 0x70000000UL : (TEST_Q31 ? 0x80000000UL : 0xF0000000UL);
        forged[INPUT_AT + 13].bits = (TEST_Q31 && (k == 1)) ? 0xFFFFFFFFUL : 0U;
        resealed(forged);
        CHECK_INT(GTC_E_IMAGE, restored(&state, forged, 0U));
    }
    resealed(words);
    CHECK_INT(GTC_OK, restored(&state, words, 0U));
}

/* 0 stands for a number of a channel that has none yet, whatever its range is. */
TEST(a_state_of_a_range_below_0_is_restored)
{
    gtc_word_t guard[GTC_GUARD_WORDS];
    gtc_word_t words[WORDS];
    table_t table = TABLE;
    state_t state;

    memcpy(guard, TABLE.guards, sizeof guard);
    NUMBER(guard[1]) = C(-1.0);
    table.guards = guard;
    CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
    CHECK_INT(GTC_OK, save(&state, words));
    CHECK_INT(GTC_OK, restore(&state, &table, PERIOD, words, 0U));
    CHECK_INT(GTC_WARMING, feed(&state, C(-2.0), 9));
    CHECK_INT(GTC_OK, save(&state, words));
    CHECK_INT(GTC_OK, restore(&state, &table, PERIOD, words, 0U));
}

/* What the uncertainty is computed from must be numbers and temperatures, the shift what the table grants. */
TEST(uncertainties_that_no_call_leaves_are_refused_with_a_right_crc)
{
    static const int at[11] = {
        UNCERTAINTY_AT, UNCERTAINTY_AT + 1, UNCERTAINTY_AT + 2, UNCERTAINTY_AT + 3, UNCERTAINTY_AT + 6,
        UNCERTAINTY_AT + 7, UNSHIFTED_AT, UNCERTAINTY_AT + 8, SHIFT_AT, SHIFT_AT, SHIFT_AT + 1,
    };
    static const uint_least32_t to[11] = {
        MISSING_BITS, MISSING_BITS, MISSING_BITS, 0x70000000UL, 0x70000000UL, 0x70000000UL, MISSING_BITS, MISSING_BITS,
        0x70000000UL, 0xF0000000UL, MISSING_BITS,
    };
    gtc_word_t words[WORDS];
    gtc_word_t forged[WORDS];
    state_t state = started();
    int k;

    walk(&state, 0, 30);
    saved(&state, words);
    for (k = 0; k < 11; k++) {
        memcpy(forged, words, sizeof forged);
        forged[at[k]].bits = to[k];
        if ((TEST_Q31 != 0) && (at[k] == SHIFT_AT)) {
            forged[at[k]].bits = (k == 8) ? 0x7FFFFFFFUL : 0x80000001UL;
        }
        resealed(forged);
        CHECK_INT(GTC_E_IMAGE, restored(&state, forged, 0U));
    }
}

TEST(bad_arguments_are_refused)
{
    gtc_word_t words[WORDS];
    state_t state = started();
    state_t none = state;
    table_t unusable = TABLE;

    saved(&state, words);
    none.samples_per_block = 0U;
    unusable.layout = 1U;
    CHECK_INT(GTC_E_ARG, save(NULL, words));
    CHECK_INT(GTC_E_ARG, save(&state, NULL));
    CHECK_INT(GTC_E_ARG, save(&none, words));
    CHECK_INT(GTC_E_ARG, restore(NULL, &TABLE, PERIOD, words, 0U));
    CHECK_INT(GTC_E_ARG, restore(&state, NULL, PERIOD, words, 0U));
    CHECK_INT(GTC_E_ARG, restore(&state, &TABLE, PERIOD, NULL, 0U));
    CHECK_INT(GTC_E_ARG, restore(&state, &TABLE, 0U, words, 0U));
    CHECK_INT(GTC_E_LAYOUT, restore(&state, &unusable, PERIOD, words, 0U));
}

int main(void)
{
    RUN(a_state_of_a_range_below_0_is_restored);
    RUN(a_restored_state_goes_on_as_if_nothing_had_happened);
    RUN(a_saved_state_is_the_same_words_again);
    RUN(after_a_time_without_power_the_window_starts_again);
    RUN(another_sample_rate_starts_the_window_again);
    RUN(every_flipped_bit_is_refused);
    RUN(torn_images_are_refused);
    RUN(a_state_of_another_table_is_refused);
    RUN(erased_memory_is_refused);
    RUN(a_state_of_the_other_arithmetic_is_refused);
    RUN(numbers_that_no_call_leaves_are_refused_with_a_right_crc);
    RUN(uncertainties_that_no_call_leaves_are_refused_with_a_right_crc);
    RUN(bad_arguments_are_refused);
    return test_end();
}
