/* counted.c - instructions of every public function on an emulated core: the most of many calls, among them those
 * that lead to the longest ways: blocks that close and restart in one sample, every block until a channel is lost,
 * channels that never show anything, increments that do not fit, states after a long time without power. Prints, for each function, its name, calls and ticks, an empty call taken
 * off. Bounds are held against these (bench/bounds.py). */
#include "board.h"

#include <stdio.h>

#include "counted.h" /* NAME, NUM, TABLE, ID, N_CHANNELS, PERIOD_BLOCK, image */

#define CALLS 400

typedef NAME(table_t) table_t;
typedef NAME(state_t) state_t;
typedef NAME(snapshot_t) snapshot_t;
typedef NAME(angle_t) angle_t;

static const table_t *const table = &TABLE;
static table_t opened;
static state_t state;
static snapshot_t now;
static angle_t angle;
static gtc_word_t words[GTC_SAVE_WORDS];
static NUM channels[N_CHANNELS];
static NUM temp, slope, bias, rate, dt;
static uint_least32_t period = PERIOD_BLOCK, count, elapsed_us, off, seconds;
static const NUM *read = channels; /* NULL: nothing was read */
static uint_least32_t seed = 2463534242UL; /* Marsaglia, "Xorshift RNGs", 2003 */
static volatile int said;
static int alone; /* 1: further channels show nothing, so that fallback models do */

typedef struct {
    uint_least32_t calls, most, empty;
} cost_t;

