/* gtc_private.h - what the parts of the runtime share and no user sees.
 *
 * The functions are external only because they live in files of their own; they are not part of
 * the interface and may change at any time.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_PRIVATE_H_INCLUDED
#define GTC_PRIVATE_H_INCLUDED

#include <stddef.h>

#include "gtc.h"

#if GTC_TABLE_LAYOUT != 1
#error "these sources read table layout 1: include/ and libc/ are of different versions"
#endif

/* CRC-32 (polynomial 0xEDB88320), before the final inversion. */
#define GTC_CRC_START 0xFFFFFFFFUL
#define GTC_CRC_FINAL 0xFFFFFFFFUL

/* Takes one 32-bit word into a running CRC-32, as four octets, least significant first. */
uint_least32_t gtc_crc_word(uint_least32_t crc, uint_least32_t word);

/* The same for n words of a table; n may be 0. */
uint_least32_t gtc_crc_words(uint_least32_t crc, const gtc_word_t *words, uint_least32_t n);

/* 1 if this build of the runtime can use the table, else 0. */
int gtc_f32_is_usable(const gtc_f32_table_t *table);
int gtc_q31_is_usable(const gtc_q31_table_t *table);

#endif /* GTC_PRIVATE_H_INCLUDED */
