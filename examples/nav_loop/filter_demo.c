/* filter_demo.c - does a filter gain from the uncertainty of its corrections?
 *
 * In: a line for each 10 s with the thermometer's word (2^-7 C; -32768: it did not answer), the true bias and the
 * measured rate at rest, both in 10^-9 deg/h. Out: what the bias is wrong by, RMS, after the correction alone, after
 * a filter with the best constant process noise, and after one that the snapshots feed.
 */
#include <math.h>
#include <stdio.h>

#include "filter.h"
#include "gtc_sim_0003.h"

#define STEP_S 10.0F
#define PERIOD_US 10000000UL
#define NOISE 2.21e-3F /* deg/h, 1 sigma of a rate over 10 s */
#define N_FIXED 9
#define FIRST 20 /* steps until the window is full, and some more */

int main(void)
{
    static const float fixed[N_FIXED] = {2e-5F, 4e-5F, 6e-5F, 8e-5F, 1e-4F, 1.3e-4F, 1.7e-4F, 2.5e-4F, 4e-4F};
    gtc_f32_state_t state;
    filter_t fed = {0.0F, 0.0F, 0.0F};
    filter_t constant[N_FIXED] = {{0.0F, 0.0F, 0.0F}};
    double plain = 0.0;
    double of_fed = 0.0;
    double of_constant[N_FIXED] = {0.0};
    double best;
    long word;
    long truth;
    long measured;
    long n = 0;
    int k;

    if ((gtc_f32_check(&gtc_sim_0003_f32) != GTC_OK) || (gtc_f32_init(&state, &gtc_sim_0003_f32, PERIOD_US) != GTC_OK)) {
        return 1;
    }
    while (scanf("%ld %ld %ld", &word, &truth, &measured) == 3) {
        const float temperature = (float)word / 128.0F;
        const int taken = gtc_f32_sample(&state, &gtc_sim_0003_f32, PERIOD_US, (word == -32768L) ? NULL : &temperature);
        gtc_f32_snapshot_t now;
        float rate;
        double error;

        if ((taken < 0) || (gtc_f32_snapshot(&state, &gtc_sim_0003_f32, &now) < 0)) {
            return 1;
        }
        rate = ((float)measured * 1e-9F) - now.bias;
        error = ((double)truth * 1e-9) - (double)now.bias;
        filter_step(&fed, now.sigma, now.correlation_s, rate, NOISE * NOISE, STEP_S);
        for (k = 0; k < N_FIXED; k++) {
            filter_step(&constant[k], fixed[k], now.correlation_s, rate, NOISE * NOISE, STEP_S);
        }
        n++;
        if (n > FIRST) {
            plain += error * error;
            of_fed += (error - (double)fed.rest) * (error - (double)fed.rest);
            for (k = 0; k < N_FIXED; k++) {
                of_constant[k] += (error - (double)constant[k].rest) * (error - (double)constant[k].rest);
            }
        }
    }
    best = of_constant[0];
    for (k = 1; k < N_FIXED; k++) {
        best = (of_constant[k] < best) ? of_constant[k] : best;
    }
    printf("RMS error of the bias, deg/h: correction alone %.2e, best constant process noise %.2e, fed by snapshots %.2e\n",
           sqrt(plain / (double)(n - FIRST)), sqrt(best / (double)(n - FIRST)), sqrt(of_fed / (double)(n - FIRST)));
    printf("fed by snapshots / best constant: %.3f\n", sqrt(of_fed / best));
    return 0;
}
