#include "mixed.hpp"

#include <nlopt.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <utility>

namespace gyrotc {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Kept = Eigen::Array<bool, Eigen::Dynamic, 1>;

constexpr double kConstantSd = 5.0;  // of beta's constant, in units of the bias' spread: as good as free
constexpr double kReach = 4.0;       // standard deviations of the prior, to either side, that are searched
constexpr double kStep = 1e-4;       // of a logarithm, for differences: their error is 1e-8 of what is asked
constexpr int kNoise = kMixedParameters - 3;  // the first parameter of drift and noise
constexpr int kScatter = kMixedParts;         // the first of the scatter between groups

// Logarithms of standard deviations in units of the bias' spread. A gyro's line is about the spread, its curve and its
// dT/dt a third and a seventh of it; from power-on to power-on the constant moves by a fifth, the rest by less. The
// prior is broad: a factor of e, one sigma.
const MixedParameters kPriorMean =
    (MixedParameters() << 0.0, -1.0, -2.0, -1.5, -2.0, -2.0, -3.0, -1.5, 0.0, 0.0).finished();
constexpr double kSd = 1.0, kLengthSd = 0.7;
constexpr double kRunPerLength = 3.0;    // a drift forgets itself within a third of a run
constexpr double kLittleMap = 1.5;       // second start: the map e^-1.5 smaller, and the scatter e larger
constexpr double kMoreScatter = 1.0;

MixedWeights scale_of(const MixedParameters &p, int first, double constant) {
    MixedWeights s;
    s << constant, std::exp(p[first]), std::exp(p[first + 1]), std::exp(p[first + 1]), std::exp(p[first + 2]);
    return s;
}

}  // namespace

// Of one power-on: products of whitened columns, those of each group one behind the other, and of y.
struct MixedModel::Whitened {
    MatrixXd gram;
    VectorXd moment;
    double square = 0.0;
    double log_determinant = 0.0;
    int groups = 0;
};

// Of everything, the scatter between groups taken into the noise.
struct MixedModel::Sums {
    Eigen::Matrix<double, kMixedColumns, kMixedColumns> gram;
    MixedWeights moment;
    double square = 0.0;
    double log_determinant = 0.0;
};

MixedModel::MixedModel(MixedMeans means, double white, double length_s) : means_(std::move(means)) {
    const Eigen::Index n = means_.y.size();
    if (n == 0 || !(white > 0.0) || !(length_s > 0.0)) throw std::invalid_argument("mixed: no means");
    many_ = (means_.group.array() != means_.group[0]).any();
    prior_mean_ = kPriorMean;
    prior_mean_[kNoise + 1] = std::log(white);
    prior_mean_[kNoise + 2] = std::log(length_s / kRunPerLength);
    prior_sd_.setConstant(kSd);
    prior_sd_[kNoise + 2] = kLengthSd;
    log_parameters_ = prior_mean_;
}

std::vector<MixedModel::Whitened> MixedModel::whitened(const MixedParameters &p, const Kept &kept) const {
    constexpr int kAll = kMixedColumns + 1;
    using Row = Eigen::Matrix<double, kAll, 1>;
    const double drift = std::exp(2.0 * p[kNoise]), white = std::exp(2.0 * p[kNoise + 1]);
    const double length = std::exp(p[kNoise + 2]);
    std::vector<Whitened> parts;
    const Eigen::Index n = means_.y.size();
    for (Eigen::Index begin = 0, end = 0; begin < n; begin = end) {
        while (end < n && means_.power_on[end] == means_.power_on[begin]) ++end;
        const int first = means_.group[begin], groups = many_ ? means_.group[end - 1] - first + 1 : 1;
        // Columns of other groups are zero in a row, but the filter carries what it has seen of them: all are filtered.
        MatrixXd rows = MatrixXd::Zero(end - begin, groups * kMixedColumns + 1);
        VectorXd state = VectorXd::Zero(rows.cols()), seen(rows.cols());
        Whitened part;
        part.groups = groups;
        double variance = drift, last = 0.0;
        Eigen::Index used = 0;
        for (Eigen::Index k = begin; k < end; ++k) {
            if (!kept[k]) continue;
            if (used > 0) {
                const double fade = std::exp(-std::abs(means_.time_s[k] - last) / length);
                state *= fade;
                variance = fade * fade * variance + drift * (1.0 - fade * fade);
            }
            last = means_.time_s[k];
            seen.setZero();
            seen.segment((many_ ? means_.group[k] - first : 0) * kMixedColumns, kMixedColumns) =
                means_.columns.row(k).transpose();
            seen[rows.cols() - 1] = means_.y[k];
            const double total = variance + white / means_.count[k];
            seen -= state;
            rows.row(used++) = seen.transpose() / std::sqrt(total);
            state += seen * (variance / total);
            variance *= 1.0 - variance / total;
            part.log_determinant += std::log(total);
        }
        const auto whole = rows.topRows(used);
        const auto columns = whole.leftCols(groups * kMixedColumns);
        part.gram = columns.transpose() * columns;
        part.moment = columns.transpose() * whole.col(whole.cols() - 1);
        part.square = whole.col(whole.cols() - 1).squaredNorm();
        parts.push_back(std::move(part));
    }
    return parts;
}

