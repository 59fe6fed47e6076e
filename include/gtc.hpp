/* gtc.hpp - C++ face of the gyrotc runtime: the functions of gtc.h with a type for each unit.
 *
 * A header alone, C++11, no exceptions, no heap. gtc.h is the manual; a Correction is a state of it, so one task
 * owns it, and an Increments one sum of angle increments, which an interrupt may own.
 *
 *   gtc::f32::Correction correction;
 *   if (!gtc::f32::check(gtc_sim_0001_f32).is_ok()) { halt(); }
 *   if (!correction.init(gtc_sim_0001_f32, 10000UL).is_ok()) { halt(); }
 *   correction.sample(10000UL, gtc::f32::Celsius(t));
 *   gtc::f32::DegPerHour bias(0.0F);
 *   gtc::Status status = correction.bias(bias);
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_HPP_INCLUDED
#define GTC_HPP_INCLUDED

#include "gtc.h"

namespace gtc {

/* What a call did: the codes of gtc.h. */
class Status {
public:
    explicit constexpr Status(int code) noexcept : code_(code) {}
    constexpr int code() const noexcept { return code_; }
    constexpr bool is_ok() const noexcept { return code_ == GTC_OK; }
    constexpr bool failed() const noexcept { return code_ < 0; }
    /* One of GTC_WARMING ... GTC_CHANNEL_LOST; false for a call that failed. */
    constexpr bool has(int remark) const noexcept { return (code_ > 0) && ((code_ & remark) != 0); }

private:
    int code_;
};

/* A number of one unit; another unit, or a bare number, does not convert to it. */
template <class Unit, class Number> class Quantity {
public:
    explicit constexpr Quantity(Number value) noexcept : value_(value) {}
    constexpr Number value() const noexcept { return value_; }

private:
    Number value_;
};

namespace unit {
struct Celsius;
struct CelsiusPerBlock;
struct DegPerHour;
struct Time;
struct Angle;
} // namespace unit

/* The functions of gtc.h in float32: C, C per block, deg/h, s, arcsec. */
#if GTC_WITH_F32
struct F32 {
    typedef float Number;
    typedef gtc_f32_table_t Table;
    typedef gtc_f32_state_t State;
    typedef gtc_f32_angle_t Sum;
    static constexpr decltype(&gtc_f32_check) check = &gtc_f32_check;
    static constexpr decltype(&gtc_f32_init) init = &gtc_f32_init;
    static constexpr decltype(&gtc_f32_sample) sample = &gtc_f32_sample;
    static constexpr decltype(&gtc_f32_bias) bias = &gtc_f32_bias;
    static constexpr decltype(&gtc_f32_angle) angle = &gtc_f32_angle;
#if GTC_WITH_UNCERTAINTY
    typedef gtc_f32_snapshot_t Snapshot;
    static constexpr decltype(&gtc_f32_snapshot) snapshot = &gtc_f32_snapshot;
#endif
#if GTC_WITH_REZERO
    static constexpr decltype(&gtc_f32_rezero) rezero = &gtc_f32_rezero;
#endif
#if GTC_WITH_IMAGE
    static constexpr decltype(&gtc_f32_open) open = &gtc_f32_open;
    static constexpr decltype(&gtc_f32_check_words) check_words = &gtc_f32_check_words;
#endif
#if GTC_WITH_SAVE
    static constexpr decltype(&gtc_f32_save) save = &gtc_f32_save;
    static constexpr decltype(&gtc_f32_restore) restore = &gtc_f32_restore;
#endif
};
#endif

/* The same in fixed point: 2^-16 C, 2^-16 C per block, 2^-bias_frac_bits deg/h, microseconds,
 * 2^-bias_frac_bits arcsec. */
#if GTC_WITH_Q31
struct Q31 {
    typedef int_least32_t Number;
    typedef gtc_q31_table_t Table;
    typedef gtc_q31_state_t State;
    typedef gtc_q31_angle_t Sum;
    static constexpr decltype(&gtc_q31_check) check = &gtc_q31_check;
    static constexpr decltype(&gtc_q31_init) init = &gtc_q31_init;
    static constexpr decltype(&gtc_q31_sample) sample = &gtc_q31_sample;
    static constexpr decltype(&gtc_q31_bias) bias = &gtc_q31_bias;
    static constexpr decltype(&gtc_q31_angle) angle = &gtc_q31_angle;
#if GTC_WITH_UNCERTAINTY
    typedef gtc_q31_snapshot_t Snapshot;
    static constexpr decltype(&gtc_q31_snapshot) snapshot = &gtc_q31_snapshot;
#endif
#if GTC_WITH_REZERO
    static constexpr decltype(&gtc_q31_rezero) rezero = &gtc_q31_rezero;
#endif
#if GTC_WITH_IMAGE
    static constexpr decltype(&gtc_q31_open) open = &gtc_q31_open;
    static constexpr decltype(&gtc_q31_check_words) check_words = &gtc_q31_check_words;
#endif
#if GTC_WITH_SAVE
    static constexpr decltype(&gtc_q31_save) save = &gtc_q31_save;
    static constexpr decltype(&gtc_q31_restore) restore = &gtc_q31_restore;
#endif
};
#endif

