#include "evidence.hpp"

#include <nlopt.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

namespace gyrotc {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kColumns = 24;      // of a triangle at once: what is zero above or below them is left out
constexpr double kReach = 1.4;            // domain over largest |input|: the basis vanishes at its edge
constexpr double kConstVariance = 100.0;  // of the constant, in units of the bias' variance
constexpr double kVarianceFloor = 1e-10;  // a function that is not used keeps the equations solvable
constexpr double kPi = 3.14159265358979323846;  // C++ has it from C++20 on

// Log-normal priors of the parameters: weak, but they keep unused parts from drifting.
const EvidenceParameters kPriorMean =
    (EvidenceParameters() << std::log(0.3), std::log(0.15), std::log(1.0), std::log(0.7), std::log(0.3),
     std::log(0.8), std::log(0.8), std::log(0.3))
        .finished();
const EvidenceParameters kPriorSd =
    (EvidenceParameters() << 1.5, 0.7, 1.0, 0.5, 1.5, 0.5, 0.5, 3.0).finished();
constexpr double kShortScaleStarts[] = {0.08, 0.35};

double frequency(int j, double reach) { return kPi * (j + 1) / (2.0 * reach); }

// Spectral density of a squared-exponential process of one input at w, and its derivatives by log s and log l.
struct Density {
    double value, by_s, by_l;
};
Density density(double s, double l, double w) {
    const double lw2 = l * l * w * w;
    const double v = s * s * std::sqrt(2.0 * kPi) * l * std::exp(-0.5 * lw2);
    return {v, 2.0 * v, v * (1.0 - lw2)};
}

// Inverse of a lower triangle. What lies above a block of columns is zero and is not solved for.
MatrixXd inverse_of(const MatrixXd &lower) {
    const Eigen::Index n = lower.rows();
    MatrixXd inverse = MatrixXd::Identity(n, n);
    for (Eigen::Index at = 0; at < n; at += kColumns) {
        const Eigen::Index left = n - at, width = std::min<Eigen::Index>(kColumns, left);
        auto block = inverse.block(at, at, left, width);
        lower.bottomRightCorner(left, left).triangularView<Eigen::Lower>().solveInPlace(block);
    }
    return inverse;
}

double reach_of(const VectorXd &x) { return kReach * std::max(x.cwiseAbs().maxCoeff(), 1e-3); }

}  // namespace

EvidenceModel::EvidenceModel(const Bins &bins, double least_sigma)
    : samples_(bins.samples), least_sigma_(least_sigma) {
    if (bins.t.size() == 0) throw std::invalid_argument("evidence: no bins");
    domain_ = {reach_of(bins.t), reach_of(bins.r)};
    Sums sums = sums_over(domain_, bins.t, bins.r, bins.count, bins.mean);
    gram_ = std::move(sums.products);
    moment_ = std::move(sums.moments);
    squares_ = bins.count.dot(bins.mean.cwiseAbs2()) + bins.within;
}

VectorXd EvidenceModel::prior_variance(const EvidenceParameters &log_parameters, MatrixXd *derivative) const {
    const EvidenceParameters p = log_parameters.array().exp();
    VectorXd variance(kBasis);
    variance[0] = kConstVariance;
    if (derivative) derivative->setZero(kBasis, kEvidenceParameters);
    for (int j = 0; j < kOfT; ++j) {
        const double w = frequency(j, domain_.t);
        const Density a = density(p[0], p[1], w), b = density(p[2], p[3], w);
        variance[1 + j] = a.value + b.value + kVarianceFloor;
        if (derivative) derivative->row(1 + j).head<4>() << a.by_s, a.by_l, b.by_s, b.by_l;
    }
    for (int i = 0; i < kCoupledT; ++i)
        for (int j = 0; j < kCoupledR; ++j) {
            const Density a = density(p[4], p[5], frequency(i, domain_.t));
            const Density b = density(1.0, p[6], frequency(j, domain_.r));
            const int k = 1 + kOfT + i * kCoupledR + j;
            variance[k] = a.value * b.value + kVarianceFloor;
            if (derivative)
                derivative->row(k).segment<3>(4) << a.by_s * b.value, a.by_l * b.value, a.value * b.by_l;
        }
    return variance;
}

double EvidenceModel::objective(const EvidenceParameters &log_parameters, EvidenceParameters *gradient) const {
    MatrixXd slope;
    const VectorXd lambda = prior_variance(log_parameters, gradient ? &slope : nullptr);
    const VectorXd h = lambda.cwiseSqrt();
    const double noise = std::exp(2.0 * log_parameters[7]);
    MatrixXd a = h.asDiagonal() * gram_ * h.asDiagonal();
    a.diagonal().array() += noise;
    const Eigen::LLT<MatrixXd> llt(a);
    if (llt.info() != Eigen::Success || !std::isfinite(noise)) return std::numeric_limits<double>::infinity();
    const VectorXd hg = h.cwiseProduct(moment_);
    const VectorXd alpha = llt.solve(hg);
    const double fitted = squares_ - hg.dot(alpha);
    const EvidenceParameters deviation = (log_parameters - kPriorMean).cwiseQuotient(kPriorSd);
    const double value = 0.5 * fitted / noise + llt.matrixLLT().diagonal().array().log().sum() +
                         (samples_ - kBasis) * log_parameters[7] + 0.5 * deviation.squaredNorm();
    if (gradient) {
        const MatrixXd inverse_l = inverse_of(llt.matrixLLT());
        const VectorXd inverse_diagonal = inverse_l.colwise().squaredNorm();
        const VectorXd by_log_lambda =
            0.5 * (1.0 - noise * inverse_diagonal.array() - alpha.array().square()).matrix();
        *gradient = slope.transpose() * by_log_lambda.cwiseQuotient(lambda);
        (*gradient)[7] = samples_ - kBasis + noise * inverse_diagonal.sum() - fitted / noise + alpha.squaredNorm();
        *gradient += deviation.cwiseQuotient(kPriorSd);
    }
    return value;
}

