/* gtc_front.inl - samples in, correction in force out.
 *
 * docs/numerics.md, section 1, gives every step. From a sample to a correction:
 *
 *   sample()       puts the call on a grid of periods; slots without a call are passed as missed
 *     take_slot()    judges the readings: accepted, held, or the start of a new series
 *     close_block()  at the end of a block: means -> slope window -> terms -> map -> correction in force
 *   bias()         the correction in force
 *
 * SPDX-License-Identifier: MIT
 */

#if GTC_WITH_TERMS
/* Blocks since the start are counted no further than this: all warm-up is over then. */
#define MAX_ELAPSED 0xFFFFFFUL
#endif

/* A float counts up to here exactly, and sums of words keep to 64 bits. */
#define MAX_SAMPLES_PER_BLOCK 0x100000UL

/* The samples of a block may be shorter or longer than the block by one of so many parts of it. */
#define PERIOD_PARTS 1000U

/* The longest time that is counted, microseconds. What was so long ago is forgotten. */
#define MAX_US 0xFFFFFFFFUL

/* What becomes of a reading. */
#define READING_HELD 0
#define READING_ACCEPTED 1
#define READING_NEW_START 2

/* ---- the correction ------------------------------------------------------------------------------ */

/* Puts a correction in force, with the shift of the constant where it was moved: the only place that writes one, but
 * for init. */
static void put_in_force(STATE *state, const TABLE *table, WIDE bias, int_least32_t status)
{
    int_least32_t remarks = status;
    NUM limited = within_authority(table, bias, &remarks);

#if GTC_WITH_REZERO
    state->unshifted = limited;
    if ((state->shift > NUM_ZERO) || (state->shift < NUM_ZERO)) {
        limited = within_authority(table, add(limited, state->shift), &remarks);
    }
#endif
    state->bias = limited;
    state->status = remarks;
}

#if GTC_WITH_TERMS
/* The temperature as the terms see it, which is as the map does: within the envelope. */
static NUM within_envelope(const TABLE *table, NUM temp, int_least32_t *remarks)
{
    return saturate(temp, MEMBER(table->envelope[0]), MEMBER(table->envelope[1]), remarks);
}
#endif

#if GTC_WITH_TERMS
/* What all terms do to the map's inputs, and add; `remarks` of the effect are set before. */
static void apply_terms(STATE *state, const TABLE *table, NUM temp, NUM slope, EFFECT *effect)
{
    NUM within;
    uint_least32_t i;

    effect->temp = temp;
    effect->slope = slope;
    effect->added = NUM_ZERO;
#if GTC_WITH_UNCERTAINTY
    effect->terms_known = state->uncertainty.terms_known;
    effect->edge_effect = NUM_ZERO;
#endif
    within = within_envelope(table, temp, &effect->remarks);
    for (i = 0U; i < table->n_terms; i++) {
        apply_term(state, table, i, within, effect);
    }
#if GTC_WITH_UNCERTAINTY
    state->uncertainty.terms_known = effect->terms_known;
    state->uncertainty.edge_effect = effect->edge_effect;
#endif
}
#endif

/* Makes the correction for an input and puts it in force. Where something wrote over the state, so that the input is no
 * number, that is the fallback. */
static void make_correction(STATE *state, const TABLE *table, NUM temp, NUM slope, int_least32_t remarks)
{
    NUM of_map = NUM_ZERO;
#if GTC_WITH_TERMS
    EFFECT effect;
    WIDE bias;
    int status;

    effect.remarks = remarks;
    apply_terms(state, table, temp, slope, &effect);
    status = map_value(table, effect.temp, effect.slope, &of_map);
#if GTC_WITH_UNCERTAINTY
    uncertainty_input(state, table, effect.temp, effect.slope, slope, effect.remarks);
#endif
    bias = of_map;
    if (table->n_terms != 0U) {
        bias = add(bias, saturate(effect.added, MEMBER(table->effect[0]), MEMBER(table->effect[1]), &effect.remarks));
    }
    if (status < 0) {
        put_in_force(state, table, MEMBER(table->fallback), GTC_HELD | GTC_FALLBACK);
    } else {
        put_in_force(state, table, bias, status | (int)effect.remarks);
    }
#else
    const int status = map_value(table, temp, slope, &of_map);

#if GTC_WITH_UNCERTAINTY
    uncertainty_input(state, table, temp, slope, slope, remarks);
#endif
    if (status < 0) {
        put_in_force(state, table, MEMBER(table->fallback), GTC_HELD | GTC_FALLBACK);
    } else {
        put_in_force(state, table, of_map, status | (int)remarks);
    }
#endif
}

