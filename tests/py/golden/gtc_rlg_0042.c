/* gtc_rlg_0042.c - bias table of gyro RLG-0042. Written by gyrotc; do not edit.
 *
 * Make again:  gyrotc emit model.json --out .
 * Model:       sha256 3a1d04c46810450057e0c6c72e7ff517857928ac6b3d5846b106b6b3fe4c19d7
 *
 * The numbers in this file belong to the owner of the gyro's recordings.
 */
#include "gtc_rlg_0042.h"

#include <stddef.h>

#if GTC_TABLE_LAYOUT != 1
#error "gtc_rlg_0042.c was written for table layout 1: emit it again with the gyrotc of this runtime"
#endif

#define V(x) { .value = (x) } /* a float32 number */
#define B(x) { .bits = (x) }  /* an integer */

/* ---- float32 ---- */

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

/* one bit for each cell of T (fastest) and slope, low bit first */
static const gtc_word_t f32_coverage[12] = {
    B(0x7ff8000UL), B(0x1fe1f000UL), B(0x3e001e00UL), B(0x73ffffc0UL), B(0xfe000078UL), B(0xc008000fUL),
    B(0xe0080c03UL), B(0x3e01fc7fUL), B(0x7ffffceUL), B(0xfff07cUL), B(0xfcff8UL), B(0x1ffe0UL),
};

/* known answers: T, slope, bias, status */
static const gtc_word_t f32_probes[32] = {
    V(43.2966003F), V(0.0548433736F), V(0.00832111202F), B(0x4UL),
    V(18.5791969F), V(-0.283040613F), V(0.00574665563F), B(0x0UL),
    V(-6.13820362F), V(0.164560363F), V(0.00633316068F), B(0x0UL),
    V(-30.8556042F), V(-0.173323601F), V(0.00685811182F), B(0x4UL),
    V(45.2639961F), V(0.274277359F), V(0.0083055133F), B(0x4UL),
    V(20.5465946F), V(-0.0636066124F), V(0.00637993729F), B(0x4UL),
    V(-58.0322533F), V(-0.589128852F), V(0.00703108823F), B(0x6UL),
    V(93.2232513F), V(0.589098573F), V(0.00794571172F), B(0x6UL),
};

const gtc_f32_table_t gtc_rlg_0042_f32 = {
    .layout = 1,
    .quantity = 0UL,
    .unit = 0UL,
    .id = 0xcf4eb7abUL,
    .slope_blocks = 10UL,
    .hold_blocks = 30UL,
    .stuck_samples = 0UL,
    .bias_frac_bits = 0UL,
    .max_step = V(1.0F),
    .max_slope = V(5.0F),
    .fallback = V(0.00726183504F),
    .scale = { V(17.595499F), V(0.0198339894F), V(2.54609966F) },
    .envelope = { V(-32.8230019F), V(68.0139999F), V(-0.392757595F), V(0.392727345F) },
    .n_networks = 1UL,
    .n_centers = 10UL,
    .n_channels = 1UL,
    .n_terms = 0UL,
    .coverage_cells = { 32UL, 12UL },
    .sigma_cells = { 0UL, 0UL },
    .n_probes = 8UL,
    .networks = f32_networks,
    .centers = f32_centers,
    .terms = NULL,
    .coverage = f32_coverage,
    .sigma = NULL,
    .probes = f32_probes,
    .crc = 0xfef29dc6UL,
    .term_code = { NULL },
    .serial = "RLG-0042",
};

/* ---- fixed point ---- */

/* centers, w0, linear in T and slope, region: T min, max, slope min, max */
static const gtc_word_t q31_networks[8] = {
    B(0xaUL), B(0x0ecf4e61UL), B(0xfdd35b70UL), B(0x02470a1eUL), B(0xffdf2d50UL), B(0x00440396UL), B(0xffff9b74UL), B(0x0000648aUL),
};

