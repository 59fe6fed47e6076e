/* gtc_save.inl - a state over power cycles, in the numbers included before.
 *
 * docs/numerics.md, section 7, gives the words. One text serves both directions, so that they cannot
 * drift apart.
 *
 * SPDX-License-Identifier: MIT
 */

#if GTC_WITH_SAVE
/* Changes with the order of the words. */
#define SAVE_MAGIC 0x47545336UL

/* What another build may have otherwise. */
#define SAVE_OPTIONS \
    (ARITHMETIC + (128UL * (uint_least32_t)GTC_WITH_UNCERTAINTY) + (256UL * (uint_least32_t)GTC_MAX_TERMS) + (65536UL * (uint_least32_t)GTC_MAX_SLOPE_BLOCKS))

/* Words before the state: magic, options, CRC of the table. */
#define SAVE_HEAD 3U
#define CRC_AT (GTC_SAVE_WORDS - 1)

/* Where the next word goes to, or, if that is NULL, comes from; whether every word so far is one that a call can have
 * left, as far as no function of the state meets a run-time error. Volatile: no memcpy(). */
typedef struct {
    volatile gtc_word_t *to;
    const volatile gtc_word_t *from;
    int is_sound;
} FN(cursor_t);

static void FN(carry_bits)(FN(cursor_t) *at, uint_least32_t *bits)
{
    if (at->to != NULL) {
        at->to[0].bits = *bits;
        at->to = &at->to[1];
    } else {
        *bits = at->from[0].bits;
        at->from = &at->from[1];
    }
}

static void FN(carry_count)(FN(cursor_t) *at, uint_least32_t *count, uint_least32_t most)
{
    FN(carry_bits)(at, count);
    at->is_sound &= (*count <= most) ? 1 : 0;
}

/* The bits of a number, whatever it is. */
static void FN(carry_any)(FN(cursor_t) *at, NUM *x)
{
    gtc_word_t word;

    ELEMENT(word) = *x;
    FN(carry_bits)(at, &word.bits);
    if (at->to == NULL) {
        *x = ELEMENT(word);
    }
}

static void FN(carry)(FN(cursor_t) *at, NUM *x, NUM least, NUM most)
{
    FN(carry_any)(at, x);
    at->is_sound &= ((*x >= least) && (*x <= most)) ? 1 : 0;
}

/* A temperature of the window, or of a term, which an envelope may have moved. */
static void FN(carry_temp)(FN(cursor_t) *at, NUM *x)
{
    FN(carry)(at, x, FN(number_limits)[NUMBER_ENVELOPE].least, FN(number_limits)[NUMBER_ENVELOPE].most);
}

static void FN(carry_number)(FN(cursor_t) *at, NUM *x)
{
    FN(carry)(at, x, -NUM_MOST, NUM_MOST);
}

static void FN(carry_wide)(FN(cursor_t) *at, WIDE *x)
{
    gtc_word_t words[2];

    FN(to_words)(*x, words);
    FN(carry_bits)(at, &words[0].bits);
    FN(carry_bits)(at, &words[1].bits);
    if (at->to == NULL) {
        *x = FN(from_words)(words);
    }
}

/* One channel: numbers within its range (0 before the first reading), counts within the block. */
static void FN(carry_input)(FN(cursor_t) *at, INPUT *in, const gtc_word_t *guard, uint_least32_t position)
{
    const NUM low = ELEMENT(guard[GUARD_LOW]);
    const NUM high = ELEMENT(guard[GUARD_HIGH]);
    const NUM least = (low < NUM_ZERO) ? low : NUM_ZERO;
    const NUM most = (high > NUM_ZERO) ? high : NUM_ZERO;

    FN(carry_bits)(at, &in->gap_us);
    FN(carry_bits)(at, &in->series_us);
    FN(carry_bits)(at, &in->candidate_us);
    FN(carry_bits)(at, &in->same_us);
    FN(carry_bits)(at, &in->received);
    FN(carry_count)(at, &in->valid, position);
    FN(carry_count)(at, &in->held_blocks, guard[GUARD_MISSING].bits + 1U);
    FN(carry_count)(at, &in->clamped, CLAMPED_NOW | CLAMPED_MEAN);
    FN(carry)(at, &in->last, least, most);
    FN(carry)(at, &in->candidate, least, most);
    FN(carry)(at, &in->base, least, most);
    FN(carry)(at, &in->mean, least, most);
    FN(carry_wide)(at, &in->sum);
    /* The sum last: its bounds are products of what was tested before. */
    if (at->is_sound != 0) {
        at->is_sound = FN(sum_fits)(in, low, high);
    }
}

