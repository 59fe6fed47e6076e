/* filter.c - the bias state of a navigation filter, fed by the snapshots of gtc. */
#include "filter.h"

/* The process has another variance from now on: a part comes, which is not known, or a part goes, and what was
 * estimated of it with it. */
static void change(filter_t *filter, float sigma2)
{
    if (sigma2 >= filter->sigma2) {
        filter->variance += sigma2 - filter->sigma2;
    } else {
        const float share = sigma2 / filter->sigma2;
        const float left = sigma2 - (share * share * (filter->sigma2 - filter->variance));
        filter->rest *= share;
        filter->variance = (left > (0.01F * sigma2)) ? left : (0.01F * sigma2);
    }
    filter->sigma2 = sigma2;
}

void filter_step(filter_t *filter, float sigma, float correlation_s, float rate, float noise2, float dt)
{
    const float keep = (correlation_s > dt) ? (1.0F - (dt / correlation_s)) : 0.0F;
    float gain;

    filter->rest *= keep;
    filter->variance = (keep * keep * filter->variance) + ((1.0F - (keep * keep)) * filter->sigma2);
    change(filter, sigma * sigma);
    gain = filter->variance / (filter->variance + noise2);
    filter->rest += gain * (rate - filter->rest);
    filter->variance *= 1.0F - gain;
}
