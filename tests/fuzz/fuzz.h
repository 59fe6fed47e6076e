/* fuzz.h - the input of a fuzz target as a stream of numbers, and claims that end it.
 *
 * Each target is one file, compiled for each arithmetic (TEST_Q31), with AddressSanitizer and
 * UndefinedBehaviorSanitizer: https://llvm.org/docs/LibFuzzer.html
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef FUZZ_H_INCLUDED
#define FUZZ_H_INCLUDED

#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include "test_image.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* A claim that must hold for every input. */
#define CLAIM(claim) ((claim) ? (void)0 : (printf("%s:%d: not true: %s\n", __FILE__, __LINE__, #claim), abort()))

#define REMARKS (GTC_WARMING | GTC_CLAMPED | GTC_UNCOVERED | GTC_HELD | GTC_FALLBACK | GTC_CHANNEL_LOST)

typedef struct {
    const uint8_t *data;
    size_t left;
} stream_t;

/* The next byte; 0 behind the end. */
static inline uint_least32_t next_byte(stream_t *in)
{
    uint_least32_t byte = 0U;

    if (in->left > 0U) {
        byte = in->data[0];
        in->data++;
        in->left--;
    }
    return byte;
}

static inline uint_least32_t next_word(stream_t *in)
{
    uint_least32_t word = next_byte(in);

    word |= next_byte(in) << 8;
    word |= next_byte(in) << 16;
    return word | (next_byte(in) << 24);
}

/* Any number of 32 bits of the arithmetic. */
static inline num_t next_number(stream_t *in)
{
    gtc_word_t word;

    word.bits = next_word(in);
#if TEST_Q31
    return word.integer;
#else
    return word.value;
#endif
}

/* One of the test tables: plain, bank, terms, narrow widths with terms, functions of a channel. */
static inline const table_t *next_table(stream_t *in)
{
    static const table_t *const tables[5] = {&TABLE, &BANK, &TERMS, &NARROW, &CURVED};

    return tables[next_byte(in) % 5U];
}

/* A correction is one that the table may give. */
static inline int is_within_authority(const table_t *table, num_t x)
{
    return ((x >= WORD_OF(table->authority[0])) && (x <= WORD_OF(table->authority[1]))) ? 1 : 0;
}

/* A correction is a number: not NaN, not infinite, not the mark of a missing one. */
static inline int is_number(num_t x)
{
#if TEST_Q31
    return (x != GTC_TEMP_MISSING) ? 1 : 0;
#else
    return (x - x == 0.0F) ? 1 : 0;
#endif
}

/* Spoils words: each change is a place and a new value. */
static inline void spoil(stream_t *in, gtc_word_t *words, uint_least32_t n)
{
    while (in->left >= 3U) {
        const uint_least32_t at = next_byte(in) | (next_byte(in) << 8);

        if ((at & 0x8000U) != 0U) {
            words[(at & 0x7FFFU) % n].bits ^= 1UL << (next_byte(in) % 32U);
        } else {
            words[at % n].bits = next_word(in);
        }
    }
}

#endif /* FUZZ_H_INCLUDED */
