/* fuzz_step.c - any sequence of init, sample, bias, angle, save and restore, with any numbers.
 *
 * Every status is one of those that gtc.h names, every correction a number, and a state that was
 * saved and restored is the state.
 */
#include "fuzz.h"

static void check_status(int status)
{
    CLAIM((status >= 0) && ((status & ~REMARKS) == 0));
}

static void save_and_restore(state_t *state, const table_t *table)
{
    gtc_word_t words[GTC_SAVE_WORDS];
    gtc_word_t again[GTC_SAVE_WORDS];

    CLAIM(FN(save)(state, table, words) == GTC_OK);
    CLAIM(FN(restore)(state, table, state->period_us, words, 0U) == GTC_OK);
    CLAIM(FN(save)(state, table, again) == GTC_OK);
    CLAIM(memcmp(words, again, sizeof words) == 0);
}

static void step(stream_t *in, state_t *state, const table_t *table, FN(angle_t) *sum)
{
    num_t bias = 0;
    num_t channels[3] = {0, 0, 0};
    num_t result = C(77);
    int status;

    switch (next_byte(in) % 9U) {
    case 0:
        check_status(FN(sample)(state, table, next_word(in), NULL));
        break;
    case 1:
        CLAIM(FN(bias)(state, table, &bias) >= 0);
        status = FN(angle)(sum, bias, next_number(in), &result);
        CLAIM((status == GTC_E_ARG) ? same(result, C(77)) : is_number(result));
        break;
    case 2:
        save_and_restore(state, table);
        break;
    case 3: /* anything at all */
        channels[0] = next_number(in);
        channels[1] = next_number(in);
        check_status(FN(sample)(state, table, state->period_us, channels));
        break;
    case 4: /* at any time */
        channels[0] = (num_t)C(0.5) * (num_t)((int)next_byte(in) - 100);
        channels[1] = next_number(in);
        check_status(FN(sample)(state, table, next_word(in), channels));
        break;
    default: /* something plausible */
        channels[0] = (num_t)C(0.5) * (num_t)((int)next_byte(in) - 100);
        channels[1] = channels[0];
        check_status(FN(sample)(state, table, state->period_us, channels));
        break;
    }
    check_status(FN(bias)(state, table, &result));
    CLAIM(is_number(result) && is_within_authority(table, result));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    stream_t in = {data, size};
    const table_t *const table = next_table(&in);
    const uint_least32_t n = next_byte(&in);
    state_t state;
    FN(angle_t) sum;

    memset(&sum, 0, sizeof sum);
    memset(&state, 0xA5, sizeof state);
    if (n == 0U) {
        const uint_least32_t any = next_word(&in);

        const int status = FN(init)(&state, table, any);

        CLAIM((any == 0U) ? (status == GTC_E_ARG) : ((status == GTC_OK) || (status == GTC_E_PERIOD)));
        return 0;
    }
    CLAIM(FN(init)(&state, table, table->block_us / n) == GTC_OK);
    while (in.left > 0U) {
        step(&in, &state, table, &sum);
    }
    return 0;
}