#define FUNCTION(f, parameters, arguments)                                                         \
    static int nothing_##f parameters                                                              \
    {                                                                                              \
        return 0;                                                                                  \
    }                                                                                              \
    static int(*volatile to_##f) parameters = nothing_##f;                                         \
    static cost_t cost_##f;                                                                        \
    static __attribute__((noinline)) void go_##f(void)                                             \
    {                                                                                              \
        const uint_least32_t start = BOARD_TICKS();                                                \
        uint_least32_t ticks;                                                                      \
        said = to_##f arguments;                                                                   \
        ticks = (BOARD_TICKS() - start) & BOARD_TICKS_MASK;                                        \
        cost_##f.calls++;                                                                          \
        cost_##f.most = (ticks > cost_##f.most) ? ticks : cost_##f.most;                           \
    }                                                                                              \
    static void begin_##f(void)                                                                    \
    {                                                                                              \
        go_##f();                                                                                  \
        cost_##f.empty = cost_##f.most;                                                            \
        cost_##f.calls = 0U;                                                                       \
        cost_##f.most = 0U;                                                                        \
        to_##f = NAME(f);                                                                          \
    }

FUNCTION(check, (const table_t *t), (table))
FUNCTION(open, (table_t * t, const gtc_word_t *w, uint_least32_t n, uint_least32_t id),
         (&opened, image, sizeof image / sizeof image[0], ID))
FUNCTION(map, (const table_t *t, NUM x, NUM s, NUM *b), (table, temp, slope, &bias))
FUNCTION(init, (state_t * s, const table_t *t, uint_least32_t p), (&state, table, period))
FUNCTION(sample, (state_t * s, uint_least32_t us, const NUM *c), (&state, elapsed_us, read))
FUNCTION(bias, (const state_t *s, NUM *b), (&state, &bias))
FUNCTION(snapshot, (const state_t *s, snapshot_t *to), (&state, &now))
FUNCTION(rezero, (state_t * s, NUM r, uint_least32_t n), (&state, rate, seconds))
FUNCTION(angle, (angle_t * a, NUM b, NUM t, NUM *to), (&angle, bias, dt, &rate))
FUNCTION(save, (const state_t *s, gtc_word_t *w), (&state, words))
FUNCTION(restore, (state_t * s, const table_t *t, uint_least32_t p, const gtc_word_t *w, uint_least32_t n),
         (&state, table, period, words, off))

static void put_hex(uint_least32_t word)
{
    int digit;
    for (digit = 28; digit >= 0; digit -= 4) {
        (void)putchar("0123456789abcdef"[(unsigned)((word >> digit) & 15U)]);
    }
}

static void put(const char *name, const cost_t *cost)
{
    while (*name != '\0') {
        (void)putchar(*name);
        name++;
    }
    (void)putchar(' ');
    put_hex(cost->calls);
    (void)putchar(' ');
    put_hex(cost->most - cost->empty);
    (void)putchar('\n');
}

static uint_least32_t draw(uint_least32_t below)
{
    seed ^= (seed << 13) & 0xFFFFFFFFUL;
    seed ^= seed >> 17;
    seed ^= (seed << 5) & 0xFFFFFFFFUL;
    return (uint_least32_t)(((uint_least64_t)seed * below) >> 32);
}

/* low + (high - low) part / 256, part from -64 to 320: a quarter beyond either end */
static NUM between(NUM low, NUM high, int part)
{
    return low + (((high / 256) - (low / 256)) * (NUM)part);
}

static NUM somewhere(uint_least32_t channel, uint_least32_t beyond)
{
    const int part = (int)draw(256U + (2U * beyond)) - (int)beyond;
    if (channel == 0U) {
        return between(EDGE(table->envelope[0]), EDGE(table->envelope[1]), part);
    }
    return between(WORD(table->guards[8U * channel]), WORD(table->guards[(8U * channel) + 1U]), part);
}

static NUM none(void)
{
    gtc_word_t word;
    word.bits = MISSING;
    return WORD(word);
}

static void all_somewhere(uint_least32_t beyond)
{
    uint_least32_t c;
    for (c = 0U; c < N_CHANNELS; c++) {
        channels[c] = ((alone != 0) && (c != 0U)) ? none() : somewhere(c, beyond);
    }
}

static void wander(uint_least32_t c)
{
    const uint_least32_t how = draw(64U);
    if ((how == 1U) || ((alone != 0) && (c != 0U))) {
        channels[c] = none();
    } else if (how == 0U) {
        channels[c] = somewhere(c, 64U);
    } else {
        channels[c] += between(0, (c == 0U) ? EDGE(table->envelope[1]) : 0, 1) / (NUM)(16 + (int)draw(64U));
    }
}

/* A sample a period after the one before. */
static void go_next(void)
{
    elapsed_us = period;
    go_sample();
}

/* Half of a block and more at one place, then at another one until it is accepted: where the guard takes that long,
 * the sample that opens the next block closes a whole one and starts anew. */
static void jump(uint_least32_t samples)
{
    uint_least32_t k;
    all_somewhere(0U);
    for (k = 0U; k < (samples * 22U); k++) {
        go_next();
    }
    for (k = 0U; k < ((samples + 1U) / 2U); k++) {
        go_next();
    }
    all_somewhere(64U);
    for (k = 0U; k < samples; k++) {
        go_next();
    }
}

static void history(uint_least32_t samples)
{
    uint_least32_t k;
    uint_least32_t c;
    period = PERIOD_BLOCK / samples;
    go_init();
    for (k = 0U; k < CALLS; k++) {
        for (c = 0U; c < N_CHANNELS; c++) {
            wander(c);
        }
        go_next();
        go_bias();
        go_snapshot();
        if ((k % 16U) == 15U) {
            rate = between(0, EDGE(table->authority[1]), (int)draw(512U) - 256);
            seconds = 1U + draw(4000U);
            go_rezero();
            go_bias();
            go_next();
        }
        if (draw(40U) == 0U) {
            channels[0] = somewhere(0U, 64U);
        }
    }
    seconds = 0U;
    go_rezero();
}

/* A block that is whole, then nothing for as long as can be. */
static void outage(uint_least32_t samples, uint_least32_t for_samples, int then_read)
{
    uint_least32_t k;
    period = PERIOD_BLOCK / samples;
    go_init();
    all_somewhere(0U);
    for (k = 0U; k < (samples * 24U); k++) {
        go_next();
        go_snapshot();
    }
    elapsed_us = for_samples * period;
    if (then_read != 0) {
        all_somewhere(64U);
    } else {
        read = NULL;
    }
    go_sample();
    read = channels;
    go_snapshot();
    go_bias();
}

/* The uncertainty as late as the count of blocks goes. */
static void late(uint_least32_t blocks)
{
    all_somewhere(0U);
    channels[0] = between(EDGE(table->envelope[0]), EDGE(table->envelope[1]), 128);
    period = PERIOD_BLOCK / 4U;
    off = 0U;
    go_init();
    for (count = 0U; count < 3U; count++) {
        go_next();
    }
    state.elapsed = blocks; /* of a state that has run for so long */
    state.uncertainty.terms_since = 0U;
    channels[0] = none();
    for (count = 0U; count < 8U; count++) {
        go_next();
        go_snapshot();
        rate = between(0, EDGE(table->authority[1]), 1);
        seconds = 1U;
        go_rezero();
    }
}

static void power(uint_least32_t without, uint_least32_t samples)
{
    uint_least32_t k;
    period = PERIOD_BLOCK / samples;
    off = 0U;
    go_save();
    off = without;
    go_restore();
    off = 0U;
    for (k = 0U; k < 3U; k++) {
        go_next();
        go_bias();
    }
    go_restore();
}

static void begin(void)
{
    begin_check();
    begin_open();
    begin_map();
    begin_init();
    begin_sample();
    begin_bias();
    begin_snapshot();
    begin_rezero();
    begin_angle();
    begin_save();
    begin_restore();
}

int main(void)
{
    static const uint_least32_t blocks[] = {1U, 2U, 4U, 10U};
    uint_least32_t k;
    begin();
    go_check();
    go_open();
    for (k = 0U; k < CALLS; k++) {
        temp = somewhere(0U, 64U);
        slope = between(EDGE(table->envelope[2]), EDGE(table->envelope[3]), (int)draw(384U) - 64);
        go_map();
        bias = between(EDGE(table->authority[0]), EDGE(table->authority[1]), (int)draw(256U));
        dt = (NUM)(1 + (int)draw(1000U)) * ((draw(2U) == 0U) ? DT : (DT * 1000));
        go_angle();
        bias = (NUM)draw(0x7FFFFFFFUL); /* beyond what an increment holds */
        go_angle();
        dt = (NUM)(1000000000 - (int_least32_t)draw(1000000UL)); /* and far beyond it */
        go_angle();
    }
    for (k = 0U; k < 8U; k++) {
        uint_least32_t n;
        alone = (k >= 4U) ? 1 : 0;
        history(blocks[k % 4U]);
        for (n = 0U; n < 6U; n++) {
            jump(blocks[k % 4U]);
        }
        power(0U, blocks[k % 4U]);
        power(0x80000000UL, blocks[k % 4U]);
        power(0x7FFFFFFFUL, blocks[k % 4U]);
        for (n = 0U; n < 400U; n += 27U) {
            outage(blocks[k % 4U], 1U + n, (int)(n & 1U));
        }
        outage(blocks[k % 4U], 0x0FFFFFFFUL / PERIOD_BLOCK, 1);
        outage(blocks[k % 4U], 0xE0000000UL / PERIOD_BLOCK, 0);
    }
    alone = 0;
    late(0x7FFFFFUL);
    late(0x800000UL);
    late(0x00FFFFUL);
    go_save();
    off = 1U;
    go_restore();
    put("check", &cost_check);
    put("open", &cost_open);
    put("map", &cost_map);
    put("init", &cost_init);
    put("sample", &cost_sample);
    put("bias", &cost_bias);
    put("snapshot", &cost_snapshot);
    put("rezero", &cost_rezero);
    put("angle", &cost_angle);
    put("save", &cost_save);
    put("restore", &cost_restore);
    return 0;
}
