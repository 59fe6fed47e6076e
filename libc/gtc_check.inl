/* gtc_check.inl - boot self-test of a table, in the numbers included before.
 *
 * SPDX-License-Identifier: MIT
 */

/* The words of the table's image between its magic and its arrays. */
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
    uint_least32_t i;

    words[9] = MEMBER_BITS(table->max_step);
    words[10] = MEMBER_BITS(table->max_slope);
    words[11] = MEMBER_BITS(table->fallback);
    for (i = 0U; i < 3U; i++) {
        words[12U + i] = MEMBER_BITS(table->scale[i]);
    }
    for (i = 0U; i < 4U; i++) {
        words[15U + i] = MEMBER_BITS(table->envelope[i]);
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

/* 1 if the map gives the known answers of the table. */
static int FN(probes_agree)(const TABLE *table)
{
    uint_least32_t i;

    for (i = 0U; i < table->n_probes; i++) {
        const gtc_word_t *const probe = &table->probes[i * GTC_PROBE_WORDS];
        NUM bias = NUM_ZERO;
        const int status = FN(map)(table, ELEMENT(probe[0]), ELEMENT(probe[1]), &bias);

        if ((status < 0) || ((uint_least32_t)status != probe[3].bits)
            || (FN(bits)(bias) != probe[2].bits)) {
            return 0;
        }
    }
    return 1;
}

int FN(check)(const TABLE *table)
{
    int status = GTC_OK;

    if (table == NULL) {
        status = GTC_E_ARG;
    } else if (!FN(is_readable)(table)) {
        status = GTC_E_LAYOUT;
    } else if (!FN(primitives_work)()) {
        status = GTC_E_SELF_TEST;
    } else if (FN(crc)(table) != table->crc) {
        status = GTC_E_IMAGE;
    } else if (!FN(is_usable)(table)) {
        status = GTC_E_LAYOUT;
    } else if (!FN(probes_agree)(table)) {
        status = GTC_E_SELF_TEST;
    } else {
        /* all is well */
    }
    return status;
}
