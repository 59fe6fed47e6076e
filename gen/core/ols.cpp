#include "ols.hpp"

#include <algorithm>
#include <cmath>

namespace gyrotc {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

OlsPath select_columns(const NormalEquations &dictionary, const SelectionRule &rule) {
    const VectorXd norms = dictionary.norms();
    VectorXd rest = norms, moments = dictionary.moments();
    const Index q = dictionary.size(), limit = std::min(rule.max_columns, q);
    const double energy = dictionary.energy();
    MatrixXd rows(q, limit);  // columns of the Cholesky factor, for all candidates
    std::vector<char> open(static_cast<std::size_t>(q), 1);
    OlsPath path;
    path.reduction.resize(limit);
    path.rest.resize(limit);
    double left = energy;
    Index m = 0;
    for (; m < limit; ++m) {
        const bool in_order = rule.in_order || m < rule.given;
        Index best = -1;
        double gain = -1.0;
        for (Index j = 0; j < q; ++j) {
            if (!open[static_cast<std::size_t>(j)] || !(rest[j] > rule.guard * norms[j])) continue;
            const double g = moments[j] * moments[j] / rest[j];
            if (g > gain) {
                gain = g;
                best = j;
                if (in_order) break;
            }
        }
        if (best < 0) break;
        const double root = std::sqrt(rest[best]);
        VectorXd l = dictionary.column(best);
        if (m > 0) l.noalias() -= rows.leftCols(m) * rows.row(best).head(m).transpose();
        l /= root;
        const double coefficient = moments[best] / root;
        moments -= coefficient * l;
        rest -= l.cwiseAbs2();
        rows.col(m) = l;
        open[static_cast<std::size_t>(best)] = 0;
        path.chosen.push_back(best);
        left = std::max(left - coefficient * coefficient, 0.0);
        path.rest[m] = left;
        path.reduction[m] = energy > 0.0 ? coefficient * coefficient / energy : 0.0;
        if (left < rule.rho * energy) {
            ++m;
            break;
        }
    }
    path.reduction.conservativeResize(m);
    path.rest.conservativeResize(m);
    return path;
}

VectorXd least_squares(const Samples &samples, const MatrixXd &gaussians, double ridge) {
    constexpr Index kBlock = 2048;
    const Index m = gaussians.rows() + 1, n = samples.t.size();
    MatrixXd triangle = MatrixXd::Zero(m, m + 1);  // (R | Q'y) of the samples so far, ridge rows first
    triangle.diagonal().tail(m - 1).setConstant(std::sqrt(ridge));
    for (Index first = 0; first < n; first += kBlock) {
        const Index rows = std::min(kBlock, n - first);
        MatrixXd stack(m + rows, m + 1);
        stack.topRows(m) = triangle;
        const Eigen::ArrayXd root = samples.weight.segment(first, rows).array().sqrt();
        const auto t = samples.t.segment(first, rows).array(), r = samples.r.segment(first, rows).array();
        stack.col(0).tail(rows) = root;
        for (Index j = 0; j + 1 < m; ++j)
            stack.col(j + 1).tail(rows) = root * (-((t - gaussians(j, 0)) / gaussians(j, 2)).square() -
                                                  ((r - gaussians(j, 1)) / gaussians(j, 3)).square())
                                                     .exp();
        stack.col(m).tail(rows) = root * samples.y.segment(first, rows).array();
        const Eigen::HouseholderQR<MatrixXd> qr(stack.leftCols(m));
        const VectorXd rotated = qr.householderQ().adjoint() * stack.col(m);
        triangle.leftCols(m) = qr.matrixQR().topRows(m).triangularView<Eigen::Upper>();
        triangle.col(m) = rotated.head(m);
    }
    return triangle.leftCols(m).triangularView<Eigen::Upper>().solve(triangle.col(m));
}

}  // namespace gyrotc
