/* gtc_test_c.h - bias table of gyro TEST-C. Written by gyrotc; do not edit.
 *
 * Serial:      TEST-C
 * Axis:        the only one
 *
 * Valid:       -20.00 ... 60.00 C, -3.000 ... 3.000 C/min; outside, the value at the edge with GTC_CLAMPED
 * Block:       10 s; gtc_<n>_init() takes any sample period of which a whole number makes a block
 * f32:         648 bytes of read-only data, 132 of them parameters; |error| <= 5.51e-06 deg/h against the model (terms excluded, curves and products of channels: 3.74e-06)
 * q31:         648 bytes of read-only data, 132 of them parameters; |error| <= 9.38e-05 deg/h against the model (terms excluded, curves and products of channels: 2.17e-05)
 * Runtime:     gtc.h and gtc_<n>.c beside it, the smallest that holds it
 *
 * Make again:  gyrotc emit model.json --out .
 * Model:       sha256 4c32da67ac31e58cc72a06b76fef5ea5c9930215ae810dd1868e2ce94d4363dc
 *
 * The numbers belong to the owner of the gyro's recordings.
 */
#ifndef GTC_TEST_C_H_INCLUDED
#define GTC_TEST_C_H_INCLUDED

#include "gtc.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GTC_TEST_C_ID 0xb349a8ceUL /* for gtc_<n>_open() */
#define GTC_TEST_C_BLOCK_US 10000000UL /* block length, microseconds */
#define GTC_TEST_C_T_MIN_C (-20.00000F) /* envelope: beyond it GTC_CLAMPED */
#define GTC_TEST_C_T_MAX_C (60.00000F) /* envelope: beyond it GTC_CLAMPED */
#define GTC_TEST_C_SLOPE_MIN_C_PER_MIN (-3.000000F) /* envelope: beyond it GTC_CLAMPED */
#define GTC_TEST_C_SLOPE_MAX_C_PER_MIN (3.000000F) /* envelope: beyond it GTC_CLAMPED */
#define GTC_TEST_C_PERIOD_MIN_US 10UL /* shortest sample period, microseconds */
#define GTC_TEST_C_PERIOD_MAX_US 10010000UL /* longest sample period */
#define GTC_TEST_C_STUCK_US 0UL /* a temperature that stays the same so long is none; 0: never, the recordings do not show after what time */
#define GTC_TEST_C_AUTHORITY_MIN_DPH (-9.18306351F) /* no correction lies below it, deg/h: margin 25% of range */
#define GTC_TEST_C_AUTHORITY_MAX_DPH (9.26056099F) /* no correction lies above it, deg/h: margin 25% of range */
#define GTC_TEST_C_N_CHANNELS 2 /* numbers of a sample */
#define GTC_TEST_C_CHANNEL_0 "temperature_c" /* C, of the gyro's own sensor */
#define GTC_TEST_C_CHANNEL_1 "supply_v" /* unit as recorded */
#define GTC_TEST_C_F32_TABLE_BYTES 648UL /* read-only data, with pointers of 32 bits */
#define GTC_TEST_C_Q31_BIAS_FRAC_BITS 24 /* bias in 2^-this deg/h */
#define GTC_TEST_C_Q31_TABLE_BYTES 648UL /* read-only data, with pointers of 32 bits */

extern const gtc_f32_table_t gtc_test_c_f32;
extern const gtc_q31_table_t gtc_test_c_q31;

#ifdef __cplusplus
}
#endif

#endif
