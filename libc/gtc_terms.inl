/* gtc_terms.inl - channels and their guards, and the kinds of extension terms.
 *
 * docs/numerics.md, section 8.
 *
 * SPDX-License-Identifier: MIT
 */

static const gtc_word_t *guard_of(const TABLE *table, uint_least32_t channel)
{
    return &table->guards[channel * GTC_GUARD_WORDS];
}

/* A channel has been missing for so long that its fallback stands for it. */
static int is_lost(const INPUT *in, const gtc_word_t *guard)
{
    return (in->held_blocks > guard[GUARD_MISSING].bits) ? 1 : 0;
}

#if GTC_WITH_TERMS
/* What terms make of the inputs and add to the bias. */
typedef struct {
    NUM temp;
    NUM slope;
    WIDE added;
    int_least32_t remarks;
#if GTC_WITH_UNCERTAINTY
    uint_least32_t terms_known; /* as of an uncertainty */
    NUM edge_effect;            /* as of an uncertainty */
#endif
} EFFECT;

static const gtc_word_t *term_of(const TABLE *table, uint_least32_t i)
{
    return &table->terms[i * GTC_TERM_WORDS];
}

#if GTC_WITH_CHANNELS || GTC_WITH_IMAGE
/* The channel that a term reads, and the number of its fallback model among the networks, from 1 on; 0: it has none. */
static uint_least32_t channel_of(const gtc_word_t *term)
{
    return term[TERM_CHANNEL].bits & 0xFFFFU;
}

static uint_least32_t fallback_model_of(const gtc_word_t *term)
{
    return term[TERM_CHANNEL].bits >> 16;
}

#endif

#if GTC_WITH_MEMORY
/* ---- first-order memory: cavity_lag, thermal_gradient
 *
 * z <- z + gain (T - z) once a block. Parameters: gain; amplitude; rate, block / tau: where it is not 0
 * the map sees z and (T - z) rate instead of T and its slope. Adds amplitude (z - T). What no call can have
 * left in z (something else wrote there) would take long to follow, so z begins again at T. */

static void memory_follow(NUM z[2], NUM x, NUM gain)
{
    if ((z[0] >= -NUM_HOTTEST) && (z[0] <= NUM_HOTTEST)) {
        follow_memory(z, x, gain);
    } else {
        settle_memory(z, x);
    }
}

static void memory_begin(STATE *state, const TABLE *table, uint_least32_t i, NUM x)
{
    memory_follow(state->term[i], x, relaxed_share(parameter(table, i, MEMORY_GAIN), state->off_blocks));
}

static void memory_step(STATE *state, const TABLE *table, uint_least32_t i, NUM x)
{
    memory_follow(state->term[i], x, parameter(table, i, MEMORY_GAIN));
}

static void memory_apply(const STATE *state, const TABLE *table, uint_least32_t i, NUM x, EFFECT *effect)
{
    const NUM z = state->term[i][0];
    const NUM rate = parameter(table, i, MEMORY_RATE);

    if (bits_of(rate) != 0U) {
        effect->temp = z;
        effect->slope = slope_of(x, z, rate);
    }
    effect->added = add(effect->added, scaled_difference(z, x, parameter(table, i, MEMORY_AMPLITUDE)));
}
#endif

#if GTC_WITH_PLAY || GTC_WITH_PRODUCT
/* A parameter that goes with the temperature: value + growth (T - reference of T). */
static NUM over_temp(NUM value, NUM growth, NUM x, NUM middle)
{
    return FACTOR(add(value, scaled_difference(x, middle, growth)));
}
#endif

#if GTC_WITH_PLAY
/* ---- play operator: hysteresis ----------------------------------------------------------------------------------- */

static void play_step(STATE *state, const TABLE *table, uint_least32_t i, NUM x)
{
    const NUM width = parameter(table, i, PLAY_WIDTH);
    const NUM low = NARROW(diff(x, width));
    const NUM high = NARROW(add(x, width));
    NUM *const z = state->term[i];

    if (*z > high) {
        *z = high;
    } else if (*z >= low) {
        /* it does not move */
    } else {
        *z = low; /* what is no number, too */
    }
}

