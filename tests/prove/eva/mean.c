/* mean.c - the mean of a block: |sum| <= valid * 290 C, valid in slices by powers of two. */
#include "arithmetic.h"

#include RUNTIME

int main(void)
{
    unsigned k;
    /*@ loop unroll 21; */
    for (k = 0; k <= 20U; k++) {
        const unsigned long most = 1UL << k; /* of valid, twice the least */
        const num_t base = ANY_PLAUSIBLE();
        const uint_least32_t valid = Frama_C_unsigned_long_interval((most + 1UL) / 2UL, most);
#if defined(F32)
        const wide_t sum = Frama_C_float_interval(-291.0F * (float)most, 291.0F * (float)most);
#else
        const wide_t sum = Frama_C_long_long_interval(-(290LL * 65536LL * (long long)most), 290LL * 65536LL * (long long)most);
#endif
        (void)mean_of(base, sum, valid);
    }
    return 0;
}
