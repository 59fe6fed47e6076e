/* test_limits.c - images with a right CRC whose words lie outside their ranges: refused, however they came about. */
#include "test_image.h"

#define NETWORK 51U /* word of an image at which its networks begin */

#define HEADER_ROOM IMAGE_MAX /* more than a test table has besides its probes */

static gtc_word_t image[IMAGE_MAX];

/* A word of the arithmetic of this test. */
static gtc_word_t word_of(float f32, long q31)
{
    gtc_word_t word;

#if TEST_Q31
    (void)f32;
    word.integer = (int_least32_t)q31;
#else
    (void)q31;
    word.value = f32;
#endif
    return word;
}

/* Status of open() and init() for an image with a word replaced, and of check() for the table that it makes. */
static int status_with(const table_t *from, uint_least32_t at, gtc_word_t word)
{
    const uint_least32_t n = image_of(from, image);
    table_t table;
    int status;

    CHECK_INT(GTC_OK, FN(open)(&table, image, n, from->id));
    image[at] = word;
    seal(image, n);
    status = FN(open)(&table, image, n, from->id);
    if (status == GTC_OK) {
        state_t state;

        CHECK((FN(check)(&table) == GTC_OK) || (FN(check)(&table) == GTC_E_SELF_TEST));
        CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
    }
    return status;
}

static uint_least32_t centers_at(const table_t *table)
{
    return NETWORK + ((table->n_networks + table->n_fallback_models) * GTC_NETWORK_WORDS);
}

#if GTC_WITH_TERMS
static uint_least32_t terms_at(const table_t *table)
{
    return centers_at(table) + (table->n_centers * GTC_CENTER_WORDS) + (table->n_channels * GTC_GUARD_WORDS);
}
#endif

#define REFUSED(table, at, f32, q31) CHECK_INT(GTC_E_LAYOUT, status_with(&(table), at, word_of(f32, q31)))
#define OPENED(table, at, f32, q31) CHECK_INT(GTC_OK, status_with(&(table), at, word_of(f32, q31)))

#if !TEST_Q31
static float not_a_number(void)
{
    gtc_word_t word;

    word.bits = 0x7FC00000UL;
    return word.value;
}

static float infinite(void)
{
    gtc_word_t word;

    word.bits = 0x7F800000UL;
    return word.value;
}
#endif

TEST(members_keep_to_their_ranges)
{
    REFUSED(TABLE, 12U, 7.6e6F, 1073741825L);
    REFUSED(TABLE, 12U, -7.6e6F, -1073741825L);
    REFUSED(TABLE, 13U, -1.6e7F, 1L);
    REFUSED(TABLE, 13U, 1.0e-9F, GTC_TEMP_MISSING);
    REFUSED(TABLE, 14U, -1.0e-9F, -1L);
    REFUSED(TABLE, 15U, 1.0e-9F, 1L);
    REFUSED(TABLE, 16U, -1.0e-9F, -1L);
    REFUSED(TABLE, 17U, -1.0e-9F, -1L);
    REFUSED(TABLE, 18U, -201.0F, -1L);
    REFUSED(TABLE, 19U, 1.1e12F, -1L);
    REFUSED(TABLE, 20U, -1.0F, 33L);
    REFUSED(TABLE, 20U, -1.0F, -1L);
    REFUSED(TABLE, 21U, -201.0F, -13107201L);
    REFUSED(TABLE, 22U, 401.0F, 26214401L);
    OPENED(TABLE, 17U, 7.5e6F, 1073741824L);
    OPENED(TABLE, 17U, 0.0F, 0L);
}

/* The constant correction is one that the table may give. */
TEST(a_fallback_beyond_the_authority_is_refused)
{
    image_of(&TABLE, image);
    OPENED(TABLE, 14U, image[12].value, image[12].integer);
    REFUSED(TABLE, 14U, 0.0F, 0L);
}

