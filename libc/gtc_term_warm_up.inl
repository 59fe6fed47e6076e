/* gtc_term_warm_up.inl - exponential in the time since init: warm_up, in the numbers included before.
 *
 * Parameters: gain, (block / tau) log2(e) times 64 in float32; amplitude. Adds amplitude exp(-t / tau).
 *
 * SPDX-License-Identifier: MIT
 */

static void FN(warm_up_apply)(const STATE *state, uint_least32_t i, NUM x, EFFECT *effect)
{
    const NUM gain = FN(parameter)(state, i, 0U);
    const NUM amplitude = FN(parameter)(state, i, 1U);

    (void)x;
    effect->added = FN(add)(effect->added, FN(fading)(state->elapsed, gain, amplitude));
}

const struct FN(term_code) FN(term_warm_up) = {
    GTC_TERM_WARM_UP, 0U, FN(nothing), FN(nothing), FN(nothing), FN(warm_up_apply),
};
