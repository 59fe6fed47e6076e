/* gtc_image.inl - a table as the words of its image, in the numbers included before.
 *
 * docs/FORMAT.md, section 3, gives the order.
 *
 * SPDX-License-Identifier: MIT
 */

/* Words between the magic and the arrays. */
#define HEADER_WORDS (2U + 7U + 3U + 3U + 4U + 4U + 5U)

/* MISRA 5.9: two files use these small functions, and each has them to itself. */
static uint_least32_t FN(coverage_words)(const TABLE *table)
{
    return ((table->coverage_cells[0] * table->coverage_cells[1]) + 31U) / 32U;
}

/* Words of all arrays.
 * MISRA 5.9: as above. */
static uint_least32_t FN(array_words)(const TABLE *table)
{
    return (table->n_networks * GTC_NETWORK_WORDS) + (table->n_centers * GTC_CENTER_WORDS)
           + (table->n_terms * GTC_TERM_WORDS) + FN(coverage_words)(table)
           + (table->sigma_cells[0] * table->sigma_cells[1])
           + (table->n_probes * GTC_PROBE_WORDS);
}
