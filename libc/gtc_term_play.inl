/* gtc_term_play.inl - play operator: hysteresis, in the numbers included before.
 *
 * z <- max(T - width, min(T + width, z)) once a block. Parameters: width; amplitude. Adds
 * amplitude (z - T).
 *
 * SPDX-License-Identifier: MIT
 */

static void FN(play_step)(STATE *state, uint_least32_t i, NUM x)
{
    const NUM width = FN(parameter)(state, i, 0U);
    const NUM low = (NUM)FN(diff)(x, width);
    const NUM high = (NUM)FN(add)(x, width);
    NUM *const z = state->term[i];

    if (*z < low) {
        *z = low;
    } else if (*z > high) {
        *z = high;
    } else {
        /* it does not move */
    }
}

static void FN(play_begin)(STATE *state, uint_least32_t i, NUM x)
{
    if (FN(is_missing)(state->term[i][0]) != 0) {
        state->term[i][0] = x;
    }
    FN(play_step)(state, i, x);
}

static void FN(play_apply)(const STATE *state, uint_least32_t i, NUM x, EFFECT *effect)
{
    const NUM amplitude = FN(parameter)(state, i, 1U);

    effect->added = FN(add)(effect->added, FN(scaled_difference)(state->term[i][0], x, amplitude));
}

const struct FN(term_code) FN(term_play) = {
    GTC_TERM_PLAY, 1U, FN(play_begin), FN(nothing), FN(play_step), FN(play_apply),
};
