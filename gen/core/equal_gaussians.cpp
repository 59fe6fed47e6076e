#include "equal_gaussians.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <vector>

// Sums are elementwise over samples in order, so wider vectors give the same bits.
#if defined(__x86_64__) && defined(__linux__) && defined(__GNUC__) && !defined(__clang__)
#define GYROTC_WIDER_VECTORS __attribute__((target_clones("avx2", "default")))
#else
#define GYROTC_WIDER_VECTORS
#endif

namespace gyrotc {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr Index kBlock = 256;        // samples of one matrix product
constexpr Index kPoints = 20;        // of the interpolation
constexpr double kNodesPerWidth = 12.0;  // of the fine grid: with 20 points the interpolation errs by 1e-13
constexpr double kNegligible = 80.0;  // exp(-80) of a Gaussian's height is taken as 0

// Sums of one tile stay in the registers of a processor with 16 or more of them.
constexpr Index kTileRows = 4, kTileColumns = 8;

// s += a' b for one tile; a: n x lda, b: n x ldb, s: lds to a row, all by rows.
GYROTC_WIDER_VECTORS
void add_tile(const double *a, Index lda, const double *b, Index ldb, Index n, double *s, Index lds) {
    double sum[kTileRows][kTileColumns] = {};
    for (Index i = 0; i < n; ++i, a += lda, b += ldb)
        for (Index p = 0; p < kTileRows; ++p)
            for (Index q = 0; q < kTileColumns; ++q) sum[p][q] += a[p] * b[q];
    for (Index p = 0; p < kTileRows; ++p)
        for (Index q = 0; q < kTileColumns; ++q) s[p * lds + q] += sum[p][q];
}

Index padded(Index n, Index tile) { return (n + tile - 1) / tile * tile; }

// s += a' b; columns of a and b are padded to whole tiles, s has those sizes.
void add_product(const RowMatrix &a, const RowMatrix &b, Index n, RowMatrix &s) {
    for (Index p = 0; p < s.rows(); p += kTileRows)
        for (Index q = 0; q < s.cols(); q += kTileColumns)
            add_tile(a.data() + p, a.cols(), b.data() + q, b.cols(), n, s.data() + p * s.cols() + q, s.cols());
}

// Values exp(-beta (x - node)^2) of a block of samples at the nodes of an axis, from three exponentials a sample:
// with k the nearest node and f the distance from it in steps, exp(-b (f - j)^2) = exp(-b f^2) u^j c^(j^2).
class AxisKernel {
  public:
    AxisKernel(const Axis &axis, double beta) : axis_(axis), beta_(beta * axis.step * axis.step) {
        const double reach = 0.5 + std::sqrt(0.25 + kNegligible / beta_);
        const Index n = std::min<Index>(axis.count, static_cast<Index>(std::min(reach, 1e9)) + 1);
        squares_.resize(static_cast<std::size_t>(n) + 1);
        for (std::size_t j = 0; j < squares_.size(); ++j)
            squares_[j] = std::exp(-beta_ * static_cast<double>(j) * static_cast<double>(j));
    }

    void fill(double x, double scale, double *row) const {
        const double a = (x - axis_.first) / axis_.step;
        const double nearest = std::min(std::max(std::round(a), 0.0), static_cast<double>(axis_.count - 1));
        const Index k = static_cast<Index>(nearest);
        const double f = a - nearest;
        if (std::abs(f) > 2.0) return fill_far(a, scale, row);
        const double base = scale * std::exp(-beta_ * f * f);
        const double up = std::exp(2.0 * beta_ * f), down = 1.0 / up;
        const Index n = static_cast<Index>(squares_.size());
        double power = base;
        for (Index j = 0; j < n && k + j < axis_.count; ++j, power *= up) row[k + j] = power * squares_[index(j)];
        power = base * down;
        for (Index j = 1; j < n && k - j >= 0; ++j, power *= down) row[k - j] = power * squares_[index(j)];
    }

  private:
    static std::size_t index(Index j) { return static_cast<std::size_t>(j); }

    // Samples far outside the axis: plainly.
    void fill_far(double a, double scale, double *row) const {
        for (Index k = 0; k < axis_.count; ++k) {
            const double d = a - static_cast<double>(k);
            row[k] = scale * std::exp(-beta_ * d * d);
        }
    }

    Axis axis_;
    double beta_;
    std::vector<double> squares_;
};

RowMatrix table(const Axis &t, const Axis &r) {
    return RowMatrix::Zero(padded(t.count, kTileRows), padded(r.count, kTileColumns));
}

// Weights of Lagrange's interpolation between kPoints equidistant nodes; at = position in steps from the first.
std::array<double, kPoints> lagrange(double at) {
    static const std::array<double, kPoints> barycentric = [] {
        std::array<double, kPoints> w{};
        w[0] = 1.0;
        for (Index k = 1; k < kPoints; ++k)
            w[static_cast<std::size_t>(k)] =
                -w[static_cast<std::size_t>(k - 1)] * static_cast<double>(kPoints - k) / static_cast<double>(k);
        return w;
    }();
    std::array<double, kPoints> w{};
    double sum = 0.0;
    for (std::size_t k = 0; k < w.size(); ++k) {
        const double d = at - static_cast<double>(k);
        if (d == 0.0) {
            w.fill(0.0);
            w[k] = 1.0;
            return w;
        }
        w[k] = barycentric[k] / d;
        sum += w[k];
    }
    for (double &x : w) x /= sum;
    return w;
}

Axis fine_axis(const VectorXd &x, double width) {
    const double step = width / kNodesPerWidth;
    const double low = x.minCoeff() - step * static_cast<double>(kPoints / 2);
    const double span = x.maxCoeff() - low + step * static_cast<double>(kPoints / 2);
    return {low, step, static_cast<Index>(std::ceil(span / step)) + 1};
}

}  // namespace

