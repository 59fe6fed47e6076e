/* gtc_test_h.h - bias table of gyro TEST-H. Written by gyrotc; do not edit.
 *
 * Serial:      TEST-H
 * Axis:        the only one
 *
 * Valid:       -20.00 ... 60.00 C, -3.000 ... 3.000 C/min; outside, the value at the edge with GTC_CLAMPED
 * Block:       10 s; samples_per_block of gtc_<n>_init() = 10 s / sample period of the target
 * f32:         112 bytes of table; |error| <= 3.86e-05 deg/h against the model (terms excluded)
 * q31:         112 bytes of table; |error| <= 6.70e-04 deg/h against the model (terms excluded)
 *
 * Make again:  gyrotc emit model.json --out .
 * Model:       sha256 adf08e9dfa037bbd373289000f492c464a10333a630974ff949247a647933cf2
 *
 * The numbers belong to the owner of the gyro's recordings.
 */
#ifndef GTC_TEST_H_H_INCLUDED
#define GTC_TEST_H_H_INCLUDED

#include "gtc.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GTC_TEST_H_ID 0x249b7146UL /* for gtc_<n>_open() */

extern const gtc_f32_table_t gtc_test_h_f32;
extern const gtc_q31_table_t gtc_test_h_q31;

#ifdef __cplusplus
}
#endif

#endif
