/* main_freertos.c - the port to FreeRTOS: the tick's hook is the interrupt, a task of its own reads the thermometer.
 *
 * SPDX-License-Identifier: MIT
 */
#define _DEFAULT_SOURCE

#include <unistd.h>

#include "FreeRTOS.h"
#include "task.h"

#include "app.h"

#define TICKS_A_SECOND 64U /* of the example's seconds: a tick is an increment */

static volatile int running;
static int verdict = 1;

void vApplicationTickHook(void)
{
    if (running != 0) {
        app_interrupt();
    }
}

/* The simulator's idle task would take all of a processor. */
void vApplicationIdleHook(void)
{
    (void)usleep(200);
}

static void thermometer(void *unused)
{
    int second;

    (void)unused;
    running = 1;
    for (second = 0; second < APP_SECONDS; second++) {
        vTaskDelay(TICKS_A_SECOND);
        app_second();
    }
    running = 0;
    verdict = app_verdict();
    vTaskEndScheduler();
}

int main(void)
{
    if ((app_start() != 0)
        || (xTaskCreate(thermometer, "thermometer", configMINIMAL_STACK_SIZE * 4U, NULL, 1, NULL) != pdPASS)) {
        return 1;
    }
    vTaskStartScheduler();
    return verdict;
}
