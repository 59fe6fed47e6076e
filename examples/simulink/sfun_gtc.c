/* sfun_gtc.c - the correction as a block of Simulink: a level-2 C S-function over the emitted C, so that the model of
 * the navigation sees every bit that the target will see.
 *
 *   inputs    temperature, C, of the gyro's own sensor; measured rate, deg/h
 *   outputs   compensated rate, deg/h; bias in force, deg/h; 1 sigma of it, deg/h (-1 where the table has none);
 *             status bits (gtc.h), negative if there is no correction
 *   parameter sample period, s
 *
 * Build, in MATLAB:  mex -I../minimal -I../../include CFLAGS="$CFLAGS -std=c99 -ffp-contract=off" sfun_gtc.c
 *                        ../minimal/gtc_rlg_0042.c ../../libc/gtc_f32.c ../../libc/gtc_crc.c
 * Another table: -DGTC_TABLE=gtc_<id>_f32 -DGTC_TABLE_HEADER='"gtc_<id>.h"'.
 */
#define S_FUNCTION_NAME sfun_gtc
#define S_FUNCTION_LEVEL 2

#include "simstruc.h"

#ifndef GTC_TABLE
#define GTC_TABLE gtc_rlg_0042_f32
#define GTC_TABLE_HEADER "gtc_rlg_0042.h"
#endif
#include GTC_TABLE_HEADER

enum { IN_TEMPERATURE, IN_RATE, N_IN };
enum { OUT_RATE, OUT_BIAS, OUT_SIGMA, OUT_STATUS, N_OUT };

static void mdlInitializeSizes(SimStruct *S)
{
    int_T port;

    ssSetNumSFcnParams(S, 1);
    if (ssGetNumSFcnParams(S) != ssGetSFcnParamsCount(S)) {
        return; /* Simulink says which parameter is missing */
    }
    if (!ssSetNumInputPorts(S, N_IN) || !ssSetNumOutputPorts(S, N_OUT)) {
        return;
    }
    for (port = 0; port < N_IN; port++) {
        ssSetInputPortWidth(S, port, 1);
        ssSetInputPortDirectFeedThrough(S, port, 1);
    }
    for (port = 0; port < N_OUT; port++) {
        ssSetOutputPortWidth(S, port, 1);
    }
    ssSetNumSampleTimes(S, 1);
    ssSetNumDWork(S, 1); /* the state: Simulink keeps it, one for each block of a model; doubles for their alignment */
    ssSetDWorkWidth(S, 0, (int_T)((sizeof(gtc_f32_state_t) + sizeof(real_T) - 1U) / sizeof(real_T)));
    ssSetDWorkDataType(S, 0, SS_DOUBLE);
}

static void mdlInitializeSampleTimes(SimStruct *S)
{
    ssSetSampleTime(S, 0, mxGetScalar(ssGetSFcnParam(S, 0)));
    ssSetOffsetTime(S, 0, 0.0);
}

#define MDL_START
static void mdlStart(SimStruct *S)
{
    gtc_f32_state_t *const state = (gtc_f32_state_t *)ssGetDWork(S, 0);
    const real_T period_us = 1e6 * mxGetScalar(ssGetSFcnParam(S, 0));
    int status = gtc_f32_check(&GTC_TABLE);

    if (status != GTC_OK) {
        ssSetErrorStatus(S, "gtc_f32_check: build with -std=c99 -ffp-contract=off, without -ffast-math");
        return;
    }
    if (!((period_us >= 1.0) && (period_us <= 4294967295.0))) {
        ssSetErrorStatus(S, "the sample period is to be between a microsecond and 4294 s");
        return;
    }
    status = gtc_f32_init(state, &GTC_TABLE, (uint_least32_t)(period_us + 0.5));
    if (status != GTC_OK) {
        ssSetErrorStatus(S, "gtc_f32_init: no whole number of sample periods makes a block of the table");
    }
}

static void mdlOutputs(SimStruct *S, int_T tid)
{
    gtc_f32_state_t *const state = (gtc_f32_state_t *)ssGetDWork(S, 0);
    const real_T rate = *ssGetInputPortRealSignalPtrs(S, IN_RATE)[0];
    const float channels[1] = {(float)*ssGetInputPortRealSignalPtrs(S, IN_TEMPERATURE)[0]};
    gtc_f32_snapshot_t now;
    float bias = 0.0F;
    int status = gtc_f32_sample(state, channels);

    (void)tid;
    if (status >= 0) {
        status |= gtc_f32_bias(state, &bias);
    }
    now.sigma = -1.0F;
    if (gtc_f32_snapshot(state, &now) < 0) {
        now.sigma = -1.0F;
    }
    ssGetOutputPortRealSignal(S, OUT_RATE)[0] = rate - (real_T)bias;
    ssGetOutputPortRealSignal(S, OUT_BIAS)[0] = (real_T)bias;
    ssGetOutputPortRealSignal(S, OUT_SIGMA)[0] = (real_T)now.sigma;
    ssGetOutputPortRealSignal(S, OUT_STATUS)[0] = (real_T)status;
}

static void mdlTerminate(SimStruct *S)
{
    (void)S;
}

#ifdef MATLAB_MEX_FILE
#include "simulink.c"
#else
#include "cg_sfun.h"
#endif
