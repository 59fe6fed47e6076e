#include "varpro.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <utility>

namespace gyrotc {
namespace {

using Eigen::ArrayXd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Walls of c, d, log s, log q: beyond them the objective grows quadratically.
const double kLow[kNonlinear] = {-1.2, -1.2, std::log(0.03), std::log(0.05)};
const double kHigh[kNonlinear] = {1.2, 1.2, std::log(4.0), std::log(4.0)};
constexpr double kWall = 0.02;  // stiffness of a wall, in units of the cloud's weighted square sum

// The ladder of widths that candidates offer.
constexpr double kWidthsT[] = {0.05, 0.1, 0.2, 0.4, 0.8, 1.6};
constexpr double kWidthsR[] = {0.1, 0.25, 0.6, 1.2, 3.0};

constexpr int kMaxRefineSteps = 40;  // bounds the time; the tolerance ends a refinement before
constexpr double kRelativeTolerance = 0.01;  // a step that gains less of the objective ends the refinement
constexpr int kExactGains = 200;  // of so many candidates the gain is computed exactly
constexpr int kExactDeletions = 4;  // of so many, the cheapest, the loss is computed exactly: two are tried

double beyond(double x, int k) { return x < kLow[k] ? x - kLow[k] : x > kHigh[k] ? x - kHigh[k] : 0.0; }

// Positive definite by construction (ridge); the jitter only meets rounding.
Eigen::LLT<MatrixXd> factorise(MatrixXd a) {
    Eigen::LLT<MatrixXd> llt(a);
    for (double jitter = 1e-14; llt.info() != Eigen::Success && jitter < 1.0; jitter *= 100.0) {
        MatrixXd b = a;
        b.diagonal() *= 1.0 + jitter;
        llt.compute(b);
    }
    return llt;
}

// Columns x of the cloud with the ridge on the Gaussians' weights: normal matrix.
MatrixXd normal_matrix(const MatrixXd &x, double ridge) {
    MatrixXd a = MatrixXd::Zero(x.cols(), x.cols());
    a.selfadjointView<Eigen::Lower>().rankUpdate(x.transpose());
    a.triangularView<Eigen::StrictlyUpper>() = a.transpose();
    const double floor = 1e-13 * a.diagonal().maxCoeff();
    a.diagonal().array() += floor;
    a.diagonal().tail(x.cols() - kLinear).array() += ridge;
    return a;
}

bool distant(const Shapes &candidates, Eigen::Index a, Eigen::Index b) {
    const Eigen::Matrix<double, kNonlinear, 1> d = candidates.col(a) - candidates.col(b);
    const double s = std::exp(std::min(candidates(2, a), candidates(2, b)));
    const double q = std::exp(std::min(candidates(3, a), candidates(3, b)));
    const bool apart = std::hypot(d[0] / s, d[1] / q) > 1.0;
    return apart || std::abs(d[2]) > 1.2 || std::abs(d[3]) > 1.2;
}

Shapes with(const Shapes &shapes, const Eigen::Matrix<double, kNonlinear, 1> &one) {
    Shapes more(kNonlinear, shapes.cols() + 1);
    more << shapes, one;
    return more;
}

Shapes without(const Shapes &shapes, Eigen::Index j) {
    Shapes fewer(kNonlinear, shapes.cols() - 1);
    fewer << shapes.leftCols(j), shapes.rightCols(shapes.cols() - j - 1);
    return fewer;
}

// Every center with every pair of widths.
Shapes dictionary(const MatrixXd &centers) {
    constexpr Eigen::Index widths = std::size(kWidthsT) * std::size(kWidthsR);
    Shapes all(kNonlinear, centers.rows() * widths);
    Eigen::Index k = 0;
    for (Eigen::Index i = 0; i < centers.rows(); ++i)
        for (const double s : kWidthsT)
            for (const double q : kWidthsR) all.col(k++) << centers(i, 0), centers(i, 1), std::log(s), std::log(q);
    return all;
}

}  // namespace

VariableProjection::VariableProjection(const Cloud &cloud, double ridge)
    : t_(cloud.t), r_(cloud.r), root_(cloud.weight.cwiseSqrt()), target_(root_.cwiseProduct(cloud.target)),
      ridge_(ridge) {
    if (t_.size() == 0) throw std::invalid_argument("variable projection: no points");
    wall_ = kWall * std::max(target_.squaredNorm(), std::numeric_limits<double>::min());
}

// Gaussians times sqrt(weight), one column each.
MatrixXd VariableProjection::gaussians(const Shapes &shapes) const {
    MatrixXd g(t_.size(), shapes.cols());
    for (Eigen::Index j = 0; j < shapes.cols(); ++j) {
        const double s = std::exp(-shapes(2, j)), q = std::exp(-shapes(3, j));
        g.col(j) = root_.array() *
                   (-((t_.array() - shapes(0, j)) * s).square() - ((r_.array() - shapes(1, j)) * q).square()).exp();
    }
    return g;
}

// The Gaussians of `dictionary`, as `gaussians` has them but for rounding: each is a product of functions of one input,
// of which a center has eleven for its thirty Gaussians.
MatrixXd VariableProjection::dictionary_columns(const MatrixXd &centers) const {
    constexpr Eigen::Index of_t = std::size(kWidthsT), of_r = std::size(kWidthsR);
    MatrixXd g(t_.size(), centers.rows() * of_t * of_r), in_r(t_.size(), of_r);
    Eigen::Index k = 0;
    for (Eigen::Index i = 0; i < centers.rows(); ++i) {
        for (Eigen::Index j = 0; j < of_r; ++j)
            in_r.col(j) = (-((r_.array() - centers(i, 1)) / kWidthsR[j]).square()).exp();
        for (const double width : kWidthsT) {
            const ArrayXd in_t = root_.array() * (-((t_.array() - centers(i, 0)) / width).square()).exp();
            for (Eigen::Index j = 0; j < of_r; ++j) g.col(k++) = in_t * in_r.col(j).array();
        }
    }
    return g;
}

MatrixXd VariableProjection::columns(const Shapes &shapes) const {
    MatrixXd x(t_.size(), kLinear + shapes.cols());
    x.col(0) = root_;
    x.col(1) = root_.cwiseProduct(t_);
    x.col(2) = root_.cwiseProduct(r_);
    x.rightCols(shapes.cols()) = gaussians(shapes);
    return x;
}

double VariableProjection::walls(const Shapes &shapes) const {
    double sum = 0.0;
    for (Eigen::Index j = 0; j < shapes.cols(); ++j)
        for (int k = 0; k < kNonlinear; ++k) sum += wall_ * std::pow(beyond(shapes(k, j), k), 2);
    return sum;
}

VariableProjection::Projection VariableProjection::projection(const Shapes &shapes) const {
    Projection p;
    p.columns = columns(shapes);
    p.factor = factorise(normal_matrix(p.columns, ridge_));
    Network &n = p.network;
    n.shapes = shapes;
    n.weights = p.factor.solve(p.columns.transpose() * target_);
    n.misfit = (target_ - p.columns * n.weights).squaredNorm();
    n.cost = n.misfit + ridge_ * n.weights.tail(shapes.cols()).squaredNorm();
    n.cost += walls(shapes);
    if (!std::isfinite(n.cost)) n.cost = std::numeric_limits<double>::infinity();
    return p;
}

Network VariableProjection::project(const Shapes &shapes) const { return projection(shapes).network; }

namespace {

// Derivatives of the network's columns by its nonlinear parameters, times the weights: points x 4 M.
MatrixXd derivatives(const VectorXd &t, const VectorXd &r, const MatrixXd &columns, const Network &n) {
    const Eigen::Index m = n.shapes.cols();
    MatrixXd d(t.size(), kNonlinear * m);
    for (Eigen::Index j = 0; j < m; ++j) {
        const double s = std::exp(-n.shapes(2, j)), q = std::exp(-n.shapes(3, j));
        const ArrayXd a = (t.array() - n.shapes(0, j)) * s, b = (r.array() - n.shapes(1, j)) * q;
        const ArrayXd g = 2.0 * n.weights[kLinear + j] * columns.col(kLinear + j).array();
        d.col(kNonlinear * j) = g * a * s;
        d.col(kNonlinear * j + 1) = g * b * q;
        d.col(kNonlinear * j + 2) = g * a.square();
        d.col(kNonlinear * j + 3) = g * b.square();
    }
    return d;
}

}  // namespace

Shapes VariableProjection::gradient(const Network &network) const {
    const MatrixXd x = columns(network.shapes);
    const VectorXd residual = target_ - x * network.weights;
    const VectorXd g = -2.0 * derivatives(t_, r_, x, network).transpose() * residual;
    Shapes out = Eigen::Map<const Shapes>(g.data(), kNonlinear, network.shapes.cols());
    for (Eigen::Index j = 0; j < out.cols(); ++j)
        for (int k = 0; k < kNonlinear; ++k) out(k, j) += 2.0 * wall_ * beyond(network.shapes(k, j), k);
    return out;
}

Network VariableProjection::refine(const Network &start, double tolerance, int max_steps) const {
    return start.shapes.cols() ? refined(projection(start.shapes), tolerance, max_steps) : start;
}

Network VariableProjection::refined(Projection at, double tolerance, int max_steps) const {
    const Eigen::Index m = at.network.shapes.cols();
    double damping = 1e-3;
    for (int step = 0; step < max_steps; ++step) {
        const MatrixXd &x = at.columns;
        const Network &best = at.network;
        const MatrixXd d = derivatives(t_, r_, x, best);
        const VectorXd residual = target_ - x * best.weights;
        const MatrixXd cross = x.transpose() * d;
        VectorXd down = d.transpose() * residual;
        MatrixXd h = MatrixXd::Zero(d.cols(), d.cols());
        h.selfadjointView<Eigen::Lower>().rankUpdate(d.transpose());
        const MatrixXd projected = at.factor.matrixL().solve(cross);
        h.selfadjointView<Eigen::Lower>().rankUpdate(projected.transpose(), -1.0);
        for (Eigen::Index i = 0; i < h.rows(); ++i) {
            const double b = beyond(best.shapes(i % kNonlinear, i / kNonlinear), static_cast<int>(i % kNonlinear));
            down[i] -= wall_ * b;
            if (b != 0.0) h(i, i) += wall_;
        }
        h.triangularView<Eigen::StrictlyUpper>() = h.transpose();
        const VectorXd diagonal = h.diagonal().cwiseMax(1e-12 * h.diagonal().maxCoeff() + 1e-300);
        double gained = 0.0;
        while (damping < 1e8) {
            MatrixXd damped = h;
            damped.diagonal() += damping * diagonal;
            const VectorXd move = factorise(damped).solve(down).cwiseMax(-0.7).cwiseMin(0.7);
            const Shapes shapes = best.shapes + Eigen::Map<const Shapes>(move.data(), kNonlinear, m);
            // Walls are a part of the cost: a trial that runs into them so far needs no projection.
            if (walls(shapes) < best.cost) {
                Projection trial = projection(shapes);
                if (trial.network.cost < best.cost) {
                    gained = best.cost - trial.network.cost;
                    at = std::move(trial);
                    damping = std::max(damping * 0.2, 1e-7);
                    break;
                }
            }
            damping *= 5.0;
        }
        if (gained <= std::max(tolerance, kRelativeTolerance * at.network.cost)) break;
    }
    return at.network;
}

namespace {

// Candidates that promise most without orthogonalisation: only of these the gain is computed.
std::vector<Eigen::Index> promising(const VectorXd &moment, const VectorXd &norms) {
    const VectorXd promise = moment.cwiseAbs2().cwiseQuotient(norms.cwiseMax(1e-300));
    std::vector<Eigen::Index> order(static_cast<std::size_t>(promise.size()));
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return promise[a] > promise[b]; });
    order.resize(std::min<std::size_t>(order.size(), kExactGains));
    return order;
}

