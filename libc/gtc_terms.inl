/* gtc_terms.inl - the kinds of extension terms, in the numbers included before.
 *
 * A table names the code of its terms, so that a program links the kinds that its table has. docs/numerics.md, section 8.
 *
 * SPDX-License-Identifier: MIT
 */

/* Terms of a table, and its channels with the temperature: a build without terms leaves the code of both out. */
static inline uint_least32_t FN(n_terms)(const TABLE *table)
{
    return (GTC_MAX_TERMS > 0) ? table->n_terms : 0U;
}

static inline uint_least32_t FN(n_channels)(const TABLE *table)
{
    return (GTC_MAX_TERMS > 0) ? table->n_channels : 1U;
}

static const gtc_word_t *FN(term_of)(const TABLE *table, uint_least32_t i)
{
    return &table->terms[i * GTC_TERM_WORDS];
}

/* The functions of a term. */
static const CODE *FN(code_of)(const TABLE *table, uint_least32_t i)
{
    return table->term_code[FN(term_of)(table, i)[TERM_KIND].bits - 1U];
}

/* The channel that a term reads, and the number of its fallback model among the networks, from 1 on; 0: it has none. */
static uint_least32_t FN(channel_of)(const gtc_word_t *term)
{
    return term[TERM_CHANNEL].bits & 0xFFFFU;
}

static uint_least32_t FN(fallback_model_of)(const gtc_word_t *term)
{
    return term[TERM_CHANNEL].bits >> 16;
}

/* What a term adds on average where its channel is not known: its fallback model, at the inputs of the map. Where they are
 * none (something else wrote over the state) the map says so. */
static NUM FN(fallback_model)(const TABLE *table, uint_least32_t number, const EFFECT *effect)
{
    const gtc_word_t *network = table->networks;
    const gtc_word_t *center = table->centers;
    POINT in;
    uint_least32_t i;

    (void)FN(locate)(table, effect->temp, effect->slope, &in);
    for (i = 1U; i < number; i++) {
        center = &center[network[NETWORK_CENTERS].bits * GTC_CENTER_WORDS];
        network = &network[GTC_NETWORK_WORDS];
    }
    return FN(network)(table, network, center, &in);
}

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
 * the map sees z and (T - z) rate instead of T and its slope. Adds amplitude (z - T). What no call can have
 * left in z (something else wrote there) would take long to follow, so z begins again at T. */

static void FN(memory_follow)(NUM z[2], NUM x, NUM gain)
{
    const NUM most = FN(number_limits)[NUMBER_ENVELOPE].most;

    if ((z[0] >= -most) && (z[0] <= most)) {
        FN(follow)(z, x, gain);
    } else {
        FN(settle)(z, x);
    }
}

static void FN(memory_begin)(STATE *state, uint_least32_t i, NUM x)
{
    FN(memory_follow)(state->term[i], x, FN(power)(FN(parameter)(state, i, MEMORY_GAIN), state->off_blocks));
}

static void FN(memory_step)(STATE *state, uint_least32_t i, NUM x)
{
    FN(memory_follow)(state->term[i], x, FN(parameter)(state, i, MEMORY_GAIN));
}

static void FN(memory_apply)(const STATE *state, uint_least32_t i, NUM x, EFFECT *effect)
{
    const NUM z = state->term[i][0];
    const NUM rate = FN(parameter)(state, i, MEMORY_RATE);

    if (FN(bits)(rate) != 0U) {
        effect->temp = z;
        effect->slope = FN(slope_of)(x, z, rate);
    }
    effect->added = FN(add)(effect->added, FN(scaled_difference)(z, x, FN(parameter)(state, i, MEMORY_AMPLITUDE)));
}

const struct FN(term_code) FN(term_memory) = {
    1U, FN(memory_begin), FN(memory_step), FN(memory_apply),
};

/* A parameter that goes with the temperature: value + growth (T - reference of T). */
static NUM FN(over_temp)(NUM value, NUM growth, NUM x, NUM middle)
{
    return (NUM)FN(factor)(FN(add)(value, FN(scaled_difference)(x, middle, growth)));
}

/* ---- play operator: hysteresis
 *
 * z <- max(T - width, min(T + width, z)) once a block. Parameters: width; amplitude; growth, by which the amplitude grows
 * with each C; reference of T. Adds (amplitude + growth (T - reference of T)) (z - T). */

