#include "waves.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

namespace gyrotc {
namespace {

using Eigen::ArrayXd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kPi = 3.14159265358979323846;  // C++ has it from C++20 on
constexpr int kLanes = 8;                       // points at once: what is kept of them stays in registers and L1
constexpr Eigen::Index kRows = 256;             // points at once in sums: 0.3 MB of waves
constexpr double kLost = 1e7;                   // rounding errors in a value that still has nine digits
using Lane = Eigen::Array<double, kLanes, 1>;

double step_of(double reach) { return kPi / (2.0 * reach); }

// sin(j a), j = 1 ... n, and cos(m a), m = 0 ... n - 1, by recurrence.
template <typename Values, typename Put> void sines(const Values &angle, int n, const Put &put) {
    const Values twice_cos = 2.0 * angle.cos();
    Values before = Values::Zero(angle.size()), now = angle.sin();
    for (int j = 0; j < n; ++j) {
        put(j) = now;
        const Values next = twice_cos * now - before;
        before = now;
        now = next;
    }
}

template <typename Values, typename Put> void cosines(const Values &angle, int n, const Put &put) {
    Values before = angle.cos(), now = Values::Ones(angle.size());
    const Values twice_cos = 2.0 * before;
    for (int m = 0; m < n; ++m) {
        put(m) = now;
        const Values next = twice_cos * now - before;
        before = now;
        now = next;
    }
}

MatrixXd sine_columns(const ArrayXd &angle, int n) {
    MatrixXd s(angle.size(), n);
    sines(angle, n, [&](int j) { return s.col(j).array(); });
    return s;
}

MatrixXd cosine_columns(const ArrayXd &angle, int n) {
    MatrixXd c(angle.size(), n);
    cosines(angle, n, [&](int m) { return c.col(m).array(); });
    return c;
}

// Points from `at` on, the last one again where there are fewer.
Lane lane_of(const VectorXd &x, Eigen::Index at) {
    Lane lane;
    for (int k = 0; k < kLanes; ++k) lane[k] = x[std::min(at + k, x.size() - 1)];
    return lane;
}

// What `value` makes of every lane.
template <typename Value> VectorXd by_lanes(const VectorXd &t, const VectorXd &r, const Value &value) {
    VectorXd found(t.size());
    for (Eigen::Index at = 0; at < t.size(); at += kLanes) {
        const Lane lane = value(lane_of(t, at), lane_of(r, at));
        const Eigen::Index n = std::min<Eigen::Index>(kLanes, t.size() - at);
        found.segment(at, n) = lane.head(n).matrix();
    }
    return found;
}

}  // namespace

MatrixXd basis_of(const Domain &domain, const VectorXd &t, const VectorXd &r) {
    const MatrixXd of_t = sine_columns(step_of(domain.t) * (t.array() + domain.t), kOfT) / std::sqrt(domain.t);
    const MatrixXd of_r = sine_columns(step_of(domain.r) * (r.array() + domain.r), kCoupledR) / std::sqrt(domain.r);
    MatrixXd phi(t.size(), kBasis);
    phi.col(0).setOnes();
    phi.middleCols(1, kOfT) = of_t;
    for (int i = 0; i < kCoupledT; ++i)
        for (int l = 0; l < kCoupledR; ++l) phi.col(coupled(i, l)) = of_t.col(i).cwiseProduct(of_r.col(l));
    return phi;
}

Sums sums_over(const Domain &domain, const VectorXd &t, const VectorXd &r, const VectorXd &weight,
               const VectorXd &y) {
    constexpr int kAllCos = 2 * kOfT + 1, kMixedCos = kOfT + kCoupledT + 1;
    constexpr int kCosT = 2 * kCoupledT + 1, kCosR = 2 * kCoupledR + 1;
    double weights = 0.0, total = 0.0;
    VectorXd of_cos = VectorXd::Zero(kAllCos), of_sin = VectorXd::Zero(kOfT), y_sin = VectorXd::Zero(kOfT);
    MatrixXd sin_sin = MatrixXd::Zero(kCoupledT, kCoupledR), y_sin_sin = sin_sin;
    MatrixXd cos_sin = MatrixXd::Zero(kMixedCos, kCoupledR), cos_cos = MatrixXd::Zero(kCosT, kCosR);
    for (Eigen::Index at = 0, n; at < t.size(); at += n) {
        n = std::min(kRows, t.size() - at);
        const ArrayXd angle_t = step_of(domain.t) * (t.segment(at, n).array() + domain.t);
        const ArrayXd angle_r = step_of(domain.r) * (r.segment(at, n).array() + domain.r);
        const MatrixXd sin_t = sine_columns(angle_t, kOfT), cos_t = cosine_columns(angle_t, kAllCos);
        const VectorXd w = weight.segment(at, n), wy = w.cwiseProduct(y.segment(at, n));
        const MatrixXd sin_r = sine_columns(angle_r, kCoupledR);
        const MatrixXd w_sin_r = w.asDiagonal() * sin_r, wy_sin_r = wy.asDiagonal() * sin_r;
        const MatrixXd w_cos_r = w.asDiagonal() * cosine_columns(angle_r, kCosR);
        weights += w.sum();
        total += wy.sum();
        of_cos.noalias() += cos_t.transpose() * w;
        of_sin.noalias() += sin_t.transpose() * w;
        y_sin.noalias() += sin_t.transpose() * wy;
        sin_sin.noalias() += sin_t.leftCols(kCoupledT).transpose() * w_sin_r;
        y_sin_sin.noalias() += sin_t.leftCols(kCoupledT).transpose() * wy_sin_r;
        cos_sin.noalias() += cos_t.leftCols(kMixedCos).transpose() * w_sin_r;
        cos_cos.noalias() += cos_t.leftCols(kCosT).transpose() * w_cos_r;
    }
    const double root_t = 1.0 / std::sqrt(domain.t), root_r = 1.0 / std::sqrt(domain.r);
    Sums sums{MatrixXd(kBasis, kBasis), VectorXd(kBasis)};
    MatrixXd &products = sums.products;
    products(0, 0) = weights;
    sums.moments[0] = total;
    for (int j = 0; j < kOfT; ++j) {  // the j-th function is the sine of j + 1 angles
        products(1 + j, 0) = root_t * of_sin[j];
        sums.moments[1 + j] = root_t * y_sin[j];
        for (int k = 0; k <= j; ++k)
            products(1 + j, 1 + k) = 0.5 * root_t * root_t * (of_cos[j - k] - of_cos[j + k + 2]);
    }
    for (int i = 0; i < kCoupledT; ++i)
        for (int l = 0; l < kCoupledR; ++l) {
            const int row = coupled(i, l);
            products(row, 0) = root_t * root_r * sin_sin(i, l);
            sums.moments[row] = root_t * root_r * y_sin_sin(i, l);
            for (int j = 0; j < kOfT; ++j)
                products(row, 1 + j) =
                    0.5 * root_t * root_t * root_r * (cos_sin(std::abs(i - j), l) - cos_sin(i + j + 2, l));
            for (int column = coupled(0, 0); column <= row; ++column) {
                const int k = (column - 1 - kOfT) / kCoupledR, m = (column - 1 - kOfT) % kCoupledR;
                const int less_t = std::abs(i - k), less_r = std::abs(l - m), more_t = i + k + 2, more_r = l + m + 2;
                products(row, column) = 0.25 * root_t * root_t * root_r * root_r *
                                        (cos_cos(less_t, less_r) - cos_cos(less_t, more_r) -
                                         cos_cos(more_t, less_r) + cos_cos(more_t, more_r));
            }
        }
    products.triangularView<Eigen::StrictlyUpper>() = products.transpose();
    return sums;
}

VectorXd linear_form(const Domain &domain, const VectorXd &c, const VectorXd &t, const VectorXd &r) {
    const double root_t = 1.0 / std::sqrt(domain.t), root_r = 1.0 / std::sqrt(domain.r);
    const VectorXd of_t = root_t * c.segment(1, kOfT);
    const MatrixXd both =
        root_t * root_r * Eigen::Map<const MatrixXd>(c.data() + coupled(0, 0), kCoupledR, kCoupledT);
    return by_lanes(t, r, [&](const Lane &at_t, const Lane &at_r) {
        Lane sin_t[kOfT], sin_r[kCoupledR];
        sines<Lane>(step_of(domain.t) * (at_t + domain.t), kOfT, [&](int j) -> Lane & { return sin_t[j]; });
        sines<Lane>(step_of(domain.r) * (at_r + domain.r), kCoupledR, [&](int l) -> Lane & { return sin_r[l]; });
        Lane value = Lane::Constant(c[0]);
        for (int j = 0; j < kOfT; ++j) value += of_t[j] * sin_t[j];
        for (int i = 0; i < kCoupledT; ++i) {
            Lane factor = Lane::Zero();
            for (int l = 0; l < kCoupledR; ++l) factor += both(l, i) * sin_r[l];
            value += factor * sin_t[i];
        }
        return value;
    });
}

QuadraticForm::QuadraticForm(const Domain &domain, const MatrixXd &lower)
    : domain_(domain), of_cos_(VectorXd::Zero(kOfCos)), of_sin_(VectorXd::Zero(kOfT)),
      sin_sin_(MatrixXd::Zero(kCoupledT, kCoupledR)), cos_sin_(MatrixXd::Zero(kMixedCos, kCoupledR)),
      cos_cos_(MatrixXd::Zero(kCoupledCosT, kCoupledCosR)) {
    add_of_t(lower);
    add_mixed(lower);
    add_coupled(lower);
    const double size = of_cos_.lpNorm<1>() + of_sin_.lpNorm<1>() + sin_sin_.lpNorm<1>() + cos_sin_.lpNorm<1>() +
                        cos_cos_.lpNorm<1>();
    least_ = kLost * std::numeric_limits<double>::epsilon() * size;
}

void QuadraticForm::add_of_t(const MatrixXd &lower) {
    const double root_t = 1.0 / std::sqrt(domain_.t);
    of_cos_[0] += lower(0, 0);
    for (int j = 0; j < kOfT; ++j) {
        of_sin_[j] += 2.0 * root_t * lower(1 + j, 0);
        for (int k = 0; k <= j; ++k) {
            const double amplitude = (j == k ? 0.5 : 1.0) * root_t * root_t * lower(1 + j, 1 + k);
            of_cos_[j - k] += amplitude;
            of_cos_[j + k + 2] -= amplitude;
        }
    }
}

void QuadraticForm::add_mixed(const MatrixXd &lower) {
    const double root_t = 1.0 / std::sqrt(domain_.t), root_r = 1.0 / std::sqrt(domain_.r);
    for (int i = 0; i < kCoupledT; ++i)
        for (int l = 0; l < kCoupledR; ++l) {
            sin_sin_(i, l) += 2.0 * root_t * root_r * lower(coupled(i, l), 0);
            for (int j = 0; j < kOfT; ++j) {
                const double amplitude = root_t * root_t * root_r * lower(coupled(i, l), 1 + j);
                cos_sin_(std::abs(i - j), l) += amplitude;
                cos_sin_(i + j + 2, l) -= amplitude;
            }
        }
}

void QuadraticForm::add_coupled(const MatrixXd &lower) {
    for (int row = coupled(0, 0); row < kBasis; ++row)
        for (int column = coupled(0, 0); column <= row; ++column) {
            const int i = (row - 1 - kOfT) / kCoupledR, l = (row - 1 - kOfT) % kCoupledR;
            const int k = (column - 1 - kOfT) / kCoupledR, m = (column - 1 - kOfT) % kCoupledR;
            const double amplitude = (row == column ? 0.25 : 0.5) / (domain_.t * domain_.r) * lower(row, column);
            cos_cos_(std::abs(i - k), std::abs(l - m)) += amplitude;
            cos_cos_(std::abs(i - k), l + m + 2) -= amplitude;
            cos_cos_(i + k + 2, std::abs(l - m)) -= amplitude;
            cos_cos_(i + k + 2, l + m + 2) += amplitude;
        }
}

VectorXd QuadraticForm::at(const VectorXd &t, const VectorXd &r) const {
    return by_lanes(t, r, [&](const Lane &at_t, const Lane &at_r) {
        const Lane angle_t = step_of(domain_.t) * (at_t + domain_.t);
        const Lane angle_r = step_of(domain_.r) * (at_r + domain_.r);
        Lane sin_t[kOfT], cos_t[kOfCos], sin_r[kCoupledR], cos_r[kCoupledCosR];
        sines(angle_t, kOfT, [&](int j) -> Lane & { return sin_t[j]; });
        cosines(angle_t, kOfCos, [&](int m) -> Lane & { return cos_t[m]; });
        sines(angle_r, kCoupledR, [&](int l) -> Lane & { return sin_r[l]; });
        cosines(angle_r, kCoupledCosR, [&](int n) -> Lane & { return cos_r[n]; });
        Lane value = Lane::Zero();
        for (int m = 0; m < kOfCos; ++m) value += of_cos_[m] * cos_t[m];
        for (int j = 0; j < kOfT; ++j) value += of_sin_[j] * sin_t[j];
        for (int l = 0; l < kCoupledR; ++l) {
            Lane factor = Lane::Zero();
            for (int i = 0; i < kCoupledT; ++i) factor += sin_sin_(i, l) * sin_t[i];
            for (int m = 0; m < kMixedCos; ++m) factor += cos_sin_(m, l) * cos_t[m];
            value += factor * sin_r[l];
        }
        for (int n = 0; n < kCoupledCosR; ++n) {
            Lane factor = Lane::Zero();
            for (int m = 0; m < kCoupledCosT; ++m) factor += cos_cos_(m, n) * cos_t[m];
            value += factor * cos_r[n];
        }
        return value;
    });
}

}  // namespace gyrotc
