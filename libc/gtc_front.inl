/* gtc_front.inl - samples in, correction in force out, in the numbers included before.
 *
 * docs/numerics.md, section 1, says every step; gen/gyrotc/frontend is its mirror.
 *
 * SPDX-License-Identifier: MIT
 */

/* Samples since the last believed one are counted no further than this. */
#define MAX_GAP 65535UL

/* Blocks since the start, too: all warm-up is over then. */
#define MAX_ELAPSED 0xFFFFFFUL

/* So many suspects in a row that agree are the new truth. */
#define NEW_TRUTH 3U

/* A float counts up to here exactly, and sums of words keep to 64 bits. */
#define MAX_SAMPLES_PER_BLOCK 0x100000UL

/* Words of a guard. */
#define GUARD_STUCK 5U
#define GUARD_MISSING 6U

/* A time and another, microseconds, as far as can be counted. */
static uint_least32_t FN(later)(uint_least32_t a, uint_least32_t b)
{
    return ((0xFFFFFFFFUL - a) > b) ? (a + b) : 0xFFFFFFFFUL;
}

/* Lets every term take note that a block of mean temperature state->mean ends. */
static void FN(step_terms)(STATE *state, NUM temp)
{
    const TABLE *const table = state->table;
    uint_least32_t i;

    for (i = 0U; i < table->n_terms; i++) {
        table->term_code[i]->step(state, i, temp);
    }
}

/* Makes the correction for an input and puts it in force. */
static void FN(correct)(STATE *state, NUM temp, NUM slope, int_least32_t remarks)
{
    const TABLE *const table = state->table;
    EFFECT effect;
    NUM bias = NUM_ZERO;
    uint_least32_t i;
    int status;

    effect.temp = temp;
    effect.slope = slope;
    effect.added = NUM_ZERO;
    effect.remarks = remarks;
    for (i = 0U; i < table->n_terms; i++) {
        table->term_code[i]->apply(state, i, temp, &effect);
    }
    status = FN(map)(table, effect.temp, effect.slope, &bias);
    state->bias = FN(total)(bias, effect.added);
    state->status = effect.remarks | (int_least32_t)status;
}

/* Begins again at x: slope 0, nothing in the window, the block's samples so far dropped. */
static void FN(restart)(STATE *state, NUM x)
{
    const TABLE *const table = state->table;
    uint_least32_t i;

    state->filled = 0U;
    state->window_valid = 0U;
    state->held_blocks = 0U;
    state->valid = 0U;
    state->mean = x;
    if (state->gap == 0U) {
        for (i = 0U; i < table->n_terms; i++) {
            table->term_code[i]->begin(state, i, x);
        }
    }
    FN(correct)(state, x, NUM_ZERO, GTC_WARMING);
}

/* Moves the window on by one block: its mean, or a hole. */
static void FN(push)(STATE *state, uint_least32_t is_valid)
{
    volatile NUM *const window = state->window; /* no memmove() */
    uint_least32_t i;

    for (i = state->table->slope_blocks - 1U; i > 0U; i--) {
        window[i] = window[i - 1U];
    }
    state->window[0] = state->mean;
    state->window_valid = ((state->window_valid << 1) | is_valid) & 0xFFFFFFFFUL;
    if (state->filled < state->table->slope_blocks) {
        state->filled++;
    }
}

/* Least-squares slope over the valid blocks of the window, the newest of which is valid.
 * Returns GTC_OK, or GTC_WARMING (and slope 0) if the window is not full. */
static int_least32_t FN(window_slope)(const STATE *state, NUM *slope)
{
    const uint_least32_t blocks = state->table->slope_blocks;
    const uint_least32_t half = (blocks + 1U) / 2U;
    WIDE sum_d = NUM_ZERO;
    WIDE sum_kd = NUM_ZERO;
    uint_least32_t n = 0U;
    uint_least32_t sum_k = 0U;
    uint_least32_t sum_kk = 0U;
    uint_least32_t k;

    for (k = 0U; k < blocks; k++) {
        const uint_least32_t age = (blocks - 1U) - k;

        if (((state->window_valid >> age) & 1U) != 0U) {
            const WIDE d = FN(diff)(state->window[age], state->window[0]);

            sum_d = FN(add)(sum_d, d);
            sum_kd = FN(add)(sum_kd, FN(scaled)(k, d));
            n++;
            sum_k += k;
            sum_kk += k * k;
        }
    }
    *slope = NUM_ZERO;
    if ((state->filled < blocks) || (n < 2U) || (n < half)) {
        return GTC_WARMING;
    }
    sum_d = FN(scaled)(sum_k, sum_d);
    sum_kd = FN(scaled)(n, sum_kd);
    *slope = FN(quotient)(FN(diff)(sum_kd, sum_d), (n * sum_kk) - (sum_k * sum_k));
    return GTC_OK;
}