static void FN(play_step)(STATE *state, uint_least32_t i, NUM x)
{
    const NUM width = FN(parameter)(state, i, PLAY_WIDTH);
    const NUM low = (NUM)FN(diff)(x, width);
    const NUM high = (NUM)FN(add)(x, width);
    NUM *const z = state->term[i];

    if (*z > high) {
        *z = high;
    } else if (*z >= low) {
        /* it does not move */
    } else {
        *z = low; /* what is no number, too */
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
    const NUM growth = FN(parameter)(state, i, PLAY_GROWTH);
    NUM amplitude = FN(parameter)(state, i, PLAY_AMPLITUDE);

    if (FN(bits)(growth) != 0U) {
        amplitude = FN(over_temp)(amplitude, growth, x, FN(parameter)(state, i, PLAY_REFERENCE_TEMP));
    }
    effect->added = FN(add)(effect->added, FN(scaled_difference)(state->term[i][0], x, amplitude));
}

const struct FN(term_code) FN(term_play) = {
    1U, FN(play_begin), FN(play_step), FN(play_apply),
};

/* ---- exponential in the time since init: warm_up
 *
 * Parameters: gain, (block / tau) log2(e) times 64 in float32; amplitude. Adds amplitude exp(-t / tau). */

static void FN(warm_up_apply)(const STATE *state, uint_least32_t i, NUM x, EFFECT *effect)
{
    const NUM gain = FN(parameter)(state, i, WARM_UP_GAIN);
    const NUM amplitude = FN(parameter)(state, i, WARM_UP_AMPLITUDE);

    (void)x;
    effect->added = FN(add)(effect->added, FN(fading)(state->elapsed, gain, amplitude));
}

const struct FN(term_code) FN(term_warm_up) = {
    0U, FN(nothing), FN(nothing), FN(warm_up_apply),
};

/* ---- harmonic in the temperature: path_length_periodicity
 *
 * Parameters: frequency, 1 / period; phase in turns; amplitude. Adds amplitude cos(2 pi (T / period + phase)). */

static void FN(harmonic_apply)(const STATE *state, uint_least32_t i, NUM x, EFFECT *effect)
{
    const NUM frequency = FN(parameter)(state, i, HARMONIC_FREQUENCY);
    const NUM phase = FN(parameter)(state, i, HARMONIC_PHASE);
    const NUM amplitude = FN(parameter)(state, i, HARMONIC_AMPLITUDE);

    effect->added = FN(add)(effect->added, FN(wave)(x, frequency, phase, amplitude));
}

const struct FN(term_code) FN(term_harmonic) = {
    0U, FN(nothing), FN(nothing), FN(harmonic_apply),
};

/* ---- functions of the block mean of an auxiliary channel
 *
 * The mean is that of the channel's last block with enough readings. While nothing of the channel is accepted a term
 * adds its fallback model; one that has none takes the guard's fallback for the mean (gtc_front.inl). */

static const gtc_word_t *FN(guard)(const STATE *state, uint_least32_t channel)
{
    return &state->table->guards[channel * GTC_GUARD_WORDS];
}

/* A channel has been missing for so long that its fallback stands for it. */
static int FN(is_lost)(const INPUT *in, const gtc_word_t *guard)
{
    return (in->held_blocks > guard[GUARD_MISSING].bits) ? 1 : 0;
}

/* Whether the channel of a term has a mean, with the remarks about it; else the fallback model is added. */
static int FN(has_mean)(const STATE *state, uint_least32_t i, EFFECT *effect, NUM *mean)
{
    const gtc_word_t *const term = FN(term_of)(state->table, i);
    const uint_least32_t channel = FN(channel_of)(term);
    const uint_least32_t fallback_model = FN(fallback_model_of)(term);
    const INPUT *const in = &state->input[channel];
    const uint_least32_t bit = (uint_least32_t)1U << i;

    int_least32_t remarks = GTC_OK;

    if ((in->gap_us == 0U) || (in->held_blocks != 0U)) {
        remarks |= GTC_HELD;
    }
    if (FN(is_lost)(in, FN(guard)(state, channel)) != 0) {
        remarks |= GTC_CHANNEL_LOST;
    }
    if ((in->clamped & CLAMPED_MEAN) != 0U) {
        remarks |= GTC_CLAMPED;
    }
    effect->terms_known = (remarks == GTC_OK) ? (effect->terms_known | bit) : (effect->terms_known & ~bit);
    effect->remarks |= remarks;
    if ((in->gap_us == 0U) && (fallback_model != 0U)) {
        effect->added = FN(add)(effect->added, FN(fallback_model)(state->table, fallback_model, effect));
        return 0;
    }
    *mean = in->mean;
    return 1;
}

/* Adds the effect of a channel's mean. Where that is the edge of its range, the sensor may be at fault as well as the
 * supply: the effect may be wrong by what it is beyond that which the term adds without a reading. */
static void FN(add_effect)(const STATE *state, uint_least32_t i, EFFECT *effect, WIDE added)
{
    const gtc_word_t *const term = FN(term_of)(state->table, i);
    const uint_least32_t fallback_model = FN(fallback_model_of)(term);

    effect->added = FN(add)(effect->added, added);
    if ((state->input[FN(channel_of)(term)].clamped & CLAMPED_MEAN) != 0U) {
        const WIDE usual = (fallback_model != 0U) ? FN(fallback_model)(state->table, fallback_model, effect) : NUM_ZERO;
        const WIDE beyond = FN(diff)(added, usual);

        effect->edge_effect = (NUM)FN(factor)(FN(add)(effect->edge_effect, (beyond < NUM_ZERO) ? -beyond : beyond));
    }
}

/* Linear. Parameters: slope; reference. Adds slope (mean - reference). */
static void FN(auxiliary_apply)(const STATE *state, uint_least32_t i, NUM x, EFFECT *effect)
{
    const NUM slope = FN(parameter)(state, i, AUXILIARY_SLOPE);
    const NUM reference = FN(parameter)(state, i, AUXILIARY_REFERENCE);
    NUM mean = NUM_ZERO;

    (void)x;
    if (FN(has_mean)(state, i, effect, &mean) != 0) {
        FN(add_effect)(state, i, effect, FN(scaled_difference)(mean, reference, slope));
    }
}

const struct FN(term_code) FN(term_auxiliary) = {
    0U, FN(nothing), FN(nothing), FN(auxiliary_apply),
};

/* ---- a line and two Gaussians in the block mean of an auxiliary channel
 *
 * Parameters: slope; gain, sqrt(log2 e) / width, times 8 in float32; reference, the first center; first weight; second
 * center; second weight. Adds slope (mean - reference) + sum of weight exp(-((mean - center) / width)^2). */

static void FN(curve_apply)(const STATE *state, uint_least32_t i, NUM x, EFFECT *effect)
{
    const gtc_word_t *const term = FN(term_of)(state->table, i);
    NUM mean = NUM_ZERO;
    WIDE sum;

    (void)x;
    if (FN(has_mean)(state, i, effect, &mean) != 0) {
        mean = (NUM)FN(factor)(mean);
        sum = FN(scaled_difference)(mean, ELEMENT(term[TERM_PARAMETERS + CURVE_REFERENCE]),
                                    ELEMENT(term[TERM_PARAMETERS + CURVE_SLOPE]));
        sum = FN(add)(sum, FN(gaussians_of_channel)(mean, &term[TERM_PARAMETERS + CURVE_GAIN]));
        FN(add_effect)(state, i, effect, sum);
    }
}

const struct FN(term_code) FN(term_curve) = {
    0U, FN(nothing), FN(nothing), FN(curve_apply),
};

/* ---- a line in the temperature times a line in the block mean of an auxiliary channel
 *
 * Parameters: slope; reference; growth, by which the slope grows with each C; reference of T. Adds
 * (slope + growth (T - reference of T)) (mean - reference). */

static void FN(product_apply)(const STATE *state, uint_least32_t i, NUM x, EFFECT *effect)
{
    const NUM reference = FN(parameter)(state, i, PRODUCT_REFERENCE);
    const NUM slope = FN(over_temp)(FN(parameter)(state, i, PRODUCT_SLOPE), FN(parameter)(state, i, PRODUCT_GROWTH), x,
                                    FN(parameter)(state, i, PRODUCT_REFERENCE_TEMP));
    NUM mean = NUM_ZERO;

    if (FN(has_mean)(state, i, effect, &mean) != 0) {
        FN(add_effect)(state, i, effect, FN(scaled_difference)(mean, reference, slope));
    }
}

const struct FN(term_code) FN(term_product) = {
    0U, FN(nothing), FN(nothing), FN(product_apply),
};
