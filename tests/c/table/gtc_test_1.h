/* gtc_test_1.h - bias table of gyro TEST-1. Written by gyrotc; do not edit.
 *
 * Serial:      TEST-1
 * Axis:        the only one
 *
 * Valid:       -20.00 ... 60.00 C, -3.000 ... 3.000 C/min; outside, the value at the edge with GTC_CLAMPED
 * Block:       10 s; samples_per_block of gtc_<n>_init() = 10 s / sample period of the target
 * f32:         84 bytes of table; |error| <= 5.94e-06 deg/h against the model (terms excluded)
 * q31:         84 bytes of table; |error| <= 9.72e-05 deg/h against the model (terms excluded)
 *
 * Make again:  gyrotc emit model.json --out .
 * Model:       sha256 f68b9baa4528dcaebdda8da77596e4744b2d348c40108c9809db48ae82642cbb
 *
 * The numbers belong to the owner of the gyro's recordings.
 */
#ifndef GTC_TEST_1_H_INCLUDED
#define GTC_TEST_1_H_INCLUDED

#include "gtc.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GTC_TEST_1_ID 0x362c9816UL /* for gtc_<n>_open() */

extern const gtc_f32_table_t gtc_test_1_f32;
extern const gtc_q31_table_t gtc_test_1_q31;

#ifdef __cplusplus
}
#endif

#endif
