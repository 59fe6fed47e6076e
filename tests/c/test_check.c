/* test_check.c - the boot self-test. */
#include "test_num.h"

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
    flip_all(&table, &table.sigma, 2U);
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
    FOUND(table.hold_blocks ^= 1U);
    FOUND(table.stuck_samples ^= 1U);
    FOUND(table.bias_frac_bits ^= 1U);
    FOUND(table.crc ^= 1U);
#undef FOUND
}

int main(void)
{
    RUN(a_sound_table_passes);
    RUN(every_flipped_bit_of_an_array_is_found);
    RUN(changed_members_are_found);
    return test_end();
}
