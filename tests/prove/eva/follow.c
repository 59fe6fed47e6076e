/* follow.c - one step of a memory from every state that it follows on from, for every plausible argument and every
 * gain, and its share after any number of blocks. */
#include "arithmetic.h"

#include RUNTIME

int main(void)
{
    num_t z[2];
#if defined(F32)
    const float gain = Frama_C_float_interval(0.0F, 1.0F);
    z[0] = Frama_C_float_interval(-FOLLOWED, FOLLOWED);
    z[1] = any_number(0);
#else
    const int_least32_t gain = (int_least32_t)Frama_C_long_interval(0, 2147483647L);
    z[0] = (int_least32_t)Frama_C_long_interval(-FOLLOWED, FOLLOWED);
    z[1] = any_number(0);
#endif
    follow_memory(z, ANY_PLAUSIBLE(), gain);
    (void)relaxed_share(gain, Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL));
    return 0;
}
