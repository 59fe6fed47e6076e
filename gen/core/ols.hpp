// ols.hpp - orthogonal least squares by error-reduction ratio (Chen, Cowan and Grant 1991; Ding et al. 2014,
// eq. (7) to (16)) as a pivoted Cholesky factorisation: O(Q M^2) after the normal equations.
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "equal_gaussians.hpp"

namespace gyrotc {

// Candidates that are given as columns.
class DenseColumns final : public NormalEquations {
  public:
    DenseColumns(Eigen::MatrixXd columns, const Eigen::VectorXd &y)
        : columns_(std::move(columns)), energy_(y.squaredNorm()), moments_(columns_.transpose() * y) {}

    Eigen::Index size() const override { return columns_.cols(); }
    double energy() const override { return energy_; }
    Eigen::VectorXd norms() const override { return columns_.colwise().squaredNorm(); }
    Eigen::VectorXd moments() const override { return moments_; }
    Eigen::VectorXd column(Eigen::Index j) const override { return columns_.transpose() * columns_.col(j); }

  private:
    Eigen::MatrixXd columns_;
    double energy_;
    Eigen::VectorXd moments_;
};

// The whole path of models: the first m chosen columns are the model of m columns.
struct OlsPath {
    std::vector<Eigen::Index> chosen;  // columns in order of selection
    Eigen::VectorXd reduction;         // error-reduction ratio of each, of y'y
    Eigen::VectorXd rest;              // residual sum of squares after each
};

struct SelectionRule {
    Eigen::Index max_columns = 31;
    double rho = 0.0;      // ends when 1 - sum of reductions < rho, eq. (16)
    double guard = 1e-7;   // passes over a candidate whose squared norm orthogonal to the chosen is below this share:
                           // a million times what interpolated products err by, so that rounding decides nothing
    Eigen::Index given = 1;  // so many leading columns (the constant, w0) are taken first
    bool in_order = false;   // takes the others as they come, too, instead of by largest reduction
};

// Selects columns until the rule ends it or nothing can be chosen.
OlsPath select_columns(const NormalEquations &dictionary, const SelectionRule &rule);

// Least-squares weights (w0, w_1 ... w_M) of Gaussians (rows c_t, c_r, width_t, width_r), by QR over blocks of samples,
// with the ridge on w_1 ... w_M only.
Eigen::VectorXd least_squares(const Samples &samples, const Eigen::MatrixXd &gaussians, double ridge);

}  // namespace gyrotc
