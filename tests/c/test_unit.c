/* test_unit.c - a build that decodes one unit of fixed point refuses tables in another. */
#include "test_image.h"

TEST(a_table_in_another_unit_is_refused)
{
    static gtc_word_t image[IMAGE_MAX];
    table_t found = TABLE;
    uint_least32_t n;

    found.bias_frac_bits = GTC_BIAS_FRAC_BITS;
    n = image_of(&found, image);
    CHECK_INT(GTC_OK, FN(open)(&found, image, n, TABLE.id));
    CHECK(found.bias_frac_bits == GTC_BIAS_FRAC_BITS);

    CHECK(TABLE.bias_frac_bits != GTC_BIAS_FRAC_BITS);
    CHECK_INT(GTC_E_LAYOUT, FN(check)(&TABLE));
    {
        state_t state;

        CHECK_INT(GTC_E_LAYOUT, FN(init)(&state, &TABLE, PERIOD));
    }
    n = image_of(&TABLE, image);
    CHECK_INT(GTC_E_LAYOUT, FN(open)(&found, image, n, TABLE.id));
}

int main(void)
{
    RUN(a_table_in_another_unit_is_refused);
    return test_end();
}
