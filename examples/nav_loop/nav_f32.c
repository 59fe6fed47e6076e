/* nav_f32.c - the bias compensation of a navigation loop in float32. */
#include "nav.h"

#include "gtc_rlg_0042.h"

#define PERIOD_US 1000000UL /* a reading each second */
#define TICK_S 0.015625F      /* 1/64 s, exact */

static gtc_f32_state_t state;     /* of the task that reads the thermometer */
static volatile float bias_dph;   /* from the task to the interrupt: one number, stored at once */
static gtc_f32_angle_t increments; /* of the interrupt that reads the gyro */

int nav_start(void)
{
    const int checked = gtc_f32_check(&gtc_rlg_0042_f32);
    return (checked != GTC_OK) ? checked : gtc_f32_init(&state, &gtc_rlg_0042_f32, PERIOD_US);
}

int nav_temperature(int_least32_t word)
{
    const float temperature = (float)word * 0.0078125F;
    const int taken = gtc_f32_sample(&state, &gtc_rlg_0042_f32, PERIOD_US, (word == NAV_NO_READING) ? NULL : &temperature);
    float bias = 0.0F;
    const int status = gtc_f32_bias(&state, &gtc_rlg_0042_f32, &bias);
    bias_dph = bias;
    return (taken < 0) ? taken : status;
}

int nav_increment(int_least32_t counts, int_least64_t *angle)
{
    float drift = 0.0F;
    const int status = gtc_f32_angle(&increments, bias_dph, TICK_S, &drift); /* a multiple of 2^-16 arcsec */
    *angle += counts - (int_least32_t)(drift * 65536.0F);
    return status;
}

unsigned nav_angle_bits(void)
{
    return 16U;
}
