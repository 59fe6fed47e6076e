/* gtc_learn.c - learning in service, see gtc_learn.h.
 *
 * A Kalman filter of 13 states in covariance form. docs/numerics.md, section 9, gives the equations; gen/gyrotc/target/learning.py
 * is the mirror. Every operation is rounded to float by a function of its own, in the order written, so that the bits
 * are the same on every target.
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_learn.h"

#include "gtc_num_f32.h"

#define KNOTS GTC_LEARN_KNOTS
#define STATES GTC_LEARN_STATES
#define LAST_KNOT 7.0F /* GTC_LEARN_KNOTS - 1, as a float */
#define OFFSET 8U /* the states behind the knots */
#define SLOPE 9U
#define WARM 10U
#define MEMORY 11U
#define ALONG 12U /* d memory / dT */
#define SEEN 7U   /* states that a measurement sees */
#define LAYOUT 0x47544C31UL
#define EXP_UNITS 0x1.715476p+6F /* 64 / ln 2: exp(-x) = 2^(-64 x / ln 2 / 64) */
#define SMALL 1.0F /* of 2 L, below which a series does not cancel */
#define ALIKE 1.25F /* ratio of two innovations that agree */
#define HOUR_S 3600.0F
#define DAY_H 24.0F

static float plus(float a, float b)
{
    float sum;

    sum = a + b;
    return sum;
}

static float less(float a, float b)
{
    float difference;

    difference = a - b;
    return difference;
}

static float times(float a, float b)
{
    float product;

    product = a * b;
    return product;
}

static float over(float a, float b)
{
    float quotient;

    quotient = a / b;
    return quotient;
}

static float size_of(float x)
{
    return (x < 0.0F) ? -x : x;
}

static float saturate(float x, float limit)
{
    float y = x;

    if (y > limit) {
        y = limit;
    }
    if (y < -limit) {
        y = -limit;
    }
    return y;
}

/* exp(-x), x >= 0 */
static float decay(float x)
{
    return gtc_f32_exp2(times(x, EXP_UNITS));
}

/* Place of the element (i, j) of a symmetric matrix among its packed rows. */
static uint_least32_t place(uint_least32_t i, uint_least32_t j)
{
    const uint_least32_t row = (i > j) ? i : j;
    const uint_least32_t column = (i > j) ? j : i;

    return ((row * (row + 1U)) / 2U) + column;
}

/* What happens to the states between the last rest and an instant, and which of them a measurement sees then. */
typedef struct {
    float hours;
    float warm;      /* factor of the warm-up */
    float f[4];      /* transition of memory and its slope, rows */
    float q[3];      /* variance it gains: of memory, both, of the slope */
    uint_least32_t seen[SEEN];
    float h[SEEN];   /* factors of those states before the step */
} step_t;

static void knots_at(const gtc_learn_prior_t *prior, float temp_c, step_t *step)
{
    float u = times(less(temp_c, prior->low_c), prior->per_knot);
    uint_least32_t k;

    if (!(u > 0.0F)) {
        u = 0.0F;
    }
    if (u > LAST_KNOT) {
        u = LAST_KNOT;
    }
    k = (uint_least32_t)u;
    if (k > (KNOTS - 2U)) {
        k = KNOTS - 2U;
    }
    u = less(u, (float)k);
    step->seen[0] = k;
    step->seen[1] = k + 1U;
    step->h[0] = less(1.0F, u);
    step->h[1] = u;
}

/* 1 - exp(-x), x >= 0 */
static float risen(float x)
{
    float y = less(1.0F, decay(x));

    if (x < 0.0625F) { /* x (1 - x/2 (1 - x/3)), to 2^-24 of itself */
        y = times(less(1.0F, times(x, 0.25F)), 0x1.555556p-2F);
        y = times(less(1.0F, times(x, y)), 0.5F);
        y = times(x, less(1.0F, times(x, y)));
    }
    return y;
}

/* 1 - exp(-u) (1 + u + u^2/2) and 1 - exp(-u) (1 - u + u^2/2). Where u is small they cancel: there they are exp(-u) S
 * and exp(-u) (2 u + S), S = u^3/6 (1 + u/4 (1 + u/5 (1 + ... u/8))). */
