/* libc_shim.c - loops around the runtime's functions, so that tests call C once for many inputs. */
#include <stddef.h>

#include "gtc.h"

/* Samples that did not arrive; a call takes a time of less than 2^32 microseconds. */
#define MISSED(n, state, table, count, period, status)                                                   \
    do {                                                                                          \
        uint_least32_t left = (count);                                                            \
        const uint_least32_t most = 0xE0000000UL / (period);                                      \
        while (left > 0U) {                                                                       \
            const uint_least32_t now = (left < most) ? left : most;                               \
            (status) = gtc_##n##_sample((state), (table), now * (period), NULL);                           \
            left -= now;                                                                          \
        }                                                                                         \
    } while (0)

#define SHIM(n, num)                                                                              \
    size_t shim_##n##_state_size(void);                                                           \
    void shim_##n##_maps(const gtc_##n##_table_t *table, const num *in, long n_in, int *status,   \
                         num *bias);                                                              \
    void shim_##n##_steps(gtc_##n##_state_t *state, const gtc_##n##_table_t *table, const num *channels, long n_channels,         \
                          const uint_least32_t *missed, long rows, int *status, num *bias);       \
    void shim_##n##_snapshots(gtc_##n##_state_t *state, const gtc_##n##_table_t *table, const num *channels, long n_channels,     \
                              const uint_least32_t *missed, long rows, int *status, num *out);    \
    void shim_##n##_calls(gtc_##n##_state_t *state, const gtc_##n##_table_t *table,               \
                          uint_least32_t period_us, const int *kind,                              \
                          const uint_least32_t *number, const num *values, long n_channels,       \
                          long rows, int *status, num *out);                                      \
    size_t shim_##n##_state_size(void)                                                            \
    {                                                                                             \
        return sizeof(gtc_##n##_state_t);                                                         \
    }                                                                                             \
    void shim_##n##_maps(const gtc_##n##_table_t *table, const num *in, long n_in, int *status,   \
                         num *bias)                                                               \
    {                                                                                             \
        long i;                                                                                   \
        for (i = 0; i < n_in; i++) {                                                              \
            bias[i] = 0;                                                                          \
            status[i] = gtc_##n##_map(table, in[2 * i], in[(2 * i) + 1], &bias[i]);               \
        }                                                                                         \
    }                                                                                             \
    void shim_##n##_steps(gtc_##n##_state_t *state, const gtc_##n##_table_t *table, const num *channels, long n_channels,         \
                          const uint_least32_t *missed, long rows, int *status, num *bias)        \
    {                                                                                             \
        long i;                                                                                   \
        for (i = 0; i < rows; i++) {                                                              \
            status[3 * i] = 0;                                                                    \
            MISSED(n, state, table, missed[i], state->period_us, status[3 * i]);                         \
            status[(3 * i) + 1] = gtc_##n##_sample(state, table, state->period_us, &channels[i * n_channels]); \
            status[(3 * i) + 2] = gtc_##n##_bias(state, table, &bias[i]);                                \
        }                                                                                         \
    }                                                                                             \
    void shim_##n##_snapshots(gtc_##n##_state_t *state, const gtc_##n##_table_t *table, const num *channels, long n_channels,     \
                              const uint_least32_t *missed, long rows, int *status, num *out)     \
    {                                                                                             \
        long i;                                                                                   \
        for (i = 0; i < rows; i++) {                                                              \
            gtc_##n##_snapshot_t snapshot = {0, 0, 0, 0U, 0};                                      \
            MISSED(n, state, table, missed[i], state->period_us, status[4 * i]);                         \
            status[4 * i] = gtc_##n##_sample(state, table, state->period_us, &channels[i * n_channels]); \
            status[(4 * i) + 1] = gtc_##n##_snapshot(state, table, &snapshot);                           \
            status[(4 * i) + 2] = snapshot.status;                                                \
            status[(4 * i) + 3] = (int)snapshot.age_blocks;                                       \
            out[3 * i] = snapshot.bias;                                                           \
            out[(3 * i) + 1] = snapshot.sigma;                                                    \
            out[(3 * i) + 2] = snapshot.correlation_s;                                            \
        }                                                                                         \
    }                                                                                             \
    void shim_##n##_calls(gtc_##n##_state_t *state, const gtc_##n##_table_t *table,               \
                          uint_least32_t period_us, const int *kind,                              \
                          const uint_least32_t *number, const num *values, long n_channels,       \
                          long rows, int *status, num *out)                                       \
    {                                                                                             \
        gtc_word_t words[GTC_SAVE_WORDS];                                                         \
        uint_least32_t clock_us = 0U - period_us;                                                 \
        long i;                                                                                   \
        for (i = 0; i < rows; i++) {                                                              \
            gtc_##n##_snapshot_t snapshot = {0, 0, 0, 0U, 0};                                     \
            const num *const at = &values[i * n_channels];                                        \
            double sum = 0.0;                                                                     \
            long k;                                                                               \
            int done = 0;                                                                         \
            switch (kind[i]) {                                                                    \
            case 0: done = gtc_##n##_sample(state, table, period_us, at); break;                         \
            case 1: /* the time that a clock shows, which was at 0 a period before the first sample */ \
                done = gtc_##n##_sample(state, table, number[i] - clock_us, at);                         \
                clock_us = number[i];                                                             \
                break;                                                                            \
            case 2: MISSED(n, state, table, number[i], period_us, done); break;                          \
            case 3: /* the mean of what the calls before it gave is taken off */                  \
                for (k = i - (long)number[i]; k < i; k++) {                                       \
                    sum += (double)out[2 * k];                                                    \
                }                                                                                 \
                done = gtc_##n##_rezero(state, table, at[0] - (num)(sum / number[i]), number[i]);        \
                break;                                                                            \
            case 4:                                                                               \
                done = gtc_##n##_save(state, table, words);                                              \
                done = gtc_##n##_restore(state, table, period_us, words, number[i]);              \
                break;                                                                            \
            default: done = gtc_##n##_init(state, table, period_us); break;                       \
            }                                                                                     \
            status[2 * i] = done;                                                                 \
            status[(2 * i) + 1] = gtc_##n##_snapshot(state, table, &snapshot);                           \
            out[2 * i] = snapshot.bias;                                                           \
            out[(2 * i) + 1] = snapshot.sigma;                                                    \
        }                                                                                         \
    }

SHIM(f32, float)
SHIM(q31, int_least32_t)

/* Claims of GTC_ASSERT that did not hold; see libc_counted.h. */
extern long shim_out_of_range;
long shim_out_of_range;
