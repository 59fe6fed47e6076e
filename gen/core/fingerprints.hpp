// fingerprints.hpp - hashes of windows of rows, and numbers of windows of signs, by which copies are known again.
//
// What they mean, and why chance cannot have made them, stands in gyrotc/recordings/copies.py and fleet/outliers.py.
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

// Signs of the noise of runs, one behind the other.
struct SignRuns {
    std::vector<std::uint8_t> packed;  // eight a byte, the first one in the highest bit
    std::vector<std::int64_t> start;   // place of each run's first sign
    std::vector<std::int64_t> count;   // number of its signs
    std::vector<std::int64_t> serial;  // number of its gyro's serial
};

// How copies are looked for.
struct SignRule {
    std::int64_t crowd;        // windows with one number, each of which is compared with so many less one behind it
    std::int64_t first_look;   // signs about a window that are compared first
    double least_excess;       // by how much more of them must agree than differ, or the other way round
    double independent;        // share of the signs that are independent
    double least_sigmas;       // of the excess over all that two runs have in common
};

// Pairs of runs, by their numbers, at the lags at which they agree; a pair and lag may stand there again.
struct Alike {
    std::vector<std::int64_t> one, other;
    std::vector<std::int64_t> lag;     // of the other's place behind the one's, in signs
    std::vector<std::int64_t> common;  // signs that were compared
    std::vector<double> excess;        // by how much more of them agree than differ, or the other way round: 0 to 1
};

constexpr std::int64_t kSignsAtOnce = 56;  // what eight bytes hold from any bit of the first on

// Runs of different serials whose signs agree about windows with the same number: signs at `offsets` (the first is 0,
// all are below twice kSignsAtOnce), against the first. A window counts if the second sign is another than the first
// and the third is the same.
Alike alike_runs(SignRuns runs, const std::vector<std::int64_t> &offsets, const SignRule &rule);

}  // namespace gyrotc
