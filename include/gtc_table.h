/* gtc_table.h - table layout 3: what an emitted table file holds.
 *
 * Tables are written by `gyrotc emit`, never by hand; docs/FORMAT.md gives every word. A table is
 * one axis of one gyro serial. The order of the members below is the order of the values in the
 * binary image and in the checksum. Unused parts have length 0 and a NULL pointer.
 *
 * Only least-width integers occur, because `char` has 16 bits on some DSPs. A float value is held
 * as `gtc_word_t`, so that one array of 32-bit words serves as table and as flash image.
 *
 * SPDX-License-Identifier: MIT
 */
#ifndef GTC_TABLE_H_INCLUDED
#define GTC_TABLE_H_INCLUDED

#include "gtc.h"

/* A runtime reads exactly this layout; an emitted file refuses to compile against another. */
#define GTC_TABLE_LAYOUT 3U

/* First word of a binary image; reads 0x31435447 when the image has the other byte order. */
#define GTC_IMAGE_MAGIC 0x47544331UL

/* Codes of `quantity` and `unit`. */
#define GTC_QUANTITY_BIAS 0U /* bias of angular rate */
#define GTC_UNIT_DEG_PER_H 0U

/* Kinds of extension terms (first word of a term record). */
#define GTC_TERM_MEMORY 1U    /* first-order memory: cavity_lag (input) and thermal_gradient */
#define GTC_TERM_PLAY 2U      /* play operator: hysteresis */
#define GTC_TERM_WARM_UP 3U   /* exponential in the time since power-on */
#define GTC_TERM_HARMONIC 4U  /* harmonic in T: path_length_periodicity */
#define GTC_TERM_AUXILIARY 5U /* linear in an auxiliary channel */
#define GTC_TERM_CURVE 6U     /* a line and two Gaussians in an auxiliary channel */
#define GTC_TERM_PRODUCT 7U   /* a line in T times a line in an auxiliary channel */
#define GTC_N_KINDS 7U

/* Parts of the runtime that a table needs, bits of `parts`: gtc_<n>_check(), _init() and _open() refuse a table if this
 * runtime has not all of them. */
#define GTC_PART_BANK 0x1UL             /* several networks */
#define GTC_PART_TERM(kind) (1UL << (kind)) /* a kind of term: bits 1 ... 7 */
#define GTC_PART_COVERAGE 0x100UL
#define GTC_PART_UNCERTAINTY 0x200UL
#define GTC_PART_PROBES 0x400UL         /* known answers */
#define GTC_PART_NARROW 0x800UL         /* fixed point: narrow Gaussians */
#define GTC_PART_REZERO 0x1000UL

/* Sizes of the records in the arrays below, in words. */
#define GTC_SERIAL_WORDS 16U /* the serial in ASCII, four characters a word, the first one lowest; then zeros */
#define GTC_GUARD_WORDS 8U   /* low, high, max_step, max_rate, agree_us, stuck_us, missing_blocks, fallback */
#define GTC_NETWORK_WORDS 8U /* n_centers, w0, linear T, linear slope, region: T0, T1, slope0, slope1 */
#define GTC_CENTER_WORDS 5U  /* T: center, gain; slope: center, gain; weight (q31: s, k; s, k; weight) */
#define GTC_TERM_WORDS 8U    /* kind, channel + 65536 * number of the fallback model, then six parameters of the kind */
#define GTC_SIGMA_RULES 12U  /* words of `sigma` behind its grids, before one for each term */
#define GTC_PROBE_WORDS 4U   /* temperature, slope, bias, status */

