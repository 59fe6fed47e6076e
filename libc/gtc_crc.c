/* gtc_crc.c - CRC-32 over the values of words, whatever the byte order or width of a char.
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_private.h"

uint_least32_t gtc_crc_word(uint_least32_t crc, uint_least32_t word)
{
    uint_least32_t rest = (crc ^ word) & 0xFFFFFFFFUL;
    int bit;

    /* Least significant bit first, so four octets in a row are the same as one word. */
    for (bit = 0; bit < 32; bit++) {
        const uint_least32_t poly = ((rest & 1U) != 0U) ? 0xEDB88320UL : 0UL;
        rest = (rest >> 1) ^ poly;
    }
    return rest;
}

uint_least32_t gtc_crc_words(uint_least32_t crc, const gtc_word_t *words, uint_least32_t n)
{
    uint_least32_t rest = crc;
    uint_least32_t i;

    for (i = 0; i < n; i++) {
        rest = gtc_crc_word(rest, words[i].bits);
    }
    return rest;
}
