/* gtc_usable.inl - whether this build can use a table, in the numbers included before.
 *
 * Everything that could make another function read outside the table, or divide by zero, is
 * refused here; the values themselves are guarded by the checksum.
 *
 * SPDX-License-Identifier: MIT
 */

#define MAX_NETWORKS 16U
#define MAX_CELLS 256U
#define MAX_CENTERS 512U
#define MAX_PROBES 4096U
#define MAX_HOLD_BLOCKS 100000UL
#define MAX_STUCK_SAMPLES 0x7FFFFFFFUL

/* An array is there if and only if it has a length. */
static int FN(fits)(const gtc_word_t *words, uint_least32_t n, uint_least32_t most)
{
    return ((n <= most) && ((words == NULL) == (n == 0U))) ? 1 : 0;
}

/* Cells of a grid over the envelope: both counts 0, or both in 1 ... MAX_CELLS. */
static int FN(grid_fits)(const gtc_word_t *words, const uint_least32_t cells[2])
{
    return ((cells[0] <= MAX_CELLS) && (cells[1] <= MAX_CELLS)
            && ((cells[0] == 0U) == (cells[1] == 0U))
            && ((words == NULL) == (cells[0] == 0U))) ? 1 : 0;
}

static int FN(arrays_fit)(const TABLE *table)
{
    return (FN(fits)(table->networks, table->n_networks, MAX_NETWORKS)
            && FN(fits)(table->centers, table->n_centers, MAX_CENTERS)
            && FN(fits)(table->terms, table->n_terms, (uint_least32_t)GTC_MAX_TERMS)
            && FN(fits)(table->probes, table->n_probes, MAX_PROBES)
            && FN(grid_fits)(table->coverage, table->coverage_cells)
            && FN(grid_fits)(table->sigma, table->sigma_cells)) ? 1 : 0;
}

static int FN(settings_fit)(const TABLE *table)
{
    return ((table->quantity == GTC_QUANTITY_BIAS) && (table->unit == GTC_UNIT_DEG_PER_H)
            && (table->slope_blocks >= 2U) && (table->slope_blocks <= (uint_least32_t)GTC_MAX_SLOPE_BLOCKS)
            && (table->hold_blocks >= 1U) && (table->hold_blocks <= MAX_HOLD_BLOCKS)
            && (table->stuck_samples <= MAX_STUCK_SAMPLES)) ? 1 : 0;
}

/* The networks share out the centers. */
static int FN(centers_fit)(const TABLE *table)
{
    uint_least32_t n = 0U;
    uint_least32_t i;

    for (i = 0U; i < table->n_networks; i++) {
        const uint_least32_t own = table->networks[i * GTC_NETWORK_WORDS].bits;

        if (own > MAX_CENTERS) {
            return 0;
        }
        n += own;
    }
    return (n == table->n_centers) ? 1 : 0;
}

/* The envelope is a range (false for a NaN, too). */
static int FN(envelope_fits)(const TABLE *table)
{
    return ((MEMBER(table->envelope[0]) <= MEMBER(table->envelope[1]))
            && (MEMBER(table->envelope[2]) <= MEMBER(table->envelope[3]))) ? 1 : 0;
}

/* Every term comes with its code and reads a channel that is there. */
static int FN(terms_fit)(const TABLE *table)
{
    uint_least32_t i;

    for (i = 0U; i < table->n_terms; i++) {
        const gtc_word_t *const term = &table->terms[i * GTC_TERM_WORDS];

        if ((table->term_code[i] == NULL) || (table->term_code[i]->kind != term[0].bits)
            || (term[1].bits >= table->n_channels)) {
            return 0;
        }
    }
    return ((table->n_channels >= 1U) && (table->n_channels <= (1U + (uint_least32_t)GTC_MAX_TERMS))) ? 1 : 0;
}

/* One network, or several where the code of the hand-over is there. */
static int FN(networks_fit)(const TABLE *table)
{
#if GTC_WITH_BANK
    return (table->n_networks >= 1U) ? 1 : 0;
#else
    return (table->n_networks == 1U) ? 1 : 0;
#endif
}

int FN(is_usable)(const TABLE *table)
{
    return ((table->layout == GTC_TABLE_LAYOUT) && FN(arrays_fit)(table)
            && FN(settings_fit)(table) && FN(networks_fit)(table) && FN(terms_fit)(table)
            && FN(centers_fit)(table) && FN(envelope_fits)(table)) ? 1 : 0;
}
