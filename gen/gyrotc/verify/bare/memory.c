/* memory.c - what a compiler may call without being asked. volatile keeps it from calling itself. */
#include <stddef.h>

void *memcpy(void *to, const void *from, size_t n);
void *memset(void *to, int c, size_t n);
void *memmove(void *to, const void *from, size_t n);
int memcmp(const void *a, const void *b, size_t n);

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

void *memmove(void *to, const void *from, size_t n)
{
    volatile unsigned char *out = to;
    const volatile unsigned char *in = from;
    size_t i;
    if (out < in) {
        for (i = 0U; i < n; i++) {
            out[i] = in[i];
        }
    } else {
        for (i = n; i > 0U; i--) {
            out[i - 1U] = in[i - 1U];
        }
    }
    return to;
}

int memcmp(const void *a, const void *b, size_t n)
{
    const volatile unsigned char *left = a;
    const volatile unsigned char *right = b;
    size_t i;
    for (i = 0U; i < n; i++) {
        if (left[i] != right[i]) {
            return (left[i] < right[i]) ? -1 : 1;
        }
    }
    return 0;
}
