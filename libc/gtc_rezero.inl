/* gtc_rezero.inl - the snapshot of a correction, and the constant of a power-on, which a rest of the vehicle moves; in
 * the numbers included before.
 *
 * The rest is weighed as a Kalman filter weighs a measurement: the constant has the variance P that training saw from
 * power-on to power-on, the mean residual of the rest that of the correction and of the noise over its length, R.
 * The shift takes the share P/(P + R) of it and leaves the variance P R/(P + R); but the part of R that is the
 * correction's does not average out over rests, so that no less is left than after a rest without noise. A rest that lies
 * GATE standard deviations of P + R from 0 is none: the vehicle moved, or Earth's rate is in it. The next power-on draws a
 * constant anew, independent of this one: nothing of the shift is kept for it.
 *
 * SPDX-License-Identifier: MIT
 */

#if GTC_WITH_UNCERTAINTY
static int FN(run_snapshot)(const STATE *state, SNAPSHOT *snapshot)
{
    int status;

    if ((state == NULL) || (snapshot == NULL) || (FN(has_times)(state) == 0)) {
        return GTC_E_ARG;
    }
    if (!FN(has_sigma)(state->table)) {
        return GTC_E_ABSENT;
    }
    status = FN(run_bias)(state, &snapshot->bias);
    snapshot->sigma = FN(root)(FN(plus)(FN(variance)(state), FN(variance_of_constant)(state)));
    snapshot->correlation_s = FN(rule)(state->table, RULE_CORRELATION);
    snapshot->age_blocks = (state->uncertainty.slope_known == 0U) ? 0U : state->input[0].held_blocks;
    snapshot->status = (int_least32_t)status;
    return status;
}
#endif

#if GTC_WITH_REZERO
/* Of a measurement and what it is compared with, in standard deviations: a rest is wrong once in 16,000. */
#define GATE 4U

/* The variance of the constant after a rest: `rest` of the correction and of the noise, `of_map` of the correction. */
static SQUARE FN(variance_left)(const STATE *state, SQUARE prior, SQUARE rest, SQUARE of_map)
{
    const SQUARE between = FN(squared)(FN(rule)(state->table, RULE_BETWEEN));
    const SQUARE least = FN(part_of_square)(FN(share_of)(between, of_map), of_map);
    const SQUARE left = FN(part_of_square)(FN(share_of)(prior, rest), rest);

    return (left > least) ? left : least;
}

/* GTC_OK, or why a rest cannot move the constant. */
static int FN(can_rezero)(const STATE *state, NUM mean_rate)
{
    int status = GTC_OK;

    if (FN(is_missing)(mean_rate) != 0) {
        status = GTC_E_ARG;
    } else if ((!FN(has_sigma)(state->table)) || (!(MEMBER(state->table->rezero) > NUM_ZERO))) {
        status = GTC_E_ABSENT;
    } else {
        /* it can */
    }
    return status;
}

/* The measurement update with the mean residual of a rest. */
static int FN(update)(STATE *state, NUM mean_rate, uint_least32_t seconds)
{
    const NUM most = MEMBER(state->table->rezero);
    const SQUARE prior = FN(variance_of_constant)(state);
    const SQUARE of_map = FN(variance)(state);
    const SQUARE rest = FN(plus)(of_map, FN(shared_out)(FN(squared)(FN(rule)(state->table, RULE_NOISE)), seconds));
    int_least32_t remarks = GTC_OK;
    WIDE shift;

    if (!(FN(shared_out)(FN(squared)(mean_rate), GATE * GATE) <= FN(plus)(prior, rest))) {
        return GTC_E_REST;
    }
    shift = FN(add)((FN(is_missing)(state->shift) != 0) ? NUM_ZERO : state->shift,
                    FN(part)(FN(share_of)(prior, rest), mean_rate));
    state->shift = FN(saturate)(shift, -most, most, &remarks);
    if (remarks == GTC_OK) {
        state->shift_sigma = FN(root)(FN(variance_left)(state, prior, rest, of_map));
    }
    return (int)remarks;
}

static int FN(run_rezero)(STATE *state, NUM mean_rate, uint_least32_t seconds)
{
    int status = GTC_OK;

    if ((state == NULL) || (FN(has_times)(state) == 0)) {
        return GTC_E_ARG;
    }
    if (seconds == 0U) {
        FN(rezero_clear)(state);
    } else {
        status = FN(can_rezero)(state, mean_rate);
        if (status == GTC_OK) {
            status = FN(update)(state, mean_rate, seconds);
        }
    }
    if (status >= GTC_OK) {
        FN(set_correction)(state, state->uncertainty.unshifted, state->status);
    }
    return status;
}
#endif
