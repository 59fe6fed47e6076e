/* gtc_test.h - the smallest test frame: a test is a function, a program runs its list of them.
 *
 *     TEST(clamps_to_the_envelope) { CHECK(...); CHECK_INT(expected, found); }
 *     int main(void) { RUN(clamps_to_the_envelope); return test_end(); }
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_TEST_H_INCLUDED
#define GTC_TEST_H_INCLUDED

#include <stdio.h>

static int test_failures;
static const char *test_name = "";

static void test_check(int holds, const char *claim, const char *file, int line)
{
    if (!holds) {
        test_failures++;
        printf("%s:%d: in %s: not true: %s\n", file, line, test_name, claim);
    }
}

static void test_int(long expected, long found, const char *what, const char *file, int line)
{
    if (expected != found) {
        test_failures++;
        printf("%s:%d: in %s: %s is %ld, expected %ld\n", file, line, test_name, what, found, expected);
    }
}

static int test_end(void)
{
    printf("%s\n", (test_failures == 0) ? "passed" : "FAILED");
    return (test_failures == 0) ? 0 : 1;
}

#define TEST(name) static void name(void)
#define CHECK(claim) test_check((claim) ? 1 : 0, #claim, __FILE__, __LINE__)
#define CHECK_INT(expected, found) test_int((long)(expected), (long)(found), #found, __FILE__, __LINE__)
#define RUN(name)         \
    do {                  \
        test_name = #name; \
        name();           \
    } while (0)

#endif /* GTC_TEST_H_INCLUDED */
