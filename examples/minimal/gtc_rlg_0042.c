/* gtc_rlg_0042.c - bias table of gyro RLG-0042. Written by gyrotc; do not edit.
 *
 * Make again:  gyrotc emit model.json --out .
 * Model:       sha256 dcfdd3e112ccad432a2d62c8b3766cf7ca205f064fedcb87e6932911ea1c901c
 *
 * The numbers in this file belong to the owner of the gyro's recordings.
 */
#include "gtc_rlg_0042.h"

#include <stddef.h>

#if GTC_TABLE_LAYOUT != 3
#error "gtc_rlg_0042.c was written for table layout 3: emit it again with the gyrotc of this runtime"
#endif

#define V(x) { .value = (x) } /* a float32 number */
#define B(x) { .bits = (x) }  /* an integer */

/* ---- float32 ---- */

/* four characters of the serial a word, the first one lowest */
static const gtc_word_t f32_serial[16] = {
    B(0x2d474c52UL), B(0x32343030UL), B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL),
    B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL),
    B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL),
};

/* centers, w0, linear in T and slope, region: T min, max, slope min, max */
static const gtc_word_t f32_networks[8] = {
    B(0xaUL), V(0.00723136216F), V(-0.000530842517F), V(0.000556076295F), V(-32.8230019F), V(68.0139999F), V(-0.392757595F), V(0.392727345F),
};

/* T: center, gain; slope: center, gain; weight */
static const gtc_word_t f32_centers[50] = {
    V(-0.895866394F), V(117.591789F), V(0.073472023F), V(5.62642574F), V(-0.00131828233F), /* -27.57 C, +0.173 C/min; widths 0.082, 1.708; -1.318e-03 deg/h */
    V(-0.688103676F), V(126.819138F), V(-0.103748322F), V(7.18937063F), V(-0.00139633496F), /* -17.10 C, -0.244 C/min; widths 0.076, 1.337; -1.396e-03 deg/h */
    V(-0.466757774F), V(141.507278F), V(-0.284078598F), V(5.46079063F), V(-0.00160327822F), /* -5.94 C, -0.669 C/min; widths 0.068, 1.760; -1.603e-03 deg/h */
    V(-0.1381073F), V(105.431168F), V(-0.147624016F), V(4.53447533F), V(0.00336317695F), /* 10.63 C, -0.348 C/min; widths 0.091, 2.119; +3.363e-03 deg/h */
    V(-0.132966042F), V(65.076622F), V(-0.176724434F), V(4.96975756F), V(-0.00385734159F), /* 10.89 C, -0.416 C/min; widths 0.148, 1.933; -3.857e-03 deg/h */
    V(0.183084488F), V(140.386673F), V(0.523936272F), V(2.40137649F), V(-0.00127691089F), /* 26.83 C, +1.235 C/min; widths 0.068, 4.001; -1.277e-03 deg/h */
    V(0.413938522F), V(111.523598F), V(-0.281129837F), V(3.20180488F), V(-0.00363156642F), /* 38.47 C, -0.662 C/min; widths 0.086, 3.001; -3.632e-03 deg/h */
    V(0.435255051F), V(77.1773071F), V(-0.415244102F), V(3.68802929F), V(0.0034676108F), /* 39.54 C, -0.979 C/min; widths 0.125, 2.605; +3.468e-03 deg/h */
    V(0.73853302F), V(134.191986F), V(-0.196117401F), V(5.6845088F), V(0.0017929693F), /* 54.83 C, -0.462 C/min; widths 0.072, 1.690; +1.793e-03 deg/h */
    V(0.943508148F), V(97.7552109F), V(-0.196278572F), V(6.46356249F), V(0.00183206401F), /* 65.17 C, -0.463 C/min; widths 0.098, 1.487; +1.832e-03 deg/h */
};

/* low, high, max_step, max_rate, agree_us, stuck_us, missing_blocks, fallback */
static const gtc_word_t f32_guards[8] = {
    V(-90.0F), V(200.0F), V(1.0F), V(4.99999999e-07F), B(0xf4240UL), B(0x0UL), B(0x1eUL), V(0.0F), /* temperature_c */
};

/* one bit for each cell of T (fastest) and slope, low bit first */
static const gtc_word_t f32_coverage[12] = {
    B(0x7ff8000UL), B(0x1fe1f000UL), B(0x3e001e00UL), B(0x73ffffc0UL), B(0xfe000078UL), B(0xc008000fUL),
    B(0xe0080c03UL), B(0x3e01fc7fUL), B(0x7ffffceUL), B(0xfff07cUL), B(0xfcff8UL), B(0x1ffe0UL),
};

