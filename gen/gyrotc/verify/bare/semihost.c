/* semihost.c - stdio.h and the end of a program over the debugger's interface of Arm and RISC-V.
 *
 * The emulator does the work: text goes to its standard output, standard input is the file
 * `stdin.bin` of its working folder. Both are buffered, because every call stops the core.
 */
#include "stdio.h"

#include <stdint.h>

#include "semihost.h"

#define SYS_OPEN 0x01
#define SYS_WRITE 0x05
#define SYS_READ 0x06
#define SYS_EXIT_EXTENDED 0x20
#define EXITED 0x20026U /* ADP_Stopped_ApplicationExit */
#define MODE_RB 1U
#define MODE_W 4U

struct bare_file {
    const char *name;
    uintptr_t name_length;
    uintptr_t mode;
    uintptr_t handle; /* plus 1; 0: not opened yet */
    uintptr_t used;   /* of the buffer */
    uintptr_t filled; /* bytes that a read brought */
    unsigned char buffer[512];
};

static FILE in_file = { "stdin.bin", 9U, MODE_RB, 0U, 0U, 0U, { 0U } };
static FILE out_file = { ":tt", 3U, MODE_W, 0U, 0U, 0U, { 0U } };
FILE *const bare_stdin = &in_file;
FILE *const bare_stdout = &out_file;

static intptr_t transfer(int operation, FILE *file, uintptr_t length)
{
    uintptr_t block[3];
    if (file->handle == 0U) {
        block[0] = (uintptr_t) file->name;
        block[1] = file->mode;
        block[2] = file->name_length;
        file->handle = (uintptr_t) semihost_call(SYS_OPEN, block) + 1U;
    }
    block[0] = file->handle - 1U;
    block[1] = (uintptr_t) file->buffer;
    block[2] = length;
    return semihost_call(operation, block); /* bytes that were left */
}

static void flush(void)
{
    if (out_file.used != 0U) {
        (void) transfer(SYS_WRITE, &out_file, out_file.used);
        out_file.used = 0U;
    }
}

int putchar(int c)
{
    out_file.buffer[out_file.used] = (unsigned char) c;
    out_file.used++;
    if (out_file.used == sizeof out_file.buffer) {
        flush();
    }
    return c;
}

static int next(void)
{
    if (in_file.used == in_file.filled) {
        in_file.filled = sizeof in_file.buffer - (uintptr_t) transfer(SYS_READ, &in_file, sizeof in_file.buffer);
        in_file.used = 0U;
        if (in_file.filled == 0U) {
            return -1;
        }
    }
    in_file.used++;
    return in_file.buffer[in_file.used - 1U];
}

size_t fread(void *data, size_t size, size_t n, FILE *stream)
{
    unsigned char *const bytes = data;
    size_t k;
    (void) stream;
    for (k = 0U; k < (size * n); k++) {
        const int c = next();
        if (c < 0) {
            break;
        }
        bytes[k] = (unsigned char) c;
    }
    return k / size;
}

size_t fwrite(const void *data, size_t size, size_t n, FILE *stream)
{
    const unsigned char *const bytes = data;
    size_t k;
    (void) stream;
    for (k = 0U; k < (size * n); k++) {
        (void) putchar(bytes[k]);
    }
    return n;
}

void semihost_exit(int code)
{
    uintptr_t block[2];
    flush();
    block[0] = EXITED;
    block[1] = (uintptr_t) code;
    (void) semihost_call(SYS_EXIT_EXTENDED, block);
    for (;;) {
    }
}
