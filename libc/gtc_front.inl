/* gtc_front.inl - samples in, correction in force out, in the numbers included before.
 *
 * docs/numerics.md, section 1, says every step; gen/gyrotc/mirror is its mirror.
 *
 * SPDX-License-Identifier: MIT
 */

/* Blocks since the start are counted no further than this: all warm-up is over then. */
#define MAX_ELAPSED 0xFFFFFFUL

/* A float counts up to here exactly, and sums of words keep to 64 bits. */
#define MAX_SAMPLES_PER_BLOCK 0x100000UL

/* A block of samples may be off by this part of it. */
#define PERIOD_PARTS 1000U

/* Stamps that are so much earlier than the last one are of samples that come late, microseconds. */
#define LATEST 0x10000000UL

/* The longest time that is counted, microseconds. What was so long ago is forgotten. */
#define MAX_US 0xFFFFFFFFUL

/* What becomes of a reading. */
#define IS_HELD 0
#define IS_ACCEPTED 1
#define IS_NEW_START 2

/* ---- the correction ------------------------------------------------------------------------------ */

/* Puts a correction in force, moved by the shift of the constant: the only place that writes one. */
static void FN(set_correction)(STATE *state, WIDE bias, int_least32_t status)
{
    int_least32_t remarks = status;
    NUM limited = FN(within_authority)(state->table, bias, &remarks);

#if GTC_WITH_UNCERTAINTY
    state->uncertainty.unshifted = limited;
    if ((state->shift > NUM_ZERO) || (state->shift < NUM_ZERO)) {
        limited = FN(within_authority)(state->table, FN(add)(limited, state->shift), &remarks);
    }
#endif
    state->bias = limited;
    state->status = remarks;
}

/* The temperature as the terms see it, which is as the map does: within the envelope. */
static NUM FN(within_envelope)(const TABLE *table, NUM temp, int_least32_t *remarks)
{
    return FN(saturate)(temp, MEMBER(table->envelope[0]), MEMBER(table->envelope[1]), remarks);
}

/* Lets every term take note that a block ends, of this temperature, which lies within the envelope. */
static void FN(step_terms)(STATE *state, NUM temp)
{
    uint_least32_t i;

    for (i = 0U; i < FN(n_terms)(state->table); i++) {
        FN(code_of)(state->table, i)->step(state, i, temp);
    }
    FN(uncertainty_step)(state, temp);
}

/* Makes the correction for an input and puts it in force; `within`: its temperature within the envelope. */
static void FN(correct)(STATE *state, NUM temp, NUM within, NUM slope, int_least32_t remarks)
{
    const TABLE *const table = state->table;
    EFFECT effect;
    NUM bias = NUM_ZERO;
    WIDE total;
    uint_least32_t i;
    int status;

    effect.temp = temp;
    effect.slope = slope;
    effect.added = NUM_ZERO;
    effect.terms_known = FN(terms_known)(state);
    effect.edge_effect = NUM_ZERO;
    effect.remarks = remarks;
    for (i = 0U; i < FN(n_terms)(table); i++) {
        FN(code_of)(table, i)->apply(state, i, within, &effect);
    }
    status = FN(map)(table, effect.temp, effect.slope, &bias);
    FN(uncertainty_input)(state, &effect, slope);
    total = bias;
    if (FN(n_terms)(table) != 0U) {
        total = FN(add)(total, FN(saturate)(effect.added, MEMBER(table->effect[0]), MEMBER(table->effect[1]),
                                            &effect.remarks));
    }
    FN(set_correction)(state, total, effect.remarks | (int_least32_t)status);
}

/* A term that was never begun. */
static void FN(reset_term)(volatile STATE *state, uint_least32_t i)
{
    state->term[i][0] = FN(missing)();
    state->term[i][1] = FN(missing)();
}

static void FN(reset_terms)(STATE *state)
{
    uint_least32_t i;

    for (i = 0U; i < (uint_least32_t)GTC_TERM_SLOTS; i++) {
        FN(reset_term)(state, i);
    }
}

/* Begins again at x: slope 0, nothing in the window; terms too, but for what the first start finds of a saved state. */
static void FN(restart)(STATE *state, NUM x, int is_first)
{
    const TABLE *const table = state->table;
    int_least32_t remarks = GTC_WARMING;
    const NUM within = FN(within_envelope)(table, x, &remarks);
    uint_least32_t i;

    state->filled = 0U;
    state->window_valid = 0U;
    if (is_first == 0) {
        FN(reset_terms)(state);
    }
    FN(uncertainty_begin)(state, x, within);
    for (i = 0U; i < FN(n_terms)(table); i++) {
        FN(code_of)(table, i)->begin(state, i, within);
    }
    FN(correct)(state, x, within, NUM_ZERO, remarks);
}

