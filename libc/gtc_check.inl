/* gtc_check.inl - the boot self-test of a table.
 *
 * docs/FORMAT.md, section 3, gives the order of the words.
 *
 * SPDX-License-Identifier: MIT
 */

#define N_WHOLE 19U    /* whole numbers of a table's header ... */
#define FIRST_COUNT 9U /* ... of which the counts are the last */
#define N_NUMBERS 13U  /* other numbers of the header */

/* Whole numbers by name ... */
#define WHOLE_QUANTITY 0U
#define WHOLE_UNIT 1U
#define WHOLE_ID 2U
#define WHOLE_CALIBRATED 3U
#define WHOLE_BLOCK_US 4U
#define WHOLE_SLOPE_BLOCKS 5U
#define WHOLE_LEAD_BLOCKS 6U
#define WHOLE_BIAS_FRAC_BITS 7U
#define WHOLE_PARTS 8U
#define WHOLE_NETWORKS 9U
#define WHOLE_CENTERS 10U
#define WHOLE_CHANNELS 11U
#define WHOLE_TERMS 12U
#define WHOLE_COVERAGE_TEMP 13U
#define WHOLE_COVERAGE_SLOPE 14U
#define WHOLE_SIGMA_TEMP 15U
#define WHOLE_SIGMA_SLOPE 16U
#define WHOLE_SIGMA_WORDS 17U
#define WHOLE_PROBES 18U

/* ... and the first of each kind of the others. */
#define NUMBER_FALLBACK 0U
#define NUMBER_AUTHORITY 1U
#define NUMBER_EFFECT 3U
#define NUMBER_REZERO 5U
#define NUMBER_SCALE 6U
#define NUMBER_ENVELOPE 9U

/* Words between the magic and the arrays. */
#define HEADER_WORDS (2U + N_WHOLE + N_NUMBERS)

/* No table has more: a count that memory lost is found before anything is read by it. */
#define MAX_NETWORKS 16U
#define MAX_CELLS 0x1FFU
#define MAX_TABLE_WORDS 0x4000UL

static uint_least32_t coverage_words(const TABLE *table)
{
    return ((table->coverage_cells[0] * table->coverage_cells[1]) + 31U) / 32U;
}

/* Networks of the map, and the fallback models behind them. */
static uint_least32_t all_networks(const TABLE *table)
{
    return table->n_networks + table->n_fallback_models;
}

/* Words of all arrays. */
static uint_least32_t array_words(const TABLE *table)
{
    return GTC_SERIAL_WORDS + (all_networks(table) * GTC_NETWORK_WORDS) + (table->n_centers * GTC_CENTER_WORDS)
           + (table->n_channels * GTC_GUARD_WORDS) + (table->n_terms * GTC_TERM_WORDS) + coverage_words(table)
           + table->n_sigma + (table->n_probes * GTC_PROBE_WORDS);
}

/* The whole numbers of the header, in the order of an image. */
static void get_wholes(const TABLE *table, uint_least32_t found[N_WHOLE])
{
    found[WHOLE_QUANTITY] = table->quantity;
    found[WHOLE_UNIT] = table->unit;
    found[WHOLE_ID] = table->id;
    found[WHOLE_CALIBRATED] = table->calibrated;
    found[WHOLE_BLOCK_US] = table->block_us;
    found[WHOLE_SLOPE_BLOCKS] = table->slope_blocks;
    found[WHOLE_LEAD_BLOCKS] = table->lead_blocks;
    found[WHOLE_BIAS_FRAC_BITS] = table->bias_frac_bits;
    found[WHOLE_PARTS] = table->parts;
    found[WHOLE_NETWORKS] = all_networks(table);
    found[WHOLE_CENTERS] = table->n_centers;
    found[WHOLE_CHANNELS] = table->n_channels;
    found[WHOLE_TERMS] = table->n_terms;
    found[WHOLE_COVERAGE_TEMP] = table->coverage_cells[0];
    found[WHOLE_COVERAGE_SLOPE] = table->coverage_cells[1];
    found[WHOLE_SIGMA_TEMP] = table->sigma_cells[0];
    found[WHOLE_SIGMA_SLOPE] = table->sigma_cells[1];
    found[WHOLE_SIGMA_WORDS] = table->n_sigma;
    found[WHOLE_PROBES] = table->n_probes;
}

/* The other numbers of the header. */
static void get_numbers(const TABLE *table, gtc_word_t found[N_NUMBERS])
{
    uint_least32_t i;

    ELEMENT(found[NUMBER_FALLBACK]) = MEMBER(table->fallback);
    for (i = 0U; i < 2U; i++) {
        ELEMENT(found[NUMBER_AUTHORITY + i]) = MEMBER(table->authority[i]);
        ELEMENT(found[NUMBER_EFFECT + i]) = MEMBER(table->effect[i]);
    }
    ELEMENT(found[NUMBER_REZERO]) = MEMBER(table->rezero);
    for (i = 0U; i < 3U; i++) {
        ELEMENT(found[NUMBER_SCALE + i]) = MEMBER(table->scale[i]);
    }
    for (i = 0U; i < 4U; i++) {
        ELEMENT(found[NUMBER_ENVELOPE + i]) = MEMBER(table->envelope[i]);
    }
}

