/* semihost.h - one call of the debugger, and the end of the program. */
#ifndef SEMIHOST_H_INCLUDED
#define SEMIHOST_H_INCLUDED

#include <stdint.h>

#define FAULT_CODE 99 /* exit status after a fault */

void semihost_exit(int code);

static inline intptr_t semihost_call(int operation, void *block)
{
#if defined(__riscv)
    register intptr_t result __asm__("a0") = operation;
    register void *argument __asm__("a1") = block;
    __asm__ volatile(".balign 16\n .option push\n .option norvc\n"
                     " slli x0, x0, 0x1f\n ebreak\n srai x0, x0, 7\n .option pop"
                     : "+r"(result) : "r"(argument) : "memory");
#else
    register intptr_t result __asm__("r0") = operation;
    register void *argument __asm__("r1") = block;
    __asm__ volatile("bkpt 0xAB" : "+r"(result) : "r"(argument) : "memory");
#endif
    return result;
}

#endif
