/* learn.c - one call of every function of the learning unit, on every state, with every stop, time and image.
 *
 * The bounds: whatever the state holds, the shift lies within the prior's authority, sigma is a number that is not
 * negative. Each knot lies within the authority where it starts (0) or is put by `restore`, and a rest keeps it there. The prior is the generator's: numbers within
 * the intervals below; its authority is 1 deg/h.
 */
#define RANGES_BY_CONTRACT
#include "arithmetic.h"

#include "gtc.c"

#define BOUND 1.0F

static gtc_learn_prior_t prior;
static gtc_learn_state_t state;

static void any_prior(void)
{
    unsigned i;
    prior.id = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
    prior.low_c = Frama_C_float_interval(-200.0F, 400.0F);
    prior.knots_per_c = Frama_C_float_interval(0x1p-10F, 1.0e6F);
    prior.reference_c = Frama_C_float_interval(-200.0F, 400.0F);
    prior.authority_dph = BOUND;
    prior.memory_per_c = Frama_C_float_interval(1.0e-6F, 1.0e6F);
    prior.memory_per_s = Frama_C_float_interval(0.0F, 1.0e6F);
    prior.warm_up_per_s = Frama_C_float_interval(0.0F, 1.0e6F);
    prior.off_s = Frama_C_float_interval(0.0F, 1.0e9F);
    prior.noise_var = Frama_C_float_interval(0.0F, 1.0e14F);
    prior.noise_ratio = Frama_C_float_interval(1.0F, 100.0F);
    prior.span_c = Frama_C_float_interval(0.0F, 1.0e6F);
    prior.settle_s = Frama_C_float_interval(0.0F, 1.0e6F);
    prior.gate_square = Frama_C_float_interval(0.0F, 1.0e12F);
    prior.jump_square = Frama_C_float_interval(0.0F, 1.0e12F);
    prior.agreeing_rests = Frama_C_unsigned_long_interval(1, 255);
    prior.agreeing_power_ons = Frama_C_unsigned_long_interval(0, 254);
    for (i = 0; i < GTC_LEARN_DRAWN; i++) {
        prior.power_on_var[i] = Frama_C_float_interval(0.0F, 1.0e14F);
    }
    for (i = 0; i < GTC_LEARN_KNOT_PAIRS; i++) {
        prior.map_var[i] = Frama_C_float_interval(-1.0e20F, 1.0e20F);
        prior.ageing_var[i] = Frama_C_float_interval(-1.0e18F, 1.0e18F);
    }
}

/* Any number, also one that is missing; each call is analysed for both. */
static float number_or_not(void)
{
    return any_number((unsigned)Frama_C_interval(0, KINDS - 1));
}

static void any_state(void)
{
    unsigned i;
    for (i = 0; i < GTC_LEARN_STATES; i++) {
        state.x[i] = number_or_not();
    }
    for (i = 0; i < GTC_LEARN_PAIRS; i++) {
        state.p[i] = number_or_not();
    }
    state.time_s = number_or_not();
    state.temp_c = number_or_not();
    state.refused_dph = number_or_not();
    state.service_s = number_or_not();
    state.power_ons = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
    state.since_refused = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
    state.refused = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
}

static int any_rest(void)
{
    gtc_learn_stop_t stop;
    stop.time_s = number_or_not();
    stop.temp_c = number_or_not();
    stop.span_c = number_or_not();
    stop.rate_dph = number_or_not();
    stop.duration_s = number_or_not();
    stop.mean_var = number_or_not();
    stop.earth_var = number_or_not();
    stop.confirmed = Frama_C_interval(0, 1);
    return gtc_learn_rest(&state, &prior, &stop);
}

int main(void)
{
    static gtc_word_t words[GTC_LEARN_KEPT_WORDS];
    gtc_learn_shift_t shift;
    unsigned i;
    int status;

    any_prior();
    any_state();
    status = gtc_learn_shift(&state, &prior, number_or_not(), Frama_C_float_interval(LOWEST, HIGHEST), &shift);
    //@ check status == 0;
    //@ check -BOUND <= shift.dph <= BOUND;
    //@ check shift.sigma_dph >= 0;
    status = gtc_learn_shift(&state, &prior, number_or_not(), Frama_C_float_interval(200.001F, 0x1.fffffep127F), &shift);
    //@ check status == -1;
    status = gtc_learn_shift(&state, &prior, number_or_not(), Frama_C_float_interval(-0x1.fffffep127F, -90.001F), &shift);
    //@ check status == -1;
    status = any_rest();
    //@ check status == -8 || status == 0 || status == 64;
    any_state();
    for (i = 0; i < GTC_LEARN_KNOTS; i++) {
        state.x[i] = Frama_C_float_interval(-BOUND, BOUND);
    }
    status = any_rest();
    /*@ loop unroll 8; */
    for (i = 0; i < GTC_LEARN_KNOTS; i++) {
        //@ check -BOUND <= state.x[i] <= BOUND;
    }
    any_state();
    status = gtc_learn_power_on(&state, &prior, number_or_not(), number_or_not());
    //@ check status == -1 || status == 0;
    any_state();
    status = gtc_learn_save(&state, &prior, words);
    //@ check status == 0;
    /*@ loop unroll 48; */
    for (i = 0; i < GTC_LEARN_KEPT_WORDS; i++) {
        words[i].bits = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
    }
    for (i = 0; i < GTC_LEARN_KNOTS; i++) {
        state.x[i] = Frama_C_float_interval(-BOUND, BOUND); /* a refused image leaves them */
    }
    status = gtc_learn_restore(&state, &prior, words);
    //@ check status == -5 || status == -4 || status == 0;
    /*@ loop unroll 8; */
    for (i = 0; i < GTC_LEARN_KNOTS; i++) {
        //@ check -BOUND <= state.x[i] <= BOUND;
    }
    return 0;
}
