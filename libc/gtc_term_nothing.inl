/* gtc_term_nothing.inl - the hook of terms that have nothing to do there.
 *
 * SPDX-License-Identifier: MIT
 */

void FN(nothing)(STATE *state, uint_least32_t i, NUM x)
{
    (void)state;
    (void)i;
    (void)x;
}
