/* primitives_f32.c - the float32 Gaussian for every float32 argument, against the same statements in float64.
 *
 * A float64 operation on float32 numbers, rounded to float32, gives what the float32 operation gives (53 >= 2 * 24 + 2
 * bits), so no float32 arithmetic of the compiler is believed. Prints arguments visited, those that differ, and
 * the worst departure from 2^(-u/64).
 */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "gtc_num_f32.h"

static float of_bits(uint32_t bits)
{
    gtc_word_t word;
    word.bits = bits;
    return word.value;
}

static float rounded(double x)
{
    return (float)x;
}

int main(int argc, char **argv)
{
    const uint32_t every = (argc > 1) ? (uint32_t)strtoul(argv[1], NULL, 10) : 1U;
    const float p1 = of_bits(0x3C3171B6U), p2 = of_bits(0x3874C223U);
    uint64_t visited = 0, wrong = 0;
    double worst = 0.0;
    double exact[64];
    float table[64];
    uint32_t bits;
    int i;
    for (i = 0; i < 64; i++) {
        exact[i] = exp2(-i / 64.0);
        table[i] = (float)exact[i];
    }
    for (bits = 0; bits < 0x45800000U; bits += every) { /* 0 ... 4096 */
        const float u = of_bits(bits);
        const float got = gtc_f32_gauss(u);
        float want = 0.0F;
        double true_value = 0.0;
        if (u < 2048.0F) {
            const int n = (int)u;
            const double f = (double)u - n; /* exact, also in float32 */
            const float h1 = rounded(f * p2);
            const float h2 = rounded((double)p1 - h1);
            const float h3 = rounded(f * h2);
            const float h4 = rounded(1.0 - h3);
            const double x = f * (0.6931471805599453094 / 64.0);
            want = rounded(ldexp((double)table[n % 64], -(n / 64)) * h4);
            true_value = ldexp(exact[n % 64], -(n / 64)) * (1 - x * (1 - x / 2 * (1 - x / 3 * (1 - x / 4 * (1 - x / 5)))));
        }
        wrong += (gtc_f32_bits(got) != gtc_f32_bits(want));
        worst = fmax(worst, fabs((double)got - true_value));
        visited++;
    }
    printf("gauss %" PRIu64 " %" PRIu64 " %.6e\n", visited, wrong, worst);
    return 0;
}
