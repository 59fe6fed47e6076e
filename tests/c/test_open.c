/* test_open.c - a table from a binary image: the same bits as the compiled one, or none. */
#include "test_num.h"

#define MOST_WORDS 400
#define LAYOUT_WORD 1
#define LENGTH_WORD 2
#define ID_WORD 5
#define FIRST_COUNT 25

static gtc_word_t image[MOST_WORDS];
static uint_least32_t n_image;

static void put(uint_least32_t bits)
{
    CHECK(n_image < MOST_WORDS);
    image[n_image].bits = bits;
    n_image++;
}

static void put_words(const gtc_word_t *words, uint_least32_t n)
{
    uint_least32_t i;

    for (i = 0; i < n; i++) {
        put(words[i].bits);
    }
}

/* CRC-32, a bit at a time, over octets. */
static uint_least32_t crc_of(const gtc_word_t *words, uint_least32_t n)
{
    uint_least32_t crc = 0xFFFFFFFFUL;
    uint_least32_t i;

    for (i = 0; i < (n * 4U); i++) {
        int bit;

        crc ^= (words[i / 4U].bits >> (8U * (i % 4U))) & 0xFFU;
        for (bit = 0; bit < 8; bit++) {
            crc = ((crc & 1U) != 0U) ? ((crc >> 1) ^ 0xEDB88320UL) : (crc >> 1);
        }
    }
    return crc ^ 0xFFFFFFFFUL;
}

/* Makes the CRC right again after a change. */
static void seal(void)
{
    image[n_image - 1U].bits = crc_of(&image[1], n_image - 2U);
}

/* The image of the test table, from docs/FORMAT.md. The members are words without gaps. */
static void make_image(void)
{
    const table_t *const t = &TABLE;

    n_image = 0U;
    put(GTC_IMAGE_MAGIC);
    put(t->layout + (65536UL * (1U + TEST_Q31)));
    put(0U);
    put_words((const gtc_word_t *)(const void *)&t->quantity, 32U);
    put_words(t->serial, GTC_SERIAL_WORDS);
    put_words(t->networks, t->n_networks * GTC_NETWORK_WORDS);
    put_words(t->centers, t->n_centers * GTC_CENTER_WORDS);
    put_words(t->guards, t->n_channels * GTC_GUARD_WORDS);
    put_words(t->coverage, 1U);
    put_words(t->sigma, t->n_sigma);
    put_words(t->probes, t->n_probes * GTC_PROBE_WORDS);
    put(0U);
    image[LENGTH_WORD].bits = n_image;
    seal();
    CHECK_INT(t->crc, image[n_image - 1U].bits);
}

static const table_t *untouched(void)
{
    static table_t table;

    memset(&table, 0xA5, sizeof table);
    return &table;
}

/* Opens the first n words; an error must leave the table unwritten. */
static int opened(table_t *table, uint_least32_t n)
{
    int status;

    *table = *untouched();
    status = FN(open)(table, image, n, GTC_TEST_1_ID);
    CHECK(status <= 0);
    CHECK((status == GTC_OK) || (memcmp(table, untouched(), sizeof *table) == 0));
    return status;
}

TEST(an_opened_table_gives_the_same_bits_as_the_compiled_one)
{
    table_t table;
    state_t state;
    int i;

    make_image();
    CHECK_INT(GTC_OK, opened(&table, n_image));
    CHECK_INT(GTC_OK, FN(check)(&table));
    CHECK_INT(TABLE.crc, table.crc);
    CHECK(table.terms == NULL);
    CHECK((memcmp(table.serial, TABLE.serial, GTC_SERIAL_WORDS * sizeof table.serial[0]) == 0)
          && (table.calibrated == TABLE.calibrated));
    CHECK_INT(GTC_OK, init(&state, &table, PERIOD));
    for (i = 0; i < 400; i++) {
        const num_t temp = (num_t)(C(-30) + ((C(1) / 4) * (num_t)i));
        const num_t slope = (num_t)((C(1) / 64) * (num_t)((i % 80) - 40));
        num_t a = 0;
        num_t b = 0;

        CHECK_INT(FN(map)(&TABLE, temp, slope, &a), FN(map)(&table, temp, slope, &b));
        CHECK(same(a, b));
    }
}

TEST(words_behind_the_image_do_not_matter)
{
    table_t table;

    make_image();
    put(0xFFFFFFFFUL);
    CHECK_INT(GTC_OK, opened(&table, n_image));
}

TEST(every_flipped_bit_is_refused)
{
    table_t table;
    uint_least32_t i;

    make_image();
    for (i = 0; i < (n_image * 32U); i++) {
        image[i / 32U].bits ^= 1UL << (i % 32U);
        CHECK_INT(GTC_E_IMAGE, opened(&table, n_image));
        image[i / 32U].bits ^= 1UL << (i % 32U);
    }
    CHECK_INT(GTC_OK, opened(&table, n_image));
}

TEST(every_torn_word_is_refused)
{
    table_t table;
    uint_least32_t i;

    make_image();
    for (i = 0; i < n_image; i++) {
        const uint_least32_t bits = image[i].bits;

        image[i].bits = (bits == 0xFFFFFFFFUL) ? 0U : 0xFFFFFFFFUL;
        CHECK_INT(GTC_E_IMAGE, opened(&table, n_image));
        image[i].bits = ~bits & 0xFFFFFFFFUL;
        CHECK_INT(GTC_E_IMAGE, opened(&table, n_image));
        image[i].bits = bits;
    }
}

