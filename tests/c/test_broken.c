/* test_broken.c - a build whose arithmetic is wrong must not pass its self-test.
 *
 * Linked with a copy of the runtime in which one expected result of the primitives is another one, as it
 * would be found on a target that computes wrongly.
 */
#include "test_num.h"

TEST(wrong_arithmetic_is_found)
{
    CHECK_INT(GTC_E_SELF_TEST, FN(check)(&TABLE));
}

int main(void)
{
    RUN(wrong_arithmetic_is_found);
    return test_end();
}
