/* gtc_table.inl - whether a table can be used, its self-test, and a table from a binary image, in the numbers
 * included before.
 *
 * docs/FORMAT.md, section 3, gives the order of the words.
 *
 * SPDX-License-Identifier: MIT
 */

/* ---- an image ------------------------------------------------------------------------------------ */

/* Places in an image. */
#define IMAGE_MAGIC 0U
#define IMAGE_LAYOUT 1U
#define IMAGE_LENGTH 2U
#define IMAGE_WHOLES 3U

/* Words between the magic and the arrays. */
#define HEADER_WORDS (2U + N_WHOLE + N_NUMBERS)

static uint_least32_t FN(coverage_words)(const TABLE *table)
{
    return ((table->coverage_cells[0] * table->coverage_cells[1]) + 31U) / 32U;
}

/* Networks of the map, and the fallback models behind them. */
static uint_least32_t FN(all_networks)(const TABLE *table)
{
    return table->n_networks + table->n_fallback_models;
}

/* Words of all arrays. */
static uint_least32_t FN(array_words)(const TABLE *table)
{
    return GTC_SERIAL_WORDS + (FN(all_networks)(table) * GTC_NETWORK_WORDS) + (table->n_centers * GTC_CENTER_WORDS)
           + (table->n_channels * GTC_GUARD_WORDS) + (table->n_terms * GTC_TERM_WORDS) + FN(coverage_words)(table)
           + table->n_sigma + (table->n_probes * GTC_PROBE_WORDS);
}

/* ---- whether this build can use a table ---------------------------------------------------------------------------------- */

/* Everything that could make another function read outside the table, divide by zero, leave the range of a
 * number or make one that is none is refused here: words outside of gtc_limits.inl, and what relates
 * several words. The tests call these "the conditions"; docs/FORMAT.md, section 3, lists them. */

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
static int FN(is_grid)(const uint_least32_t cells[2])
{
    return ((cells[0] == 0U) == (cells[1] == 0U)) ? 1 : 0;
}

static int FN(grids_fit)(const TABLE *table)
{
    return (FN(is_grid)(table->coverage_cells) && FN(is_array)(table->coverage, table->coverage_cells[0])
            && FN(is_grid)(table->sigma_cells) && FN(is_array)(table->sigma, table->n_sigma)
            && (table->n_sigma >= (table->sigma_cells[0] * table->sigma_cells[1]))) ? 1 : 0;
}

static int FN(arrays_fit)(const TABLE *table)
{
    return (FN(is_array)(table->serial, GTC_SERIAL_WORDS) && FN(is_array)(table->networks, table->n_networks)
            && FN(is_array)(table->centers, table->n_centers) && FN(is_array)(table->guards, table->n_channels)
            && FN(is_array)(table->terms, table->n_terms) && FN(is_array)(table->probes, table->n_probes)) ? 1 : 0;
}

