/* gtc_sigma.inl - how uncertain a correction is.
 *
 * docs/design.md (How uncertain a correction is) gives the rules with their reasons.
 * All of it is a function of a state: whoever does not ask for a snapshot pays a few words at the end of a block.
 *
 * SPDX-License-Identifier: MIT
 */

#if GTC_WITH_UNCERTAINTY
/* Words of a table's uncertainty behind its grids; then one for each term. */
#define RULE_HOLD 0U        /* deg/h per C that a held input may have gone on by at its slope */
#define RULE_REST 1U        /* deg/h per block for which a correction is held, as T may move at any trained slope */
#define RULE_SLOPE 2U       /* deg/h per C/block of a slope that is known and not in the correction yet */
#define RULE_START 3U       /* deg/h: nothing is known of the slope */
#define RULE_TURN 4U        /* deg/h: a held input may have turned to any trained slope */
#define RULE_BEYOND 5U      /* deg/h per C, deg/h per C/block beyond the envelope */
#define RULE_FALLBACK 7U    /* deg/h about the constant correction */
#define RULE_NONE 8U        /* deg/h of the bias itself */
#define RULE_BETWEEN 9U     /* deg/h of the constant from power-on to power-on */
#if GTC_WITH_REZERO
#define RULE_NOISE 10U      /* deg/h of a mean of the rate over 1 s */
#endif
#define RULE_CORRELATION 11U /* s */

/* 1 if a table says how uncertain its corrections are: grids, rules, and a word for each term. */
static int has_sigma(const TABLE *table)
{
    return (table->n_sigma != 0U) ? 1 : 0;
}

/* Number of grids: one for covered cells, one for those that are not, if the table says which are. */
static uint_least32_t sigma_grids(const TABLE *table)
{
#if GTC_WITH_COVERAGE
    return (table->coverage == NULL) ? 1U : 2U;
#else
    (void)table;
    return 1U;
#endif
}

/* The rules, which are behind the grids. */
static const gtc_word_t *rules_of(const TABLE *table)
{
    return &table->sigma[sigma_grids(table) * table->sigma_cells[0] * table->sigma_cells[1]];
}

/* ---- what a state takes note of ------------------------------------------------------------------ */

static void uncertainty_clear(STATE *state)
{
    state->uncertainty.input[0] = NUM_ZERO;
    state->uncertainty.input[1] = NUM_ZERO;
    state->uncertainty.slope = NUM_ZERO;
    state->uncertainty.first_temp = NUM_ZERO;
    state->uncertainty.slope_known = 0U;
    state->uncertainty.missing = 0U;
#if GTC_WITH_TERMS
    state->uncertainty.lowest = NUM_ZERO;
    state->uncertainty.highest = NUM_ZERO;
    state->uncertainty.edge_effect = NUM_ZERO;
    state->uncertainty.terms_since = 0U;
    state->uncertainty.terms_known = 0U;
#endif
}

#if GTC_WITH_TERMS
/* The terms begin at x, the first temperature within the envelope: those whose memory was retained know where they
 * were. */
static void uncertainty_terms_begin(STATE *state, const TABLE *table, NUM x)
{
#if GTC_WITH_RETAINED
    uint_least32_t i;
#endif

    state->uncertainty.terms_known = 0U;
#if GTC_WITH_RETAINED
    for (i = 0U; i < table->n_terms; i++) {
        if (!is_missing(state->term[i][0])) {
            state->uncertainty.terms_known |= (uint_least32_t)1U << i;
        }
    }
#else
    (void)table;
#endif
    state->uncertainty.terms_since = state->elapsed;
    state->uncertainty.lowest = x;
    state->uncertainty.highest = x;
}

/* A block ends, of which the terms see this temperature. */
static void uncertainty_step(STATE *state, NUM x)
{
    if (x < state->uncertainty.lowest) {
        state->uncertainty.lowest = x;
    }
    if (x > state->uncertainty.highest) {
        state->uncertainty.highest = x;
    }
}
#endif