/* ---- the window ---------------------------------------------------------------------------------- */

/* Moves the window on by one block: its mean, or a hole. */
static void FN(push)(STATE *state, uint_least32_t is_valid)
{
    volatile NUM *const window = state->window; /* no memmove() */
    uint_least32_t i;

    for (i = state->table->slope_blocks - 1U; i > 0U; i--) {
        window[i] = window[i - 1U];
    }
    state->window[0] = state->input[0].mean;
    state->window_valid = ((state->window_valid << 1) | is_valid) & 0xFFFFFFFFUL;
    if (state->filled < state->table->slope_blocks) {
        state->filled++;
    }
}

/* Least-squares slope over the valid blocks of the window, the newest of which is valid.
 * Returns GTC_OK, or GTC_WARMING (and slope 0) if the window is not full. Sums over the places k of the blocks begin
 * as those without holes; the newest block adds nothing to the sums over d, its differences from itself. */
static int_least32_t FN(window_slope)(const STATE *state, NUM *slope)
{
    const uint_least32_t blocks = state->table->slope_blocks;
    const uint_least32_t last = blocks - 1U;
    const uint_least32_t half = (blocks + 1U) / 2U;
    const NUM newest = state->window[0];
    uint_least32_t n = blocks;
    uint_least32_t sum_k = (blocks * last) / 2U;
    uint_least32_t sum_kk = (sum_k * (blocks + last)) / 3U;
    WIDE sum_d = NUM_ZERO;
    WIDE sum_kd = NUM_ZERO;
    uint_least32_t k = 0U;
    uint_least32_t bit;

    *slope = NUM_ZERO;
    if (state->filled < blocks) {
        return GTC_WARMING;
    }
    for (bit = (uint_least32_t)1U << last; bit > 1U; bit >>= 1) {
        if ((state->window_valid & bit) != 0U) {
            const WIDE d = FN(diff)(state->window[last - k], newest);

            sum_d = FN(add)(sum_d, d);
            sum_kd = FN(add)(sum_kd, FN(scaled)(k, d));
        } else {
            n--;
            sum_k -= k;
            sum_kk -= k * k;
        }
        k++;
    }
    if ((n < 2U) || (n < half)) {
        return GTC_WARMING;
    }
    sum_d = FN(scaled)(sum_k, sum_d);
    sum_kd = FN(scaled)(n, sum_kd);
    *slope = FN(quotient)(FN(diff)(sum_kd, sum_d), (n * sum_kk) - (sum_k * sum_k));
    return GTC_OK;
}

/* ---- what is accepted ---------------------------------------------------------------------------- */

/* A time and another, microseconds, as far as can be counted. */
static uint_least32_t FN(later)(uint_least32_t a, uint_least32_t b)
{
    const uint_least32_t sum = (a + b) & MAX_US;

    return (sum >= a) ? sum : MAX_US;
}

/* Nothing of a channel was ever accepted, or not since it was lost. */
static int FN(is_new)(const INPUT *in)
{
    return (in->gap_us == 0U) ? 1 : 0;
}

/* `us` microseconds passed in which nothing was accepted. */
static void FN(hold)(INPUT *in, uint_least32_t us)
{
    if (in->gap_us != 0U) {
        in->gap_us = FN(later)(in->gap_us, us);
    }
    in->series_us = FN(later)(in->series_us, us);
    in->candidate_us = FN(later)(in->candidate_us, us);
}

/* 1 if x has been the same for too long. */
static int FN(is_stuck)(INPUT *in, const gtc_word_t *guard, NUM x, uint_least32_t period_us)
{
    const uint_least32_t bits = FN(bits)(x);
    const uint_least32_t most = guard[GUARD_STUCK].bits;

    if (bits != in->received) {
        in->received = bits;
        in->same_us = 0U;
    } else if (in->same_us < most) {
        in->same_us = FN(later)(in->same_us, period_us);
    } else {
        /* counted far enough */
    }
    return ((most != 0U) && (in->same_us >= most)) ? 1 : 0;
}