/* The types and functions of one arithmetic. */
template <class A> struct Runtime {
    typedef typename A::Number Number;
    typedef typename A::Table Table;
    typedef typename A::State State;
#if GTC_WITH_UNCERTAINTY
    typedef typename A::Snapshot Snapshot;
#endif
    typedef Quantity<unit::Celsius, Number> Celsius;
    typedef Quantity<unit::CelsiusPerBlock, Number> CelsiusPerBlock;
    typedef Quantity<unit::DegPerHour, Number> DegPerHour;
    typedef Quantity<unit::Time, Number> Time;
    typedef Quantity<unit::Angle, Number> Angle;

    static Status check(const Table &table) noexcept { return Status(A::check(&table)); }

#if GTC_WITH_IMAGE
    static Status check_words(const Table &table) noexcept { return Status(A::check_words(&table)); }

    static Status open(Table &table, const gtc_word_t *words, uint_least32_t n_words, uint_least32_t expected_id) noexcept
    {
        return Status(A::open(&table, words, n_words, expected_id));
    }
#endif

    /* One state and its table; owned by one task. */
    class Correction {
    public:
        Correction() noexcept : state_(), table_(nullptr) {}
        Status init(const Table &table, uint_least32_t period_us) noexcept
        {
            return taken(table, Status(A::init(&state_, &table, period_us)));
        }
        /* Of a table with one channel, so many microseconds after the call before. */
        Status sample(uint_least32_t elapsed_us, Celsius temp) noexcept
        {
            const Number channel = temp.value();
            const bool alone = (table_ != nullptr) && (table_->n_channels == 1U);
            return Status(alone ? A::sample(&state_, table_, elapsed_us, &channel) : GTC_E_ARG);
        }
        /* Of any table: n_channels numbers, the temperature first; nullptr: nothing was read. */
        Status sample(uint_least32_t elapsed_us, const Number *channels) noexcept
        {
            return Status(A::sample(&state_, table_, elapsed_us, channels));
        }
        Status bias(DegPerHour &bias) const noexcept
        {
            Number result = bias.value();
            const Status status(A::bias(&state_, table_, &result));
            bias = DegPerHour(result);
            return status;
        }
#if GTC_WITH_UNCERTAINTY
        /* Correction, its uncertainty and more, as a filter takes them; the numbers as in gtc.h. */
        Status snapshot(Snapshot &all) const noexcept { return Status(A::snapshot(&state_, table_, &all)); }
#endif
#if GTC_WITH_REZERO
        /* After a rest of so many seconds: the mean of the compensated rate. 0 seconds take every re-zero back. */
        Status rezero(DegPerHour mean_rate, uint_least32_t seconds) noexcept
        {
            return Status(A::rezero(&state_, table_, mean_rate.value(), seconds));
        }
#endif
        /* The state of gtc.h, to copy it or to hand it to C. */
        State &state() noexcept { return state_; }
        const State &state() const noexcept { return state_; }
#if GTC_WITH_SAVE
        Status save(gtc_word_t (&words)[GTC_SAVE_WORDS]) const noexcept { return Status(A::save(&state_, table_, words)); }
        Status restore(const Table &table, uint_least32_t period_us, const gtc_word_t (&words)[GTC_SAVE_WORDS],
                       uint_least32_t off_blocks) noexcept
        {
            return taken(table, Status(A::restore(&state_, &table, period_us, words, off_blocks)));
        }
#endif

    private:
        /* A start that failed leaves state and table as they were. */
        Status taken(const Table &table, Status status) noexcept
        {
            if (!status.failed()) {
                table_ = &table;
            }
            return status;
        }

        typename A::State state_;
        const Table *table_;
    };

    /* Angle increments; owned by one task or interrupt. */
    class Increments {
    public:
        Increments() noexcept : sum_() {}
        /* Adds to the increment, which is set to 0 when it was used. */
        Status angle(DegPerHour bias, Time dt, Angle &increment) noexcept
        {
            Number result = increment.value();
            const Status status(A::angle(&sum_, bias.value(), dt.value(), &result));
            increment = Angle(result);
            return status;
        }

    private:
        typename A::Sum sum_;
    };
};

#if GTC_WITH_F32
typedef Runtime<F32> f32;
#endif
#if GTC_WITH_Q31
typedef Runtime<Q31> q31;
#endif

} // namespace gtc

#endif /* GTC_HPP_INCLUDED */
