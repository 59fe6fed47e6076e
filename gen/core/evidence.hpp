// evidence.hpp - a smooth reference map of the bias, learnt by maximum evidence.
//
// Hilbert-space Gaussian process (Solin and Saerkkae 2020) on binned samples:
//
//   f(t, r) = const + s1(t) + s2(t) + a(t, r)
//
// s1 has a short scale, s2 a long one, a couples both inputs. Inputs and bias are standardised by
// the caller. What the process believes is the target of the compression into few Gaussians.
#pragma once

#include <Eigen/Dense>
#include <optional>

#include "waves.hpp"

namespace gyrotc {

// Samples gathered into cells of the input plane.
struct Bins {
    Eigen::VectorXd t;       // mean normalised temperature of each bin
    Eigen::VectorXd r;       // mean normalised dT/dt
    Eigen::VectorXd count;   // summed weight of its samples, in units of one sample, > 0
    Eigen::VectorXd mean;    // mean bias, standardised
    double within = 0.0;     // summed weighted squares about the means of the bins
    double samples = 0.0;    // number of samples
};

// Logarithms of: s1, l1, s2, l2 (parts of temperature), sa, la_t, la_r (coupled part), sigma.
constexpr int kEvidenceParameters = 8;
using EvidenceParameters = Eigen::Matrix<double, kEvidenceParameters, 1>;

// The process conditioned on bins, and its evidence.
class EvidenceModel {
  public:
    // `least_sigma` truncates the prior of sigma from below: less than it is not believed, whatever the evidence says.
    // 0: the log-normal prior alone.
    explicit EvidenceModel(const Bins &bins, double least_sigma = 0.0);

    // Negative log posterior of the parameters (up to a constant) and its gradient.
    // The gradient is with respect to the logarithms. Not finite input gives +inf.
    double objective(const EvidenceParameters &log_parameters, EvidenceParameters *gradient) const;

    // Maximises the evidence from two starts of the short scale (and from `start` if given), then conditions.
    void optimise(const EvidenceParameters *start = nullptr);

    // Conditions on the bins with these parameters. What `variance` and `freedom` need is made when they are asked.
    void condition(const EvidenceParameters &log_parameters);

    Eigen::VectorXd mean(const Eigen::VectorXd &t, const Eigen::VectorXd &r) const;
    Eigen::VectorXd variance(const Eigen::VectorXd &t, const Eigen::VectorXd &r) const;

    const EvidenceParameters &log_parameters() const { return log_parameters_; }
    double sigma() const { return std::exp(log_parameters_[kEvidenceParameters - 1]); }
    double freedom() const;                            // effective number of parameters
    double value() const { return value_; }            // objective at the optimum
    int evaluations() const { return evaluations_; }

  private:
    Eigen::VectorXd prior_variance(const EvidenceParameters &log_parameters, Eigen::MatrixXd *derivative) const;

    double samples_ = 0.0;
    double least_sigma_ = 0.0;
    double squares_ = 0.0;               // y'y
    Domain domain_;
    Eigen::MatrixXd gram_;               // Phi' N Phi
    Eigen::VectorXd moment_;             // Phi' N y
    EvidenceParameters log_parameters_ = EvidenceParameters::Zero();
    Eigen::VectorXd coefficients_;       // posterior mean
    void spread() const;

    Eigen::VectorXd root_;               // sqrt of the prior variances
    Eigen::MatrixXd lower_;              // Cholesky factor of the posterior precision, scaled by root_ and noise
    mutable Eigen::MatrixXd factor_;     // sqrt of the posterior covariance: cov = factor factor'; empty: not made yet
    mutable std::optional<QuadraticForm> form_;  // the same covariance, as waves
    mutable double freedom_ = 0.0;
    double value_ = 0.0;
    int evaluations_ = 0;
};

}  // namespace gyrotc
