/* gtc_test_b.h - bias table of gyro TEST-B. Written by gyrotc; do not edit.
 *
 * Serial:      TEST-B
 * Axis:        the only one
 *
 * Valid:       -20.00 ... 60.00 C, -3.000 ... 3.000 C/min; outside, the value at the edge with GTC_CLAMPED
 * Block:       10 s; samples_per_block of gtc_<n>_init() = 10 s / sample period of the target
 * f32:         168 bytes of table; |error| <= 1.72e-05 deg/h against the model (terms excluded)
 * q31:         168 bytes of table; |error| <= 1.33e-03 deg/h against the model (terms excluded)
 *
 * Make again:  gyrotc emit model.json --out .
 * Model:       sha256 0374aec108631ddcb9a02445533048310f123884a4bd4516573b7ad2a976a4e3
 *
 * The numbers belong to the owner of the gyro's recordings.
 */
#ifndef GTC_TEST_B_H_INCLUDED
#define GTC_TEST_B_H_INCLUDED

#include "gtc.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GTC_TEST_B_ID 0xc44e9858UL /* for gtc_<n>_open() */

extern const gtc_f32_table_t gtc_test_b_f32;
extern const gtc_q31_table_t gtc_test_b_q31;

#ifdef __cplusplus
}
#endif

#endif
