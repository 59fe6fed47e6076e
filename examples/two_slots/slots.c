/* slots.c - two flash slots, of which the newest whole one counts.
 *
 * SPDX-License-Identifier: MIT
 */
#include "slots.h"

/* Restores from one slot. Its number is believed only with its complement. */
static int load_slot(int slot, gtc_f32_state_t *state, const gtc_f32_table_t *table,
                     uint_least32_t period_us, uint_least32_t off_blocks)
{
    gtc_word_t words[GTC_SAVE_WORDS];
    int i;

    if ((flash_read(slot, GTC_SAVE_WORDS) ^ flash_read(slot, GTC_SAVE_WORDS + 1)) != 0xFFFFFFFFUL) {
        return GTC_E_IMAGE;
    }
    for (i = 0; i < GTC_SAVE_WORDS; i++) {
        words[i].bits = flash_read(slot, i);
    }
    return gtc_f32_restore(state, table, period_us, words, off_blocks);
}

/* The slot with the higher number; numbers may pass 2^32. */
static int higher(void)
{
    const uint_least32_t ahead = flash_read(1, GTC_SAVE_WORDS) - flash_read(0, GTC_SAVE_WORDS);

    return ((ahead & 0x80000000UL) == 0U) ? 1 : 0;
}

int slots_load(gtc_f32_state_t *state, const gtc_f32_table_t *table,
               uint_least32_t period_us, uint_least32_t off_blocks)
{
    const int newest = higher();
    int status = load_slot(newest, state, table, period_us, off_blocks);

    if (status != GTC_OK) {
        status = load_slot(1 - newest, state, table, period_us, off_blocks);
    }
    return status;
}

int slots_save(const gtc_f32_state_t *state, const gtc_f32_table_t *table)
{
    gtc_f32_state_t scratch;
    gtc_word_t words[GTC_SAVE_WORDS];
    uint_least32_t number;
    int keep = higher(); /* the newest whole one must outlive this save */
    int slot;
    int i;
    const int status = gtc_f32_save(state, table, words);

    if (status != GTC_OK) {
        return status;
    }
    if (load_slot(keep, &scratch, table, table->block_us, 1U) != GTC_OK) {
        keep = 1 - keep;
    }
    slot = 1 - keep;
    number = (flash_read(keep, GTC_SAVE_WORDS) + 1U) & 0xFFFFFFFFUL;
    flash_erase(slot);
    for (i = 0; i < GTC_SAVE_WORDS; i++) {
        flash_write(slot, i, words[i].bits);
    }
    flash_write(slot, GTC_SAVE_WORDS, number);
    flash_write(slot, GTC_SAVE_WORDS + 1, ~number & 0xFFFFFFFFUL);
    return GTC_OK;
}
