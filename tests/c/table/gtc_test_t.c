/* gtc_test_t.c - bias table of gyro TEST-T. Written by gyrotc; do not edit.
 *
 * Make again:  gyrotc emit model.json --out .
 * Model:       sha256 c24b36fa44754e0c385adc70f5397d3585ed4feec00487c7e3320198c869d125
 *
 * The numbers in this file belong to the owner of the gyro's recordings.
 */
#include "gtc_test_t.h"

#include <stddef.h>

#if GTC_TABLE_LAYOUT != 3
#error "gtc_test_t.c was written for table layout 3: emit it again with the gyrotc of this runtime"
#endif

#define V(x) { .value = (x) } /* a float32 number */
#define B(x) { .bits = (x) }  /* an integer */

/* ---- float32 ---- */

/* four characters of the serial a word, the first one lowest */
static const gtc_word_t f32_serial[16] = {
    B(0x54534554UL), B(0x542dUL), B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL),
    B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL),
    B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL),
};

/* centers, w0, linear in T and slope, region: T min, max, slope min, max */
static const gtc_word_t f32_networks[16] = {
    B(0x3UL), V(0.125F), V(0.5F), V(-0.25F), V(-20.0F), V(60.0F), V(-0.5F), V(0.5F),
    B(0x1UL), V(0.0625F), V(0.25F), V(-0.125F), V(-20.0F), V(60.0F), V(-0.5F), V(0.5F), /* fallback model of supply_v */
};

/* T: center, gain; slope: center, gain; weight */
static const gtc_word_t f32_centers[20] = {
    V(-0.75F), V(24.0224476F), V(0.166666985F), V(9.60897923F), V(0.75F), /* -10.00 C, +0.500 C/min; widths 0.400, 1.000; +7.500e-01 deg/h */
    V(0.0F), V(16.0149651F), V(0.0F), V(0.0F), V(-1.25F), /* 20.00 C, +0.000 C/min; widths 0.600, infinite; -1.250e+00 deg/h */
    V(0.0F), V(0.0F), V(-0.5F), V(13.7271128F), V(0.3125F), /* 45.00 C, -1.500 C/min; widths infinite, 0.700; +3.125e-01 deg/h */
    V(-0.125F), V(19.2179585F), V(0.0F), V(0.0F), V(0.375F), /* 15.00 C, +0.500 C/min; widths 0.500, infinite; +3.750e-01 deg/h */
};

/* low, high, max_step, max_rate, agree_us, stuck_us, missing_blocks, fallback */
static const gtc_word_t f32_guards[16] = {
    V(-90.0F), V(200.0F), V(0.5F), V(1.00000001e-07F), B(0x0UL), B(0x0UL), B(0x2UL), V(0.0F), /* temperature_c */
    V(9.0F), V(15.0F), V(2.0F), V(0.0F), B(0x0UL), B(0x0UL), B(0x4UL), V(12.5F), /* supply_v */
};

/* kind, channel + 65536 * number of the fallback model among the networks, parameters */
static const gtc_word_t f32_terms[32] = {
    B(0x1UL), B(0x0UL), V(0.221199214F), V(0.0F), V(0.25F), V(0.0F), V(0.0F), V(0.0F), /* cavity_lag */
    B(0x2UL), B(0x0UL), V(2.0F), V(0.25F), V(0.0F), V(0.0F), V(0.0F), V(0.0F), /* hysteresis */
    B(0x3UL), B(0x0UL), V(9.23324871F), V(0.475614727F), V(0.0F), V(0.0F), V(0.0F), V(0.0F), /* warm_up */
    B(0x5UL), B(0x20001UL), V(0.125F), V(12.0F), V(0.0F), V(0.0F), V(0.0F), V(0.0F), /* auxiliary */
};

/* 1 sigma of the compensated bias, a row for each cell of slope */
static const gtc_word_t f32_sigma[18] = {
    V(0.00800000038F), V(0.0190787837F),
    V(0.00100000005F), V(9.99999975e-05F),
    V(0.0179999992F), V(0.00400000019F),
    V(0.00400000019F), V(0.00200000009F),
    V(0.0299999993F), V(0.0500000007F),
    V(0.150000006F), V(0.00600000005F),
    V(0.0599999987F), V(900.0F),
    V(0.00999999978F), V(0.0199999996F),
    V(0.0F), V(0.0299999993F),
};

