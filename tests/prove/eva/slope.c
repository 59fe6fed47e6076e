/* slope.c - the slope over every window: any pattern of holes, any block means. */
#include "arithmetic.h"

#include RUNTIME

int main(void)
{
    static NAME(state_t) state;
    num_t slope = 0;
    unsigned k;
    int_least32_t remark;
    state.filled = Frama_C_unsigned_long_interval(0, THE_TABLE.slope_blocks);
    state.window_valid = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
    for (k = 0; k < GTC_MAX_SLOPE_BLOCKS; k++) {
        state.window[k] = ANY_PLAUSIBLE();
    }
    remark = window_slope(&state, &THE_TABLE, &slope);
    //@ check remark == 0 || remark == 1;
    //@ check FINITE(slope) && -STEEPEST <= slope <= STEEPEST;
    return (int)remark;
}