#if GTC_WITH_RETAINED
/* A term that was never begun. */
static void reset_term(STATE *state, uint_least32_t i)
{
    state->term[i][0] = missing_number();
    state->term[i][1] = missing_number();
}

static void reset_terms(STATE *state)
{
    uint_least32_t i;

    for (i = 0U; i < (uint_least32_t)GTC_MAX_TERMS; i++) {
        reset_term(state, i);
    }
}
#endif

#if GTC_WITH_RETAINED || (GTC_WITH_TERMS && GTC_WITH_UNCERTAINTY)
/* The terms begin at x, the first temperature. */
static void begin_terms(STATE *state, const TABLE *table, NUM x)
{
    int_least32_t ignored = GTC_OK;
    const NUM within = within_envelope(table, x, &ignored);
#if GTC_WITH_RETAINED
    uint_least32_t i;
#endif

#if GTC_WITH_UNCERTAINTY
    uncertainty_terms_begin(state, table, within);
#endif
#if GTC_WITH_RETAINED
    for (i = 0U; i < table->n_terms; i++) {
        begin_term(state, table, i, within);
    }
#endif
}

/* Lets every term take note that a block ends, of this temperature. */
static void step_terms(STATE *state, const TABLE *table, NUM temp)
{
    int_least32_t ignored = GTC_OK;
    const NUM within = within_envelope(table, temp, &ignored);
#if GTC_WITH_RETAINED
    uint_least32_t i;

    for (i = 0U; i < table->n_terms; i++) {
        step_term(state, table, i, within);
    }
#endif
#if GTC_WITH_UNCERTAINTY
    uncertainty_step(state, within);
#endif
}
#endif

/* Begins again at x: slope 0, nothing in the window. */
static void restart(STATE *state, const TABLE *table, NUM x)
{
    state->filled = 0U;
    state->window_valid = 0U;
#if GTC_WITH_UNCERTAINTY
    state->uncertainty.first_temp = x;
    state->uncertainty.missing = 0U;
#endif
#if GTC_WITH_RETAINED || (GTC_WITH_TERMS && GTC_WITH_UNCERTAINTY)
    begin_terms(state, table, x);
#endif
    make_correction(state, table, x, NUM_ZERO, GTC_WARMING);
}

/* ---- the window ---------------------------------------------------------------------------------- */

/* Moves the window on by one block: its mean, or a hole. */
static void push_block(STATE *state, const TABLE *table, uint_least32_t is_valid)
{
    uint_least32_t age;

    for (age = table->slope_blocks - 1U; age > 0U; age--) {
        state->window[age] = state->window[age - 1U];
    }
    state->window[0] = state->input[0].mean;
    state->window_valid = (state->window_valid << 1) | is_valid;
    if (state->filled < table->slope_blocks) {
        state->filled++;
    }
}

/* Slope of the temperature for each block: the least-squares line through the block means of the window.
 *
 * window[age] is the mean of the block that ended `age` blocks before the newest; bit `age` of window_valid is 0
 * where that block had too few readings (a hole). The newest, age 0, is valid here: close_block() has just pushed
 * it.
 *
 * With k = blocks - 1 - age, which grows with time, d = mean - newest mean, and every sum over the n valid blocks
 * only:
 *
 *     slope = (n * sum(k d) - sum(k) * sum(d)) / (n * sum(k k) - sum(k)^2)
 *
 * The denominator is a whole number, at least 1 for two valid blocks. The order of the sums, oldest first, is part
 * of the result.
 *
 * Returns GTC_OK, or GTC_WARMING with slope 0 until the window has been filled once, and while fewer than half of
 * its blocks, or fewer than two, are valid. */