/* The whole numbers of the header, in the order of an image. */
static void FN(wholes)(const TABLE *table, uint_least32_t found[N_WHOLE])
{
    found[WHOLE_QUANTITY] = table->quantity;
    found[WHOLE_UNIT] = table->unit;
    found[WHOLE_ID] = table->id;
    found[WHOLE_CALIBRATED] = table->calibrated;
    found[WHOLE_BLOCK_US] = table->block_us;
    found[WHOLE_SLOPE_BLOCKS] = table->slope_blocks;
    found[WHOLE_LEAD_BLOCKS] = table->lead_blocks;
    found[WHOLE_BIAS_FRAC_BITS] = table->bias_frac_bits;
    found[WHOLE_NETWORKS] = FN(all_networks)(table);
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
static void FN(numbers)(const TABLE *table, gtc_word_t found[N_NUMBERS])
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

/* 1 if a table is of this layout and within the options of this build, so that no array of a state is too short for it.
 * Its other words are those that gtc_<n>_check() or gtc_<n>_open() found sound. */
static int FN(fits_build)(const TABLE *table)
{
    return ((table->layout == GTC_TABLE_LAYOUT) && (table->slope_blocks <= (uint_least32_t)GTC_MAX_SLOPE_BLOCKS)
            && (table->n_terms <= (uint_least32_t)GTC_MAX_TERMS)
            && (table->n_channels <= ((uint_least32_t)GTC_MAX_TERMS + 1U))
            && ((GTC_WITH_COVERAGE != 0) || (table->coverage == NULL))
            && ((GTC_WITH_BANK != 0) || (table->n_networks == 1U))) ? 1 : 0;
}

/* Whole numbers in their ranges, from number `first` of their list on. */
static int FN(wholes_fit)(const TABLE *table, uint_least32_t first)
{
    uint_least32_t found[N_WHOLE];
    int fit = 1;
    uint_least32_t i;

    FN(wholes)(table, found);
    for (i = first; i < N_WHOLE; i++) {
        fit &= ((found[i] >= FN(whole_limits)[i][0]) && (found[i] <= FN(whole_limits)[i][1])) ? 1 : 0;
    }
    return fit;
}

/* One network, or several where the code of the hand-over is there, and fallback models; they share out the centers. */
static int FN(centers_fit)(const TABLE *table)
{
    const uint_least32_t n_networks = FN(all_networks)(table);
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

/* A term comes with its code; some kinds read a further channel, others the temperature. */
static int FN(term_fits)(const TABLE *table, uint_least32_t i)
{
    const gtc_word_t *const term = FN(term_of)(table, i);
    const uint_least32_t kind = term[TERM_KIND].bits;
    const uint_least32_t channel = FN(channel_of)(term);

    return ((kind >= 1U) && (kind <= GTC_N_KINDS) && (table->term_code != NULL) && (FN(code_of)(table, i) != NULL)
            && (channel < table->n_channels) && ((channel != 0U) == READS_CHANNEL(kind))) ? 1 : 0;
}

/* All of them; fallback models belong to terms of a channel, one to each that has one, in their order, behind at least one
 * network of the map. */
static int FN(terms_fit)(const TABLE *table)
{
    uint_least32_t last = table->n_networks;
    uint_least32_t i;

    for (i = 0U; i < table->n_terms; i++) {
        const gtc_word_t *const term = FN(term_of)(table, i);
        const uint_least32_t fallback_model = FN(fallback_model_of)(term);

        if (!FN(term_fits)(table, i)) {
            return 0;
        }
        if (fallback_model != 0U) {
            last++;
            if ((fallback_model != last) || (FN(channel_of)(term) == 0U)) {
                return 0;
            }
        }
    }
    return (last == FN(all_networks)(table)) ? 1 : 0;
}

/* 1 if the table is of this layout and its counts say where its arrays end, else 0. */
static int FN(is_readable)(const TABLE *table)
{
    return (FN(fits_build)(table) && FN(wholes_fit)(table, FIRST_COUNT) && FN(arrays_fit)(table)
            && FN(grids_fit)(table) && FN(terms_fit)(table) && FN(centers_fit)(table)) ? 1 : 0;
}

/* The constant correction is one that the table may give. */
static int FN(authority_fits)(const TABLE *table)
{
    const NUM fallback = MEMBER(table->fallback);

    return ((fallback >= MEMBER(table->authority[0])) && (fallback <= MEMBER(table->authority[1]))) ? 1 : 0;
}

static int FN(members_fit)(const TABLE *table)
{
    gtc_word_t found[N_NUMBERS];

    FN(numbers)(table, found);
    return FN(numbers_fit)(found, FN(number_limits), N_NUMBERS) & FN(envelope_fits)(table) & FN(authority_fits)(table);
}

/* The guard of one channel. The temperature's range keeps to what a sensor can show, so that no difference of
 * two samples leaves its word. */
static int FN(guard_fits)(const gtc_word_t *guard, uint_least32_t channel)
{
    const NUM low = ELEMENT(guard[GUARD_LOW]);
    const NUM high = ELEMENT(guard[GUARD_HIGH]);
    int fit = FN(numbers_fit)(guard, FN(guard_limits), 4U)
              & FN(numbers_fit)(&guard[GUARD_FALLBACK], FN(guard_limits), 1U) & ((low <= high) ? 1 : 0);
    uint_least32_t i;

    for (i = 0U; i < 3U; i++) {
        fit &= ((guard[GUARD_AGREE + i].bits >= FN(guard_wholes)[i][0])
                && (guard[GUARD_AGREE + i].bits <= FN(guard_wholes)[i][1]))
                   ? 1
                   : 0;
    }
    if (channel == 0U) {
        fit &= ((low >= NUM_PLAUSIBLE_MIN) && (high <= NUM_PLAUSIBLE_MAX)) ? 1 : 0;
    } else {
        fit &= ((ELEMENT(guard[GUARD_FALLBACK]) >= low) && (ELEMENT(guard[GUARD_FALLBACK]) <= high)) ? 1 : 0;
    }
    return fit;
}

static int FN(guards_fit)(const TABLE *table)
{
    int fit = 1;
    uint_least32_t i;

    for (i = 0U; i < table->n_channels; i++) {
        fit &= FN(guard_fits)(&table->guards[i * GTC_GUARD_WORDS], i);
    }
    return fit;
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
    int fit = FN(numbers_fit)(&network[NETWORK_CONSTANT], FN(network_limits), GTC_NETWORK_WORDS - 1U)
              & FN(region_fits)(&network[NETWORK_REGION_TEMP], table->n_networks) & FN(region_fits)(&network[NETWORK_REGION_SLOPE], table->n_networks);

    for (i = 0U; i < network[NETWORK_CENTERS].bits; i++) {
        fit &= FN(numbers_fit)(&centers[i * GTC_CENTER_WORDS], FN(center_limits), GTC_CENTER_WORDS);
    }
    return fit & FN(sums_fit)(network, centers);
}

static int FN(networks_fit)(const TABLE *table)
{
    const uint_least32_t n_networks = FN(all_networks)(table);
    const gtc_word_t *center = table->centers;
    int fit = 1;
    uint_least32_t i;

    for (i = 0U; i < n_networks; i++) {
        const gtc_word_t *const network = &table->networks[i * GTC_NETWORK_WORDS];

        fit &= FN(network_fits)(table, network, center);
        center = &center[network[NETWORK_CENTERS].bits * GTC_CENTER_WORDS];
    }
    return fit;
}

/* Parameters of the terms, and the uncertainties. */
static int FN(rest_fits)(const TABLE *table)
{
    int fit = FN(sigma_fits)(table);
    uint_least32_t i;

    for (i = 0U; i < table->n_terms; i++) {
        const gtc_word_t *const term = FN(term_of)(table, i);

        fit &= FN(numbers_fit)(&term[TERM_PARAMETERS], FN(term_limits)[term[TERM_KIND].bits - 1U],
                               GTC_TERM_WORDS - TERM_PARAMETERS);
    }
    for (i = 0U; i < table->n_sigma; i++) {
        fit &= FN(numbers_fit)(&table->sigma[i], FN(sigma_limits), 1U);
    }
    return fit;
}

/* 1 if this build of the runtime can use the table: no function meets a run-time error with it; else 0. */
static int FN(is_usable)(const TABLE *table)
{
    return (FN(is_readable)(table) && FN(wholes_fit)(table, 0U) && FN(members_fit)(table)
            && FN(networks_fit)(table) && FN(guards_fit)(table) && FN(rest_fits)(table)) ? 1 : 0;
}

/* ---- the self-test ------------------------------------------------------------------------------- */

/* CRC-32, not final, over the words of the table's image between its magic and its arrays. */
static uint_least32_t FN(header_crc)(const TABLE *table)
{
    uint_least32_t whole[N_WHOLE];
    gtc_word_t number[N_NUMBERS];
    uint_least32_t crc = GTC_CRC_START;
    uint_least32_t i;

    FN(wholes)(table, whole);
    FN(numbers)(table, number);
    crc = gtc_crc_word(crc, table->layout + (ARITHMETIC * 65536UL));
    crc = gtc_crc_word(crc, 1U + HEADER_WORDS + FN(array_words)(table) + 1U);
    for (i = 0U; i < FIRST_COUNT; i++) {
        crc = gtc_crc_word(crc, whole[i]);
    }
    crc = gtc_crc_words(crc, number, N_NUMBERS);
    for (i = FIRST_COUNT; i < N_WHOLE; i++) {
        crc = gtc_crc_word(crc, whole[i]);
    }
    return crc;
}

/* CRC-32 over what an image holds between its magic and its own CRC. */
static uint_least32_t FN(crc)(const TABLE *table)
{
    uint_least32_t crc = FN(header_crc)(table);

    crc = gtc_crc_words(crc, table->serial, GTC_SERIAL_WORDS);
    crc = gtc_crc_words(crc, table->networks, FN(all_networks)(table) * GTC_NETWORK_WORDS);
    crc = gtc_crc_words(crc, table->centers, table->n_centers * GTC_CENTER_WORDS);
    crc = gtc_crc_words(crc, table->guards, table->n_channels * GTC_GUARD_WORDS);
    crc = gtc_crc_words(crc, table->terms, table->n_terms * GTC_TERM_WORDS);
    crc = gtc_crc_words(crc, table->coverage, FN(coverage_words)(table));
    crc = gtc_crc_words(crc, table->sigma, table->n_sigma);
    crc = gtc_crc_words(crc, table->probes, table->n_probes * GTC_PROBE_WORDS);
    return crc ^ GTC_CRC_FINAL;
}

#if GTC_WITH_PROBES
/* 1 if the map gives the known answers of the table. */
static int FN(probes_agree)(const TABLE *table)
{
    uint_least32_t i;

    for (i = 0U; i < table->n_probes; i++) {
        const gtc_word_t *const probe = &table->probes[i * GTC_PROBE_WORDS];
        NUM bias = NUM_ZERO;
        const int status = FN(map)(table, ELEMENT(probe[PROBE_TEMP]), ELEMENT(probe[PROBE_SLOPE]), &bias);

        if ((status < 0) || ((uint_least32_t)status != probe[PROBE_STATUS].bits)
            || (FN(bits)(bias) != probe[PROBE_BIAS].bits)) {
            return 0;
        }
    }
    return 1;
}

#endif

static int FN(run_check)(const TABLE *table)
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
#if GTC_WITH_PROBES
    } else if (!FN(probes_agree)(table)) {
        status = GTC_E_SELF_TEST;
#endif
    } else {
        /* all is well */
    }
    return status;
}