/* 1 if x follows the last accepted reading. */
static int FN(follows)(const STATE *state, const INPUT *in, const gtc_word_t *guard, NUM x)
{
    int near = 0;

    if (in->gap_us == state->period_us) {
        near = FN(is_near)(x, in->last, in->near);
    } else if (in->gap_us != 0U) {
        near = FN(is_near)(x, in->last, FN(limit)(guard, in->gap_us));
    } else {
        /* there is none */
    }
    return near;
}

/* 1 if x agrees with the candidate before it: as near as an accepted reading must be to the last one, and no later than a
 * channel is held. */
static int FN(agrees)(const STATE *state, const INPUT *in, const gtc_word_t *guard, NUM x)
{
    const uint_least32_t us = in->candidate_us;
    const uint_least32_t blocks = us / state->table->block_us;
    int near = 0;

    if ((us < MAX_US) && (blocks <= guard[GUARD_MISSING].bits)) {
        near = FN(is_near)(x, in->candidate, FN(limit)(guard, us));
    }
    return near;
}

/* Decides on a reading that does not follow the last accepted one. Such readings make a series while each agrees with
 * the one before it. One that is at least the third of its series, and comes at least GUARD_AGREE after the first, is a
 * new start; how many polls were missed in between does not matter. Where GUARD_AGREE is 0, any reading is.
 *
 * The first reading of a series sets both of its times to 0, and from then on they grow alike; so series_us is larger
 * than candidate_us from the second reading on. Returns IS_HELD or IS_NEW_START. */
static int FN(confirm)(const STATE *state, INPUT *in, const gtc_word_t *guard, NUM x)
{
    const uint_least32_t least_us = guard[GUARD_AGREE].bits;
    int verdict = IS_HELD;

    if (least_us == 0U) {
        verdict = IS_NEW_START;
    }
    if (!FN(agrees)(state, in, guard, x)) {
        in->series_us = 0U;
    } else if ((in->series_us > in->candidate_us) && (in->series_us >= least_us)) {
        verdict = IS_NEW_START;
    } else {
        /* too few, or not for long enough */
    }
    in->candidate = x;
    in->candidate_us = 0U;
    return verdict;
}

/* Forgets the candidate, so that the next reading that does not follow begins a series. */
static void FN(forget_candidate)(INPUT *in)
{
    in->candidate_us = MAX_US;
}

/* Takes x into the running block. */
static void FN(accept)(INPUT *in, NUM x, uint_least32_t period_us)
{
    if (in->valid == 0U) {
        in->base = x;
        in->sum = NUM_ZERO;
    }
    in->sum = FN(add)(in->sum, FN(diff)(x, in->base));
    in->valid++;
    in->last = x;
    in->gap_us = period_us;
    FN(forget_candidate)(in);
}

/* One reading x within its range: held, accepted, or accepted as a new start, which is the mean until a block ends. */
static int FN(judge)(const STATE *state, INPUT *in, const gtc_word_t *guard, NUM x)
{
    int verdict = IS_ACCEPTED;

    if (!FN(follows)(state, in, guard, x)) {
        verdict = FN(confirm)(state, in, guard, x);
    }
    if (verdict == IS_HELD) {
        FN(hold)(in, state->period_us);
        return IS_HELD;
    }
    if (verdict == IS_NEW_START) {
        in->valid = 0U;
        in->held_blocks = 0U;
        in->clamped = 0U;
        in->mean = x;
    }
    FN(accept)(in, x, state->period_us);
    return verdict;
}

/* A reading x that is missing or cannot be true. The latter speaks against the candidate before it. */
static void FN(reject)(INPUT *in, NUM x, uint_least32_t us)
{
    if (FN(is_missing)(x) == 0) {
        FN(forget_candidate)(in);
    }
    FN(hold)(in, us);
}

/* One temperature. Returns GTC_OK or GTC_HELD. */
static int FN(take_temperature)(STATE *state, NUM x)
{
    INPUT *const in = &state->input[0];
    const gtc_word_t *const guard = state->table->guards;
    const int is_first = FN(is_new)(in);
    int verdict = IS_HELD;

    if (FN(is_missing)(x) || FN(is_stuck)(in, guard, x, state->period_us)
        || (!((x >= ELEMENT(guard[GUARD_LOW])) && (x <= ELEMENT(guard[GUARD_HIGH]))))) {
        FN(reject)(in, x, state->period_us);
    } else {
        verdict = FN(judge)(state, in, guard, x);
        if (verdict == IS_NEW_START) {
            FN(restart)(state, x, is_first);
        }
    }
    return (verdict == IS_HELD) ? GTC_HELD : GTC_OK;
}

