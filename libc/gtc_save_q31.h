/* gtc_save_q31.h - numbers of 64 bits as words of a saved state.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_SAVE_Q31_H_INCLUDED
#define GTC_SAVE_Q31_H_INCLUDED

static void FN(to_words)(int_least64_t x, gtc_word_t words[2])
{
    const uint_least64_t bits = (uint_least64_t)x;

    words[0].bits = (uint_least32_t)(bits & 0xFFFFFFFFU);
    words[1].bits = (uint_least32_t)((bits >> 32) & 0xFFFFFFFFU);
}

static int_least64_t FN(from_words)(const gtc_word_t words[2])
{
    return ((int_least64_t)words[1].integer * 4294967296) + (int_least64_t)words[0].bits;
}

static void FN(angle_to_words)(const STATE *state, gtc_word_t words[2])
{
    FN(to_words)(state->angle, words);
}

static void FN(angle_from_words)(STATE *state, const gtc_word_t words[2])
{
    state->angle = FN(from_words)(words);
}

#endif /* GTC_SAVE_Q31_H_INCLUDED */
