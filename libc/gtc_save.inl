/* gtc_save.inl - a state over power cycles, in the numbers included before.
 *
 * docs/numerics.md, section 7, gives the words. One text serves both directions, so that they cannot
 * drift apart.
 *
 * SPDX-License-Identifier: MIT
 */

/* Changes with the order of the words. */
#define SAVE_MAGIC 0x47545332UL

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
    FN(carry_bits)(at, &state->samples_per_block);
    FN(carry_bits)(at, &state->position);
    FN(carry_bits)(at, &state->valid);
    FN(carry_bits)(at, &state->gap);
    FN(carry_bits)(at, &state->suspects);
    FN(carry_bits)(at, &state->received);
    FN(carry_bits)(at, &state->repeats);
    FN(carry_bits)(at, &state->held_blocks);
    FN(carry_bits)(at, &state->filled);
    FN(carry_bits)(at, &state->window_valid);
    FN(carry)(at, &state->last);
    FN(carry)(at, &state->candidate);
    FN(carry)(at, &state->base);
    FN(carry)(at, &state->mean);
    FN(carry)(at, &state->bias);
    FN(carry_wide)(at, &state->sum);
    for (i = 0U; i < (uint_least32_t)GTC_MAX_SLOPE_BLOCKS; i++) {
        FN(carry)(at, &state->window[i]);
    }
}

/* The terms, and the time by which they go. */
static void FN(carry_terms)(FN(cursor_t) *at, STATE *state)
{
    uint_least32_t i;

    FN(carry_bits)(at, &state->elapsed);
    FN(carry_bits)(at, &state->off_blocks);
    for (i = 0U; i < (uint_least32_t)GTC_MAX_TERMS; i++) {
        FN(carry)(at, &state->term[i][0]);
        FN(carry)(at, &state->term[i][1]);
        FN(carry_wide)(at, &state->channel[i]);
        FN(carry_bits)(at, &state->channel_valid[i]);
    }
}

/* All of a state but what init() makes of table and samples_per_block; with `to`, nothing of it is written. */
static void FN(carry_state)(STATE *state, gtc_word_t *to, const gtc_word_t *from)
{
    FN(cursor_t) at;

    at.to = to;
    at.from = from;
    FN(carry_front)(&at, state);
    FN(carry_terms)(&at, state);
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

/* Of a state that was read, what outlasts a time without power: terms. If it had not begun when it was saved,
 * it had itself been without power before. */
static void FN(outlast)(STATE *state, uint_least32_t samples_per_block, uint_least32_t off_blocks)
{
    const uint_least32_t before = (state->gap == 0U) ? state->off_blocks : 0U;
    const uint_least32_t room = 0xFFFFFFFFUL - before;
    uint_least32_t i;

    FN(clear)(state, samples_per_block);
    state->off_blocks = before + ((off_blocks < room) ? off_blocks : room);
    for (i = 0U; i < (uint_least32_t)GTC_MAX_TERMS; i++) {
        state->channel[i] = NUM_ZERO;
        state->channel_valid[i] = 0U;
        if ((i >= state->table->n_terms) || (state->table->term_code[i]->survives == 0U)) {
            FN(forget)(state, i);
        }
    }
}

static int FN(run_restore)(STATE *state, const TABLE *table, uint_least32_t samples_per_block,
                           const gtc_word_t words[GTC_SAVE_WORDS], uint_least32_t off_blocks)
{
    int status = (words == NULL) ? GTC_E_ARG : FN(can_start)(state, table, samples_per_block);

    if (status == GTC_OK) {
        status = FN(inspect)(table, words);
    }
    if (status == GTC_OK) {
        FN(start)(state, table, samples_per_block);
        FN(carry_state)(state, NULL, &words[SAVE_HEAD]);
        if ((off_blocks != 0U) || (state->samples_per_block != samples_per_block)) {
            FN(outlast)(state, samples_per_block, off_blocks);
        }
    }
    return status;
}
