/* threads.c - the rule of gtc.h, who may call what from where, under ThreadSanitizer.
 *
 * A task owns the state, an interrupt (here a thread) the sum of angle increments; a third reads the table. From
 * task to interrupt goes one number. With -DBREAK_THE_RULE the interrupt asks the state itself.
 */
#include <pthread.h>

#include "gtc_rlg_0042.h"

#define STEPS 2000 /* few enough that the sanitizer still knows where each access came from */

static gtc_f32_state_t state;
static float bias_in_force;
static int failed;
static pthread_barrier_t together; /* none has ended before another begins */

static void fail(void)
{
    __atomic_store_n(&failed, 1, __ATOMIC_RELAXED);
}

static void *task(void *unused)
{
    int i;

    (void)pthread_barrier_wait(&together);
    for (i = 0; i < STEPS; i++) {
        const float temperature = 20.0F + (0.001F * (float)(i % 1000));
        gtc_word_t words[GTC_SAVE_WORDS];
        float bias = 0.0F;

        if ((gtc_f32_sample(&state, &gtc_rlg_0042_f32, state.period_us, &temperature) < 0) || (gtc_f32_bias(&state, &gtc_rlg_0042_f32, &bias) < 0)
            || (((i % 100) == 0) && (gtc_f32_save(&state, &gtc_rlg_0042_f32, words) < 0))) {
            fail();
        }
        __atomic_store(&bias_in_force, &bias, __ATOMIC_RELAXED);
    }
    return unused;
}

static void *interrupt(void *unused)
{
    gtc_f32_angle_t sum = {{0.0F, 0.0F}};
    int i;

    (void)pthread_barrier_wait(&together);
    for (i = 0; i < STEPS; i++) {
        float bias = 0.0F;
        float increment = 0.0F;

        __atomic_load(&bias_in_force, &bias, __ATOMIC_RELAXED);
#ifdef BREAK_THE_RULE
        if (gtc_f32_bias(&state, &gtc_rlg_0042_f32, &bias) < 0) {
            fail();
        }
#endif
        if (gtc_f32_angle(&sum, bias, 0.0009765625F, &increment) != GTC_OK) {
            fail();
        }
    }
    return unused;
}

static void *reader(void *unused)
{
    int i;

    (void)pthread_barrier_wait(&together);
    for (i = 0; i < STEPS; i++) {
        float bias = 0.0F;

        if (gtc_f32_map(&gtc_rlg_0042_f32, 20.0F, 0.0F, &bias) < 0) {
            fail();
        }
    }
    return unused;
}

int main(void)
{
    void *(*const bodies[3])(void *) = {task, interrupt, reader};
    pthread_t threads[3];
    int i;

    if (gtc_f32_init(&state, &gtc_rlg_0042_f32, 1000000UL) != GTC_OK) {
        return 1;
    }
    if (pthread_barrier_init(&together, NULL, 3U) != 0) {
        return 1;
    }
    for (i = 0; i < 3; i++) {
        if (pthread_create(&threads[i], NULL, bodies[i], NULL) != 0) {
            return 1;
        }
    }
    for (i = 0; i < 3; i++) {
        (void)pthread_join(threads[i], NULL);
    }
    return failed;
}