static void play_begin(STATE *state, const TABLE *table, uint_least32_t i, NUM x)
{
    if (is_missing(state->term[i][0]) != 0) {
        state->term[i][0] = x;
    }
    play_step(state, table, i, x);
}

static void play_apply(const STATE *state, const TABLE *table, uint_least32_t i, NUM x, EFFECT *effect)
{
    const NUM growth = parameter(table, i, PLAY_GROWTH);
    NUM amplitude = parameter(table, i, PLAY_AMPLITUDE);

    if (bits_of(growth) != 0U) {
        amplitude = over_temp(amplitude, growth, x, parameter(table, i, PLAY_REFERENCE_TEMP));
    }
    effect->added = add(effect->added, scaled_difference(state->term[i][0], x, amplitude));
}
#endif

#if GTC_WITH_WARM_UP
/* ---- exponential in the time since init: warm_up
 *
 * Parameters: gain, (block / tau) log2(e) times 64 in float32; amplitude. Adds amplitude exp(-t / tau). */

static void warm_up_apply(const STATE *state, const TABLE *table, uint_least32_t i, NUM x, EFFECT *effect)
{
    const NUM gain = parameter(table, i, WARM_UP_GAIN);
    const NUM amplitude = parameter(table, i, WARM_UP_AMPLITUDE);

    (void)x;
    effect->added = add(effect->added, warm_up_value(state->elapsed, gain, amplitude));
}
#endif

#if GTC_WITH_HARMONIC
/* ---- harmonic in the temperature: path_length_periodicity
 *
 * Parameters: frequency, 1 / period; phase in turns; amplitude. Adds amplitude cos(2 pi (T / period + phase)). */

static void harmonic_apply(const STATE *state, const TABLE *table, uint_least32_t i, NUM x, EFFECT *effect)
{
    const NUM frequency = parameter(table, i, HARMONIC_FREQUENCY);
    const NUM phase = parameter(table, i, HARMONIC_PHASE);
    const NUM amplitude = parameter(table, i, HARMONIC_AMPLITUDE);

    (void)state;
    effect->added = add(effect->added, harmonic_value(x, frequency, phase, amplitude));
}
#endif

#if GTC_WITH_CHANNELS
/* ---- functions of the block mean of an auxiliary channel
 *
 * The mean is that of the channel's last block with enough readings. While nothing of the channel is accepted a term
 * adds its fallback model; one that has none takes the guard's fallback for the mean. */

/* What a term adds on average where its channel is not known: its fallback model, at the inputs of the map. Where
 * they are none (something else wrote over the state) the map says so. */
static NUM fallback_value(const TABLE *table, uint_least32_t number, const EFFECT *effect)
{
    const gtc_word_t *network = table->networks;
    const gtc_word_t *center = table->centers;
    POINT in;
    uint_least32_t i;

    (void)locate(table, effect->temp, effect->slope, &in);
    for (i = 1U; i < number; i++) {
        center = &center[network[NETWORK_CENTERS].bits * GTC_CENTER_WORDS];
        network = &network[GTC_NETWORK_WORDS];
    }
    return network_value(table, network, center, &in);
}

#if GTC_WITH_UNCERTAINTY
/* Takes note whether the mean of a term's channel is new and within its range. */
static void note_known(EFFECT *effect, uint_least32_t i, int is_known)
{
    const uint_least32_t bit = (uint_least32_t)1U << i;

    effect->terms_known = (is_known != 0) ? (effect->terms_known | bit) : (effect->terms_known & ~bit);
}
#endif

/* Gets the mean of the channel of a term, with the remarks about it. Returns 0 if there is none: then the fallback
 * model was added. */
