/* gtc_checked.h - configuration in which the fixed-point runtime asserts the range of every intermediate
 * number; a claim that does not hold ends the test.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_CHECKED_H_INCLUDED
#define GTC_CHECKED_H_INCLUDED

#include <stdio.h>
#include <stdlib.h>

#define GTC_ASSERT_RANGE(claim) \
    ((claim) ? (void)0 : (printf("%s:%d: out of range: %s\n", __FILE__, __LINE__, #claim), abort()))

#endif /* GTC_CHECKED_H_INCLUDED */
