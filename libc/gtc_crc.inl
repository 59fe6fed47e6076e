/* gtc_crc.inl - CRC-32 over the values of words, whatever the byte order or width of a char.
 *
 * SPDX-License-Identifier: MIT
 */

/* CRC-32 (polynomial 0xEDB88320), before the final inversion. */
#define CRC_START 0xFFFFFFFFUL
#define CRC_FINAL 0xFFFFFFFFUL

/* Takes one 32-bit word into a running CRC-32, as four octets, least significant first. */
static uint_least32_t crc_word(uint_least32_t crc, uint_least32_t word)
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

/* The same for n words of a table; n may be 0. NULL stands for none, so that an array that a lost count names is not
 * read. */
static uint_least32_t crc_words(uint_least32_t crc, const gtc_word_t *words, uint_least32_t n)
{
    uint_least32_t rest = crc;
    uint_least32_t i;

    for (i = 0U; (words != NULL) && (i < n); i++) {
        rest = crc_word(rest, words[i].bits);
    }
    return rest;
}
