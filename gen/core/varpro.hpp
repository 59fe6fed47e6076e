// varpro.hpp - few anisotropic Gaussians through a weighted cloud of points, by variable projection.
//
//   min over c, d, s, q of  min over w of
//     sum_i n_i (y_i - w0 - a t_i - b r_i - sum_j w_j exp(-((t_i - c_j)/s_j)^2 - ((r_i - d_j)/q_j)^2))^2
//     + ridge sum_j w_j^2 + walls(c, d, log s, log q)
//
// Levenberg-Marquardt on the nonlinear parameters with the linear ones projected out (Golub and Pereyra
// 1973, Kaufman's Jacobian 1975). Inputs are normalised to about -1 ... 1.
#pragma once

#include <Eigen/Dense>
#include <vector>

namespace gyrotc {

// Points to follow. All four of one length.
struct Cloud {
    Eigen::VectorXd t, r;    // normalised inputs
    Eigen::VectorXd weight;  // >= 0
    Eigen::VectorXd target;
};

constexpr int kLinear = 3;     // w0, linear part in t and r
constexpr int kNonlinear = 4;  // of one Gaussian: c, d, log s, log q
using Shapes = Eigen::Matrix<double, kNonlinear, Eigen::Dynamic>;  // one column for each Gaussian

// A network: shapes and linear weights (w0, a, b, w_1 ... w_M).
struct Network {
    Shapes shapes{kNonlinear, 0};
    Eigen::VectorXd weights;
    double cost = 0.0;    // the objective above
    double misfit = 0.0;  // its first sum alone
};

class VariableProjection {
  public:
    VariableProjection(const Cloud &cloud, double ridge);

    // The best weights for these shapes, and the objective.
    Network project(const Shapes &shapes) const;

    // Gradient of the objective, kNonlinear x M, at a projected network.
    Shapes gradient(const Network &network) const;

    // What the objective of a projected network rises by when each Gaussian is deleted and all weights are fitted anew.
    Eigen::VectorXd losses(const Shapes &shapes) const { return losses(projection(shapes)); }

    // Levenberg-Marquardt from `start`, until a step gains less than `tolerance` or 1 %. Never worse than the start.
    Network refine(const Network &start, double tolerance, int max_steps) const;

    // Networks of 0, 1, ... Gaussians: forward selection among `centers` (rows: t, r) x a ladder of widths, two
    // trials for each size; deletions from the larger size replace a smaller one that they beat. The cost never rises
    // along the path. Ends one size after the misfit is <= enough, at max_size, or where a further Gaussian gains nothing.
    // Below a misfit of `settled` further Gaussians are only selected: there is nothing left to move them for. Each is
    // appended to the Cholesky factor of those before it, O(points x candidates) a Gaussian however many there are.
    std::vector<Network> path(const Eigen::MatrixXd &centers, int max_size, double enough, double settled,
                              double tolerance) const;

  private:
    struct Dictionary {
        Shapes shapes;
        Eigen::MatrixXd columns;
        Eigen::VectorXd norms;  // squared
    };

    // A network with its columns and the Cholesky factor of their normal matrix, from which the next step starts.
    struct Projection {
        Network network;
        Eigen::MatrixXd columns;
        Eigen::LLT<Eigen::MatrixXd> factor;
    };

    Projection projection(const Shapes &shapes) const;
    Network refined(Projection at, double tolerance, int max_steps) const;
    Eigen::VectorXd losses(const Projection &whole) const;
    Eigen::MatrixXd gaussians(const Shapes &shapes) const;
    Eigen::MatrixXd dictionary_columns(const Eigen::MatrixXd &centers) const;
    Eigen::MatrixXd columns(const Shapes &shapes) const;
    class Appended;

    double walls(const Shapes &shapes) const;
    Eigen::VectorXd gains(const Network &network, const Dictionary &candidates) const;
    Network grow(const Network &network, const Dictionary &candidates, double tolerance) const;
    Network prune(const Network &network, double tolerance) const;

    Eigen::VectorXd t_, r_, root_, target_;  // target_ is already multiplied by root_ = sqrt(weight)
    double ridge_, wall_;
};

}  // namespace gyrotc
