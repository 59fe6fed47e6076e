// Prints the correction of gyro RLG-0042 for the temperature of an LM35 at A0, ten readings a second.
// Beside this file lie gtc_rlg_0042.c and gtc_rlg_0042.h, which `gyrotc emit` wrote.
//
// SPDX-License-Identifier: MIT
#include "gtc_rlg_0042.h"

static gtc_q31_state_t state;
static int status;

void setup()
{
    Serial.begin(115200);
    status = gtc_q31_check(&gtc_rlg_0042_q31);
    if (status == GTC_OK) {
        status = gtc_q31_init(&state, &gtc_rlg_0042_q31, 100000UL);
    }
}

void loop()
{
    // 5 V over 1024 steps, 10 mV/C; in 2^-16 C.
    const int_least32_t temperature = (int_least32_t) analogRead(A0) * (int_least32_t) (65536L * 500L / 1024L);
    int_least32_t bias = 0;

    if (status >= 0) {
        status = gtc_q31_sample(&state, &temperature);
    }
    if (status >= 0) {
        status = gtc_q31_bias(&state, &bias);
    }
    Serial.print(status);
    Serial.print(' ');
    Serial.println(bias); // 2^-GTC_RLG_0042_Q31_BIAS_FRAC_BITS deg/h
    delay(100);
}
