/* primitives_q31.c - the fixed-point primitives over all of their arguments, against formulas written apart.
 *
 * Prints one line for each: name, arguments visited, arguments that differ; for the Gaussian also its worst error
 * in 2^-29 against 2^-v for every v that truncates to u. Its argument k, if any, visits every k-th argument of
 * the Gaussian alone. Arguments `curve k` visit every k-th reading of a channel for the two Gaussians of three
 * records of terms: its worst error against float64 is in units of the weights.
 */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gtc_num_q31.h"

static uint64_t seed = 1;

static uint64_t draw(void) /* splitmix64 */
{
    uint64_t z = (seed += 0x9E3779B97F4A7C15ULL);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
    return z ^ (z >> 31);
}

static void gauss(uint64_t every)
{
    uint64_t wrong = 0;
    double worst = 0.0;
    uint64_t table[64];
    double step[64];
    uint64_t u;
    int i;
    for (i = 0; i < 64; i++) {
        table[i] = (uint64_t)llrint(2052389455.0 * exp2(-i / 64.0));
        step[i] = 536870912.0 * exp2(-i / 64.0);
    }
    for (u = 0; u < 536870912U; u += every) {
        const uint64_t f = u % 262144U; /* 2^-18 of an entry */
        const uint64_t v = 1557473452U - 64U * f;
        const uint64_t square = (v * v) / 4294967296U + 558709134U;
        const uint64_t want = ((table[(u / 262144U) % 64U] * square) / 4294967296U) >> (u / 16777216U);
        const int32_t got = (int32_t)exp2_of_minus((uint_least32_t)u);
        /* 2^(-f/64) at both ends by the exponential's series: f ln2/64 <= 0.011 */
        const double x0 = (double)f * (0.6931471805599453094 / 64.0 / 262144.0);
        const double x1 = (double)(f + 1U) * (0.6931471805599453094 / 64.0 / 262144.0);
        const double scale = ldexp(step[(u / 262144U) % 64U], -(int)(u / 16777216U));
        const double e0 = got - scale * (1 - x0 * (1 - x0 / 2 * (1 - x0 / 3 * (1 - x0 / 4 * (1 - x0 / 5)))));
        const double e1 = got - scale * (1 - x1 * (1 - x1 / 2 * (1 - x1 / 3 * (1 - x1 / 4 * (1 - x1 / 5)))));
        wrong += (got < 0) || ((uint64_t)got != want);
        worst = fmax(worst, fmax(fabs(e0), fabs(e1)));
    }
    printf("gauss %" PRIu64 " %" PRIu64 " %.6f\n", (536870911U + every) / every, wrong, worst);
}

/* Products of operands below 2^31, sums of products of numbers below 2^30 in magnitude. */
static void products(void)
{
    static const uint32_t corners[] = { 0, 1, 2, 0x7FFF, 0x8000, 0xFFFF, 0x10000, 0x10001, 0x3FFFFFFF, 0x40000000,
                                        0x7FFF0000, 0x7FFFFFFE, 0x7FFFFFFF };
    const uint64_t n = sizeof corners / sizeof corners[0];
    uint64_t wrong = 0, k;
    sum_t sum = { 0 };
    int64_t exact = 0;
    for (k = 0; k < n * n + 100000000U; k++) {
        const uint64_t pair = draw();
        const uint32_t a = (k < n * n) ? corners[k / n] : (uint32_t)pair & 0x7FFFFFFFU;
        const uint32_t b = (k < n * n) ? corners[k % n] : (uint32_t)(pair >> 33);
        const int32_t p = (pair & 0x80000000U) ? (int32_t)a : -(int32_t)a;
        const int32_t q = (pair & 0x100000000U) ? (int32_t)b : -(int32_t)b;
        const int32_t w = p / 2;
        const int32_t e = (int32_t)(b / 2U);
        wrong += (high_word(a, b) != (uint32_t)(((uint64_t)a * b) >> 32));
        wrong += (high_of_square(a) != (uint32_t)(((uint64_t)a * a) >> 32));
        wrong += (high_of_squares(p, q)
                  != (uint32_t)(((uint64_t)((int64_t)p * p) + (uint64_t)((int64_t)q * q)) >> 32));
        if (llabs(exact) > 0x0E00000000000000LL) {
            const sum_t zero = { 0 };
            sum = zero;
            exact = 0;
        }
        sum = accumulate(sum, w, e);
        exact += (int64_t)w * e;
        wrong += (units(sum)
                  != (uint32_t)(exact / 536870912 - ((exact % 536870912) < 0)));
    }
    printf("products %" PRIu64 " %" PRIu64 "\n", n * n + 100000000U, wrong);
}