#if GTC_WITH_F32
/* Table in float32. Gains are 1/width with sqrt(log2 e) folded in. */
struct gtc_f32_table {
    uint_least32_t layout;         /* GTC_TABLE_LAYOUT */
    uint_least32_t quantity;       /* GTC_QUANTITY_... */
    uint_least32_t unit;           /* GTC_UNIT_... */
    uint_least32_t id;             /* CRC-32 of the table's id as text; in the emitted header */
    uint_least32_t calibrated;     /* date of calibration, yyyymmdd as a decimal number; 0: not known */
    uint_least32_t block_us;       /* length of a block, microseconds */
    uint_least32_t slope_blocks;   /* window of the slope, 2 ... GTC_MAX_SLOPE_BLOCKS */
    uint_least32_t lead_blocks;    /* the map is evaluated at T + lead_blocks * slope; 0 or 1 */
    uint_least32_t bias_frac_bits; /* 0 in float32 */
    uint_least32_t parts;          /* of the runtime that it needs: GTC_PART_... */
    gtc_word_t fallback;           /* deg/h: constant correction where the temperature is lost */
    gtc_word_t authority[2];       /* deg/h: smallest and largest correction that is ever given */
    gtc_word_t effect[2];          /* deg/h: smallest and largest that all terms together add */
    gtc_word_t rezero;             /* deg/h: largest shift of the constant in the field; 0: none */
    gtc_word_t scale[3];           /* C, 1/C, block/C: center of T, gain of T, gain of slope */
    gtc_word_t envelope[4];        /* C, C, C/block, C/block: T min, max; slope min, max */
    uint_least32_t n_networks;     /* of the map: 1, or more where GTC_WITH_BANK */
    uint_least32_t n_centers;      /* of all networks together */
    uint_least32_t n_channels;     /* 1 + auxiliary channels */
    uint_least32_t n_terms;        /* 0 ... GTC_MAX_TERMS */
    uint_least32_t coverage_cells[2]; /* cells in T and slope over the envelope; 0, 0: none */
    uint_least32_t sigma_cells[2];    /* the same for the uncertainty; 0, 0: none */
    uint_least32_t n_sigma;           /* words of the uncertainty: 0, or its grids, GTC_SIGMA_RULES, one a term */
    uint_least32_t n_probes;          /* known answers */
    uint_least32_t n_fallback_models;       /* networks behind those of the map, each for a term whose channel is lost */
    const gtc_word_t *serial;      /* [GTC_SERIAL_WORDS], as given by the gyro's maker */
    const gtc_word_t *networks;    /* [n_networks + n_fallback_models][GTC_NETWORK_WORDS] */
    const gtc_word_t *centers;     /* [n_centers][GTC_CENTER_WORDS] */
    const gtc_word_t *guards;      /* [n_channels][GTC_GUARD_WORDS], the temperature first */
    const gtc_word_t *terms;       /* [n_terms][GTC_TERM_WORDS] */
    const gtc_word_t *coverage;    /* one bit a cell, T fastest, 32 cells a word, low bit first */
    const gtc_word_t *sigma;       /* [covered, uncovered][slope cell][T cell] deg/h, 1 sigma (without coverage only
                                      the first grid); rules; terms */
    const gtc_word_t *probes;      /* [n_probes][GTC_PROBE_WORDS] */
    uint_least32_t crc;            /* CRC-32 over all of the above */
};
#endif

#if GTC_WITH_Q31
/* Table in fixed point. Words are two's complement 32-bit integers in `bits`. */
struct gtc_q31_table {
    uint_least32_t layout;
    uint_least32_t quantity;
    uint_least32_t unit;
    uint_least32_t id;
    uint_least32_t calibrated;
    uint_least32_t block_us;
    uint_least32_t slope_blocks;
    uint_least32_t lead_blocks;
    uint_least32_t bias_frac_bits; /* bias = integer * 2^-bias_frac_bits deg/h */
    uint_least32_t parts;
    int_least32_t fallback;        /* 2^-bias_frac_bits deg/h, and so are ... */
    int_least32_t authority[2];
    int_least32_t effect[2];
    int_least32_t rezero;
    int_least32_t scale[3];        /* gains of T and slope onto 16 bits, bits by which squares are
                                      in larger units (docs/numerics.md) */
    int_least32_t envelope[4];     /* 2^-16 C, 2^-16 C per block */
    uint_least32_t n_networks;
    uint_least32_t n_centers;
    uint_least32_t n_channels;
    uint_least32_t n_terms;
    uint_least32_t coverage_cells[2];
    uint_least32_t sigma_cells[2];
    uint_least32_t n_sigma;
    uint_least32_t n_probes;
    uint_least32_t n_fallback_models;
    const gtc_word_t *serial;
    const gtc_word_t *networks;
    const gtc_word_t *centers;
    const gtc_word_t *guards;
    const gtc_word_t *terms;
    const gtc_word_t *coverage;
    const gtc_word_t *sigma;
    const gtc_word_t *probes;
    uint_least32_t crc;
};
#endif

#endif /* GTC_TABLE_H_INCLUDED */