/* The front end: everything that the running block and the next correction depend on. */
static void FN(carry_front)(FN(cursor_t) *at, STATE *state)
{
    gtc_word_t status;
    uint_least32_t i;

    status.integer = state->status;
    FN(carry_count)(at, &status.bits, (2U * (uint_least32_t)GTC_CHANNEL_LOST) - 1U);
    if (at->to == NULL) {
        state->status = status.integer;
    }
    FN(carry_bits)(at, &state->period_us);
    FN(carry_count)(at, &state->position, MAX_SAMPLES_PER_BLOCK);
    FN(carry_count)(at, &state->filled, state->table->slope_blocks);
    FN(carry_bits)(at, &state->window_valid);
    FN(carry_count)(at, &state->elapsed, MAX_ELAPSED);
    FN(carry_bits)(at, &state->off_blocks);
    FN(carry_number)(at, &state->bias);
    for (i = 0U; i < (uint_least32_t)GTC_MAX_SLOPE_BLOCKS; i++) {
        FN(carry_temp)(at, &state->window[i]);
    }
    for (i = 0U; i <= (uint_least32_t)GTC_MAX_TERMS; i++) {
        const uint_least32_t channel = (i < FN(n_channels)(state->table)) ? i : 0U;

        FN(carry_input)(at, &state->input[i], FN(guard)(state, channel), state->position);
    }
}

/* 1 if a term has a memory that goes on over a time without power. */
static int FN(is_retained)(const TABLE *table, uint_least32_t i)
{
    return ((i < FN(n_terms)(table)) && (FN(code_of)(table, i)->is_retained != 0U)) ? 1 : 0;
}

/* The state of a term; nothing of it is known where it never began, or has none. */
static void FN(carry_term)(FN(cursor_t) *at, STATE *state, uint_least32_t i)
{
    NUM *const z = state->term[i];

    FN(carry_any)(at, &z[0]);
    FN(carry_any)(at, &z[1]);
    if (FN(is_missing)(z[0]) != 0) {
        at->is_sound &= ((state->input[0].gap_us == 0U) || (FN(is_retained)(state->table, i) == 0)) ? 1 : 0;
    } else {
        at->is_sound &= ((z[0] >= FN(number_limits)[NUMBER_ENVELOPE].least)
                         && (z[0] <= FN(number_limits)[NUMBER_ENVELOPE].most) && FN(is_fraction)(z[1])) ? 1 : 0;
    }
}

#if GTC_WITH_UNCERTAINTY
/* What the uncertainty is computed from, and the shift of the constant. */
static void FN(carry_uncertainty)(FN(cursor_t) *at, STATE *state)
{
    const NUM most = MEMBER(state->table->rezero);

    FN(carry_number)(at, &state->uncertainty.input[0]);
    FN(carry_number)(at, &state->uncertainty.input[1]);
    FN(carry_number)(at, &state->uncertainty.slope);
    FN(carry_temp)(at, &state->uncertainty.first_temp);
    FN(carry_temp)(at, &state->uncertainty.lowest);
    FN(carry_temp)(at, &state->uncertainty.highest);
    FN(carry_number)(at, &state->uncertainty.unshifted);
    FN(carry_number)(at, &state->uncertainty.edge_effect);
    FN(carry_bits)(at, &state->uncertainty.terms_since);
    FN(carry_bits)(at, &state->uncertainty.terms_known);
    FN(carry_bits)(at, &state->uncertainty.slope_known);
    FN(carry_count)(at, &state->uncertainty.missing, MAX_SAMPLES_PER_BLOCK);
    FN(carry)(at, &state->shift, -most, most);
    FN(carry_number)(at, &state->shift_sigma);
}

#endif

/* All of a state but what init() makes of table and period_us, and the clock; with `to`, nothing of it is written.
 * Returns 1 if it is sound. */