/* A guard of the test table's only channel. */
TEST(guards_keep_to_their_ranges)
{
    const uint_least32_t guard = centers_at(&TABLE) + (TABLE.n_centers * GTC_CENTER_WORDS);
    gtc_word_t word;

    REFUSED(TABLE, guard, -90.1F, (-90L * 65536L) - 1L);
    REFUSED(TABLE, guard, 201.0F, 201L * 65536L);
    REFUSED(TABLE, guard + 1U, 200.1F, (200L * 65536L) + 1L);
    REFUSED(TABLE, guard + 2U, -1.0F, -1L);
    REFUSED(TABLE, guard + 2U, 1.1e9F, -2147483647L);
    REFUSED(TABLE, guard + 3U, -1.0F, -1L);
    OPENED(TABLE, guard + 2U, 1.0e9F, 2147483647L);
    OPENED(TABLE, guard + 2U, 0.0F, 0L);
    word.bits = 0x80000000UL;
    CHECK_INT(GTC_E_LAYOUT, status_with(&TABLE, guard + 4U, word));
    CHECK_INT(GTC_E_LAYOUT, status_with(&TABLE, guard + 5U, word));
    CHECK_INT(GTC_E_LAYOUT, status_with(&TABLE, guard + 6U, word));
    word.bits = 0U;
    CHECK_INT(GTC_OK, status_with(&TABLE, guard + 4U, word));
    CHECK_INT(GTC_E_LAYOUT, status_with(&TABLE, guard + 6U, word));
    word.bits = 100001UL;
    CHECK_INT(GTC_E_LAYOUT, status_with(&TABLE, guard + 6U, word));
}

TEST(whole_numbers_keep_to_their_ranges)
{
    gtc_word_t word;

    word.bits = 0U;
    CHECK_INT(GTC_E_LAYOUT, status_with(&TABLE, 7U, word));
    CHECK_INT(GTC_OK, status_with(&TABLE, 6U, word));
    word.bits = 3600000001UL;
    CHECK_INT(GTC_E_LAYOUT, status_with(&TABLE, 7U, word));
    CHECK_INT(GTC_E_LAYOUT, status_with(&TABLE, 6U, word));
    word.bits = 2U;
    CHECK_INT(GTC_E_LAYOUT, status_with(&TABLE, 9U, word));
    word.bits = 1U;
    CHECK_INT(GTC_OK, status_with(&TABLE, 9U, word));
    /* fewer words of the uncertainty than cells of it */
    word.bits = 200U;
    CHECK_INT(GTC_E_LAYOUT, status_with(&TABLE, 31U, word));
}

#if !TEST_Q31
TEST(what_is_no_number_is_refused)
{
    uint_least32_t at;

    for (at = 12U; at < 25U; at++) {
        REFUSED(TABLE, at, not_a_number(), 0L);
        REFUSED(TABLE, at, infinite(), 0L);
        REFUSED(TABLE, at, -infinite(), 0L);
    }
    for (at = NETWORK + 1U; at < (centers_at(&TABLE) + (TABLE.n_centers * GTC_CENTER_WORDS)); at++) {
        REFUSED(TABLE, at, not_a_number(), 0L);
        REFUSED(TABLE, at, infinite(), 0L);
        REFUSED(TABLE, at, -infinite(), 0L);
    }
}

/* 8 half ranges are the farthest that normalised inputs reach. */
TEST(inputs_beyond_the_normalised_range_are_refused)
{
    REFUSED(TABLE, 19U, 1.0F, 0L);
    REFUSED(TABLE, 20U, 100.0F, 0L);
    REFUSED(TABLE, 20U, infinite(), 0L);
    REFUSED(TABLE, 18U, 400.0F, 0L);
    REFUSED(TABLE, 23U, -1.0e5F, 0L);
}
#else
/* An envelope spans 26 bits and its positions end with 65535. */
TEST(positions_beyond_the_last_are_refused)
{
    REFUSED(TABLE, 18U, 0.0F, 2147483647L);
    REFUSED(TABLE, 19U, 0.0F, 2147483647L);
    OPENED(TABLE, 18U, 0.0F, 0L);
    REFUSED(TABLE, 23U, 0.0F, -1073741824L);
    REFUSED(TABLE, 23U, 0.0F, 32769L);
    REFUSED(TABLE, 23U, 0.0F, 1073741824L);
}

