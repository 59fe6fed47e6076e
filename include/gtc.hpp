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

/* float32: C, C per block, deg/h, s, arcsec. */
struct F32 {
    typedef float Number;
    typedef gtc_f32_table_t Table;
    typedef gtc_f32_state_t State;
    typedef gtc_f32_angle_t Sum;
    typedef gtc_f32_snapshot_t Snapshot;
    static int check(const Table *table) noexcept { return gtc_f32_check(table); }
    static int check_words(const Table *table) noexcept { return gtc_f32_check_words(table); }
    static int open(Table *table, const gtc_word_t *words, uint_least32_t n, uint_least32_t id) noexcept
    {
        return gtc_f32_open(table, words, n, id);
    }
    static int init(State *state, const Table *table, uint_least32_t us) noexcept { return gtc_f32_init(state, table, us); }
    static int sample(State *state, const Table *table, uint_least32_t us, const Number *x) noexcept
    {
        return gtc_f32_sample(state, table, us, x);
    }
    static int bias(const State *state, const Table *table, Number *b) noexcept
    {
        return gtc_f32_bias(state, table, b);
    }
    static int snapshot(const State *state, const Table *table, Snapshot *all) noexcept
    {
        return gtc_f32_snapshot(state, table, all);
    }
    static int rezero(State *state, const Table *table, Number rate, uint_least32_t seconds) noexcept
    {
        return gtc_f32_rezero(state, table, rate, seconds);
    }
    static int save(const State *state, const Table *table, gtc_word_t *words) noexcept
    {
        return gtc_f32_save(state, table, words);
    }
    static int restore(State *state, const Table *table, uint_least32_t us, const gtc_word_t *words,
                       uint_least32_t off) noexcept
    {
        return gtc_f32_restore(state, table, us, words, off);
    }
    static int angle(Sum *sum, Number bias, Number dt, Number *a) noexcept { return gtc_f32_angle(sum, bias, dt, a); }
};

/* Fixed point: 2^-16 C, 2^-16 C per block, 2^-bias_frac_bits deg/h, microseconds, 2^-bias_frac_bits arcsec. */
struct Q31 {
    typedef int_least32_t Number;
    typedef gtc_q31_table_t Table;
    typedef gtc_q31_state_t State;
    typedef gtc_q31_angle_t Sum;
    typedef gtc_q31_snapshot_t Snapshot;
    static int check(const Table *table) noexcept { return gtc_q31_check(table); }
    static int check_words(const Table *table) noexcept { return gtc_q31_check_words(table); }
    static int open(Table *table, const gtc_word_t *words, uint_least32_t n, uint_least32_t id) noexcept
    {
        return gtc_q31_open(table, words, n, id);
    }
    static int init(State *state, const Table *table, uint_least32_t us) noexcept { return gtc_q31_init(state, table, us); }
    static int sample(State *state, const Table *table, uint_least32_t us, const Number *x) noexcept
    {
        return gtc_q31_sample(state, table, us, x);
    }
    static int bias(const State *state, const Table *table, Number *b) noexcept
    {
        return gtc_q31_bias(state, table, b);
    }
    static int snapshot(const State *state, const Table *table, Snapshot *all) noexcept
    {
        return gtc_q31_snapshot(state, table, all);
    }
    static int rezero(State *state, const Table *table, Number rate, uint_least32_t seconds) noexcept
    {
        return gtc_q31_rezero(state, table, rate, seconds);
    }
    static int save(const State *state, const Table *table, gtc_word_t *words) noexcept
    {
        return gtc_q31_save(state, table, words);
    }
    static int restore(State *state, const Table *table, uint_least32_t us, const gtc_word_t *words,
                       uint_least32_t off) noexcept
    {
        return gtc_q31_restore(state, table, us, words, off);
    }
    static int angle(Sum *sum, Number bias, Number dt, Number *a) noexcept { return gtc_q31_angle(sum, bias, dt, a); }
};

/* The types and functions of one arithmetic. */
template <class A> struct Runtime {
    typedef typename A::Number Number;
    typedef typename A::Table Table;
    typedef typename A::State State;
    typedef typename A::Snapshot Snapshot;
    typedef Quantity<unit::Celsius, Number> Celsius;
    typedef Quantity<unit::CelsiusPerBlock, Number> CelsiusPerBlock;
    typedef Quantity<unit::DegPerHour, Number> DegPerHour;
    typedef Quantity<unit::Time, Number> Time;
    typedef Quantity<unit::Angle, Number> Angle;

    static Status check(const Table &table) noexcept { return Status(A::check(&table)); }

    static Status check_words(const Table &table) noexcept { return Status(A::check_words(&table)); }

    static Status open(Table &table, const gtc_word_t *words, uint_least32_t n_words, uint_least32_t expected_id) noexcept
    {
        return Status(A::open(&table, words, n_words, expected_id));
    }

    /* One state and its table; owned by one task. */
    class Correction {
    public:
        Correction() noexcept : state_(), table_(nullptr) {}
        Status init(const Table &table, uint_least32_t period_us) noexcept
        {
            table_ = &table;
            return Status(A::init(&state_, table_, period_us));
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
        /* Correction, its uncertainty and more, as a filter takes them; the numbers as in gtc.h. */
        Status snapshot(Snapshot &all) const noexcept { return Status(A::snapshot(&state_, table_, &all)); }
        /* After a rest of so many seconds: the mean of the compensated rate. 0 seconds take every re-zero back. */
        Status rezero(DegPerHour mean_rate, uint_least32_t seconds) noexcept
        {
            return Status(A::rezero(&state_, table_, mean_rate.value(), seconds));
        }
        /* The state of gtc.h, to copy it or to hand it to C. */
        State &state() noexcept { return state_; }
        const State &state() const noexcept { return state_; }
        Status save(gtc_word_t (&words)[GTC_SAVE_WORDS]) const noexcept { return Status(A::save(&state_, table_, words)); }
        Status restore(const Table &table, uint_least32_t period_us, const gtc_word_t (&words)[GTC_SAVE_WORDS],
                       uint_least32_t off_blocks) noexcept
        {
            table_ = &table;
            return Status(A::restore(&state_, table_, period_us, words, off_blocks));
        }

    private:
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

typedef Runtime<F32> f32;
typedef Runtime<Q31> q31;

} // namespace gtc

#endif /* GTC_HPP_INCLUDED */
