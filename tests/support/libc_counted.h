/* libc_counted.h - configuration in which the runtime counts the claims about ranges that do not hold. */
#ifndef LIBC_COUNTED_H_INCLUDED
#define LIBC_COUNTED_H_INCLUDED

extern long shim_out_of_range;
#define GTC_ASSERT(claim) ((claim) ? (void)0 : (void)shim_out_of_range++)

#endif /* LIBC_COUNTED_H_INCLUDED */
