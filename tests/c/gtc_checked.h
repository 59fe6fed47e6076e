/* gtc_checked.h - configuration in which the runtime asserts its preconditions and, in fixed point, the range of
 * every intermediate number; a claim that does not hold ends the test.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_CHECKED_H_INCLUDED
#define GTC_CHECKED_H_INCLUDED

#include <stdio.h>
#include <stdlib.h>

#define GTC_ASSERT(claim) \
    ((claim) ? (void)0 : (printf("%s:%d: not true: %s\n", __FILE__, __LINE__, #claim), abort()))

#endif /* GTC_CHECKED_H_INCLUDED */
