/* gtc_term_memory.inl - first-order memory: cavity_lag, thermal_gradient, in the numbers included before.
 *
 * z <- z + gain (T - z) once a block. Parameters: gain; amplitude; rate, block / tau: where it is not 0
 * the map sees z and (T - z) rate instead of T and its slope. Adds amplitude (z - T).
 *
 * SPDX-License-Identifier: MIT
 */

static void FN(memory_begin)(STATE *state, uint_least32_t i, NUM x)
{
    NUM *const z = state->term[i];

    if (FN(is_missing)(z[0]) != 0) {
        FN(settle)(z, x);
    } else {
        FN(follow)(z, x, FN(power)(FN(parameter)(state, i, 0U), state->off_blocks));
    }
}

static void FN(memory_step)(STATE *state, uint_least32_t i, NUM x)
{
    FN(follow)(state->term[i], x, FN(parameter)(state, i, 0U));
}

static void FN(memory_apply)(const STATE *state, uint_least32_t i, NUM x, EFFECT *effect)
{
    const NUM z = state->term[i][0];
    const NUM rate = FN(parameter)(state, i, 2U);

    if (FN(bits)(rate) != 0U) {
        effect->temp = z;
        effect->slope = FN(slope_of)(x, z, rate);
    }
    effect->added = FN(add)(effect->added, FN(scaled_difference)(z, x, FN(parameter)(state, i, 1U)));
}

const struct FN(term_code) FN(term_memory) = {
    GTC_TERM_MEMORY, 1U, FN(memory_begin), FN(nothing), FN(memory_step), FN(memory_apply),
};
