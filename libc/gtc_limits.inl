/* gtc_limits.inl - the legal range of every word of a table.
 *
 * This is the one text of them. A table with a word outside of its range, or one that does not meet the
 * conditions that relate several words, is refused by gtc_<n>_open() and gtc_<n>_check_words(). The ranges are
 * chosen so that with any other table no function of the runtime meets a run-time error. The generator emits no
 * table that is refused.
 * In the repository: docs/proof.md says how far that is shown.
 *
 * MISRA 8.9 throughout: the ranges stand together, not each in the one function that uses it.
 *
 * SPDX-License-Identifier: MIT
 */

#if GTC_WITH_IMAGE
typedef struct {
    NUM least;
    NUM most;
} range_t;

/* Whole numbers, in the order of an image. */
static const uint_least32_t whole_limits[N_WHOLE][2] = {
    /*    float32: least, most         fixed point: least, most */
    RANGE(GTC_QUANTITY_BIAS, GTC_QUANTITY_BIAS, GTC_QUANTITY_BIAS, GTC_QUANTITY_BIAS),     /* quantity */
    RANGE(GTC_UNIT_DEG_PER_H, GTC_UNIT_DEG_PER_H, GTC_UNIT_DEG_PER_H, GTC_UNIT_DEG_PER_H), /* unit */
    RANGE(0U, 4294967295U,             0U, 4294967295U),             /* id */
    RANGE(0U, 99991231U,               0U, 99991231U),               /* calibrated */
    RANGE(1U, 3600000000U,             1U, 3600000000U),             /* block_us */
    RANGE(2U, GTC_MAX_SLOPE_BLOCKS,    2U, GTC_MAX_SLOPE_BLOCKS),    /* slope_blocks */
    RANGE(0U, 1U,                      0U, 1U),                      /* lead_blocks */
    RANGE(0U, 0U,                      GTC_BIAS_FRAC_BITS, GTC_BIAS_FRAC_BITS), /* bias_frac_bits */
    RANGE(0U, 8191U,                   0U, 8191U),                   /* parts */
    RANGE(1U, 16U,                     1U, 16U),                     /* n_networks */
    RANGE(0U, 512U,                    0U, 512U),                    /* n_centers */
    RANGE(1U, GTC_MAX_CHANNELS,        1U, GTC_MAX_CHANNELS),       /* n_channels */
    RANGE(0U, GTC_MAX_TERMS,           0U, GTC_MAX_TERMS),           /* n_terms */
    RANGE(0U, 256U,                    0U, 256U),                    /* coverage_cells: T */
    RANGE(0U, 256U,                    0U, 256U),                    /* coverage_cells: slope */
    RANGE(0U, 256U,                    0U, 256U),                    /* sigma_cells: T */
    RANGE(0U, 256U,                    0U, 256U),                    /* sigma_cells: slope */
    RANGE(0U, 65535U,                  0U, 65535U),                  /* n_sigma */
    RANGE(0U, 4096U,                   0U, 4096U),                   /* n_probes */
};

/* Numbers between them. */
static const range_t number_limits[N_NUMBERS] = {
    RANGE(-7.5e6F, 7.5e6F,             -1073741824, 1073741824),     /* fallback */
    RANGE(-1.5e7F, 0.0F,               -2147483647, 0),              /* authority: smallest */
    RANGE(0.0F, 1.5e7F,                0, 2147483647),               /* authority: largest */
    RANGE(-1.5e7F, 0.0F,               -2147483647, 0),              /* effect: smallest */
    RANGE(0.0F, 1.5e7F,                0, 2147483647),               /* effect: largest */
    RANGE(0.0F, 7.5e6F,                0, 1073741824),               /* rezero */
    RANGE(-200.0F, 400.0F,             0, 2147483647),               /* scale: center of T; q31: gain of T */
    RANGE(0.0F, 1.0e12F,               0, 2147483647),               /* scale: gain of T; q31: gain of slope */
    RANGE(0.0F, 1.0e12F,               0, 32),                       /* scale: gain of slope; q31: bits of narrow squares */
    RANGE(-200.0F, 400.0F,             -13107200, 26214400),         /* envelope: T min */
    RANGE(-200.0F, 400.0F,             -13107200, 26214400),         /* envelope: T max */
    RANGE(-1.0e5F, 1.0e5F,             -1073741824, 1073741824),     /* envelope: slope min */
    RANGE(-1.0e5F, 1.0e5F,             -1073741824, 1073741824),     /* envelope: slope max */
};

/* A network, behind its number of centers, which the conditions limit. */
static const range_t network_limits[GTC_NETWORK_WORDS - 1U] = {
    RANGE(-7.5e6F, 7.5e6F,             -1073741824, 1073741824),     /* network: w0 */
    RANGE(-7.5e6F, 7.5e6F,             -1073741824, 1073741824),     /* network: linear T */
    RANGE(-7.5e6F, 7.5e6F,             -1073741824, 1073741824),     /* network: linear slope */
    RANGE(-200.0F, 400.0F,             0, 65535),                    /* network: region T0 */
    RANGE(-200.0F, 400.0F,             0, 65535),                    /* network: region T1 */
    RANGE(-1.0e5F, 1.0e5F,             0, 65535),                    /* network: region slope0 */
    RANGE(-1.0e5F, 1.0e5F,             0, 65535),                    /* network: region slope1 */
};

