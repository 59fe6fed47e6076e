/* nav.h - what a navigation loop asks of the bias compensation. nav_f32.c and nav_q31.c give it; take one of them. */
#ifndef NAV_H_INCLUDED
#define NAV_H_INCLUDED

#include <stdint.h>

#define NAV_TICKS 64U               /* angle increments a second */
#define NAV_NO_READING (-32768L)    /* the thermometer did not answer */

/* At boot: proves arithmetic and table, starts the state. 0, or a negative status: do not navigate. */
int nav_start(void);

/* One reading of the thermometer, 2^-7 C, one a second; a task. Returns the status of the correction (gtc.h). */
int nav_temperature(int_least32_t word);

/* One increment of the gyro, 2^-16 arcsec over 1/NAV_TICKS s: adds it, compensated, to an angle.
 * An interrupt of its own may call it at any time. Returns 0, or a negative status. */
int nav_increment(int_least32_t counts, int_least64_t *angle);

/* Fraction bits of that angle, in arcsec. */
unsigned nav_angle_bits(void);

#endif
