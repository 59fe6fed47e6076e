/* slots.h - the state of the correction in two flash slots, so that a power cut never costs both.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef SLOTS_H_INCLUDED
#define SLOTS_H_INCLUDED

#include "gtc.h"

/* A saved state, a number that grows with every save, and its complement, written last. */
#define SLOT_WORDS (GTC_SAVE_WORDS + 2)
#define N_SLOTS 2

/* What the board has to give: erased words read 0xFFFFFFFF. Each slot is erased by itself. */
void flash_erase(int slot);
void flash_write(int slot, int index, uint_least32_t word);
uint_least32_t flash_read(int slot, int index);

/* Saves the state over the older slot, or over one that holds nothing. Returns GTC_OK or an error
 * of gtc_f32_save(). */
int slots_save(const gtc_f32_state_t *state, const gtc_f32_table_t *table);

/* Restores the newest whole state of this table. Returns GTC_OK, or the last error of
 * gtc_f32_restore() if there is none; then start with gtc_f32_init(). */
int slots_load(gtc_f32_state_t *state, const gtc_f32_table_t *table,
               uint_least32_t period_us, uint_least32_t off_blocks);

#endif /* SLOTS_H_INCLUDED */
