/* avr.c - stdio.h over the UART of an AVR, a cycle counter, and the end of the run.
 *
 * The simulator prints what the UART sends and stops when the core sleeps with interrupts off.
 */
#include "stdio.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

struct bare_file {
    char unused;
};

static FILE uart;
FILE *const bare_stdin = &uart;
FILE *const bare_stdout = &uart;

void bare_start(void);
void bare_end(void);

/* Run by the compiler's own start-up code before and after main(). */
__attribute__((constructor, used)) void bare_start(void)
{
    UBRR0 = 0U; /* as fast as it goes */
    UCSR0A = (1 << U2X0);
    UCSR0B = (1 << TXEN0) | (1 << RXEN0);
    TCCR1B = (1 << CS11); /* timer 1: core clock / 8 */
}

__attribute__((destructor, used)) void bare_end(void)
{
    while ((UCSR0A & (1 << UDRE0)) == 0) {
    }
    cli();
    sleep_mode();
}

int putchar(int c)
{
    while ((UCSR0A & (1 << UDRE0)) == 0) {
    }
    UDR0 = (unsigned char) c;
    return c;
}

size_t fread(void *data, size_t size, size_t n, FILE *stream)
{
    unsigned char *const bytes = data;
    size_t k;
    (void) stream;
    for (k = 0U; k < (size * n); k++) {
        while ((UCSR0A & (1 << RXC0)) == 0) {
        }
        bytes[k] = UDR0;
    }
    return n;
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
