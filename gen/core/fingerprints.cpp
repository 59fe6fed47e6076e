#include "fingerprints.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

namespace gyrotc {
namespace {

using Words = std::vector<std::uint64_t>;

// SplitMix64 (Steele, Lea, Flood 2014).
constexpr std::uint64_t kFirst = 0x9E3779B97F4A7C15U, kSecond = 0xBF58476D1CE4E5B9U;
constexpr std::size_t kCounters = std::size_t{1} << 20;  // 4 MiB
constexpr std::size_t kContext = 16;                     // rows that a pattern is known by

std::uint64_t mixed(std::uint64_t word) {
    word = (word ^ (word >> 30)) * kSecond;
    word = (word ^ (word >> 27)) * kFirst;
    return word ^ (word >> 31);
}

// A value as float32, as a whole number; 0 and -0 are one, and so is all that is beyond float32.
std::uint64_t bits_of(double value) {
    const bool beyond = std::abs(value) > std::numeric_limits<float>::max();
    const float narrow = beyond ? std::copysign(INFINITY, static_cast<float>(std::copysign(1.0, value)))
                                : static_cast<float>(value) + 0.0F;
    std::uint32_t word;
    std::memcpy(&word, &narrow, sizeof word);
    return word;
}

// Hashes of windows of words: of any length in one multiplication, from what is summed up before each word.
class Rolling {
  public:
    explicit Rolling(const Words &words) : sum_(words.size() + 1, 0) {
        for (std::size_t k = 0; k < words.size(); ++k) sum_[k + 1] = sum_[k] * kFirst + words[k];
    }

    // Of each window of `length` words, in order.
    void windows(std::size_t length, Words &hashes) const {
        std::uint64_t power = 1;
        for (std::size_t k = 0; k < length; ++k) power *= kFirst;
        hashes.resize(sum_.size() > length ? sum_.size() - length : 0);
        for (std::size_t k = 0; k < hashes.size(); ++k) hashes[k] = mixed(sum_[k + length] - sum_[k] * power);
    }

  private:
    Words sum_;
};

// How often each of the words occurs among all, by their lowest bits.
class Occurrences {
  public:
    Occurrences() : counters_(kCounters) {}

    void count(const Words &words, std::size_t n) {
        std::fill(counters_.begin(), counters_.end(), 0U);
        for (std::size_t k = 0; k < n; ++k) ++counters_[words[k] % kCounters];
    }

    float of(std::uint64_t word) const { return static_cast<float>(counters_[word % kCounters]); }

  private:
    std::vector<std::uint32_t> counters_;
};

// How much rarer each rate is after the `length` rows before it, given as hashes, than it might be; lowers `rarity`.
void lower(std::vector<float> &rarity, const Words &before, const Words &rate, std::size_t length, Words &pairs) {
    if (rate.size() <= length) return;
    static thread_local Occurrences alone, both;
    const std::size_t n = rate.size() - length;
    pairs.resize(n);
    for (std::size_t k = 0; k < n; ++k) pairs[k] = mixed(before[k] * kFirst + rate[k + length]);
    alone.count(before, n);
    both.count(pairs, n);
    for (std::size_t k = 0; k < n; ++k) {
        const float found = alone.of(before[k]) / (both.of(pairs[k]) - 0.5F);
        rarity[k + length] = std::min(rarity[k + length], found);
    }
}

// Sum of the bits that rates tell before each row: of each rate after the one before, or after the sixteen before,
// whichever is less.
std::vector<double> bits_before(const Words &rate) {
    std::vector<float> rarity(rate.size(), INFINITY);
    if (!rarity.empty()) rarity[0] = 1.0F;
    Words before, pairs;
    lower(rarity, rate, rate, 1, pairs);
    Rolling(rate).windows(kContext, before);
    lower(rarity, before, rate, kContext, pairs);
    std::vector<double> sum(rate.size() + 1, 0.0);
    for (std::size_t k = 0; k < rate.size(); ++k)
        sum[k + 1] = sum[k] + static_cast<double>(std::log2(std::max(rarity[k], 1.0F)));
    return sum;
}

}  // namespace

Windows windows_of(const double *temperature, const std::vector<const double *> &rates, std::size_t rows,
                   const WindowRule &rule) {
    // Rows that differ from the one before, where they stand, and their rates.
    Words row, rate;
    std::vector<std::size_t> at;
    std::uint64_t last = 0;
    for (std::size_t k = 0; k < rows; ++k) {
        bool known = true;
        std::uint64_t of_rates = 0;
        for (const double *values : rates) {
            known = known && std::isfinite(values[k]);
            of_rates = mixed(of_rates * kSecond + bits_of(values[k]));
        }
        const std::uint64_t word = mixed(of_rates * kFirst + bits_of(temperature[k]));
        if (known && (k == 0 || word != last)) {
            row.push_back(word);
            rate.push_back(of_rates);
            at.push_back(k);
        }
        last = word;
    }
    const std::vector<double> bits = bits_before(rate);
    const Rolling rolling(row);
    Windows found;
    Words words;
    for (const std::size_t length : rule.lengths) {
        rolling.windows(length, words);
        for (std::size_t k = 0; k < words.size(); ++k) {
            if ((words[k] & rule.mask) != 0 || at[k] >= rule.own || bits[k + length] - bits[k + 1] < rule.bits) continue;
            found.hash.push_back(words[k]);
            found.first.push_back(static_cast<std::int64_t>(at[k]));
            found.last.push_back(static_cast<std::int64_t>(at[k + length - 1]));
        }
    }
    return found;
}

}  // namespace gyrotc