/* T: center, gain; slope: center, gain; weight */
static const gtc_word_t q31_centers[50] = {
    B(0x00003accUL), B(0x1a564c23UL), B(0x000002d0UL), B(0xffe588d1UL), B(0xfd4cdb77UL), /* -27.57 C, +0.173 C/min; widths 0.082, 1.708; -1.318e-03 deg/h */
    B(0x00003f69UL), B(0x15d1024bUL), B(0x00000398UL), B(0x002fb46fUL), B(0xfd23f44cUL), /* -17.10 C, -0.244 C/min; widths 0.076, 1.337; -1.396e-03 deg/h */
    B(0x000046c1UL), B(0x10833a12UL), B(0x000002bbUL), B(0x00634575UL), B(0xfcb766f0UL), /* -5.94 C, -0.669 C/min; widths 0.068, 1.760; -1.603e-03 deg/h */
    B(0x000034b7UL), B(0x03a3ed40UL), B(0x00000244UL), B(0x002acc8eUL), B(0x06e33d23UL), /* 10.63 C, -0.348 C/min; widths 0.091, 2.119; +3.363e-03 deg/h */
    B(0x0000208aUL), B(0x0229d4a2UL), B(0x0000027cUL), B(0x00382f67UL), B(0xf8198f94UL), /* 10.89 C, -0.416 C/min; widths 0.148, 1.933; -3.857e-03 deg/h */
    B(0x00004632UL), B(0xf9931264UL), B(0x00000133UL), B(0xffaf9181UL), B(0xfd6294eeUL), /* 26.83 C, +1.235 C/min; widths 0.068, 4.001; -1.277e-03 deg/h */
    B(0x000037c3UL), B(0xf47596f2UL), B(0x0000019aUL), B(0x00399f95UL), B(0xf88fd580UL), /* 38.47 C, -0.662 C/min; widths 0.086, 3.001; -3.632e-03 deg/h */
    B(0x00002697UL), B(0xf79a1ce8UL), B(0x000001d8UL), B(0x0061fd0dUL), B(0x071a1d92UL), /* 39.54 C, -0.979 C/min; widths 0.125, 2.605; +3.468e-03 deg/h */
    B(0x00004319UL), B(0xe73939ebUL), B(0x000002d8UL), B(0x00475f26UL), B(0x03ac254dUL), /* 54.83 C, -0.462 C/min; widths 0.072, 1.690; +1.793e-03 deg/h */
    B(0x000030e1UL), B(0xe8f1096fUL), B(0x0000033bUL), B(0x005124eaUL), B(0x03c07198UL), /* 65.17 C, -0.463 C/min; widths 0.098, 1.487; +1.832e-03 deg/h */
};

/* one bit for each cell of T (fastest) and slope, low bit first */
static const gtc_word_t q31_coverage[12] = {
    B(0x7ff8000UL), B(0x1fe1f000UL), B(0x3e001e00UL), B(0x73ffffc0UL), B(0xfe000078UL), B(0xc008000fUL),
    B(0xe0080c03UL), B(0x3e01fc7fUL), B(0x7ffffceUL), B(0xfff07cUL), B(0xfcff8UL), B(0x1ffe0UL),
};

/* known answers: T, slope, bias, status */
static const gtc_word_t q31_probes[32] = {
    B(0x002b4beeUL), B(0x00000e0aUL), B(0x110aa28eUL), B(0x4UL),
    B(0x00129446UL), B(0xffffb78bUL), B(0x0bc4e756UL), B(0x0UL),
    B(0xfff9dc9fUL), B(0x00002a21UL), B(0x0cf8629aUL), B(0x0UL),
    B(0xffe124f7UL), B(0xffffd3a1UL), B(0x0e0b9191UL), B(0x4UL),
    B(0x002d4395UL), B(0x00004637UL), B(0x11027c99UL), B(0x4UL),
    B(0x00148beeUL), B(0xffffefb7UL), B(0x0d10f960UL), B(0x4UL),
    B(0xffc5f7beUL), B(0xffff692fUL), B(0x0e66550eUL), B(0x6UL),
    B(0x005d3927UL), B(0x000096cfUL), B(0x10460925UL), B(0x6UL),
};

const gtc_q31_table_t gtc_rlg_0042_q31 = {
    .layout = 1,
    .quantity = 0UL,
    .unit = 0UL,
    .id = 0xcf4eb7abUL,
    .slope_blocks = 10UL,
    .hold_blocks = 30UL,
    .stuck_samples = 0UL,
    .bias_frac_bits = 35UL,
    .max_step = 65536L,
    .max_slope = 327680L,
    .fallback = 249514756L,
    .scale = { -2151139L, 665513L, -25741L, 85433798L, 6L, 0L },
    .envelope = { -2151088L, 4457366L, -25740L, 25738L },
    .n_networks = 1UL,
    .n_centers = 10UL,
    .n_channels = 1UL,
    .n_terms = 0UL,
    .coverage_cells = { 32UL, 12UL },
    .sigma_cells = { 0UL, 0UL },
    .n_probes = 8UL,
    .networks = q31_networks,
    .centers = q31_centers,
    .terms = NULL,
    .coverage = q31_coverage,
    .sigma = NULL,
    .probes = q31_probes,
    .crc = 0x8cae8027UL,
    .term_code = { NULL },
    .serial = "RLG-0042",
};

