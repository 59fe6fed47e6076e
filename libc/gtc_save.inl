/* gtc_save.inl - a state over power cycles.
 *
 * docs/numerics.md, section 7, gives the words. One text serves both directions, so that they cannot
 * drift apart.
 *
 * SPDX-License-Identifier: MIT
 */

#if GTC_WITH_SAVE
/* Changes with the order of the words. */
#define SAVE_MAGIC 0x47545338UL

/* Words before the state: magic, options, CRC of the table. */
#define SAVE_HEAD 3U
#define CRC_AT (GTC_SAVE_WORDS - 1)

/* Where the next word goes to, or, if that is NULL, comes from; whether every word so far is one that a call can have
 * left, as far as no function of the state meets a run-time error. */
typedef struct {
    gtc_word_t *to;
    const gtc_word_t *from;
    int is_sound;
} cursor_t;

static void carry_bits(cursor_t *at, uint_least32_t *bits)
{
    if (at->to != NULL) {
        at->to[0].bits = *bits;
        at->to = &at->to[1];
    } else {
        *bits = at->from[0].bits;
        at->from = &at->from[1];
    }
}

static void carry_count(cursor_t *at, uint_least32_t *count, uint_least32_t most)
{
    carry_bits(at, count);
    at->is_sound &= (*count <= most) ? 1 : 0;
}

/* The bits of a number, whatever it is. */
static void carry_any(cursor_t *at, NUM *x)
{
    gtc_word_t word;

    ELEMENT(word) = *x;
    carry_bits(at, &word.bits);
    if (at->to == NULL) {
        *x = ELEMENT(word);
    }
}

static void carry_within(cursor_t *at, NUM *x, NUM least, NUM most)
{
    carry_any(at, x);
    at->is_sound &= ((*x >= least) && (*x <= most)) ? 1 : 0;
}

/* A temperature of the window, or of a term, which an envelope may have moved. */
static void carry_temp(cursor_t *at, NUM *x)
{
    carry_within(at, x, NUM_COLDEST, NUM_HOTTEST);
}

static void carry_number(cursor_t *at, NUM *x)
{
    carry_within(at, x, -NUM_MOST, NUM_MOST);
}

static void carry_wide(cursor_t *at, WIDE *x)
{
    gtc_word_t words[2];

    to_words(*x, words);
    carry_bits(at, &words[0].bits);
    carry_bits(at, &words[1].bits);
    if (at->to == NULL) {
        *x = from_words(words);
    }
}

/* One channel: numbers within its range (0 before the first reading), counts within the block. */
static void carry_input(cursor_t *at, INPUT *in, const gtc_word_t *guard, uint_least32_t position)
{
    const NUM low = ELEMENT(guard[GUARD_LOW]);
    const NUM high = ELEMENT(guard[GUARD_HIGH]);
    const NUM least = (low < NUM_ZERO) ? low : NUM_ZERO;
    const NUM most = (high > NUM_ZERO) ? high : NUM_ZERO;

    carry_bits(at, &in->next_gap_us);
    carry_bits(at, &in->series_us);
    carry_bits(at, &in->candidate_us);
    carry_bits(at, &in->same_us);
    carry_bits(at, &in->received);
    carry_count(at, &in->valid, position);
    carry_count(at, &in->held_blocks, guard[GUARD_MISSING].bits + 1U);
#if GTC_WITH_CHANNELS
    carry_count(at, &in->clamped, CLAMPED_NOW | CLAMPED_MEAN);
#endif
    carry_within(at, &in->last, least, most);
    carry_within(at, &in->candidate, least, most);
    carry_within(at, &in->base, least, most);
    carry_within(at, &in->mean, least, most);
    carry_wide(at, &in->sum);
    /* The sum last: its bounds are products of what was tested before. */
    if (at->is_sound != 0) {
        at->is_sound = sum_fits(in, low, high);
    }
}

