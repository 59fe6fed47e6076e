/* gtc_term_harmonic.inl - harmonic in the temperature: path_length_periodicity, in the numbers included before.
 *
 * Parameters: frequency, 1 / period; phase in turns; amplitude. Adds amplitude cos(2 pi (T / period + phase)).
 *
 * SPDX-License-Identifier: MIT
 */

static void FN(harmonic_apply)(const STATE *state, uint_least32_t i, NUM x, EFFECT *effect)
{
    const NUM frequency = FN(parameter)(state, i, 0U);
    const NUM phase = FN(parameter)(state, i, 1U);
    const NUM amplitude = FN(parameter)(state, i, 2U);

    effect->added = FN(add)(effect->added, FN(wave)(x, frequency, phase, amplitude));
}

const struct FN(term_code) FN(term_harmonic) = {
    GTC_TERM_HARMONIC, 0U, FN(nothing), FN(nothing), FN(nothing), FN(harmonic_apply),
};
