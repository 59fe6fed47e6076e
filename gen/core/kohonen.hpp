// kohonen.hpp - Kohonen network of two inputs: candidate centers from samples (Ding et al. 2014, eq. (5), (6)).
#pragma once

#include <Eigen/Dense>
#include <cstdint>

namespace gyrotc {

struct KohonenOptions {
    int nodes = 40;
    int max_epochs = 30;
    double rate_first = 0.5;    // eta of the first step; falls geometrically to rate_last over max_epochs
    double rate_last = 0.005;
    double tolerance = 1e-4;    // learning ends when no node moves further than this over an epoch
    double neighbourhood = 0.0; // 0: the winner takes all. Else the first radius on a square lattice of nodes, in nodes
    std::uint64_t seed = 0;
};

struct KohonenMap {
    Eigen::MatrixXd nodes;      // n x 2
    Eigen::VectorXd occupancy;  // samples won by each node in the last epoch
    int epochs = 0;
};

// Samples: n x 2, normalised, n >= 1. Nodes start on samples drawn without replacement; if there are no more samples
// than nodes, the samples are the nodes. Equal distances: the node of the lowest index wins.
KohonenMap kohonen(const Eigen::MatrixXd &samples, const KohonenOptions &options);

}  // namespace gyrotc
