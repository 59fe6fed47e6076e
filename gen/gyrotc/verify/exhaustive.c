/* exhaustive.c - every pair of positions of a fixed-point table through the emitted code.
 *
 * Compiled with gtc_q31.c and the table; TABLE and HEADER name the table. For each of the 2^16 x 2^16
 * pairs of positions (those that an input can reach) it calls gtc_q31_map() and compares
 *   - status and bits with integers computed here from the words on standard input, written from
 *     docs/numerics.md and not from libc/;
 *   - the bias with the model in float64, at the middle of the pair's cell of inputs (arithmetic)
 *     and at its four corners (arithmetic and rounding of the inputs).
 * It takes part `part` of `parts`, a band of slopes, so that several processes share the work.
 *
 * In (text): see the calls of number() and real() in main().
 * Out: "progress k" per slice; mismatches; then one line of results.
 */
#include <inttypes.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include HEADER

#define POSITIONS 65536
#define SLICE 512 /* slopes at a time: their factors stay in the cache */
#define CUT 0x20000000U
#define SHOWN 5

typedef struct {
    int64_t low, high, gain; /* 2^-16 C, 2^-27 */
    double least, most;      /* the model's envelope, C */
    double zero, half;       /* its normalisation */
    int32_t input[POSITIONS]; /* an input for each position */
    int reached[POSITIONS];
} axis_t;

typedef struct {
    int64_t s[2], k[2], w;
    double c[2], inverse[2], weight; /* the model's: normalised center, 1/width (0: infinite), deg/h */
} center_t;

static axis_t axes[2];
static center_t *centers;
static int n_integer, n_model; /* the table may leave out a Gaussian that is nowhere felt */
static int64_t w0, linear[2], narrow, entries[64];
static double unit, model_w0, model_linear[2];
static int64_t cells[2];
static uint32_t *coverage;

static uint64_t visited, mismatches;
static double worst_middle, worst_corner, sum_of_errors;

static int64_t number(void)
{
    int64_t value;
    if (scanf("%" SCNd64, &value) != 1) {
        exit(2);
    }
    return value;
}

static double real(void)
{
    double value;
    if (scanf("%lf", &value) != 1) {
        exit(2);
    }
    return value;
}

static void *room(size_t n, size_t size)
{
    void *const memory = calloc(n + 1U, size);
    if (memory == NULL) {
        exit(2);
    }
    return memory;
}

/* ---- inputs ---- */

/* The smallest input of each position, by the rule position = (offset * gain) >> 27. */
static void find_inputs(axis_t *axis)
{
    int64_t x;
    for (x = 0; x < POSITIONS; x++) {
        const int64_t offset = ((x << 27) + axis->gain - 1) / axis->gain;
        axis->reached[x] = (axis->low + offset <= axis->high) && (((offset * axis->gain) >> 27) == x);
        axis->input[x] = (int32_t)(axis->low + offset);
    }
}

/* Normalised input of the model at a position (edges at whole numbers, middles at halves). */
static double normalised(const axis_t *axis, double position)
{
    const double inputs = fmin((double)axis->low + ldexp(position, 27) / (double)axis->gain, (double)axis->high);
    return (fmin(fmax(inputs / 65536.0, axis->least), axis->most) - axis->zero) / axis->half;
}

/* ---- factors of the model's Gaussians: f[center][place], places 2x: edge of x, 2x + 1: its middle ---- */

static double *factors(int a, int first, int count)
{
    const size_t places = 2U * (size_t)count + 1U;
    double *const f = room((size_t)(n_model + 1) * places, sizeof *f);
    size_t i;
    int c;
    for (i = 0; i < places; i++) {
        const double z = normalised(&axes[a], first + 0.5 * (double)i);
        for (c = 0; c < n_model; c++) {
            const double d = (z - centers[c].c[a]) * centers[c].inverse[a];
            f[(size_t)c * places + i] = exp(-d * d);
        }
        f[(size_t)n_model * places + i] = model_linear[a] * z; /* the linear part goes along */
    }
    return f;
}

