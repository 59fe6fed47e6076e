/* storm.c - a fuzz target without libFuzzer: pseudo-random inputs, as many as are asked for.
 *
 *     storm_image_q31 [executions [seed]]
 *
 * Without counters of coverage. The same seed gives the same inputs.
 *
 * SPDX-License-Identifier: MIT
 */
#include <stdio.h>
#include <stdlib.h>

#include "fuzz.h"

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

int main(int argc, char **argv)
{
    const unsigned long executions = (argc > 1) ? strtoul(argv[1], NULL, 10) : 100000UL;
    const unsigned long seed = (argc > 2) ? strtoul(argv[2], NULL, 10) : 1UL;
    uint64_t input[LENGTH / 8];
    unsigned long i;

    (void)setvbuf(stdout, NULL, _IONBF, 0U); /* a claim that fails ends the program at once */
    printf("seed %lu\n", seed);
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
