/* gtc_test_t.h - bias table of gyro TEST-T. Written by gyrotc; do not edit.
 *
 * Serial:      TEST-T
 * Axis:        the only one
 *
 * Valid:       -20.00 ... 60.00 C, -3.000 ... 3.000 C/min; outside, the value at the edge with GTC_CLAMPED
 * Block:       10 s; samples_per_block of gtc_<n>_init() = 10 s / sample period of the target
 * f32:         180 bytes of table; |error| <= 5.51e-06 deg/h against the model (terms excluded)
 * q31:         180 bytes of table; |error| <= 9.37e-05 deg/h against the model (terms excluded)
 *
 * Make again:  gyrotc emit model.json --out .
 * Model:       sha256 379713d8493773e9cc1e583e62b525aeaa89b20647ae49fc604454fa192bfdcd
 *
 * The numbers belong to the owner of the gyro's recordings.
 */
#ifndef GTC_TEST_T_H_INCLUDED
#define GTC_TEST_T_H_INCLUDED

#include "gtc.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GTC_TEST_T_ID 0x309a2d09UL /* for gtc_<n>_open() */

extern const gtc_f32_table_t gtc_test_t_f32;
extern const gtc_q31_table_t gtc_test_t_q31;

#ifdef __cplusplus
}
#endif

#endif
