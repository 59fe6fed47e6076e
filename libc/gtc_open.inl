/* gtc_open.inl - a table from a binary image, and the conditions on the words of a table from outside.
 *
 * docs/FORMAT.md, section 3, gives the order of the words.
 *
 * SPDX-License-Identifier: MIT
 */

#if GTC_WITH_IMAGE
/* Places in an image. */
#define IMAGE_MAGIC 0U
#define IMAGE_LAYOUT 1U
#define IMAGE_LENGTH 2U
#define IMAGE_WHOLES 3U

/* ---- whether this build can use a table -------------------------------------------------------------------------- */

/* Everything that could make another function read outside the table, divide by zero, leave the range of a
 * number or make one that is none is refused here: words outside of their ranges, and what relates
 * several words. The tests call these "the conditions"; docs/FORMAT.md, section 3, lists them. */

/* Whether n words are numbers in their ranges (false for a NaN, too). */
static int numbers_fit(const gtc_word_t *words, const range_t *ranges, uint_least32_t n)
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
static int is_array(const gtc_word_t *words, uint_least32_t n)
{
    return ((words == NULL) == (n == 0U)) ? 1 : 0;
}

/* Cells of a grid over the envelope: both counts 0, or none. */
static int is_grid(const uint_least32_t cells[2])
{
    return ((cells[0] == 0U) == (cells[1] == 0U)) ? 1 : 0;
}

static int grids_fit(const TABLE *table)
{
    return (is_grid(table->coverage_cells) && is_array(table->coverage, table->coverage_cells[0])
            && is_grid(table->sigma_cells) && is_array(table->sigma, table->n_sigma)
            && (table->n_sigma >= (table->sigma_cells[0] * table->sigma_cells[1]))) ? 1 : 0;
}

static int arrays_fit(const TABLE *table)
{
    return (is_array(table->serial, GTC_SERIAL_WORDS) && is_array(table->networks, table->n_networks)
            && is_array(table->centers, table->n_centers) && is_array(table->guards, table->n_channels)
            && is_array(table->terms, table->n_terms) && is_array(table->probes, table->n_probes)) ? 1 : 0;
}

#if GTC_WITH_UNCERTAINTY
/* A table's words of uncertainty are all there, or none, and in their ranges. */
static int sigma_fits(const TABLE *table)
{
    const uint_least32_t cells = table->sigma_cells[0] * table->sigma_cells[1];
    const uint_least32_t whole = (sigma_grids(table) * cells) + GTC_SIGMA_RULES + table->n_terms;
    int fit = 1;
    uint_least32_t i;

    for (i = 0U; i < table->n_sigma; i++) {
        fit &= numbers_fit(&table->sigma[i], sigma_limits, 1U);
    }
    return ((fit != 0) && ((table->n_sigma == 0U) || ((cells != 0U) && (table->n_sigma == whole)))) ? 1 : 0;
}
#endif

/* Whole numbers in their ranges, from number `first` of their list on. */
static int wholes_fit(const TABLE *table, uint_least32_t first)
{
    uint_least32_t found[N_WHOLE];
    int fit = 1;
    uint_least32_t i;

    get_wholes(table, found);
    for (i = first; i < N_WHOLE; i++) {
        fit &= ((found[i] >= whole_limits[i][0]) && (found[i] <= whole_limits[i][1])) ? 1 : 0;
    }
    return fit;
}

/* What the table holds it names among its parts. */
static int parts_fit(const TABLE *table)
{
    return (((table->n_networks == 1U) || ((table->parts & GTC_PART_BANK) != 0U))
            && ((table->coverage == NULL) || ((table->parts & GTC_PART_COVERAGE) != 0U))
            && ((table->n_sigma == 0U) || ((table->parts & GTC_PART_UNCERTAINTY) != 0U))
            && ((table->n_probes == 0U) || ((table->parts & GTC_PART_PROBES) != 0U))) ? 1 : 0;
}

#if GTC_WITH_TERMS
/* A term is of a kind that the table names among its parts; some kinds read a further channel, others the
 * temperature. */
static int term_fits(const TABLE *table, uint_least32_t i)
{
    const gtc_word_t *const term = term_of(table, i);
    const uint_least32_t kind = term[TERM_KIND].bits;
    const uint_least32_t channel = channel_of(term);

    return ((kind >= 1U) && (kind <= GTC_N_KINDS) && ((table->parts & GTC_PART_TERM(kind)) != 0U)
            && (channel < table->n_channels) && ((channel != 0U) == (((CHANNEL_KINDS >> kind) & 1U) != 0U))) ? 1 : 0;
}

/* All of them; fallback models belong to terms of a channel, one to each that has one, in their order, behind at
 * least one network of the map. */