/* The front end: everything that the running block and the next correction depend on. */
static void carry_front(cursor_t *at, STATE *state, const TABLE *table)
{
    gtc_word_t status;
    uint_least32_t i;

    status.integer = state->status;
    carry_count(at, &status.bits, (2U * (uint_least32_t)GTC_CHANNEL_LOST) - 1U);
    if (at->to == NULL) {
        state->status = status.integer;
    }
    carry_bits(at, &state->period_us);
    carry_count(at, &state->position, MAX_SAMPLES_PER_BLOCK);
    carry_count(at, &state->filled, table->slope_blocks);
    carry_bits(at, &state->window_valid);
#if GTC_WITH_TERMS
    carry_count(at, &state->elapsed, MAX_ELAPSED);
    carry_bits(at, &state->off_blocks);
#endif
    carry_number(at, &state->bias);
    for (i = 0U; i < (uint_least32_t)GTC_MAX_SLOPE_BLOCKS; i++) {
        carry_temp(at, &state->window[i]);
    }
    for (i = 0U; i < GTC_MAX_CHANNELS; i++) {
        const uint_least32_t channel = (i < table->n_channels) ? i : 0U;

        carry_input(at, &state->input[i], guard_of(table, channel), state->position);
    }
}

#if GTC_WITH_RETAINED
/* The state of a term; nothing of it is known where it never began, or has none. */
static void carry_term(cursor_t *at, STATE *state, const TABLE *table, uint_least32_t i)
{
    NUM *const z = state->term[i];

    carry_any(at, &z[0]);
    carry_any(at, &z[1]);
    if (is_missing(z[0]) != 0) {
        at->is_sound &= ((state->input[0].next_gap_us == 0U) || (is_retained_term(table, i) == 0)) ? 1 : 0;
    } else {
        at->is_sound &= ((z[0] >= NUM_COLDEST)
                         && (z[0] <= NUM_HOTTEST) && is_fraction(z[1])) ? 1 : 0;
    }
}

#endif

#if GTC_WITH_UNCERTAINTY
/* What the uncertainty is computed from. */
static void carry_uncertainty(cursor_t *at, STATE *state)
{
    carry_number(at, &state->uncertainty.input[0]);
    carry_number(at, &state->uncertainty.input[1]);
    carry_number(at, &state->uncertainty.slope);
    carry_temp(at, &state->uncertainty.first_temp);
    carry_bits(at, &state->uncertainty.slope_known);
    carry_count(at, &state->uncertainty.missing, MAX_SAMPLES_PER_BLOCK);
#if GTC_WITH_TERMS
    carry_temp(at, &state->uncertainty.lowest);
    carry_temp(at, &state->uncertainty.highest);
    carry_number(at, &state->uncertainty.edge_effect);
    carry_bits(at, &state->uncertainty.terms_since);
    carry_bits(at, &state->uncertainty.terms_known);
#endif
}

#endif

#if GTC_WITH_REZERO
static void carry_shift(cursor_t *at, STATE *state, const TABLE *table)
{
    const NUM most = MEMBER(table->rezero);

    carry_number(at, &state->unshifted);
    carry_within(at, &state->shift, -most, most);
    carry_number(at, &state->shift_sigma);
}

#endif

/* All of a state but what init() makes of table and period_us, and the clock; with `to`, nothing of it is written.
 * Returns 1 if it is sound. */
static int carry_state(STATE *state, const TABLE *table, gtc_word_t *to, const gtc_word_t *from)
{
    cursor_t at;
#if GTC_WITH_RETAINED
    uint_least32_t i;
#endif

    at.to = to;
    at.from = from;
    at.is_sound = 1;
    carry_front(&at, state, table);
#if GTC_WITH_RETAINED
    for (i = 0U; i < (uint_least32_t)GTC_MAX_TERMS; i++) {
        carry_term(&at, state, table, i);
    }
#endif
#if GTC_WITH_UNCERTAINTY
    carry_uncertainty(&at, state);
#endif
#if GTC_WITH_REZERO
    carry_shift(&at, state, table);
#endif
    return at.is_sound;
}

static uint_least32_t save_crc(const gtc_word_t words[GTC_SAVE_WORDS])
{
    return crc_words(CRC_START, words, CRC_AT) ^ CRC_FINAL;
}