static int FN(carry_state)(STATE *state, gtc_word_t *to, const gtc_word_t *from)
{
    FN(cursor_t) at;
    uint_least32_t i;

    at.to = to;
    at.from = from;
    at.is_sound = 1;
    FN(carry_front)(&at, state);
    for (i = 0U; i < (uint_least32_t)GTC_TERM_SLOTS; i++) {
        FN(carry_term)(&at, state, i);
    }
#if GTC_WITH_UNCERTAINTY
    FN(carry_uncertainty)(&at, state);
#endif
    return at.is_sound;
}

static uint_least32_t FN(save_crc)(const gtc_word_t words[GTC_SAVE_WORDS])
{
    return gtc_crc_words(GTC_CRC_START, words, CRC_AT) ^ GTC_CRC_FINAL;
}

static int FN(run_save)(const STATE *state, gtc_word_t words[GTC_SAVE_WORDS])
{
    if ((state == NULL) || (words == NULL) || (state->table == NULL)) {
        return GTC_E_ARG;
    }
    words[0].bits = SAVE_MAGIC;
    words[1].bits = SAVE_OPTIONS;
    words[2].bits = state->table->crc;
    /* MISRA 11.8: one text carries both ways; this way the state is only read. */
    (void)FN(carry_state)((STATE *)state, &words[SAVE_HEAD], words);
    words[CRC_AT].bits = FN(save_crc)(words);
    return GTC_OK;
}

/* Whether the words are a whole state of this table, saved by a build like this one. */
static int FN(inspect)(const TABLE *table, const gtc_word_t words[GTC_SAVE_WORDS])
{
    int status = GTC_OK;

    if ((words[0].bits != SAVE_MAGIC)
        || (words[CRC_AT].bits != FN(save_crc)(words))) {
        status = GTC_E_IMAGE;
    } else if (words[1].bits != SAVE_OPTIONS) {
        status = GTC_E_LAYOUT;
    } else if (words[2].bits != table->crc) {
        status = GTC_E_ID;
    } else {
        /* it is */
    }
    return status;
}

/* Of a state that was read, what is retained over a time without power: terms. If it had not begun when it was saved,
 * it had itself been without power before. */
static void FN(retain)(STATE *state, uint_least32_t off_blocks)
{
    const uint_least32_t before = (state->input[0].gap_us == 0U) ? state->off_blocks : 0U;
    const uint_least32_t room = 0xFFFFFFFFUL - before;
    uint_least32_t i;

    FN(clear)(state);
    state->off_blocks = before + ((off_blocks < room) ? off_blocks : room);
    if (off_blocks != 0U) {
        FN(rezero_clear)(state);
    }
    for (i = 0U; i < (uint_least32_t)GTC_TERM_SLOTS; i++) {
        if (FN(is_retained)(state->table, i) == 0) {
            FN(reset_term)(state, i);
        }
    }
}

/* The state that the words hold, after so many blocks without power. Returns 1 if it is one that calls could have left. */
static int FN(take_over)(STATE *state, const TABLE *table, uint_least32_t period_us, const gtc_word_t *words,
                         uint_least32_t off_blocks)
{
    int is_sound;

    FN(start)(state, table, period_us);
    is_sound = FN(carry_state)(state, NULL, &words[SAVE_HEAD]);
    if ((off_blocks != 0U) || (state->period_us != period_us)) {
        state->period_us = period_us;
        FN(retain)(state, off_blocks);
    }
    return ((is_sound != 0) && (state->position <= state->samples_per_block)) ? 1 : 0;
}

static int FN(run_restore)(STATE *state, const TABLE *table, uint_least32_t period_us,
                           const gtc_word_t words[GTC_SAVE_WORDS], uint_least32_t off_blocks)
{
    int status = (words == NULL) ? GTC_E_ARG : FN(can_start)(state, table, period_us);
    STATE read;

    if (status == GTC_OK) {
        status = FN(inspect)(table, words);
    }
    if ((status == GTC_OK) && (FN(take_over)(&read, table, period_us, words, off_blocks) == 0)) {
        status = GTC_E_IMAGE;
    }
    if (status == GTC_OK) {
        (void)FN(take_over)(state, table, period_us, words, off_blocks);
    }
    return status;
}
#endif
