/* riscv.c - start-up of a bare RISC-V: stack, FPU where there is one, .bss; a trap ends the run. */
#include <stdint.h>

#include "semihost.h"

extern uint32_t bare_bss[], bare_bss_end[];

int main(void);
void bare_start(void);
void bare_run(void);
void bare_fault(void);

__attribute__((aligned(4))) void bare_fault(void)
{
    semihost_exit(FAULT_CODE);
}

void bare_run(void)
{
    uint32_t *to;
    for (to = bare_bss; to < bare_bss_end; to++) {
        *to = 0U;
    }
    semihost_exit(main());
}

__attribute__((section(".start"), naked, used)) void bare_start(void)
{
    __asm__ volatile(".option push\n .option arch, +zicsr\n"
                     " la sp, bare_stack_top\n la t0, bare_fault\n csrw mtvec, t0\n"
#if defined(__riscv_flen)
                     " li t0, 0x6000\n csrs mstatus, t0\n" /* FS on, before the first float instruction */
#endif
                     " .option pop\n j bare_run");
}
