/* cortexm.c - start-up of a Cortex-M: vector table, FPU, .data, .bss; a fault ends the run. */
#include <stdint.h>

#include "semihost.h"

#define CPACR (*(volatile uint32_t *) 0xE000ED88UL)
#define SYSTICK_CTRL (*(volatile uint32_t *) 0xE000E010UL)
#define SYSTICK_LOAD (*(volatile uint32_t *) 0xE000E014UL)
#define SYSTICK_VALUE (*(volatile uint32_t *) 0xE000E018UL)

extern uint32_t bare_stack_top[], bare_data_load[], bare_data[], bare_data_end[], bare_bss[], bare_bss_end[];

int main(void);
void bare_reset(void);
void bare_fault(void);

void bare_fault(void)
{
    semihost_exit(FAULT_CODE);
}

void bare_reset(void)
{
    const uint32_t *from = bare_data_load;
    uint32_t *to;
#if defined(__ARM_FP)
    CPACR |= 0xFUL << 20;
    __asm__ volatile("dsb\n isb");
#endif
    for (to = bare_data; to < bare_data_end; to++) {
        *to = *from;
        from++;
    }
    for (to = bare_bss; to < bare_bss_end; to++) {
        *to = 0U;
    }
    SYSTICK_LOAD = 0xFFFFFFUL;
    SYSTICK_VALUE = 0U;
    SYSTICK_CTRL = 5U; /* on, core clock, no interrupt */
    semihost_exit(main());
}

typedef void (*handler_t)(void);

__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack_top;
    handler_t handlers[15];
} vectors = {
    bare_stack_top,
    { bare_reset, bare_fault, bare_fault, bare_fault, bare_fault, bare_fault, bare_fault, bare_fault,
      bare_fault, bare_fault, bare_fault, bare_fault, bare_fault, bare_fault, bare_fault },
};
