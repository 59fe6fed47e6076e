/* gtc_map.inl - the static map, in the numbers of the gtc_num_<n>.h included before.
 *
 * docs/numerics.md, section 2.
 *
 * SPDX-License-Identifier: MIT
 */

/* 1 if there was training data where the inputs lie, or no map says where it was. */
static int FN(is_covered)(const TABLE *table, const POINT *in)
{
    uint_least32_t cell[2];
    uint_least32_t index;
    uint_least32_t rest;

    if (table->coverage == NULL) {
        return 1;
    }
    FN(cells)(table, in, table->coverage_cells, cell);
    index = (cell[1] * table->coverage_cells[0]) + cell[0];
    rest = table->coverage[index >> 5].bits >> (index & 31U);
    return ((rest & 1U) != 0U) ? 1 : 0;
}

int FN(map)(const TABLE *table, NUM temp, NUM slope, NUM *bias)
{
    POINT in;
    int status;

    if ((table == NULL) || (bias == NULL)) {
        return GTC_E_ARG;
    }
    status = FN(locate)(table, temp, slope, &in);
    if (status < 0) {
        return GTC_E_ARG;
    }
    if (!FN(is_covered)(table, &in)) {
        status |= GTC_UNCOVERED;
    }
#if GTC_WITH_BANK
    if (table->n_networks > 1U) {
        *bias = FN(blend)(table, &in);
        return status;
    }
#endif
    *bias = FN(network)(table, table->networks, table->centers, &in);
    return status;
}