static int_least32_t window_slope(const STATE *state, const TABLE *table, NUM *slope)
{
    const uint_least32_t blocks = table->slope_blocks;
    const uint_least32_t half = (blocks + 1U) / 2U;
    const NUM newest = state->window[0];
    uint_least32_t n = 0U;
    uint_least32_t sum_k = 0U;
    uint_least32_t sum_kk = 0U;
    WIDE sum_d = NUM_ZERO;
    WIDE sum_kd = NUM_ZERO;
    WIDE n_sum_kd;
    WIDE sum_k_sum_d;
    uint_least32_t k;

    *slope = NUM_ZERO;
    if (state->filled < blocks) {
        return GTC_WARMING;
    }
    for (k = 0U; k < blocks; k++) {
        const uint_least32_t age = (blocks - 1U) - k;

        if (((state->window_valid >> age) & 1U) != 0U) {
            const WIDE d = diff(state->window[age], newest);

            sum_d = add(sum_d, d);
            sum_kd = add(sum_kd, scaled(k, d));
            n++;
            sum_k += k;
            sum_kk += k * k;
        }
    }
    if ((n < 2U) || (n < half)) {
        return GTC_WARMING;
    }
    n_sum_kd = scaled(n, sum_kd);
    sum_k_sum_d = scaled(sum_k, sum_d);
    *slope = NARROW(rounded_quotient(diff(n_sum_kd, sum_k_sum_d), (n * sum_kk) - (sum_k * sum_k)));
    return GTC_OK;
}

/* ---- what is accepted ---------------------------------------------------------------------------- */

/* The sum of two times, microseconds, as far as can be counted. */
static uint_least32_t add_us(uint_least32_t a, uint_least32_t b)
{
    const uint_least32_t sum = a + b;

    return (sum >= a) ? sum : MAX_US;
}

/* Samples of `us` microseconds passed in which nothing was accepted. */
static void add_gap(INPUT *in, uint_least32_t us)
{
    if (in->next_gap_us != 0U) {
        in->next_gap_us = add_us(in->next_gap_us, us);
    }
    in->series_us = add_us(in->series_us, us);
    in->candidate_us = add_us(in->candidate_us, us);
}

/* 1 if x has been the same for too long. */
static int is_stuck(INPUT *in, const gtc_word_t *guard, NUM x, uint_least32_t period_us)
{
    const uint_least32_t bits = bits_of(x);
    const uint_least32_t most = guard[GUARD_STUCK].bits;

    if (bits != in->received) {
        in->received = bits;
        in->same_us = 0U;
    } else if (in->same_us < most) {
        in->same_us = add_us(in->same_us, period_us);
    } else {
        /* counted far enough */
    }
    return ((most != 0U) && (in->same_us >= most)) ? 1 : 0;
}

/* 1 if x follows the last accepted reading. The change allowed in one period is kept in the state, which saves a product
 * in each sample. */
static int follows(const STATE *state, const INPUT *in, const gtc_word_t *guard, NUM x)
{
    int is_close = 0;

    if (in->next_gap_us == state->period_us) {
        is_close = is_near(x, in->last, in->max_change);
    } else if (in->next_gap_us != 0U) {
        is_close = is_near(x, in->last, largest_change(guard, in->next_gap_us));
    } else {
        /* there is none */
    }
    return is_close;
}

/* 1 if x agrees with the candidate before it: as near as an accepted reading must be to the last one, and no later
 * than a channel is held. */
static int agrees(const TABLE *table, const INPUT *in, const gtc_word_t *guard, NUM x)
{
    const uint_least32_t us = in->candidate_us;
    const uint_least32_t blocks = us / table->block_us;
    int is_close = 0;

    if ((us < MAX_US) && (blocks <= guard[GUARD_MISSING].bits)) {
        is_close = is_near(x, in->candidate, largest_change(guard, us));
    }
    return is_close;
}