static void lost_along(float u, float kept, float lost[2])
{
    const float half = times(times(u, u), 0.5F);
    float s = plus(1.0F, times(u, 0.125F));

    if (u < SMALL) {
        s = plus(1.0F, times(times(u, 0x1.24924ap-3F), s)); /* 1/7 */
        s = plus(1.0F, times(times(u, 0x1.555556p-3F), s)); /* 1/6 */
        s = plus(1.0F, times(times(u, 0x1.99999ap-3F), s)); /* 1/5 */
        s = plus(1.0F, times(times(u, 0.25F), s));
        s = times(times(times(times(u, u), u), 0x1.555556p-3F), s);
        lost[0] = times(kept, s);
        lost[1] = times(kept, plus(plus(u, u), s));
    } else {
        lost[0] = less(1.0F, times(kept, plus(plus(1.0F, u), half)));
        lost[1] = less(1.0F, times(kept, plus(less(1.0F, u), half)));
    }
}

/* Matern 3/2 along T, forgotten in time: F = exp(-s - L) [[1 + L, dT], [-l^2 dT, 1 - L]], L = l |dT|, and what keeps its
 * variance a^2 diag(1, l^2). */
static void step_memory(const gtc_learn_prior_t *prior, float dt, float d_temp, step_t *step)
{
    const float l = prior->memory_per_c;
    const float way = times(l, size_of(d_temp));
    const float kept = decay(way);
    const float forgotten = times(dt, prior->forget_per_s);
    const float both = times(decay(forgotten), kept);
    const float u = plus(way, way);
    const float kept2 = times(kept, kept);
    const float lost2 = risen(plus(forgotten, forgotten));
    const float left2 = less(1.0F, lost2);
    const float var = prior->memory_var;
    const float l2 = times(l, l);
    float lost[2];
    float cross;

    step->f[0] = times(both, plus(1.0F, way));
    step->f[1] = times(both, d_temp);
    step->f[2] = times(-l2, step->f[1]);
    step->f[3] = times(both, less(1.0F, way));
    lost_along(u, kept2, lost);
    cross = times(times(kept2, u), times(l2, d_temp)); /* exp(-2 L) 2 L l^2 dT */
    step->q[0] = times(var, plus(lost2, times(left2, lost[0])));
    step->q[1] = times(var, times(left2, cross));
    step->q[2] = times(times(var, l2), plus(lost2, times(left2, lost[1])));
}

static void step_to(const gtc_learn_state_t *state, const gtc_learn_prior_t *prior, float time_s, float temp_c,
                    step_t *step)
{
    float dt = less(time_s, state->time_s);

    if (!(dt > 0.0F)) {
        dt = 0.0F;
    }
    step->hours = over(dt, HOUR_S);
    step->warm = decay(times(dt, prior->warm_per_s));
    step_memory(prior, dt, less(temp_c, state->temp_c), step);
    knots_at(prior, temp_c, step);
    step->seen[2] = OFFSET;
    step->h[2] = 1.0F;
    step->seen[3] = SLOPE;
    step->h[3] = less(temp_c, prior->center_c);
    step->seen[4] = WARM;
    step->h[4] = step->warm;
    step->seen[5] = MEMORY;
    step->h[5] = step->f[0];
    step->seen[6] = ALONG;
    step->h[6] = step->f[1];
}

/* The covariance of the knots, some hours later. */
static void age(gtc_learn_state_t *state, const gtc_learn_prior_t *prior, float hours)
{
    uint_least32_t k;

    for (k = 0U; k < GTC_LEARN_KNOT_PAIRS; k++) {
        state->p[k] = plus(state->p[k], times(prior->ageing_var[k], hours));
    }
    state->hours = plus(state->hours, hours);
}

