/* images.h - finds the image of a serial among those that lie in flash.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef IMAGES_H_INCLUDED
#define IMAGES_H_INCLUDED

#include "gtc.h"

/* Opens the float32 image of a gyro. `words` are `n_words` words of flash, images one after another; they must stay.
 * Every image before it is skipped by its length; one that is damaged ends the search, for its length is not known.
 * Returns GTC_OK, GTC_E_ARG, GTC_E_ID (no image of this serial) or what gtc_f32_open() says of the damaged one. */
GTC_MUST_CHECK int images_open(gtc_f32_table_t *table, const gtc_word_t *words, uint_least32_t n_words,
                               const char *serial);

#endif
