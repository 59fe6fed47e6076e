/* gtc_terms.inl - the kinds of extension terms, in the numbers included before.
 *
 * A table names the code of its terms, so that a program links the kinds that its table has. docs/numerics.md, section 8.
 *
 * SPDX-License-Identifier: MIT
 */

/* The hook of terms that have nothing to do there. */
static void FN(nothing)(STATE *state, uint_least32_t i, NUM x)
{
    (void)state;
    (void)i;
    (void)x;
}

/* ---- first-order memory: cavity_lag, thermal_gradient
 *
 * z <- z + gain (T - z) once a block. Parameters: gain; amplitude; rate, block / tau: where it is not 0
 * the map sees z and (T - z) rate instead of T and its slope. Adds amplitude (z - T). */

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
    GTC_TERM_MEMORY, 1U, FN(memory_begin), FN(memory_step), FN(memory_apply),
};

/* ---- play operator: hysteresis
 *
 * z <- max(T - width, min(T + width, z)) once a block. Parameters: width; amplitude. Adds
 * amplitude (z - T). */

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
    GTC_TERM_PLAY, 1U, FN(play_begin), FN(play_step), FN(play_apply),
};

/* ---- exponential in the time since init: warm_up
 *
 * Parameters: gain, (block / tau) log2(e) times 64 in float32; amplitude. Adds amplitude exp(-t / tau). */

static void FN(warm_up_apply)(const STATE *state, uint_least32_t i, NUM x, EFFECT *effect)
{
    const NUM gain = FN(parameter)(state, i, 0U);
    const NUM amplitude = FN(parameter)(state, i, 1U);

    (void)x;
    effect->added = FN(add)(effect->added, FN(fading)(state->elapsed, gain, amplitude));
}

const struct FN(term_code) FN(term_warm_up) = {
    GTC_TERM_WARM_UP, 0U, FN(nothing), FN(nothing), FN(warm_up_apply),
};

/* ---- harmonic in the temperature: path_length_periodicity
 *
 * Parameters: frequency, 1 / period; phase in turns; amplitude. Adds amplitude cos(2 pi (T / period + phase)). */

static void FN(harmonic_apply)(const STATE *state, uint_least32_t i, NUM x, EFFECT *effect)
{
    const NUM frequency = FN(parameter)(state, i, 0U);
    const NUM phase = FN(parameter)(state, i, 1U);
    const NUM amplitude = FN(parameter)(state, i, 2U);

    effect->added = FN(add)(effect->added, FN(wave)(x, frequency, phase, amplitude));
}

const struct FN(term_code) FN(term_harmonic) = {
    GTC_TERM_HARMONIC, 0U, FN(nothing), FN(nothing), FN(harmonic_apply),
};

/* ---- linear in the block mean of an auxiliary channel
 *
 * Parameters: slope; reference. Adds slope (mean - reference), the mean of the channel's last block with enough
 * readings, or of what stands for it (gtc_front.inl). */

static void FN(auxiliary_apply)(const STATE *state, uint_least32_t i, NUM x, EFFECT *effect)
{
    const uint_least32_t channel = state->table->terms[(i * GTC_TERM_WORDS) + 1U].bits;
    const INPUT *const in = &state->input[channel];
    const NUM slope = FN(parameter)(state, i, 0U);
    const NUM reference = FN(parameter)(state, i, 1U);

    (void)x;
    if ((in->gap_us == 0U) || (in->held_blocks != 0U)) {
        effect->remarks |= GTC_HELD;
    }
    if (in->held_blocks > state->table->guards[(channel * GTC_GUARD_WORDS) + 6U].bits) {
        effect->remarks |= GTC_CHANNEL_LOST;
    }
    if ((in->clamped & 2U) != 0U) {
        effect->remarks |= GTC_CLAMPED;
    }
    effect->added = FN(add)(effect->added, FN(scaled_difference)(in->mean, reference, slope));
}

const struct FN(term_code) FN(term_auxiliary) = {
    GTC_TERM_AUXILIARY, 0U, FN(nothing), FN(nothing), FN(auxiliary_apply),
};
