/* memory.c - what a compiler may call without being asked. volatile keeps it from calling itself. */
#include <stddef.h>

void *memcpy(void *to, const void *from, size_t n);
void *memset(void *to, int c, size_t n);

void *memcpy(void *to, const void *from, size_t n)
{
    volatile unsigned char *out = to;
    const unsigned char *in = from;
    for (; n != 0U; n--) {
        *out = *in;
        out++;
        in++;
    }
    return to;
}

void *memset(void *to, int c, size_t n)
{
    volatile unsigned char *out = to;
    for (; n != 0U; n--) {
        *out = (unsigned char) c;
        out++;
    }
    return to;
}