/* Decides on a reading that does not follow the last accepted one. Such readings make a series while each agrees with
 * the one before it. One that is at least the third of its series, and comes at least GUARD_AGREE after the first, is a
 * new start; how many polls were missed in between does not matter. Where GUARD_AGREE is 0, any reading is.
 *
 * The first reading of a series sets both of its times to 0, and from then on they grow alike; so series_us is larger
 * than candidate_us from the second reading on. Returns READING_HELD or READING_NEW_START. */
static int confirm_candidate(const TABLE *table, INPUT *in, const gtc_word_t *guard, NUM x)
{
    const uint_least32_t least_us = guard[GUARD_AGREE].bits;
    int verdict = READING_HELD;

    if (least_us == 0U) {
        verdict = READING_NEW_START;
    }
    if (!agrees(table, in, guard, x)) {
        in->series_us = 0U;
    } else if ((in->series_us > in->candidate_us) && (in->series_us >= least_us)) {
        verdict = READING_NEW_START;
    } else {
        /* too few, or not for long enough */
    }
    in->candidate = x;
    in->candidate_us = 0U;
    return verdict;
}

/* Forgets the candidate, so that the next reading that does not follow begins a series. */
static void forget_candidate(INPUT *in)
{
    in->candidate_us = MAX_US;
}

/* Takes x into the running block. */
static void accept_reading(INPUT *in, NUM x, uint_least32_t period_us)
{
    if (in->valid == 0U) {
        in->base = x;
        in->sum = NUM_ZERO;
    }
    in->sum = add(in->sum, diff(x, in->base));
    in->valid++;
    in->last = x;
    in->next_gap_us = period_us;
    forget_candidate(in);
}

/* One reading x within its range: held, accepted, or accepted as a new start, which is the mean until a block ends. */
static int judge_reading(const STATE *state, const TABLE *table, INPUT *in, const gtc_word_t *guard, NUM x)
{
    int verdict = READING_ACCEPTED;

    if (!follows(state, in, guard, x)) {
        verdict = confirm_candidate(table, in, guard, x);
    }
    if (verdict == READING_HELD) {
        add_gap(in, state->period_us);
        return READING_HELD;
    }
    if (verdict == READING_NEW_START) {
        in->valid = 0U;
        in->held_blocks = 0U;
        in->mean = x;
#if GTC_WITH_CHANNELS
        in->clamped = 0U;
#endif
    }
    accept_reading(in, x, state->period_us);
    return verdict;
}

/* A reading x that is missing or cannot be true. The latter speaks against the candidate before it. */
static void miss_reading(INPUT *in, NUM x, uint_least32_t us)
{
    if (is_missing(x) == 0) {
        forget_candidate(in);
    }
    add_gap(in, us);
}

#if GTC_WITH_RETAINED
/* 1 before the first reading, and after a gap for which nothing is remembered. */
static int has_no_past(const INPUT *in)
{
    return (in->next_gap_us == 0U) ? 1 : 0;
}
#endif

/* One temperature. Returns GTC_OK or GTC_HELD. */
static int take_temperature(STATE *state, const TABLE *table, NUM x)
{
    INPUT *const in = &state->input[0];
    const gtc_word_t *const guard = table->guards;
#if GTC_WITH_RETAINED
    const int nothing_before = has_no_past(in);
#endif
    int verdict = READING_HELD;

    if (is_missing(x) || is_stuck(in, guard, x, state->period_us)
        || (!((x >= ELEMENT(guard[GUARD_LOW])) && (x <= ELEMENT(guard[GUARD_HIGH]))))) {
        miss_reading(in, x, state->period_us);
    } else {
        verdict = judge_reading(state, table, in, guard, x);
        if (verdict == READING_NEW_START) {
#if GTC_WITH_RETAINED
            if (nothing_before == 0) {
                reset_terms(state); /* what a first start finds of a saved state goes on */
            }
#endif
            restart(state, table, x);
        }
    }
    return (verdict == READING_HELD) ? GTC_HELD : GTC_OK;
}