/* One reading of an auxiliary channel: beyond its range the edge. */
static void FN(take_channel)(STATE *state, uint_least32_t channel, NUM reading)
{
    INPUT *const in = &state->input[channel];
    const gtc_word_t *const guard = FN(guard)(state, channel);
    int_least32_t remarks = GTC_OK;
    NUM x;
    int verdict;

    if (FN(is_missing)(reading) || FN(is_stuck)(in, guard, reading, state->period_us) != 0) {
        FN(reject)(in, reading, state->period_us);
        return;
    }
    x = FN(saturate)(reading, ELEMENT(guard[GUARD_LOW]), ELEMENT(guard[GUARD_HIGH]), &remarks);
    verdict = FN(judge)(state, in, guard, x);
    if ((verdict != IS_HELD) && (remarks != GTC_OK)) {
        in->clamped |= (verdict == IS_NEW_START) ? (CLAMPED_NOW | CLAMPED_MEAN) : CLAMPED_NOW;
    }
}

/* ---- blocks -------------------------------------------------------------------------------------- */

/* Readings that make a mean: half of a block, or two, which agree, as each was accepted after the one before it. How far
 * the mean may lie from that of the whole block, its uncertainty says. */
static int FN(is_enough)(const STATE *state, const INPUT *in)
{
    return ((in->valid >= 2U) || ((2U * in->valid) >= state->samples_per_block)) ? 1 : 0;
}

/* The running block of a channel ends. Returns 1 if it has enough readings; then the mean is theirs. When it is
 * lost its last reading is forgotten, so that it must agree with itself before it is accepted again. */
static int FN(end_block)(const STATE *state, INPUT *in, const gtc_word_t *guard)
{
    const int is_valid = FN(is_enough)(state, in);

    if (is_valid != 0) {
        in->mean = FN(mean)(in->base, in->sum, in->valid);
        in->held_blocks = 0U;
        in->clamped = (in->clamped & CLAMPED_NOW) * CLAMPED_MEAN;
    } else {
        in->clamped &= CLAMPED_MEAN;
        if (!FN(is_lost)(in, guard)) {
            in->held_blocks++;
        }
        if (FN(is_lost)(in, guard) != 0) {
            in->gap_us = 0U;
        }
    }
    in->valid = 0U;
    return is_valid;
}

static void FN(close_channels)(STATE *state)
{
    uint_least32_t c;

    for (c = 1U; c < FN(n_channels)(state->table); c++) {
        INPUT *const in = &state->input[c];
        const gtc_word_t *const guard = FN(guard)(state, c);

        if ((!FN(end_block)(state, in, guard)) && FN(is_lost)(in, guard)) {
            in->mean = ELEMENT(guard[GUARD_FALLBACK]);
            in->clamped = 0U;
        }
    }
}

/* A block with too few valid samples: the last correction stays, but not for ever. */
static void FN(bridge)(STATE *state)
{
    if (FN(is_lost)(&state->input[0], state->table->guards) != 0) {
        FN(reset_terms)(state);
        FN(set_correction)(state, MEMBER(state->table->fallback), GTC_HELD | GTC_FALLBACK);
    } else if (state->input[0].gap_us != 0U) {
        int_least32_t ignored = GTC_OK;

        FN(push)(state, 0U);
        FN(step_terms)(state, FN(within_envelope)(state->table, state->input[0].mean, &ignored));
        state->status |= GTC_HELD;
    } else {
        /* nothing was ever accepted: no correction yet */
    }
}

/* Blocks that have passed since the start. */
static void FN(pass)(STATE *state, uint_least32_t blocks)
{
    state->elapsed = ((MAX_ELAPSED - state->elapsed) > blocks) ? (state->elapsed + blocks) : MAX_ELAPSED;
}

/* The running block is complete: its mean and slope make the next correction, which is in force for the next block:
 * so terms and map see where the slope brings the mean by then. */
static void FN(close)(STATE *state)
{
    const uint_least32_t missing = state->samples_per_block - state->input[0].valid;

    FN(pass)(state, 1U);
    FN(close_channels)(state);
    if (FN(end_block)(state, &state->input[0], state->table->guards) != 0) {
        NUM temp;
        NUM within;
        NUM slope;
        int_least32_t remarks;

        FN(uncertainty_block)(state, missing);
        FN(push)(state, 1U);
        remarks = FN(window_slope)(state, &slope);
        temp = FN(ahead)(state->input[0].mean, slope, state->table->lead_blocks);
        within = FN(within_envelope)(state->table, temp, &remarks);
        FN(step_terms)(state, within);
        FN(correct)(state, temp, within, slope, remarks);
    } else {
        FN(bridge)(state);
    }
    state->position = 0U;
}