/* Takes the state to the instant of a step. */
static void propagate(gtc_learn_state_t *state, const gtc_learn_prior_t *prior, const step_t *step)
{
    float *const p = state->p;
    float *const own = &p[place(MEMORY, MEMORY)];
    float *const cross = &p[place(ALONG, MEMORY)];
    float *const along = &p[place(ALONG, ALONG)];
    const float f00 = step->f[0];
    const float f01 = step->f[1];
    const float f10 = step->f[2];
    const float f11 = step->f[3];
    float a;
    float b;
    float c;
    float d;
    uint_least32_t j;

    age(state, prior, step->hours);
    for (j = 0U; j < STATES; j++) {
        p[place(WARM, j)] = times(p[place(WARM, j)], step->warm);
    }
    p[place(WARM, WARM)] = times(p[place(WARM, WARM)], step->warm);
    state->x[WARM] = times(state->x[WARM], step->warm);
    for (j = 0U; j < MEMORY; j++) {
        a = p[place(MEMORY, j)];
        b = p[place(ALONG, j)];
        p[place(MEMORY, j)] = plus(times(f00, a), times(f01, b));
        p[place(ALONG, j)] = plus(times(f10, a), times(f11, b));
    }
    a = plus(times(f00, *own), times(f01, *cross)); /* F P */
    b = plus(times(f00, *cross), times(f01, *along));
    c = plus(times(f10, *own), times(f11, *cross));
    d = plus(times(f10, *cross), times(f11, *along));
    *own = plus(plus(times(a, f00), times(b, f01)), step->q[0]);
    *cross = plus(plus(times(c, f00), times(d, f01)), step->q[1]);
    *along = plus(plus(times(c, f10), times(d, f11)), step->q[2]);
    a = state->x[MEMORY];
    b = state->x[ALONG];
    state->x[MEMORY] = plus(times(f00, a), times(f01, b));
    state->x[ALONG] = plus(times(f10, a), times(f11, b));
}

/* P h of every state, and h P h. */
static float spread(const gtc_learn_state_t *state, const step_t *step, uint_least32_t n, float ph[STATES])
{
    float var = 0.0F;
    uint_least32_t j;
    uint_least32_t k;

    for (j = 0U; j < STATES; j++) {
        ph[j] = 0.0F;
        for (k = 0U; k < n; k++) {
            ph[j] = plus(ph[j], times(step->h[k], state->p[place(j, step->seen[k])]));
        }
    }
    for (k = 0U; k < n; k++) {
        var = plus(var, times(step->h[k], ph[step->seen[k]]));
    }
    return var;
}

static float expected(const gtc_learn_state_t *state, const step_t *step, uint_least32_t n)
{
    float y = 0.0F;
    uint_least32_t k;

    for (k = 0U; k < n; k++) {
        y = plus(y, times(step->h[k], state->x[step->seen[k]]));
    }
    return y;
}

/* Of the knots' covariance at first, after so many hours. */
static float aged(const gtc_learn_prior_t *prior, uint_least32_t i, uint_least32_t j, float hours)
{
    const uint_least32_t k = place(i, j);

    return plus(prior->map_var[k], times(prior->ageing_var[k], hours));
}

/* The variance of the shift of a gyro that has aged and learned nothing. */
static float prior_variance(const gtc_learn_state_t *state, const gtc_learn_prior_t *prior, const step_t *step,
                            float time_s)
{
    const uint_least32_t k = step->seen[0];
    const float warm = decay(times(time_s, prior->warm_per_s));
    const float hours = plus(state->hours, step->hours);
    float var = times(times(step->h[0], step->h[0]), aged(prior, k, k, hours));

    var = plus(var, times(times(times(step->h[0], step->h[1]), 2.0F), aged(prior, k + 1U, k, hours)));
    var = plus(var, times(times(step->h[1], step->h[1]), aged(prior, k + 1U, k + 1U, hours)));
    var = plus(var, prior->offset_var);
    var = plus(var, times(times(step->h[3], step->h[3]), prior->slope_var));
    var = plus(var, times(times(warm, warm), prior->warm_var));
    return plus(var, prior->memory_var);
}

static void clear(volatile float *x, uint_least32_t from, uint_least32_t to) /* no memset() */
{
    uint_least32_t k;

    for (k = from; k < to; k++) {
        x[k] = 0.0F;
    }
}

/* A gyro that has learned nothing. */
static void begin(gtc_learn_state_t *state, const gtc_learn_prior_t *prior)
{
    uint_least32_t k;

    clear(state->x, 0U, STATES);
    clear(state->p, 0U, GTC_LEARN_PAIRS);
    for (k = 0U; k < GTC_LEARN_KNOT_PAIRS; k++) {
        state->p[k] = plus(prior->map_var[k], 0.0F);
    }
    state->time_s = 0.0F;
    state->temp_c = prior->center_c;
    state->refused_dph = 0.0F;
    state->hours = 0.0F;
    state->power_ons = 0U;
    state->first_refused = 0U;
    state->refused = 0U;
}

