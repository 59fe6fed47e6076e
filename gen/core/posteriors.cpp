// posteriors.cpp - an inverse by Cholesky factorisation for each unit; zeros of triangles are passed over by blocks.
#include "posteriors.hpp"

#include <algorithm>
#include <stdexcept>

namespace gyrotc {

using Eigen::Index;
using Eigen::Lower;
using Eigen::MatrixXd;

namespace {

constexpr Index kBlock = 16;  // columns: as fast as any other between 8 and 32 at n = 47 and 121

}  // namespace

void posteriors(const MatrixXd &prior, const double *precision, Index units, double *covariance,
                double *log_determinant) {
    const Index n = prior.rows();
    Eigen::LLT<MatrixXd> factor(n);
    MatrixXd inverse(n, n);  // of the factor
    for (Index u = 0; u < units; ++u) {
        factor.compute(prior + Eigen::Map<const MatrixXd>(precision + u * n * n, n, n));
        if (factor.info() != Eigen::Success) throw std::domain_error("a precision is not positive definite");
        const MatrixXd &lower = factor.matrixLLT();
        log_determinant[u] = -2.0 * lower.diagonal().array().log().sum();
        inverse.setIdentity();
        for (Index k = 0; k < n; k += kBlock) {
            const Index rest = n - k, width = std::min(kBlock, rest);
            auto columns = inverse.block(k, k, rest, width);
            lower.bottomRightCorner(rest, rest).triangularView<Lower>().solveInPlace(columns);
        }
        Eigen::Map<MatrixXd> found(covariance + u * n * n, n, n);
        found.setZero();
        for (Index k = 0; k < n; k += kBlock) {
            const Index width = std::min(kBlock, n - k), seen = k + width;
            found.topLeftCorner(seen, seen).selfadjointView<Lower>().rankUpdate(
                inverse.block(k, 0, width, seen).transpose());
        }
        found.triangularView<Eigen::StrictlyUpper>() = found.transpose();
    }
}

}  // namespace gyrotc