/* The map is asked at an input; `slope` is that of the window, 0 while it is not full. */
static void uncertainty_input(STATE *state, const TABLE *table, NUM temp, NUM asked_slope, NUM slope,
                              int_least32_t remarks)
{
    const uint_least32_t filled = state->filled;

    state->uncertainty.input[0] = temp;
    state->uncertainty.input[1] = asked_slope;
    state->uncertainty.slope_known = 2U;
    state->uncertainty.slope = slope;
    if ((remarks & GTC_WARMING) != 0) {
        if ((filled >= 2U) && (filled < table->slope_blocks)) {
            const WIDE d = diff(state->input[0].mean, state->uncertainty.first_temp);

            state->uncertainty.slope = NARROW(rounded_quotient(scaled(2U, d), (2U * filled) - 1U));
        } else {
            state->uncertainty.slope_known = 1U;
        }
    }
}

/* ---- the parts of a variance ------------------------------------------------------------------------- */

/* Variance of the map, from the grid of covered or that of uncovered cells: where it was asked, but with the slope that
 * the correction should have had, where one is known that is not in it yet; `unknown` where the input is no number. */
static SQUARE variance_of_map(const STATE *state, const TABLE *table, SQUARE unknown)
{
    NUM slope = state->uncertainty.input[1];
    uint_least32_t cell[2];
    uint_least32_t index;
    POINT in;

    if (((state->status & GTC_WARMING) != 0) && (state->uncertainty.slope_known == 2U)) {
        slope = state->uncertainty.slope;
    }
    if (locate(table, state->uncertainty.input[0], slope, &in) < 0) {
        return unknown;
    }
    cells_of(table, &in, table->sigma_cells, cell);
    index = (cell[1] * table->sigma_cells[0]) + cell[0];
#if GTC_WITH_COVERAGE
    if (((state->status & GTC_UNCOVERED) != 0) && (sigma_grids(table) == 2U)) {
        index += table->sigma_cells[0] * table->sigma_cells[1];
    }
#endif
    return squared(ELEMENT(table->sigma[index]));
}

/* What x, of a block, comes to in the blocks for which the correction is held, and in the part of the last one without
 * readings: its mean is that of the other part. */
static WIDE without_readings(const STATE *state, WIDE x)
{
    const uint_least32_t samples = state->samples_per_block;
    const uint_least32_t missing = (state->uncertainty.missing < samples) ? state->uncertainty.missing : samples;

    return add(scaled(state->input[0].held_blocks, x), rounded_quotient(scaled(missing, x), samples));
}

/* Variance of an input that went on while nothing was read. */
static SQUARE variance_of_age(const STATE *state, const gtc_word_t *rules)
{
    WIDE moved;
    SQUARE square;

    if ((state->input[0].held_blocks == 0U) && (state->uncertainty.missing == 0U)) {
        return NO_SQUARE;
    }
    moved = FACTOR(scaled_difference(state->uncertainty.slope, NUM_ZERO, ELEMENT(rules[RULE_HOLD])));
    square = squared(without_readings(state, moved));
    return add_squares(square, squared(without_readings(state, ELEMENT(rules[RULE_REST]))));
}

/* Variance of a slope that the correction does not have: while it is held, as the temperature may then turn to any
 * slope, and while the window fills. */
static SQUARE variance_of_slope(const STATE *state, const gtc_word_t *rules)
{
    SQUARE square = NO_SQUARE;

    if (state->input[0].held_blocks != 0U) {
        square = squared(ELEMENT(rules[RULE_TURN]));
    } else if ((state->status & GTC_WARMING) == 0) {
        /* it has the slope */
    } else if (state->uncertainty.slope_known != 2U) {
        square = squared(ELEMENT(rules[RULE_START]));
    } else {
        square = squared(scaled_difference(state->uncertainty.slope, NUM_ZERO, ELEMENT(rules[RULE_SLOPE])));
    }
    return square;
}

