/* gtc_save.inl - a state over power cycles, in the numbers included before.
 *
 * docs/numerics.md, section 7, gives the words. One text serves both directions, so that they cannot
 * drift apart.
 *
 * SPDX-License-Identifier: MIT
 */

/* Changes with the order of the words. */
#define SAVE_MAGIC 0x47545334UL

/* What another build may have otherwise. */
#define SAVE_OPTIONS \
    (ARITHMETIC + (256UL * (uint_least32_t)GTC_MAX_TERMS) + (65536UL * (uint_least32_t)GTC_MAX_SLOPE_BLOCKS))

/* Words before the state: magic, options, CRC of the table. */
#define SAVE_HEAD 3U
#define CRC_AT (GTC_SAVE_WORDS - 1)

/* Where the next word goes to, or, if that is NULL, comes from. Volatile: no memcpy(). */
typedef struct {
    volatile gtc_word_t *to;
    const volatile gtc_word_t *from;
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

static void FN(carry)(FN(cursor_t) *at, NUM *x)
{
    gtc_word_t word;

    ELEMENT(word) = *x;
    FN(carry_bits)(at, &word.bits);
    if (at->to == NULL) {
        *x = ELEMENT(word);
    }
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

/* One channel. */
static void FN(carry_input)(FN(cursor_t) *at, INPUT *in)
{
    FN(carry_bits)(at, &in->gap_us);
    FN(carry_bits)(at, &in->agreed_us);
    FN(carry_bits)(at, &in->same_us);
    FN(carry_bits)(at, &in->received);
    FN(carry_bits)(at, &in->valid);
    FN(carry_bits)(at, &in->held_blocks);
    FN(carry_bits)(at, &in->clamped);
    FN(carry)(at, &in->last);
    FN(carry)(at, &in->candidate);
    FN(carry)(at, &in->base);
    FN(carry)(at, &in->mean);
    FN(carry_wide)(at, &in->sum);
}

/* The front end: everything that the running block and the next correction depend on. */
static void FN(carry_front)(FN(cursor_t) *at, STATE *state)
{
    gtc_word_t status;
    uint_least32_t i;

    status.integer = state->status;
    FN(carry_bits)(at, &status.bits);
    if (at->to == NULL) {
        state->status = status.integer;
    }
    FN(carry_bits)(at, &state->period_us);
    FN(carry_bits)(at, &state->position);
    FN(carry_bits)(at, &state->filled);
    FN(carry_bits)(at, &state->window_valid);
    FN(carry_bits)(at, &state->elapsed);
    FN(carry_bits)(at, &state->off_blocks);
    FN(carry)(at, &state->bias);
    for (i = 0U; i < (uint_least32_t)GTC_MAX_SLOPE_BLOCKS; i++) {
        FN(carry)(at, &state->window[i]);
    }
    for (i = 0U; i <= (uint_least32_t)GTC_MAX_TERMS; i++) {
        FN(carry_input)(at, &state->input[i]);
    }
}

/* What the uncertainty is computed from, and the shift of the constant. */
static void FN(carry_uncertainty)(FN(cursor_t) *at, STATE *state)
{
    FN(carry)(at, &state->uncertainty.input[0]);
    FN(carry)(at, &state->uncertainty.input[1]);
    FN(carry)(at, &state->uncertainty.slope);
    FN(carry)(at, &state->uncertainty.first_temp);
    FN(carry)(at, &state->uncertainty.lowest);
    FN(carry)(at, &state->uncertainty.highest);
    FN(carry)(at, &state->uncertainty.unshifted);
    FN(carry)(at, &state->uncertainty.edge_effect);
    FN(carry_bits)(at, &state->uncertainty.terms_since);
    FN(carry_bits)(at, &state->uncertainty.terms_known);
    FN(carry_bits)(at, &state->uncertainty.slope_known);
    FN(carry)(at, &state->shift);
    FN(carry)(at, &state->shift_sigma);
}

/* All of a state but what init() makes of table and period_us, and the clock; with `to`, nothing of it is written. */
static void FN(carry_state)(STATE *state, gtc_word_t *to, const gtc_word_t *from)
{
    FN(cursor_t) at;
    uint_least32_t i;

    at.to = to;
    at.from = from;
    FN(carry_front)(&at, state);
    for (i = 0U; i < (uint_least32_t)GTC_TERM_SLOTS; i++) {
        FN(carry)(&at, &state->term[i][0]);
        FN(carry)(&at, &state->term[i][1]);
    }
    FN(carry_uncertainty)(&at, state);
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
    FN(carry_state)((STATE *)state, &words[SAVE_HEAD], words);
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

static NUM FN(lesser_of)(NUM a, NUM b)
{
    return (a < b) ? a : b;
}

static int FN(is_within)(NUM x, NUM low, NUM high)
{
    return ((x >= low) && (x <= high)) ? 1 : 0;
}

static int FN(counts_fit)(const STATE *state, const INPUT *in, const gtc_word_t *guard)
{
    return ((state->position <= state->samples_per_block) && (in->valid <= state->position)
            && (in->clamped <= (CLAMPED_NOW | CLAMPED_MEAN))
            && (in->held_blocks <= (guard[GUARD_MISSING].bits + 1U))) ? 1 : 0;
}

/* Numbers of a channel within its range (0 before the first reading), counts within the block: what no call would
 * have left is refused. */
static int FN(input_fits)(const STATE *state, const INPUT *in, const gtc_word_t *guard)
{
    const NUM low = FN(lesser_of)(ELEMENT(guard[GUARD_LOW]), NUM_ZERO);
    const NUM high = -FN(lesser_of)(-ELEMENT(guard[GUARD_HIGH]), NUM_ZERO);
    int numbers = FN(counts_fit)(state, in, guard);

    numbers &= FN(is_within)(in->mean, low, high) & FN(is_within)(in->last, low, high)
               & FN(is_within)(in->base, low, high) & FN(is_within)(in->candidate, low, high);
    /* The sum last: its bounds are products of what was tested before. */
    return (numbers != 0) ? FN(sum_fits)(in, ELEMENT(guard[GUARD_LOW]), ELEMENT(guard[GUARD_HIGH])) : 0;
}

/* A temperature of the window, or of a term, which an envelope may have moved. */
static int FN(is_temperature)(NUM x)
{
    return FN(is_within)(x, FN(number_limits)[NUMBER_ENVELOPE].least, FN(number_limits)[NUMBER_ENVELOPE].most);
}

/* Whether a term has a memory since the first temperature. */
static int FN(is_retained)(const STATE *state, uint_least32_t i)
{
    return ((state->input[0].gap_us != 0U) && (i < FN(n_terms)(state->table))
            && (FN(code_of)(state->table, i)->is_retained != 0U)) ? 1 : 0;
}

static int FN(terms_are_sound)(const STATE *state)
{
    int sound = 1;
    uint_least32_t i;

    for (i = 0U; i < (uint_least32_t)GTC_TERM_SLOTS; i++) {
        const NUM z = state->term[i][0];

        if (FN(is_missing)(z) != 0) {
            sound &= 1 - FN(is_retained)(state, i);
        } else {
            sound &= FN(is_temperature)(z) & FN(is_fraction)(state->term[i][1]);
        }
    }
    return sound;
}

/* A re-zeroed constant: a number, and a shift that the table grants. */
static int FN(shift_is_sound)(const STATE *state)
{
    const NUM most = MEMBER(state->table->rezero);

    return ((!FN(is_missing)(state->shift_sigma)) && (state->shift >= -most) && (state->shift <= most)) ? 1 : 0;
}

/* What the uncertainty is computed from: numbers and temperatures. */
static int FN(uncertainty_is_sound)(const STATE *state)
{
    return ((!FN(is_missing)(state->uncertainty.input[0])) && (!FN(is_missing)(state->uncertainty.input[1]))
            && (!FN(is_missing)(state->uncertainty.slope)) && (!FN(is_missing)(state->uncertainty.unshifted)) && (!FN(is_missing)(state->uncertainty.edge_effect))
            && FN(is_temperature)(state->uncertainty.first_temp) && FN(is_temperature)(state->uncertainty.lowest)
            && FN(is_temperature)(state->uncertainty.highest)) ? 1 : 0;
}

/* Whether a state is one that calls could have left, as far as no function of it meets a run-time error. */
static int FN(is_sound)(const STATE *state)
{
    int sound = 1;
    uint_least32_t i;

    sound &= ((state->position <= state->samples_per_block) && (state->filled <= state->table->slope_blocks)
              && (state->elapsed <= MAX_ELAPSED) && (state->status >= 0)
              && (state->status < (2 * GTC_CHANNEL_LOST))) ? 1 : 0;

    for (i = 0U; i < FN(n_channels)(state->table); i++) {
        sound &= FN(input_fits)(state, &state->input[i], FN(guard)(state, i));
    }
    for (i = 0U; i < (uint_least32_t)GTC_MAX_SLOPE_BLOCKS; i++) {
        sound &= FN(is_temperature)(state->window[i]);
    }
    return sound & FN(terms_are_sound)(state) & FN(uncertainty_is_sound)(state) & FN(shift_is_sound)(state)
           & ((FN(is_missing)(state->bias) != 0) ? 0 : 1);
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
        if ((i >= FN(n_terms)(state->table)) || (FN(code_of)(state->table, i)->is_retained == 0U)) {
            FN(reset_term)(state, i);
        }
    }
}

/* The state that the words hold, after so many blocks without power. */
static void FN(take_over)(STATE *state, const TABLE *table, uint_least32_t period_us, const gtc_word_t *words,
                          uint_least32_t off_blocks)
{
    FN(start)(state, table, period_us);
    FN(carry_state)(state, NULL, &words[SAVE_HEAD]);
    if ((off_blocks != 0U) || (state->period_us != period_us)) {
        state->period_us = period_us;
        FN(retain)(state, off_blocks);
    }
}

static int FN(run_restore)(STATE *state, const TABLE *table, uint_least32_t period_us,
                           const gtc_word_t words[GTC_SAVE_WORDS], uint_least32_t off_blocks)
{
    int status = (words == NULL) ? GTC_E_ARG : FN(can_start)(state, table, period_us);
    STATE read;

    if (status == GTC_OK) {
        status = FN(inspect)(table, words);
    }
    if (status == GTC_OK) {
        FN(take_over)(&read, table, period_us, words, off_blocks);
        if (FN(is_sound)(&read) != 0) {
            FN(take_over)(state, table, period_us, words, off_blocks);
        } else {
            status = GTC_E_IMAGE;
        }
    }
    return status;
}
