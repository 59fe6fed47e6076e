/* self_test.c - what a build makes of many float32 tables: for each, the self-test and a digest of results.
 *
 * A line for each table: status of gtc_f32_check(), CRC of the results, in hexadecimal. Inputs are whole
 * multiples of powers of two: no rounding, so that no flag of a compiler can change them. tables.h, which
 * the test writes, lists the tables in TABLES.
 */
#include <stdio.h>

#include "tables.h"

#define MAPS 300
#define SAMPLES 400

typedef struct {
    const gtc_f32_table_t *table;
    long t_low, t_span; /* 2^-9 C, a little beyond the envelope */
    long s_low, s_span; /* 2^-14 C per block */
} subject_t;

static const subject_t subjects[] = {TABLES};

static uint_least32_t seed;
static uint_least32_t digest;

static long between(long low, long span)
{
    seed = (seed * 1664525UL + 1013904223UL) & 0xFFFFFFFFUL;
    return low + (long)((seed >> 8) % (uint_least32_t)span);
}

static void take_word(uint_least32_t word)
{
    int bit;

    digest ^= word & 0xFFFFFFFFUL;
    for (bit = 0; bit < 32; bit++) {
        digest = (digest >> 1) ^ (((digest & 1U) != 0U) ? 0xEDB88320UL : 0UL);
    }
}

static void take_result(int status, float x)
{
    gtc_word_t word;

    word.value = x;
    take_word((uint_least32_t)status);
    take_word(word.bits);
}

static void maps(const subject_t *subject)
{
    int k;

    for (k = 0; k < MAPS; k++) {
        const float t = (float)between(subject->t_low, subject->t_span) * 0x1p-9F;
        const float s = (float)between(subject->s_low, subject->s_span) * 0x1p-14F;
        float bias = 0.0F;
        const int status = gtc_f32_map(subject->table, t, s, &bias);

        take_result(status, bias);
    }
}

static void history(const subject_t *subject)
{
    static gtc_f32_state_t state;
    gtc_f32_angle_t sum = {{0.0F, 0.0F}};
    long t = subject->t_low + subject->t_span / 2;
    int k;

    take_word((uint_least32_t)gtc_f32_init(&state, subject->table, subject->table->block_us / 3U));
    for (k = 0; k < SAMPLES; k++) {
        float channels[8] = {0.0F};
        float bias = 0.0F;
        float angle = 0.0F;
        int c;
        int status;

        t += between(-20, 41);
        for (c = 1; c < 8; c++) {
            channels[c] = (float)between(10000, 4000) * 0x1p-10F;
        }
        channels[0] = (float)t * 0x1p-9F;
        status = ((k % 37) == 36) ? gtc_f32_sample(&state, subject->table, 2U * state.period_us, NULL) : gtc_f32_sample(&state, subject->table, state.period_us, channels);
        take_word((uint_least32_t)status);
        status = gtc_f32_bias(&state, subject->table, &bias);
        take_result(status, bias);
        status = gtc_f32_angle(&sum, bias, 0x1.47ae14p-7F, &angle);
        take_result(status, angle);
    }
}

static void put_word(uint_least32_t word)
{
    int shift;

    for (shift = 28; shift >= 0; shift -= 4) {
        putchar("0123456789abcdef"[(word >> shift) & 15U]);
    }
}

int main(void)
{
    unsigned k;

    for (k = 0U; k < sizeof subjects / sizeof subjects[0]; k++) {
        seed = k + 1U;
        digest = 0xFFFFFFFFUL;
        put_word((uint_least32_t)gtc_f32_check(subjects[k].table));
        putchar(' ');
        maps(&subjects[k]);
        history(&subjects[k]);
        put_word(digest);
        putchar('\n');
    }
    return 0;
}