static int get_channel_mean(const STATE *state, const TABLE *table, uint_least32_t i, EFFECT *effect, NUM *mean)
{
    const gtc_word_t *const term = term_of(table, i);
    const uint_least32_t channel = channel_of(term);
    const uint_least32_t fallback_model = fallback_model_of(term);
    const INPUT *const in = &state->input[channel];
    int_least32_t remarks = GTC_OK;

    if ((in->next_gap_us == 0U) || (in->held_blocks != 0U)) {
        remarks |= GTC_HELD;
    }
    if (is_lost(in, guard_of(table, channel)) != 0) {
        remarks |= GTC_CHANNEL_LOST;
    }
    if ((in->clamped & CLAMPED_MEAN) != 0U) {
        remarks |= GTC_CLAMPED;
    }
#if GTC_WITH_UNCERTAINTY
    note_known(effect, i, (remarks == GTC_OK) ? 1 : 0);
#endif
    effect->remarks |= remarks;
    if ((in->next_gap_us == 0U) && (fallback_model != 0U)) {
        effect->added = add(effect->added, fallback_value(table, fallback_model, effect));
        return 0;
    }
    *mean = in->mean;
    return 1;
}

/* Adds the effect of a channel's mean. Where that is the edge of its range, the sensor may be at fault as well as the
 * supply: the effect may be wrong by what it is beyond that which the term adds without a reading. */
static void add_effect(const STATE *state, const TABLE *table, uint_least32_t i, EFFECT *effect, WIDE added)
{
#if GTC_WITH_UNCERTAINTY
    const gtc_word_t *const term = term_of(table, i);
    const uint_least32_t fallback_model = fallback_model_of(term);

    if ((state->input[channel_of(term)].clamped & CLAMPED_MEAN) != 0U) {
        const WIDE usual = (fallback_model != 0U) ? fallback_value(table, fallback_model, effect) : NUM_ZERO;
        const WIDE beyond = diff(added, usual);

        effect->edge_effect = FACTOR(add(effect->edge_effect, (beyond < NUM_ZERO) ? -beyond : beyond));
    }
#else
    (void)state;
    (void)table;
    (void)i;
#endif
    effect->added = add(effect->added, added);
}
#endif

#if GTC_WITH_AUXILIARY
/* Linear. Parameters: slope; reference. Adds slope (mean - reference). */
static void auxiliary_apply(const STATE *state, const TABLE *table, uint_least32_t i, NUM x, EFFECT *effect)
{
    const NUM slope = parameter(table, i, AUXILIARY_SLOPE);
    const NUM reference = parameter(table, i, AUXILIARY_REFERENCE);
    NUM mean = NUM_ZERO;

    (void)x;
    if (get_channel_mean(state, table, i, effect, &mean) != 0) {
        add_effect(state, table, i, effect, scaled_difference(mean, reference, slope));
    }
}
#endif

#if GTC_WITH_CURVE
/* ---- a line and two Gaussians in the block mean of an auxiliary channel
 *
 * Parameters: slope; gain, sqrt(log2 e) / width, times 8 in float32; reference, the first center; first weight; second
 * center; second weight. Adds slope (mean - reference) + sum of weight exp(-((mean - center) / width)^2). */

static void curve_apply(const STATE *state, const TABLE *table, uint_least32_t i, NUM x, EFFECT *effect)
{
    const gtc_word_t *const term = term_of(table, i);
    NUM reading = NUM_ZERO;

    (void)x;
    if (get_channel_mean(state, table, i, effect, &reading) != 0) {
        const NUM mean = FACTOR(reading);
        WIDE sum;

        sum = scaled_difference(mean, ELEMENT(term[TERM_PARAMETERS + CURVE_REFERENCE]),
                                    ELEMENT(term[TERM_PARAMETERS + CURVE_SLOPE]));
        sum = add(sum, gaussians_of_channel(mean, &term[TERM_PARAMETERS + CURVE_GAIN]));
        add_effect(state, table, i, effect, sum);
    }
}
#endif

#if GTC_WITH_PRODUCT
/* ---- a line in the temperature times a line in the block mean of an auxiliary channel
 *
 * Parameters: slope; reference; growth, by which the slope grows with each C; reference of T. Adds
 * (slope + growth (T - reference of T)) (mean - reference). */

