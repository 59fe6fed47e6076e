/* main.c - one firmware for every gyro: the images of many serials lie in flash, the serial decides which one is used.
 *
 * Run on the host: many_serials FLASH SERIAL. FLASH is what pack.py writes: images one after another, each as long as
 * its own third word says.
 *
 * SPDX-License-Identifier: MIT
 */
#include <stdio.h>

#include "images.h"

#define FLASH_WORDS 65536
#define PERIOD_US 1000000UL

static gtc_word_t flash[FLASH_WORDS]; /* on a board: the address of the sector */

/* Reads words of little-endian bytes; their number. */
static uint_least32_t load(const char *path)
{
    uint_least32_t n = 0;
    FILE *file = fopen(path, "rb");

    if (file != NULL) {
        int b[4];

        for (;;) {
            int k;

            for (k = 0; k < 4; k++) {
                b[k] = fgetc(file);
            }
            if ((b[3] == EOF) || (n == FLASH_WORDS)) {
                break;
            }
            flash[n].bits = (uint_least32_t)b[0] | ((uint_least32_t)b[1] << 8) | ((uint_least32_t)b[2] << 16)
                            | ((uint_least32_t)b[3] << 24);
            n++;
        }
        (void)fclose(file);
    }
    return n;
}

int main(int argc, char **argv)
{
    gtc_f32_table_t table;
    static gtc_f32_state_t state;
    const float temperature = 20.0F;
    float bias = 0.0F;
    int status;
    int k;

    if (argc != 3) {
        printf("many_serials FLASH SERIAL\n");
        return 2;
    }
    status = images_open(&table, flash, load(argv[1]), argv[2]);
    if (status != GTC_OK) {
        printf("no image of %s that opens: %d\n", argv[2], status);
        return 1;
    }
    status = gtc_f32_check(&table);
    if (status == GTC_OK) {
        status = gtc_f32_init(&state, &table, PERIOD_US);
    }
    for (k = 0; (k < 3) && (status >= 0); k++) {
        status = gtc_f32_sample(&state, &table, PERIOD_US, &temperature);
    }
    if (status >= 0) {
        status = gtc_f32_bias(&state, &table, &bias);
    }
    if (status < 0) {
        printf("do not navigate: %d\n", status);
        return 1;
    }
    printf("%s: bias at %.1f C %.7f deg/h\n", argv[2], (double)temperature, (double)bias);
    return 0;
}
