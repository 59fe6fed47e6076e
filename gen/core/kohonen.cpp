#include "kohonen.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "random.hpp"

namespace gyrotc {
namespace {

using Eigen::Index;

// Nodes sorted into square cells, so that the winner is found among a few of them.
class Buckets {
  public:
    Buckets(const Eigen::MatrixXd &samples, const Eigen::MatrixXd &nodes) : nodes_(nodes) {
        low_ = samples.colwise().minCoeff();
        const Eigen::RowVector2d span = (samples.colwise().maxCoeff() - low_).cwiseMax(1e-12);
        const double cells = 0.5 * static_cast<double>(nodes.rows());
        const double side = std::sqrt(span[0] * span[1] / cells);
        side_ = std::max(side, span.maxCoeff() / cells);
        columns_ = static_cast<Index>(span[0] / side_) + 1;
        rows_ = static_cast<Index>(span[1] / side_) + 1;
        cells_.resize(static_cast<std::size_t>(columns_ * rows_));
        where_.resize(static_cast<std::size_t>(nodes.rows()));
        for (Index j = 0; j < nodes.rows(); ++j) {
            where_[at(j)] = cell(nodes(j, 0), nodes(j, 1));
            cells_[at(where_[at(j)])].push_back(j);
        }
    }

    Index winner(double x, double y) const {
        const Index cx = column(x), cy = row(y);
        Index best = -1;
        double least = std::numeric_limits<double>::infinity();
        const Index rings = std::max(columns_, rows_);
        for (Index ring = 0; ring <= rings; ++ring) {
            const double clear = static_cast<double>(ring - 1) * side_;  // all cells of the ring are further than this
            if (ring > 0 && clear > 0.0 && clear * clear > least) break;
            for (Index i = std::max<Index>(cx - ring, 0); i <= std::min(cx + ring, columns_ - 1); ++i) {
                const bool edge = i == cx - ring || i == cx + ring;
                for (Index j = std::max<Index>(cy - ring, 0); j <= std::min(cy + ring, rows_ - 1); ++j)
                    if (edge || j == cy - ring || j == cy + ring) search(i + columns_ * j, x, y, best, least);
            }
        }
        return best;
    }

    void move(Index node, double x, double y) {
        nodes_(node, 0) = x;
        nodes_(node, 1) = y;
        const Index now = cell(x, y);
        Index &before = where_[at(node)];
        if (now == before) return;
        auto &left = cells_[at(before)];
        left.erase(std::find(left.begin(), left.end(), node));
        cells_[at(now)].push_back(node);
        before = now;
    }

    const Eigen::MatrixXd &nodes() const { return nodes_; }

  private:
    static std::size_t at(Index i) { return static_cast<std::size_t>(i); }
    Index column(double x) const { return clamp((x - low_[0]) / side_, columns_); }
    Index row(double y) const { return clamp((y - low_[1]) / side_, rows_); }
    Index cell(double x, double y) const { return column(x) + columns_ * row(y); }
    static Index clamp(double x, Index n) {
        return static_cast<Index>(std::min(std::max(x, 0.0), static_cast<double>(n - 1)));
    }

    void search(Index cell, double x, double y, Index &best, double &least) const {
        for (const Index j : cells_[at(cell)]) {
            const double dx = nodes_(j, 0) - x, dy = nodes_(j, 1) - y, d = dx * dx + dy * dy;
            if (d < least || (d == least && j < best)) {
                least = d;
                best = j;
            }
        }
    }

    Eigen::MatrixXd nodes_;
    Eigen::RowVector2d low_;
    double side_ = 1.0;
    Index columns_ = 1, rows_ = 1;
    std::vector<std::vector<Index>> cells_;
    std::vector<Index> where_;
};

// Moves the winner's neighbours on the lattice, too.
void pull_neighbours(Buckets &buckets, Index winner, double x, double y, double rate, double radius) {
    const Index m = buckets.nodes().rows();
    const Index width = static_cast<Index>(std::ceil(std::sqrt(static_cast<double>(m))));
    for (Index j = 0; j < m; ++j) {
        if (j == winner) continue;
        const double dx = static_cast<double>(j % width - winner % width);
        const double dy = static_cast<double>(j / width - winner / width);
        const double h = rate * std::exp(-0.5 * (dx * dx + dy * dy) / (radius * radius));
        if (h < 1e-4 * rate) continue;
        const double nx = buckets.nodes()(j, 0), ny = buckets.nodes()(j, 1);
        buckets.move(j, nx + h * (x - nx), ny + h * (y - ny));
    }
}

}  // namespace

KohonenMap kohonen(const Eigen::MatrixXd &samples, const KohonenOptions &options) {
    const Index n = samples.rows(), m = options.nodes;
    if (n < 1 || samples.cols() != 2 || m < 1) throw std::invalid_argument("kohonen: no samples or no nodes");
    if (!samples.allFinite()) throw std::invalid_argument("kohonen: a sample is not finite");
    if (n <= m) return {samples, Eigen::VectorXd::Ones(n), 0};
    SplitMix64 random(options.seed);
    std::vector<Index> first = random.permutation(n);
    first.resize(static_cast<std::size_t>(m));
    Buckets buckets(samples, samples(first, Eigen::all));
    const double steps = std::max(1.0, static_cast<double>(n) * options.max_epochs - 1.0);
    const double decay = std::pow(options.rate_last / options.rate_first, 1.0 / steps);
    double rate = options.rate_first;
    KohonenMap map;
    while (map.epochs < options.max_epochs) {
        const Eigen::MatrixXd before = buckets.nodes();
        map.occupancy.setZero(m);
        for (const Index i : random.permutation(n)) {
            const double x = samples(i, 0), y = samples(i, 1);
            const Index w = buckets.winner(x, y);
            const double nx = buckets.nodes()(w, 0), ny = buckets.nodes()(w, 1);
            buckets.move(w, nx + rate * (x - nx), ny + rate * (y - ny));
            const double radius = options.neighbourhood * rate / options.rate_first;
            if (radius > 0.1) pull_neighbours(buckets, w, x, y, rate, radius);
            map.occupancy[w] += 1.0;
            rate *= decay;
        }
        ++map.epochs;
        if ((buckets.nodes() - before).cwiseAbs().maxCoeff() <= options.tolerance) break;
    }
    map.nodes = buckets.nodes();
    return map;
}

}  // namespace gyrotc
