/* test_image.h - the image of a table, written from docs/FORMAT.md alone.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef TEST_IMAGE_H_INCLUDED
#define TEST_IMAGE_H_INCLUDED

#include "test_num.h"

#define IMAGE_MAX 512U

#if TEST_Q31
#define ARITHMETIC 2U
#define MEMBER_WORD(member) ((uint_least32_t)(member))
#else
#define ARITHMETIC 1U
#define MEMBER_WORD(member) ((member).bits)
#endif

/* CRC-32 of n words, bit by bit, each word as four octets. */
static inline uint_least32_t crc_of(const gtc_word_t *words, uint_least32_t n)
{
    uint_least32_t crc = 0xFFFFFFFFUL;
    uint_least32_t i;

    for (i = 0U; i < (n * 32U); i++) {
        const uint_least32_t bit = (words[i / 32U].bits >> (i % 32U)) & 1U;

        crc = (((crc ^ bit) & 1U) != 0U) ? ((crc >> 1) ^ 0xEDB88320UL) : (crc >> 1);
    }
    return crc ^ 0xFFFFFFFFUL;
}

static inline uint_least32_t put(gtc_word_t *image, uint_least32_t n, const gtc_word_t *from,
                                 uint_least32_t count)
{
    uint_least32_t i;

    for (i = 0U; i < count; i++) {
        image[n + i] = from[i];
    }
    return n + count;
}

/* Closes an image of n words with its CRC. */
static inline void seal(gtc_word_t *image, uint_least32_t n)
{
    image[n - 1U].bits = crc_of(&image[1], n - 2U);
}

/* Writes the image of a table; returns its length in words. */
static inline uint_least32_t image_of(const table_t *table, gtc_word_t *image)
{
    uint_least32_t n = 0U;
    uint_least32_t i;

    image[n++].bits = GTC_IMAGE_MAGIC;
    image[n++].bits = GTC_TABLE_LAYOUT + (ARITHMETIC * 65536UL);
    image[n++].bits = 0U;
    image[n++].bits = table->quantity;
    image[n++].bits = table->unit;
    image[n++].bits = table->id;
    image[n++].bits = table->calibrated;
    image[n++].bits = table->block_us;
    image[n++].bits = table->slope_blocks;
    image[n++].bits = table->lead_blocks;
    image[n++].bits = table->bias_frac_bits;
    image[n++].bits = table->parts;
    image[n++].bits = MEMBER_WORD(table->fallback);
    image[n++].bits = MEMBER_WORD(table->authority[0]);
    image[n++].bits = MEMBER_WORD(table->authority[1]);
    image[n++].bits = MEMBER_WORD(table->effect[0]);
    image[n++].bits = MEMBER_WORD(table->effect[1]);
    image[n++].bits = MEMBER_WORD(table->rezero);
    for (i = 0U; i < 3U; i++) {
        image[n++].bits = MEMBER_WORD(table->scale[i]);
    }
    for (i = 0U; i < 4U; i++) {
        image[n++].bits = MEMBER_WORD(table->envelope[i]);
    }
    image[n++].bits = table->n_networks + table->n_fallback_models;
    image[n++].bits = table->n_centers;
    image[n++].bits = table->n_channels;
    image[n++].bits = table->n_terms;
    image[n++].bits = table->coverage_cells[0];
    image[n++].bits = table->coverage_cells[1];
    image[n++].bits = table->sigma_cells[0];
    image[n++].bits = table->sigma_cells[1];
    image[n++].bits = table->n_sigma;
    image[n++].bits = table->n_probes;
    n = put(image, n, table->serial, 16U);
    n = put(image, n, table->networks, (table->n_networks + table->n_fallback_models) * 8U);
    n = put(image, n, table->centers, table->n_centers * 5U);
    n = put(image, n, table->guards, table->n_channels * 8U);
    n = put(image, n, table->terms, table->n_terms * 8U);
    n = put(image, n, table->coverage, ((table->coverage_cells[0] * table->coverage_cells[1]) + 31U) / 32U);
    n = put(image, n, table->sigma, table->n_sigma);
    n = put(image, n, table->probes, table->n_probes * 4U);
    n++;
    image[2].bits = n;
    seal(image, n);
    return n;
}

/* What the tests of words and the self-test say of a linked table whose checksum is mended. */
static inline int checked(const table_t *table)
{
    static gtc_word_t image[IMAGE_MAX];
    table_t mended = *table;
    int status = FN(check_words)(table);

    if (status == GTC_OK) {
        mended.crc = image[image_of(table, image) - 1U].bits;
        status = FN(check)(&mended);
    }
    return status;
}

#endif /* TEST_IMAGE_H_INCLUDED */
