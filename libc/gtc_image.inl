/* gtc_image.inl - a table as the words of its image, in the numbers included before.
 *
 * docs/FORMAT.md, section 3, gives the order.
 *
 * SPDX-License-Identifier: MIT
 */

/* Words between the magic and the arrays. */
#define HEADER_WORDS (2U + 7U + 3U + 3U + 4U + 4U + 5U)

static uint_least32_t FN(coverage_words)(const TABLE *table)
{
    return ((table->coverage_cells[0] * table->coverage_cells[1]) + 31U) / 32U;
}

/* Words of all arrays. */
static uint_least32_t FN(array_words)(const TABLE *table)
{
    return (table->n_networks * GTC_NETWORK_WORDS) + (table->n_centers * GTC_CENTER_WORDS)
           + (table->n_terms * GTC_TERM_WORDS) + FN(coverage_words)(table)
           + (table->sigma_cells[0] * table->sigma_cells[1])
           + (table->n_probes * GTC_PROBE_WORDS);
}

static void FN(header)(const TABLE *table, uint_least32_t words[HEADER_WORDS])
{
    const uint_least32_t integers[9] = {
        table->layout + (ARITHMETIC * 65536UL),
        1U + HEADER_WORDS + FN(array_words)(table) + 1U,
        table->quantity,
        table->unit,
        table->id,
        table->slope_blocks,
        table->hold_blocks,
        table->stuck_samples,
        table->bias_frac_bits,
    };
    const uint_least32_t counts[9] = {
        table->n_networks,
        table->n_centers,
        table->n_channels,
        table->n_terms,
        table->coverage_cells[0],
        table->coverage_cells[1],
        table->sigma_cells[0],
        table->sigma_cells[1],
        table->n_probes,
    };
    uint_least32_t *const numbers = &words[9];
    uint_least32_t i;

    numbers[0] = MEMBER_BITS(table->max_step);
    numbers[1] = MEMBER_BITS(table->max_slope);
    numbers[2] = MEMBER_BITS(table->fallback);
    for (i = 0U; i < 3U; i++) {
        numbers[3U + i] = MEMBER_BITS(table->scale[i]);
    }
    for (i = 0U; i < 4U; i++) {
        numbers[6U + i] = MEMBER_BITS(table->envelope[i]);
    }
    for (i = 0U; i < 9U; i++) {
        words[i] = integers[i];
        words[(HEADER_WORDS - 9U) + i] = counts[i];
    }
}

/* CRC-32 over what an image holds between its magic and its own CRC. */
static uint_least32_t FN(crc)(const TABLE *table)
{
    uint_least32_t header[HEADER_WORDS];
    uint_least32_t crc = GTC_CRC_START;
    uint_least32_t i;

    FN(header)(table, header);
    for (i = 0U; i < HEADER_WORDS; i++) {
        crc = gtc_crc_word(crc, header[i]);
    }
    crc = gtc_crc_words(crc, table->networks, table->n_networks * GTC_NETWORK_WORDS);
    crc = gtc_crc_words(crc, table->centers, table->n_centers * GTC_CENTER_WORDS);
    crc = gtc_crc_words(crc, table->terms, table->n_terms * GTC_TERM_WORDS);
    crc = gtc_crc_words(crc, table->coverage, FN(coverage_words)(table));
    crc = gtc_crc_words(crc, table->sigma, table->sigma_cells[0] * table->sigma_cells[1]);
    crc = gtc_crc_words(crc, table->probes, table->n_probes * GTC_PROBE_WORDS);
    return crc ^ GTC_CRC_FINAL;
}
