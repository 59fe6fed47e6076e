#include "kohonen.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "random.hpp"

namespace gyrotc {

KohonenMap kohonen(const Eigen::MatrixXd &samples, const KohonenOptions &options) {
    const Eigen::Index n = samples.rows();
    if (n < 1 || samples.cols() != 2 || options.nodes < 1) throw std::invalid_argument("kohonen: no samples or nodes");
    KohonenMap map;
    if (n <= options.nodes) {
        map.nodes = samples;
        map.occupancy.setOnes(n);
        return map;
    }
    SplitMix64 random(options.seed);
    const auto first = random.permutation(n);
    const Eigen::Index m = options.nodes;
    Eigen::VectorXd x(m), y(m);
    for (Eigen::Index j = 0; j < m; ++j) {
        x[j] = samples(first[static_cast<std::size_t>(j)], 0);
        y[j] = samples(first[static_cast<std::size_t>(j)], 1);
    }
    const double steps = static_cast<double>(n) * options.max_epochs;
    const double decay = std::pow(options.rate_last / options.rate_first, 1.0 / std::max(1.0, steps - 1.0));
    double rate = options.rate_first;
    for (map.epochs = 0; map.epochs < options.max_epochs;) {
        const Eigen::VectorXd old_x = x, old_y = y;
        map.occupancy.setZero(m);
        for (const Eigen::Index i : random.permutation(n)) {
            const double sx = samples(i, 0), sy = samples(i, 1);
            Eigen::Index winner = 0;
            ((x.array() - sx).square() + (y.array() - sy).square()).minCoeff(&winner);
            x[winner] += rate * (sx - x[winner]);
            y[winner] += rate * (sy - y[winner]);
            map.occupancy[winner] += 1.0;
            rate *= decay;
        }
        ++map.epochs;
        const double moved = std::max((x - old_x).cwiseAbs().maxCoeff(), (y - old_y).cwiseAbs().maxCoeff());
        if (moved <= options.tolerance) break;
    }
    map.nodes.resize(m, 2);
    map.nodes << x, y;
    return map;
}

}  // namespace gyrotc