/* ---- a state ------------------------------------------------------------------------------------- */

/* Samples in a block of the table, if so many of this period make one to a thousandth of it; else 0. */
static uint_least32_t FN(samples_in_block)(const TABLE *table, uint_least32_t period_us)
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
static int FN(can_start)(const STATE *state, const TABLE *table, uint_least32_t period_us)
{
    int status = GTC_OK;

    if ((state == NULL) || (table == NULL) || (period_us == 0U)) {
        status = GTC_E_ARG;
    } else if (!FN(fits_build)(table)) {
        status = GTC_E_LAYOUT;
    } else if (FN(samples_in_block)(table, period_us) == 0U) {
        status = GTC_E_PERIOD;
    } else {
        /* it can */
    }
    return status;
}

/* A channel that has not seen a reading yet. */
static void FN(clear_input)(volatile INPUT *in)
{
    in->gap_us = 0U;
    in->series_us = MAX_US;
    in->candidate_us = MAX_US;
    in->same_us = 0U;
    in->received = NUM_MISSING_BITS;
    in->valid = 0U;
    in->held_blocks = 0U;
    in->clamped = 0U;
    in->last = NUM_ZERO;
    in->candidate = NUM_ZERO;
    in->base = NUM_ZERO;
    in->sum = NUM_ZERO;
    in->mean = NUM_ZERO;
}

/* A front end that has not seen a sample yet. */
static void FN(clear)(STATE *state)
{
    volatile NUM *const window = state->window; /* no memset() */
    uint_least32_t i;

    state->position = 0U;
    state->filled = 0U;
    state->window_valid = 0U;
    state->status = GTC_HELD;
    state->bias = NUM_ZERO;
    state->elapsed = 0U;
    state->off_blocks = 0U;
    state->late_us = 0U;
    state->unused = 0U;
    FN(uncertainty_clear)(state);
    for (i = 0U; i < (uint_least32_t)GTC_MAX_SLOPE_BLOCKS; i++) {
        window[i] = NUM_ZERO;
    }
    for (i = 0U; i <= (uint_least32_t)GTC_MAX_TERMS; i++) {
        FN(clear_input)(&state->input[i]);
        if ((i >= 1U) && (i < FN(n_channels)(state->table))) {
            state->input[i].mean = ELEMENT(FN(guard)(state, i)[GUARD_FALLBACK]);
        }
    }
}

/* All of a state that can be started. */
static void FN(start)(STATE *state, const TABLE *table, uint_least32_t period_us)
{
    uint_least32_t i;

    state->table = table;
    state->period_us = period_us;
    state->samples_per_block = FN(samples_in_block)(table, period_us);
    FN(clear)(state);
    FN(rezero_clear)(state);
    for (i = 0U; i <= (uint_least32_t)GTC_MAX_TERMS; i++) {
        state->input[i].near = LIMIT_ZERO;
        if (i < FN(n_channels)(table)) {
            state->input[i].near = FN(limit)(FN(guard)(state, i), period_us);
        }
    }
    FN(reset_terms)(state);
}

static int FN(run_init)(STATE *state, const TABLE *table, uint_least32_t period_us)
{
    const int status = FN(can_start)(state, table, period_us);

    if (status == GTC_OK) {
        FN(start)(state, table, period_us);
    }
    return status;
}

/* The next sample of the grid. */
static int FN(take)(STATE *state, const NUM *channels)
{
    uint_least32_t c;
    int remark;

    if (state->position >= state->samples_per_block) {
        FN(close)(state);
    }
    state->position++;
    for (c = 1U; c < FN(n_channels)(state->table); c++) {
        FN(take_channel)(state, c, channels[c]);
    }
    remark = FN(take_temperature)(state, channels[0]);
    return (int)state->status | remark;
}

/* 1 if a state was started: 0 for one that memory lost, whose times would divide by nothing or never pass. */
static int FN(has_times)(const STATE *state)
{
    return ((state->table != NULL) && (state->samples_per_block != 0U) && (state->period_us != 0U)) ? 1 : 0;
}

