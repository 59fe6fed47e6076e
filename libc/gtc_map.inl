/* gtc_map.inl - the static map.
 *
 * docs/numerics.md, section 2.
 *
 * SPDX-License-Identifier: MIT
 */

#if GTC_WITH_BANK
/* Several networks with a hand-over: where their regions overlap their results are blended, each with the weight
 * that it has by its distance from the nearest edge of its region; edges of the envelope do not count. */

/* Weight of x in a region by one input: 0 outside; NUM share of the way from the nearest edge. */
static SHARE share_in(NUM x, const gtc_word_t region[2], const NUM envelope[2])
{
    const NUM low = ELEMENT(region[0]);
    const NUM high = ELEMENT(region[1]);
    SHARE share = FULL_SHARE;

    if (low > envelope[0]) {
        share = lesser(share, fraction(low, x, high));
    }
    if (high < envelope[1]) {
        share = lesser(share, fraction(high, x, low));
    }
    return share;
}

static NUM blend_networks(const TABLE *table, const POINT *in)
{
    const gtc_word_t *center = table->centers;
    BLEND blend;
    NUM edges[4];
    uint_least32_t i;

    blend.total = NUM_ZERO;
    blend.share = NUM_ZERO;
    get_edges(table, edges);
    for (i = 0U; i < table->n_networks; i++) {
        const gtc_word_t *const network = &table->networks[i * GTC_NETWORK_WORDS];
        const SHARE share = lesser(share_in(IN_TEMP(in), &network[NETWORK_REGION_TEMP], &edges[ENVELOPE_TEMP]),
                                       share_in(IN_SLOPE(in), &network[NETWORK_REGION_SLOPE], &edges[ENVELOPE_SLOPE]));

        if (share > NUM_ZERO) {
            mix(&blend, share, network_value(table, network, center, in));
        }
        center = &center[network[NETWORK_CENTERS].bits * GTC_CENTER_WORDS];
    }
    return unmixed(&blend, MEMBER(table->fallback));
}
#endif

/* A correction within the authority of the table. */
static NUM within_authority(const TABLE *table, WIDE bias, int_least32_t *remarks)
{
    return saturate(bias, MEMBER(table->authority[0]), MEMBER(table->authority[1]), remarks);
}

#if GTC_WITH_COVERAGE
/* 1 if there was training data where the inputs lie, or no map says where it was. */
static int is_covered(const TABLE *table, const POINT *in)
{
    uint_least32_t cell[2];
    uint_least32_t index;
    uint_least32_t rest;

    if (table->coverage == NULL) {
        return 1;
    }
    cells_of(table, in, table->coverage_cells, cell);
    index = (cell[1] * table->coverage_cells[0]) + cell[0];
    rest = table->coverage[index >> 5].bits >> (index & 31U);
    return ((rest & 1U) != 0U) ? 1 : 0;
}

#endif

/* The map at a temperature and a slope. Returns GTC_OK or remarks, or GTC_E_ARG if an input is no number: then *bias is
 * not written. */
static int map_value(const TABLE *table, NUM temp, NUM slope, NUM *bias)
{
    POINT in;
    NUM value;
    int_least32_t remarks = (int_least32_t)locate(table, temp, slope, &in);

    if (remarks < 0) {
        return GTC_E_ARG;
    }
#if GTC_WITH_COVERAGE
    if (!is_covered(table, &in)) {
        remarks |= GTC_UNCOVERED;
    }
#endif
#if GTC_WITH_BANK
    if (table->n_networks > 1U) {
        value = blend_networks(table, &in);
    } else {
        value = network_value(table, table->networks, table->centers, &in);
    }
#else
    value = network_value(table, table->networks, table->centers, &in);
#endif
    *bias = within_authority(table, value, &remarks);
    return (int)remarks;
}

int PUBLIC(map)(const TABLE *table, NUM temp, NUM slope, NUM *bias)
{
    return ((table == NULL) || (bias == NULL)) ? GTC_E_ARG : map_value(table, temp, slope, bias);
}