int PUBLIC(save)(const STATE *state, const TABLE *table, gtc_word_t words[GTC_SAVE_WORDS])
{
    const int status = (words == NULL) ? GTC_E_ARG : check_state(state, table);

    if (status != GTC_OK) {
        return status;
    }
    words[0].bits = SAVE_MAGIC;
    words[1].bits = ARITHMETIC + GTC_SAVE_OPTIONS;
    words[2].bits = state->table_crc;
    /* MISRA 11.8: one text carries both ways; this way the state is only read. */
    (void)carry_state((STATE *)state, table, &words[SAVE_HEAD], words);
    words[CRC_AT].bits = save_crc(words);
    return GTC_OK;
}

/* GTC_OK for words that are a whole state of this table, saved by a build like this one, or why they are not. */
static int inspect_saved(const TABLE *table, const gtc_word_t words[GTC_SAVE_WORDS])
{
    int status = GTC_OK;

    if ((words[0].bits != SAVE_MAGIC)
        || (words[CRC_AT].bits != save_crc(words))) {
        status = GTC_E_IMAGE;
    } else if (words[1].bits != (ARITHMETIC + GTC_SAVE_OPTIONS)) {
        status = GTC_E_LAYOUT;
    } else if (words[2].bits != table->crc) {
        status = GTC_E_ID;
    } else {
        /* it is */
    }
    return status;
}

/* Reduces a state that was read to what is retained over a time without power: its terms. If it had not begun when it
 * was saved, it had itself been without power before. */
static void retain(STATE *state, const TABLE *table, uint_least32_t off_blocks)
{
#if GTC_WITH_TERMS
    const uint_least32_t before = (state->input[0].next_gap_us == 0U) ? state->off_blocks : 0U;
#endif
#if GTC_WITH_RETAINED
    uint_least32_t i;
#endif

    clear_front_end(state);
#if GTC_WITH_CHANNELS
    set_fallback_means(state, table);
#endif
#if GTC_WITH_REZERO
    if (off_blocks != 0U) {
        rezero_clear(state, table);
    }
#endif
#if GTC_WITH_TERMS
    state->off_blocks = add_us(before, off_blocks);
#endif
#if GTC_WITH_RETAINED
    for (i = 0U; i < (uint_least32_t)GTC_MAX_TERMS; i++) {
        if (is_retained_term(table, i) == 0) {
            reset_term(state, i);
        }
    }
#endif
#if !GTC_WITH_RETAINED && !GTC_WITH_CHANNELS && !GTC_WITH_UNCERTAINTY
    (void)table;
#endif
#if !GTC_WITH_TERMS && !GTC_WITH_UNCERTAINTY
    (void)off_blocks;
#endif
}

/* The state that the words hold, after so many blocks without power. Returns 1 if it is one that calls could have
 * left. */
static int take_over(STATE *state, const TABLE *table, uint_least32_t period_us, const gtc_word_t *words,
                         uint_least32_t off_blocks)
{
    int is_sound;

    start_state(state, table, period_us);
    is_sound = carry_state(state, table, NULL, &words[SAVE_HEAD]);
    if ((off_blocks != 0U) || (state->period_us != period_us)) {
        state->period_us = period_us;
        retain(state, table, off_blocks);
    }
    return ((is_sound != 0) && (state->position <= state->samples_per_block)) ? 1 : 0;
}

int PUBLIC(restore)(STATE *state, const TABLE *table, uint_least32_t period_us,
                    const gtc_word_t words[GTC_SAVE_WORDS], uint_least32_t off_blocks)
{
    int status = (words == NULL) ? GTC_E_ARG : check_start(state, table, period_us);
    STATE read;

    if (status == GTC_OK) {
        status = inspect_saved(table, words);
    }
    if ((status == GTC_OK) && (take_over(&read, table, period_us, words, off_blocks) == 0)) {
        status = GTC_E_IMAGE;
    }
    if (status == GTC_OK) {
        *state = read;
    }
    return status;
}
#endif
