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
        if (n < kCounters / 8)  // few are asked for: only these need be 0
            for (std::size_t k = 0; k < n; ++k) counters_[words[k] % kCounters] = 0;
        else
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

// How many bits are set: sums of neighbours, twice as wide each time.
std::int64_t ones(std::uint64_t word) {
    word = word - ((word >> 1) & 0x5555555555555555U);
    word = (word & 0x3333333333333333U) + ((word >> 2) & 0x3333333333333333U);
    word = (word + (word >> 4)) & 0x0F0F0F0F0F0F0F0FU;
    return static_cast<std::int64_t>((word * 0x0101010101010101U) >> 56);
}

// Windows of signs with their numbers, and what two places of the signs have in common.
class SignWindows {
  public:
    struct Window {
        std::uint64_t number;
        std::uint32_t at, run;
    };

    explicit SignWindows(const SignRuns &runs) : runs_(runs) {}

    // Those of one number stand beside each other, in the order of their places.
    std::vector<Window> with_numbers(const std::vector<std::int64_t> &offsets) const {
        constexpr std::uint64_t all = (std::uint64_t{1} << kSignsAtOnce) - 1;
        std::uint64_t chosen[2] = {0, 0};
        for (const std::int64_t o : offsets)
            chosen[o / kSignsAtOnce] |= std::uint64_t{1} << (kSignsAtOnce - 1 - o % kSignsAtOnce);
        std::vector<Window> found;
        for (std::size_t run = 0; run < runs_.start.size(); ++run) {
            const std::int64_t end = runs_.start[run] + runs_.count[run] - offsets.back();
            for (std::int64_t at = runs_.start[run]; at < end; ++at) {
                const bool first = sign(at);
                if (sign(at + offsets[1]) == first || sign(at + offsets[2]) != first) continue;
                const std::uint64_t turned = first ? all : 0;
                const std::uint64_t low = (from(at) ^ turned) & chosen[0];
                const std::uint64_t high = (from(at + kSignsAtOnce) ^ turned) & chosen[1];
                found.push_back({low * kFirst ^ high, static_cast<std::uint32_t>(at), static_cast<std::uint32_t>(run)});
            }
        }
        return by_number(found);
    }

    // By how much more of so many signs from two places on agree than differ, or the other way round: 0 to 1.
    double excess(std::int64_t one, std::int64_t other, std::int64_t count) const {
        std::int64_t differ = 0;
        for (std::int64_t done = 0; done < count; done += kSignsAtOnce) {
            const std::uint64_t words = from(one + done) ^ from(other + done);
            const std::int64_t beyond = std::max(std::int64_t{0}, kSignsAtOnce - (count - done));
            differ += ones(words >> beyond);
        }
        return std::abs(1.0 - 2.0 * static_cast<double>(differ) / static_cast<double>(count));
    }

  private:
    bool sign(std::int64_t at) const { return (runs_.packed[static_cast<std::size_t>(at >> 3)] >> (7 - (at & 7))) & 1; }

    // The signs from a place on, the first one in the highest of kSignsAtOnce bits.
    std::uint64_t from(std::int64_t at) const {
        const std::uint8_t *bytes = runs_.packed.data() + (at >> 3);
        const auto byte = [bytes](int k) { return std::uint64_t{bytes[k]} << (56 - 8 * k); };
        const std::uint64_t word = byte(0) | byte(1) | byte(2) | byte(3) | byte(4) | byte(5) | byte(6) | byte(7);
        return (word << (at & 7)) >> (64 - kSignsAtOnce);
    }

    // Sorted by number and place: distributed by some bits first, for comparing all of them takes longer.
    static std::vector<Window> by_number(const std::vector<Window> &windows) {
        int bits = 1;
        while (bits < 24 && (windows.size() >> bits) > 1) ++bits;
        const auto bucket = [bits](const Window &w) { return static_cast<std::size_t>(mixed(w.number) >> (64 - bits)); };
        std::vector<std::uint32_t> next((std::size_t{1} << bits) + 1, 0);
        for (const Window &w : windows) ++next[bucket(w) + 1];
        for (std::size_t k = 1; k < next.size(); ++k) next[k] += next[k - 1];
        const std::vector<std::uint32_t> first = next;
        std::vector<Window> sorted(windows.size());
        for (const Window &w : windows) sorted[next[bucket(w)]++] = w;
        const auto before = [](const Window &a, const Window &b) {
            return a.number != b.number ? a.number < b.number : a.at < b.at;
        };
        for (std::size_t k = 0; k + 1 < first.size(); ++k)
            std::sort(sorted.begin() + first[k], sorted.begin() + first[k + 1], before);
        return sorted;
    }

    const SignRuns &runs_;
};

}  // namespace

Alike alike_runs(SignRuns runs, const std::vector<std::int64_t> &offsets, const SignRule &rule) {
    runs.packed.resize(runs.packed.size() + 2 * kSignsAtOnce / 8 + 8, 0);  // words are read beyond the last sign
    const SignWindows signs(runs);
    const std::vector<SignWindows::Window> windows = signs.with_numbers(offsets);
    Alike found;
    for (std::size_t k = 0; k < windows.size(); ++k) {
        const std::size_t end = std::min(windows.size(), k + static_cast<std::size_t>(rule.crowd));
        const std::size_t one = windows[k].run;
        const std::int64_t at = windows[k].at, place = at - runs.start[one];
        for (std::size_t j = k + 1; j < end && windows[j].number == windows[k].number; ++j) {
            const std::size_t other = windows[j].run;
            if (runs.serial[one] == runs.serial[other]) continue;
            const std::int64_t other_at = windows[j].at, other_place = other_at - runs.start[other];
            const std::int64_t before = std::min({place, other_place, kSignsAtOnce});
            const std::int64_t after = std::min(runs.count[one] - place, runs.count[other] - other_place);
            const std::int64_t near = std::min(before + after, rule.first_look);
            if (signs.excess(at - before, other_at - before, near) < rule.least_excess) continue;
            const std::int64_t lag = other_place - place;
            const std::int64_t first = std::max(std::int64_t{0}, -lag), other_first = std::max(std::int64_t{0}, lag);
            const std::int64_t common = std::min(runs.count[one] - first, runs.count[other] - other_first);
            const double excess = signs.excess(runs.start[one] + first, runs.start[other] + other_first, common);
            if (excess * std::sqrt(rule.independent * static_cast<double>(common)) < rule.least_sigmas) continue;
            found.one.push_back(static_cast<std::int64_t>(one));
            found.other.push_back(static_cast<std::int64_t>(other));
            found.lag.push_back(lag);
            found.common.push_back(common);
            found.excess.push_back(excess);
        }
    }
    return found;
}

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
