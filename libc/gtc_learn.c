/* gtc_learn.c - learning in service, see gtc_learn.h.
 *
 * A Kalman filter of 13 states in covariance form. docs/numerics.md, section 9, gives the equations; gen/gyrotc/mirror/learning.py
 * is the mirror. Every operation is rounded to float by a statement of its own, in the order written, so that the bits
 * are the same on every target.
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_learn.h"

#include "gtc_num_f32.h"

#define KNOTS GTC_LEARN_KNOTS
#define STATES GTC_LEARN_STATES
#define PAIRS GTC_LEARN_PAIRS
#define KNOT_PAIRS GTC_LEARN_KNOT_PAIRS
#define LAST_KNOT 7.0F /* GTC_LEARN_KNOTS - 1, as a float */
#define OFFSET 8U      /* the states behind the knots */
#define SLOPE 9U
#define WARM_UP 10U
#define MEMORY 11U
#define MEMORY_SLOPE 12U
#define N_OBSERVED 7U  /* states that a rate depends on: two knots, and those behind the knots */
#define BEHIND(state) ((state) - KNOTS + 2U) /* their place among these */
#define N_DRAWN (STATES - KNOTS) /* states that are drawn anew at each power-on */
#define ROW(i) (((i) * ((i) + 1U)) / 2U) /* first element of a row of a symmetric matrix, among its packed rows */
#define DIAGONAL(i) (ROW(i) + (i))
#define LEARN_LAYOUT 0x47544C32UL /* where the CRC of the kept words starts: that of another layout differs */
#define EXP2_UNITS 0x1.715476p+6F /* 64 / ln 2: exp(-x) = 2^(-64 x / ln 2 / 64) */
#define AGREEING 0.25F /* innovations differ by at most this part of the later one */
#define COUNT_MASK 255U /* of refused rests, and of power-ons since: 8 bits of the kept words */
#define LONGEST_S 3.6e9F /* in service: a century */
#define FIRST_NUMBER 3U /* of the kept words: behind id and counters */
#define LAST_WORD (GTC_LEARN_KEPT_WORDS - 1U)

static float product(float a, float b)
{
    return gtc_f32_part(a, b);
}

static float quotient(float a, float b)
{
    float q;

    q = a / b;
    return q;
}

/* sum + a b */
static float add_product(float sum, float a, float b)
{
    return gtc_f32_add(sum, product(a, b));
}

static float square(float x)
{
    return gtc_f32_squared(x);
}

static float magnitude(float x)
{
    return (x < 0.0F) ? -x : x;
}

static float within(float x, float least, float most)
{
    int_least32_t remarks = 0;

    return gtc_f32_saturate(x, least, most, &remarks);
}

/* to + factor from */
static void add_products(float *to, const float *from, uint_least32_t n, float factor)
{
    uint_least32_t k;

    for (k = 0U; k < n; k++) {
        to[k] = add_product(to[k], factor, from[k]);
    }
}

static void clear(volatile float *x, uint_least32_t n) /* no memset() */
{
    uint_least32_t k;

    for (k = 0U; k < n; k++) {
        x[k] = 0.0F;
    }
}

/* exp(-x), x >= 0 */
static float exp_minus(float x)
{
    return gtc_f32_exp2(product(x, EXP2_UNITS));
}

/* From the last rest to an instant, and how a rate depends on the states then. */
typedef struct {
    float elapsed_s;
    float warm_up;       /* factor of the warm-up */
    float memory[4];     /* transition of the memory and its slope, by rows */
    uint_least32_t knot; /* the one below T */
    float h[N_OBSERVED]; /* of the two knots about T, then of the states behind the knots */
} step_t;

static void interpolate(const gtc_learn_prior_t *prior, float temp_c, step_t *step)
{
    float u = product(gtc_f32_diff(temp_c, prior->low_c), prior->knots_per_c);
    uint_least32_t k;

    u = within(u, 0.0F, LAST_KNOT);
    k = (uint_least32_t)u;
    if (k > (KNOTS - 2U)) {
        k = KNOTS - 2U;
    }
    u = gtc_f32_diff(u, (float)k);
    step->knot = k;
    step->h[0] = gtc_f32_diff(1.0F, u);
    step->h[1] = u;
}