/* known answers: T, slope, bias, status */
static const gtc_word_t f32_probes[32] = {
    V(0.774153054F), V(0.456940234F), V(-0.723808289F), B(0x0UL),
    V(47.31493F), V(0.38882038F), V(-0.0590648577F), B(0x0UL),
    V(-19.3186951F), V(-0.298464566F), V(0.302154005F), B(0x0UL),
    V(-13.0752821F), V(-0.181019917F), V(0.462099791F), B(0x0UL),
    V(48.6775398F), V(-0.208108783F), V(0.595777869F), B(0x0UL),
    V(49.3588448F), V(-0.00657336134F), V(0.408011675F), B(0x0UL),
    V(-40.0F), V(-0.75F), V(0.115000188F), B(0x2UL),
    V(80.0F), V(0.75F), V(0.300446272F), B(0x2UL),
};

const gtc_f32_table_t gtc_test_t_f32 = {
    .layout = 3,
    .quantity = 0UL,
    .unit = 0UL,
    .id = 0x309a2d09UL,
    .calibrated = 0UL,
    .block_us = 10000000UL,
    .slope_blocks = 4UL,
    .lead_blocks = 0UL,
    .bias_frac_bits = 0UL,
    .parts = 0x0000162eUL,
    .fallback = V(0.375F),
    .authority = { V(-4.02148485F), V(3.66148233F) },
    .effect = { V(-2.0259223F), V(2.0259223F) },
    .rezero = V(0.0299999993F),
    .scale = { V(20.0F), V(0.0250000004F), V(2.0F) },
    .envelope = { V(-20.0F), V(60.0F), V(-0.5F), V(0.5F) },
    .n_networks = 1UL,
    .n_centers = 4UL,
    .n_channels = 2UL,
    .n_terms = 4UL,
    .coverage_cells = { 0UL, 0UL },
    .sigma_cells = { 2UL, 1UL },
    .n_sigma = 18UL,
    .n_probes = 8UL,
    .n_fallback_models = 1UL,
    .serial = f32_serial,
    .networks = f32_networks,
    .centers = f32_centers,
    .guards = f32_guards,
    .terms = f32_terms,
    .coverage = NULL,
    .sigma = f32_sigma,
    .probes = f32_probes,
    .crc = 0xf3824ab5UL,
};

/* ---- fixed point ---- */

/* four characters of the serial a word, the first one lowest */
static const gtc_word_t q31_serial[16] = {
    B(0x54534554UL), B(0x542dUL), B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL),
    B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL),
    B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL),
};

/* centers, w0, linear in T and slope, region: T min, max, slope min, max */
static const gtc_word_t q31_networks[16] = {
    B(0x3UL), B(0xffe00374UL), B(0x00fffef8UL), B(0xff7fff37UL), B(0x00000000UL), B(0x0000ffffUL), B(0x00000000UL), B(0x0000ffffUL),
    B(0x1UL), B(0xffeffff5UL), B(0x00800015UL), B(0xffc00000UL), B(0x00000000UL), B(0x0000ffffUL), B(0x00000000UL), B(0x0000ffffUL), /* fallback model of supply_v */
};

/* T: center, gain; slope: center, gain; weight */
static const gtc_word_t q31_centers[20] = {
    B(0x00006017UL), B(0xf3fd5054UL), B(0x00002670UL), B(0xe994133bUL), B(0x00bfffc8UL), /* -10.00 C, +0.500 C/min; widths 0.400, 1.000; +7.500e-01 deg/h */
    B(0x0000400fUL), B(0xdff8a0c8UL), B(0x00000000UL), B(0x00000000UL), B(0xfebffeabUL), /* 20.00 C, +0.000 C/min; widths 0.600, infinite; -1.250e+00 deg/h */
    B(0x00000000UL), B(0x00000000UL), B(0x000036e9UL), B(0xf245db76UL), B(0x004fff60UL), /* 45.00 C, -1.500 C/min; widths infinite, 0.700; +3.125e-01 deg/h */
    B(0x00004cdfUL), B(0xde5e9739UL), B(0x00000000UL), B(0x00000000UL), B(0x00600012UL), /* 15.00 C, +0.500 C/min; widths 0.500, infinite; +3.750e-01 deg/h */
};

