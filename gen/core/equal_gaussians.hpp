// equal_gaussians.hpp - normal equations of a dictionary of equal Gaussians, without the dictionary.
//
// The product of two Gaussians of the same widths depends on a sample x only through their midpoint m:
//
//   exp(-|x - a|^2) exp(-|x - b|^2) = exp(-|a - b|^2 / 2) exp(-2 |x - m|^2),   m = (a + b) / 2   (in widths)
//
// so every Gram entry is a value of one smooth function S(m) = sum_i n_i exp(-2 |x_i - m|^2), and so are the moments
// with 1 and y. On a grid these sums separate by axis: they are small matrix products over blocks of samples. For
// candidates on a regular grid the values are exact; for any others they are interpolated from a fine grid (Lagrange,
// 20 points in each direction, 12 nodes to a width: 1e-13 of the largest value).
#pragma once

#include <Eigen/Dense>

namespace gyrotc {

using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Samples: inputs, target, weight > 0, all of one length.
struct Samples {
    Eigen::VectorXd t, r, y, weight;
};

// Candidate columns as far as least squares needs them: their products with one another and with the target.
class NormalEquations {
  public:
    virtual ~NormalEquations() = default;
    virtual Eigen::Index size() const = 0;
    virtual double energy() const = 0;                           // y'Ny
    virtual Eigen::VectorXd norms() const = 0;                   // diagonal of the Gram
    virtual Eigen::VectorXd moments() const = 0;                 // with y
    virtual Eigen::VectorXd column(Eigen::Index j) const = 0;    // of the Gram
};

struct Axis {
    double first = 0.0, step = 1.0;
    Eigen::Index count = 1;
    double at(Eigen::Index k) const { return first + step * static_cast<double>(k); }
};

// The dictionary's sums over the samples added so far. Column 0 of the normal equations is the constant, column
// j + 1 the Gaussian at center j.
class EqualGaussians final : public NormalEquations {
  public:
    // Candidates at every node of t x r, r running fastest.
    static EqualGaussians on_grid(const Axis &t, const Axis &r, double width_t, double width_r);
    // Candidates at the rows (t, r) of `centers`.
    static EqualGaussians at(const Eigen::MatrixXd &centers, double width_t, double width_r);

    void add(const Samples &samples);

    Eigen::Index size() const override { return centers_.rows() + 1; }
    const Eigen::MatrixXd &centers() const { return centers_; }
    double energy() const override { return energy_; }
    double samples() const { return samples_; }

    Eigen::VectorXd norms() const override;
    Eigen::VectorXd moments() const override;
    Eigen::VectorXd column(Eigen::Index j) const override;

  private:
    EqualGaussians(double width_t, double width_r) : width_t_(width_t), width_r_(width_r) {}
    double interpolate(const RowMatrix &table, const Axis &t, const Axis &r, double at_t, double at_r) const;
    double pair_sum(Eigen::Index i, Eigen::Index j) const;
    Eigen::VectorXd at_centers(const RowMatrix &table) const;

    double width_t_, width_r_;
    bool grid_ = false;
    Axis t_, r_;               // nodes of the moments
    Axis mid_t_, mid_r_;       // nodes of the midpoints
    Eigen::MatrixXd centers_;
    RowMatrix pairs_;          // S at the midpoints
    RowMatrix ones_, targets_; // sums with 1 and y at the nodes
    double energy_ = 0.0, total_ = 0.0, total_y_ = 0.0, samples_ = 0.0;
};

}  // namespace gyrotc
