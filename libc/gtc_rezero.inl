/* gtc_rezero.inl - the snapshot of a correction, and the constant of a power-on, which a rest of the vehicle moves; in
 * the numbers included before.
 *
 * The rest is weighed as a Kalman filter weighs a measurement: the constant has the variance P that training saw from
 * power-on to power-on, the mean residual of the rest that of the correction and of the noise over its length, R.
 * The shift takes the share P/(P + R) of it and leaves the variance P R/(P + R). gen/gyrotc/target/sigma.py is its mirror.
 *
 * SPDX-License-Identifier: MIT
 */

static int FN(run_snapshot)(const STATE *state, SNAPSHOT *snapshot)
{
    int status;

    if ((state == NULL) || (snapshot == NULL) || (state->table == NULL)) {
        return GTC_E_ARG;
    }
    if (!FN(has_sigma)(state->table)) {
        return GTC_E_ABSENT;
    }
    status = FN(run_bias)(state, &snapshot->bias);
    snapshot->sigma = FN(root)(FN(plus)(FN(variance)(state), FN(variance_of_constant)(state)));
    snapshot->correlation_s = FN(rule)(state->table, RULE_CORRELATION);
    snapshot->age_blocks = (state->doubt.sure == 0U) ? 0U : state->input[0].held_blocks;
    snapshot->status = (int_least32_t)status;
    return status;
}

/* The nearest shift that the table grants. */
static NUM FN(granted)(const TABLE *table, WIDE shift)
{
    const NUM most = MEMBER(table->rezero);
    NUM found;

    if (shift > most) {
        found = most;
    } else if (shift < -most) {
        found = -most;
    } else {
        found = (NUM)shift;
    }
    return found;
}

static int FN(run_rezero)(STATE *state, NUM mean_rate, uint_least32_t seconds)
{
    int status = GTC_OK;
    SQUARE prior;
    SQUARE rest;
    SHIFT_SHARE share;
    WIDE shift;

    if ((state == NULL) || (state->table == NULL) || (FN(is_missing)(mean_rate) != 0) || (seconds == 0U)) {
        return GTC_E_ARG;
    }
    if ((!FN(has_sigma)(state->table)) || (!(MEMBER(state->table->rezero) > NUM_ZERO))) {
        return GTC_E_ABSENT;
    }
    prior = FN(variance_of_constant)(state);
    rest = FN(plus)(FN(variance)(state), FN(shared_out)(FN(squared)(FN(rule)(state->table, RULE_NOISE)), seconds));
    share = FN(share_of)(prior, rest);
    shift = FN(add)((FN(is_missing)(state->shift) != 0) ? NUM_ZERO : state->shift, FN(part)(share, mean_rate));
    state->shift = FN(granted)(state->table, shift);
    if ((shift > state->shift) || (shift < state->shift)) {
        status = GTC_CLAMPED;
    } else {
        state->constant = FN(root)(FN(part_of_square)(share, rest));
    }
    FN(put)(state, state->doubt.plain, state->status);
    return status;
}

static int FN(run_unzero)(STATE *state)
{
    if ((state == NULL) || (state->table == NULL)) {
        return GTC_E_ARG;
    }
    FN(rezero_clear)(state);
    FN(put)(state, state->doubt.plain, state->status);
    return GTC_OK;
}
