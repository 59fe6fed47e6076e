// ols.hpp - orthogonal least squares by error-reduction ratio (Chen, Cowan and Grant 1991; Ding et al. 2014,
// eq. (7) to (16)) as a pivoted Cholesky factorisation: O(Q M^2) after the normal equations.
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "equal_gaussians.hpp"

namespace gyrotc {

// The whole path of models: the first m chosen columns are the model of m columns. Column 0 (the constant, w0) is
// always the first.
struct OlsPath {
    std::vector<Eigen::Index> chosen;  // columns in order of selection
    Eigen::VectorXd reduction;         // error-reduction ratio of each, of y'y
    Eigen::VectorXd rest;              // residual sum of squares after each
    Eigen::MatrixXd factor;            // lower triangular: Gram of the chosen = factor factor'
    Eigen::VectorXd orthogonal;        // coefficients on the orthonormal columns
};

struct SelectionRule {
    Eigen::Index max_columns = 31;
    double rho = 0.0;      // ends when 1 - sum of reductions < rho, eq. (16)
    double guard = 1e-10;  // passes over a candidate whose squared norm orthogonal to the chosen is below this share
    bool in_order = false; // takes the candidates as they come instead of by largest reduction
};

// Selects columns until the rule ends it or nothing can be chosen.
OlsPath select_columns(const EqualGaussians &dictionary, const SelectionRule &rule);

// Weighted sum of squared errors on other samples of every model on the path (its first 1, 2, ... columns), with the
// weights that the path's own samples gave.
Eigen::VectorXd errors_along(const OlsPath &path, const EqualGaussians &dictionary, const Samples &samples);

// Least-squares weights (w0, w_1 ... w_M) of Gaussians (rows c_t, c_r, width_t, width_r), by QR over blocks of samples,
// with the ridge on w_1 ... w_M only.
Eigen::VectorXd least_squares(const Samples &samples, const Eigen::MatrixXd &gaussians, double ridge);

}  // namespace gyrotc