/* Every input of a range, and inputs far outside. */
static void one_range(int32_t low, uint32_t span, uint64_t *visited, uint64_t *wrong)
{
    const int_least32_t range[2] = { low, (int32_t)(low + (int64_t)span) };
    const uint64_t most = (65536ULL * 134217728ULL - 1U) / (span > 0U ? span : 1U);
    const uint32_t gain = (uint32_t)(most > 0x7FFFFFFFULL ? 0x7FFFFFFFULL : most);
    uint64_t offset;
    uint_least32_t x = 0;
    for (offset = 0; offset <= span; offset++) {
        const int status = position_of((int32_t)(low + (int64_t)offset), range, (int_least32_t)gain, &x);
        const uint64_t want = (offset * gain) / 134217728U;
        *wrong += (status != GTC_OK) || (x != want) || (want > 65535U);
    }
    *visited += offset;
    if (low > -2147483647) {
        *wrong += position_of(low - 1, range, (int_least32_t)gain, &x) != GTC_CLAMPED || x != 0U;
        *wrong += position_of(-2147483647, range, (int_least32_t)gain, &x) != GTC_CLAMPED || x != 0U;
    }
    *wrong += position_of(2147483647, range, (int_least32_t)gain, &x) != GTC_CLAMPED
              || x != ((uint64_t)span * gain) / 134217728U;
    *wrong += position_of(GTC_TEMP_MISSING, range, (int_least32_t)gain, &x) != GTC_E_ARG;
    *visited += 4;
}

static void positions(void)
{
    static const uint32_t spans[] = { 0, 1, 2, 63, 64, 65, 65535, 65536, 65537, 6553600, 10000019, 67107839 };
    uint64_t visited = 0, wrong = 0;
    size_t k;
    for (k = 0; k < sizeof spans / sizeof spans[0]; k++) {
        one_range(-3276800, spans[k], &visited, &wrong);
        one_range(-13107200, spans[k], &visited, &wrong);
    }
    printf("positions %" PRIu64 " %" PRIu64 "\n", visited, wrong);
}

/* num / den to the nearest, halves away from zero. */
static void quotients(void)
{
    uint64_t wrong = 0, k;
    const uint64_t n = 50000000U;
    for (k = 0; k < n; k++) {
        const uint64_t bits = draw();
        const int64_t num = (int64_t)(draw() >> (8U + bits % 40U)) * ((bits & 0x10000U) ? 1 : -1);
        const uint32_t den = (uint32_t)((draw() >> (32U + bits / 64U % 31U)) | 1U);
        const int64_t q = rounded_quotient(num, den);
        /* |2 (num - q den)| <= den, and at a tie |q den| > |num| */
        const __int128 left = 2 * ((__int128)num - (__int128)q * den);
        const __int128 size = left < 0 ? -left : left;
        const int away = (num < 0) ? (left > 0) : (left < 0);
        wrong += (size > den) || ((size == den) && !away);
    }
    printf("quotients %" PRIu64 " %" PRIu64 "\n", n, wrong);
}

