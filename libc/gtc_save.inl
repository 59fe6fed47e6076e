/* gtc_save.inl - a state over power cycles, in the numbers included before.
 *
 * Words: magic, options, checksum of the table, gap, filled, window_valid, held_blocks, status, mean,
 * last, bias; the window; the states of the terms; CRC-32 over all before it.
 *
 * SPDX-License-Identifier: MIT
 */

#define SAVE_MAGIC 0x47545331UL
#define SAVE_HEAD 11U

/* A build with other options has another number of words. */
#define SAVE_OPTIONS (ARITHMETIC + (256UL * GTC_MAX_SLOPE_BLOCKS) + (65536UL * GTC_MAX_TERMS))

static uint_least32_t FN(save_crc)(const gtc_word_t words[GTC_SAVE_WORDS])
{
    return gtc_crc_words(GTC_CRC_START, words, GTC_SAVE_WORDS - 1U) ^ GTC_CRC_FINAL;
}

int FN(save)(const STATE *state, gtc_word_t words[GTC_SAVE_WORDS])
{
    uint_least32_t i;

    if ((state == NULL) || (words == NULL) || (state->table == NULL)) {
        return GTC_E_ARG;
    }
    words[0].bits = SAVE_MAGIC;
    words[1].bits = SAVE_OPTIONS;
    words[2].bits = state->table->crc;
    words[3].bits = state->gap;
    words[4].bits = state->filled;
    words[5].bits = state->window_valid;
    words[6].bits = state->held_blocks;
    words[7].integer = state->status;
    ELEMENT(words[8]) = state->mean;
    ELEMENT(words[9]) = state->last;
    ELEMENT(words[10]) = state->bias;
    for (i = 0U; i < GTC_MAX_SLOPE_BLOCKS; i++) {
        ELEMENT(words[SAVE_HEAD + i]) = state->window[i];
    }
    for (i = 0U; i < GTC_MAX_TERMS; i++) {
        gtc_word_t *const pair = &words[SAVE_HEAD + GTC_MAX_SLOPE_BLOCKS + (2U * i)];

        ELEMENT(pair[0]) = state->term[i][0];
        ELEMENT(pair[1]) = state->term[i][1];
    }
    words[GTC_SAVE_WORDS - 1].bits = FN(save_crc)(words);
    return GTC_OK;
}

/* Whether the words are a state of this table in this build. */
static int FN(inspect)(const TABLE *table, const gtc_word_t words[GTC_SAVE_WORDS])
{
    int status = GTC_OK;

    if ((words[0].bits != SAVE_MAGIC)
        || (words[GTC_SAVE_WORDS - 1].bits != FN(save_crc)(words))) {
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

/* The window and the correction go on where they were; samples since then count as held. */
static void FN(resume)(STATE *state, const gtc_word_t words[GTC_SAVE_WORDS])
{
    uint_least32_t i;

    state->gap = (words[3].bits == 0U) ? 0U : state->samples_per_block;
    state->filled = words[4].bits;
    state->window_valid = words[5].bits;
    state->held_blocks = words[6].bits;
    state->status = words[7].integer | GTC_HELD;
    state->mean = ELEMENT(words[8]);
    state->last = ELEMENT(words[9]);
    state->bias = ELEMENT(words[10]);
    for (i = 0U; i < GTC_MAX_SLOPE_BLOCKS; i++) {
        state->window[i] = ELEMENT(words[SAVE_HEAD + i]);
    }
}

int FN(restore)(STATE *state, const TABLE *table, uint_least32_t samples_per_block,
                const gtc_word_t words[GTC_SAVE_WORDS], uint_least32_t off_blocks)
{
    STATE fresh;
    uint_least32_t i;
    int status;

    if ((state == NULL) || (words == NULL)) {
        return GTC_E_ARG;
    }
    status = FN(init)(&fresh, table, samples_per_block);
    if (status == GTC_OK) {
        status = FN(inspect)(table, words);
    }
    if (status != GTC_OK) {
        return status;
    }
    fresh.off_blocks = off_blocks;
    for (i = 0U; i < table->n_terms; i++) {
        const gtc_word_t *const pair = &words[SAVE_HEAD + GTC_MAX_SLOPE_BLOCKS + (2U * i)];

        if ((off_blocks == 0U) || (table->term_code[i]->survives != 0U)) {
            fresh.term[i][0] = ELEMENT(pair[0]);
            fresh.term[i][1] = ELEMENT(pair[1]);
        }
    }
    if (off_blocks == 0U) {
        FN(resume)(&fresh, words);
    }
    *state = fresh;
    return GTC_OK;
}
