// posteriors.hpp - covariances of many units' coefficients, given one normal prior and what recordings of each say.
#pragma once

#include <Eigen/Dense>

namespace gyrotc {

// With the prior's precision Q and a unit's own precision G: P = (Q + G)^-1.
// `precision` holds one symmetric matrix (n, n) of each unit after the other; `covariance` takes their P in the same
// order, `log_determinant` ln det P. std::domain_error: a sum is not positive definite.
void posteriors(const Eigen::MatrixXd &prior, const double *precision, Eigen::Index units, double *covariance,
                double *log_determinant);

}  // namespace gyrotc
