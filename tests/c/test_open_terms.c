/* test_open_terms.c - images that carry extension terms: they need code that was compiled in. */
#include "test_image.h"

static gtc_word_t image[IMAGE_MAX];

static int try_open(uint_least32_t n)
{
    table_t table;

    seal(image, n);
    return FN(open)(&table, image, n, TERMS.id);
}

TEST(terms_open_where_their_code_is)
{
    const uint_least32_t n = image_of(&TERMS, image);
    const uint_least32_t kind = n - 1U - (TERMS.n_probes * 4U) - TERMS.n_sigma - (TERMS.n_terms * 8U);
    table_t table;

    CHECK_INT(GTC_OPEN_TERMS ? GTC_OK : GTC_E_LAYOUT, try_open(n));
#if GTC_OPEN_TERMS
    CHECK_INT(GTC_OK, FN(open)(&table, image, n, TERMS.id));
    CHECK_INT(GTC_OK, FN(check)(&table));
    CHECK(table.term_code[GTC_TERM_MEMORY - 1U] == TERMS.term_code[GTC_TERM_MEMORY - 1U]);
    CHECK(table.term_code[GTC_TERM_AUXILIARY - 1U] == TERMS.term_code[GTC_TERM_AUXILIARY - 1U]);
#else
    (void)table;
#endif
    image[kind].bits = 8U;
    CHECK_INT(GTC_E_LAYOUT, try_open(n));
    image[kind].bits = 0U;
    CHECK_INT(GTC_E_LAYOUT, try_open(n));
}

#if GTC_OPEN_TERMS
TEST(an_image_whose_terms_name_other_networks_is_refused)
{
    const uint_least32_t n = image_of(&TERMS, image);
    const uint_least32_t terms = n - 1U - (TERMS.n_probes * 4U) - TERMS.n_sigma - (TERMS.n_terms * 8U);
    gtc_word_t *const head = &image[terms + (3U * GTC_TERM_WORDS) + 1U];
    uint_least32_t number;
    uint_least32_t i;
    table_t table;

    for (number = 1U; number <= 0xFFFFU; number += (number < 32U) ? 1U : 0x7FFU) {
        head->bits = 1U + (number << 16);
        CHECK_INT((number == 2U) ? GTC_OK : GTC_E_LAYOUT, try_open(n));
    }
    /* No fallback model: then both networks are the map's. */
    head->bits = 1U;
    CHECK_INT(GTC_WITH_BANK ? GTC_OK : GTC_E_LAYOUT, try_open(n));
    head->bits = 1U + (2UL << 16);
    for (i = 0U; i < 3U; i++) {
        gtc_word_t *const other = &image[terms + (i * GTC_TERM_WORDS) + 1U];

        other->bits = 2UL << 16;
        CHECK_INT(GTC_E_LAYOUT, try_open(n));
        other->bits = 0U;
    }
    CHECK_INT(GTC_OK, try_open(n));
    CHECK_INT(GTC_OK, FN(open)(&table, image, n, TERMS.id));
    CHECK((table.n_networks == 1U) && (table.n_fallback_models == 1U));
    image[24].bits = 1U; /* networks: with its CRC, but the length does not fit any more */
    CHECK_INT(GTC_E_IMAGE, try_open(n));
}
#endif

TEST(more_terms_than_there_is_room_for_are_refused)
{
    const uint_least32_t n = image_of(&TERMS, image) + 8U;
    uint_least32_t i;

    /* One term more, before the uncertainty and the probes. */
    for (i = n - 1U; i >= (n - 1U - (TERMS.n_probes * 4U) - TERMS.n_sigma); i--) {
        image[i] = image[i - 8U];
    }
    image[2].bits = n;
    image[27].bits = TERMS.n_terms + 1U;
    CHECK_INT(GTC_E_LAYOUT, try_open(n));
}

int main(void)
{
    RUN(terms_open_where_their_code_is);
#if GTC_OPEN_TERMS
    RUN(an_image_whose_terms_name_other_networks_is_refused);
#endif
    RUN(more_terms_than_there_is_room_for_are_refused);
    return test_end();
}
