/* gtc_rezero.inl - the snapshot of a correction, and the constant of a power-on, which a rest of the vehicle moves.
 *
 * The rest is weighed as a Kalman filter weighs a measurement: the constant has the variance P that training saw
 * from power-on to power-on, the mean residual of the rest that of the correction and of the noise over its length,
 * R. The shift takes the share P/(P + R) of it and leaves the variance P R/(P + R); but the part of R that is the
 * correction's does not average out over rests, so that no less is left than after a rest without noise. A rest that
 * lies GATE standard deviations of P + R from 0 is none: the vehicle moved, or Earth's rate is in it. The next
 * power-on draws a constant anew, independent of this one: nothing of the shift is kept for it.
 *
 * SPDX-License-Identifier: MIT
 */

#if GTC_WITH_UNCERTAINTY
int PUBLIC(snapshot)(const STATE *state, const TABLE *table, SNAPSHOT *snapshot)
{
    int status = (snapshot == NULL) ? GTC_E_ARG : check_state(state, table);
    SQUARE constant;

    if (status != GTC_OK) {
        return status;
    }
    if (!has_sigma(table)) {
        return GTC_E_ABSENT;
    }
    status = PUBLIC(bias)(state, table, &snapshot->bias);
#if GTC_WITH_REZERO
    constant = variance_of_constant(state, table);
#else
    constant = variance_between(table);
#endif
    snapshot->sigma = square_root(add_squares(variance(state, table), constant));
    snapshot->correlation_s = ELEMENT(rules_of(table)[RULE_CORRELATION]);
    snapshot->age_blocks = (state->uncertainty.slope_known == 0U) ? 0U : state->input[0].held_blocks;
    snapshot->status = (int_least32_t)status;
    return status;
}
#endif

#if GTC_WITH_REZERO
/* Standard deviations that the mean rate of a rest may lie from 0; a true rest lies farther once in 16,000. */
#define GATE 4U

/* The variance of the constant after a rest: `rest` of the correction and of the noise, `of_map` of the correction. */
static SQUARE variance_left(const TABLE *table, SQUARE prior, SQUARE rest, SQUARE of_map)
{
    const SQUARE between = variance_between(table);
    const SQUARE least = part_of_square(share_of(between, of_map), of_map);
    const SQUARE left = part_of_square(share_of(prior, rest), rest);

    return (left > least) ? left : least;
}

/* GTC_OK, or why a rest cannot move the constant. */
static int check_rest(const TABLE *table, NUM mean_rate)
{
    int status = GTC_OK;

    if (is_missing(mean_rate) != 0) {
        status = GTC_E_ARG;
    } else if ((!has_sigma(table)) || (!(MEMBER(table->rezero) > NUM_ZERO))) {
        status = GTC_E_ABSENT;
    } else {
        /* it can */
    }
    return status;
}

/* The measurement update with the mean residual of a rest. */
static int update_constant(STATE *state, const TABLE *table, NUM mean_rate, uint_least32_t seconds)
{
    const NUM most = MEMBER(table->rezero);
    const SQUARE prior = variance_of_constant(state, table);
    const SQUARE of_map = variance(state, table);
    const SQUARE rest = add_squares(of_map, divide_square(squared(ELEMENT(rules_of(table)[RULE_NOISE])), seconds));
    int_least32_t remarks = GTC_OK;
    WIDE shift;

    if (!(divide_square(squared(mean_rate), GATE * GATE) <= add_squares(prior, rest))) {
        return GTC_E_REST;
    }
    shift = add((is_missing(state->shift) != 0) ? NUM_ZERO : state->shift,
                    share_of_number(share_of(prior, rest), mean_rate));
    state->shift = saturate(shift, -most, most, &remarks);
    if (remarks == GTC_OK) {
        state->shift_sigma = square_root(variance_left(table, prior, rest, of_map));
    }
    return (int)remarks;
}

int PUBLIC(rezero)(STATE *state, const TABLE *table, NUM mean_rate, uint_least32_t seconds)
{
    int status = check_state(state, table);

    if (status != GTC_OK) {
        return status;
    }
    if (seconds == 0U) {
        rezero_clear(state, table);
    } else {
        status = check_rest(table, mean_rate);
        if (status == GTC_OK) {
            status = update_constant(state, table, mean_rate, seconds);
        }
    }
    if (status >= GTC_OK) {
        put_in_force(state, table, state->unshifted, state->status);
    }
    return status;
}
#endif