#if GTC_WITH_IMAGE
/* ---- a table from an image ----------------------------------------------------------------------- */

/* Words before the arrays, with the magic; and the CRC behind them. */
#define BEFORE_ARRAYS (1U + HEADER_WORDS)
#define AFTER_ARRAYS 1U
#define SHORTEST 4U /* magic, layout, length, CRC */

/* The members of a table as the image has them; arrays and code of terms are NULL. */
static void FN(read_header)(volatile TABLE *table, const gtc_word_t *words)
{
    const gtc_word_t *const wholes = &words[IMAGE_WHOLES];
    const gtc_word_t *const numbers = &wholes[FIRST_COUNT];
    const gtc_word_t *const counts = &numbers[N_NUMBERS];
    uint_least32_t i;

    table->layout = words[IMAGE_LAYOUT].bits & 0xFFFFU;
    table->quantity = wholes[WHOLE_QUANTITY].bits;
    table->unit = wholes[WHOLE_UNIT].bits;
    table->id = wholes[WHOLE_ID].bits;
    table->calibrated = wholes[WHOLE_CALIBRATED].bits;
    table->block_us = wholes[WHOLE_BLOCK_US].bits;
    table->slope_blocks = wholes[WHOLE_SLOPE_BLOCKS].bits;
    table->lead_blocks = wholes[WHOLE_LEAD_BLOCKS].bits;
    table->bias_frac_bits = wholes[WHOLE_BIAS_FRAC_BITS].bits;
    MEMBER(table->fallback) = ELEMENT(numbers[NUMBER_FALLBACK]);
    MEMBER(table->rezero) = ELEMENT(numbers[NUMBER_REZERO]);
    for (i = 0U; i < 3U; i++) {
        MEMBER(table->scale[i]) = ELEMENT(numbers[NUMBER_SCALE + i]);
    }
    for (i = 0U; i < 4U; i++) {
        MEMBER(table->envelope[i]) = ELEMENT(numbers[NUMBER_ENVELOPE + i]);
    }
    table->n_networks = counts[WHOLE_NETWORKS - FIRST_COUNT].bits;
    table->n_fallback_models = 0U;
    table->n_centers = counts[WHOLE_CENTERS - FIRST_COUNT].bits;
    table->n_channels = counts[WHOLE_CHANNELS - FIRST_COUNT].bits;
    table->n_terms = counts[WHOLE_TERMS - FIRST_COUNT].bits;
    for (i = 0U; i < 2U; i++) {
        MEMBER(table->authority[i]) = ELEMENT(numbers[NUMBER_AUTHORITY + i]);
        MEMBER(table->effect[i]) = ELEMENT(numbers[NUMBER_EFFECT + i]);
        table->coverage_cells[i] = counts[WHOLE_COVERAGE_TEMP - FIRST_COUNT + i].bits;
        table->sigma_cells[i] = counts[WHOLE_SIGMA_TEMP - FIRST_COUNT + i].bits;
    }
    table->n_sigma = counts[WHOLE_SIGMA_WORDS - FIRST_COUNT].bits;
    table->n_probes = counts[WHOLE_PROBES - FIRST_COUNT].bits;
}

