/* stdio.h - the few functions of the C library that the test programs use, for targets without one. */
#ifndef BARE_STDIO_H_INCLUDED
#define BARE_STDIO_H_INCLUDED

#include <stddef.h>

typedef struct bare_file FILE;

extern FILE *const bare_stdin;
extern FILE *const bare_stdout;
#define stdin bare_stdin
#define stdout bare_stdout

int putchar(int c);
size_t fread(void *data, size_t size, size_t n, FILE *stream);
size_t fwrite(const void *data, size_t size, size_t n, FILE *stream);

#endif