static int terms_fit(const TABLE *table)
{
    uint_least32_t last = table->n_networks;
    uint_least32_t i;

    for (i = 0U; i < table->n_terms; i++) {
        const gtc_word_t *const term = term_of(table, i);
        const uint_least32_t fallback_model = fallback_model_of(term);

        if (!term_fits(table, i)) {
            return 0;
        }
        if (fallback_model != 0U) {
            last++;
            if ((fallback_model != last) || (channel_of(term) == 0U)) {
                return 0;
            }
        }
    }
    return (last == all_networks(table)) ? 1 : 0;
}
#else
/* No term has a fallback model. */
static int terms_fit(const TABLE *table)
{
    return (table->n_fallback_models == 0U) ? 1 : 0;
}
#endif

/* 1 if this runtime has what the table needs, and counts, arrays and terms go together, so that the words of each
 * record can be read; else 0. */
static int has_sound_structure(const TABLE *table)
{
    return (fits_runtime(table) && wholes_fit(table, FIRST_COUNT) && arrays_fit(table) && parts_fit(table)
            && grids_fit(table) && terms_fit(table) && centers_fit(table)
            && (array_words(table) <= MAX_TABLE_WORDS)) ? 1 : 0;
}

/* The constant correction is one that the table may give. */
static int authority_fits(const TABLE *table)
{
    const NUM fallback = MEMBER(table->fallback);

    return ((fallback >= MEMBER(table->authority[0])) && (fallback <= MEMBER(table->authority[1]))) ? 1 : 0;
}

static int members_fit(const TABLE *table)
{
    gtc_word_t found[N_NUMBERS];

    get_numbers(table, found);
    return numbers_fit(found, number_limits, N_NUMBERS) & envelope_fits(table) & authority_fits(table);
}

/* The guard of one channel. The temperature's range keeps to what a sensor can show, so that no difference of
 * two samples leaves its word. */
