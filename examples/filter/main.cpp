/* A heading filter that uses the correction with its uncertainty (C++11).
 *
 * The compensated rate is integrated; the variance of the heading grows by what the correction is uncertain of over
 * its correlation time, and by the gyro's own noise. At a rest, what the gyro still shows re-zeroes the correction.
 *
 * SPDX-License-Identifier: MIT
 */
#include <cstdio>

#include "gtc.hpp"
#include "gtc_rlg_0042.h"

namespace {

const uint_least32_t kPeriodUs = 1000000UL; /* a temperature each second */
const float kArwVariance = 1e-6F; /* deg^2 per hour of integration: (1e-3 deg/sqrt(h))^2 */

class Heading {
public:
    /* Another `hours` of a rate in deg/h, corrected by what `now` holds. */
    void propagate(float rate, const gtc::f32::Snapshot &now, float hours)
    {
        const float bias_variance = now.sigma * now.sigma * 2.0F * (now.correlation_s / 3600.0F);
        angle_ += (rate - now.bias) * hours;
        variance_ += (bias_variance + kArwVariance) * hours;
    }
    float angle() const { return angle_; }
    float variance() const { return variance_; }

private:
    float angle_ = 0.0F;    /* deg */
    float variance_ = 0.0F; /* deg^2 */
};

} // namespace

int main()
{
    gtc::f32::Correction correction;
    Heading heading;

    if (!gtc::f32::check(gtc_rlg_0042_f32).is_ok() || !correction.init(gtc_rlg_0042_f32, kPeriodUs).is_ok()) {
        return 1;
    }
    for (int second = 0; second < 600; ++second) {
        const gtc::Status sampled = correction.sample(kPeriodUs, gtc::f32::Celsius(20.0F + static_cast<float>(second) / 64.0F));
        gtc::f32::Snapshot now = {};
        const gtc::Status known = correction.snapshot(now);
        if (sampled.failed() || (known.failed() && known.code() != GTC_E_ABSENT)) {
            return 2;
        }
        if (known.code() == GTC_E_ABSENT) { /* a table without uncertainties: the correction alone */
            gtc::f32::DegPerHour bias(0.0F);
            if (correction.bias(bias).failed()) {
                return 3;
            }
            now.bias = bias.value();
        }
        heading.propagate(0.01F + now.bias, now, 1.0F / 3600.0F);
    }
    std::printf("heading %.6f deg, variance %.3e deg^2\n", static_cast<double>(heading.angle()),
                static_cast<double>(heading.variance()));
    return 0;
}
