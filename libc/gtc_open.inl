/* gtc_open.inl - a table from a binary image, in the numbers included before.
 *
 * docs/FORMAT.md, section 3, gives the order of the words.
 *
 * SPDX-License-Identifier: MIT
 */

/* Words before the arrays, with the magic; and the CRC behind them. */
#define BEFORE_ARRAYS (1U + HEADER_WORDS)
#define AFTER_ARRAYS 1U

/* The members of a table as the image has them; arrays stay NULL. */
static void FN(read_header)(TABLE *table, const gtc_word_t *words)
{
    const gtc_word_t *const numbers = &words[10];
    const gtc_word_t *const counts = &words[BEFORE_ARRAYS - 9U];
    uint_least32_t i;

    table->layout = words[1].bits & 0xFFFFU;
    table->quantity = words[3].bits;
    table->unit = words[4].bits;
    table->id = words[5].bits;
    table->slope_blocks = words[6].bits;
    table->hold_blocks = words[7].bits;
    table->stuck_samples = words[8].bits;
    table->bias_frac_bits = words[9].bits;
    MEMBER(table->max_step) = ELEMENT(numbers[0]);
    MEMBER(table->max_slope) = ELEMENT(numbers[1]);
    MEMBER(table->fallback) = ELEMENT(numbers[2]);
    for (i = 0U; i < 3U; i++) {
        MEMBER(table->scale[i]) = ELEMENT(numbers[3U + i]);
    }
    for (i = 0U; i < 4U; i++) {
        MEMBER(table->envelope[i]) = ELEMENT(numbers[6U + i]);
    }
    table->n_networks = counts[0].bits;
    table->n_centers = counts[1].bits;
    table->n_channels = counts[2].bits;
    table->n_terms = counts[3].bits;
    for (i = 0U; i < 2U; i++) {
        table->coverage_cells[i] = counts[4U + i].bits;
        table->sigma_cells[i] = counts[6U + i].bits;
    }
    table->n_probes = counts[8].bits;
}

/* Counts so small that no sum of words overflows. */
static int FN(counts_are_sane)(const TABLE *table)
{
    return ((table->n_networks <= 0xFFFFU) && (table->n_centers <= 0xFFFFU)
            && (table->n_terms <= 0xFFFFU) && (table->n_probes <= 0xFFFFU)
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

    table->networks = FN(next)(&next, table->n_networks * GTC_NETWORK_WORDS);
    table->centers = FN(next)(&next, table->n_centers * GTC_CENTER_WORDS);
    table->terms = FN(next)(&next, table->n_terms * GTC_TERM_WORDS);
    table->coverage = FN(next)(&next, FN(coverage_words)(table));
    table->sigma = FN(next)(&next, table->sigma_cells[0] * table->sigma_cells[1]);
    table->probes = FN(next)(&next, table->n_probes * GTC_PROBE_WORDS);
    table->crc = next[0].bits;
}

#if GTC_OPEN_TERMS
/* Code of every term of the image; left NULL where the kind is unknown. */
static void FN(find_code)(TABLE *table)
{
    static const struct FN(term_code) *const all[5] = {
        &FN(term_memory), &FN(term_play), &FN(term_warm_up), &FN(term_harmonic), &FN(term_auxiliary),
    };
    uint_least32_t i;

    for (i = 0U; (i < table->n_terms) && (i < (uint_least32_t)GTC_MAX_TERMS); i++) {
        const uint_least32_t kind = table->terms[i * GTC_TERM_WORDS].bits;

        if ((kind >= 1U) && (kind <= 5U)) {
            table->term_code[i] = all[kind - 1U];
        }
    }
}
#endif

/* Magic, length and CRC, which every layout has in the same places. */
static int FN(is_image)(const gtc_word_t *words, uint_least32_t n_words)
{
    uint_least32_t length;
    uint_least32_t crc;

    if ((n_words < (BEFORE_ARRAYS + AFTER_ARRAYS)) || (words[0].bits != GTC_IMAGE_MAGIC)) {
        return 0;
    }
    length = words[2].bits;
    if ((length < (BEFORE_ARRAYS + AFTER_ARRAYS)) || (length > n_words)) {
        return 0;
    }
    crc = gtc_crc_words(GTC_CRC_START, &words[1], length - 2U) ^ GTC_CRC_FINAL;
    return (crc == words[length - 1U].bits) ? 1 : 0;
}

int FN(open)(TABLE *table, const gtc_word_t *words, uint_least32_t n_words,
             uint_least32_t expected_id)
{
    const TABLE nothing = {0};
    TABLE read = nothing;

    if ((table == NULL) || (words == NULL)) {
        return GTC_E_ARG;
    }
    if (!FN(is_image)(words, n_words)) {
        return GTC_E_IMAGE;
    }
    if (words[1].bits != (GTC_TABLE_LAYOUT + (ARITHMETIC * 65536UL))) {
        return GTC_E_LAYOUT;
    }
    FN(read_header)(&read, words);
    if (read.id != expected_id) {
        return GTC_E_ID;
    }
    if ((!FN(counts_are_sane)(&read))
        || ((BEFORE_ARRAYS + FN(array_words)(&read) + AFTER_ARRAYS) != words[2].bits)) {
        return GTC_E_IMAGE;
    }
    FN(find_arrays)(&read, words);
#if GTC_OPEN_TERMS
    FN(find_code)(&read);
#endif
    if (!FN(is_usable)(&read)) {
        return GTC_E_LAYOUT;
    }
    *table = read;
    return GTC_OK;
}