/* ---- integers ---- */

static void reference_row(int64_t x_t, const uint64_t *restrict squares, const int64_t *restrict start, int count,
                          int64_t *restrict sum)
{
    const int64_t row = linear[0] * x_t * 8192;
    int c, j;
    for (j = 0; j < count; j++) {
        sum[j] = row + start[j];
    }
    for (c = 0; c < n_integer; c++) {
        const int64_t argument = centers[c].s[0] * x_t + centers[c].k[0];
        const uint64_t square = (uint64_t)(argument * argument);
        const uint64_t *restrict other = &squares[(size_t)c * SLICE];
        const int64_t w = centers[c].w;
        for (j = 0; j < count; j++) {
            const uint64_t u = (square + other[j]) >> (32 - narrow);
            const uint64_t v = 1557473452U - ((u & 0x3FFFFU) << 6);
            const uint64_t square = ((v * v) >> 32) + 558709134U;
            const uint64_t e = (((uint64_t)entries[(u >> 18) & 63U] * square) >> 32) >> ((u >> 24) & 63U);
            sum[j] += (u < CUT) ? w * (int64_t)e : 0;
        }
    }
}

static int reference_status(int64_t x_t, int64_t x_r)
{
    int64_t index;
    if (cells[0] == 0) {
        return 0;
    }
    index = ((x_r * cells[1]) >> 16) * cells[0] + ((x_t * cells[0]) >> 16);
    return ((coverage[index / 32] >> (index % 32)) & 1U) ? 0 : 4;
}

/* ---- the comparison ---- */

static void compare(int64_t x_t, int64_t x_r, int64_t sum, int32_t *bias)
{
    const int32_t want = (int32_t)(w0 + (sum >> 29));
    const int want_status = reference_status(x_t, x_r);
    int_least32_t got = 0;
    const int status = gtc_q31_map(&TABLE, axes[0].input[x_t], axes[1].input[x_r], &got);
    if ((status != want_status) || (got != want)) {
        if (mismatches < SHOWN) {
            printf("differs T %" PRId32 " slope %" PRId32 ": status %d bits %08" PRIx32 ", reference %d %08" PRIx32 "\n",
                   axes[0].input[x_t], axes[1].input[x_r], status, (uint32_t)got, want_status, (uint32_t)want);
        }
        mismatches++;
    }
    *bias = (int32_t)got;
    visited++;
}

/* The model along a row, at places first .. last of this slice in steps of two. */
static void model_row(const double *a, size_t stride, const double *b, size_t places, int first, int count,
                      double *restrict value)
{
    const double start = model_w0 + a[(size_t)n_model * stride];
    int c, j;
    for (j = 0; j < count; j++) {
        value[j] = start + b[(size_t)n_model * places + (size_t)(first + 2 * j)];
    }
    for (c = 0; c < n_model; c++) {
        const double factor = centers[c].weight * a[(size_t)c * stride];
        const double *restrict other = &b[(size_t)c * places + (size_t)first];
        for (j = 0; j < count; j++) {
            value[j] += factor * other[2 * j];
        }
    }
}

static void errors(const int32_t *bias, const double *middle, const double *below, const double *above, int first)
{
    int j;
    for (j = 0; j < SLICE; j++) {
        if (axes[1].reached[first + j]) {
            const double value = bias[j] * unit;
            const double low = fmin(fmin(below[j], below[j + 1]), fmin(above[j], above[j + 1]));
            const double high = fmax(fmax(below[j], below[j + 1]), fmax(above[j], above[j + 1]));
            worst_middle = fmax(worst_middle, fabs(value - middle[j]));
            worst_corner = fmax(worst_corner, fmax(value - low, high - value));
            sum_of_errors += value - middle[j];
        }
    }
}