/* States and factors of the instant of the step itself. */
static void step_to(const gtc_learn_state_t *state, const gtc_learn_prior_t *prior, float time_s, float temp_c,
                    step_t *step)
{
    const float d_temp = gtc_f32_diff(temp_c, state->temp_c);
    const float l = prior->memory_per_c;
    const float way = product(l, magnitude(d_temp));
    float dt = gtc_f32_diff(time_s, state->time_s);
    float left;

    if (!(dt > 0.0F)) {
        dt = 0.0F;
    }
    step->elapsed_s = dt;
    step->warm_up = exp_minus(product(dt, prior->warm_up_per_s));
    left = exp_minus(add_product(way, dt, prior->memory_per_s));
    step->memory[0] = add_product(left, left, way);
    step->memory[1] = product(left, d_temp);
    step->memory[2] = product(-square(l), step->memory[1]);
    step->memory[3] = add_product(left, left, -way);
    interpolate(prior, temp_c, step);
    step->h[BEHIND(OFFSET)] = 1.0F;
    step->h[BEHIND(SLOPE)] = gtc_f32_diff(temp_c, prior->reference_c);
    step->h[BEHIND(WARM_UP)] = 1.0F;
    step->h[BEHIND(MEMORY)] = 1.0F;
}

/* The covariance of the knots, some time later. */
static void age(gtc_learn_state_t *state, const gtc_learn_prior_t *prior, float time_s)
{
    add_products(state->p, prior->ageing_var, KNOT_PAIRS, time_s);
    state->service_s = gtc_f32_add(state->service_s, time_s);
}

/* (a, b) = F (a, b) */
static void transform(const float f[4], float *a, float *b)
{
    const float c = *a;

    *a = add_product(product(f[0], c), f[1], *b);
    *b = add_product(product(f[2], c), f[3], *b);
}

/* Takes the state to the instant of a step. Memory and its slope have their covariance P0 of power-on in the long run:
 * P becomes F (P - P0) F' + P0. The state holds P - P0 of them. */
static void propagate(gtc_learn_state_t *state, const gtc_learn_prior_t *prior, const step_t *step)
{
    float *const p = state->p;
    float *const own = &p[DIAGONAL(MEMORY)];
    float *const cross = &p[ROW(MEMORY_SLOPE) + MEMORY];
    float *const slope = &p[DIAGONAL(MEMORY_SLOPE)];
    float transposed;
    uint_least32_t j;

    age(state, prior, step->elapsed_s);
    for (j = 0U; j <= WARM_UP; j++) {
        p[ROW(WARM_UP) + j] = product(p[ROW(WARM_UP) + j], step->warm_up);
        transform(step->memory, &p[ROW(MEMORY) + j], &p[ROW(MEMORY_SLOPE) + j]);
    }
    for (j = WARM_UP; j < STATES; j++) {
        p[ROW(j) + WARM_UP] = product(p[ROW(j) + WARM_UP], step->warm_up);
    }
    transposed = *cross;
    transform(step->memory, own, cross);
    transform(step->memory, &transposed, slope);
    transform(step->memory, own, &transposed);
    transform(step->memory, cross, slope);
    state->x[WARM_UP] = product(state->x[WARM_UP], step->warm_up);
    transform(step->memory, &state->x[MEMORY], &state->x[MEMORY_SLOPE]);
}

/* A state that a rate depends on. */
static uint_least32_t observed(const step_t *step, uint_least32_t i)
{
    return (i < 2U) ? (step->knot + i) : ((KNOTS - 2U) + i);
}

/* What is expected of a rate, h x, with P h and its variance h P h. */
typedef struct {
    float rate;
    float var;
    float ph[STATES];
} expected_t;