void EvidenceModel::condition(const EvidenceParameters &log_parameters) {
    log_parameters_ = log_parameters;
    root_ = prior_variance(log_parameters, nullptr).cwiseSqrt();
    const double noise = std::exp(2.0 * log_parameters[7]);
    MatrixXd a = root_.asDiagonal() * gram_ * root_.asDiagonal();
    a.diagonal().array() += noise;
    const Eigen::LLT<MatrixXd> llt(a);
    if (llt.info() != Eigen::Success) throw std::runtime_error("evidence: the posterior is not positive definite");
    coefficients_ = root_.cwiseProduct(llt.solve(root_.cwiseProduct(moment_)));
    lower_ = llt.matrixLLT();
    factor_.resize(0, 0);
    form_.reset();
}

void EvidenceModel::spread() const {
    if (factor_.size() > 0 || lower_.size() == 0) return;
    const double noise = std::exp(2.0 * log_parameters_[7]);
    const MatrixXd inverse_l = inverse_of(lower_);
    factor_ = std::sqrt(noise) * (root_.asDiagonal() * inverse_l.transpose());
    MatrixXd covariance = MatrixXd::Zero(kBasis, kBasis);
    covariance.selfadjointView<Eigen::Lower>().rankUpdate(factor_);
    form_.emplace(domain_, covariance);
    freedom_ = kBasis - noise * inverse_l.squaredNorm();
}

double EvidenceModel::freedom() const {
    spread();
    return freedom_;
}

void EvidenceModel::optimise(const EvidenceParameters *start) {
    struct Search {
        const EvidenceModel *model;
        int evaluations;
    } search{this, 0};
    const auto call = [](unsigned, const double *x, double *gradient, void *data) -> double {
        auto &s = *static_cast<Search *>(data);
        ++s.evaluations;
        EvidenceParameters g = EvidenceParameters::Zero();
        const double v = s.model->objective(Eigen::Map<const EvidenceParameters>(x), gradient ? &g : nullptr);
        if (!std::isfinite(v)) g.setZero();
        if (gradient) std::copy(g.begin(), g.end(), gradient);
        return std::isfinite(v) ? v : std::numeric_limits<double>::max();
    };
    std::vector<EvidenceParameters> starts;
    if (start) {
        starts.push_back(*start);
    } else {
        for (const double scale : kShortScaleStarts) {
            starts.push_back(kPriorMean);
            starts.back()[1] = std::log(scale);
        }
    }
    const std::unique_ptr<nlopt_opt_s, decltype(&nlopt_destroy)> opt(
        nlopt_create(NLOPT_LD_LBFGS, kEvidenceParameters), nlopt_destroy);
    if (!opt) throw std::bad_alloc();
    EvidenceParameters low = kPriorMean - 5.0 * kPriorSd, high = kPriorMean + 5.0 * kPriorSd;
    const int sigma = kEvidenceParameters - 1;
    if (least_sigma_ > 0.0) low[sigma] = std::clamp(std::log(least_sigma_), low[sigma], high[sigma]);
    for (EvidenceParameters &one : starts) one = one.cwiseMax(low).cwiseMin(high);
    nlopt_set_min_objective(opt.get(), call, &search);
    nlopt_set_lower_bounds(opt.get(), low.data());
    nlopt_set_upper_bounds(opt.get(), high.data());
    nlopt_set_ftol_abs(opt.get(), 1e-3);
    nlopt_set_maxeval(opt.get(), 150);
    double best = std::numeric_limits<double>::infinity();
    EvidenceParameters at = starts.front();
    for (EvidenceParameters x : starts) {
        double v = 0.0;
        nlopt_optimize(opt.get(), x.data(), &v);  // whatever it says, x is the best point that it saw
        if (v < best) {
            best = v;
            at = x;
        }
    }
    value_ = best;
    evaluations_ = search.evaluations;
    condition(at);
}

VectorXd EvidenceModel::mean(const VectorXd &t, const VectorXd &r) const {
    return linear_form(domain_, coefficients_, t, r);
}

// By waves; where so little is left of them that rounding could show, by the factor.
VectorXd EvidenceModel::variance(const VectorXd &t, const VectorXd &r) const {
    spread();
    VectorXd found = form_->at(t, r);
    for (Eigen::Index k = 0; k < found.size(); ++k)
        if (!(found[k] >= form_->least()))
            found[k] = (basis_of(domain_, t.segment(k, 1), r.segment(k, 1)) * factor_).squaredNorm();
    return found;
}

}  // namespace gyrotc
