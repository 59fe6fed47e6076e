/* gtc_test_h.h - bias table of gyro TEST-H. Written by gyrotc; do not edit.
 *
 * Serial:      TEST-H
 * Axis:        the only one
 *
 * Valid:       -20.00 ... 60.00 C, -3.000 ... 3.000 C/min; outside, the value at the edge with GTC_CLAMPED
 * Block:       10 s; gtc_<n>_init() takes any sample period of which a whole number makes a block
 * f32:         532 bytes of read-only data, 112 of them parameters; |error| <= 3.86e-05 deg/h against the model (terms excluded)
 * q31:         532 bytes of read-only data, 112 of them parameters; |error| <= 6.70e-04 deg/h against the model (terms excluded)
 * Runtime:     gtc.h and gtc_<n>.c beside it, the smallest that holds it
 *
 * Make again:  gyrotc emit model.json --out .
 * Model:       sha256 a6ca9f40548225b74f2d1e43b12ab312cbd0dace3692ad95ebd7989de54d7c23
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
#define GTC_TEST_H_BLOCK_US 10000000UL /* block length, microseconds */
#define GTC_TEST_H_T_MIN_C (-20.00000F) /* envelope: beyond it GTC_CLAMPED */
#define GTC_TEST_H_T_MAX_C (60.00000F) /* envelope: beyond it GTC_CLAMPED */
#define GTC_TEST_H_SLOPE_MIN_C_PER_MIN (-3.000000F) /* envelope: beyond it GTC_CLAMPED */
#define GTC_TEST_H_SLOPE_MAX_C_PER_MIN (3.000000F) /* envelope: beyond it GTC_CLAMPED */
#define GTC_TEST_H_PERIOD_MIN_US 10UL /* shortest sample period, microseconds */
#define GTC_TEST_H_PERIOD_MAX_US 10010000UL /* longest sample period */
#define GTC_TEST_H_STUCK_US 30000000UL /* a temperature that stays the same so long is none; 0: never, the recordings do not show after what time */
#define GTC_TEST_H_AUTHORITY_MIN_DPH (-70.3042145F) /* no correction lies below it, deg/h: margin 25% of range */
#define GTC_TEST_H_AUTHORITY_MAX_DPH (69.7087097F) /* no correction lies above it, deg/h: margin 25% of range */
#define GTC_TEST_H_N_CHANNELS 1 /* numbers of a sample */
#define GTC_TEST_H_CHANNEL_0 "temperature_c" /* C, of the gyro's own sensor */
#define GTC_TEST_H_F32_TABLE_BYTES 532UL /* read-only data, with pointers of 32 bits */
#define GTC_TEST_H_Q31_BIAS_FRAC_BITS 24 /* bias in 2^-this deg/h */
#define GTC_TEST_H_Q31_TABLE_BYTES 532UL /* read-only data, with pointers of 32 bits */

extern const gtc_f32_table_t gtc_test_h_f32;
extern const gtc_q31_table_t gtc_test_h_q31;

#ifdef __cplusplus
}
#endif

#endif
