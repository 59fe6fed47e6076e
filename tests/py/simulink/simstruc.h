/* simstruc.h - stand-ins for what sfun_gtc.c asks of Simulink, one block of it. */
#ifndef STAND_IN_SIMSTRUC_H
#define STAND_IN_SIMSTRUC_H

#include <stddef.h>

typedef double real_T;
typedef int int_T;
typedef const real_T *const *InputRealPtrsType;
typedef real_T mxArray;

#define SS_DOUBLE 0

typedef struct {
    int_T n_parameters, n_inputs, n_outputs, n_times, n_work, work_doubles, feeds_through;
    real_T parameter, period, offset;
    real_T in[8], out[8];
    const real_T *to[8];
    const char *error;
    void *work;
} SimStruct;

#define ssSetNumSFcnParams(S, n) ((S)->n_parameters = (n))
#define ssGetNumSFcnParams(S) ((S)->n_parameters)
#define ssGetSFcnParamsCount(S) 1
#define ssGetSFcnParam(S, k) (&(S)->parameter)
#define mxGetScalar(array) (*(array))
#define ssSetNumInputPorts(S, n) ((S)->n_inputs = (n), 1)
#define ssSetNumOutputPorts(S, n) ((S)->n_outputs = (n), 1)
#define ssSetInputPortWidth(S, port, n) ((void)(port), (void)(n))
#define ssSetOutputPortWidth(S, port, n) ((void)(port), (void)(n))
#define ssSetInputPortDirectFeedThrough(S, port, is) ((void)(port), (S)->feeds_through += (is))
#define ssSetNumSampleTimes(S, n) ((S)->n_times = (n))
#define ssSetSampleTime(S, k, t) ((S)->period = (t))
#define ssSetOffsetTime(S, k, t) ((S)->offset = (t))
#define ssSetNumDWork(S, n) ((S)->n_work = (n))
#define ssSetDWorkWidth(S, k, n) ((S)->work_doubles = (n))
#define ssSetDWorkDataType(S, k, type) ((void)(type))
#define ssGetDWork(S, k) ((S)->work)
#define ssSetErrorStatus(S, text) ((S)->error = (text))
#define ssGetInputPortRealSignalPtrs(S, port) ((InputRealPtrsType)&(S)->to[port])
#define ssGetOutputPortRealSignal(S, port) (&(S)->out[port])

#endif
