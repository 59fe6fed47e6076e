/* main.c - a navigation loop on a board that is all standard input and output.
 *
 * In: a line for each second with the thermometer's word and the gyro's counts in that second (2^-16 arcsec).
 * Out: a line for each minute with seconds, status, the angle as measured and compensated (2^-10 arcsec) and all bits
 * of the compensated one.
 */
#include <stdio.h>

#include "nav.h"

static void put_text(const char *text)
{
    for (; *text != '\0'; text++) {
        (void)putchar(*text);
    }
}

static void put_hex(uint_least64_t word, int digits)
{
    int shift;
    for (shift = 4 * (digits - 1); shift >= 0; shift -= 4) {
        (void)putchar("0123456789abcdef"[(unsigned)((word >> shift) & 15U)]);
    }
}

static void put_number(int_least64_t n)
{
    uint_least64_t magnitude = (n < 0) ? (uint_least64_t)0 - (uint_least64_t)n : (uint_least64_t)n;
    char digits[21];
    unsigned k = 20U;
    digits[k] = '\0';
    do {
        k--;
        digits[k] = (char)('0' + (int)(magnitude % 10U));
        magnitude /= 10U;
    } while (magnitude != 0U);
    put_text((n < 0) ? " -" : " ");
    put_text(&digits[k]);
}

/* The next number of standard input; 0 at its end, too, with *end set. */
static int_least32_t next_number(int *end)
{
    int_least32_t n = 0;
    int negative = 0;
    int digits = 0;
    char c;
    while (fread(&c, 1U, 1U, stdin) == 1U) {
        if (c == '-') {
            negative = 1;
        } else if ((c >= '0') && (c <= '9')) {
            n = (n * 10) + (c - '0');
            digits++;
        } else if (digits > 0) {
            return (negative != 0) ? -n : n;
        } else {
            /* between two numbers */
        }
    }
    *end = 1;
    return 0;
}

/* In 2^-10 arcsec, towards zero. */
static int_least64_t shown(int_least64_t angle, unsigned bits)
{
    return angle / ((int_least64_t)1 << (bits - 10U));
}

static void put_minute(uint_least32_t second, int status, int_least64_t measured, int_least64_t angle)
{
    put_number((int_least64_t)second);
    put_text(" ");
    put_hex((uint_least64_t)status & 0xFFU, 2);
    put_number(shown(measured, 16U));
    put_number(shown(angle, nav_angle_bits()));
    put_text(" ");
    put_hex((uint_least64_t)angle, 16);
    put_text("\n");
}

/* The gyro: hands out the counts of a second in equal increments. */
static int_least32_t increment(int_least32_t counts, uint_least32_t tick)
{
    const int_least32_t t = (int_least32_t)tick;
    const int_least32_t n = (int_least32_t)NAV_TICKS;
    return (((t + 1) * counts) / n) - ((t * counts) / n);
}

int main(void)
{
    int_least64_t measured = 0;
    int_least64_t angle = 0;
    uint_least32_t second;
    int end = 0;
    const int started = nav_start();
    if (started < 0) {
        put_text("the self-test failed\n");
        return 1;
    }
    for (second = 1U;; second++) {
        const int_least32_t word = next_number(&end);
        const int_least32_t counts = next_number(&end);
        uint_least32_t tick;
        int status;
        if (end != 0) {
            return 0;
        }
        status = nav_temperature(word);
        for (tick = 0U; (tick < NAV_TICKS) && (status >= 0); tick++) {
            const int_least32_t now = increment(counts, tick);
            if (nav_increment(now, &angle) < 0) {
                return 1;
            }
            measured += now;
        }
        if (status < 0) {
            return 1;
        }
        if ((second % 60U) == 0U) {
            put_minute(second, status, measured, angle);
        }
    }
}
