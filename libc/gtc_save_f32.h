/* gtc_save_f32.h - wide numbers of float32 as words of a saved state: they are no wider than others.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_SAVE_F32_H_INCLUDED
#define GTC_SAVE_F32_H_INCLUDED

static void FN(to_words)(float x, gtc_word_t words[2])
{
    words[0].value = x;
    words[1].bits = 0U;
}

static float FN(from_words)(const gtc_word_t words[2])
{
    return words[0].value;
}

static void FN(angle_to_words)(const STATE *state, gtc_word_t words[2])
{
    words[0].value = state->angle[0];
    words[1].value = state->angle[1];
}

static void FN(angle_from_words)(STATE *state, const gtc_word_t words[2])
{
    state->angle[0] = words[0].value;
    state->angle[1] = words[1].value;
}

#endif /* GTC_SAVE_F32_H_INCLUDED */