MixedModel::Sums MixedModel::sums(const MixedParameters &p, const std::vector<Whitened> &parts) const {
    Sums total;
    total.gram.setZero();
    total.moment.setZero();
    const MixedWeights own = many_ ? scale_of(p, kScatter + 1, std::exp(p[kScatter])) : MixedWeights::Zero();
    for (const Whitened &part : parts) {
        const Eigen::Index size = part.gram.rows();
        const VectorXd scale = own.replicate(part.groups, 1);
        MatrixXd inner = scale.asDiagonal() * part.gram * scale.asDiagonal();
        inner.diagonal().array() += 1.0;
        const Eigen::LLT<MatrixXd> llt(inner);
        // Less what the scatter explains, of every group's columns and of y: the sum of a part's columns is X.
        MatrixXd joined = MatrixXd::Zero(size, kMixedColumns + 1);
        for (int g = 0; g < part.groups; ++g)
            joined.leftCols(kMixedColumns) += part.gram.middleCols(g * kMixedColumns, kMixedColumns);
        joined.col(kMixedColumns) = part.moment;
        MatrixXd less = scale.asDiagonal() * joined;
        llt.matrixL().solveInPlace(less);
        MatrixXd explained = less.transpose() * less;
        MatrixXd whole = MatrixXd::Zero(kMixedColumns, kMixedColumns + 1);
        for (int g = 0; g < part.groups; ++g) whole += joined.middleRows(g * kMixedColumns, kMixedColumns);
        total.gram += whole.leftCols(kMixedColumns) - explained.topLeftCorner(kMixedColumns, kMixedColumns);
        total.moment += whole.col(kMixedColumns) - explained.topRightCorner(kMixedColumns, 1);
        total.square += part.square - explained(kMixedColumns, kMixedColumns);
        total.log_determinant += part.log_determinant + 2.0 * llt.matrixLLT().diagonal().array().log().sum();
    }
    return total;
}

double MixedModel::value(const MixedParameters &p, const std::vector<Whitened> &parts) const {
    const Sums total = sums(p, parts);
    const MixedWeights scale = scale_of(p, 0, kConstantSd);
    Eigen::Matrix<double, kMixedColumns, kMixedColumns> inner = scale.asDiagonal() * total.gram * scale.asDiagonal();
    inner.diagonal().array() += 1.0;
    const Eigen::LLT<Eigen::Matrix<double, kMixedColumns, kMixedColumns>> llt(inner);
    if (llt.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
    const MixedWeights moment = scale.cwiseProduct(total.moment);
    const double squares = total.square - moment.dot(llt.solve(moment));
    return 0.5 * squares + 0.5 * total.log_determinant + llt.matrixLLT().diagonal().array().log().sum() +
           0.5 * (p - prior_mean_).cwiseQuotient(prior_sd_).squaredNorm();
}

double MixedModel::objective(const MixedParameters &log_parameters) const {
    return value(log_parameters, whitened(log_parameters, Kept::Constant(means_.y.size(), true)));
}

void MixedModel::optimise() {
    const Kept all = Kept::Constant(means_.y.size(), true);
    struct Search {
        const MixedModel *model;
        const Kept *all;
    } search{this, &all};
    const auto call = [](unsigned, const double *x, double *gradient, void *data) -> double {
        const auto &s = *static_cast<Search *>(data);
        const MixedParameters at = Eigen::Map<const MixedParameters>(x);
        const auto parts = s.model->whitened(at, *s.all);
        const double v = s.model->value(at, parts);
        for (int k = 0; gradient && k < kMixedParameters; ++k) {
            double ends[2] = {0.0, 0.0};
            for (int side = 0; side < 2; ++side) {
                MixedParameters moved = at;
                moved[k] += side ? kStep : -kStep;
                ends[side] = s.model->value(moved, k < kNoise ? parts : s.model->whitened(moved, *s.all));
            }
            gradient[k] = (ends[1] - ends[0]) / (2.0 * kStep);
            if (!std::isfinite(gradient[k])) gradient[k] = 0.0;
        }
        return std::isfinite(v) ? v : std::numeric_limits<double>::max();
    };
    const std::unique_ptr<nlopt_opt_s, decltype(&nlopt_destroy)> opt(nlopt_create(NLOPT_LD_LBFGS, kMixedParameters),
                                                                     nlopt_destroy);
    if (!opt) throw std::bad_alloc();
    const MixedParameters low = prior_mean_ - kReach * prior_sd_, high = prior_mean_ + kReach * prior_sd_;
    nlopt_set_min_objective(opt.get(), call, &search);
    nlopt_set_lower_bounds(opt.get(), low.data());
    nlopt_set_upper_bounds(opt.get(), high.data());
    nlopt_set_ftol_abs(opt.get(), 1e-3);  // of a log posterior: what no choice can depend on
    nlopt_set_maxeval(opt.get(), 60);
    double best = std::numeric_limits<double>::infinity();
    for (const bool little : {false, true}) {
        MixedParameters x = prior_mean_;
        if (little) {
            x.head<kMixedParts>().array() -= kLittleMap;
            x.segment<kNoise + 1 - kScatter>(kScatter).array() += kMoreScatter;
        }
        double v = 0.0;
        nlopt_optimize(opt.get(), x.data(), &v);  // whatever it says, x is the best point that it saw
        if (v < best) {
            best = v;
            log_parameters_ = x;
        }
    }
}

MixedWeights MixedModel::weights(const Kept &kept) const {
    if (kept.size() != means_.y.size()) throw std::invalid_argument("mixed: one flag for each mean");
    const Sums total = sums(log_parameters_, whitened(log_parameters_, kept));
    const MixedWeights scale = scale_of(log_parameters_, 0, kConstantSd);
    MatrixXd inner = scale.asDiagonal() * total.gram * scale.asDiagonal();
    inner.diagonal().array() += 1.0;
    const Eigen::LLT<MatrixXd> llt(inner);
    if (llt.info() != Eigen::Success) throw std::runtime_error("mixed: the posterior is not positive definite");
    return scale.cwiseProduct(llt.solve(scale.cwiseProduct(total.moment)));
}

}  // namespace gyrotc
