// random.hpp - a generator whose sequence is the same on every platform (SplitMix64, Steele et al. 2014).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

namespace gyrotc {

class SplitMix64 {
  public:
    explicit SplitMix64(std::uint64_t seed) : state_(seed) {}

    std::uint64_t next() {
        std::uint64_t z = (state_ += 0x9E3779B97F4A7C15U);
        z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9U;
        z = (z ^ (z >> 27)) * 0x94D049BB133111EBU;
        return z ^ (z >> 31);
    }

    // 0 ... n - 1; the bias of the remainder is below n / 2^64.
    std::uint64_t below(std::uint64_t n) { return next() % n; }

    // A random order of 0 ... n - 1 (Fisher and Yates).
    std::vector<Eigen::Index> permutation(Eigen::Index n) {
        std::vector<Eigen::Index> order(static_cast<std::size_t>(n));
        std::iota(order.begin(), order.end(), Eigen::Index{0});
        for (std::size_t i = order.size(); i > 1; --i)
            std::swap(order[i - 1], order[static_cast<std::size_t>(below(i))]);
        return order;
    }

  private:
    std::uint64_t state_;
};

}  // namespace gyrotc
