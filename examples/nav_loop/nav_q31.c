/* nav_q31.c - the bias compensation of a navigation loop in fixed point: no floating-point unit, no flags. */
#include "nav.h"

#include "gtc_rlg_0042.h"

#define PERIOD_US 1000000UL /* a reading each second */
#define TICK_US 15625L        /* 1/64 s */

static gtc_q31_state_t state;        /* of the task that reads the thermometer */
static volatile int_least32_t bias;  /* from the task to the interrupt: one number, stored at once */
static gtc_q31_angle_t increments;   /* of the interrupt that reads the gyro */

int nav_start(void)
{
    const int checked = gtc_q31_check(&gtc_rlg_0042_q31);
    return (checked != GTC_OK) ? checked : gtc_q31_init(&state, &gtc_rlg_0042_q31, PERIOD_US);
}

int nav_temperature(int_least32_t word)
{
    const int_least32_t temperature = word * 512L; /* 2^-16 C */
    const int taken = gtc_q31_sample(&state, &gtc_rlg_0042_q31, PERIOD_US, (word == NAV_NO_READING) ? NULL : &temperature);
    int_least32_t now = 0;
    const int status = gtc_q31_bias(&state, &gtc_rlg_0042_q31, &now);
    bias = now;
    return (taken < 0) ? taken : status;
}

int nav_increment(int_least32_t counts, int_least64_t *angle)
{
    int_least32_t drift = 0;
    const int status = gtc_q31_angle(&increments, bias, TICK_US, &drift);
    *angle += ((int_least64_t)counts * ((int_least64_t)1 << (nav_angle_bits() - 16U))) - drift;
    return status;
}

unsigned nav_angle_bits(void)
{
    return (unsigned)gtc_rlg_0042_q31.bias_frac_bits;
}
