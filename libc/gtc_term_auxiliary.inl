/* gtc_term_auxiliary.inl - linear in the block mean of an auxiliary channel, in the numbers included before.
 *
 * Parameters: slope; reference. Adds slope (mean - reference). State: mean of the last block, missing before
 * the first sample; base of the running block, missing where the last one had too few samples.
 *
 * SPDX-License-Identifier: MIT
 */

/* Samples of the channel count from the first believed temperature on. */
static void FN(auxiliary_begin)(STATE *state, uint_least32_t i, NUM x)
{
    (void)x;
    state->channel_valid[i] = 0U;
}

static void FN(auxiliary_take)(STATE *state, uint_least32_t i, NUM x)
{
    NUM *const mean = &state->term[i][0];
    NUM *const base = &state->term[i][1];

    /* False for a NaN, too. Before the first believed temperature no block ends that could empty the sum. */
    if ((!((x >= -CHANNEL_MAX) && (x <= CHANNEL_MAX))) || (state->channel_valid[i] >= state->samples_per_block)) {
        return;
    }
    if (FN(is_missing)(*mean) != 0) {
        *mean = x;
    }
    if (state->channel_valid[i] == 0U) {
        *base = x;
        state->channel[i] = NUM_ZERO;
    }
    state->channel[i] = FN(add)(state->channel[i], FN(diff)(x, *base));
    state->channel_valid[i]++;
}

static void FN(auxiliary_step)(STATE *state, uint_least32_t i, NUM x)
{
    NUM *const base = &state->term[i][1];

    (void)x;
    if ((2U * state->channel_valid[i]) >= state->samples_per_block) {
        state->term[i][0] = FN(mean)(*base, state->channel[i], state->channel_valid[i]);
    } else {
        *base = FN(missing)();
    }
    state->channel_valid[i] = 0U;
}

static void FN(auxiliary_apply)(const STATE *state, uint_least32_t i, NUM x, EFFECT *effect)
{
    const NUM slope = FN(parameter)(state, i, 0U);
    const NUM reference = FN(parameter)(state, i, 1U);

    (void)x;
    if (FN(is_missing)(state->term[i][1]) != 0) {
        effect->remarks |= GTC_HELD;
    }
    if (!FN(is_missing)(state->term[i][0])) {
        effect->added = FN(add)(effect->added, FN(scaled_difference)(state->term[i][0], reference, slope));
    }
}

const struct FN(term_code) FN(term_auxiliary) = {
    GTC_TERM_AUXILIARY, 0U, FN(auxiliary_begin), FN(auxiliary_take), FN(auxiliary_step), FN(auxiliary_apply),
};