/* known answers: T, slope, bias, status */
static const gtc_word_t f32_probes[32] = {
    V(30.3835793F), V(0.248078376F), V(0.00725107919F), B(0x0UL),
    V(-4.17080688F), V(0.383994341F), V(0.00722466689F), B(0x0UL),
    V(5.66617823F), V(-0.0898055881F), V(0.00591904763F), B(0x4UL),
    V(0.372868061F), V(0.292852521F), V(0.00739119947F), B(0x0UL),
    V(39.111927F), V(-0.286852509F), V(0.00652668858F), B(0x0UL),
    V(-31.9642429F), V(-0.234454557F), V(0.00705843093F), B(0x4UL),
    V(-58.0322533F), V(-0.589128852F), V(0.00703108823F), B(0x6UL),
    V(93.2232513F), V(0.589098573F), V(0.00794571172F), B(0x6UL),
};

const gtc_f32_table_t gtc_rlg_0042_f32 = {
    .layout = 3,
    .quantity = 0UL,
    .unit = 0UL,
    .id = 0xcf4eb7abUL,
    .calibrated = 20260307UL,
    .block_us = 10000000UL,
    .slope_blocks = 10UL,
    .lead_blocks = 0UL,
    .bias_frac_bits = 0UL,
    .parts = 0x00000500UL,
    .fallback = V(0.00726183504F),
    .authority = { V(0.0F), V(0.00946229789F) },
    .effect = { V(0.0F), V(0.0F) },
    .rezero = V(0.0F),
    .scale = { V(17.595499F), V(0.0198339894F), V(2.54609966F) },
    .envelope = { V(-32.8230019F), V(68.0139999F), V(-0.392757595F), V(0.392727345F) },
    .n_networks = 1UL,
    .n_centers = 10UL,
    .n_channels = 1UL,
    .n_terms = 0UL,
    .coverage_cells = { 32UL, 12UL },
    .sigma_cells = { 0UL, 0UL },
    .n_sigma = 0UL,
    .n_probes = 8UL,
    .n_fallback_models = 0UL,
    .serial = f32_serial,
    .networks = f32_networks,
    .centers = f32_centers,
    .guards = f32_guards,
    .terms = NULL,
    .coverage = f32_coverage,
    .sigma = NULL,
    .probes = f32_probes,
    .crc = 0x172b6cefUL,
};

/* ---- fixed point ---- */

/* four characters of the serial a word, the first one lowest */
static const gtc_word_t q31_serial[16] = {
    B(0x2d474c52UL), B(0x32343030UL), B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL),
    B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL),
    B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL),
};

/* centers, w0, linear in T and slope, region: T min, max, slope min, max */
static const gtc_word_t q31_networks[8] = {
    B(0xaUL), B(0x0001d843UL), B(0xffffba6bUL), B(0x000048e2UL), B(0x00000000UL), B(0x0000ffffUL), B(0x00000000UL), B(0x0000ffffUL),
};

/* T: center, gain; slope: center, gain; weight */
static const gtc_word_t q31_centers[50] = {
    B(0x00007598UL), B(0xf9e0d0bcUL), B(0x000005a0UL), B(0xfcfb14f4UL), B(0xffffa99bUL), /* -27.57 C, +0.173 C/min; widths 0.082, 1.708; -1.318e-03 deg/h */
    B(0x00007ed2UL), B(0xec393afeUL), B(0x00000730UL), B(0xfcc76deaUL), B(0xffffa47eUL), /* -17.10 C, -0.244 C/min; widths 0.076, 1.337; -1.396e-03 deg/h */
    B(0x00008d82UL), B(0xda45a923UL), B(0x00000576UL), B(0xfe0b8f60UL), B(0xffff96edUL), /* -5.94 C, -0.669 C/min; widths 0.068, 1.760; -1.603e-03 deg/h */
    B(0x0000696eUL), B(0xd290f974UL), B(0x00000489UL), B(0xfe112f51UL), B(0x0000dc6fUL), /* 10.63 C, -0.348 C/min; widths 0.091, 2.119; +3.363e-03 deg/h */
    B(0x00004114UL), B(0xe3c9bc49UL), B(0x000004f8UL), B(0xfdf46286UL), B(0xffff0332UL), /* 10.89 C, -0.416 C/min; widths 0.148, 1.933; -3.857e-03 deg/h */
    B(0x00008c63UL), B(0xacf4da54UL), B(0x00000267UL), B(0xfe2b60aaUL), B(0xffffac50UL), /* 26.83 C, +1.235 C/min; widths 0.068, 4.001; -1.277e-03 deg/h */
    B(0x00006f86UL), B(0xb1283f7aUL), B(0x00000334UL), B(0xfed941c7UL), B(0xffff11feUL), /* 38.47 C, -0.662 C/min; widths 0.086, 3.001; -3.632e-03 deg/h */
    B(0x00004d2dUL), B(0xc89dfd49UL), B(0x000003b0UL), B(0xfeebfd6dUL), B(0x0000e341UL), /* 39.54 C, -0.979 C/min; widths 0.125, 2.605; +3.468e-03 deg/h */
    B(0x00008631UL), B(0x8b5a5cccUL), B(0x000005afUL), B(0xfdb72986UL), B(0x00007581UL), /* 54.83 C, -0.462 C/min; widths 0.072, 1.690; +1.793e-03 deg/h */
    B(0x000061c1UL), B(0xa1020e4eUL), B(0x00000677UL), B(0xfd66e7deUL), B(0x00007814UL), /* 65.17 C, -0.463 C/min; widths 0.098, 1.487; +1.832e-03 deg/h */
};

