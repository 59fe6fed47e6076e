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
    path.orthogonal.resize(limit);
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
        path.orthogonal[m] = coefficient;
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
    path.orthogonal.conservativeResize(m);
    path.factor = MatrixXd::Zero(m, m);
    for (Index i = 0; i < m; ++i)
        path.factor.row(i).head(i + 1) = rows.row(path.chosen[static_cast<std::size_t>(i)]).head(i + 1);
    return path;
}

VectorXd errors_along(const OlsPath &path, const EqualGaussians &dictionary, const Samples &samples) {
    const Index m = static_cast<Index>(path.chosen.size()), n = samples.t.size();
    MatrixXd columns(n, m);
    for (Index k = 0; k < m; ++k) {
        const Index j = path.chosen[static_cast<std::size_t>(k)] - 1;
        if (j < 0) {
            columns.col(k).setOnes();
            continue;
        }
        const double c = dictionary.centers()(j, 0), d = dictionary.centers()(j, 1);
        columns.col(k) = (-((samples.t.array() - c) / dictionary.width_t()).square() -
                          ((samples.r.array() - d) / dictionary.width_r()).square())
                             .exp();
    }
    VectorXd errors(m), residual = samples.y;
    for (Index k = 0; k < m; ++k) {
        columns.col(k).noalias() -= columns.leftCols(k) * path.factor.row(k).head(k).transpose();
        columns.col(k) /= path.factor(k, k);
        residual -= path.orthogonal[k] * columns.col(k);
        errors[k] = samples.weight.dot(residual.cwiseAbs2());
    }
    return errors;
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
