/* app.c - a task that reads the thermometer and an interrupt that reads the gyro. Neither waits for the other: what
 * goes from the task to the interrupt is one number (../nav_loop/nav_f32.c), stored at once.
 *
 * SPDX-License-Identifier: MIT
 */
#include "app.h"

#include <stdint.h>
#include <stdio.h>

#include "nav.h"

#define READING (20L * 128L) /* 20 C in 2^-7 C */
#define LARGEST_DPH 0.0095   /* authority of the table, deg/h: GTC_RLG_0042_AUTHORITY_MAX_DPH */
#define UNITS_PER_ARCSEC 65536.0

static int_least64_t angle;          /* of the interrupt; read when it is off */
static volatile long increments;     /* likewise */
static volatile int interrupt_failed;
static int task_failed;
static int seconds;

int app_start(void)
{
    return nav_start();
}

void app_second(void)
{
    if (nav_temperature(READING) < 0) {
        task_failed = 1;
    }
    seconds++;
}

void app_interrupt(void)
{
    if (nav_increment(0, &angle) < 0) { /* the gyro is at rest */
        interrupt_failed = 1;
    }
    increments++;
}

int app_verdict(void)
{
    /* deg/h over a 64th of a second is as many arcsec / 64. */
    const double most = LARGEST_DPH * UNITS_PER_ARCSEC * (double)increments / (double)NAV_TICKS;
    const double taken = -(double)angle;

    printf("%ld increments, %d readings, %.3f arcsec taken away\n", increments, seconds, taken / UNITS_PER_ARCSEC);
    return ((task_failed == 0) && (interrupt_failed == 0) && (seconds == APP_SECONDS) && (taken > 0.0)
            && (taken <= (most + 1.0)))
               ? 0
               : 1;
}
