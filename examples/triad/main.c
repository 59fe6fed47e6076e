/* main.c - three gyros, one image: a table and a state for each axis, one loop over them.
 *
 * SPDX-License-Identifier: MIT
 */
#include <stdio.h>

#include "gtc_rlg_0042_x.h"
#include "gtc_rlg_0042_y.h"
#include "gtc_rlg_0042_z.h"

#define N_AXES 3
#define PERIOD_US 1000000UL /* a reading each second, of every gyro's own sensor */
#define SECONDS 60

static const gtc_f32_table_t *const tables[N_AXES] = {
    &gtc_rlg_0042_x_f32, &gtc_rlg_0042_y_f32, &gtc_rlg_0042_z_f32,
};
static gtc_f32_state_t states[N_AXES];

/* At boot: no axis is used if any of them is not sound. */
static int start(void)
{
    int axis;

    for (axis = 0; axis < N_AXES; axis++) {
        int status = gtc_f32_check(tables[axis]);

        if (status == GTC_OK) {
            status = gtc_f32_init(&states[axis], tables[axis], PERIOD_US);
        }
        if (status != GTC_OK) {
            return status;
        }
    }
    return GTC_OK;
}

/* Once a second: a temperature of each axis, in C; compensates the rates, in deg/h. Remarks of all axes as bits,
 * or the first negative status. */
static int correct(const float temperature[N_AXES], float rate[N_AXES])
{
    int axis;
    int remarks = 0;

    for (axis = 0; axis < N_AXES; axis++) {
        float bias = 0.0F;
        int status = gtc_f32_sample(&states[axis], tables[axis], PERIOD_US, &temperature[axis]);

        if (status >= 0) {
            status |= gtc_f32_bias(&states[axis], tables[axis], &bias);
        }
        if (status < 0) {
            return status;
        }
        rate[axis] -= bias;
        remarks |= status;
    }
    return remarks;
}

int main(void)
{
    float rate[N_AXES] = { 0.0F, 0.0F, 0.0F };
    int second;
    int status = start();

    for (second = 0; (second < SECONDS) && (status >= 0); second++) {
        const float temperature[N_AXES] = { 20.0F, 21.5F, 19.0F + (0.01F * (float)second) };
        int axis;

        for (axis = 0; axis < N_AXES; axis++) {
            rate[axis] = 0.0F; /* the gyros are at rest */
        }
        status = correct(temperature, rate);
    }
    if (status < 0) {
        printf("do not navigate: %d\n", status);
        return 1;
    }
    printf("x %.6f y %.6f z %.6f deg/h, remarks %d\n", (double)rate[0], (double)rate[1], (double)rate[2], status);
    return 0;
}
