/* gtc_test_b.h - bias table of gyro TEST-B. Written by gyrotc; do not edit.
 *
 * Serial:      TEST-B
 * Axis:        the only one
 *
 * Valid:       -20.00 ... 60.00 C, -3.000 ... 3.000 C/min; outside, the value at the edge with GTC_CLAMPED
 * Block:       10 s; gtc_<n>_init() takes any sample period of which a whole number makes a block
 * f32:         680 bytes of read-only data, 168 of them parameters; |error| <= 1.72e-05 deg/h against the model (terms excluded)
 * q31:         680 bytes of read-only data, 168 of them parameters; |error| <= 1.33e-03 deg/h against the model (terms excluded)
 * Runtime:     gtc.h and gtc_<n>.c beside it, the smallest that holds it
 *
 * Make again:  gyrotc emit model.json --out .
 * Model:       sha256 f5d6b8c8dd72ef0d4317fc40534deed61797bf0d6e2268a4588ebc5adfdfb741
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
#define GTC_TEST_B_BLOCK_US 10000000UL /* block length, microseconds */
#define GTC_TEST_B_T_MIN_C (-20.00000F) /* envelope: beyond it GTC_CLAMPED */
#define GTC_TEST_B_T_MAX_C (60.00000F) /* envelope: beyond it GTC_CLAMPED */
#define GTC_TEST_B_SLOPE_MIN_C_PER_MIN (-3.000000F) /* envelope: beyond it GTC_CLAMPED */
#define GTC_TEST_B_SLOPE_MAX_C_PER_MIN (3.000000F) /* envelope: beyond it GTC_CLAMPED */
#define GTC_TEST_B_PERIOD_MIN_US 10UL /* shortest sample period, microseconds */
#define GTC_TEST_B_PERIOD_MAX_US 10010000UL /* longest sample period */
#define GTC_TEST_B_STUCK_US 30000000UL /* a temperature that stays the same so long is none; 0: never, the recordings do not show after what time */
#define GTC_TEST_B_AUTHORITY_MIN_DPH (-4.31673837F) /* no correction lies below it, deg/h: margin 25% of range */
#define GTC_TEST_B_AUTHORITY_MAX_DPH (6.18734455F) /* no correction lies above it, deg/h: margin 25% of range */
#define GTC_TEST_B_N_CHANNELS 1 /* numbers of a sample */
#define GTC_TEST_B_CHANNEL_0 "temperature_c" /* C, of the gyro's own sensor */
#define GTC_TEST_B_F32_TABLE_BYTES 680UL /* read-only data, with pointers of 32 bits */
#define GTC_TEST_B_Q31_BIAS_FRAC_BITS 24 /* bias in 2^-this deg/h */
#define GTC_TEST_B_Q31_TABLE_BYTES 680UL /* read-only data, with pointers of 32 bits */

extern const gtc_f32_table_t gtc_test_b_f32;
extern const gtc_q31_table_t gtc_test_b_q31;

#ifdef __cplusplus
}
#endif

#endif