int gtc_learn_start(gtc_learn_state_t *state, const gtc_learn_prior_t *prior)
{
    if ((state == NULL) || (prior == NULL)) {
        return GTC_E_ARG;
    }
    begin(state, prior);
    return GTC_OK;
}

int gtc_learn_power_on(gtc_learn_state_t *state, const gtc_learn_prior_t *prior, float off_h, float temp_c)
{
    float hours = off_h;

    if ((state == NULL) || (prior == NULL) || (gtc_f32_is_missing(temp_c) != 0)) {
        return GTC_E_ARG;
    }
    if ((gtc_f32_is_missing(off_h) != 0) || !(off_h > 0.0F)) {
        hours = prior->off_h;
    }
    age(state, prior, hours);
    clear(state->x, KNOTS, STATES);
    clear(state->p, GTC_LEARN_KNOT_PAIRS, GTC_LEARN_PAIRS);
    state->p[place(OFFSET, OFFSET)] = prior->offset_var;
    state->p[place(SLOPE, SLOPE)] = prior->slope_var;
    state->p[place(WARM, WARM)] = prior->warm_var;
    state->p[place(MEMORY, MEMORY)] = prior->memory_var;
    state->p[place(ALONG, ALONG)] = times(times(prior->memory_var, prior->memory_per_c), prior->memory_per_c);
    state->time_s = 0.0F;
    state->temp_c = temp_c;
    state->power_ons = (state->power_ons + 1U) & 0xFFFFU;
    return GTC_OK;
}

/* Variance of a stop's mean; negative: the stop is not one to learn from. */
static float stop_variance(const gtc_learn_prior_t *prior, const gtc_learn_stop_t *stop)
{
    float var = over(prior->noise_var, stop->duration_s);

    if ((stop->time_s < prior->settle_s) || (stop->span_c > prior->span_c) ||
        (gtc_f32_is_missing(stop->earth_var) != 0) || (stop->mean_var > times(prior->noisy, var))) {
        return -1.0F;
    }
    if (stop->mean_var > var) {
        var = stop->mean_var;
    }
    return plus(var, stop->earth_var);
}

static int is_stop(const gtc_learn_stop_t *stop)
{
    const int missing = gtc_f32_is_missing(stop->time_s) | gtc_f32_is_missing(stop->temp_c) |
                        gtc_f32_is_missing(stop->span_c) | gtc_f32_is_missing(stop->rate_dph) |
                        gtc_f32_is_missing(stop->duration_s) | gtc_f32_is_missing(stop->mean_var);

    return ((missing == 0) && (stop->duration_s > 0.0F) && !(stop->earth_var < 0.0F)) ? 1 : 0;
}

/* Takes note of a refused rest. Returns 1 where enough of them agree, over as many power-ons. */
static int agrees(gtc_learn_state_t *state, const gtc_learn_prior_t *prior, float innovation)
{
    const float now = size_of(innovation);
    const float before = size_of(state->refused_dph);
    const float product = times(innovation, state->refused_dph); /* 0 or less: of other signs, or none before */

    if ((state->refused == 0U) || !(product > 0.0F) || !(now < times(before, ALIKE)) ||
        !(before < times(now, ALIKE))) {
        state->refused = 0U;
        state->first_refused = state->power_ons;
    }
    if (state->refused < 255U) {
        state->refused++;
    }
    state->refused_dph = innovation;
    return ((prior->agreeing != 0U) && (state->refused >= prior->agreeing) &&
            ((((state->power_ons - state->first_refused) & 0xFFFFU) + 1U) >= prior->power_ons))
               ? 1
               : 0;
}

/* Gives f, and for a rest that others confirmed the level of the knots, the variance of an innovation. */
static void open_states(gtc_learn_state_t *state, const gtc_learn_prior_t *prior, float innovation, int level)
{
    const float square = times(innovation, innovation);
    const float along = times(times(square, prior->memory_per_c), prior->memory_per_c);
    uint_least32_t k;

    state->p[place(MEMORY, MEMORY)] = plus(state->p[place(MEMORY, MEMORY)], square);
    state->p[place(ALONG, ALONG)] = plus(state->p[place(ALONG, ALONG)], along);
    for (k = 0U; (level != 0) && (k < GTC_LEARN_KNOT_PAIRS); k++) {
        state->p[k] = plus(state->p[k], square);
    }
}

