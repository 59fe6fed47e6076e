/* filter.h - the bias state of a navigation filter, fed by the snapshots of gtc. */
#ifndef FILTER_H_INCLUDED
#define FILTER_H_INCLUDED

/* What is left of the bias after the correction: a first-order process with the sigma and the correlation time that
 * the snapshot of the moment gives. Starts as {0}. */
typedef struct {
    float rest;     /* estimate, deg/h: true bias less correction */
    float variance; /* of it, (deg/h)^2 */
    float sigma2;   /* variance of the process at the last step, (deg/h)^2 */
} filter_t;

/* One step of dt s: `sigma` and `correlation_s` of the snapshot, the mean compensated rate of a rest over dt, deg/h, and
 * the variance of its noise. */
void filter_step(filter_t *filter, float sigma, float correlation_s, float rate, float noise2, float dt);

#endif
