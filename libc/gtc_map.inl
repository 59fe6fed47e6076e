/* gtc_map.inl - the static map, in the numbers of the gtc_num_<n>.h included before.
 *
 * docs/numerics.md, section 2.
 *
 * SPDX-License-Identifier: MIT
 */

/* GTC_OK or GTC_UNCOVERED. */
static int FN(coverage)(const TABLE *table, const POINT *in)
{
    uint_least32_t cell[2];
    uint_least32_t index;
    int status = GTC_OK;

    if (table->coverage != NULL) {
        FN(cells)(table, in, table->coverage_cells, cell);
        index = (cell[1] * table->coverage_cells[0]) + cell[0];
        if (((table->coverage[index >> 5].bits >> (index & 31U)) & 1U) == 0U) {
            status = GTC_UNCOVERED;
        }
    }
    return status;
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
    status |= FN(coverage)(table, &in);
    *bias = FN(network)(table, table->networks, table->centers, &in);
    return status;
}