/* Counts so small that no sum of words overflows. */
static int FN(counts_are_sane)(const TABLE *table)
{
    return ((table->n_networks <= 0xFFFFU) && (table->n_centers <= 0xFFFFU)
            && (table->n_channels <= 0xFFFFU) && (table->n_terms <= 0xFFFFU) && (table->n_sigma <= 0xFFFFU)
            && (table->n_probes <= 0xFFFFU)
            && ((table->coverage_cells[0] | table->coverage_cells[1]) <= 0xFFFU)
            && ((table->sigma_cells[0] | table->sigma_cells[1]) <= 0xFFFU)) ? 1 : 0;
}

/* The next n words of the image, or NULL. */
static const gtc_word_t *FN(next)(const gtc_word_t **words, uint_least32_t n)
{
    const gtc_word_t *const array = *words;

    *words = &array[n];
    return (n == 0U) ? NULL : array;
}

static void FN(find_arrays)(TABLE *table, const gtc_word_t *words)
{
    const gtc_word_t *next = &words[BEFORE_ARRAYS];

    table->serial = FN(next)(&next, GTC_SERIAL_WORDS);
    table->networks = FN(next)(&next, FN(all_networks)(table) * GTC_NETWORK_WORDS);
    table->centers = FN(next)(&next, table->n_centers * GTC_CENTER_WORDS);
    table->guards = FN(next)(&next, table->n_channels * GTC_GUARD_WORDS);
    table->terms = FN(next)(&next, table->n_terms * GTC_TERM_WORDS);
    table->coverage = FN(next)(&next, FN(coverage_words)(table));
    table->sigma = FN(next)(&next, table->n_sigma);
    table->probes = FN(next)(&next, table->n_probes * GTC_PROBE_WORDS);
    table->crc = next[0].bits;
}

