/* fuzz_image.c - images with changed words and a right CRC: what is opened, every function bears.
 *
 * An image of one of the test tables is changed in up to four words, its CRC mended. If it opens, each function is
 * called with extreme, missing and plausible numbers; every status is one of gtc.h, every correction a number.
 * storm.c gives this target pseudo-random inputs at full speed; images that failed once lie in corpus/.
 */
#include "fuzz.h"
#include "gtc_private.h"

unsigned long image_opened; /* images that were, for storm.c */

#define N_WORDS 16U

/* Numbers at which something changes. */
static const uint_least32_t edges[N_WORDS] = {
    0x00000000UL, 0x00000001UL, 0x00000002UL, 0x0000FFFFUL, 0x00010000UL, 0x40000000UL, 0x3FFFFFFFUL, 0x7FFFFFFFUL,
    0x80000000UL, 0x80000001UL, 0xFFFFFFFFUL, 0xC0000000UL, 0x7F800000UL, 0x7FC00000UL, 0x4E6E6B28UL, 0x00000020UL,
};

/* Without its probes an image has half the words. */
static uint_least32_t plain_image(const table_t *from, gtc_word_t *words)
{
    table_t table = *from;

    table.probes = NULL;
    table.n_probes = 0U;
    return image_of(&table, words);
}

/* Images without their CRC are made once. */
static const gtc_word_t *kept_image(uint_least32_t k, uint_least32_t *n)
{
    static const table_t *const tables[5] = {&TABLE, &BANK, &TERMS, &NARROW, &CURVED};
    static gtc_word_t images[5][IMAGE_MAX];
    static uint_least32_t lengths[5];

    if (lengths[k] == 0U) {
        lengths[k] = plain_image(tables[k], images[k]);
    }
    *n = lengths[k];
    return images[k];
}

/* Changes one word: to any other, to an edge, or to a neighbour of what it is. */
static void change(stream_t *in, gtc_word_t *words, uint_least32_t n)
{
    const uint_least32_t kind = next_byte(in);
    gtc_word_t *const word = &words[3U + (next_byte(in) % (n - 4U))];

    switch (kind % 4U) {
    case 0:
        word->bits = next_word(in);
        break;
    case 1:
        word->bits = edges[next_byte(in) % N_WORDS];
        break;
    case 2:
        word->bits ^= 1UL << (next_byte(in) % 32U);
        break;
    default:
        word->bits = (word->bits + next_byte(in) - 128U) & 0xFFFFFFFFUL;
        break;
    }
}

/* A temperature, a slope or a channel: anything, or something plausible. */
static num_t some_number(stream_t *in)
{
    const uint_least32_t kind = next_byte(in);
    gtc_word_t word;
    num_t x = (num_t)(C(0.5) * (num_t)((int)(kind / 2U) - 20));

    if ((kind & 1U) != 0U) {
        word.bits = ((kind & 2U) != 0U) ? next_word(in) : edges[(kind >> 2) % N_WORDS];
        memcpy(&x, &word, sizeof x);
    }
    return x;
}

static void walk(stream_t *in, const table_t *table)
{
    const uint_least32_t n = 1U + (next_byte(in) % 4U);
    gtc_word_t saved[GTC_SAVE_WORDS];
    state_t state;
    num_t result = 0;
    FN(angle_t) sum;
    uint_least32_t k;

    if (FN(init)(&state, table, (table->block_us >= n) ? (table->block_us / n) : 1U) != GTC_OK) {
        return; /* a block of so few microseconds */
    }
    for (k = 0U; k < 12U; k++) {
        num_t channels[GTC_MAX_TERMS + 1] = {0};
        uint_least32_t i;
        int status;

        for (i = 0U; i <= (uint_least32_t)GTC_MAX_TERMS; i++) {
            channels[i] = (i < 2U) ? some_number(in) : channels[1];
        }
        status = ((k % 6U) == 5U) ? FN(sample)(&state, table, (next_byte(in) % 64U) * state.period_us, NULL)
                                 : FN(sample)(&state, table, state.period_us, channels);
        CLAIM((status >= 0) && ((status & ~REMARKS) == 0));
        CLAIM((FN(bias)(&state, table, &result) >= 0) && is_number(result) && is_within_authority(table, result));
    }
    memset(&sum, 0, sizeof sum);
    result = some_number(in);
    if (FN(angle)(&sum, result, some_number(in), &result) >= 0) {
        CLAIM(is_number(result));
    }
    CLAIM(FN(save)(&state, table, saved) == GTC_OK);
    CLAIM(FN(restore)(&state, table, state.period_us, saved, next_byte(in) % 3U) == GTC_OK);
    CLAIM((FN(sample)(&state, table, 9U * state.period_us, NULL) >= 0) && (FN(bias)(&state, table, &result) >= 0) && is_number(result));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    stream_t in = {data, size};
    const uint_least32_t start = next_byte(&in);
    gtc_word_t words[IMAGE_MAX];
    uint_least32_t n;
    const gtc_word_t *const from = kept_image(start % 5U, &n);
    uint_least32_t k;
    table_t table;

    memcpy(words, from, n * sizeof words[0]);
    for (k = 0U; k <= ((start >> 2) % 4U); k++) {
        change(&in, words, n);
    }
    seal(words, n);
    if (FN(open)(&table, words, n, words[5].bits) == GTC_OK) {
        image_opened++;
        /* With other counts, words of another array may be taken for known answers. */
        CLAIM(FN(check)(&table) == ((table.n_probes == 0U) ? GTC_OK : GTC_E_SELF_TEST));
        for (k = 0U; k < 4U; k++) {
            num_t bias = 0;
            const int status = FN(map)(&table, some_number(&in), some_number(&in), &bias);

            CLAIM((status == GTC_E_ARG) || ((status & ~(GTC_CLAMPED | GTC_UNCOVERED)) == 0));
            CLAIM(is_number(bias) && ((status < 0) || is_within_authority(&table, bias)));
        }
        walk(&in, &table);
    }
    return 0;
}
