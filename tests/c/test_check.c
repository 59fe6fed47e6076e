/* test_check.c - the boot self-test. */
#include <stddef.h>

#include "test_image.h"

TEST(a_sound_table_passes)
{
    CHECK_INT(GTC_OK, FN(check)(&TABLE));
    CHECK_INT(GTC_E_ARG, FN(check)(NULL));
}

/* Every bit of every array, one after the other. */
static void flip_all(table_t *table, const gtc_word_t **array, uint_least32_t n)
{
    static gtc_word_t copy[64];
    const gtc_word_t *const original = *array;
    uint_least32_t i;

    CHECK(n <= 64U);
    memcpy(copy, original, n * sizeof copy[0]);
    *array = copy;
    for (i = 0U; i < (n * 32U); i++) {
        int status;

        copy[i / 32U].bits ^= 1UL << (i % 32U);
        status = FN(check)(table);
        CHECK((status == GTC_E_IMAGE) || (status == GTC_E_LAYOUT));
        copy[i / 32U].bits ^= 1UL << (i % 32U);
    }
    CHECK_INT(GTC_OK, FN(check)(table));
    *array = original;
}

TEST(every_flipped_bit_of_an_array_is_found)
{
    table_t table = TABLE;

    flip_all(&table, &table.networks, 8U);
    flip_all(&table, &table.centers, table.n_centers * 5U);
    flip_all(&table, &table.coverage, 1U);
    flip_all(&table, &table.serial, GTC_SERIAL_WORDS);
    flip_all(&table, &table.guards, GTC_GUARD_WORDS);
    flip_all(&table, &table.sigma, table.n_sigma);
    flip_all(&table, &table.probes, table.n_probes * 4U);
}

TEST(changed_members_are_found)
{
    table_t table;

#define FOUND(change)                                \
    do {                                             \
        table = TABLE;                               \
        change;                                      \
        CHECK_INT(GTC_E_IMAGE, FN(check)(&table));   \
    } while (0)

    FOUND(table.id ^= 1U);
    FOUND(table.slope_blocks ^= 1U);
    FOUND(table.calibrated ^= 1U);
    FOUND(table.block_us ^= 1U);
    FOUND(table.lead_blocks ^= 1U);
    FOUND(table.crc ^= 1U);
#undef FOUND
    table = TABLE;
    table.bias_frac_bits ^= 1U; /* the unit of another product */
    CHECK_INT(GTC_E_LAYOUT, FN(check)(&table));
    table = TABLE;
    table.parts |= 0x2000U; /* what no runtime has */
    CHECK_INT(GTC_E_LAYOUT, FN(check)(&table));
}

/* Counts of arrays whose end nothing can check are left out: in an image its length checks them. */
TEST(every_flipped_bit_of_a_member_is_found)
{
    const size_t more[3] = {offsetof(table_t, n_centers), offsetof(table_t, n_terms), offsetof(table_t, n_fallback_models)};
    const size_t settings = offsetof(table_t, n_networks) / sizeof(uint_least32_t);
    size_t i;

    for (i = 0U; i < ((settings + 3U) * 32U); i++) {
        const size_t word = i / 32U;
        table_t table = TABLE;
        unsigned char *const at = (unsigned char *)&table
                                  + ((word < settings) ? (word * sizeof(uint_least32_t)) : more[word - settings]);
        uint_least32_t bits;

        memcpy(&bits, at, sizeof bits);
        bits ^= 1UL << (i % 32U);
        memcpy(at, &bits, sizeof bits);
        CHECK(FN(check)(&table) < 0);
    }
}

/* A count that memory lost is found before anything is read by it. */
TEST(a_count_beyond_all_tables_is_found)
{
    table_t table;

#define FOUND(change)                                \
    do {                                             \
        table = TABLE;                               \
        change;                                      \
        CHECK_INT(GTC_E_LAYOUT, FN(check)(&table));  \
    } while (0)

    FOUND(table.n_networks = 17U);
    FOUND(table.n_fallback_models = 1U);
    FOUND(table.n_centers ^= 1U);
    FOUND(table.n_sigma = 0x4001U);
    FOUND(table.n_sigma = 0x3FFFU);
    FOUND(table.n_probes = 0x4001U);
    FOUND(table.coverage_cells[0] = 0x200U);
#undef FOUND
}

TEST(a_known_answer_that_is_not_met_is_found)
{
    gtc_word_t probes[64];
    gtc_word_t image[IMAGE_MAX];
    table_t table = TABLE;
    uint_least32_t k;

    /* Temperature not a number; status; answer: each with the right checksum. */
    for (k = 0U; k < 3U; k++) {
        uint_least32_t n;

        memcpy(probes, TABLE.probes, TABLE.n_probes * 4U * sizeof probes[0]);
        table.probes = probes;
        probes[(k == 0U) ? 0U : (k + 1U)].bits = (k == 0U) ? MISSING_BITS : 77U;
        n = image_of(&table, image);
        table.crc = image[n - 1U].bits;
        CHECK_INT(GTC_E_SELF_TEST, FN(check)(&table));
    }
}

int main(void)
{
    RUN(a_known_answer_that_is_not_met_is_found);
    RUN(a_count_beyond_all_tables_is_found);
    RUN(a_sound_table_passes);
    RUN(every_flipped_bit_of_an_array_is_found);
    RUN(changed_members_are_found);
    RUN(every_flipped_bit_of_a_member_is_found);
    return test_end();
}
