/* fuzz_restore.c - gtc_<n>_restore() of anything: noise, spoiled states, spoiled states with a right CRC.
 *
 * A spoiled state is refused and nothing written; one that is whole by its CRC is taken over word for word.
 */
#include "fuzz.h"

#define WORDS GTC_SAVE_WORDS

static void walked(uint_least32_t samples, state_t *state, const table_t *table)
{
    uint_least32_t i;

    for (i = samples; i > 0U; i--) {
        num_t channels[3] = {0, 0, 0};
        num_t bias = 0;

        channels[0] = C(10) + ((C(1) / 64) * (num_t)i);
        CLAIM(FN(sample)(state, table, state->period_us, channels) >= 0);
        CLAIM((FN(bias)(state, table, &bias) >= 0) && is_within_authority(table, bias));
    }
}

/* CRC of a saved state: over all words before it. */
static void sealed(gtc_word_t words[WORDS])
{
    words[WORDS - 1].bits = crc_of(words, WORDS - 1U);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    stream_t in = {data, size};
    const uint_least32_t kind = next_byte(&in) % 2U;
    const table_t *const table = next_table(&in);
    const uint_least32_t off_blocks = next_byte(&in);
    gtc_word_t words[WORDS];
    gtc_word_t spoiled[WORDS];
    state_t before;
    state_t state;
    int status;

    CLAIM(FN(init)(&state, table, PERIOD) == GTC_OK);
    walked(next_byte(&in), &state, table);
    CLAIM(FN(save)(&state, table, words) == GTC_OK);
    memcpy(spoiled, words, sizeof words);
    spoil(&in, spoiled, WORDS);
    if (kind == 1U) {
        sealed(spoiled);
    }
    memset(&before, 0xA5, sizeof before);
    memcpy(&state, &before, sizeof state);
    status = FN(restore)(&state, table, PERIOD, spoiled, off_blocks);
    if (status < 0) {
        CLAIM(memcmp(&state, &before, sizeof state) == 0);
        CLAIM((status == GTC_E_IMAGE) || (status == GTC_E_LAYOUT) || (status == GTC_E_ID));
    } else {
        CLAIM((status == GTC_OK) && ((kind == 1U) || (memcmp(words, spoiled, sizeof words) == 0)));
        walked(40U, &state, table);
        CLAIM(FN(save)(&state, table, words) == GTC_OK);
    }
    return 0;
}
