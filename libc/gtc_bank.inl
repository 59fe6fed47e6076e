/* gtc_bank.inl - several networks with a hand-over, in the numbers included before.
 *
 * Where the regions of networks overlap their results are blended, each with the weight that it has
 * by its distance from the nearest edge of its region; edges of the envelope do not count.
 *
 * SPDX-License-Identifier: MIT
 */

/* Weight of x in a region by one input: 0 outside; NUM share of the way from the nearest edge. */
static SHARE FN(share_in)(NUM x, const gtc_word_t region[2], const NUM envelope[2])
{
    const NUM low = ELEMENT(region[0]);
    const NUM high = ELEMENT(region[1]);
    SHARE share = FULL_SHARE;

    if (low > envelope[0]) {
        share = FN(lesser)(share, FN(fraction)(low, x, high));
    }
    if (high < envelope[1]) {
        share = FN(lesser)(share, FN(fraction)(high, x, low));
    }
    return share;
}

NUM FN(blend)(const TABLE *table, const POINT *in)
{
    const gtc_word_t *center = table->centers;
    BLEND blend = {0};
    NUM edges[4];
    uint_least32_t i;

    FN(edges)(table, edges);
    for (i = 0U; i < table->n_networks; i++) {
        const gtc_word_t *const network = &table->networks[i * GTC_NETWORK_WORDS];
        const SHARE share = FN(lesser)(FN(share_in)(IN_TEMP(in), &network[4], &edges[0]),
                                       FN(share_in)(IN_SLOPE(in), &network[6], &edges[2]));

        if (share > NUM_ZERO) {
            blend = FN(mixed)(blend, share, FN(network)(table, network, center, in));
        }
        center = &center[network[0].bits * GTC_CENTER_WORDS];
    }
    return FN(unmixed)(blend, MEMBER(table->fallback));
}