/* The rounding shift: a network without Gaussians, at every position. */
static void shifts(void)
{
    static const int32_t values[] = { 0, 1, -1, 2, -2, 3, -3, 16383, -16384, 32767, 32768, -32768, 65535, 65537,
                                      1000003, -1000003, 0x3FFFFFFF, -0x3FFFFFFF };
    const size_t n = sizeof values / sizeof values[0];
    static gtc_q31_table_t table;
    uint64_t visited = 0, wrong = 0;
    size_t a, b;
    for (a = 0; a < n; a++) {
        for (b = 0; b < n; b++) {
            gtc_word_t network[GTC_NETWORK_WORDS] = { { .bits = 0U }, { .integer = values[a] }, { .integer = values[b] },
                                                      { .integer = values[(a + b) % n] } };
            POINT in;
            for (in.x_temp = 0; in.x_temp < 65536U; in.x_temp++) {
                int64_t linear, want;
                in.x_slope = (in.x_temp * 40503U) & 0xFFFFU;
                linear = (int64_t)values[b] * in.x_temp + (int64_t)values[(a + b) % n] * in.x_slope;
                want = values[a] + linear / 65536 - ((linear % 65536) < 0);
                if ((want >= -2147483647) && (want <= 2147483647)) {
                    wrong += network_value(&table, network, network, &in) != want;
                    visited++;
                }
            }
        }
    }
    printf("shifts %" PRIu64 " %" PRIu64 "\n", visited, wrong);
}

/* 2^-u in 2^-29, u in 2^-24. */
static int64_t power(const uint64_t *table, uint64_t u)
{
    const uint64_t v = 1557473452U - 64U * (u % 262144U);
    const uint64_t square = (v * v) / 4294967296U + 558709134U;
    return (u < 536870912U) ? (int64_t)(((table[(u / 262144U) % 64U] * square) / 4294967296U) >> (u / 16777216U)) : 0;
}

static int64_t one_bell(const uint64_t *table, int64_t d, int64_t gain)
{
    const int64_t product = d * gain;
    const int64_t argument = product / 4096 - ((product % 4096) < 0);
    if ((argument >= 1610612736) || (argument <= -1610612736)) { /* 6 in 2^-28 */
        return 0;
    }
    return power(table, (uint64_t)(argument * argument) / 4294967296U);
}

/* Every reading of a channel, with Gaussians of a usual, the smallest and the largest gain. */
static void curve(uint64_t every)
{
    static const int32_t records[3][5] = {
        { 3355443, 786432, 400000000, 819200, -300000000 }, /* gain 0.2 for each unit, centers 12 and 12.5 */
        { 2147483647, -65536, 536870912, 1073741823, 536870912 },
        { 15000, -1073741823, -536870912, 1000, 123456789 },
    };
    uint64_t wrong = 0, visited = 0, table[64];
    double worst = 0.0;
    int i, k;
    for (i = 0; i < 64; i++) {
        table[i] = (uint64_t)llrint(2052389455.0 * exp2(-i / 64.0));
    }
    for (k = 0; k < 3; k++) {
        const int32_t *const r = records[k];
        gtc_word_t words[5];
        int64_t reading;
        for (i = 0; i < 5; i++) {
            words[i].integer = r[i];
        }
        for (reading = -2147483647; reading <= 2147483647; reading += (int64_t)every) {
            const int64_t x = reading > 1073741824 ? 1073741824 : reading < -1073741824 ? -1073741824 : reading;
            const int64_t found = gaussians_of_channel((int32_t)x, words);
            const int64_t sum = r[2] * one_bell(table, x - r[1], r[0]) + r[4] * one_bell(table, x - r[3], r[0]);
            wrong += (found != sum / 536870912 - ((sum % 536870912) < 0));
            if (visited % 16U == 0U) {
                const double a = (double)(x - r[1]) * r[0] / 1099511627776.0; /* 2^-40 */
                const double b = (double)(x - r[3]) * r[0] / 1099511627776.0;
                worst = fmax(worst, fabs((double)found - r[2] * exp2(-a * a) - r[4] * exp2(-b * b)));
            }
            visited++;
        }
    }
    printf("curve %" PRIu64 " %" PRIu64 " %.6e\n", visited, wrong, worst / 1073741824.0);
}

int main(int argc, char **argv)
{
    if ((argc > 2) && (strcmp(argv[1], "curve") == 0)) {
        curve(strtoull(argv[2], NULL, 10));
        return 0;
    }
    const uint64_t every = (argc > 1) ? strtoull(argv[1], NULL, 10) : 1U;
    gauss(every);
    if (every == 1U) {
        shifts();
        products();
        positions();
        quotients();
    }
    return 0;
}
