/* fuzz_open.c - gtc_<n>_open() of anything: noise, spoiled images, spoiled images with a right CRC.
 *
 * What is opened lies within the words; what is refused leaves the table unwritten.
 */
#include "fuzz.h"

/* The image ends where its memory ends, so that the sanitizer sees a word too many. */
static gtc_word_t *exactly(const gtc_word_t *words, uint_least32_t n)
{
    gtc_word_t *const copy = malloc((n + (n == 0U)) * sizeof *copy);

    CLAIM(copy != NULL);
    memcpy(copy, words, n * sizeof *copy);
    return copy;
}

static void read_all(const gtc_word_t *array, uint_least32_t n)
{
    const volatile gtc_word_t *const words = array;
    uint_least32_t i;

    for (i = 0U; i < n; i++) {
        (void)words[i].bits;
    }
}

static uint_least32_t made(stream_t *in, gtc_word_t *words, uint_least32_t *id)
{
    const uint_least32_t kind = next_byte(in) % 3U;
    const table_t *const table = next_table(in);
    uint_least32_t n = image_of(table, words);

    *id = table->id;
    if (kind == 0U) {
        n = 0U;
        while ((in->left > 0U) && (n < IMAGE_MAX)) {
            words[n++].bits = next_word(in);
        }
    } else {
        const uint_least32_t cut = next_byte(in);

        spoil(in, words, n);
        n -= (cut < n) ? (cut / 8U) : 0U;
        if ((kind == 2U) && (words[2].bits >= 4U) && (words[2].bits <= n)) {
            seal(words, words[2].bits);
        }
    }
    return n;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    stream_t in = {data, size};
    gtc_word_t words[IMAGE_MAX];
    gtc_word_t *image;
    table_t before;
    table_t table;
    uint_least32_t id;
    const uint_least32_t n = made(&in, words, &id);
    int status;

    memset(&before, 0xA5, sizeof before);
    memcpy(&table, &before, sizeof table);
    image = exactly(words, n);
    status = FN(open)(&table, image, n, id);
    if (status < 0) {
        CLAIM(memcmp(&table, &before, sizeof table) == 0);
        CLAIM((status == GTC_E_IMAGE) || (status == GTC_E_LAYOUT) || (status == GTC_E_ID));
    } else {
        CLAIM((status == GTC_OK) && (table.id == id) && (table.layout == GTC_TABLE_LAYOUT));
        read_all(table.networks, (table.n_networks + table.n_fallback_models) * GTC_NETWORK_WORDS);
        read_all(table.centers, table.n_centers * GTC_CENTER_WORDS);
        read_all(table.terms, table.n_terms * GTC_TERM_WORDS);
        read_all(table.coverage, ((table.coverage_cells[0] * table.coverage_cells[1]) + 31U) / 32U);
        read_all(table.sigma, table.n_sigma);
        read_all(table.guards, table.n_channels * GTC_GUARD_WORDS);
        read_all(table.serial, GTC_SERIAL_WORDS);
        read_all(table.probes, table.n_probes * GTC_PROBE_WORDS);
    }
    free(image);
    return 0;
}