// By a candidate's squared norm: what of it must be orthogonal to the chosen columns, or it counts as dependent on them.
constexpr double kDependent = 1e-10;

double gain_of(double moment, double rest, double norm, double ridge) {
    return rest > kDependent * norm ? moment * moment / (rest + ridge) : 0.0;
}

// The candidate with the largest gain, and the best one far from it (-1: there is none).
std::pair<Eigen::Index, Eigen::Index> best_two(const VectorXd &gain, const Shapes &candidates) {
    Eigen::Index first = 0, second = -1;
    gain.maxCoeff(&first);
    for (Eigen::Index j = 0; j < gain.size(); ++j)
        if ((second < 0 || gain[j] > gain[second]) && distant(candidates, first, j)) second = j;
    return {first, second};
}

}  // namespace

// Gain in the objective that one more Gaussian brings at first order (error reduction of orthogonal least squares), 0 for
// those that promise little.
VectorXd VariableProjection::gains(const Network &network, const Dictionary &candidates) const {
    const MatrixXd x = columns(network.shapes);
    const VectorXd moment = candidates.columns.transpose() * (target_ - x * network.weights);
    const std::vector<Eigen::Index> order = promising(moment, candidates.norms);
    const Eigen::LLT<MatrixXd> llt = factorise(normal_matrix(x, ridge_));
    const MatrixXd orthogonal = llt.matrixL().solve(x.transpose() * candidates.columns(Eigen::all, order));
    VectorXd gain = VectorXd::Zero(moment.size());
    for (std::size_t k = 0; k < order.size(); ++k) {
        const Eigen::Index j = order[k];
        const double rest = candidates.norms[j] - orthogonal.col(static_cast<Eigen::Index>(k)).squaredNorm();
        gain[j] = gain_of(moment[j], rest, candidates.norms[j], ridge_);
    }
    return gain;
}

