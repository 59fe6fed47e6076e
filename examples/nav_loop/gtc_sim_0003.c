/* gtc_sim_0003.c - bias table of gyro SIM-0003. Written by gyrotc; do not edit.
 *
 * Make again:  gyrotc emit model.json --out . --numeric f32
 * Model:       sha256 7d7f521155691e1ad07a89071ee00c9c1df2362b8a2ea0efb56daf7212558c21
 *
 * The numbers in this file belong to the owner of the gyro's recordings.
 */
#include "gtc_sim_0003.h"

#include <stddef.h>

#if GTC_TABLE_LAYOUT != 3
#error "gtc_sim_0003.c was written for table layout 3: emit it again with the gyrotc of this runtime"
#endif

#define V(x) { .value = (x) } /* a float32 number */
#define B(x) { .bits = (x) }  /* an integer */

/* ---- float32 ---- */

/* four characters of the serial a word, the first one lowest */
static const gtc_word_t f32_serial[16] = {
    B(0x2d4d4953UL), B(0x33303030UL), B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL),
    B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL),
    B(0x0UL), B(0x0UL), B(0x0UL), B(0x0UL),
};

/* centers, w0, linear in T and slope, region: T min, max, slope min, max */
static const gtc_word_t f32_networks[8] = {
    B(0x4UL), V(0.00649090065F), V(0.00167376327F), V(4.38922325e-05F), V(-32.7480011F), V(67.9795685F), V(-0.393393993F), V(0.392533362F),
};

/* T: center, gain; slope: center, gain; weight */
static const gtc_word_t f32_centers[20] = {
    V(-1.23151207F), V(15.0799484F), V(0.679493904F), V(2.34229279F), V(0.00297706272F), /* -44.41 C, +1.604 C/min; widths 0.637, 4.102; +2.977e-03 deg/h */
    V(-0.336914062F), V(38.0346565F), V(-0.174984932F), V(6.24606371F), V(-0.000523493043F), /* 0.65 C, -0.413 C/min; widths 0.253, 1.538; -5.235e-04 deg/h */
    V(-0.0895824432F), V(9.57652473F), V(0.521183014F), V(11.3095169F), V(0.00103976985F), /* 13.10 C, +1.230 C/min; widths 1.003, 0.850; +1.040e-03 deg/h */
    V(0.716838837F), V(30.6837521F), V(-0.617172241F), V(2.38280582F), V(-0.000848994066F), /* 53.72 C, -1.457 C/min; widths 0.313, 4.033; -8.490e-04 deg/h */
};

/* low, high, max_step, max_rate, agree_us, stuck_us, missing_blocks, fallback */
static const gtc_word_t f32_guards[8] = {
    V(-90.0F), V(200.0F), V(1.0F), V(4.99999999e-07F), B(0xf4240UL), B(0x0UL), B(0x1eUL), V(0.0F), /* temperature_c */
};

/* one bit for each cell of T (fastest) and slope, low bit first */
static const gtc_word_t f32_coverage[12] = {
    B(0x7ff8000UL), B(0x1fe1f000UL), B(0x3e001e00UL), B(0x73ffffc0UL), B(0xfe000078UL), B(0xc008000fUL),
    B(0xe0080c03UL), B(0x3e01fc7fUL), B(0x7ffffceUL), B(0xfff07cUL), B(0x1fcff0UL), B(0x1ffc0UL),
};

