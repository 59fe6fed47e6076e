/* main_posix.c - the port to a host without an RTOS: a timer's signal is the interrupt, main() the task. Like an
 * interrupt, it comes between any two instructions.
 *
 * SPDX-License-Identifier: MIT
 */
#define _POSIX_C_SOURCE 200809L
#define _XOPEN_SOURCE 700

#include <signal.h>
#include <stddef.h>
#include <stdio.h>
#include <sys/time.h>

#include "app.h"

#define TICKS_A_SECOND 64
#define TICK_US 500 /* emulated seconds pass faster */

static volatile sig_atomic_t ticks;

static void on_tick(int number)
{
    (void)number;
    app_interrupt();
    ticks++;
}

int main(void)
{
    struct sigaction action = { 0 };
    const struct itimerval each = { { 0, TICK_US }, { 0, TICK_US } };
    const struct itimerval never = { { 0, 0 }, { 0, 0 } };
    sigset_t blocked;
    sigset_t before;
    int second;

    if (app_start() != 0) {
        return 1;
    }
    action.sa_handler = on_tick;
    (void)sigemptyset(&action.sa_mask);
    (void)sigemptyset(&blocked);
    (void)sigaddset(&blocked, SIGALRM);
    if ((sigaction(SIGALRM, &action, NULL) != 0) || (setitimer(ITIMER_REAL, &each, NULL) != 0)) {
        return 1;
    }
    for (second = 1; second <= APP_SECONDS; second++) {
        (void)sigprocmask(SIG_BLOCK, &blocked, &before);
        while (ticks < (second * TICKS_A_SECOND)) {
            (void)sigsuspend(&before);
        }
        (void)sigprocmask(SIG_SETMASK, &before, NULL);
        app_second();
    }
    (void)sigprocmask(SIG_BLOCK, &blocked, NULL);
    (void)setitimer(ITIMER_REAL, &never, NULL);
    return app_verdict();
}
