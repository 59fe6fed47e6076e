/* gtc_sim_0003.h - bias table of gyro SIM-0003. Written by gyrotc; do not edit.
 *
 * Serial:      SIM-0003
 * Axis:        the only one
 * calibrated_on: 2026-03-07
 * description: The six environments of Ding et al. 2014, twice (simulated)
 * earth_rate:  none
 * simulated:   True
 *
 * Valid:       -32.75 ... 67.98 C, -2.360 ... 2.355 C/min; outside, the value at the edge with GTC_CLAMPED
 * Block:       10 s; gtc_<n>_init() takes any sample period of which a whole number makes a block
 * f32:         924 bytes of read-only data, 104 of them parameters; |error| <= 1.23e-08 deg/h against the model (terms excluded)
 * Runtime:     gtc.h and gtc_<n>.c beside it, the smallest that holds it
 *
 * Make again:  gyrotc emit model.json --out . --numeric f32
 * Model:       sha256 7d7f521155691e1ad07a89071ee00c9c1df2362b8a2ea0efb56daf7212558c21
 *
 * The numbers belong to the owner of the gyro's recordings.
 */
#ifndef GTC_SIM_0003_H_INCLUDED
#define GTC_SIM_0003_H_INCLUDED

#include "gtc.h"

#ifdef __cplusplus
extern "C" {
#endif

#define GTC_SIM_0003_ID 0xe32c4e66UL /* for gtc_<n>_open() */
#define GTC_SIM_0003_BLOCK_US 10000000UL /* block length, microseconds */
#define GTC_SIM_0003_T_MIN_C (-32.74800F) /* envelope: beyond it GTC_CLAMPED */
#define GTC_SIM_0003_T_MAX_C (67.97957F) /* envelope: beyond it GTC_CLAMPED */
#define GTC_SIM_0003_SLOPE_MIN_C_PER_MIN (-2.360364F) /* envelope: beyond it GTC_CLAMPED */
#define GTC_SIM_0003_SLOPE_MAX_C_PER_MIN (2.355200F) /* envelope: beyond it GTC_CLAMPED */
#define GTC_SIM_0003_PERIOD_MIN_US 10UL /* shortest sample period, microseconds */
#define GTC_SIM_0003_PERIOD_MAX_US 10010000UL /* longest sample period */
#define GTC_SIM_0003_STUCK_US 0UL /* a temperature that stays the same so long is none; 0: never, the recordings do not show after what time */
#define GTC_SIM_0003_AUTHORITY_MIN_DPH (0.00000000F) /* no correction lies below it, deg/h: margin 25% of range */
#define GTC_SIM_0003_AUTHORITY_MAX_DPH (0.00887281820F) /* no correction lies above it, deg/h: margin 25% of range */
#define GTC_SIM_0003_N_CHANNELS 1 /* numbers of a sample */
#define GTC_SIM_0003_CHANNEL_0 "temperature_c" /* C, of the gyro's own sensor */
#define GTC_SIM_0003_F32_TABLE_BYTES 924UL /* read-only data, with pointers of 32 bits */

extern const gtc_f32_table_t gtc_sim_0003_f32;

#ifdef __cplusplus
}
#endif

#endif