/* Variance of inputs beyond the envelope. */
static SQUARE variance_beyond(const STATE *state, const TABLE *table, const gtc_word_t *rules)
{
    SQUARE sum = NO_SQUARE;
    int_least32_t ignored = GTC_OK;
    uint_least32_t k;

    for (k = 0U; k < 2U; k++) {
        const NUM x = state->uncertainty.input[k];
        const NUM low = MEMBER(table->envelope[2U * k]);
        const NUM high = MEMBER(table->envelope[(2U * k) + 1U]);
        const NUM edge = saturate(x, low, high, &ignored);

        sum = add_squares(sum, squared(scaled_difference(x, edge, ELEMENT(rules[RULE_BEYOND + k]))));
    }
    return sum;
}

#if GTC_WITH_RETAINED || GTC_WITH_CHANNELS
/* Variance of what terms do not know of the time before they began, or of a channel that is held, lost or beyond its
 * range. */
static SQUARE variance_of_terms(const STATE *state, const TABLE *table, const gtc_word_t *rules)
{
    SQUARE sum = squared(state->uncertainty.edge_effect);
    uint_least32_t i;

    for (i = 0U; i < table->n_terms; i++) {
        const uint_least32_t kind = term_of(table, i)[TERM_KIND].bits;
        const NUM word = ELEMENT(rules[GTC_SIGMA_RULES + i]);

        if (((state->uncertainty.terms_known >> i) & 1U) != 0U) {
            /* it went on from where it was, or the mean of its channel is new and within its range */
#if GTC_WITH_CHANNELS
        } else if (((CHANNEL_KINDS >> kind) & 1U) != 0U) {
            sum = add_squares(sum, squared(word));
#endif
#if GTC_WITH_MEMORY
        } else if (kind == GTC_TERM_MEMORY) {
            sum = add_squares(sum, squared(remaining(word, parameter(table, i, MEMORY_GAIN),
                                                          state->elapsed - state->uncertainty.terms_since)));
#endif
#if GTC_WITH_PLAY
        } else if (kind == GTC_TERM_PLAY) {
            sum = add_squares(sum, squared(unsettled(parameter(table, i, PLAY_WIDTH), state->uncertainty.lowest,
                                                          state->uncertainty.highest, word)));
#endif
        } else {
            /* it has no state */
        }
    }
    return sum;
}
#endif

/* Variance of the correction in force, but for the constant from power-on to power-on. Of a state that was overwritten
 * nothing is known. */
static SQUARE variance(const STATE *state, const TABLE *table)
{
    const gtc_word_t *const rules = rules_of(table);
    const SQUARE unknown = squared(ELEMENT(rules[RULE_NONE]));
    SQUARE sum;

    if ((state->status & GTC_FALLBACK) != 0) {
        sum = squared(ELEMENT(rules[RULE_FALLBACK]));
    } else if (state->uncertainty.slope_known == 0U) {
        sum = unknown;
    } else {
        sum = add_squares(variance_of_map(state, table, unknown), variance_of_age(state, rules));
        sum = add_squares(sum, variance_of_slope(state, rules));
        sum = add_squares(sum, variance_beyond(state, table, rules));
#if GTC_WITH_RETAINED || GTC_WITH_CHANNELS
        sum = add_squares(sum, variance_of_terms(state, table, rules));
#endif
    }
    return square_or(sum, unknown);
}

/* ---- the constant of a power-on ------------------------------------------------------------------- */

/* Variance of the constant from power-on to power-on. */
static SQUARE variance_between(const TABLE *table)
{
    return squared(ELEMENT(rules_of(table)[RULE_BETWEEN]));
}

#if GTC_WITH_REZERO
/* No shift; the constant is as uncertain as from power-on to power-on. */
static void rezero_clear(STATE *state, const TABLE *table)
{
    state->shift = NUM_ZERO;
    state->shift_sigma = has_sigma(table) ? ELEMENT(rules_of(table)[RULE_BETWEEN]) : NUM_ZERO;
}

/* Variance of the constant, which a re-zero makes smaller. */
static SQUARE variance_of_constant(const STATE *state, const TABLE *table)
{
    return square_or(squared(state->shift_sigma), variance_between(table));
}
#endif
#endif
