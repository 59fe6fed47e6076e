/* sizes.c - sizes of the structs in C, which the crate's test holds its own against.
 *
 * SPDX-License-Identifier: MIT
 */
#include <stddef.h>

#include "gtc.h"

extern const unsigned long gtc_rust_sizes[8];

const unsigned long gtc_rust_sizes[8] = {
    sizeof(gtc_f32_table_t),    sizeof(gtc_q31_table_t),    sizeof(gtc_f32_state_t), sizeof(gtc_q31_state_t),
    sizeof(gtc_f32_snapshot_t), sizeof(gtc_q31_snapshot_t), sizeof(gtc_f32_angle_t), sizeof(gtc_q31_angle_t),
};
