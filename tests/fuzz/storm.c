/* storm.c - a fuzz target without libFuzzer: pseudo-random inputs, as many as are asked for.
 *
 *     storm_image_q31 [executions [seed]]
 *
 * Without counters of coverage, and with the CRC of a table of octets instead of the runtime's bit by bit, which
 * every other target goes through. The same seed gives the same inputs.
 *
 * SPDX-License-Identifier: MIT
 */
#include <stdio.h>
#include <stdlib.h>

#include "fuzz.h"
#include "gtc_private.h"

#define LENGTH 192

extern unsigned long image_opened;

static uint64_t state;

/* xorshift64* (Vigna 2016) */
static uint64_t next_random(void)
{
    state ^= state >> 12;
    state ^= state << 25;
    state ^= state >> 27;
    return state * 2685821657736338717ULL;
}

/* CRC-32 as libc/gtc_crc.c has it, by octets. */
static uint_least32_t octets[256];

uint_least32_t gtc_crc_word(uint_least32_t crc, uint_least32_t word)
{
    uint_least32_t rest = crc ^ word;
    int k;

    for (k = 0; k < 4; k++) {
        rest = octets[rest & 0xFFU] ^ (rest >> 8);
    }
    return rest;
}

uint_least32_t gtc_crc_words(uint_least32_t crc, const gtc_word_t *words, uint_least32_t n)
{
    uint_least32_t rest = crc;
    uint_least32_t i;

    for (i = 0U; i < n; i++) {
        rest = gtc_crc_word(rest, words[i].bits);
    }
    return rest;
}

static void make_octets(void)
{
    uint_least32_t i;
    int k;

    for (i = 0U; i < 256U; i++) {
        octets[i] = i;
        for (k = 0; k < 8; k++) {
            octets[i] = ((octets[i] & 1U) != 0U) ? ((octets[i] >> 1) ^ 0xEDB88320UL) : (octets[i] >> 1);
        }
    }
}

int main(int argc, char **argv)
{
    const unsigned long executions = (argc > 1) ? strtoul(argv[1], NULL, 10) : 100000UL;
    const unsigned long seed = (argc > 2) ? strtoul(argv[2], NULL, 10) : 1UL;
    uint64_t input[LENGTH / 8];
    unsigned long i;

    (void)setvbuf(stdout, NULL, _IONBF, 0U); /* a claim that fails ends the program at once */
    printf("seed %lu\n", seed);
    make_octets();
    state = (seed * 0x9E3779B97F4A7C15ULL) | 1U;
    for (i = 0UL; i < executions; i++) {
        int k;

        for (k = 0; k < (LENGTH / 8); k++) {
            input[k] = next_random();
        }
        (void)LLVMFuzzerTestOneInput((const uint8_t *)input, sizeof input);
        if (((i + 1UL) % 1000000UL) == 0UL) {
            printf("%lu executions, %lu opened\n", i + 1UL, image_opened);
            (void)fflush(stdout);
        }
    }
    printf("%lu executions, %lu opened: passed\n", executions, image_opened);
    return 0;
}