static void expect(const gtc_learn_state_t *state, const gtc_learn_prior_t *prior, const step_t *step, uint_least32_t n,
                   expected_t *expected)
{
    const float memory_var = prior->power_on_var[MEMORY - KNOTS];
    float *ph;
    float var = 0.0F;
    uint_least32_t i;
    uint_least32_t j;
    uint_least32_t k;

    expected->rate = 0.0F;
    ph = expected->ph;
    clear(ph, STATES);
    for (i = 0U; i < n; i++) {
        const float h = step->h[i];

        k = observed(step, i);
        expected->rate = add_product(expected->rate, h, state->x[k]);
        add_products(ph, &state->p[ROW(k)], k, h);
        for (j = k; j < STATES; j++) {
            ph[j] = add_product(ph[j], h, state->p[ROW(j) + k]);
        }
    }
    for (i = 0U; i < n; i++) {
        k = observed(step, i);
        var = add_product(var, step->h[i], ph[k]);
    }
    ph[MEMORY] = gtc_f32_add(ph[MEMORY], memory_var); /* P0 is not in the state */
    var = gtc_f32_add(var, memory_var);
    expected->var = (var < 0.0F) ? 0.0F : var;
}

/* Variance, or covariance, of knots for a gyro that has learned nothing. */
static float aged_var(const gtc_learn_prior_t *prior, uint_least32_t pair, float service_s)
{
    return add_product(prior->map_var[pair], prior->ageing_var[pair], service_s);
}

/* A bound on the variance of a gyro that has aged as long and learned nothing since power-on. Between two knots the
 * variance is at most the mean of theirs, weighted as their values are. */
static float unlearned_var(const gtc_learn_state_t *state, const gtc_learn_prior_t *prior, const step_t *step)
{
    const float service_s = within(gtc_f32_add(state->service_s, step->elapsed_s), 0.0F, LONGEST_S);
    const uint_least32_t k = step->knot;
    float var;
    uint_least32_t i;

    var = product(step->h[0], aged_var(prior, DIAGONAL(k), service_s));
    var = add_product(var, step->h[1], aged_var(prior, DIAGONAL(k + 1U), service_s));
    for (i = 0U; i < GTC_LEARN_DRAWN; i++) {
        var = add_product(var, square(step->h[i + 2U]), prior->power_on_var[i]);
    }
    return var;
}

/* The states that are drawn at a power-on. */
static void draw(gtc_learn_state_t *state, const gtc_learn_prior_t *prior, float temp_c)
{
    uint_least32_t k;

    clear(&state->x[KNOTS], N_DRAWN);
    clear(&state->p[KNOT_PAIRS], PAIRS - KNOT_PAIRS);
    for (k = KNOTS; k < MEMORY; k++) {
        state->p[DIAGONAL(k)] = prior->power_on_var[k - KNOTS];
    }
    state->time_s = 0.0F;
    state->temp_c = temp_c;
}

int gtc_learn_start(gtc_learn_state_t *state, const gtc_learn_prior_t *prior)
{
    volatile float *p; /* no memcpy() */
    uint_least32_t k;

    if ((state == NULL) || (prior == NULL)) {
        return GTC_E_ARG;
    }
    p = state->p;
    for (k = 0U; k < KNOT_PAIRS; k++) {
        p[k] = prior->map_var[k];
    }
    clear(state->x, KNOTS);
    draw(state, prior, prior->reference_c);
    state->refused_dph = 0.0F;
    state->service_s = 0.0F;
    state->power_ons = 0U;
    state->since_refused = 0U;
    state->refused = 0U;
    return GTC_OK;
}

static int is_plausible(float temp_c)
{
    return ((temp_c >= NUM_PLAUSIBLE_MIN) && (temp_c <= NUM_PLAUSIBLE_MAX)) ? 1 : 0;
}

int gtc_learn_power_on(gtc_learn_state_t *state, const gtc_learn_prior_t *prior, float off_s, float temp_c)
{
    if ((state == NULL) || (prior == NULL) || (is_plausible(temp_c) == 0)) {
        return GTC_E_ARG;
    }
    age(state, prior, ((off_s > 0.0F) && (off_s < LONGEST_S)) ? off_s : prior->off_s);
    draw(state, prior, temp_c);
    state->power_ons++;
    state->since_refused++;
    return GTC_OK;
}

/* Variance of a rest's mean; 0: it is not one to learn from. A member that is no number refuses it, too. */
static float rest_var(const gtc_learn_prior_t *prior, const gtc_learn_stop_t *stop)
{
    const float least = quotient(prior->noise_var, stop->duration_s);
    float var = 0.0F;

    if ((stop->time_s >= prior->settle_s) && (is_plausible(stop->temp_c) != 0) && (stop->span_c <= prior->span_c) &&
        (stop->mean_var <= product(prior->noise_ratio, least)) && (stop->earth_var >= 0.0F)) {
        var = gtc_f32_add((stop->mean_var > least) ? stop->mean_var : least, stop->earth_var);
    }
    return var;
}