#if GTC_WITH_CHANNELS
/* One reading of an auxiliary channel: beyond its range the edge. */
static void take_channel(STATE *state, const TABLE *table, uint_least32_t channel, NUM reading)
{
    INPUT *const in = &state->input[channel];
    const gtc_word_t *const guard = guard_of(table, channel);
    int_least32_t remarks = GTC_OK;
    NUM x;
    int verdict;

    if (is_missing(reading) || is_stuck(in, guard, reading, state->period_us)) {
        miss_reading(in, reading, state->period_us);
        return;
    }
    x = saturate(reading, ELEMENT(guard[GUARD_LOW]), ELEMENT(guard[GUARD_HIGH]), &remarks);
    verdict = judge_reading(state, table, in, guard, x);
    if ((verdict != READING_HELD) && (remarks != GTC_OK)) {
        in->clamped |= (verdict == READING_NEW_START) ? (CLAMPED_NOW | CLAMPED_MEAN) : CLAMPED_NOW;
    }
}
#endif

/* ---- blocks -------------------------------------------------------------------------------------- */

/* Two readings make a mean: they agree, as each was accepted after the one before it. One does where a block has one or
 * two samples. How far the mean may be from that of the whole block, its uncertainty says. */
static int has_enough_readings(const STATE *state, const INPUT *in)
{
    return ((in->valid >= 2U) || ((2U * in->valid) >= state->samples_per_block)) ? 1 : 0;
}

/* The running block of a channel ends. Returns 1 if it has enough readings; then the mean is theirs. When it is
 * lost its last reading is forgotten, so that it must agree with itself before it is accepted again. */
static int end_block(const STATE *state, INPUT *in, const gtc_word_t *guard)
{
    const int is_valid = has_enough_readings(state, in);

    if (is_valid != 0) {
        in->mean = mean_of(in->base, in->sum, in->valid);
        in->held_blocks = 0U;
#if GTC_WITH_CHANNELS
        if ((in->clamped & CLAMPED_NOW) != 0U) {
            in->clamped = CLAMPED_MEAN;
        } else {
            in->clamped = 0U;
        }
#endif
    } else {
#if GTC_WITH_CHANNELS
        in->clamped &= CLAMPED_MEAN;
#endif
        if (is_lost(in, guard) == 0) {
            in->held_blocks++;
        }
        if (is_lost(in, guard) != 0) {
            in->next_gap_us = 0U;
        }
    }
    in->valid = 0U;
    return is_valid;
}

#if GTC_WITH_CHANNELS
static void close_channels(STATE *state, const TABLE *table)
{
    uint_least32_t c;

    for (c = 1U; c < table->n_channels; c++) {
        INPUT *const in = &state->input[c];
        const gtc_word_t *const guard = guard_of(table, c);

        if ((!end_block(state, in, guard)) && is_lost(in, guard)) {
            in->mean = ELEMENT(guard[GUARD_FALLBACK]);
            in->clamped = 0U;
        }
    }
}
#endif

/* A block with too few valid samples: the last correction stays, but not for ever. */
static void close_without_mean(STATE *state, const TABLE *table)
{
    if (is_lost(&state->input[0], table->guards) != 0) {
#if GTC_WITH_RETAINED
        reset_terms(state);
#endif
        put_in_force(state, table, MEMBER(table->fallback), GTC_HELD | GTC_FALLBACK);
    } else if (state->input[0].next_gap_us != 0U) {
        push_block(state, table, 0U);
#if GTC_WITH_RETAINED || (GTC_WITH_TERMS && GTC_WITH_UNCERTAINTY)
        step_terms(state, table, state->input[0].mean);
#endif
        state->status |= GTC_HELD;
    } else {
        /* nothing was ever accepted: no correction yet */
    }
}

#if GTC_WITH_TERMS
/* Blocks that have passed since the start. */
static void count_blocks(STATE *state, uint_least32_t blocks)
{
    state->elapsed = ((MAX_ELAPSED - state->elapsed) > blocks) ? (state->elapsed + blocks) : MAX_ELAPSED;
}
#endif

