/* test_open_terms.c - images that carry extension terms. */
#include "test_image.h"

#define PARTS 11U /* word of an image */

static gtc_word_t image[IMAGE_MAX];

static int try_open(uint_least32_t n)
{
    table_t table;

    seal(image, n);
    return FN(open)(&table, image, n, TERMS.id);
}

TEST(terms_open)
{
    const uint_least32_t n = image_of(&TERMS, image);
    const uint_least32_t kind = n - 1U - (TERMS.n_probes * 4U) - TERMS.n_sigma - (TERMS.n_terms * 8U);
    table_t table;

    CHECK_INT(GTC_OK, try_open(n));
    CHECK_INT(GTC_OK, FN(open)(&table, image, n, TERMS.id));
    CHECK_INT(GTC_OK, FN(check)(&table));
    image[kind].bits = 8U;
    CHECK_INT(GTC_E_LAYOUT, try_open(n));
    image[kind].bits = 0U;
    CHECK_INT(GTC_E_LAYOUT, try_open(n));
}

/* A kind that a table does not name among its parts could be one that the runtime does not have. */
TEST(every_kind_is_named_among_the_parts)
{
    uint_least32_t i;

    for (i = 0U; i < TERMS.n_terms; i++) {
        const uint_least32_t n = image_of(&TERMS, image);

        image[PARTS].bits &= (uint_least32_t)~GTC_PART_TERM(TERMS.terms[i * GTC_TERM_WORDS].bits);
        CHECK_INT(GTC_E_LAYOUT, try_open(n));
    }
}

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
    CHECK_INT(GTC_E_LAYOUT, try_open(n));
    image[PARTS].bits |= GTC_PART_BANK;
    CHECK_INT(GTC_WITH_BANK ? GTC_OK : GTC_E_LAYOUT, try_open(n));
    image[PARTS].bits = TERMS.parts;
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
    image[25].bits = 1U; /* networks: with its CRC, but the length does not fit any more */
    CHECK_INT(GTC_E_IMAGE, try_open(n));
}

TEST(more_terms_than_there_is_room_for_are_refused)
{
    const uint_least32_t n = image_of(&TERMS, image) + 8U;
    uint_least32_t i;

    /* One term more, before the uncertainty and the probes. */
    for (i = n - 1U; i >= (n - 1U - (TERMS.n_probes * 4U) - TERMS.n_sigma); i--) {
        image[i] = image[i - 8U];
    }
    image[2].bits = n;
    image[28].bits = TERMS.n_terms + 1U;
    CHECK_INT(GTC_E_LAYOUT, try_open(n));
}

int main(void)
{
    RUN(terms_open);
    RUN(every_kind_is_named_among_the_parts);
    RUN(an_image_whose_terms_name_other_networks_is_refused);
    RUN(more_terms_than_there_is_room_for_are_refused);
    return test_end();
}