/* One network, or several where the code of the hand-over is there, and fallback models; they share out the centers. */
static int centers_fit(const TABLE *table)
{
    const uint_least32_t n_networks = all_networks(table);
    uint_least32_t n = 0U;
    uint_least32_t i;

    for (i = 0U; i < n_networks; i++) {
        const uint_least32_t own = table->networks[i * GTC_NETWORK_WORDS].bits;

        if (own > table->n_centers) {
            return 0;
        }
        n += own;
    }
    return (n == table->n_centers) ? 1 : 0;
}

/* 1 if this runtime has what the table needs, and the counts are small enough that the arrays can be read for the CRC,
 * which then shows whether they are right. Ranges of words are not tested: has_sound_words(). */
static int has_bounded_counts(const TABLE *table)
{
    return (fits_runtime(table) && (table->n_networks <= MAX_NETWORKS) && (table->n_fallback_models <= table->n_terms)
            && centers_fit(table) && (table->n_sigma <= MAX_TABLE_WORDS) && (table->n_probes <= MAX_TABLE_WORDS)
            && ((table->coverage_cells[0] | table->coverage_cells[1]) <= MAX_CELLS)
            && (array_words(table) <= MAX_TABLE_WORDS)) ? 1 : 0;
}

/* CRC-32, not final, over the words of the table's image between its magic and its arrays. */
static uint_least32_t header_crc(const TABLE *table)
{
    uint_least32_t whole[N_WHOLE];
    gtc_word_t number[N_NUMBERS];
    uint_least32_t crc = CRC_START;
    uint_least32_t i;

    get_wholes(table, whole);
    get_numbers(table, number);
    crc = crc_word(crc, table->layout + (ARITHMETIC * 65536UL));
    crc = crc_word(crc, 1U + HEADER_WORDS + array_words(table) + 1U);
    for (i = 0U; i < FIRST_COUNT; i++) {
        crc = crc_word(crc, whole[i]);
    }
    crc = crc_words(crc, number, N_NUMBERS);
    for (i = FIRST_COUNT; i < N_WHOLE; i++) {
        crc = crc_word(crc, whole[i]);
    }
    return crc;
}

/* CRC-32 over what an image holds between its magic and its own CRC. */
static uint_least32_t table_crc(const TABLE *table)
{
    uint_least32_t crc = header_crc(table);

    crc = crc_words(crc, table->serial, GTC_SERIAL_WORDS);
    crc = crc_words(crc, table->networks, all_networks(table) * GTC_NETWORK_WORDS);
    crc = crc_words(crc, table->centers, table->n_centers * GTC_CENTER_WORDS);
    crc = crc_words(crc, table->guards, table->n_channels * GTC_GUARD_WORDS);
    crc = crc_words(crc, table->terms, table->n_terms * GTC_TERM_WORDS);
    crc = crc_words(crc, table->coverage, coverage_words(table));
    crc = crc_words(crc, table->sigma, table->n_sigma);
    crc = crc_words(crc, table->probes, table->n_probes * GTC_PROBE_WORDS);
    return crc ^ CRC_FINAL;
}

#if GTC_WITH_PROBES
/* 1 if the map gives the known answers of the table. */
static int probes_agree(const TABLE *table)
{
    uint_least32_t i;

    for (i = 0U; i < table->n_probes; i++) {
        const gtc_word_t *const probe = &table->probes[i * GTC_PROBE_WORDS];
        NUM bias = NUM_ZERO;
        const int status = map_value(table, ELEMENT(probe[PROBE_TEMP]), ELEMENT(probe[PROBE_SLOPE]), &bias);

        if ((status < 0) || ((uint_least32_t)status != probe[PROBE_STATUS].bits)
            || (bits_of(bias) != probe[PROBE_BIAS].bits)) {
            return 0;
        }
    }
    return 1;
}

#endif

int PUBLIC(check)(const TABLE *table)
{
    int status = GTC_OK;

    if (table == NULL) {
        status = GTC_E_ARG;
    } else if (!has_bounded_counts(table)) {
        status = GTC_E_LAYOUT;
    } else if (!arithmetic_works()) {
        status = GTC_E_SELF_TEST;
    } else if (table_crc(table) != table->crc) {
        status = GTC_E_IMAGE;
#if GTC_WITH_PROBES
    } else if (!probes_agree(table)) {
        status = GTC_E_SELF_TEST;
#endif
    } else {
        /* all is well */
    }
    return status;
}