// A network that only grows, none of its shapes being moved: the triangle of its normal equations, and what of every
// candidate is orthogonal to it, go on from one size to the next.
class VariableProjection::Appended {
  public:
    Appended(const VariableProjection &solver, const Network &start, const Dictionary &candidates, int max_size)
        : solver_(solver), candidates_(candidates), size_(kLinear + start.shapes.cols()) {
        const Eigen::Index most = std::max<Eigen::Index>(size_, kLinear + max_size);
        x_.resize(solver.t_.size(), most);
        x_.leftCols(size_) = solver.columns(start.shapes);
        const MatrixXd normal = normal_matrix(x_.leftCols(size_), solver.ridge_);
        floor_ = normal(0, 0) - x_.col(0).squaredNorm();
        lower_ = MatrixXd::Zero(most, most);
        lower_.topLeftCorner(size_, size_) = factorise(normal).matrixL();
        target_.resize(most);
        target_.head(size_) = x_.leftCols(size_).transpose() * solver.target_;
        triangle().solveInPlace(target_.head(size_));
        held_.resize(most, candidates.columns.cols());
        held_.topRows(size_) = x_.leftCols(size_).transpose() * candidates.columns;
        triangle().solveInPlace(held_.topRows(size_));
        rest_ = candidates.norms - held_.topRows(size_).colwise().squaredNorm().transpose();
    }