static void slice(int first, const double *along_t)
{
    static uint64_t *squares;
    static int64_t start[SLICE], sum[SLICE];
    static int32_t bias[SLICE];
    static double middle[SLICE], edge[2][SLICE + 1];
    const size_t stride = 2U * POSITIONS + 1U;
    const size_t places = 2U * SLICE + 1U;
    double *const b = factors(1, first, SLICE);
    int c, j, x_t;
    squares = (squares == NULL) ? room((size_t)n_integer * SLICE, sizeof *squares) : squares;
    for (j = 0; j < SLICE; j++) {
        start[j] = linear[1] * (first + j) * 8192;
        for (c = 0; c < n_integer; c++) {
            const int64_t argument = centers[c].s[1] * (first + j) + centers[c].k[1];
            squares[(size_t)c * SLICE + (size_t)j] = (uint64_t)(argument * argument);
        }
    }
    model_row(along_t, stride, b, places, 0, SLICE + 1, edge[0]);
    for (x_t = 0; x_t < POSITIONS; x_t++) {
        double *const below = edge[x_t & 1], *const above = edge[(x_t + 1) & 1];
        model_row(along_t + 2 * x_t + 2, stride, b, places, 0, SLICE + 1, above);
        if (!axes[0].reached[x_t]) {
            continue;
        }
        reference_row(x_t, squares, start, SLICE, sum);
        for (j = 0; j < SLICE; j++) {
            if (axes[1].reached[first + j]) {
                compare(x_t, first + j, sum[j], &bias[j]);
            }
        }
        model_row(along_t + 2 * x_t + 1, stride, b, places, 1, SLICE, middle);
        errors(bias, middle, below, above, first);
    }
    free(b);
}

static void read_axis(axis_t *axis)
{
    axis->low = number();
    axis->high = number();
    axis->gain = number();
    axis->least = real();
    axis->most = real();
    axis->zero = real();
    axis->half = real();
    find_inputs(axis);
}

static void read_table(void)
{
    int64_t i;
    int a;
    narrow = number();
    for (i = 0; i < 64; i++) {
        entries[i] = number();
    }
    w0 = number();
    linear[0] = number();
    linear[1] = number();
    n_integer = (int)number();
    n_model = (int)number();
    centers = room((size_t)(n_integer > n_model ? n_integer : n_model), sizeof *centers);
    for (i = 0; i < n_integer; i++) {
        for (a = 0; a < 2; a++) {
            centers[i].s[a] = number();
            centers[i].k[a] = number();
        }
        centers[i].w = number();
    }
    cells[0] = number();
    cells[1] = number();
    coverage = room((size_t)(cells[0] * cells[1] / 32 + 1), sizeof *coverage);
    for (i = 0; i < (cells[0] * cells[1] + 31) / 32; i++) {
        coverage[i] = (uint32_t)number();
    }
}

static void read_model(void)
{
    int i, a;
    unit = real();
    model_w0 = real();
    model_linear[0] = real();
    model_linear[1] = real();
    for (i = 0; i < n_model; i++) {
        for (a = 0; a < 2; a++) {
            centers[i].c[a] = real();
            centers[i].inverse[a] = real();
        }
        centers[i].weight = real();
    }
}

int main(void)
{
    const int part = (int)number(), parts = (int)number(), every = (int)number();
    double *along_t;
    int first;
    read_axis(&axes[0]);
    read_axis(&axes[1]);
    read_table();
    read_model();
    along_t = factors(0, 0, POSITIONS);
    for (first = part * SLICE; first < POSITIONS; first += parts * SLICE) {
        if ((first / SLICE) % every == every / 2) {
            slice(first, along_t);
        }
        printf("progress\n");
        fflush(stdout);
    }
    printf("result %" PRIu64 " %" PRIu64 " %a %a %a\n", visited, mismatches, worst_middle, worst_corner, sum_of_errors);
    return 0;
}
