/* step.c - one call of every step function, with every argument, on every state that the invariant allows.
 *
 * `n` of the mean is at least 1, because a block with a mean has two readings, or half of samples_per_block >= 1.
 *
 * The invariant: the intervals below. It holds after `init`; that a call keeps it is checked at the end, but for three
 * facts that relate two numbers, which no interval can say (docs/proof.md gives the argument): valid <= position <=
 * samples_per_block, position * period_us < 2^32, and means lie between the samples they are of. The mean and the slope
 * are taken by their contracts here; mean.c and slope.c show that they keep them, tests/prove/primitives_f32.c
 * that is_missing() keeps its own.
 */
#include "arithmetic.h"

/*@ assigns \result \from base, sum, n;
    ensures FINITE(\result) && LOWEST <= \result <= HIGHEST; */
static inline num_t mean_of(num_t base, wide_t sum, uint_least32_t n);

/*@ assigns \result \from state->filled;
    assigns *slope \from state->filled;
    ensures \initialized(slope);
    ensures FINITE(*slope) && -STEEPEST <= *slope <= STEEPEST;
    ensures \result == 0 || \result == 1; */
static int_least32_t window_slope(const NAME(state_t) *state, const NAME(table_t) *table, num_t *slope);

#include RUNTIME

static NAME(state_t) state;

static void any_input(uint_least32_t least_valid, uint_least32_t most_valid)
{
    NAME(input_t) *const in = &state.input[0];
    in->next_gap_us = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
    in->series_us = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
    in->candidate_us = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
    in->same_us = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
    in->received = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
    in->valid = Frama_C_unsigned_long_interval(least_valid, most_valid);
    in->held_blocks = Frama_C_unsigned_long_interval(0, THE_TABLE.guards[6].bits + 1U);
#if WITH_CHANNELS
    in->clamped = Frama_C_unsigned_long_interval(0, 3);
#endif
    in->last = ANY_PLAUSIBLE();
    in->candidate = ANY_PLAUSIBLE();
    in->base = ANY_PLAUSIBLE();
    in->mean = ANY_PLAUSIBLE();
#if defined(F32)
    in->max_change = any_number(0);
    in->sum = Frama_C_float_interval(-291.0F * MAX_BLOCK, 291.0F * MAX_BLOCK);
#else
    in->max_change = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
    in->sum = Frama_C_long_long_interval(-(290LL * 65536LL * (long long)MAX_BLOCK), 290LL * 65536LL * (long long)MAX_BLOCK);
#endif
}

/* A bias is any number; tests/prove/smt/authority.smt2 has those that are none, too. */
static void any_state(uint_least32_t least_valid, uint_least32_t most_valid)
{
    unsigned k;
    state.table_crc = THE_TABLE.crc;
    state.period_us = Frama_C_unsigned_long_interval(1, 3603600000UL);
    state.samples_per_block = Frama_C_unsigned_long_interval(1, MAX_BLOCK);
    state.position = Frama_C_unsigned_long_interval(0, MAX_BLOCK);
    state.filled = Frama_C_unsigned_long_interval(0, THE_TABLE.slope_blocks);
    state.window_valid = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
    state.status = Frama_C_interval(0, 63);
    state.bias = any_number(0);
#if WITH_TERMS
    state.elapsed = Frama_C_unsigned_long_interval(0, 0xFFFFFFUL);
    state.off_blocks = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
#endif
    state.phase_us = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
    state.repeated = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
    any_input(least_valid, most_valid);
    for (k = 0; k < GTC_MAX_SLOPE_BLOCKS; k++) {
        state.window[k] = ANY_PLAUSIBLE();
    }
}

static void invariant_holds(void)
{
    unsigned k;
    //@ check state.table_crc == THE_TABLE.crc;
    //@ check 1 <= state.samples_per_block <= MAX_BLOCK;
    //@ check state.input[0].held_blocks <= THE_TABLE.guards[6].bits + 1;
#if WITH_CHANNELS
    //@ check state.input[0].clamped <= 3;
#endif
    //@ check state.filled <= THE_TABLE.slope_blocks;
    //@ check 0 <= state.status <= 63;
    //@ check LOWEST <= state.input[0].last <= HIGHEST;
    //@ check LOWEST <= state.input[0].candidate <= HIGHEST;
    //@ check LOWEST <= state.input[0].base <= HIGHEST;
    //@ check LOWEST <= state.input[0].mean <= HIGHEST;
    /*@ loop unroll GTC_MAX_SLOPE_BLOCKS; */
    for (k = 0; k < GTC_MAX_SLOPE_BLOCKS; k++) {
        //@ check LOWEST <= state.window[k] <= HIGHEST;
    }
}

static void one_call(unsigned kind, uint_least32_t least_valid, uint_least32_t most_valid)
{
    num_t bias = 0;
    num_t channels[1];
    int status = 0;
    any_state(least_valid, most_valid);
    channels[0] = any_number(kind);
    switch (Frama_C_interval(0, 3)) {
    case 0:
        status = NAME(sample)(&state, &THE_TABLE, state.period_us, channels);
        break;
    case 1:
        status = NAME(sample)(&state, &THE_TABLE, Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL), NULL);
        break;
    case 2:
        status = NAME(sample)(&state, &THE_TABLE, Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL), channels);
        break;
    default:
        status = NAME(bias)(&state, &THE_TABLE, &bias);
        //@ check MEMBER_NUMBER(THE_TABLE.authority[0]) <= bias <= MEMBER_NUMBER(THE_TABLE.authority[1]);
        break;
    }
    //@ check 0 <= status <= 63;
    invariant_holds();
}

int main(void)
{
    unsigned kind;
    if (NAME(init)(&state, &THE_TABLE, Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL)) == 0) {
        //@ check state.table_crc == THE_TABLE.crc;
        //@ check state.position == 0 && state.status == 8;
    }
    /*@ loop unroll KINDS; */
    for (kind = 0; kind < KINDS; kind++) {
        one_call(kind, 0, 0); /* apart, because a block without a valid sample has no mean */
        one_call(kind, 1, MAX_BLOCK);
    }
    return 0;
}