/* Takes note of a refused rest. Returns 1 where enough of them agree, over as many power-ons. */
static int agrees(gtc_learn_state_t *state, const gtc_learn_prior_t *prior, float innovation)
{
    const float difference = gtc_f32_diff(innovation, state->refused_dph); /* 0: none before */

    if (!(magnitude(difference) <= product(AGREEING, magnitude(innovation)))) {
        state->refused = 0U;
        state->since_refused = 0U;
    }
    state->refused++;
    state->refused_dph = innovation;
    return ((state->refused >= prior->agreeing_rests) && (state->since_refused >= prior->agreeing_power_ons)) ? 1 : 0;
}

/* Adds the square of an innovation to the variance of the offset, or of the knots' level, which add up to it in h P h. */
static void inflate(gtc_learn_state_t *state, expected_t *expected, float square_dph, int knots)
{
    uint_least32_t k;

    if (knots != 0) {
        for (k = 0U; k < KNOT_PAIRS; k++) {
            state->p[k] = gtc_f32_add(state->p[k], square_dph);
        }
        for (k = 0U; k < KNOTS; k++) {
            expected->ph[k] = gtc_f32_add(expected->ph[k], square_dph);
        }
    } else {
        state->p[DIAGONAL(OFFSET)] = gtc_f32_add(state->p[DIAGONAL(OFFSET)], square_dph);
        expected->ph[OFFSET] = gtc_f32_add(expected->ph[OFFSET], square_dph);
    }
    expected->var = gtc_f32_add(expected->var, square_dph);
}

static void update(gtc_learn_state_t *state, const gtc_learn_prior_t *prior, const expected_t *expected,
                   float innovation)
{
    float *row = state->p;
    uint_least32_t i;

    for (i = 0U; i < STATES; i++) {
        const float gain = quotient(expected->ph[i], expected->var);

        add_products(row, expected->ph, i + 1U, -gain);
        row = &row[i + 1U];
        state->x[i] = add_product(state->x[i], gain, innovation);
        if (i < KNOTS) {
            state->x[i] = within(state->x[i], -prior->authority_dph, prior->authority_dph);
        }
    }
}

/* Compares an innovation with its variance, and inflates that of a jump. Returns the status of the rest. */
static int judged(gtc_learn_state_t *state, const gtc_learn_prior_t *prior, const gtc_learn_stop_t *stop,
                  expected_t *expected, float innovation)
{
    const float square_dph = square(innovation);
    int status = GTC_OK;

    if (!(magnitude(stop->rate_dph) <= prior->authority_dph)) {
        status = GTC_E_REST;
    } else if (!(square_dph <= product(prior->gate_square, expected->var))) {
        if ((stop->confirmed == 0) && !(square_dph <= product(prior->jump_square, expected->var))) {
            status = GTC_E_REST;
            if (agrees(state, prior, innovation) != 0) {
                status = GTC_DISAGREES;
            }
        }
        if (status >= 0) {
            inflate(state, expected, square_dph, (status == GTC_DISAGREES) ? 1 : 0);
        }
    } else {
        status = GTC_OK; /* MISRA 15.7 */
    }
    return status;
}

int gtc_learn_rest(gtc_learn_state_t *state, const gtc_learn_prior_t *prior, const gtc_learn_stop_t *stop)
{
    step_t step;
    expected_t expected;
    float noise;
    float innovation;
    int status;

    if ((state == NULL) || (prior == NULL) || (stop == NULL)) {
        return GTC_E_ARG;
    }
    noise = rest_var(prior, stop);
    if (!(noise > 0.0F) || !(noise <= NUM_MOST)) {
        return GTC_E_REST;
    }
    step_to(state, prior, stop->time_s, stop->temp_c, &step);
    propagate(state, prior, &step);
    state->time_s = stop->time_s;
    state->temp_c = stop->temp_c;
    expect(state, prior, &step, N_OBSERVED - 1U, &expected);
    innovation = gtc_f32_diff(stop->rate_dph, expected.rate);
    expected.var = gtc_f32_add(expected.var, noise);
    status = judged(state, prior, stop, &expected, innovation);
    if (status >= 0) {
        state->refused_dph = 0.0F;
        update(state, prior, &expected, innovation);
    }
    return status;
}