/* The running block is complete: its mean and slope make the next correction, which is in force for the next block:
 * so terms and map see where the slope brings the mean by then. */
static void close_block(STATE *state, const TABLE *table)
{
#if GTC_WITH_UNCERTAINTY
    const uint_least32_t missing = state->samples_per_block - state->input[0].valid;

#endif
#if GTC_WITH_TERMS
    count_blocks(state, 1U);
#endif
#if GTC_WITH_CHANNELS
    close_channels(state, table);
#endif
    if (end_block(state, &state->input[0], table->guards) != 0) {
        NUM temp;
        NUM slope;
        int_least32_t remarks;

#if GTC_WITH_UNCERTAINTY
        state->uncertainty.missing = missing;
#endif
        push_block(state, table, 1U);
        remarks = window_slope(state, table, &slope);
        temp = ahead(state->input[0].mean, slope, table->lead_blocks);
#if GTC_WITH_RETAINED || (GTC_WITH_TERMS && GTC_WITH_UNCERTAINTY)
        step_terms(state, table, temp);
#endif
        make_correction(state, table, temp, slope, remarks);
    } else {
        close_without_mean(state, table);
    }
    state->position = 0U;
}

/* ---- start --------------------------------------------------------------------------------------- */

/* 1 if this runtime has what the table needs, and a state has room for it. The words of the table are those that
 * gtc_<n>_check() or gtc_<n>_open() found sound. */
static int fits_runtime(const TABLE *table)
{
    return ((table->layout == GTC_TABLE_LAYOUT) && ((table->parts & ~GTC_PARTS) == 0U)
            && (table->bias_frac_bits == FRAC_BITS)
            && (table->slope_blocks <= (uint_least32_t)GTC_MAX_SLOPE_BLOCKS)
            && (table->n_terms <= (uint_least32_t)GTC_MAX_TERMS)
            && (table->n_channels <= GTC_MAX_CHANNELS)) ? 1 : 0;
}

/* Samples in a block of the table, if so many of this period make one to a thousandth of it; else 0. */
static uint_least32_t samples_in_block(const TABLE *table, uint_least32_t period_us)
{
    const uint_least32_t rest = table->block_us % period_us;
    uint_least32_t n = table->block_us / period_us;
    uint_least32_t off = rest;

    if (rest >= (period_us - rest)) {
        n++;
        off = period_us - rest;
    }
    return ((n <= MAX_SAMPLES_PER_BLOCK) && (off <= (table->block_us / PERIOD_PARTS))) ? n : 0U;
}

/* GTC_OK, or why a state cannot be started. */
static int check_start(const STATE *state, const TABLE *table, uint_least32_t period_us)
{
    int status = GTC_OK;

    if ((state == NULL) || (table == NULL) || (period_us == 0U)) {
        status = GTC_E_ARG;
    } else if (!fits_runtime(table)) {
        status = GTC_E_LAYOUT;
    } else if (samples_in_block(table, period_us) == 0U) {
        status = GTC_E_PERIOD;
    } else {
        /* it can */
    }
    return status;
}

/* A channel that has not seen a reading yet. */
static void clear_input(INPUT *in)
{
    in->next_gap_us = 0U;
    in->series_us = MAX_US;
    in->candidate_us = MAX_US;
    in->same_us = 0U;
    in->received = NUM_MISSING_BITS;
    in->valid = 0U;
    in->held_blocks = 0U;
#if GTC_WITH_CHANNELS
    in->clamped = 0U;
#endif
    in->last = NUM_ZERO;
    in->candidate = NUM_ZERO;
    in->base = NUM_ZERO;
    in->sum = NUM_ZERO;
    in->mean = NUM_ZERO;
}

