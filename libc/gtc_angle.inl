/* gtc_angle.inl - the correction in force as an angle, in the numbers included before.
 *
 * docs/numerics.md, section 6, says every step.
 *
 * SPDX-License-Identifier: MIT
 */

int FN(angle)(STATE *state, NUM dt, NUM *angle)
{
    if ((state == NULL) || (angle == NULL) || (state->table == NULL) || FN(is_missing)(dt)
        || (dt < NUM_ZERO) || (dt > NUM_LONGEST_DT) || !FN(advance)(state, dt, angle)) {
        return GTC_E_ARG;
    }
    return (int)state->status;
}
