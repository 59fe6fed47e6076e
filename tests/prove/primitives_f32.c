/* primitives_f32.c - the float32 Gaussian for every float32 argument, against the same statements in float64.
 *
 * A float64 operation on float32 numbers, rounded to float32, gives what the float32 operation gives (53 >= 2 * 24 + 2
 * bits), so no float32 arithmetic of the compiler is believed. Prints arguments visited, those that differ, and
 * the worst departure from 2^(-u/64). Arguments `curve k` visit every k-th float32 (NaN and infinity among them) for
 * the two Gaussians of three records of terms: its worst departure from float64 is in units of the weights.
 */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gtc_num_f32.h"

static float of_bits(uint32_t bits)
{
    gtc_word_t word;
    word.bits = bits;
    return word.value;
}

/* What tests/prove/eva/arithmetic.h believes of a range, of a square and of the root of anything but plus infinity. */
static int breaks_contract(float x)
{
    const float most[] = {1.0F, 7.0F, 3.6e9F}, root = square_root(x), square = square_or(x, 4.0F);
    int wrong = !(isinf(x) && (x > 0.0F)) && !(isfinite(root) && (root >= 0.0F));
    wrong |= !((square >= 0.0F) && (square <= 1.0e38F));
    unsigned k;
    for (k = 0; k < 3U; k++) {
        const float least = (k == 0U) ? -1.0F : 0.0F;
        int_least32_t remarks = 0;
        const float y = saturate(x, least, most[k], &remarks);
        wrong |= !((y >= least) && (y <= most[k])) || ((remarks != 0) && (remarks != GTC_CLAMPED));
    }
    return wrong;
}

/* What the step functions believe of is_missing() (tests/prove/eva/step.c), for every float32. */
static uint64_t missing(uint32_t every)
{
    uint64_t wrong = 0, bits;
    for (bits = 0; bits <= 0xFFFFFFFFU; bits += every) {
        const float x = of_bits((uint32_t)bits);
        wrong += (is_missing(x) != (isfinite(x) ? 0 : 1)) || breaks_contract(x);
    }
    return wrong;
}

static float rounded(double x)
{
    return (float)x;
}

static float power(float u)
{
    const float h = 0x1.71549ep+6F, g = 0x1.0a69ccp+13F;
    const float plain = rounded((double)u + 12582912.0);
    int n;
    float f1;
    if (!(plain < 12584960.0F)) { /* 2048 or more, or no number */
        return 0.0F;
    }
    n = (int)(plain - 12582912.0F);
    f1 = rounded(rounded((double)u - n) - (double)h);
    f1 = rounded((double)rounded((double)f1 * f1) + g);
    return rounded(ldexp((double)rounded(0x1.ebfc21c077705p-15 * exp2(-(n % 64) / 64.0)), -(n / 64)) * f1);
}

static float one_bell(float x, float gain, float center, float weight)
{
    const float d = rounded((double)rounded((double)x - center) * gain);
    return rounded((double)weight * power(rounded((double)d * d)));
}

static void curve(uint32_t every)
{
    static const float records[3][5] = {
        { 1.6F, 12.0F, 0.004F, 12.5F, -0.003F },
        { 1.0e9F, -1.0F, 1.0e9F, 1.0e9F, 1.0e9F },
        { 0.003F, -1.0e5F, -0.01F, 1000.0F, 0.02F },
    };
    uint64_t wrong = 0, visited = 0, bits;
    double worst = 0.0;
    int i, k;
    for (k = 0; k < 3; k++) {
        const float *const r = records[k];
        const double size = fabs((double)r[2]) + fabs((double)r[4]);
        gtc_word_t words[5];
        for (i = 0; i < 5; i++) {
            words[i].value = r[i];
        }
        for (bits = 0; bits <= 0xFFFFFFFFU; bits += every) {
            const float x = of_bits((uint32_t)bits);
            const float found = gaussians_of_channel(x, words);
            const float want = rounded((double)one_bell(x, r[0], r[1], r[2]) + one_bell(x, r[0], r[3], r[4]));
            wrong += (bits_of(found) != bits_of(want)) || !isfinite(found);
            if (isfinite(x) && (visited % 16U == 0U)) {
                const double a = ((double)x - r[1]) * r[0], b = ((double)x - r[3]) * r[0];
                const double exact = r[2] * exp2(-a * a / 64.0) + r[4] * exp2(-b * b / 64.0);
                worst = fmax(worst, fabs(found - exact) / size);
            }
            visited++;
        }
    }
    printf("curve %" PRIu64 " %" PRIu64 " %.6e\n", visited, wrong, worst);
}

int main(int argc, char **argv)
{
    const uint32_t every = (argc > 1) ? (uint32_t)strtoul(argv[1], NULL, 10) : 1U;
    const float h = 0x1.71549ep+6F, g = 0x1.0a69ccp+13F;
    uint64_t visited = 0, wrong = 0;
    double worst = 0.0;
    double exact[64];
    float table[64];
    uint32_t bits;
    int i;
    if ((argc > 2) && (strcmp(argv[1], "curve") == 0)) {
        curve((uint32_t)strtoul(argv[2], NULL, 10));
        return 0;
    }
    for (i = 0; i < 64; i++) {
        exact[i] = exp2(-i / 64.0);
        table[i] = (float)(0x1.ebfc21c077705p-15 * exact[i]);
    }
    for (bits = 0; bits < 0x45800000U; bits += every) { /* 0 ... 4096 */
        const float u = of_bits(bits);
        const float got = exp2_of_minus(u);
        const int n = (int)rint(u);
        const double x = u * (0.6931471805599453094 / 64.0);
        float want = 0.0F;
        if (n < 2048) {
            const float f1 = rounded(((double)u - n) - h); /* u - n is exact, also in float32 */
            const float f2 = rounded((double)f1 * f1);
            const float f3 = rounded((double)f2 + g);
            want = rounded(ldexp((double)table[n % 64], -(n / 64)) * f3);
        }
        wrong += (bits_of(got) != bits_of(want));
        worst = fmax(worst, fabs((double)got - exp(-x)));
        visited++;
    }
    printf("gauss %" PRIu64 " %" PRIu64 " %.6e\n", visited, wrong, worst);
    printf("missing %" PRIu64 " %" PRIu64 "\n", (uint64_t)((0xFFFFFFFFULL + every) / every), missing(every));
    return 0;
}
