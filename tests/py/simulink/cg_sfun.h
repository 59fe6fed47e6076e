/* cg_sfun.h - in place of Simulink: two blocks of sfun_gtc.c, fed from standard input.
 *
 * Argument: the sample period in s. In: lines of temperature and rate. Out: the four outputs of the first block; the
 * second one sees other temperatures, and must not matter.
 */
#include <stdio.h>
#include <stdlib.h>

static int block_start(SimStruct *S, double period)
{
    int k;
    for (k = 0; k < 8; k++) {
        S->to[k] = &S->in[k];
    }
    S->parameter = period;
    mdlInitializeSizes(S);
    mdlInitializeSampleTimes(S);
    S->work = calloc((size_t)S->work_doubles, sizeof(real_T));
    mdlStart(S);
    if (S->error != NULL) {
        (void)printf("error: %s\n", S->error);
    }
    return (S->error == NULL) && (S->n_inputs == 2) && (S->feeds_through == 2) && (S->n_outputs == 4) && (S->period == period);
}

static void block_step(SimStruct *S, double temperature, double rate)
{
    S->in[0] = temperature;
    S->in[1] = rate;
    mdlOutputs(S, 0);
}

int main(int argc, char **argv)
{
    static SimStruct first, second;
    const double period = (argc > 1) ? atof(argv[1]) : 0.0;
    double temperature, rate;
    if (!block_start(&first, period) || !block_start(&second, period)) {
        return 1;
    }
    while (scanf("%lf %lf", &temperature, &rate) == 2) {
        block_step(&first, temperature, rate);
        block_step(&second, temperature + 7.0, rate);
        (void)printf("%.17g %.17g %.17g %.17g\n", first.out[0], first.out[1], first.out[2], first.out[3]);
    }
    mdlTerminate(&first);
    mdlTerminate(&second);
    free(first.work);
    free(second.work);
    return 0;
}
