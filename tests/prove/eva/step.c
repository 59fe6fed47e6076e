/* step.c - one call of every step function, with every argument, on every state that the invariant allows.
 *
 * `n` of the mean is at least 1, because 2 valid >= samples_per_block >= 1 there.
 *
 * The invariant: the intervals below. It holds after `init`; that a call keeps it is checked at the end, but for three
 * facts that relate two numbers, which no interval can say (docs/proof.md gives the argument): valid <= position <=
 * samples_per_block, gap + count <= 65535, and means lie between the samples they are of. The mean and the slope
 * are taken by their contracts here; mean.c and slope.c show that they keep them, tests/prove/primitives_f32.c
 * that gtc_f32_is_missing() keeps its own.
 */
#include "arithmetic.h"

/*@ assigns \result \from base, sum, n;
    ensures FINITE(\result) && LOWEST <= \result <= HIGHEST; */
static inline num_t NAME(mean)(num_t base, wide_t sum, uint_least32_t n);

/*@ assigns \result \from state->filled;
    assigns *slope \from state->filled;
    ensures \initialized(slope);
    ensures FINITE(*slope) && -STEEPEST <= *slope <= STEEPEST;
    ensures \result == 0 || \result == 1; */
static int_least32_t NAME(window_slope)(const NAME(state_t) *state, num_t *slope);

#if defined(F32)
/*@ assigns \result \from x;
    behavior number: assumes \is_finite(x); ensures \result == 0;
    behavior missing: assumes !\is_finite(x); ensures \result == 1;
    complete behaviors; */
static inline int gtc_f32_is_missing(float x);
#endif

#include "gtc.c"

static NAME(state_t) state;

static void any_state(uint_least32_t least_valid, uint_least32_t most_valid)
{
    unsigned k;
    state.table = &THE_TABLE;
    state.samples_per_block = Frama_C_unsigned_long_interval(1, MAX_BLOCK);
    state.position = Frama_C_unsigned_long_interval(0, MAX_BLOCK);
    state.valid = Frama_C_unsigned_long_interval(least_valid, most_valid);
    state.gap = Frama_C_unsigned_long_interval(0, 65535);
    state.suspects = Frama_C_unsigned_long_interval(0, 2);
    state.received = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
    state.period_us = Frama_C_unsigned_long_interval(1, 0xFFFFFFFFUL);
    state.repeats = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
    state.held_blocks = Frama_C_unsigned_long_interval(0, THE_TABLE.guards[6].bits + 1U);
    state.filled = Frama_C_unsigned_long_interval(0, THE_TABLE.slope_blocks);
    state.window_valid = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
    state.status = Frama_C_interval(0, 31);
    state.last = ANY_PLAUSIBLE();
    state.candidate = ANY_PLAUSIBLE();
    state.base = ANY_PLAUSIBLE();
    state.mean = ANY_PLAUSIBLE();
    state.bias = any_number(0);
#if defined(F32)
    state.step_per_sample = Frama_C_float_interval(0.0F, 1.0e9F);
    state.sum = Frama_C_float_interval(-291.0F * MAX_BLOCK, 291.0F * MAX_BLOCK);
#else
    state.step_per_sample = (int_least32_t)Frama_C_long_interval(0, 2147483647L);
    state.sum = Frama_C_long_long_interval(-(290LL * 65536LL * (long long)MAX_BLOCK), 290LL * 65536LL * (long long)MAX_BLOCK);
#endif
    for (k = 0; k < GTC_MAX_SLOPE_BLOCKS; k++) {
        state.window[k] = ANY_PLAUSIBLE();
    }
}

static void invariant_holds(void)
{
    unsigned k;
    //@ check state.table == &THE_TABLE;
    //@ check 1 <= state.samples_per_block <= MAX_BLOCK;
    //@ check state.suspects <= 2;
    //@ check state.held_blocks <= THE_TABLE.guards[6].bits + 1;
    //@ check state.filled <= THE_TABLE.slope_blocks;
    //@ check 0 <= state.status <= 31;
    //@ check LOWEST <= state.last <= HIGHEST;
    //@ check LOWEST <= state.candidate <= HIGHEST;
    //@ check LOWEST <= state.base <= HIGHEST;
    //@ check LOWEST <= state.mean <= HIGHEST;
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
    switch (Frama_C_interval(0, 2)) {
    case 0:
        status = NAME(sample)(&state, channels);
        break;
    case 1:
        status = NAME(missed)(&state, Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL));
        break;
    default:
        status = NAME(bias)(&state, &bias);
        break;
    }
    //@ check 0 <= status <= 31;
    invariant_holds();
}

int main(void)
{
    unsigned kind;
    if (NAME(init)(&state, &THE_TABLE, Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL)) == 0) {
        //@ check state.table == &THE_TABLE;
        //@ check 1 <= state.samples_per_block <= MAX_BLOCK;
        //@ check state.position == 0 && state.valid == 0 && state.gap == 0 && state.status == 8;
    }
    /*@ loop unroll KINDS; */
    for (kind = 0; kind < KINDS; kind++) {
        one_call(kind, 0, 0); /* apart, because a block without a valid sample has no mean */
        one_call(kind, 1, MAX_BLOCK);
    }
    return 0;
}