/* Code of the terms of an image; NULL where images have none. Networks that terms name are fallback models, not the map's;
 * one at least is left to the map. */
static void FN(find_terms)(TABLE *table)
{
#if GTC_OPEN_TERMS
    /* MISRA 9.3: all are there; their names are macros, which the checker does not count. */
    static const CODE *const all[GTC_N_KINDS] = {
        &FN(term_memory), &FN(term_play), &FN(term_warm_up), &FN(term_harmonic), &FN(term_auxiliary),
        &FN(term_curve), &FN(term_product),
    };
    uint_least32_t i;

    table->term_code = all;
    for (i = 0U; i < table->n_terms; i++) {
        if ((FN(fallback_model_of)(FN(term_of)(table, i)) != 0U) && (table->n_networks > 1U)) {
            table->n_networks--;
            table->n_fallback_models++;
        }
    }
#else
    table->term_code = NULL;
#endif
}

/* All of a table from an image whose counts are sane. */
static void FN(read_image)(TABLE *table, const gtc_word_t *words)
{
    FN(read_header)(table, words);
    FN(find_arrays)(table, words);
    FN(find_terms)(table);
}

/* Magic, length and CRC, which every layout has in the same places; some layouts are shorter than this one. */
static int FN(is_image)(const gtc_word_t *words, uint_least32_t n_words)
{
    uint_least32_t length;
    uint_least32_t crc;

    if ((n_words < SHORTEST) || (words[IMAGE_MAGIC].bits != GTC_IMAGE_MAGIC)) {
        return 0;
    }
    length = words[IMAGE_LENGTH].bits;
    if ((length < SHORTEST) || (length > n_words)) {
        return 0;
    }
    crc = gtc_crc_words(GTC_CRC_START, &words[IMAGE_LAYOUT], length - 2U) ^ GTC_CRC_FINAL;
    return (crc == words[length - 1U].bits) ? 1 : 0;
}

static int FN(run_open)(TABLE *table, const gtc_word_t *words, uint_least32_t n_words,
                        uint_least32_t expected_id)
{
    TABLE read;

    if ((table == NULL) || (words == NULL)) {
        return GTC_E_ARG;
    }
    if (!FN(is_image)(words, n_words)) {
        return GTC_E_IMAGE;
    }
    if (words[IMAGE_LAYOUT].bits != (GTC_TABLE_LAYOUT + (ARITHMETIC * 65536UL))) {
        return GTC_E_LAYOUT;
    }
    if (words[IMAGE_LENGTH].bits < (BEFORE_ARRAYS + AFTER_ARRAYS)) {
        return GTC_E_IMAGE;
    }
    FN(read_header)(&read, words);
    if (read.id != expected_id) {
        return GTC_E_ID;
    }
    if ((!FN(counts_are_sane)(&read))
        || ((BEFORE_ARRAYS + FN(array_words)(&read) + AFTER_ARRAYS) != words[IMAGE_LENGTH].bits)) {
        return GTC_E_IMAGE;
    }
    FN(read_image)(&read, words);
    if (!FN(is_usable)(&read)) {
        return GTC_E_LAYOUT;
    }
    FN(read_image)(table, words);
    return GTC_OK;
}
#endif
