/* fuzz_map.c - gtc_<n>_map() at any pair of numbers: its status is one of five, its bias a number. */
#include "fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    stream_t in = {data, size};
    const table_t *const table = next_table(&in);
    const num_t temp = next_number(&in);
    const num_t slope = next_number(&in);
    num_t bias = C(77);
    const int status = FN(map)(table, temp, slope, &bias);

    if (status < 0) {
        CLAIM((status == GTC_E_ARG) && same(bias, C(77)));
    } else {
        num_t again = 0;

        CLAIM(((status & ~(GTC_CLAMPED | GTC_UNCOVERED)) == 0) && is_number(bias));
        CLAIM((FN(map)(table, temp, slope, &again) == status) && same(bias, again));
    }
    return 0;
}
