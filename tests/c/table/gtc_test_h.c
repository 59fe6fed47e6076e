/* gtc_test_h.c - bias table of gyro TEST-H. Written by gyrotc; do not edit.
 *
 * Make again:  gyrotc emit model.json --out .
 * Model:       sha256 a6ca9f40548225b74f2d1e43b12ab312cbd0dace3692ad95ebd7989de54d7c23
 *
 * The numbers in this file belong to the owner of the gyro's recordings.
 */
#include "gtc_test_h.h"

#include <stddef.h>

#if GTC_TABLE_LAYOUT != 3
#error "gtc_test_h.c was written for table layout 3: emit it again with the gyrotc of this runtime"
#endif

#define V(x) { .value = (x) } /* a float32 number */
#define B(x) { .bits = (x) }  /* an integer */

/* ---- float32 ---- */

/* four characters of the serial a word, the first one lowest */
static const gtc_word_t f32_serial[16] = {
    B(0x54534554UL), B(0x482dUL), B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL),
    B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL),
    B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL),
};

/* centers, w0, linear in T and slope, region: T min, max, slope min, max */
static const gtc_word_t f32_networks[8] = {
    B(0x2UL), V(0.125F), V(0.5F), V(-0.25F), V(-20.0F), V(60.0F), V(-0.5F), V(0.5F),
};

/* T: center, gain; slope: center, gain; weight */
static const gtc_word_t f32_centers[10] = {
    V(-0.75F), V(480.448975F), V(0.166666985F), V(9.60897923F), V(0.75F), /* -10.00 C, +0.500 C/min; widths 0.020, 1.000; +7.500e-01 deg/h */
    V(0.0F), V(16.0149651F), V(0.0F), V(0.0F), V(-1.25F), /* 20.00 C, +0.000 C/min; widths 0.600, infinite; -1.250e+00 deg/h */
};

/* low, high, max_step, max_rate, agree_us, stuck_us, missing_blocks, fallback */
static const gtc_word_t f32_guards[8] = {
    V(-90.0F), V(200.0F), V(0.5F), V(1.00000001e-07F), B(0x0UL), B(0x1c9c380UL), B(0x2UL), V(0.0F), /* temperature_c */
};

/* kind, channel + 65536 * number of the fallback model among the networks, parameters */
static const gtc_word_t f32_terms[16] = {
    B(0x4UL), B(0x0UL), V(0.125F), V(0.0F), V(0.25F), V(0.0F), V(0.0F), V(0.0F), /* path_length_periodicity */
    B(0x1UL), B(0x0UL), V(0.221199214F), V(0.566574216F), V(0.0F), V(0.0F), V(0.0F), V(0.0F), /* thermal_gradient */
};

/* known answers: T, slope, bias, status */
static const gtc_word_t f32_probes[32] = {
    V(-10.8331242F), V(0.29987666F), V(-0.440116227F), B(0x0UL),
    V(47.31493F), V(0.38882038F), V(-0.0702364147F), B(0x0UL),
    V(49.3588448F), V(-0.00657336134F), V(0.215360343F), B(0x0UL),
    V(-2.83061481F), V(-0.427027196F), V(-0.452584088F), B(0x0UL),
    V(46.633625F), V(0.187284946F), V(-0.000537395477F), B(0x0UL),
    V(41.0715179F), V(0.271375716F), V(-0.32556963F), B(0x0UL),
    V(-40.0F), V(-0.75F), V(-0.202720672F), B(0x2UL),
    V(80.0F), V(0.75F), V(0.297279328F), B(0x2UL),
};

const gtc_f32_table_t gtc_test_h_f32 = {
    .layout = 3,
    .quantity = 0UL,
    .unit = 0UL,
    .id = 0x249b7146UL,
    .calibrated = 0UL,
    .block_us = 10000000UL,
    .slope_blocks = 4UL,
    .lead_blocks = 0UL,
    .bias_frac_bits = 0UL,
    .parts = 0x00000412UL,
    .fallback = V(0.375F),
    .authority = { V(-70.3042145F), V(69.7087097F) },
    .effect = { V(-68.3639145F), V(68.3639145F) },
    .rezero = V(0.0F),
    .scale = { V(20.0F), V(0.0250000004F), V(2.0F) },
    .envelope = { V(-20.0F), V(60.0F), V(-0.5F), V(0.5F) },
    .n_networks = 1UL,
    .n_centers = 2UL,
    .n_channels = 1UL,
    .n_terms = 2UL,
    .coverage_cells = { 0UL, 0UL },
    .sigma_cells = { 0UL, 0UL },
    .n_sigma = 0UL,
    .n_probes = 8UL,
    .n_fallback_models = 0UL,
    .serial = f32_serial,
    .networks = f32_networks,
    .centers = f32_centers,
    .guards = f32_guards,
    .terms = f32_terms,
    .coverage = NULL,
    .sigma = NULL,
    .probes = f32_probes,
    .crc = 0x9e012742UL,
};