static int guard_fits(const gtc_word_t *guard, uint_least32_t channel)
{
    const NUM low = ELEMENT(guard[GUARD_LOW]);
    const NUM high = ELEMENT(guard[GUARD_HIGH]);
    int fit = numbers_fit(guard, guard_limits, 4U)
              & numbers_fit(&guard[GUARD_FALLBACK], guard_limits, 1U) & ((low <= high) ? 1 : 0);
    uint_least32_t i;

    for (i = 0U; i < 3U; i++) {
        fit &= ((guard[GUARD_AGREE + i].bits >= guard_wholes[i][0])
                && (guard[GUARD_AGREE + i].bits <= guard_wholes[i][1]))
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

static int guards_fit(const TABLE *table)
{
    int fit = 1;
    uint_least32_t i;

    for (i = 0U; i < table->n_channels; i++) {
        fit &= guard_fits(&table->guards[i * GTC_GUARD_WORDS], i);
    }
    return fit;
}

/* The region of one of several networks has a width by which shares can be divided. */
static int region_fits(const gtc_word_t region[2], uint_least32_t n_networks)
{
    const NUM low = ELEMENT(region[0]);
    const NUM high = ELEMENT(region[1]);

    return (is_width(low, high) || ((n_networks == 1U) && (low <= high))) ? 1 : 0;
}

/* One network with its centers. */
static int network_fits(const TABLE *table, const gtc_word_t *network, const gtc_word_t *centers)
{
    uint_least32_t i;
    int fit = numbers_fit(&network[NETWORK_CONSTANT], network_limits, GTC_NETWORK_WORDS - 1U)
              & region_fits(&network[NETWORK_REGION_TEMP],
                            table->n_networks) & region_fits(&network[NETWORK_REGION_SLOPE], table->n_networks);

    for (i = 0U; i < network[NETWORK_CENTERS].bits; i++) {
        fit &= numbers_fit(&centers[i * GTC_CENTER_WORDS], center_limits, GTC_CENTER_WORDS);
    }
#if HAS_SUM_LIMITS
    fit &= sums_fit(network, centers);
#endif
    return fit;
}

static int networks_fit(const TABLE *table)
{
    const uint_least32_t n_networks = all_networks(table);
    const gtc_word_t *center = table->centers;
    int fit = 1;
    uint_least32_t i;

    for (i = 0U; i < n_networks; i++) {
        const gtc_word_t *const network = &table->networks[i * GTC_NETWORK_WORDS];

        fit &= network_fits(table, network, center);
        center = &center[network[NETWORK_CENTERS].bits * GTC_CENTER_WORDS];
    }
    return fit;
}

#if GTC_WITH_TERMS
/* The parameters of all terms. */
static int parameters_fit(const TABLE *table)
{
    int fit = 1;
    uint_least32_t i;

    for (i = 0U; i < table->n_terms; i++) {
        const gtc_word_t *const term = term_of(table, i);

        fit &= numbers_fit(&term[TERM_PARAMETERS], term_limits[term[TERM_KIND].bits - 1U],
                           GTC_TERM_WORDS - TERM_PARAMETERS);
    }
    return fit;
}
#endif

/* 1 if the structure is sound and every word is in its range, so that no function meets a run-time error with the
 * table; else 0. */
static int has_sound_words(const TABLE *table)
{
    return (has_sound_structure(table) && wholes_fit(table, 0U) && members_fit(table)
#if GTC_WITH_TERMS
            && parameters_fit(table)
#endif
#if GTC_WITH_UNCERTAINTY
            && sigma_fits(table)
#endif
            && networks_fit(table) && guards_fit(table)) ? 1 : 0;
}

/* ---- a table from an image ----------------------------------------------------------------------- */

/* Words before the arrays, with the magic; and the CRC behind them. */
#define BEFORE_ARRAYS (1U + HEADER_WORDS)
#define AFTER_ARRAYS 1U
#define SHORTEST 4U /* magic, layout, length, CRC */

/* The members of a table as the image has them. */
static void read_header(TABLE *table, const gtc_word_t *words)
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
    table->parts = wholes[WHOLE_PARTS].bits;
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
static int counts_are_sane(const TABLE *table)
{
    return ((table->n_networks <= 0xFFFFU) && (table->n_centers <= 0xFFFFU)
            && (table->n_channels <= 0xFFFFU) && (table->n_terms <= 0xFFFFU) && (table->n_sigma <= 0xFFFFU)
            && (table->n_probes <= 0xFFFFU)
            && ((table->coverage_cells[0] | table->coverage_cells[1]) <= 0xFFFU)
            && ((table->sigma_cells[0] | table->sigma_cells[1]) <= 0xFFFU)) ? 1 : 0;
}

/* The next n words of the image, or NULL. */
static const gtc_word_t *next_array(const gtc_word_t **words, uint_least32_t n)
{
    const gtc_word_t *const array = *words;

    *words = &array[n];
    return (n == 0U) ? NULL : array;
}

static void find_arrays(TABLE *table, const gtc_word_t *words)
{
    const gtc_word_t *next = &words[BEFORE_ARRAYS];

    table->serial = next_array(&next, GTC_SERIAL_WORDS);
    table->networks = next_array(&next, all_networks(table) * GTC_NETWORK_WORDS);
    table->centers = next_array(&next, table->n_centers * GTC_CENTER_WORDS);
    table->guards = next_array(&next, table->n_channels * GTC_GUARD_WORDS);
    table->terms = next_array(&next, table->n_terms * GTC_TERM_WORDS);
    table->coverage = next_array(&next, coverage_words(table));
    table->sigma = next_array(&next, table->n_sigma);
    table->probes = next_array(&next, table->n_probes * GTC_PROBE_WORDS);
    table->crc = next[0].bits;
}

#if GTC_WITH_TERMS
/* Networks that terms name are fallback models, not the map's; one at least is left to the map. */
static void find_fallback_models(TABLE *table)
{
    uint_least32_t i;

    for (i = 0U; i < table->n_terms; i++) {
        if ((fallback_model_of(term_of(table, i)) != 0U) && (table->n_networks > 1U)) {
            table->n_networks--;
            table->n_fallback_models++;
        }
    }
}
#endif

/* All of a table from an image whose counts are sane. */
static void read_image(TABLE *table, const gtc_word_t *words)
{
    read_header(table, words);
    find_arrays(table, words);
#if GTC_WITH_TERMS
    find_fallback_models(table);
#endif
}

/* Magic, length and CRC, which every layout has in the same places; some layouts are shorter than this one. */
static int is_image(const gtc_word_t *words, uint_least32_t n_words)
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
    crc = crc_words(CRC_START, &words[IMAGE_LAYOUT], length - 2U) ^ CRC_FINAL;
    return (crc == words[length - 1U].bits) ? 1 : 0;
}

int PUBLIC(check_words)(const TABLE *table)
{
    int status = GTC_OK;

    if (table == NULL) {
        status = GTC_E_ARG;
    } else if (!has_sound_words(table)) {
        status = GTC_E_LAYOUT;
    } else {
        /* every word is in its range */
    }
    return status;
}

int PUBLIC(open)(TABLE *table, const gtc_word_t *words, uint_least32_t n_words, uint_least32_t expected_id)
{
    TABLE read;

    if ((table == NULL) || (words == NULL)) {
        return GTC_E_ARG;
    }
    if (!is_image(words, n_words)) {
        return GTC_E_IMAGE;
    }
    if (words[IMAGE_LAYOUT].bits != (GTC_TABLE_LAYOUT + (ARITHMETIC * 65536UL))) {
        return GTC_E_LAYOUT;
    }
    if (words[IMAGE_LENGTH].bits < (BEFORE_ARRAYS + AFTER_ARRAYS)) {
        return GTC_E_IMAGE;
    }
    read_header(&read, words);
    if (read.id != expected_id) {
        return GTC_E_ID;
    }
    if ((!counts_are_sane(&read))
        || ((BEFORE_ARRAYS + array_words(&read) + AFTER_ARRAYS) != words[IMAGE_LENGTH].bits)) {
        return GTC_E_IMAGE;
    }
    read_image(&read, words);
    if (!has_sound_words(&read)) {
        return GTC_E_LAYOUT;
    }
    *table = read;
    return GTC_OK;
}
#endif
