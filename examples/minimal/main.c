/* main.c - the correction of gyro RLG-0042, in ten lines. */
#include <stdio.h>

#include "gtc_rlg_0042.h"

int main(void)
{
    static gtc_f32_state_t state;
    int k;
    float bias_dph = 0.0F;
    float channels[1] = { 17.6F };  /* C, from the gyro's own sensor */
    if ((gtc_f32_check(&gtc_rlg_0042_f32) != GTC_OK) ||
        (gtc_f32_init(&state, &gtc_rlg_0042_f32, 10000UL) < 0)) { /* a sample each 10000 microseconds */
        return 1; /* do not navigate with this build or table */
    }
    for (k = 0; k < 101; k++) { /* a start must agree with itself for a while before it is accepted */
        if (gtc_f32_sample(&state, &gtc_rlg_0042_f32, 10000UL, channels) < 0) {
            return 1;
        }
    }
    if (gtc_f32_bias(&state, &gtc_rlg_0042_f32, &bias_dph) < 0) {
        return 1;
    }
    printf("bias at %.2f C: %.6f deg/h\n", (double) channels[0], (double) bias_dph); /* rate - bias */
    return 0;
}
