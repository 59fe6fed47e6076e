/* gtc_sigma.inl - how uncertain a correction is, in the numbers included before.
 *
 * docs/design.md (How uncertain a correction is) gives the rules with their reasons; gen/gyrotc/mirror/sigma.py is
 * the mirror. All of it is a function of a state: whoever does not ask for a snapshot pays a few words at the end
 * of a block.
 *
 * SPDX-License-Identifier: MIT
 */

/* Words of a table's uncertainty behind its two grids; then one for each term. */
#define RULE_HOLD 0U        /* deg/h per C that a held input may have gone on by at its slope */
#define RULE_REST 1U        /* deg/h per block for which a correction is held, whatever its slope */
#define RULE_SLOPE 2U       /* deg/h per C/block of a slope that is known and not in the correction yet */
#define RULE_START 3U       /* deg/h: nothing is known of the slope */
#define RULE_BEYOND 4U      /* deg/h per C, deg/h per C/block beyond the envelope */
#define RULE_FALLBACK 6U    /* deg/h about the constant correction */
#define RULE_NONE 7U        /* deg/h of the bias itself */
#define RULE_BETWEEN 8U     /* deg/h of the constant from power-on to power-on */
#define RULE_NOISE 9U       /* deg/h of a mean of the rate over 1 s */
#define RULE_CORRELATION 10U /* s */

/* A table's words of uncertainty are all there, or none. */
static int FN(sigma_fits)(const TABLE *table)
{
    const uint_least32_t cells = table->sigma_cells[0] * table->sigma_cells[1];
    const uint_least32_t whole = (2U * cells) + GTC_SIGMA_RULES + table->n_terms;

    return ((table->n_sigma == 0U) || ((cells != 0U) && (table->n_sigma == whole))) ? 1 : 0;
}

#if GTC_WITH_UNCERTAINTY
/* 1 if a table says how uncertain its corrections are: two grids, rules, and a word for each term. */
static int FN(has_sigma)(const TABLE *table)
{
    return (table->n_sigma != 0U) ? 1 : 0;
}

static NUM FN(rule)(const TABLE *table, uint_least32_t k)
{
    return ELEMENT(table->sigma[(2U * table->sigma_cells[0] * table->sigma_cells[1]) + k]);
}

/* ---- what a state takes note of ------------------------------------------------------------------ */

static void FN(uncertainty_clear)(volatile STATE *state)
{
    state->uncertainty.input[0] = NUM_ZERO;
    state->uncertainty.input[1] = NUM_ZERO;
    state->uncertainty.slope = NUM_ZERO;
    state->uncertainty.first_temp = NUM_ZERO;
    state->uncertainty.lowest = NUM_ZERO;
    state->uncertainty.highest = NUM_ZERO;
    state->uncertainty.unshifted = NUM_ZERO;
    state->uncertainty.edge_effect = NUM_ZERO;
    state->uncertainty.terms_since = 0U;
    state->uncertainty.terms_known = 0U;
    state->uncertainty.slope_known = 0U;
    state->uncertainty.missing = 0U;
}

static uint_least32_t FN(terms_known)(const STATE *state)
{
    return state->uncertainty.terms_known;
}

/* The terms begin at x, the first temperature within the envelope: those whose memory was retained know where they were. */
static void FN(uncertainty_begin)(STATE *state, NUM first, NUM x)
{
    uint_least32_t i;

    state->uncertainty.terms_known = 0U;
    for (i = 0U; i < FN(n_terms)(state->table); i++) {
        if (!FN(is_missing)(state->term[i][0])) {
            state->uncertainty.terms_known |= (uint_least32_t)1U << i;
        }
    }
    state->uncertainty.first_temp = first;
    state->uncertainty.missing = 0U;
    state->uncertainty.terms_since = state->elapsed;
    state->uncertainty.lowest = x;
    state->uncertainty.highest = x;
}

/* The mean of a block is that of its readings; so many are missing. */
static void FN(uncertainty_block)(STATE *state, uint_least32_t missing)
{
    state->uncertainty.missing = missing;
}

/* A block ends, of which the terms see this temperature. */
static void FN(uncertainty_step)(STATE *state, NUM x)
{
    if (x < state->uncertainty.lowest) {
        state->uncertainty.lowest = x;
    }
    if (x > state->uncertainty.highest) {
        state->uncertainty.highest = x;
    }
}