int gtc_learn_shift(const gtc_learn_state_t *state, const gtc_learn_prior_t *prior, float time_s, float temp_c,
                    gtc_learn_shift_t *shift)
{
    step_t step;
    expected_t expected;
    float unlearned;
    float var;
    float y;

    if ((state == NULL) || (prior == NULL) || (shift == NULL) || (is_plausible(temp_c) == 0)) {
        return GTC_E_ARG;
    }
    step_to(state, prior, time_s, temp_c, &step);
    unlearned = unlearned_var(state, prior, &step);
    step.h[BEHIND(WARM_UP)] = step.warm_up;
    step.h[BEHIND(MEMORY)] = step.memory[0];
    step.h[BEHIND(MEMORY_SLOPE)] = step.memory[1];
    expect(state, prior, &step, N_OBSERVED, &expected);
    y = expected.rate;
    var = expected.var;
    if (gtc_f32_is_missing(y) != 0) {
        y = 0.0F;
        var = unlearned;
    }
    shift->dph = within(y, -prior->authority_dph, prior->authority_dph);
    shift->sigma_dph = gtc_f32_root((var < unlearned) ? var : unlearned);
    return GTC_OK;
}

static uint_least32_t crc_of(const gtc_word_t words[GTC_LEARN_KEPT_WORDS])
{
    return gtc_crc_words(LEARN_LAYOUT, words, LAST_WORD) ^ GTC_CRC_FINAL;
}

int gtc_learn_save(const gtc_learn_state_t *state, const gtc_learn_prior_t *prior, gtc_word_t words[GTC_LEARN_KEPT_WORDS])
{
    uint_least32_t k;

    if ((state == NULL) || (prior == NULL) || (words == NULL)) {
        return GTC_E_ARG;
    }
    words[0].bits = prior->id;
    words[1].bits = ((state->power_ons & 0xFFFFU) << 16) | ((state->since_refused & COUNT_MASK) << 8) |
                    (state->refused & COUNT_MASK);
    words[2].bits = ((gtc_f32_bits(state->service_s) + 0xFFFFU) & 0xFFFF0000UL) | (gtc_f32_bits(state->refused_dph) >> 16);
    for (k = 0U; k < KNOTS; k++) {
        words[FIRST_NUMBER + k].value = state->x[k];
    }
    for (k = 0U; k < KNOT_PAIRS; k++) {
        words[FIRST_NUMBER + KNOTS + k].value = state->p[k];
    }
    words[LAST_WORD].bits = crc_of(words);
    return GTC_OK;
}

int gtc_learn_restore(gtc_learn_state_t *state, const gtc_learn_prior_t *prior,
                      const gtc_word_t words[GTC_LEARN_KEPT_WORDS])
{
    gtc_word_t half;
    uint_least32_t k;

    if ((state == NULL) || (prior == NULL) || (words == NULL)) {
        return GTC_E_ARG;
    }
    if (words[LAST_WORD].bits != crc_of(words)) {
        return GTC_E_IMAGE;
    }
    for (k = FIRST_NUMBER; k < LAST_WORD; k++) {
        if (gtc_f32_is_missing(words[k].value) != 0) {
            return GTC_E_IMAGE;
        }
    }
    if (words[0].bits != prior->id) {
        return GTC_E_ID;
    }
    draw(state, prior, prior->reference_c);
    state->power_ons = words[1].bits >> 16;
    state->since_refused = (words[1].bits >> 8) & COUNT_MASK;
    state->refused = words[1].bits & COUNT_MASK;
    half.bits = words[2].bits & 0xFFFF0000UL;
    state->service_s = half.value;
    half.bits = (words[2].bits << 16) & 0xFFFFFFFFUL;
    state->refused_dph = half.value;
    for (k = 0U; k < KNOTS; k++) {
        state->x[k] = within(words[FIRST_NUMBER + k].value, -prior->authority_dph, prior->authority_dph);
    }
    for (k = 0U; k < KNOT_PAIRS; k++) {
        state->p[k] = words[FIRST_NUMBER + KNOTS + k].value;
    }
    return GTC_OK;
}
