/* map.c - the map at every pair of numbers of 32 bits. */
#include "arithmetic.h"

#if defined(ANY_TABLE)
/* What the conditions on several words of a table give, which no interval can say: docs/proof.md, section 2. */
#if defined(F32)
/*@ requires n >= 1; assigns \result \from x, range[0 .. 1], n; ensures \result <= n - 1; */
static inline uint_least32_t cell_of(float x, const gtc_word_t *range, uint_least32_t n);
#else
/*@ assigns \result \from x, range[0 .. 1];
    assigns *position \from x, range[0 .. 1], gain;
    ensures \initialized(position) && *position <= 65535;
    ensures \result == 0 || \result == 2 || \result == -1; */
static inline int position_of(int_least32_t x, const int_least32_t range[2], int_least32_t gain,
                              uint_least32_t *position);
#endif
#endif

#include RUNTIME
#include "any_table.h"

int main(void)
{
    unsigned a;
    unsigned b;
    any_table();
    /*@ loop unroll KINDS; */
    for (a = 0; a < KINDS; a++) {
        /*@ loop unroll KINDS; */
        for (b = 0; b < KINDS; b++) {
            num_t bias = 0;
            const int status = NAME(map)(&THE_TABLE, any_number(a), any_number(b), &bias);
            //@ check status == -1 || status == 0 || status == 2 || status == 4 || status == 6;
        }
    }
    return 0;
}
