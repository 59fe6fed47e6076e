/* sigma.c - the snapshot, and a rest of any rate and length, on every state with any table that `init` accepts.
 *
 * The bound: whatever the state, the rate and the time, the shift stays within the table's `rezero`, here 1 deg/h or
 * 2^20 units, where it starts (`init`: 0) or is put by `restore`.
 */
#define RANGES_BY_CONTRACT
#include "arithmetic.h"

#if defined(F32)
/*@ requires n >= 1; assigns \result \from x, range[0 .. 1], n; ensures \result <= n - 1; */
static inline uint_least32_t cell_of(float x, const gtc_word_t *range, uint_least32_t n);
#define BOUND 1.0F
#else
/*@ assigns \result \from x, range[0 .. 1];
    assigns *position \from x, range[0 .. 1], gain;
    ensures \initialized(position) && *position <= 65535;
    ensures \result == 0 || \result == 2 || \result == -1; */
static inline int position_of(int_least32_t x, const int_least32_t range[2], int_least32_t gain,
                              uint_least32_t *position);
#define BOUND 1048576L
#endif

#include RUNTIME
#include "any_table.h"

#define CELLS 6U

static gtc_word_t any_sigma[(2U * CELLS) + GTC_SIGMA_RULES + GTC_MAX_TERMS];
static NAME(state_t) state;

static void any_uncertainty(void)
{
    unsigned i;
    /*@ loop unroll 32; */
    for (i = 0; i < ((2U * CELLS) + GTC_SIGMA_RULES + GTC_MAX_TERMS); i++) {
        NUMBER(any_sigma[i]) = ANY_IN(sigma_limits[0]);
    }
    any.sigma = any_sigma;
    any.sigma_cells[0] = 3U;
    any.sigma_cells[1] = 2U;
    any.n_sigma = (2U * CELLS) + GTC_SIGMA_RULES + GTC_MAX_TERMS;
    MEMBER_OF(any.rezero) = BOUND;
}

static void any_state(void)
{
    unsigned i;
    state.table_crc = THE_TABLE.crc;
    state.period_us = Frama_C_unsigned_long_interval(1, 0xFFFFFFFFUL);
    state.samples_per_block = Frama_C_unsigned_long_interval(1, MAX_BLOCK);
    state.status = Frama_C_interval(0, 63);
    state.input[0].held_blocks = Frama_C_unsigned_long_interval(0, 100001);
    state.elapsed = Frama_C_unsigned_long_interval(0, 0xFFFFFFUL);
    state.bias = any_number(0);
#if defined(F32)
    state.shift = Frama_C_float_interval(-BOUND, BOUND);
#else
    state.shift = (int_least32_t)Frama_C_long_interval(-BOUND, BOUND);
#endif
    state.shift_sigma = any_number(0);
    state.uncertainty.input[0] = any_number(0);
    state.uncertainty.input[1] = any_number(0);
    state.uncertainty.slope = any_number(0);
    state.uncertainty.lowest = ANY_PLAUSIBLE();
    state.uncertainty.highest = ANY_PLAUSIBLE();
    state.unshifted = any_number(0);
    state.uncertainty.edge_effect = any_number(0);
    state.uncertainty.missing = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
    state.uncertainty.terms_since = Frama_C_unsigned_long_interval(0, 0xFFFFFFUL);
    state.uncertainty.terms_known = Frama_C_unsigned_long_interval(0, 15);
    state.uncertainty.slope_known = Frama_C_unsigned_long_interval(0, 2);
    /*@ loop unroll 4; */
    for (i = 0; i < GTC_MAX_TERMS; i++) {
        state.term[i][0] = any_number((unsigned)Frama_C_interval(0, KINDS - 1));
    }
}

int main(void)
{
    unsigned kind;
    any_table();
    any_uncertainty();
    /*@ loop unroll KINDS; */
    for (kind = 0; kind < KINDS; kind++) {
        NAME(snapshot_t) snapshot;
        int status;
        any_state();
        status = NAME(snapshot)(&state, &THE_TABLE, &snapshot);
        //@ check status >= 0;
        //@ check snapshot.sigma >= 0;
        status = NAME(rezero)(&state, &THE_TABLE, any_number(kind), Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL));
        //@ check status == -8 || status == -1 || status == 0 || status == 2;
        //@ check -BOUND <= state.shift <= BOUND;
        status = NAME(rezero)(&state, &THE_TABLE, any_number(kind), 0U);
        //@ check status == 0 && state.shift == 0;
    }
    return 0;
}
