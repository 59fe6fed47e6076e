/* main.c - proves slots.c: the power is cut at every word that is erased or written.
 *
 * SPDX-License-Identifier: MIT
 */
#include <stdio.h>
#include <string.h>

#include "gtc_rlg_0042.h"
#include "slots.h"

#define TABLE (&gtc_rlg_0042_f32)
#define PERIOD_US 1000000UL
#define SAVES 5
#define ALL_WORDS (2L * SLOT_WORDS) /* changed by one save: erased, and written */

/* ---- flash in RAM, whose power fails */

static uint_least32_t flash[N_SLOTS][SLOT_WORDS];
static long words_left;           /* until the power fails */
static uint_least32_t torn_bits;  /* of the word at which it fails, those that still change */

static void change(int slot, int index, uint_least32_t word)
{
    const uint_least32_t mask = (words_left > 0) ? 0xFFFFFFFFUL : torn_bits;

    if (words_left >= 0) {
        flash[slot][index] = (flash[slot][index] & ~mask) | (word & mask);
        words_left--;
    }
}

void flash_erase(int slot)
{
    int i;

    for (i = 0; i < SLOT_WORDS; i++) {
        change(slot, i, 0xFFFFFFFFUL);
    }
}

void flash_write(int slot, int index, uint_least32_t word)
{
    change(slot, index, flash[slot][index] & word); /* flash only clears bits */
}

uint_least32_t flash_read(int slot, int index)
{
    return flash[slot][index];
}

/* ---- the proof */

/* The state after so many saves' worth of samples. */
static int state_at(int save, gtc_f32_state_t *state)
{
    int status = gtc_f32_init(state, TABLE, PERIOD_US);
    int i;

    for (i = 0; (i < (37 * save)) && (status >= 0); i++) {
        const float temp = 20.0F + (0.0625F * (float)i);

        status = gtc_f32_sample(state, TABLE, PERIOD_US, &temp);
    }
    return status;
}

/* Which save the flash gives back: 1 ... SAVES, 0 for none, -1 for a state that never was. */
static int loaded(void)
{
    gtc_f32_state_t state;
    gtc_f32_state_t expected;
    gtc_word_t found_words[GTC_SAVE_WORDS];
    gtc_word_t words[GTC_SAVE_WORDS];
    int save;

    if (slots_load(&state, TABLE, PERIOD_US, 0U) != GTC_OK) {
        return 0;
    }
    if (gtc_f32_save(&state, TABLE, found_words) != GTC_OK) {
        return -1;
    }
    for (save = 1; save <= SAVES; save++) {
        if ((state_at(save, &expected) >= 0) && (gtc_f32_save(&expected, TABLE, words) == GTC_OK)
            && (memcmp(words, found_words, sizeof words) == 0)) {
            return save;
        }
    }
    return -1;
}

/* Saves with the power failing after so many words. Returns what the flash gives back then, -1 for
 * anything but number `save` or, if the power did fail, the one before it. */
static int cut(int save, long after, uint_least32_t torn)
{
    gtc_f32_state_t state;
    int found;

    if (state_at(save, &state) < 0) {
        return -1;
    }
    words_left = after;
    torn_bits = torn;
    if (slots_save(&state, TABLE) != GTC_OK) {
        return -1;
    }
    found = loaded();
    if ((found != save) && ((words_left >= 0) || (found != (save - 1)))) {
        printf("save %d cut after %ld words: found %d\n", save, after, found);
        return -1;
    }
    return found;
}

/* The power fails after so many words, soon again during the next try, and then lasts. Returns 1,
 * 0 if something was lost. */
static int survives(int save, long after, uint_least32_t torn)
{
    return ((cut(save, after, torn) >= 0) && (cut(save, (after * 7) % ALL_WORDS, torn) >= 0)
            && (cut(save, ALL_WORDS, 0U) == save)) ? 1 : 0;
}

int main(void)
{
    static const uint_least32_t torn[3] = {0U, 0x0000FFFFUL, 0xA5A5A5A5UL};
    uint_least32_t before[N_SLOTS][SLOT_WORDS];
    long cuts = 0;
    int save;

    if (gtc_f32_check(TABLE) != GTC_OK) {
        return 1;
    }
    memset(flash, 0xFF, sizeof flash);
    for (save = 1; save <= SAVES; save++) {
        memcpy(before, flash, sizeof before);
        for (cuts = 0; cuts < (3 * ALL_WORDS); cuts++) {
            memcpy(flash, before, sizeof flash);
            if (!survives(save, cuts / 3, torn[cuts % 3])) {
                return 1;
            }
        }
        memcpy(flash, before, sizeof flash);
        if (cut(save, ALL_WORDS, 0U) != save) {
            return 1;
        }
    }
    printf("%d x %ld power cuts: always the newest whole state, never none\n", SAVES, cuts);
    return 0;
}
