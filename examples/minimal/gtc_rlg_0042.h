/* gtc_rlg_0042.h - bias table of gyro RLG-0042. Written by gyrotc; do not edit.
 *
 * Serial:      RLG-0042
 * Axis:        the only one
 * calibrated_on: 2026-03-07
 * description: The paper's environments, a gyro whose bias waves strongly over temperature (simulated)
 * simulated:   True
 *
 * Valid:       -32.82 ... 68.01 C, -2.357 ... 2.356 C/min; outside, the value at the edge with GTC_CLAMPED
 * Block:       10 s; samples_per_block of gtc_<n>_init() = 10 s / sample period of the target
 * f32:         224 bytes of table; |error| <= 1.16e-07 deg/h against the model (terms excluded)
 * q31:         224 bytes of table; |error| <= 1.24e-06 deg/h against the model (terms excluded)
 *
 * Make again:  gyrotc emit model.json --out .
 * Model:       sha256 3a1d04c46810450057e0c6c72e7ff517857928ac6b3d5846b106b6b3fe4c19d7
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

extern const gtc_f32_table_t gtc_rlg_0042_f32;
extern const gtc_q31_table_t gtc_rlg_0042_q31;

#ifdef __cplusplus
}
#endif

#endif