    // The better of the two trials of `grow`, appended; it is `network` with one Gaussian more.
    Network next(const Network &network) {
        const VectorXd moment =
            candidates_.columns.transpose() * (solver_.target_ - x_.leftCols(size_) * network.weights);
        VectorXd gain = VectorXd::Zero(moment.size());
        for (const Eigen::Index j : promising(moment, candidates_.norms))
            gain[j] = gain_of(moment[j], rest_[j], candidates_.norms[j], solver_.ridge_);
        const auto [first, second] = best_two(gain, candidates_.shapes);
        Eigen::Index taken = first;
        Network best = appended(network, first);
        if (second >= 0) {
            Network other = appended(network, second);
            if (other.cost < best.cost) {
                best = std::move(other);
                taken = second;
            }
        }
        append(taken);
        return best;
    }

  private:
    const VariableProjection &solver_;
    const Dictionary &candidates_;
    Eigen::Index size_;
    double floor_ = 0.0;            // what `normal_matrix` adds to its diagonal
    MatrixXd x_, lower_;            // columns, and the triangle of their normal matrix
    VectorXd target_;               // lower^-1 x' target
    MatrixXd held_;                 // lower^-1 x' candidates
    VectorXd rest_;                 // squared norms of the candidates without that

    Eigen::TriangularView<const Eigen::Block<const MatrixXd>, Eigen::Lower> triangle() const {
        return static_cast<const MatrixXd &>(lower_).topLeftCorner(size_, size_).triangularView<Eigen::Lower>();
    }

    // Column, row of the triangle, and entry of the target that a candidate brings.
    void enter(Eigen::Index j) {
        const Eigen::Index k = size_;
        x_.col(k) = solver_.gaussians(candidates_.shapes.col(j));
        VectorXd row = x_.leftCols(k).transpose() * x_.col(k);
        triangle().solveInPlace(row);
        const double norm = x_.col(k).squaredNorm() + floor_ + solver_.ridge_;
        lower_.row(k).head(k) = row;
        lower_(k, k) = std::sqrt(std::max(norm - row.squaredNorm(), kDependent * norm));
        target_[k] = (x_.col(k).dot(solver_.target_) - row.dot(target_.head(k))) / lower_(k, k);
    }

    Network appended(const Network &network, Eigen::Index j) {
        enter(j);
        ++size_;
        Network more;
        more.shapes = with(network.shapes, candidates_.shapes.col(j));
        more.weights = lower_.topLeftCorner(size_, size_).transpose().triangularView<Eigen::Upper>().solve(target_.head(size_));
        more.misfit = (solver_.target_ - x_.leftCols(size_) * more.weights).squaredNorm();
        more.cost = more.misfit + solver_.ridge_ * more.weights.tail(more.shapes.cols()).squaredNorm() +
                    solver_.walls(more.shapes);
        if (!std::isfinite(more.cost)) more.cost = std::numeric_limits<double>::infinity();
        --size_;
        return more;
    }