/* The map is asked at an input; `slope` is that of the window, 0 while it is not full. */
static void FN(uncertainty_input)(STATE *state, const EFFECT *effect, NUM slope)
{
    const uint_least32_t filled = state->filled;

    state->uncertainty.terms_known = effect->terms_known;
    state->uncertainty.edge_effect = effect->edge_effect;
    state->uncertainty.input[0] = effect->temp;
    state->uncertainty.input[1] = effect->slope;
    state->uncertainty.slope_known = 2U;
    state->uncertainty.slope = slope;
    if ((effect->remarks & GTC_WARMING) != 0) {
        if ((filled >= 2U) && (filled < state->table->slope_blocks)) {
            const WIDE d = FN(diff)(state->input[0].mean, state->uncertainty.first_temp);

            state->uncertainty.slope = FN(quotient)(FN(scaled)(2U, d), (2U * filled) - 1U);
        } else {
            state->uncertainty.slope_known = 1U;
        }
    }
}

/* ---- the parts of a variance ------------------------------------------------------------------------- */

/* Of the map, from the grid of covered or that of uncovered cells: where it was asked, but with the slope that the
 * correction should have had, where one is known that is not in it yet. */
static SQUARE FN(variance_of_map)(const STATE *state)
{
    const TABLE *const table = state->table;
    NUM slope = state->uncertainty.input[1];
    uint_least32_t cell[2];
    uint_least32_t index;
    POINT in;

    if (((state->status & GTC_WARMING) != 0) && (state->uncertainty.slope_known == 2U)) {
        slope = state->uncertainty.slope;
    }
    if (FN(locate)(table, state->uncertainty.input[0], slope, &in) < 0) {
        return FN(squared)(FN(rule)(table, RULE_NONE));
    }
    FN(cells)(table, &in, table->sigma_cells, cell);
    index = (cell[1] * table->sigma_cells[0]) + cell[0];
    if ((state->status & GTC_UNCOVERED) != 0) {
        index += table->sigma_cells[0] * table->sigma_cells[1];
    }
    return FN(squared)(ELEMENT(table->sigma[index]));
}

/* What x, of a block, comes to in the blocks for which the correction is held, and in the part of the last one without
 * readings: its mean is that of the other part. */
static WIDE FN(without_readings)(const STATE *state, WIDE x)
{
    const uint_least32_t samples = state->samples_per_block;
    const uint_least32_t missing = (state->uncertainty.missing < samples) ? state->uncertainty.missing : samples;

    return FN(add)(FN(scaled)(state->input[0].held_blocks, x), FN(quotient)(FN(scaled)(missing, x), samples));
}

/* Of an input that went on while nothing was read. */
static SQUARE FN(variance_of_age)(const STATE *state)
{
    WIDE moved;
    SQUARE square;

    if ((state->input[0].held_blocks == 0U) && (state->uncertainty.missing == 0U)) {
        return NO_SQUARE;
    }
    moved = FN(factor)(FN(scaled_difference)(state->uncertainty.slope, NUM_ZERO, FN(rule)(state->table, RULE_HOLD)));
    square = FN(squared)(FN(without_readings)(state, moved));
    return FN(plus)(square, FN(squared)(FN(without_readings)(state, FN(rule)(state->table, RULE_REST))));
}

/* Of a slope that the correction does not have yet. */
static SQUARE FN(variance_of_start)(const STATE *state)
{
    if ((state->status & GTC_WARMING) == 0) {
        return NO_SQUARE;
    }
    if (state->uncertainty.slope_known != 2U) {
        return FN(squared)(FN(rule)(state->table, RULE_START));
    }
    return FN(squared)(FN(scaled_difference)(state->uncertainty.slope, NUM_ZERO, FN(rule)(state->table, RULE_SLOPE)));
}

