// mixed.hpp - a correction of few columns whose weights differ from power-on to power-on.
//
//   y = X (beta + b_g) + drift + white noise,   beta ~ N(0, P),   b_g ~ N(0, D)  for every group g
//
// Columns of X: 1, and powers of temperature and its rate, in three parts of one variance each. The drift of a power-on is
// an Ornstein-Uhlenbeck process, so that a Kalman filter whitens its means in O(n). The weights beta, given all of it,
// are shrunk by how much they scatter between groups (linear mixed model: Laird and Ware 1982).
#pragma once

#include <Eigen/Dense>
#include <vector>

namespace gyrotc {

constexpr int kMixedColumns = 5;     // 1; T; second and third power of T; dT/dt
constexpr int kMixedParts = 3;       // of beta: T, the higher powers, dT/dt
constexpr int kMixedParameters = 10; // logarithms of: beta's parts; b's constant and parts; drift, white noise, length
using MixedColumns = Eigen::Matrix<double, Eigen::Dynamic, kMixedColumns>;
using MixedParameters = Eigen::Matrix<double, kMixedParameters, 1>;
using MixedWeights = Eigen::Matrix<double, kMixedColumns, 1>;

// Means in order of power-on, then of time; standardised by the caller.
struct MixedMeans {
    MixedColumns columns;
    Eigen::VectorXd y;
    Eigen::VectorXd count;      // summed weight, median 1: the variance of white noise is that of one mean over it
    Eigen::VectorXd time_s;
    Eigen::VectorXi power_on;   // number of the power-on, ascending
    Eigen::VectorXi group;      // number of the group within all, contiguous
};

class MixedModel {
  public:
    // `length_s`: of the longest run; `white`: what neighbouring means differ by, in units of the standardised y.
    MixedModel(MixedMeans means, double white, double length_s);

    // Negative log posterior of the parameters, up to a constant; not finite where it cannot be had.
    double objective(const MixedParameters &log_parameters) const;

    // Most probable parameters, from two starts: much map, or much scatter between groups.
    void optimise();

    // Mean of beta, the constant first, given the means that are kept.
    MixedWeights weights(const Eigen::Array<bool, Eigen::Dynamic, 1> &kept) const;

    const MixedParameters &log_parameters() const { return log_parameters_; }

  private:
    struct Whitened;
    struct Sums;
    std::vector<Whitened> whitened(const MixedParameters &p, const Eigen::Array<bool, Eigen::Dynamic, 1> &kept) const;
    Sums sums(const MixedParameters &p, const std::vector<Whitened> &parts) const;
    double value(const MixedParameters &p, const std::vector<Whitened> &parts) const;

    MixedMeans means_;
    MixedParameters prior_mean_, prior_sd_, log_parameters_;
    bool many_ = false;  // groups, so that weights can scatter between them
};

}  // namespace gyrotc
