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
    CHECK(table.term_code[0] == TERMS.term_code[0]);
    CHECK(table.term_code[3] == TERMS.term_code[3]);
#else
    (void)table;
#endif
    image[kind].bits = 6U;
    CHECK_INT(GTC_E_LAYOUT, try_open(n));
    image[kind].bits = 0U;
    CHECK_INT(GTC_E_LAYOUT, try_open(n));
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
    image[27].bits = TERMS.n_terms + 1U;
    CHECK_INT(GTC_E_LAYOUT, try_open(n));
}

int main(void)
{
    RUN(terms_open_where_their_code_is);
    RUN(more_terms_than_there_is_room_for_are_refused);
    return test_end();
}