static void update(gtc_learn_state_t *state, const gtc_learn_prior_t *prior, const float ph[STATES], float var,
                   float innovation)
{
    const float inverse = over(1.0F, var);
    uint_least32_t i;
    uint_least32_t j;

    for (i = 0U; i < STATES; i++) {
        const float gain = times(ph[i], inverse);

        state->x[i] = plus(state->x[i], times(gain, innovation));
        for (j = 0U; j <= i; j++) {
            state->p[place(i, j)] = less(state->p[place(i, j)], times(gain, ph[j]));
        }
        if (!(state->p[place(i, i)] > 0.0F)) {
            state->p[place(i, i)] = 0.0F;
        }
    }
    for (i = 0U; i < KNOTS; i++) {
        state->x[i] = saturate(state->x[i], prior->authority_dph);
    }
}

/* Compares an innovation with its variance, and opens states where that is due. Returns GTC_OK, GTC_DISAGREES or
 * GTC_E_REST. */
static int judged(gtc_learn_state_t *state, const gtc_learn_prior_t *prior, float innovation, float var,
                  int_least32_t sure)
{
    const float square = times(innovation, innovation);
    int status = GTC_OK;

    if (square > times(times(prior->gate, prior->gate), var)) {
        if ((sure != 0) || !(square > times(times(prior->open_gate, prior->open_gate), var))) {
            open_states(state, prior, innovation, 0);
        } else if (agrees(state, prior, innovation) != 0) {
            open_states(state, prior, innovation, 1);
            status = GTC_DISAGREES;
        } else {
            status = GTC_E_REST;
        }
    }
    return status;
}

int gtc_learn_rest(gtc_learn_state_t *state, const gtc_learn_prior_t *prior, const gtc_learn_stop_t *stop)
{
    step_t step;
    float ph[STATES];
    float noise;
    float innovation;
    float var;
    int status = GTC_E_REST;

    if ((state == NULL) || (prior == NULL) || (stop == NULL) || (is_stop(stop) == 0)) {
        return GTC_E_ARG;
    }
    noise = stop_variance(prior, stop);
    if (!(noise > 0.0F)) {
        return GTC_E_REST;
    }
    step_to(state, prior, stop->time_s, stop->temp_c, &step);
    propagate(state, prior, &step);
    state->time_s = stop->time_s;
    state->temp_c = stop->temp_c;
    step.h[4] = 1.0F; /* the states are those of this instant now */
    step.h[5] = 1.0F;
    innovation = less(stop->rate_dph, expected(state, &step, SEEN - 1U));
    if (!(size_of(stop->rate_dph) > plus(prior->authority_dph, times(prior->gate, gtc_f32_root(noise))))) {
        var = plus(spread(state, &step, SEEN - 1U, ph), noise);
        status = judged(state, prior, innovation, var, stop->sure);
    }
    if (status >= 0) {
        var = plus(spread(state, &step, SEEN - 1U, ph), noise);
        state->refused = 0U;
        update(state, prior, ph, var, innovation);
    }
    return status;
}

int gtc_learn_shift(const gtc_learn_state_t *state, const gtc_learn_prior_t *prior, float time_s, float temp_c,
                    gtc_learn_shift_t *shift)
{
    step_t step;
    float ph[STATES];
    float before;
    float var;
    float y;

    if ((state == NULL) || (prior == NULL) || (shift == NULL) || (gtc_f32_is_missing(time_s) != 0) ||
        (gtc_f32_is_missing(temp_c) != 0)) {
        return GTC_E_ARG;
    }
    step_to(state, prior, time_s, temp_c, &step);
    y = expected(state, &step, SEEN);
    var = plus(spread(state, &step, SEEN, ph), step.q[0]);
    before = prior_variance(state, prior, &step, time_s);
    if (!(var < before)) {
        var = before;
    }
    if (gtc_f32_is_missing(y) != 0) {
        y = 0.0F;
        var = before;
    }
    shift->dph = saturate(y, prior->authority_dph);
    shift->sigma_dph = gtc_f32_root(var);
    return GTC_OK;
}

