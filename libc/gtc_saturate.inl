/* gtc_saturate.inl - limiting a number to a range.
 *
 * In the repository: the one text of it, in the numbers of the header that includes it.
 *
 * SPDX-License-Identifier: MIT
 */

/* The nearest number in a range; GTC_CLAMPED joins the remarks if it is another one. The least for what is no
 * number. */
static inline NUM saturate(WIDE x, NUM least, NUM most, int_least32_t *remarks)
{
    NUM nearest = least;

    if ((x >= least) && (x <= most)) {
        nearest = NARROW(x);
    } else {
        *remarks |= GTC_CLAMPED;
        if (x > most) {
            nearest = most;
        }
    }
    return nearest;
}
