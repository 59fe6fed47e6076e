/* terms.c - every function of every extension term of the table, on every state.
 *
 * The step functions call them with a temperature within the envelope, which is within ENVELOPE_LEAST to ENVELOPE_MOST
 * and may lie beyond every plausible reading; they touch nothing but the state of their own term. The state of a memory
 * is any number at all: beyond FOLLOWED it begins again. A play is as far from such a temperature as it is wide; the
 * mean of a channel is a number. docs/proof.md argues that a memory moves towards its argument and no farther, and
 * that a mean lies between its samples; follow.c shows that the first has no error.
 */
#include "arithmetic.h"

#if !GTC_WITH_MEMORY
/* There is none that could be followed. */
#elif defined(F32)
/*@ assigns z[0 .. 1] \from z[0 .. 1], x, gain;
    ensures FINITE(z[0]) && -FOLLOWED <= z[0] <= FOLLOWED; */
static inline void follow_memory(float z[2], float x, float gain);
#else
/*@ assigns z[0 .. 1] \from z[0 .. 1], x, gain;
    ensures -FOLLOWED <= z[0] <= FOLLOWED && 0 <= z[1] <= 65535; */
static inline void follow_memory(int_least32_t z[2], int_least32_t x, int_least32_t gain);
#endif

/*@ assigns \result \from base, sum, n;
    ensures FINITE(\result); */
static inline num_t mean_of(num_t base, wide_t sum, uint_least32_t n);

#if defined(ANY_TABLE) && !defined(F32)
/* As in map.c. */
/*@ assigns \result \from x, range[0 .. 1];
    assigns *position \from x, range[0 .. 1], gain;
    ensures \initialized(position) && *position <= 65535;
    ensures \result == 0 || \result == 2 || \result == -1; */
static inline int position_of(int_least32_t x, const int_least32_t range[2], int_least32_t gain,
                              uint_least32_t *position);
#endif

#include RUNTIME
#include "any_table.h"

static NAME(state_t) state;

#if GTC_WITH_PLAY
static num_t width_of(unsigned i)
{
    return NUMBER(THE_TABLE.terms[(i * GTC_TERM_WORDS) + TERM_PARAMETERS + PLAY_WIDTH]);
}
#endif

/* Everything about term i that its functions may read. */
static void any_term(unsigned i)
{
    const unsigned long kind = THE_TABLE.terms[i * GTC_TERM_WORDS].bits;
    state.samples_per_block = Frama_C_unsigned_long_interval(1, MAX_BLOCK);
    state.elapsed = Frama_C_unsigned_long_interval(0, 0xFFFFFFUL);
    state.off_blocks = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
#if WITH_RETAINED
    state.term[i][0] = any_number(Frama_C_unsigned_int_interval(0, KINDS - 1U));
    state.term[i][1] = any_number(0);
#endif
#if GTC_WITH_PLAY
    if (kind == GTC_TERM_PLAY) {
        const num_t width = width_of(i);
#if defined(F32)
        state.term[i][0] = Frama_C_float_interval(ENVELOPE_LEAST - width, ENVELOPE_MOST + width);
#else
        state.term[i][0] = (int_least32_t)Frama_C_long_interval(ENVELOPE_LEAST - width, ENVELOPE_MOST + width);
#endif
    }
#endif
#if WITH_CHANNELS
    if (((CHANNEL_KINDS >> kind) & 1U) != 0U) {
        NAME(input_t) *const in = &state.input[THE_TABLE.terms[(i * GTC_TERM_WORDS) + 1U].bits & 0xFFFFU];
        in->next_gap_us = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
        in->held_blocks = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
        in->clamped = Frama_C_unsigned_long_interval(0, 3);
        in->mean = any_number(0);
    }
#else
    (void)kind;
#endif
}

static void invariant_holds(unsigned i, unsigned call)
{
    const unsigned long kind = THE_TABLE.terms[i * GTC_TERM_WORDS].bits;
    (void)kind;
    (void)call;
#if GTC_WITH_PLAY && !defined(ANY_TABLE) /* relates two numbers there */
    if (kind == GTC_TERM_PLAY) {
        const num_t least = (num_t)(ENVELOPE_LEAST - width_of(i)); /* rounded as the runtime rounds it */
        const num_t most = (num_t)(ENVELOPE_MOST + width_of(i));
        //@ check least <= state.term[i][0] <= most;
    }
#endif
#if GTC_WITH_MEMORY
    if ((kind == GTC_TERM_MEMORY) && (call < 2U)) {
        //@ check -FOLLOWED <= state.term[i][0] <= FOLLOWED;
    }
#endif
}

static void one_call(unsigned i, unsigned call)
{
    EFFECT effect;
    any_term(i);
    if (call == 0U) {
#if WITH_RETAINED
        begin_term(&state, &THE_TABLE, i, ANY_IN_ENVELOPE());
    } else if (call == 1U) {
        step_term(&state, &THE_TABLE, i, ANY_IN_ENVELOPE());
#endif
    } else {
        effect.temp = ANY_IN_ENVELOPE();
        effect.slope = any_number(0);
        effect.remarks = Frama_C_interval(0, 63);
        effect.edge_effect = any_number(0);
        effect.terms_known = Frama_C_unsigned_long_interval(0, 15);
#if defined(F32)
        effect.added = any_number(0);
#else
        effect.added = Frama_C_long_long_interval(-0x1000000000000000LL, 0x1000000000000000LL);
#endif
        apply_term(&state, &THE_TABLE, i, ANY_IN_ENVELOPE(), &effect);
        (void)saturate(effect.added, MEMBER_NUMBER(THE_TABLE.effect[0]), MEMBER_NUMBER(THE_TABLE.effect[1]),
                       &effect.remarks);
    }
    invariant_holds(i, call);
}

int main(void)
{
    unsigned i;
    unsigned call;
    any_table();
    /*@ loop unroll GTC_MAX_TERMS; */
    for (i = 0; i < THE_TABLE.n_terms; i++) {
        /*@ loop unroll 3; */
        for (call = 0; call < 3U; call++) {
            one_call(i, call);
        }
    }
    return 0;
}