#if GTC_WITH_TIME
/* 1 if every channel has been missing for so long that only time passes any more. */
static int FN(all_lost)(const STATE *state)
{
    int lost = 1;
    uint_least32_t c;

    for (c = 0U; c < FN(n_channels)(state->table); c++) {
        lost &= FN(is_lost)(&state->input[c], FN(guard)(state, c));
    }
    return lost;
}

/* `samples` samples passed in which nothing came. */
static void FN(miss)(STATE *state, uint_least32_t samples)
{
    uint_least32_t c;

    for (c = 0U; c < FN(n_channels)(state->table); c++) {
        FN(hold)(&state->input[c], samples * state->period_us);
    }
}

/* Whole blocks in which nothing can change but the times. Returns the samples that are left, at least one. */
static uint_least32_t FN(skip)(STATE *state, uint_least32_t samples)
{
    const uint_least32_t blocks = (samples - 1U) / state->samples_per_block;
    const uint_least32_t skipped = blocks * state->samples_per_block;

    FN(pass)(state, blocks);
    FN(miss)(state, skipped);
    return samples - skipped;
}

/* `count` samples of the grid in which nothing came, the same bits as in `count` calls. */
static int FN(pass_over)(STATE *state, uint_least32_t count)
{
    uint_least32_t rest = count;

    while (rest > 0U) {
        uint_least32_t step;

        if (state->position >= state->samples_per_block) {
            FN(close)(state);
        }
        if (FN(all_lost)(state) != 0) {
            rest = FN(skip)(state, rest);
        }
        step = state->samples_per_block - state->position;
        step = (step < rest) ? step : rest;
        FN(miss)(state, step);
        state->position += step;
        rest -= step;
    }
    return (int)state->status | GTC_HELD;
}

/* Sample periods in a time, rounded. */
static uint_least32_t FN(slots)(const STATE *state, uint_least32_t us)
{
    const uint_least32_t rest = us % state->period_us;
    const uint_least32_t n = us / state->period_us;

    return n + ((rest >= (state->period_us - rest)) ? 1U : 0U);
}

/* A sample whose time has not moved on is not used. One or a few come of jitter, or of a caller that is faster than its
 * period. After as many in a row as make a block the clock has stopped: each of them is a period in which nothing came. */
static int FN(not_used)(STATE *state)
{
    if (state->unused < state->samples_per_block) {
        state->unused++;
        return (int)state->status | GTC_HELD;
    }
    return FN(pass_over)(state, 1U);
}

/* Times are put on a grid of sample periods, from the start on, so that no error of them adds up. */
static int FN(run_sample)(STATE *state, uint_least32_t elapsed_us, const NUM *channels)
{
    uint_least32_t later_us;
    uint_least32_t n = 1U;

    if ((state == NULL) || (FN(has_times)(state) == 0)) {
        return GTC_E_ARG;
    }
    later_us = (state->late_us + elapsed_us) & MAX_US;
    if (later_us != state->period_us) {
        n = FN(slots)(state, later_us);
    }
    if ((n == 0U) || (later_us > (MAX_US - LATEST))) {
        state->late_us = later_us;
        return FN(not_used)(state);
    }
    state->unused = 0U;
    state->late_us = (later_us - (n * state->period_us)) & MAX_US;
    if (channels == NULL) {
        return FN(pass_over)(state, n);
    }
    (void)FN(pass_over)(state, n - 1U);
    return FN(take)(state, channels);
}

#else
/* Samples come each period. */
static int FN(run_sample)(STATE *state, uint_least32_t elapsed_us, const NUM *channels)
{
    NUM missing[GTC_MAX_TERMS + 1];
    uint_least32_t c;

    if ((state == NULL) || (FN(has_times)(state) == 0) || (elapsed_us != state->period_us)) {
        return GTC_E_ARG;
    }
    if (channels != NULL) {
        return FN(take)(state, channels);
    }
    for (c = 0U; c <= (uint_least32_t)GTC_MAX_TERMS; c++) {
        missing[c] = FN(missing)();
    }
    return FN(take)(state, missing);
}
#endif

static int FN(run_bias)(const STATE *state, NUM *bias)
{
    int_least32_t remarks;

    if ((state == NULL) || (bias == NULL) || (state->table == NULL)) {
        return GTC_E_ARG;
    }
    remarks = state->status;
    *bias = FN(within_authority)(state->table, state->bias, &remarks);
    return (int)remarks;
}