/* ---- fixed point ---- */

/* four characters of the serial a word, the first one lowest */
static const gtc_word_t q31_serial[16] = {
    B(0x54534554UL), B(0x482dUL), B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL),
    B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL),
    B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL),
};

/* centers, w0, linear in T and slope, region: T min, max, slope min, max */
static const gtc_word_t q31_networks[8] = {
    B(0x2UL), B(0xffdffddaUL), B(0x00fffffaUL), B(0xff7ffffcUL), B(0x00000000UL), B(0x0000ffffUL), B(0x00000000UL), B(0x0000ffffUL),
};

/* T: center, gain; slope: center, gain; weight */
static const gtc_word_t q31_centers[10] = {
    B(0x0000781dUL), B(0xf0fc9c69UL), B(0x00000267UL), B(0xfe994134UL), B(0x00c000baUL), /* -10.00 C, +0.500 C/min; widths 0.020, 1.000; +7.500e-01 deg/h */
    B(0x00000401UL), B(0xfdff820dUL), B(0x00000000UL), B(0x00000000UL), B(0xfec001b9UL), /* 20.00 C, +0.000 C/min; widths 0.600, infinite; -1.250e+00 deg/h */
};

/* low, high, max_step, max_rate, agree_us, stuck_us, missing_blocks, fallback */
static const gtc_word_t q31_guards[8] = {
    B(0xffa60000UL), B(0x00c80000UL), B(0x00008000UL), B(0x0001ad7fUL), B(0x0UL), B(0x1c9c380UL), B(0x2UL), B(0x00000000UL), /* temperature_c */
};

/* kind, channel + 65536 * number of the fallback model among the networks, parameters */
static const gtc_word_t q31_terms[16] = {
    B(0x4UL), B(0x0UL), B(0x20000000UL), B(0x00000000UL), B(0x00400000UL), B(0x00000000UL), B(0x00000000UL), B(0x00000000UL), /* path_length_periodicity */
    B(0x1UL), B(0x0UL), B(0x1c504185UL), B(0x00910b02UL), B(0x00000000UL), B(0x00000000UL), B(0x00000000UL), B(0x00000000UL), /* thermal_gradient */
};

/* known answers: T, slope, bias, status */
static const gtc_word_t q31_probes[32] = {
    B(0x002863e5UL), B(0x000011e1UL), B(0xffbcd4c0UL), B(0x0UL),
    B(0x0014c7caUL), B(0xffffa3c2UL), B(0xff10f4b0UL), B(0x0UL),
    B(0x00012bafUL), B(0x000035a3UL), B(0xff1c05d1UL), B(0x0UL),
    B(0xffed8f94UL), B(0xffffc784UL), B(0xffa8a022UL), B(0x0UL),
    B(0x0029f379UL), B(0x00005965UL), B(0xffaeed80UL), B(0x0UL),
    B(0x0016575eUL), B(0xffffeb46UL), B(0xfef4e1a2UL), B(0x0UL),
    B(0xffd80000UL), B(0xffff4000UL), B(0xffcc192eUL), B(0x2UL),
    B(0x00500000UL), B(0x0000c000UL), B(0x004c18a9UL), B(0x2UL),
};

const gtc_q31_table_t gtc_test_h_q31 = {
    .layout = 3,
    .quantity = 0UL,
    .unit = 0UL,
    .id = 0x249b7146UL,
    .calibrated = 0UL,
    .block_us = 10000000UL,
    .slope_blocks = 4UL,
    .lead_blocks = 0UL,
    .bias_frac_bits = 24UL,
    .parts = 0x00000c12UL,
    .fallback = 6291456L,
    .authority = { -1179508867L, 1169517243L },
    .effect = { -1146956038L, 1146956038L },
    .rezero = 0L,
    .scale = { 1677721L, 134217727L, 8L },
    .envelope = { -1310720L, 3932160L, -32768L, 32768L },
    .n_networks = 1UL,
    .n_centers = 2UL,
    .n_channels = 1UL,
    .n_terms = 2UL,
    .coverage_cells = { 0UL, 0UL },
    .sigma_cells = { 0UL, 0UL },
    .n_sigma = 0UL,
    .n_probes = 8UL,
    .n_fallback_models = 0UL,
    .serial = q31_serial,
    .networks = q31_networks,
    .centers = q31_centers,
    .guards = q31_guards,
    .terms = q31_terms,
    .coverage = NULL,
    .sigma = NULL,
    .probes = q31_probes,
    .crc = 0x1522bd06UL,
};