    void append(Eigen::Index j) {
        enter(j);
        const Eigen::Index k = size_++;
        Eigen::RowVectorXd held = x_.col(k).transpose() * candidates_.columns;
        held -= lower_.row(k).head(k) * held_.topRows(k);
        held_.row(k) = held / lower_(k, k);
        rest_ -= held_.row(k).cwiseAbs2().transpose();
    }
};

// The better of two trials: the candidate with the largest gain, and the best one far from it.
Network VariableProjection::grow(const Network &network, const Dictionary &candidates, double tolerance) const {
    const auto [first, second] = best_two(gains(network, candidates), candidates.shapes);
    Network best = refined(projection(with(network.shapes, candidates.shapes.col(first))), tolerance, kMaxRefineSteps);
    if (second >= 0) {
        const Shapes shapes = with(network.shapes, candidates.shapes.col(second));
        Network other = refined(projection(shapes), tolerance, kMaxRefineSteps);
        if (other.cost < best.cost) best = std::move(other);
    }
    return best;
}

// What the objective rises by when a Gaussian is deleted and all weights are fitted anew: w^2 over its entry in the
// inverse of the normal matrix.
VectorXd VariableProjection::losses(const Projection &whole) const {
    const Shapes &shapes = whole.network.shapes;
    const Eigen::Index m = shapes.cols(), k = kLinear + m;
    const MatrixXd inverse = whole.factor.matrixL().solve(MatrixXd::Identity(k, k));
    VectorXd loss = whole.network.weights.tail(m).cwiseAbs2().cwiseQuotient(
        inverse.rightCols(m).colwise().squaredNorm().transpose());
    for (Eigen::Index j = 0; j < m; ++j) loss[j] -= walls(shapes.col(j));
    return loss;
}

// The best of the two cheapest deletions.
Network VariableProjection::prune(const Network &network, double tolerance) const {
    const VectorXd loss = losses(projection(network.shapes));
    std::vector<Eigen::Index> order(static_cast<std::size_t>(loss.size()));
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return loss[a] < loss[b]; });
    order.resize(std::min<std::size_t>(order.size(), kExactDeletions));
    std::sort(order.begin(), order.end());
    std::vector<Projection> trials;
    for (const Eigen::Index j : order) trials.push_back(projection(without(network.shapes, j)));
    std::stable_sort(trials.begin(), trials.end(),
                     [](const Projection &a, const Projection &b) { return a.network.cost < b.network.cost; });
    Network best = refined(std::move(trials[0]), tolerance, kMaxRefineSteps);
    if (trials.size() > 1) {
        Network other = refined(std::move(trials[1]), tolerance, kMaxRefineSteps);
        if (other.cost < best.cost) best = std::move(other);
    }
    return best;
}

std::vector<Network> VariableProjection::path(const MatrixXd &centers, int max_size, double enough, double settled,
                                              double tolerance) const {
    Dictionary candidates{dictionary(centers), {}, {}};
    candidates.columns = dictionary_columns(centers);
    candidates.norms = candidates.columns.colwise().squaredNorm();
    std::vector<Network> sizes{project(Shapes(kNonlinear, 0))};
    std::optional<Appended> appended;  // while nothing is left to move Gaussians for
    while (static_cast<int>(sizes.size()) <= max_size && centers.rows() > 0) {
        const bool reached = sizes.back().misfit <= enough;
        if (sizes.back().misfit <= settled) {
            if (!appended) appended.emplace(*this, sizes.back(), candidates, max_size);
            Network next = appended->next(sizes.back());
            if (!(next.cost < sizes.back().cost)) break;
            sizes.push_back(std::move(next));
            if (reached) break;
            continue;
        }
        appended.reset();
        Network next = grow(sizes.back(), candidates, tolerance);
        if (!(next.cost < sizes.back().cost)) break;
        sizes.push_back(std::move(next));
        std::size_t m = sizes.size() - 1;
        for (; m > 1; --m) {
            Network fewer = prune(sizes[m], tolerance);
            if (!(fewer.cost < sizes[m - 1].cost)) break;
            sizes[m - 1] = std::move(fewer);
        }
        // A deletion may beat even the larger network that it came from: that one is grown anew.
        for (; m < sizes.size(); ++m) {
            if (m == 0 || sizes[m].cost < sizes[m - 1].cost) continue;
            sizes[m] = grow(sizes[m - 1], candidates, tolerance);
            if (!(sizes[m].cost < sizes[m - 1].cost)) sizes.resize(m);
        }
        if (reached) break;
    }
    if (appended) sizes.back() = project(sizes.back().shapes);
    return sizes;
}

}  // namespace gyrotc
