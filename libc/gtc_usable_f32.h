/* gtc_usable_f32.h - the conditions of float32 on several words of a table.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_USABLE_F32_H_INCLUDED
#define GTC_USABLE_F32_H_INCLUDED

/* A row of gtc_limits.inl. */
#define RANGE(f32_least, f32_most, q31_least, q31_most) {(f32_least), (f32_most)}

/* Numbers that are different, and no quotient by their difference is infinite. */
static int FN(is_width)(float low, float high)
{
    float width;

    width = high - low;
    return (width >= 0x1p-100F) ? 1 : 0;
}

/* The inputs reach no farther than 8 half ranges, so that on_grid() keeps their digits. */
static int FN(is_reach)(float x, float offset, float gain)
{
    float z;

    z = x - offset;
    z = z * gain;
    return ((z >= -8.0F) && (z <= 8.0F)) ? 1 : 0;
}

/* Each input has one value or a range. */
static int FN(envelope_fits)(const TABLE *table)
{
    const gtc_word_t *const edges = table->envelope;
    int fit = 1;
    uint_least32_t i;

    for (i = 0U; i < 4U; i += 2U) {
        const float low = edges[i].value;
        const float high = edges[i + 1U].value;

        fit &= (FN(is_width)(low, high) || (FN(bits)(low) == FN(bits)(high))) ? 1 : 0;
    }
    for (i = 0U; i < 2U; i++) {
        fit &= FN(is_reach)(edges[i].value, table->scale[0].value, table->scale[1].value);
        fit &= FN(is_reach)(edges[2U + i].value, 0.0F, table->scale[2].value);
    }
    return fit;
}

/* With every word in its range no sum leaves float32. */
static int FN(sums_fit)(const gtc_word_t *network, const gtc_word_t *centers)
{
    (void)network;
    (void)centers;
    return 1;
}

#endif /* GTC_USABLE_F32_H_INCLUDED */
