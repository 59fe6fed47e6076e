/* map.c - the map at every pair of numbers of 32 bits. */
#include "arithmetic.h"

#include "gtc.c"

int main(void)
{
    unsigned a;
    unsigned b;
    /*@ loop unroll KINDS; */
    for (a = 0; a < KINDS; a++) {
        /*@ loop unroll KINDS; */
        for (b = 0; b < KINDS; b++) {
            num_t bias = 0;
            const int status = NAME(map)(&THE_TABLE, any_number(a), any_number(b), &bias);
            //@ check status == -1 || status == 0 || status == 2 || status == 4 || status == 6;
        }
    }
    return 0;
}