/* A front end that has not seen a sample yet. */
static void clear_front_end(STATE *state)
{
    uint_least32_t i;

    state->position = 0U;
    state->filled = 0U;
    state->window_valid = 0U;
    state->status = GTC_HELD;
    state->bias = NUM_ZERO;
    state->phase_us = 0U;
    state->repeated = 0U;
#if GTC_WITH_TERMS
    state->elapsed = 0U;
    state->off_blocks = 0U;
#endif
#if GTC_WITH_UNCERTAINTY
    uncertainty_clear(state);
#endif
    for (i = 0U; i < (uint_least32_t)GTC_MAX_SLOPE_BLOCKS; i++) {
        state->window[i] = NUM_ZERO;
    }
    for (i = 0U; i < GTC_MAX_CHANNELS; i++) {
        clear_input(&state->input[i]);
    }
}

#if GTC_WITH_CHANNELS
/* Until its first reading the fallback is the mean of an auxiliary channel. */
static void set_fallback_means(STATE *state, const TABLE *table)
{
    uint_least32_t c;

    for (c = 1U; c < table->n_channels; c++) {
        state->input[c].mean = ELEMENT(guard_of(table, c)[GUARD_FALLBACK]);
    }
}
#endif

/* All of a state that can be started. */
static void start_state(STATE *state, const TABLE *table, uint_least32_t period_us)
{
    uint_least32_t i;

    state->table_crc = table->crc;
    state->period_us = period_us;
    state->samples_per_block = samples_in_block(table, period_us);
    clear_front_end(state);
#if GTC_WITH_CHANNELS
    set_fallback_means(state, table);
#endif
#if GTC_WITH_REZERO
    rezero_clear(state, table);
#endif
#if GTC_WITH_RETAINED
    reset_terms(state);
#endif
    for (i = 0U; i < GTC_MAX_CHANNELS; i++) {
        state->input[i].max_change = CHANGE_ZERO;
        if (i < table->n_channels) {
            state->input[i].max_change = largest_change(guard_of(table, i), period_us);
        }
    }
}

int PUBLIC(init)(STATE *state, const TABLE *table, uint_least32_t period_us)
{
    const int status = check_start(state, table, period_us);

    if (status == GTC_OK) {
        start_state(state, table, period_us);
    }
    return status;
}

/* GTC_OK for a state that was started with this table, else GTC_E_ARG or GTC_E_ID. One that was overwritten may have
 * times that would divide by nothing, or that never pass: GTC_E_ARG. */
static int check_state(const STATE *state, const TABLE *table)
{
    int status = GTC_OK;

    if ((state == NULL) || (table == NULL) || (state->samples_per_block == 0U) || (state->period_us == 0U)) {
        status = GTC_E_ARG;
    } else if (state->table_crc != table->crc) {
        status = GTC_E_ID;
    } else {
        /* it was */
    }
    return status;
}

/* ---- the grid of periods ------------------------------------------------------------------------- */

/* The next sample of the grid. */
static int take_slot(STATE *state, const TABLE *table, const NUM *channels)
{
    int remark;
#if GTC_WITH_CHANNELS
    uint_least32_t c;
#endif

    if (state->position >= state->samples_per_block) {
        close_block(state, table);
    }
    state->position++;
#if GTC_WITH_CHANNELS
    for (c = 1U; c < table->n_channels; c++) {
        take_channel(state, table, c, channels[c]);
    }
#endif
    remark = take_temperature(state, table, channels[0]);
    return (int)state->status | remark;
}

#if GTC_WITH_TIME
/* A sample may come after one that was taken up to so much later (268 s), microseconds. */
#define LATEST_US 0x10000000UL

/* 1 if every channel has been missing for so long that only time passes any more. */
static int all_lost(const STATE *state, const TABLE *table)
{
    int lost = 1;
    uint_least32_t c;

    for (c = 0U; c < table->n_channels; c++) {
        lost &= is_lost(&state->input[c], guard_of(table, c));
    }
    return lost;
}

/* `samples` samples passed in which nothing came. */
static void miss_slots(STATE *state, const TABLE *table, uint_least32_t samples)
{
    uint_least32_t c;

    for (c = 0U; c < table->n_channels; c++) {
        add_gap(&state->input[c], samples * state->period_us);
    }
}