/* low, high, max_step, max_rate, agree_us, stuck_us, missing_blocks, fallback */
static const gtc_word_t q31_guards[8] = {
    B(0xffa60000UL), B(0x00c80000UL), B(0x00010000UL), B(0x0008637cUL), B(0xf4240UL), B(0x0UL), B(0x1eUL), B(0x00000000UL), /* temperature_c */
};

/* one bit for each cell of T (fastest) and slope, low bit first */
static const gtc_word_t q31_coverage[12] = {
    B(0x7ff8000UL), B(0x1fe1f000UL), B(0x3e001e00UL), B(0x73ffffc0UL), B(0xfe000078UL), B(0xc008000fUL),
    B(0xe0080c03UL), B(0x3e01fc7fUL), B(0x7ffffceUL), B(0xfff07cUL), B(0xfcff8UL), B(0x1ffe0UL),
};

/* known answers: T, slope, bias, status */
static const gtc_word_t q31_probes[32] = {
    B(0x002b4beeUL), B(0x00000e0aUL), B(0x00022154UL), B(0x4UL),
    B(0x00129446UL), B(0xffffb78bUL), B(0x0001789dUL), B(0x0UL),
    B(0xfff9dc9fUL), B(0x00002a21UL), B(0x00019f0dUL), B(0x0UL),
    B(0xffe124f7UL), B(0xffffd3a1UL), B(0x0001c175UL), B(0x4UL),
    B(0x002d4395UL), B(0x00004637UL), B(0x0002204fUL), B(0x4UL),
    B(0x00148beeUL), B(0xffffefb7UL), B(0x0001a21bUL), B(0x4UL),
    B(0xffc5f7beUL), B(0xffff692fUL), B(0x0001ccc8UL), B(0x6UL),
    B(0x005d3927UL), B(0x000096cfUL), B(0x000208baUL), B(0x6UL),
};

const gtc_q31_table_t gtc_rlg_0042_q31 = {
    .layout = 3,
    .quantity = 0UL,
    .unit = 0UL,
    .id = 0xcf4eb7abUL,
    .calibrated = 20260307UL,
    .block_us = 10000000UL,
    .slope_blocks = 10UL,
    .lead_blocks = 0UL,
    .bias_frac_bits = 24UL,
    .parts = 0x00000d00UL,
    .fallback = 121833L,
    .authority = { 0L, 158751L },
    .effect = { 0L, 0L },
    .rezero = 0L,
    .scale = { 1331036L, 170870916L, 4L },
    .envelope = { -2151088L, 4457366L, -25740L, 25738L },
    .n_networks = 1UL,
    .n_centers = 10UL,
    .n_channels = 1UL,
    .n_terms = 0UL,
    .coverage_cells = { 32UL, 12UL },
    .sigma_cells = { 0UL, 0UL },
    .n_sigma = 0UL,
    .n_probes = 8UL,
    .n_fallback_models = 0UL,
    .serial = q31_serial,
    .networks = q31_networks,
    .centers = q31_centers,
    .guards = q31_guards,
    .terms = NULL,
    .coverage = q31_coverage,
    .sigma = NULL,
    .probes = q31_probes,
    .crc = 0x1b79a30dUL,
};

