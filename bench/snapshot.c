/* snapshot.c - instructions of a snapshot in emulated cores: of a correction in force, and of a held one. */
#include "board.h"

#include <stdio.h>

#include "gtc_sim_0003.h"

#define PERIOD_US 1000000UL

#if defined(OF_F32)
#define NAME(x) gtc_f32_##x
#define TABLE gtc_sim_0003_f32
#define C(t) ((float)(t))
typedef float num_t;
#else
#define NAME(x) gtc_q31_##x
#define TABLE gtc_sim_0003_q31
#define C(t) ((int_least32_t)(t) * 65536L)
typedef int_least32_t num_t;
#endif

static NAME(state_t) state;
static NAME(snapshot_t) now;
static volatile int said;

static void nothing(void)
{
}

static void snapshot(void)
{
    said = NAME(snapshot)(&state, &now);
}

static void put(unsigned long number)
{
    int digit;
    for (digit = 28; digit >= 0; digit -= 4) {
        (void)putchar("0123456789abcdef"[(number >> digit) & 15U]);
    }
    (void)putchar('\n');
}

static void measure(void (*volatile function)(void))
{
    const uint_least32_t start = BOARD_TICKS();
    uint_least32_t stop;
    function();
    stop = BOARD_TICKS();
    put((stop - start) & BOARD_TICKS_MASK);
}

int main(void)
{
    int i;
    if (NAME(init)(&state, &TABLE, PERIOD_US) != 0) {
        return 1;
    }
    for (i = 0; i < 300; i++) {
        const num_t t = (num_t)(C(20) + ((num_t)(i % 2) * (C(1) / 64)));
        said = NAME(sample)(&state, PERIOD_US, &t);
    }
    measure(nothing);
    measure(snapshot);
    for (i = 0; i < 55; i++) {
        said = NAME(sample)(&state, PERIOD_US, 0);
    }
    measure(nothing);
    measure(snapshot);
    return (now.age_blocks == 0U) ? 1 : 0;
}