/* Whole blocks in which nothing can change but the times. Returns the samples that are left, at least one. */
static uint_least32_t skip_lost_blocks(STATE *state, const TABLE *table, uint_least32_t samples)
{
    const uint_least32_t blocks = (samples - 1U) / state->samples_per_block;
    const uint_least32_t skipped = blocks * state->samples_per_block;

#if GTC_WITH_TERMS
    count_blocks(state, blocks);
#endif
    miss_slots(state, table, skipped);
    return samples - skipped;
}

/* `count` samples of the grid in which nothing came, the same bits as in `count` calls. */
static int pass_slots(STATE *state, const TABLE *table, uint_least32_t count)
{
    uint_least32_t rest = count;

    while (rest > 0U) {
        uint_least32_t step;

        if (state->position >= state->samples_per_block) {
            close_block(state, table);
        }
        if (all_lost(state, table) != 0) {
            rest = skip_lost_blocks(state, table, rest);
        }
        step = state->samples_per_block - state->position;
        step = (step < rest) ? step : rest;
        miss_slots(state, table, step);
        state->position += step;
        rest -= step;
    }
    return (int)state->status | GTC_HELD;
}

/* Sample periods in a time, rounded. Most calls come after one period, which saves a division. */
static uint_least32_t slots_in(const STATE *state, uint_least32_t us)
{
    uint_least32_t n = 1U;

    if (us != state->period_us) {
        const uint_least32_t rest = us % state->period_us;

        n = (us / state->period_us) + ((rest >= (state->period_us - rest)) ? 1U : 0U);
    }
    return n;
}

/* A call whose slot is already taken. One or a few come of jitter, or of a caller that is faster than its period.
 * After as many in a row as make a block the clock has stopped: each of them is a period in which nothing came. */
static int ignore_call(STATE *state, const TABLE *table)
{
    if (state->repeated < state->samples_per_block) {
        state->repeated++;
        return (int)state->status | GTC_HELD;
    }
    return pass_slots(state, table, 1U);
}

/* Times are put on a grid of sample periods, from the start on, so that no error of them adds up. */
int PUBLIC(sample)(STATE *state, const TABLE *table, uint_least32_t elapsed_us, const NUM *channels)
{
    const int started = check_state(state, table);
    uint_least32_t since_slot_us;
    uint_least32_t slots;

    if (started != GTC_OK) {
        return started;
    }
    since_slot_us = state->phase_us + elapsed_us;
    slots = slots_in(state, since_slot_us);
    /* Less than half a period after the last slot, or before it: the time is counted modulo 2^32. */
    if ((slots == 0U) || (since_slot_us > (MAX_US - LATEST_US))) {
        state->phase_us = since_slot_us;
        return ignore_call(state, table);
    }
    state->repeated = 0U;
    state->phase_us = since_slot_us - (slots * state->period_us);
    if (channels == NULL) {
        return pass_slots(state, table, slots);
    }
    (void)pass_slots(state, table, slots - 1U);
    return take_slot(state, table, channels);
}
#else
/* Samples come each period. */
int PUBLIC(sample)(STATE *state, const TABLE *table, uint_least32_t elapsed_us, const NUM *channels)
{
    const int started = check_state(state, table);
    NUM nothing[GTC_MAX_CHANNELS];
    uint_least32_t c;

    if (started != GTC_OK) {
        return started;
    }
    if (elapsed_us != state->period_us) {
        return GTC_E_ARG;
    }
    if (channels != NULL) {
        return take_slot(state, table, channels);
    }
    for (c = 0U; c < GTC_MAX_CHANNELS; c++) {
        nothing[c] = missing_number();
    }
    return take_slot(state, table, nothing);
}
#endif

/* Limited once more, so that a state that was overwritten cannot leave the authority. */
int PUBLIC(bias)(const STATE *state, const TABLE *table, NUM *bias)
{
    const int started = (bias == NULL) ? GTC_E_ARG : check_state(state, table);
    int_least32_t remarks;

    if (started != GTC_OK) {
        return started;
    }
    remarks = state->status;
    *bias = within_authority(table, state->bias, &remarks);
    return (int)remarks;
}