EqualGaussians EqualGaussians::on_grid(const Axis &t, const Axis &r, double width_t, double width_r) {
    EqualGaussians d(width_t, width_r);
    d.grid_ = true;
    d.t_ = t;
    d.r_ = r;
    d.mid_t_ = {t.first, 0.5 * t.step, 2 * t.count - 1};
    d.mid_r_ = {r.first, 0.5 * r.step, 2 * r.count - 1};
    d.centers_.resize(t.count * r.count, 2);
    for (Index i = 0; i < t.count; ++i)
        for (Index j = 0; j < r.count; ++j) d.centers_.row(i * r.count + j) << t.at(i), r.at(j);
    d.pairs_ = table(d.mid_t_, d.mid_r_);
    d.ones_ = d.targets_ = table(d.t_, d.r_);
    return d;
}

EqualGaussians EqualGaussians::at(const Eigen::MatrixXd &centers, double width_t, double width_r) {
    if (centers.rows() == 0 || centers.cols() != 2) throw std::invalid_argument("candidates: n x 2, n >= 1");
    EqualGaussians d(width_t, width_r);
    d.centers_ = centers;
    d.t_ = d.mid_t_ = fine_axis(centers.col(0), width_t);
    d.r_ = d.mid_r_ = fine_axis(centers.col(1), width_r);
    d.pairs_ = d.ones_ = d.targets_ = table(d.t_, d.r_);
    return d;
}

void EqualGaussians::add(const Samples &samples) {
    const double b_t = 1.0 / (width_t_ * width_t_), b_r = 1.0 / (width_r_ * width_r_);
    const AxisKernel pair_t(mid_t_, 2.0 * b_t), pair_r(mid_r_, 2.0 * b_r), one_t(t_, b_t), one_r(r_, b_r);
    RowMatrix a(kBlock, pairs_.rows()), b(kBlock, pairs_.cols());
    RowMatrix c(kBlock, ones_.rows()), e(kBlock, ones_.cols()), f(kBlock, ones_.cols());
    for (Index first = 0; first < samples.t.size(); first += kBlock) {
        const Index n = std::min(kBlock, samples.t.size() - first);
        for (RowMatrix *m : {&a, &b, &c, &e}) m->setZero();
        for (Index i = 0; i < n; ++i) {
            const double w = samples.weight[first + i], t = samples.t[first + i], r = samples.r[first + i];
            pair_t.fill(t, w, a.row(i).data());
            pair_r.fill(r, 1.0, b.row(i).data());
            one_t.fill(t, w, c.row(i).data());
            one_r.fill(r, 1.0, e.row(i).data());
            f.row(i) = samples.y[first + i] * e.row(i);
        }
        add_product(a, b, n, pairs_);
        add_product(c, e, n, ones_);
        add_product(c, f, n, targets_);
    }
    samples_ += static_cast<double>(samples.t.size());
    total_ += samples.weight.sum();
    total_y_ += samples.weight.dot(samples.y);
    energy_ += samples.weight.dot(samples.y.cwiseAbs2());
}

double EqualGaussians::interpolate(const RowMatrix &values, const Axis &t, const Axis &r, double at_t,
                                   double at_r) const {
    const double a = (at_t - t.first) / t.step, b = (at_r - r.first) / r.step;
    const auto start = [](double x, Index count) {
        const Index k = static_cast<Index>(std::floor(x)) - (kPoints / 2 - 1);
        return std::min(std::max<Index>(k, 0), count - kPoints);
    };
    const Index i = start(a, t.count), j = start(b, r.count);
    const auto u = lagrange(a - static_cast<double>(i)), v = lagrange(b - static_cast<double>(j));
    const Eigen::Map<const Eigen::Matrix<double, kPoints, 1>> up(u.data()), vp(v.data());
    return up.dot(values.block<kPoints, kPoints>(i, j) * vp);
}

double EqualGaussians::pair_sum(Index i, Index j) const {
    if (grid_) return pairs_(i / r_.count + j / r_.count, i % r_.count + j % r_.count);
    const Eigen::RowVector2d m = 0.5 * (centers_.row(i) + centers_.row(j));
    return interpolate(pairs_, mid_t_, mid_r_, m[0], m[1]);
}

VectorXd EqualGaussians::at_centers(const RowMatrix &values) const {
    VectorXd v(centers_.rows());
    for (Index j = 0; j < v.size(); ++j)
        v[j] = grid_ ? values(j / r_.count, j % r_.count)
                     : interpolate(values, t_, r_, centers_(j, 0), centers_(j, 1));
    return v;
}

VectorXd EqualGaussians::norms() const {
    VectorXd v(size());
    v[0] = total_;
    for (Index j = 0; j < centers_.rows(); ++j) v[j + 1] = pair_sum(j, j);
    return v;
}

VectorXd EqualGaussians::moments() const {
    VectorXd v(size());
    v << total_y_, at_centers(targets_);
    return v;
}

VectorXd EqualGaussians::column(Index k) const {
    VectorXd v(size());
    if (k == 0) {
        v << total_, at_centers(ones_);
        return v;
    }
    const Index j = k - 1;
    v[0] = grid_ ? ones_(j / r_.count, j % r_.count) : interpolate(ones_, t_, r_, centers_(j, 0), centers_(j, 1));
    for (Index i = 0; i < centers_.rows(); ++i) {
        const double d = (centers_(i, 0) - centers_(j, 0)) / width_t_, e = (centers_(i, 1) - centers_(j, 1)) / width_r_;
        v[i + 1] = std::exp(-0.5 * (d * d + e * e)) * pair_sum(i, j);
    }
    return v;
}

}  // namespace gyrotc
