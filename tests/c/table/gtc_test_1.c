/* gtc_test_1.c - bias table of gyro TEST-1. Written by gyrotc; do not edit.
 *
 * Make again:  gyrotc emit model.json --out .
 * Model:       sha256 d4ce3603c7d9210bfe801a5d28ff92acfa634eccb25118938ed8638294f88cfd
 *
 * The numbers in this file belong to the owner of the gyro's recordings.
 */
#include "gtc_test_1.h"

#include <stddef.h>

#if GTC_TABLE_LAYOUT != 1
#error "gtc_test_1.c was written for table layout 1: emit it again with the gyrotc of this runtime"
#endif

/* ---- float32 ---- */

/* centers, w0, linear in T and slope, region: T min, max, slope min, max */
static const gtc_word_t f32_networks[8] = {
    { .bits = 0x3UL }, { .value = 0.125F }, { .value = 0.5F }, { .value = -0.25F }, { .value = -20.0F }, { .value = 60.0F }, { .value = -0.5F }, { .value = 0.5F },
};

/* T: center, gain; slope: center, gain; weight */
static const gtc_word_t f32_centers[15] = {
    { .value = -0.75F }, { .value = 24.0224476F }, { .value = 0.166666985F }, { .value = 9.60897923F }, { .value = 0.75F },
    { .value = 0.0F }, { .value = 16.0149651F }, { .value = 0.0F }, { .value = 0.0F }, { .value = -1.25F },
    { .value = 0.0F }, { .value = 0.0F }, { .value = -0.5F }, { .value = 13.7271128F }, { .value = 0.3125F },
};

/* one bit for each cell of T (fastest) and slope, low bit first */
static const gtc_word_t f32_coverage[1] = {
    { .bits = 0xfc7f0fUL },
};

/* 1 sigma of the compensated bias, a row for each cell of slope */
static const gtc_word_t f32_sigma[2] = {
    { .value = 0.00999999978F }, { .value = 0.0199999996F },
};

/* known answers: T, slope, bias, status */
static const gtc_word_t f32_probes[32] = {
    { .value = 40.390213F }, { .value = 0.0698402897F }, { .value = -0.12677373F }, { .bits = 0x0UL },
    { .value = 20.780426F }, { .value = -0.360319406F }, { .value = -0.642388165F }, { .bits = 0x4UL },
    { .value = 1.17063987F }, { .value = 0.209520876F }, { .value = -0.402597129F }, { .bits = 0x0UL },
    { .value = -18.439146F }, { .value = -0.220638841F }, { .value = 0.361409187F }, { .bits = 0x0UL },
    { .value = 41.9510651F }, { .value = 0.349201441F }, { .value = -0.300033271F }, { .bits = 0x0UL },
    { .value = 22.34128F }, { .value = -0.0809582546F }, { .value = -0.784616113F }, { .bits = 0x0UL },
    { .value = -40.0F }, { .value = -0.75F }, { .value = 0.115000188F }, { .bits = 0x2UL },
    { .value = 80.0F }, { .value = 0.75F }, { .value = 0.300446272F }, { .bits = 0x2UL },
};

const gtc_f32_table_t gtc_test_1_f32 = {
    .layout = 1,
    .quantity = 0UL,
    .unit = 0UL,
    .id = 0x362c9816UL,
    .slope_blocks = 4UL,
    .hold_blocks = 2UL,
    .stuck_samples = 12UL,
    .bias_frac_bits = 0UL,
    .max_step = { .value = 0.5F },
    .max_slope = { .value = 1.0F },
    .fallback = { .value = 0.375F },
    .scale = { { .value = 20.0F }, { .value = 0.0250000004F }, { .value = 2.0F } },
    .envelope = { { .value = -20.0F }, { .value = 60.0F }, { .value = -0.5F }, { .value = 0.5F } },
    .n_networks = 1UL,
    .n_centers = 3UL,
    .n_channels = 1UL,
    .n_terms = 0UL,
    .coverage_cells = { 8UL, 3UL },
    .sigma_cells = { 2UL, 1UL },
    .n_probes = 8UL,
    .networks = f32_networks,
    .centers = f32_centers,
    .terms = NULL,
    .coverage = f32_coverage,
    .sigma = f32_sigma,
    .probes = f32_probes,
    .crc = 0x7b3f8558UL,
    .term_code = { NULL },
    .serial = "TEST-1",
};