TEST(truncated_images_are_refused)
{
    table_t table;
    uint_least32_t n;

    make_image();
    for (n = 0; n < n_image; n++) {
        CHECK_INT(GTC_E_IMAGE, opened(&table, n));
    }
}

TEST(the_other_byte_order_is_refused)
{
    table_t table;
    uint_least32_t i;

    make_image();
    for (i = 0; i < n_image; i++) {
        const uint_least32_t x = image[i].bits;

        image[i].bits = ((x >> 24) & 0xFFU) | ((x >> 8) & 0xFF00U) | ((x << 8) & 0xFF0000UL)
                        | ((x << 24) & 0xFF000000UL);
    }
    CHECK_INT(0x31435447L, image[0].bits);
    CHECK_INT(GTC_E_IMAGE, opened(&table, n_image));
}

/* Sound in itself, but not for this build: status of an image with one word changed and sealed. */
static int changed(uint_least32_t word, uint_least32_t bits)
{
    table_t table;

    make_image();
    image[word].bits = bits;
    seal();
    return opened(&table, n_image);
}

TEST(foreign_images_are_refused)
{
    CHECK_INT(GTC_E_ID, changed(ID_WORD, GTC_TEST_1_ID ^ 1U));
    CHECK_INT(GTC_E_LAYOUT, changed(LAYOUT_WORD, (GTC_TABLE_LAYOUT - 1U) + (65536UL * (1U + TEST_Q31))));
    CHECK_INT(GTC_E_LAYOUT, changed(LAYOUT_WORD, GTC_TABLE_LAYOUT + (65536UL * (2U - TEST_Q31))));
    CHECK_INT(GTC_E_LAYOUT, changed(LAYOUT_WORD, 0U));
    CHECK_INT(GTC_E_LAYOUT, changed(3U, 1U)); /* quantity */
    CHECK_INT(GTC_E_LAYOUT, changed(4U, 1U)); /* unit */
    CHECK_INT(GTC_E_LAYOUT, changed(8U, GTC_MAX_SLOPE_BLOCKS + 1U));
    CHECK_INT(GTC_E_LAYOUT, changed(8U, 0U));
}

/* Other layouts may be shorter than this one. */
TEST(a_short_image_of_another_layout_is_reported_as_one)
{
    table_t table;

    n_image = 0U;
    put(GTC_IMAGE_MAGIC);
    put(1U + (65536UL * (1U + TEST_Q31)));
    put(5U);
    put(0U);
    put(0U);
    seal();
    CHECK_INT(GTC_E_LAYOUT, opened(&table, n_image));
    image[LAYOUT_WORD].bits = GTC_TABLE_LAYOUT + (65536UL * (1U + TEST_Q31));
    seal();
    CHECK_INT(GTC_E_IMAGE, opened(&table, n_image));
    image[LENGTH_WORD].bits = 3U;
    CHECK_INT(GTC_E_IMAGE, opened(&table, n_image));
}

/* Counts that do not make up the length, up to products and sums that wrap, with a right CRC. */
TEST(sizes_must_make_up_the_length)
{
    static const uint_least32_t wrong[8] = {
        0U, 70U, 0x20000000UL, 0x33333333UL, 0x40000000UL, 0x80000000UL, 0xFFFFFFFFUL, 0x10000UL,
    };
    uint_least32_t count;
    uint_least32_t i;

    for (count = 0; count < 10U; count++) {
        for (i = 0; i < 8U; i++) {
            make_image();
            if (((count < 6U) || (count > 7U) || (wrong[i] > 0xFFFFUL)) && (image[FIRST_COUNT + count].bits != wrong[i])) { /* not cells of sigma */
                CHECK_INT(GTC_E_IMAGE, changed(FIRST_COUNT + count, wrong[i]));
            }
        }
    }
}

/* What needs code that is not there: a term, a second network. */
TEST(what_was_not_compiled_in_is_refused)
{
    table_t table;
    uint_least32_t i;

    make_image();
    n_image = n_image - 1U;
    for (i = 0; i < 8U; i++) {
        put(0U);
    }
    put(0U);
    image[LENGTH_WORD].bits = n_image;
    image[FIRST_COUNT + 3U].bits = 1U;
    seal();
    CHECK_INT(GTC_E_LAYOUT, opened(&table, n_image));
    image[FIRST_COUNT + 3U].bits = 0U;
    image[FIRST_COUNT].bits = 2U;
    seal();
    CHECK_INT(GTC_E_LAYOUT, opened(&table, n_image));
}

TEST(null_pointers_are_refused)
{
    table_t table;

    make_image();
    CHECK_INT(GTC_E_ARG, FN(open)(NULL, image, n_image, GTC_TEST_1_ID));
    CHECK_INT(GTC_E_ARG, FN(open)(&table, NULL, n_image, GTC_TEST_1_ID));
}

int main(void)
{
    RUN(an_opened_table_gives_the_same_bits_as_the_compiled_one);
    RUN(words_behind_the_image_do_not_matter);
    RUN(every_flipped_bit_is_refused);
    RUN(every_torn_word_is_refused);
    RUN(truncated_images_are_refused);
    RUN(the_other_byte_order_is_refused);
    RUN(foreign_images_are_refused);
    RUN(a_short_image_of_another_layout_is_reported_as_one);
    RUN(sizes_must_make_up_the_length);
    RUN(what_was_not_compiled_in_is_refused);
    RUN(null_pointers_are_refused);
    return test_end();
}
