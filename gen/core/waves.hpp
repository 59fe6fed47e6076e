// waves.hpp - sums over the sines of the evidence model's basis, with few waves in place of all pairs of functions.
//
// A product of two sines is a difference of two cosines. So all products of two of the 121 functions are made of 81
// cosines of t, 51 x 8 products of a cosine of t and a sine of r, and 21 x 17 products of two cosines: a sixth to a
// tenth of the multiplications, and sums that differ from those over pairs by rounding alone.
#pragma once

#include <Eigen/Dense>

namespace gyrotc {

constexpr int kOfT = 40;       // functions of temperature alone
constexpr int kCoupledT = 10;  // functions of the coupled part, by input
constexpr int kCoupledR = 8;   // 121 in all: docs/training.md, section 1, step 2
constexpr int kBasis = 1 + kOfT + kCoupledT * kCoupledR;

// Half lengths of the domain: the functions vanish at its edges.
struct Domain {
    double t = 0.0, r = 0.0;
};

// Place of a function of the coupled part in the basis: the i-th sine of t with the l-th of r.
constexpr int coupled(int i, int l) { return 1 + kOfT + i * kCoupledR + l; }

// Rows: points. Columns: the basis.
Eigen::MatrixXd basis_of(const Domain &domain, const Eigen::VectorXd &t, const Eigen::VectorXd &r);

// Weighted sums over points: of the products of every two functions, and of each function times y.
struct Sums {
    Eigen::MatrixXd products;
    Eigen::VectorXd moments;
};
Sums sums_over(const Domain &domain, const Eigen::VectorXd &t, const Eigen::VectorXd &r,
               const Eigen::VectorXd &weight, const Eigen::VectorXd &y);

// basis' c at points.
Eigen::VectorXd linear_form(const Domain &domain, const Eigen::VectorXd &c, const Eigen::VectorXd &t,
                            const Eigen::VectorXd &r);

// basis' M basis at points, for a symmetric M of which the lower triangle is read.
class QuadraticForm {
  public:
    QuadraticForm(const Domain &domain, const Eigen::MatrixXd &lower);

    Eigen::VectorXd at(const Eigen::VectorXd &t, const Eigen::VectorXd &r) const;

    // Values below it have lost more than six of their digits to the cancelling of waves.
    double least() const { return least_; }

  private:
    static constexpr int kOfCos = 2 * kOfT + 1;           // cosines of t
    static constexpr int kMixedCos = kOfT + kCoupledT + 1;  // of t, beside a sine of r
    static constexpr int kCoupledCosT = 2 * kCoupledT + 1;  // of t, beside a cosine of r
    static constexpr int kCoupledCosR = 2 * kCoupledR + 1;

    void add_of_t(const Eigen::MatrixXd &lower);
    void add_mixed(const Eigen::MatrixXd &lower);
    void add_coupled(const Eigen::MatrixXd &lower);

    Domain domain_;
    Eigen::VectorXd of_cos_, of_sin_;  // amplitudes of cosines and sines of t
    Eigen::MatrixXd sin_sin_;          // of products of sines of t (rows) and of r
    Eigen::MatrixXd cos_sin_, cos_cos_;
    double least_ = 0.0;
};

}  // namespace gyrotc