static uint_least32_t crc_of(const uint_least32_t words[GTC_LEARN_KEPT_WORDS])
{
    uint_least32_t crc = gtc_crc_word(GTC_CRC_START, LAYOUT);
    uint_least32_t k;

    for (k = 0U; k < ((uint_least32_t)GTC_LEARN_KEPT_WORDS - 1U); k++) {
        crc = gtc_crc_word(crc, words[k]);
    }
    return crc ^ GTC_CRC_FINAL;
}

/* Days begun, at most 65535. */
static uint_least32_t days_of(float hours)
{
    const float days = over(hours, DAY_H);
    uint_least32_t begun = 65535U;

    if (days < 65535.0F) {
        begun = (uint_least32_t)days;
        if ((float)begun < days) {
            begun++;
        }
    }
    return begun;
}

int gtc_learn_save(const gtc_learn_state_t *state, const gtc_learn_prior_t *prior,
                   uint_least32_t words[GTC_LEARN_KEPT_WORDS])
{
    uint_least32_t since;
    uint_least32_t k;

    if ((state == NULL) || (prior == NULL) || (words == NULL)) {
        return GTC_E_ARG;
    }
    since = (state->power_ons - state->first_refused) & 0xFFFFU;
    if (since > 255U) {
        since = 255U;
    }
    words[0] = prior->id;
    words[1] = (state->power_ons << 16) | (gtc_f32_bits(state->refused_dph) >> 16);
    words[2] = (since << 24) | (state->refused << 16) | days_of(state->hours);
    for (k = 0U; k < KNOTS; k++) {
        words[3U + k] = gtc_f32_bits(state->x[k]);
    }
    for (k = 0U; k < GTC_LEARN_KNOT_PAIRS; k++) {
        words[3U + KNOTS + k] = gtc_f32_bits(state->p[k]);
    }
    words[GTC_LEARN_KEPT_WORDS - 1] = crc_of(words);
    return GTC_OK;
}

static float number(uint_least32_t bits)
{
    gtc_word_t word;

    word.bits = bits;
    return word.value;
}

/* Whether kept words are a covariance: finite, no negative variance, no correlation beyond 1. */
static int is_covariance(const uint_least32_t words[GTC_LEARN_KNOT_PAIRS])
{
    uint_least32_t i;
    uint_least32_t j;

    for (i = 0U; i < KNOTS; i++) {
        const float own = number(words[place(i, i)]);

        for (j = 0U; j <= i; j++) {
            const float pair = number(words[place(i, j)]);
            const float most = times(own, number(words[place(j, j)]));

            if ((gtc_f32_is_missing(pair) != 0) || (own < 0.0F) || (times(pair, pair) > times(most, 0x1.004p+0F))) {
                return 0;
            }
        }
    }
    return 1;
}

int gtc_learn_restore(gtc_learn_state_t *state, const gtc_learn_prior_t *prior,
                      const uint_least32_t words[GTC_LEARN_KEPT_WORDS])
{
    uint_least32_t days;
    uint_least32_t k;

    if ((state == NULL) || (prior == NULL) || (words == NULL)) {
        return GTC_E_ARG;
    }
    days = words[2] & 0xFFFFU;
    if ((words[GTC_LEARN_KEPT_WORDS - 1] != crc_of(words)) || (is_covariance(&words[3U + KNOTS]) == 0)) {
        return GTC_E_IMAGE;
    }
    if (words[0] != prior->id) {
        return GTC_E_ID;
    }
    begin(state, prior);
    state->power_ons = words[1] >> 16;
    state->first_refused = (state->power_ons - (words[2] >> 24)) & 0xFFFFU;
    state->refused = (words[2] >> 16) & 255U;
    state->refused_dph = number((words[1] << 16) & 0xFFFFFFFFUL);
    state->hours = times((float)days, DAY_H);
    for (k = 0U; k < KNOTS; k++) {
        const float x = number(words[3U + k]);

        state->x[k] = (gtc_f32_is_missing(x) != 0) ? 0.0F : saturate(x, prior->authority_dph);
    }
    for (k = 0U; k < GTC_LEARN_KNOT_PAIRS; k++) {
        state->p[k] = number(words[3U + KNOTS + k]);
    }
    return GTC_OK;
}