/* 1 sigma of the compensated bias, a row for each cell of slope */
static const gtc_word_t f32_sigma[92] = {
    V(0.000295534963F), V(0.000196669309F), V(0.000105281266F), V(0.000111965419F), V(0.000115889838F), V(0.000124477185F), V(0.000111126756F), V(0.000108795524F),
    V(7.81529598e-05F), V(8.86400085e-05F), V(9.73413116e-05F), V(0.000101066566F), V(8.00786875e-05F), V(9.85988445e-05F), V(0.000107989254F), V(7.15306451e-05F),
    V(3.96846408e-05F), V(9.61160549e-05F), V(9.11278548e-05F), V(8.87082133e-05F), V(3.82827275e-05F), V(9.18063961e-05F), V(0.000109072949F), V(3.63966101e-05F),
    V(8.3081366e-05F), V(0.000105890882F), V(9.49447058e-05F), V(9.25253189e-05F), V(7.58017413e-05F), V(9.31657414e-05F), V(8.03389848e-05F), V(6.76975324e-05F),
    V(0.000133005655F), V(0.000145868922F), V(0.000137229668F), V(0.000113668888F), V(0.000105408253F), V(0.000104199804F), V(0.000164945246F), V(0.000199569287F),
    V(0.000295534963F), V(0.000196669309F), V(0.000139820069F), V(0.00012682844F), V(0.000103729319F), V(0.000112923779F), V(0.000128866261F), V(0.000124637474F),
    V(0.000116509713F), V(0.000102316932F), V(9.42159968e-05F), V(0.00010299086F), V(8.46504263e-05F), V(0.000101199126F), V(0.000106730578F), V(7.23026824e-05F),
    V(7.07780491e-05F), V(9.67031519e-05F), V(9.60064135e-05F), V(9.98282485e-05F), V(7.34918067e-05F), V(9.18063961e-05F), V(0.00011101905F), V(6.3280102e-05F),
    V(8.00765192e-05F), V(0.000108895016F), V(0.000104629711F), V(9.34005657e-05F), V(6.38461061e-05F), V(8.20482383e-05F), V(0.000100930425F), V(0.000103882769F),
    V(0.000149749016F), V(0.000177271591F), V(0.000110550674F), V(0.00010222647F), V(0.000129201857F), V(0.000137680516F), V(0.000164945246F), V(0.000199569287F),
    V(5.6732064e-05F), V(9.45534424e-08F), V(0.00175561826F), V(0.0001666967F), V(0.0001666967F), V(3.32740055e-05F), V(0.00136249559F), V(0.000412954745F),
    V(0.00757381087F), V(0.0F), V(0.00706595974F), V(1811.91309F),
};

/* known answers: T, slope, bias, status */
static const gtc_word_t f32_probes[32] = {
    V(-30.7827396F), V(-0.17383641F), V(0.0073042782F), B(0x4UL),
    V(63.7994385F), V(0.0506450236F), V(0.0077932016F), B(0x0UL),
    V(47.2195168F), V(-0.292353123F), V(0.00679915398F), B(0x0UL),
    V(-12.2375555F), V(0.38871932F), V(0.00711765187F), B(0x0UL),
    V(33.2130737F), V(-0.160174653F), V(0.0071114148F), B(0x0UL),
    V(-4.37650776F), V(-0.304905087F), V(0.00598517107F), B(0x4UL),
    V(-57.9298935F), V(-0.589875817F), V(0.00699767238F), B(0x6UL),
    V(93.1614609F), V(0.589015186F), V(0.00812261458F), B(0x6UL),
};

const gtc_f32_table_t gtc_sim_0003_f32 = {
    .layout = 3,
    .quantity = 0UL,
    .unit = 0UL,
    .id = 0xe32c4e66UL,
    .calibrated = 20260307UL,
    .block_us = 10000000UL,
    .slope_blocks = 10UL,
    .lead_blocks = 1UL,
    .bias_frac_bits = 0UL,
    .parts = 0x00000700UL,
    .fallback = V(0.00756233465F),
    .authority = { V(0.0F), V(0.0088728182F) },
    .effect = { V(0.0F), V(0.0F) },
    .rezero = V(0.0F),
    .scale = { V(17.6157837F), V(0.0198555365F), V(2.54198074F) },
    .envelope = { V(-32.7480011F), V(67.9795685F), V(-0.393393993F), V(0.392533362F) },
    .n_networks = 1UL,
    .n_centers = 4UL,
    .n_channels = 1UL,
    .n_terms = 0UL,
    .coverage_cells = { 32UL, 12UL },
    .sigma_cells = { 8UL, 5UL },
    .n_sigma = 92UL,
    .n_probes = 8UL,
    .n_fallback_models = 0UL,
    .serial = f32_serial,
    .networks = f32_networks,
    .centers = f32_centers,
    .guards = f32_guards,
    .terms = NULL,
    .coverage = f32_coverage,
    .sigma = f32_sigma,
    .probes = f32_probes,
    .crc = 0x9c26da2cUL,
};