static const range_t center_limits[GTC_CENTER_WORDS] = {
    RANGE(-1.0e9F, 1.0e9F,             0, 65535),                    /* center: T; q31: s of T */
    RANGE(0.0F, 1.0e4F,                -2147483647, 2147483647),     /* center: gain of T; q31: k of T */
    RANGE(-1.0e9F, 1.0e9F,             0, 65535),                    /* center: slope; q31: s of slope */
    RANGE(0.0F, 1.0e4F,                -2147483647, 2147483647),     /* center: gain of slope; q31: k of slope */
    RANGE(-7.5e6F, 7.5e6F,             -1073741824, 1073741824),     /* center: weight */
};

/* A guard; the words between its numbers are whole. */
static const range_t guard_limits[4] = {
    RANGE(-1.0e9F, 1.0e9F,             -2147483647, 2147483647),     /* guard: low */
    RANGE(-1.0e9F, 1.0e9F,             -2147483647, 2147483647),     /* guard: high */
    RANGE(0.0F, 1.0e9F,                0, 2147483647),               /* guard: max_step */
    RANGE(0.0F, 1.0e9F,                0, 2147483647),               /* guard: max_rate */
};

static const uint_least32_t guard_wholes[3][2] = {
    RANGE(0U, 2147483647U,             0U, 2147483647U),             /* guard: agree_us */
    RANGE(0U, 2147483647U,             0U, 2147483647U),             /* guard: stuck_us */
    RANGE(1U, 100000U,                 1U, 100000U),                 /* guard: missing_blocks */
};

#if GTC_WITH_TERMS
/* Parameters of the kinds of terms; kind - 1 is the row. What a kind does not use is 0. */
static const range_t term_limits[GTC_N_KINDS][GTC_TERM_WORDS - 2U] = {
    {
        RANGE(0.0F, 1.0F,              0, 2147483647),               /* memory: gain */
        RANGE(-1.0e9F, 1.0e9F,         -2147483647, 2147483647),     /* memory: amplitude */
        RANGE(0.0F, 1.0e9F,            0, 2147483647),               /* memory: rate */
        RANGE(0.0F, 0.0F,              0, 0),
        RANGE(0.0F, 0.0F,              0, 0),
        RANGE(0.0F, 0.0F,              0, 0),
    },
    {
        RANGE(0.0F, 1.0e9F,            0, 2121269247),               /* play: width */
        RANGE(-1.0e9F, 1.0e9F,         -2147483647, 2147483647),     /* play: amplitude */
        RANGE(-1.0e9F, 1.0e9F,         -1073741824, 1073741824),     /* play: slope of the amplitude over T */
        RANGE(-200.0F, 400.0F,         -13107200, 26214400),         /* play: reference of T */
        RANGE(0.0F, 0.0F,              0, 0),
        RANGE(0.0F, 0.0F,              0, 0),
    },
    {
        RANGE(0.0F, 1.0e9F,            0, 2147483647),               /* warm-up: gain */
        RANGE(-1.0e9F, 1.0e9F,         -2147483647, 2147483647),     /* warm-up: amplitude */
        RANGE(0.0F, 0.0F,              0, 0),
        RANGE(0.0F, 0.0F,              0, 0),
        RANGE(0.0F, 0.0F,              0, 0),
        RANGE(0.0F, 0.0F,              0, 0),
    },
    {
        RANGE(0.0F, 1.0e4F,            0, 2147483647),               /* harmonic: frequency */
        RANGE(-1.0F, 1.0F,             -2147483647 - 1, 2147483647), /* harmonic: phase */
        RANGE(-1.0e9F, 1.0e9F,         -2147483647, 2147483647),     /* harmonic: amplitude */
        RANGE(0.0F, 0.0F,              0, 0),
        RANGE(0.0F, 0.0F,              0, 0),
        RANGE(0.0F, 0.0F,              0, 0),
    },
    {
        RANGE(-1.0e9F, 1.0e9F,         -1073741824, 1073741824),     /* auxiliary: slope */
        RANGE(-1.0e9F, 1.0e9F,         -1073741824, 1073741824),     /* auxiliary: reference */
        RANGE(0.0F, 0.0F,              0, 0),
        RANGE(0.0F, 0.0F,              0, 0),
        RANGE(0.0F, 0.0F,              0, 0),
        RANGE(0.0F, 0.0F,              0, 0),
    },
    {
        RANGE(-1.0e9F, 1.0e9F,         -1073741824, 1073741824),     /* curve: slope */
        RANGE(0.0F, 1.0e9F,            0, 2147483647),               /* curve: gain */
        RANGE(-1.0e9F, 1.0e9F,         -1073741823, 1073741823),     /* curve: reference, first center */
        RANGE(-1.0e9F, 1.0e9F,         -536870912, 536870912),       /* curve: first weight */
        RANGE(-1.0e9F, 1.0e9F,         -1073741823, 1073741823),     /* curve: second center */
        RANGE(-1.0e9F, 1.0e9F,         -536870912, 536870912),       /* curve: second weight */
    },
    {
        RANGE(-1.0e9F, 1.0e9F,         -1073741824, 1073741824),     /* product: slope */
        RANGE(-1.0e9F, 1.0e9F,         -1073741824, 1073741824),     /* product: reference */
        RANGE(-1.0e9F, 1.0e9F,         -1073741824, 1073741824),     /* product: slope of the slope over T */
        RANGE(-1.0e9F, 1.0e9F,         -1073741824, 1073741824),     /* product: reference of T */
        RANGE(0.0F, 0.0F,              0, 0),
        RANGE(0.0F, 0.0F,              0, 0),
    },
};
#endif

#if GTC_WITH_UNCERTAINTY
static const range_t sigma_limits[1] = {
    RANGE(0.0F, 7.5e6F,                0, 2147483647),               /* sigma */
};
#endif
#endif