/* s x + k keeps to 32 bits over all positions, its negative too. */
TEST(arguments_beyond_their_word_are_refused)
{
    const uint_least32_t center = centers_at(&TABLE);

    REFUSED(TABLE, center, 0.0F, -1L);
    REFUSED(TABLE, center, 0.0F, 65536L);
    REFUSED(TABLE, center + 1U, 0.0F, 2147483647L);
    REFUSED(TABLE, center + 1U, 0.0F, GTC_TEMP_MISSING);
    REFUSED(TABLE, center + 3U, 0.0F, 2147483647L);
    REFUSED(TABLE, center + 11U, 0.0F, GTC_TEMP_MISSING); /* where s is 0 */
    OPENED(TABLE, center + 1U, 0.0F, -2147483647L);
#if GTC_WITH_TERMS
    REFUSED(NARROW, centers_at(&NARROW) + 1U, 0.0F, 2147483647L);
#endif
}

/* All magnitudes of a network together: 2^30. */
TEST(a_sum_of_weights_that_could_overflow_is_refused)
{
    const uint_least32_t center = centers_at(&TABLE);
    uint_least32_t k;

    for (k = 1U; k <= 3U; k++) {
        REFUSED(TABLE, NETWORK + k, 0.0F, 1073741824L);
        REFUSED(TABLE, NETWORK + k, 0.0F, -1073741824L);
        REFUSED(TABLE, NETWORK + k, 0.0F, 2147483647L);
        REFUSED(TABLE, NETWORK + k, 0.0F, GTC_TEMP_MISSING);
    }
    REFUSED(TABLE, center + 4U, 0.0F, 1073741824L);
    REFUSED(TABLE, center + 4U, 0.0F, GTC_TEMP_MISSING);
}
#endif

TEST(weights_and_gains_keep_to_their_ranges)
{
    const uint_least32_t center = centers_at(&TABLE);
    const uint_least32_t sigma = center + (TABLE.n_centers * GTC_CENTER_WORDS) + GTC_GUARD_WORDS + 1U;

    REFUSED(TABLE, NETWORK + 1U, 7.6e6F, 1073741825L);
    REFUSED(TABLE, NETWORK + 2U, -7.6e6F, -1073741825L);
    REFUSED(TABLE, center, 1.1e9F, 65536L);
    REFUSED(TABLE, center + 4U, 7.6e6F, 1073741825L);
#if !TEST_Q31
    REFUSED(TABLE, center + 1U, -1.0F, 0L);
    REFUSED(TABLE, center + 1U, 1.1e4F, 0L);
#endif
    REFUSED(TABLE, sigma, 7.6e6F, -1L);
    REFUSED(TABLE, sigma + 1U, -1.0F, -2147483647L);
}

/* A table that is linked, with its checksum mended. */
TEST(the_words_of_a_linked_table_are_tested_when_asked_for)
{
    table_t table = TABLE;

    table.calibrated = 0x80000000UL;
    table.crc = image[image_of(&table, image) - 1U].bits;
    CHECK_INT(GTC_OK, FN(check)(&table));
    CHECK_INT(GTC_E_LAYOUT, FN(check_words)(&table));
    CHECK_INT(GTC_E_ARG, FN(check_words)(NULL));
    CHECK_INT(GTC_OK, FN(check_words)(&TABLE));
}

TEST(an_envelope_of_one_value_is_one)
{
    OPENED(TABLE, 22U, -20.0F, -1310720L);
    REFUSED(TABLE, 22U, -20.0F - 1.0F, -1310720L - 1L);
}

TEST(a_region_that_is_reversed_is_refused)
{
    REFUSED(TABLE, NETWORK + 4U, 61.0F, 65536L);
    REFUSED(TABLE, NETWORK + 5U, -201.0F, -1L);
    REFUSED(TABLE, NETWORK + 6U, 10.0F, 65536L);
    OPENED(TABLE, NETWORK + 4U, 60.0F, 65535L);
}

