/* images.c - finds the image of a serial among those that lie in flash.
 *
 * SPDX-License-Identifier: MIT
 */
#include "images.h"

#include <stddef.h>

#define ID_WORD 5U     /* of an image: docs/FORMAT.md, section 3 */
#define LENGTH_WORD 2U

/* Whether the serial of a table is this text: four characters a word, the first one lowest, then zeros. */
static int is_serial(const gtc_f32_table_t *table, const char *serial)
{
    uint_least32_t k;

    for (k = 0; k < (4U * GTC_SERIAL_WORDS); k++) {
        const uint_least32_t character = (table->serial[k / 4U].bits >> (8U * (k % 4U))) & 255U;

        if (character != ((uint_least32_t)serial[k] & 255U)) {
            return 0;
        }
        if (character == 0U) {
            return 1;
        }
    }
    return serial[k] == '\0';
}

int images_open(gtc_f32_table_t *table, const gtc_word_t *words, uint_least32_t n_words, const char *serial)
{
    uint_least32_t at = 0;

    if ((table == NULL) || (words == NULL) || (serial == NULL)) {
        return GTC_E_ARG;
    }
    while ((n_words - at) > ID_WORD) {
        const uint_least32_t length = words[at + LENGTH_WORD].bits;
        int status;

        if ((words[at].bits != GTC_IMAGE_MAGIC) || (length > (n_words - at))) {
            return (words[at].bits == 0xFFFFFFFFUL) ? GTC_E_ID : GTC_E_IMAGE; /* erased flash: the end */
        }
        /* Its own id: the serial in it decides, and the CRC says that it is whole. */
        status = gtc_f32_open(table, &words[at], length, words[at + ID_WORD].bits);
        if (status != GTC_OK) {
            return status;
        }
        if (is_serial(table, serial) != 0) {
            return GTC_OK;
        }
        at += length;
    }
    return GTC_E_ID;
}
