/* app.h - a task that reads the thermometer and an interrupt that reads the gyro; the ports call these.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef APP_H_INCLUDED
#define APP_H_INCLUDED

#define APP_SECONDS 5 /* after these the task is done */

/* At boot, before the interrupt is enabled. 0, or a negative status: do not navigate. */
int app_start(void);

/* The task, once a second: one reading. */
void app_second(void);

/* The interrupt, 64 times a second, at any time: one angle increment. */
void app_interrupt(void);

/* When both are done: prints the sum of the increments, 0 if it is that of biases which the task gave. */
int app_verdict(void);

#endif
