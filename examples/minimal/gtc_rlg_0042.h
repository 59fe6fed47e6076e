/* gtc_rlg_0042.h - bias table of gyro RLG-0042. Written by gyrotc; do not edit.
 *
 * Serial:      RLG-0042
 * Axis:        the only one
 * calibrated_on: 2026-03-07
 * description: The paper's environments, a gyro whose bias waves strongly over temperature (simulated)
 * simulated:   True
 *
 * Valid:       -32.82 ... 68.01 C, -2.357 ... 2.356 C/min; outside, the value at the edge with GTC_CLAMPED
 * Block:       10 s; gtc_<n>_init() takes any sample period of which a whole number makes a block
 * f32:         676 bytes of read-only data, 224 of them parameters; |error| <= 1.16e-07 deg/h against the model (terms excluded)
 * q31:         676 bytes of read-only data, 224 of them parameters; |error| <= 1.31e-06 deg/h against the model (terms excluded)
 * Runtime:     gtc.h and gtc_<n>.c beside it, the smallest that holds it
 *
 * Make again:  gyrotc emit model.json --out .
 * Model:       sha256 dcfdd3e112ccad432a2d62c8b3766cf7ca205f064fedcb87e6932911ea1c901c
 *
 * The numbers belong to the owner of the gyro's recordings.
 */
#ifndef GTC_RLG_0042_H_INCLUDED
#define GTC_RLG_0042_H_INCLUDED

#include "gtc.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GTC_RLG_0042_ID 0xcf4eb7abUL /* for gtc_<n>_open() */
#define GTC_RLG_0042_BLOCK_US 10000000UL /* block length, microseconds */
#define GTC_RLG_0042_T_MIN_C (-32.82300F) /* envelope: beyond it GTC_CLAMPED */
#define GTC_RLG_0042_T_MAX_C (68.01400F) /* envelope: beyond it GTC_CLAMPED */
#define GTC_RLG_0042_SLOPE_MIN_C_PER_MIN (-2.356546F) /* envelope: beyond it GTC_CLAMPED */
#define GTC_RLG_0042_SLOPE_MAX_C_PER_MIN (2.356364F) /* envelope: beyond it GTC_CLAMPED */
#define GTC_RLG_0042_PERIOD_MIN_US 10UL /* shortest sample period, microseconds */
#define GTC_RLG_0042_PERIOD_MAX_US 10010000UL /* longest sample period */
#define GTC_RLG_0042_STUCK_US 0UL /* a temperature that stays the same so long is none; 0: never, the recordings do not show after what time */
#define GTC_RLG_0042_AUTHORITY_MIN_DPH (0.00000000F) /* no correction lies below it, deg/h: margin 25% of range */
#define GTC_RLG_0042_AUTHORITY_MAX_DPH (0.00946229789F) /* no correction lies above it, deg/h: margin 25% of range */
#define GTC_RLG_0042_N_CHANNELS 1 /* numbers of a sample */
#define GTC_RLG_0042_CHANNEL_0 "temperature_c" /* C, of the gyro's own sensor */
#define GTC_RLG_0042_F32_TABLE_BYTES 676UL /* read-only data, with pointers of 32 bits */
#define GTC_RLG_0042_Q31_BIAS_FRAC_BITS 24 /* bias in 2^-this deg/h */
#define GTC_RLG_0042_Q31_TABLE_BYTES 676UL /* read-only data, with pointers of 32 bits */

extern const gtc_f32_table_t gtc_rlg_0042_f32;
extern const gtc_q31_table_t gtc_rlg_0042_q31;

#ifdef __cplusplus
}
#endif

#endif