static void product_apply(const STATE *state, const TABLE *table, uint_least32_t i, NUM x, EFFECT *effect)
{
    const NUM reference = parameter(table, i, PRODUCT_REFERENCE);
    const NUM slope = over_temp(parameter(table, i, PRODUCT_SLOPE), parameter(table, i, PRODUCT_GROWTH), x,
                                    parameter(table, i, PRODUCT_REFERENCE_TEMP));
    NUM mean = NUM_ZERO;

    if (get_channel_mean(state, table, i, effect, &mean) != 0) {
        add_effect(state, table, i, effect, scaled_difference(mean, reference, slope));
    }
}
#endif

/* ---- each kind by its number: another one does not pass gtc_<n>_check() or gtc_<n>_open() */

#if GTC_WITH_RETAINED
/* The first accepted temperature, x: a term with a memory begins there, or goes on from a saved state. */
static void begin_term(STATE *state, const TABLE *table, uint_least32_t i, NUM x)
{
    switch (term_of(table, i)[TERM_KIND].bits) {
#if GTC_WITH_MEMORY
    case GTC_TERM_MEMORY:
        memory_begin(state, table, i, x);
        break;
#endif
#if GTC_WITH_PLAY
    case GTC_TERM_PLAY:
        play_begin(state, table, i, x);
        break;
#endif
    default:
        /* it has no memory */
        break;
    }
}

/* A block ends, of mean temperature x. */
static void step_term(STATE *state, const TABLE *table, uint_least32_t i, NUM x)
{
    switch (term_of(table, i)[TERM_KIND].bits) {
#if GTC_WITH_MEMORY
    case GTC_TERM_MEMORY:
        memory_step(state, table, i, x);
        break;
#endif
#if GTC_WITH_PLAY
    case GTC_TERM_PLAY:
        play_step(state, table, i, x);
        break;
#endif
    default:
        /* it has no memory */
        break;
    }
}
#endif

/* Changes the inputs of the map, and adds to the bias, at temperature x. */
static void apply_term(const STATE *state, const TABLE *table, uint_least32_t i, NUM x, EFFECT *effect)
{
    switch (term_of(table, i)[TERM_KIND].bits) {
#if GTC_WITH_MEMORY
    case GTC_TERM_MEMORY:
        memory_apply(state, table, i, x, effect);
        break;
#endif
#if GTC_WITH_PLAY
    case GTC_TERM_PLAY:
        play_apply(state, table, i, x, effect);
        break;
#endif
#if GTC_WITH_WARM_UP
    case GTC_TERM_WARM_UP:
        warm_up_apply(state, table, i, x, effect);
        break;
#endif
#if GTC_WITH_HARMONIC
    case GTC_TERM_HARMONIC:
        harmonic_apply(state, table, i, x, effect);
        break;
#endif
#if GTC_WITH_AUXILIARY
    case GTC_TERM_AUXILIARY:
        auxiliary_apply(state, table, i, x, effect);
        break;
#endif
#if GTC_WITH_CURVE
    case GTC_TERM_CURVE:
        curve_apply(state, table, i, x, effect);
        break;
#endif
#if GTC_WITH_PRODUCT
    case GTC_TERM_PRODUCT:
        product_apply(state, table, i, x, effect);
        break;
#endif
    default:
        GTC_ASSERT(0);
        break;
    }
}

#if GTC_WITH_SAVE && GTC_WITH_RETAINED
/* 1 if a term has a memory that goes on over a time without power. */
static int is_retained_term(const TABLE *table, uint_least32_t i)
{
    uint_least32_t kind;

    if (i >= table->n_terms) {
        return 0;
    }
    kind = term_of(table, i)[TERM_KIND].bits;
    return ((kind == GTC_TERM_MEMORY) || (kind == GTC_TERM_PLAY)) ? 1 : 0;
}
#endif
#endif