#if GTC_WITH_BANK
/* Shares are divided by the width of a region. */
TEST(a_region_without_a_width_is_refused_in_a_bank)
{
    image_of(&BANK, image);
    REFUSED(BANK, NETWORK + 5U, image[NETWORK + 4U].value, image[NETWORK + 4U].integer);
    image_of(&BANK, image);
    REFUSED(BANK, NETWORK + 6U, image[NETWORK + 7U].value, image[NETWORK + 7U].integer);
    image_of(&BANK, image);
    REFUSED(BANK, NETWORK + 8U + 4U, image[NETWORK + 8U + 5U].value, image[NETWORK + 8U + 5U].integer);
}

/* A network that asks for more centers than are left, and one that leaves some. */
TEST(networks_share_out_the_centers)
{
    gtc_word_t word;

    word.bits = BANK.n_centers + 1U;
    CHECK_INT(GTC_E_LAYOUT, status_with(&BANK, NETWORK, word));
    word.bits = 0xFFFFFFFFUL;
    CHECK_INT(GTC_E_LAYOUT, status_with(&BANK, NETWORK + 16U, word));
    word.bits = 2U;
    CHECK_INT(GTC_E_LAYOUT, status_with(&BANK, NETWORK, word));
}
#endif

#if GTC_WITH_TERMS
/* A word of the first term of a kind, by its place in the record. */
static uint_least32_t of_kind(uint_least32_t kind, uint_least32_t place)
{
    uint_least32_t i = 0U;

    while ((i < TERMS.n_terms) && (TERMS.terms[i * GTC_TERM_WORDS].bits != kind)) {
        i++;
    }
    CHECK(i < TERMS.n_terms);
    return terms_at(&TERMS) + (i * GTC_TERM_WORDS) + place;
}

TEST(parameters_of_terms_keep_to_their_ranges)
{
    uint_least32_t i;

    REFUSED(TERMS, of_kind(GTC_TERM_MEMORY, 2U), 1.1F, -1L);
    REFUSED(TERMS, of_kind(GTC_TERM_MEMORY, 2U), -0.1F, -2147483647L);
    REFUSED(TERMS, of_kind(GTC_TERM_MEMORY, 4U), -1.0F, -1L);
    REFUSED(TERMS, of_kind(GTC_TERM_PLAY, 4U), 1.1e9F, 1073741825L);
    REFUSED(TERMS, of_kind(GTC_TERM_PLAY, 5U), 400.5F, 26214401L);
    REFUSED(TERMS, of_kind(GTC_TERM_PLAY, 5U), -200.5F, -13107201L);
    for (i = 0U; i < TERMS.n_terms; i++) {
        REFUSED(TERMS, terms_at(&TERMS) + (i * GTC_TERM_WORDS) + 7U, 1.0F, 1L);
    }
}

TEST(functions_of_a_channel_keep_to_their_ranges)
{
    const uint_least32_t curve = terms_at(&CURVED);
    const uint_least32_t product = curve + GTC_TERM_WORDS;

    REFUSED(CURVED, curve + 2U, 1.1e9F, 1073741825L);
    REFUSED(CURVED, curve + 3U, -1.0F, -1L);
    REFUSED(CURVED, curve + 3U, 1.1e9F, -2147483647L);
    REFUSED(CURVED, curve + 4U, 1.1e9F, 1073741824L);
    REFUSED(CURVED, curve + 5U, -1.1e9F, 536870913L);
    REFUSED(CURVED, curve + 6U, -1.1e9F, -1073741824L);
    REFUSED(CURVED, curve + 7U, 1.1e9F, -536870913L);
    REFUSED(CURVED, product + 2U, 1.1e9F, 1073741825L);
    REFUSED(CURVED, product + 3U, -1.1e9F, -1073741825L);
    REFUSED(CURVED, product + 4U, 1.1e9F, 1073741825L);
    REFUSED(CURVED, product + 5U, 1.1e9F, 1073741825L);
    REFUSED(CURVED, product + 6U, 1.0F, 1L);
    REFUSED(CURVED, product + 7U, 1.0F, 1L);
}