/* low, high, max_step, max_rate, agree_us, stuck_us, missing_blocks, fallback */
static const gtc_word_t q31_guards[16] = {
    B(0xffa60000UL), B(0x00c80000UL), B(0x00008000UL), B(0x0001ad7fUL), B(0x0UL), B(0x0UL), B(0x2UL), B(0x00000000UL), /* temperature_c */
    B(0x00090000UL), B(0x000f0000UL), B(0x00020000UL), B(0x00000000UL), B(0x0UL), B(0x0UL), B(0x4UL), B(0x000c8000UL), /* supply_v */
};

/* kind, channel + 65536 * number of the fallback model among the networks, parameters */
static const gtc_word_t q31_terms[32] = {
    B(0x1UL), B(0x0UL), B(0x1c504185UL), B(0x00000000UL), B(0x00400000UL), B(0x00000000UL), B(0x00000000UL), B(0x00000000UL), /* cavity_lag */
    B(0x2UL), B(0x0UL), B(0x00020000UL), B(0x00400000UL), B(0x00000000UL), B(0x00000000UL), B(0x00000000UL), B(0x00000000UL), /* hysteresis */
    B(0x3UL), B(0x0UL), B(0x024eed8aUL), B(0x0079c1e3UL), B(0x00000000UL), B(0x00000000UL), B(0x00000000UL), B(0x00000000UL), /* warm_up */
    B(0x5UL), B(0x20001UL), B(0x00200000UL), B(0x000c0000UL), B(0x00000000UL), B(0x00000000UL), B(0x00000000UL), B(0x00000000UL), /* auxiliary */
};

/* 1 sigma of the compensated bias, a row for each cell of slope */
static const gtc_word_t q31_sigma[18] = {
    B(0x00020c4aUL), B(0x0004e259UL),
    B(0x00004189UL), B(0x0000068eUL),
    B(0x00049ba6UL), B(0x00010625UL),
    B(0x00010625UL), B(0x00008312UL),
    B(0x0007ae14UL), B(0x000ccccdUL),
    B(0x00266666UL), B(0x00018937UL),
    B(0x000f5c29UL), B(0x00000384UL),
    B(0x00028f5cUL), B(0x00051eb8UL),
    B(0x00000000UL), B(0x0007ae14UL),
};

/* known answers: T, slope, bias, status */
static const gtc_word_t q31_probes[32] = {
    B(0x002863e5UL), B(0x000011e1UL), B(0xffdf8b3eUL), B(0x0UL),
    B(0x0014c7caUL), B(0xffffa3c2UL), B(0xff5b8d25UL), B(0x0UL),
    B(0x00012bafUL), B(0x000035a3UL), B(0xff98f2b2UL), B(0x0UL),
    B(0xffed8f94UL), B(0xffffc784UL), B(0x005c8576UL), B(0x0UL),
    B(0x0029f379UL), B(0x00005965UL), B(0xffb3321eUL), B(0x0UL),
    B(0x0016575eUL), B(0xffffeb46UL), B(0xff3723d9UL), B(0x0UL),
    B(0xffd80000UL), B(0xffff4000UL), B(0x001d725cUL), B(0x2UL),
    B(0x00500000UL), B(0x0000c000UL), B(0x004cea12UL), B(0x2UL),
};

const gtc_q31_table_t gtc_test_t_q31 = {
    .layout = 3,
    .quantity = 0UL,
    .unit = 0UL,
    .id = 0x309a2d09UL,
    .calibrated = 0UL,
    .block_us = 10000000UL,
    .slope_blocks = 4UL,
    .lead_blocks = 0UL,
    .bias_frac_bits = 24UL,
    .parts = 0x0000162eUL,
    .fallback = 6291456L,
    .authority = { -67469075L, 61429373L },
    .effect = { -33989333L, 33989333L },
    .rezero = 503316L,
    .scale = { 1677721L, 134217727L, 0L },
    .envelope = { -1310720L, 3932160L, -32768L, 32768L },
    .n_networks = 1UL,
    .n_centers = 4UL,
    .n_channels = 2UL,
    .n_terms = 4UL,
    .coverage_cells = { 0UL, 0UL },
    .sigma_cells = { 2UL, 1UL },
    .n_sigma = 18UL,
    .n_probes = 8UL,
    .n_fallback_models = 1UL,
    .serial = q31_serial,
    .networks = q31_networks,
    .centers = q31_centers,
    .guards = q31_guards,
    .terms = q31_terms,
    .coverage = NULL,
    .sigma = q31_sigma,
    .probes = q31_probes,
    .crc = 0x7f09fcfdUL,
};