/* A block with too few valid samples: the last correction stays, but not for ever. */
static void FN(bridge)(STATE *state)
{
    const TABLE *const table = state->table;

    FN(push)(state, 0U);
    FN(step_terms)(state, state->mean);
    if (state->held_blocks <= table->guards[GUARD_MISSING].bits) {
        state->held_blocks++;
    }
    if (state->held_blocks > table->guards[GUARD_MISSING].bits) {
        state->bias = MEMBER(table->fallback);
        state->status = GTC_HELD | GTC_FALLBACK;
    } else {
        state->status |= GTC_HELD;
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
    FN(pass)(state, 1U);
    if (state->gap == 0U) {
        /* nothing was ever believed: no correction yet */
    } else if ((2U * state->valid) >= state->samples_per_block) {
        NUM temp;
        NUM slope;
        int_least32_t remarks;

        state->mean = FN(mean)(state->base, state->sum, state->valid);
        state->held_blocks = 0U;
        FN(push)(state, 1U);
        remarks = FN(window_slope)(state, &slope);
        temp = (state->table->lead_blocks != 0U) ? FN(total)(state->mean, slope) : state->mean;
        FN(step_terms)(state, temp);
        FN(correct)(state, temp, slope, remarks);
    } else {
        FN(bridge)(state);
    }
    state->position = 0U;
    state->valid = 0U;
}

/* Takes x into the running block. */
static void FN(believe)(STATE *state, NUM x)
{
    if (state->valid == 0U) {
        state->base = x;
        state->sum = NUM_ZERO;
    }
    state->sum = FN(add)(state->sum, FN(diff)(x, state->base));
    state->valid++;
    state->last = x;
    state->gap = 1U;
    state->suspects = 0U;
}

/* `count` samples passed of which none was believed. */
static void FN(hold)(STATE *state, uint_least32_t count)
{
    if (state->gap != 0U) {
        state->gap = ((MAX_GAP - state->gap) > count) ? (state->gap + count) : MAX_GAP;
    }
}

/* 1 if x has been the same for too long. */
static int FN(is_stuck)(STATE *state, NUM x)
{
    const uint_least32_t bits = FN(bits)(x);
    const uint_least32_t most = state->table->guards[GUARD_STUCK].bits;

    if (bits != state->received) {
        state->repeats = 0U;
    } else if (state->repeats < most) {
        state->repeats = FN(later)(state->repeats, state->period_us);
    } else {
        /* counted far enough */
    }
    state->received = bits;
    return ((most != 0U) && (state->repeats >= most)) ? 1 : 0;
}

/* 1 if x is too far from the last believed sample; counts the suspects that agree. */
static int FN(is_suspect)(STATE *state, NUM x)
{
    if ((state->gap == 0U) || FN(is_near)(state, x, state->last, state->gap)) {
        return 0;
    }
    if ((state->suspects != 0U) && FN(is_near)(state, x, state->candidate, 1U)) {
        state->suspects++;
    } else {
        state->suspects = 1U;
    }
    state->candidate = x;
    return 1;
}

/* 1 if x may be believed as far as it can be told without the samples around it. */
static int FN(is_sound)(STATE *state, NUM x)
{
    if (FN(is_missing)(x) != 0) {
        return 0;
    }
    if (FN(is_stuck)(state, x) != 0) {
        return 0;
    }
    return ((x >= NUM_PLAUSIBLE_MIN) && (x <= NUM_PLAUSIBLE_MAX)) ? 1 : 0;
}

/* One temperature: believed, or held. Returns GTC_OK or GTC_HELD. */
static int FN(take)(STATE *state, NUM x)
{
    if (!FN(is_sound)(state, x)) {
        state->suspects = 0U;
        FN(hold)(state, 1U);
        return GTC_HELD;
    }
    if (FN(is_suspect)(state, x) && (state->suspects < NEW_TRUTH)) {
        FN(hold)(state, 1U);
        return GTC_HELD;
    }
    if ((state->gap == 0U) || (state->suspects >= NEW_TRUTH)
        || ((state->status & GTC_FALLBACK) != 0)) {
        FN(restart)(state, x);
    }
    FN(believe)(state, x);
    return GTC_OK;
}

/* GTC_OK, or why a state cannot be started. */
static int FN(can_start)(const STATE *state, const TABLE *table, uint_least32_t samples_per_block)
{
    if ((state == NULL) || (table == NULL) || (samples_per_block < 1U)
        || (samples_per_block > MAX_SAMPLES_PER_BLOCK)) {
        return GTC_E_ARG;
    }
    return FN(is_usable)(table) ? GTC_OK : GTC_E_LAYOUT;
}

/* A term that was never begun. */
static void FN(forget)(volatile STATE *state, uint_least32_t i)
{
    state->term[i][0] = FN(missing)();
    state->term[i][1] = FN(missing)();
    state->channel[i] = NUM_ZERO;
    state->channel_valid[i] = 0U;
}

/* A front end that has not seen a sample yet. */
static void FN(clear)(volatile STATE *state, uint_least32_t samples_per_block)
{
    uint_least32_t i;

    state->samples_per_block = samples_per_block;
    state->position = 0U;
    state->valid = 0U;
    state->gap = 0U;
    state->suspects = 0U;
    state->received = NUM_MISSING_BITS;
    state->repeats = 0U;
    state->held_blocks = 0U;
    state->filled = 0U;
    state->window_valid = 0U;
    state->status = GTC_HELD;
    state->last = NUM_ZERO;
    state->candidate = NUM_ZERO;
    state->base = NUM_ZERO;
    state->sum = NUM_ZERO;
    state->mean = NUM_ZERO;
    state->bias = NUM_ZERO;
    state->elapsed = 0U;
    state->off_blocks = 0U;
    for (i = 0U; i < (uint_least32_t)GTC_MAX_SLOPE_BLOCKS; i++) {
        state->window[i] = NUM_ZERO;
    }
}

/* All of a state that can be started. */
static void FN(start)(STATE *state, const TABLE *table, uint_least32_t samples_per_block)
{
    uint_least32_t i;

    state->table = table;
    state->period_us = (table->block_us + (samples_per_block / 2U)) / samples_per_block;
    state->step_per_sample = FN(step_per_sample)(table, state->period_us);
    FN(clear)(state, samples_per_block);
    for (i = 0U; i < (uint_least32_t)GTC_MAX_TERMS; i++) {
        FN(forget)(state, i);
    }
}

static int FN(run_init)(STATE *state, const TABLE *table, uint_least32_t samples_per_block)
{
    const int status = FN(can_start)(state, table, samples_per_block);

    if (status == GTC_OK) {
        FN(start)(state, table, samples_per_block);
    }
    return status;
}

static int FN(run_sample)(STATE *state, const NUM *channels)
{
    uint_least32_t i;
    int remark;

    if ((state == NULL) || (channels == NULL) || (state->table == NULL)) {
        return GTC_E_ARG;
    }
    if (state->position >= state->samples_per_block) {
        FN(close)(state);
    }
    state->position++;
    for (i = 0U; i < state->table->n_terms; i++) {
        const uint_least32_t channel = state->table->terms[(i * GTC_TERM_WORDS) + 1U].bits;

        state->table->term_code[i]->take(state, i, channels[channel]);
    }
    remark = FN(take)(state, channels[0]);
    return (int)state->status | remark;
}

static int FN(run_missed)(STATE *state, uint_least32_t count)
{
    uint_least32_t rest = count;
    uint_least32_t blocks;
    uint_least32_t most;

    if ((state == NULL) || (state->table == NULL)) {
        return GTC_E_ARG;
    }
    if (count == 0U) {
        return (int)state->status;
    }
    /* After so many blocks nothing changes any more: whole blocks beyond are left out. */
    most = state->table->guards[GUARD_MISSING].bits + state->table->slope_blocks + 2U;
    blocks = count / state->samples_per_block;
    if (blocks > most) {
        rest -= (blocks - most) * state->samples_per_block;
        FN(pass)(state, blocks - most);
    }
    state->suspects = 0U;
    FN(hold)(state, rest);
    while (rest > 0U) {
        uint_least32_t step;

        if (state->position >= state->samples_per_block) {
            FN(close)(state);
        }
        step = state->samples_per_block - state->position;
        step = (step < rest) ? step : rest;
        state->position += step;
        rest -= step;
    }
    return (int)state->status | GTC_HELD;
}

static int FN(run_bias)(const STATE *state, NUM *bias)
{
    if ((state == NULL) || (bias == NULL) || (state->table == NULL)) {
        return GTC_E_ARG;
    }
    *bias = state->bias;
    return (int)state->status;
}