/* The hottest envelope, 400 C, and the widest play make the largest number of 32 bits. */
TEST(the_ends_of_a_play_fit_a_word_at_the_edge_of_any_envelope)
{
    const uint_least32_t width = of_kind(GTC_TERM_PLAY, 2U);

    OPENED(TERMS, width, 1.0e9F, 2147483647L - (400L * 65536L));
    REFUSED(TERMS, width, 1.1e9F, 2147483648L - (400L * 65536L));
    REFUSED(TERMS, width, -1.0F, -1L);
}

TEST(terms_read_the_channels_that_are_theirs)
{
    const uint_least32_t play = of_kind(GTC_TERM_PLAY, 1U);
    gtc_word_t word;

    word.bits = 0U;
    CHECK_INT(GTC_E_LAYOUT, status_with(&CURVED, terms_at(&CURVED) + 1U, word));
    CHECK_INT(GTC_E_LAYOUT, status_with(&CURVED, terms_at(&CURVED) + GTC_TERM_WORDS + 1U, word));
    word.bits = 2U;
    CHECK_INT(GTC_E_LAYOUT, status_with(&CURVED, terms_at(&CURVED) + 1U, word));
    word.bits = 1U;
    CHECK_INT(GTC_E_LAYOUT, status_with(&TERMS, play, word));
    word.bits = 0xFFFFFFFFUL;
    CHECK_INT(GTC_E_LAYOUT, status_with(&TERMS, play, word));
}
#endif

/* A count that is in its range can still make more words than a table has. */
TEST(a_table_of_more_than_16384_words_is_refused_by_each_way_in)
{
    static gtc_word_t probes[4096U * GTC_PROBE_WORDS];
    static gtc_word_t large[HEADER_ROOM + (4096U * GTC_PROBE_WORDS)];
    table_t table = TABLE;
    table_t read;
    uint_least32_t n;

    table.probes = probes;
    table.n_probes = 4096U;
    n = image_of(&table, large);
    CHECK_INT(GTC_E_LAYOUT, FN(open)(&read, large, n, table.id));
    CHECK_INT(GTC_E_LAYOUT, FN(check_words)(&table));
    CHECK_INT(GTC_E_LAYOUT, FN(check)(&table));
    table.n_probes = 3500U;
    n = image_of(&table, large);
    CHECK_INT(GTC_OK, FN(open)(&read, large, n, table.id));
    CHECK_INT(GTC_OK, FN(check_words)(&table));
    table.crc = large[n - 1U].bits;
    CHECK_INT(GTC_E_SELF_TEST, FN(check)(&table));
}

int main(void)
{
    RUN(members_keep_to_their_ranges);
    RUN(a_fallback_beyond_the_authority_is_refused);
    RUN(guards_keep_to_their_ranges);
    RUN(whole_numbers_keep_to_their_ranges);
#if TEST_Q31
    RUN(positions_beyond_the_last_are_refused);
    RUN(arguments_beyond_their_word_are_refused);
    RUN(a_sum_of_weights_that_could_overflow_is_refused);
#else
    RUN(what_is_no_number_is_refused);
    RUN(inputs_beyond_the_normalised_range_are_refused);
#endif
    RUN(weights_and_gains_keep_to_their_ranges);
    RUN(the_words_of_a_linked_table_are_tested_when_asked_for);
    RUN(an_envelope_of_one_value_is_one);
    RUN(a_region_that_is_reversed_is_refused);
#if GTC_WITH_BANK
    RUN(a_region_without_a_width_is_refused_in_a_bank);
    RUN(networks_share_out_the_centers);
#endif
#if GTC_WITH_TERMS
    RUN(parameters_of_terms_keep_to_their_ranges);
    RUN(functions_of_a_channel_keep_to_their_ranges);
    RUN(the_ends_of_a_play_fit_a_word_at_the_edge_of_any_envelope);
    RUN(terms_read_the_channels_that_are_theirs);
#endif
    RUN(a_table_of_more_than_16384_words_is_refused_by_each_way_in);
    return test_end();
}
