/* fuzz_check.c - gtc_<n>_check() of tables that are spoiled in values and settings: none passes. */
#include "fuzz.h"

#define COPIES 8

/* Copies of the arrays of a table, to spoil. */
static gtc_word_t arrays[COPIES][IMAGE_MAX];

static const gtc_word_t *copied(int k, const gtc_word_t *from, uint_least32_t n)
{
    (void)put(arrays[k], 0U, from, n);
    return (n != 0U) ? arrays[k] : NULL;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    stream_t in = {data, size};
    const table_t *const from = next_table(&in);
    const uint_least32_t k = next_byte(&in);
    gtc_word_t before[IMAGE_MAX];
    gtc_word_t after[IMAGE_MAX];
    table_t table = *from;
    uint_least32_t n;

    table.networks = copied(0, from->networks, (from->n_networks + from->n_fallback_models) * 8U);
    table.centers = copied(1, from->centers, from->n_centers * 5U);
    table.terms = copied(2, from->terms, from->n_terms * 8U);
    table.coverage = copied(3, from->coverage, ((from->coverage_cells[0] * from->coverage_cells[1]) + 31U) / 32U);
    table.sigma = copied(4, from->sigma, from->n_sigma);
    table.probes = copied(5, from->probes, from->n_probes * 4U);
    table.guards = copied(6, from->guards, from->n_channels * 8U);
    table.serial = copied(7, from->serial, 16U);
    n = image_of(&table, before);
    if (k < COPIES) {
        spoil(&in, arrays[k], 8U);
    } else {
        /* what is no count: counts say where arrays end, and nothing can check them */
        table.id ^= (k & 1U) * next_word(&in);
        table.slope_blocks ^= ((k >> 1) & 1U) * next_word(&in);
        table.block_us ^= ((k >> 2) & 1U) * next_word(&in);
        table.calibrated ^= ((k >> 3) & 1U) * next_word(&in);
        table.bias_frac_bits ^= ((k >> 4) & 1U) * next_word(&in);
        table.quantity ^= ((k >> 5) & 1U) * next_word(&in);
        table.layout ^= ((k >> 6) & 1U) * next_word(&in);
        table.envelope[next_byte(&in) % 4U] = from->envelope[next_byte(&in) % 4U];
    }
    (void)image_of(&table, after);
    if ((table.layout == from->layout) && (memcmp(before, after, n * sizeof before[0]) == 0)) {
        CLAIM((FN(check)(&table) == GTC_OK) && (FN(check_words)(&table) == GTC_OK));
    } else {
        CLAIM(FN(check)(&table) < 0);
    }
    return 0;
}
