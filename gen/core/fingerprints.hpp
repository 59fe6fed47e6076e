// fingerprints.hpp - hashes of windows of rows by which a copied stretch of a recording is known again.
//
// What they mean, and why chance cannot have made them, stands in gyrotc/recordings/copies.py.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace gyrotc {

// Windows that were kept: their hash, and their first and last row, counted from 0.
struct Windows {
    std::vector<std::uint64_t> hash;
    std::vector<std::int64_t> first;
    std::vector<std::int64_t> last;
};

// How windows are chosen.
struct WindowRule {
    std::vector<std::size_t> lengths;  // of windows, rows
    std::uint64_t mask;                // a window is kept where these bits of its hash are 0
    double bits;                       // that its rates must tell, at least
    std::size_t own;                   // windows that begin in the first so many rows
};

// Windows of `rows` rows: temperatures, and the rates of every axis.
Windows windows_of(const double *temperature, const std::vector<const double *> &rates, std::size_t rows,
                   const WindowRule &rule);

}  // namespace gyrotc
