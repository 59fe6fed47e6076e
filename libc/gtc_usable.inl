/* gtc_usable.inl - whether this build can use a table, in the numbers included before.
 *
 * Everything that could make another function read outside the table, divide by zero, leave the range of a
 * number or make one that is none is refused here: words outside of gtc_limits.inl, and what relates
 * several words. The tests call these "the conditions"; docs/FORMAT.md, section 3, lists them.
 *
 * SPDX-License-Identifier: MIT
 */

/* Whether n words are numbers in their ranges (false for a NaN, too). */
static int FN(numbers_fit)(const gtc_word_t *words, const FN(range_t) *ranges, uint_least32_t n)
{
    int fit = 1;
    uint_least32_t i;

    for (i = 0U; i < n; i++) {
        const NUM x = ELEMENT(words[i]);

        fit &= ((x >= ranges[i].least) && (x <= ranges[i].most)) ? 1 : 0;
    }
    return fit;
}

/* An array is there if and only if it has a length. */
static int FN(is_array)(const gtc_word_t *words, uint_least32_t n)
{
    return ((words == NULL) == (n == 0U)) ? 1 : 0;
}

/* Cells of a grid over the envelope: both counts 0, or none. */
static int FN(is_grid)(const gtc_word_t *words, const uint_least32_t cells[2])
{
    return (((cells[0] == 0U) == (cells[1] == 0U)) && FN(is_array)(words, cells[0])) ? 1 : 0;
}

static int FN(arrays_fit)(const TABLE *table)
{
    return (FN(is_array)(table->networks, table->n_networks) && FN(is_array)(table->centers, table->n_centers)
            && FN(is_array)(table->terms, table->n_terms) && FN(is_array)(table->probes, table->n_probes)
            && FN(is_grid)(table->coverage, table->coverage_cells)
            && FN(is_grid)(table->sigma, table->sigma_cells)) ? 1 : 0;
}

/* Whole numbers in their ranges, from number `first` of their list on. */
static int FN(wholes_fit)(const TABLE *table, uint_least32_t first)
{
    const uint_least32_t found[N_WHOLE] = {
        table->quantity,          table->unit,          table->id,
        table->slope_blocks,      table->hold_blocks,   table->stuck_samples,
        table->bias_frac_bits,    table->n_networks,    table->n_centers,
        table->n_channels,        table->n_terms,       table->coverage_cells[0],
        table->coverage_cells[1], table->sigma_cells[0], table->sigma_cells[1],
        table->n_probes,
    };
    int fit = 1;
    uint_least32_t i;

    for (i = first; i < N_WHOLE; i++) {
        fit &= ((found[i] >= FN(whole_limits)[i][0]) && (found[i] <= FN(whole_limits)[i][1])) ? 1 : 0;
    }
    return fit;
}

/* One network, or several where the code of the hand-over is there; they share out the centers. */
static int FN(centers_fit)(const TABLE *table)
{
    uint_least32_t n = 0U;
    uint_least32_t i;

#if !GTC_WITH_BANK
    if (table->n_networks != 1U) {
        return 0;
    }
#endif
    for (i = 0U; i < table->n_networks; i++) {
        const uint_least32_t own = table->networks[i * GTC_NETWORK_WORDS].bits;

        if (own > table->n_centers) {
            return 0;
        }
        n += own;
    }
    return (n == table->n_centers) ? 1 : 0;
}

/* Every term comes with its code; an auxiliary one reads a further channel, others the temperature. */
static int FN(terms_fit)(const TABLE *table)
{
    uint_least32_t i;

    for (i = 0U; i < table->n_terms; i++) {
        const gtc_word_t *const term = &table->terms[i * GTC_TERM_WORDS];

        if ((table->term_code[i] == NULL) || (table->term_code[i]->kind != term[0].bits)
            || (term[1].bits >= table->n_channels)
            || ((term[1].bits != 0U) != (term[0].bits == GTC_TERM_AUXILIARY))) {
            return 0;
        }
    }
    return 1;
}

int FN(is_readable)(const TABLE *table)
{
    return ((table->layout == GTC_TABLE_LAYOUT) && FN(wholes_fit)(table, FIRST_COUNT) && FN(arrays_fit)(table)
            && FN(centers_fit)(table) && FN(terms_fit)(table)) ? 1 : 0;
}

static int FN(members_fit)(const TABLE *table)
{
    gtc_word_t found[N_NUMBERS];
    uint_least32_t i;

    ELEMENT(found[0]) = MEMBER(table->max_step);
    ELEMENT(found[1]) = MEMBER(table->max_slope);
    ELEMENT(found[2]) = MEMBER(table->fallback);
    for (i = 0U; i < 3U; i++) {
        ELEMENT(found[3U + i]) = MEMBER(table->scale[i]);
    }
    for (i = 0U; i < 4U; i++) {
        ELEMENT(found[6U + i]) = MEMBER(table->envelope[i]);
    }
    return FN(numbers_fit)(found, FN(number_limits), N_NUMBERS) & FN(envelope_fits)(table);
}

/* The region of one of several networks has a width by which shares can be divided. */
static int FN(region_fits)(const gtc_word_t region[2], uint_least32_t n_networks)
{
    const NUM low = ELEMENT(region[0]);
    const NUM high = ELEMENT(region[1]);

    return (FN(is_width)(low, high) || ((n_networks == 1U) && (low <= high))) ? 1 : 0;
}

/* One network with its centers. */
static int FN(network_fits)(const TABLE *table, const gtc_word_t *network, const gtc_word_t *centers)
{
    uint_least32_t i;
    int fit = FN(numbers_fit)(&network[1], FN(network_limits), GTC_NETWORK_WORDS - 1U)
              & FN(region_fits)(&network[4], table->n_networks) & FN(region_fits)(&network[6], table->n_networks);

    for (i = 0U; i < network[0].bits; i++) {
        fit &= FN(numbers_fit)(&centers[i * GTC_CENTER_WORDS], FN(center_limits), GTC_CENTER_WORDS);
    }
    return fit & FN(sums_fit)(network, centers);
}

static int FN(networks_fit)(const TABLE *table)
{
    const gtc_word_t *center = table->centers;
    int fit = 1;
    uint_least32_t i;

    for (i = 0U; i < table->n_networks; i++) {
        const gtc_word_t *const network = &table->networks[i * GTC_NETWORK_WORDS];

        fit &= FN(network_fits)(table, network, center);
        center = &center[network[0].bits * GTC_CENTER_WORDS];
    }
    return fit;
}

/* Parameters of the terms, and the uncertainties, which nothing reads yet. */
static int FN(rest_fits)(const TABLE *table)
{
    const uint_least32_t n = table->sigma_cells[0] * table->sigma_cells[1];
    int fit = 1;
    uint_least32_t i;

    for (i = 0U; i < table->n_terms; i++) {
        const gtc_word_t *const term = &table->terms[i * GTC_TERM_WORDS];

        fit &= FN(numbers_fit)(&term[2], FN(term_limits)[term[0].bits - 1U], GTC_TERM_WORDS - 2U);
    }
    for (i = 0U; i < n; i++) {
        fit &= FN(numbers_fit)(&table->sigma[i], FN(sigma_limits), 1U);
    }
    return fit;
}

int FN(is_usable)(const TABLE *table)
{
    return (FN(is_readable)(table) && FN(wholes_fit)(table, 0U) && FN(members_fit)(table)
            && FN(networks_fit)(table) && FN(rest_fits)(table)) ? 1 : 0;
}