/* Of inputs beyond the envelope. */
static SQUARE FN(variance_beyond)(const STATE *state)
{
    SQUARE sum = NO_SQUARE;
    int_least32_t ignored = GTC_OK;
    uint_least32_t k;

    for (k = 0U; k < 2U; k++) {
        const NUM x = state->uncertainty.input[k];
        const NUM low = MEMBER(state->table->envelope[2U * k]);
        const NUM high = MEMBER(state->table->envelope[(2U * k) + 1U]);
        const NUM edge = FN(saturate)(x, low, high, &ignored);

        sum = FN(plus)(sum, FN(squared)(FN(scaled_difference)(x, edge, FN(rule)(state->table, RULE_BEYOND + k))));
    }
    return sum;
}

/* Of what terms do not know of the time before they began, or of a channel that is held, lost or beyond its range. */
static SQUARE FN(variance_of_terms)(const STATE *state)
{
    const TABLE *const table = state->table;
    SQUARE sum = FN(squared)(state->uncertainty.edge_effect);
    uint_least32_t i;

    for (i = 0U; i < FN(n_terms)(table); i++) {
        const uint_least32_t kind = FN(term_of)(table, i)[TERM_KIND].bits;
        const NUM word = FN(rule)(table, GTC_SIGMA_RULES + i);

        if (((state->uncertainty.terms_known >> i) & 1U) != 0U) {
            /* it went on from where it was, or the mean of its channel is new and within its range */
        } else if (READS_CHANNEL(kind)) {
            sum = FN(plus)(sum, FN(squared)(word));
        } else if (kind == GTC_TERM_MEMORY) {
            sum = FN(plus)(sum, FN(squared)(FN(remaining)(word, FN(parameter)(state, i, MEMORY_GAIN),
                                                          state->elapsed - state->uncertainty.terms_since)));
        } else if (kind == GTC_TERM_PLAY) {
            sum = FN(plus)(sum, FN(squared)(FN(unsettled)(FN(parameter)(state, i, PLAY_WIDTH), state->uncertainty.lowest,
                                                          state->uncertainty.highest, word)));
        } else {
            /* it has no state */
        }
    }
    return sum;
}

/* Of the correction in force, but for the constant from power-on to power-on. Of a state that was overwritten nothing is
 * known. */
static SQUARE FN(variance)(const STATE *state)
{
    const SQUARE unknown = FN(squared)(FN(rule)(state->table, RULE_NONE));
    SQUARE sum;

    if ((state->status & GTC_FALLBACK) != 0) {
        sum = FN(squared)(FN(rule)(state->table, RULE_FALLBACK));
    } else if (state->uncertainty.slope_known == 0U) {
        sum = unknown;
    } else {
        sum = FN(plus)(FN(variance_of_map)(state), FN(variance_of_age)(state));
        sum = FN(plus)(sum, FN(variance_of_start)(state));
        sum = FN(plus)(sum, FN(variance_beyond)(state));
        sum = FN(plus)(sum, FN(variance_of_terms)(state));
    }
    return FN(square_or)(sum, unknown);
}

/* ---- the constant of a power-on ------------------------------------------------------------------- */

/* No shift; the constant is as uncertain as from power-on to power-on. */
static void FN(rezero_clear)(STATE *state)
{
    state->shift = NUM_ZERO;
    state->shift_sigma = FN(has_sigma)(state->table) ? FN(rule)(state->table, RULE_BETWEEN) : NUM_ZERO;
}

/* Variance of the constant. */
static SQUARE FN(variance_of_constant)(const STATE *state)
{
    return FN(square_or)(FN(squared)(state->shift_sigma), FN(squared)(FN(rule)(state->table, RULE_BETWEEN)));
}
#else
static void FN(uncertainty_clear)(const volatile STATE *state)
{
    (void)state;
}

static void FN(uncertainty_begin)(const STATE *state, NUM first, NUM x)
{
    (void)state;
    (void)first;
    (void)x;
}

static void FN(uncertainty_block)(const STATE *state, uint_least32_t missing)
{
    (void)state;
    (void)missing;
}

static void FN(uncertainty_step)(const STATE *state, NUM x)
{
    (void)state;
    (void)x;
}

static void FN(uncertainty_input)(const STATE *state, const EFFECT *effect, NUM slope)
{
    (void)state;
    (void)effect;
    (void)slope;
}

static uint_least32_t FN(terms_known)(const STATE *state)
{
    (void)state;
    return 0U;
}

static void FN(rezero_clear)(const STATE *state)
{
    (void)state;
}
#endif
