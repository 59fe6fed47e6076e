/* any_table.h - with -DANY_TABLE the table is any that `init` and `check` accept: words anywhere in libc/gtc_limits.inl.
 *
 * Counts are those of a small table: SHAPE_NETWORKS networks of two centers each, four terms, grids of 3 x 2 cells;
 * where the last term is that of a channel, a fallback model behind the networks, which it has or has not. Intervals
 * cannot say the conditions on several words; the files that need them take functions by contract. Included
 * behind the runtime, whose limits it reads.
 */
#ifndef ANY_TABLE_H_INCLUDED
#define ANY_TABLE_H_INCLUDED

#if defined(ANY_TABLE)

#if defined(F32)
#define ANY_IN(range) Frama_C_float_interval((range).least, (range).most)
#define MEMBER_OF(member) ((member).value)
#else
#define ANY_IN(range) (int_least32_t)Frama_C_long_interval((range).least, (range).most)
#define MEMBER_OF(member) (member)
#endif
#define ALL_NETWORKS (SHAPE_NETWORKS + 1U)
#define ANY_WHOLE(row) Frama_C_unsigned_long_interval(whole_limits[row][0], whole_limits[row][1])

static gtc_word_t any_networks[ALL_NETWORKS * GTC_NETWORK_WORDS];
static gtc_word_t any_centers[ALL_NETWORKS * 2U * GTC_CENTER_WORDS];
static gtc_word_t any_terms[GTC_MAX_TERMS * GTC_TERM_WORDS];
static gtc_word_t any_coverage[1];
static gtc_word_t any_guards[2U * GTC_GUARD_WORDS];

static void any_words(gtc_word_t *words, const range_t *limits, unsigned n)
{
    unsigned i;
    /*@ loop unroll 8; */
    for (i = 0; i < n; i++) {
        NUMBER(words[i]) = ANY_IN(limits[i]);
    }
}

static void any_members(void)
{
    unsigned i;
    any.layout = GTC_TABLE_LAYOUT;
    any.block_us = ANY_WHOLE(WHOLE_BLOCK_US);
    any.slope_blocks = ANY_WHOLE(WHOLE_SLOPE_BLOCKS);
    any.lead_blocks = ANY_WHOLE(WHOLE_LEAD_BLOCKS);
    any.bias_frac_bits = ANY_WHOLE(WHOLE_BIAS_FRAC_BITS);
    MEMBER_OF(any.fallback) = ANY_IN(number_limits[NUMBER_FALLBACK]);
    /*@ loop unroll 2; */
    for (i = 0; i < 2U; i++) {
        MEMBER_OF(any.authority[i]) = ANY_IN(number_limits[NUMBER_AUTHORITY + i]);
        MEMBER_OF(any.effect[i]) = ANY_IN(number_limits[NUMBER_EFFECT + i]);
    }
    MEMBER_OF(any.rezero) = ANY_IN(number_limits[NUMBER_REZERO]);
    /*@ loop unroll 3; */
    for (i = 0; i < 3U; i++) {
        MEMBER_OF(any.scale[i]) = ANY_IN(number_limits[NUMBER_SCALE + i]);
    }
    /*@ loop unroll 4; */
    for (i = 0; i < 4U; i++) {
        MEMBER_OF(any.envelope[i]) = ANY_IN(number_limits[NUMBER_ENVELOPE + i]);
    }
}

static void any_arrays(void)
{
    unsigned i;
    /*@ loop unroll ALL_NETWORKS; */
    for (i = 0; i < ALL_NETWORKS; i++) {
        any_networks[i * GTC_NETWORK_WORDS].bits = 2U;
        any_words(&any_networks[(i * GTC_NETWORK_WORDS) + 1U], network_limits, GTC_NETWORK_WORDS - 1U);
    }
    /*@ loop unroll ALL_NETWORKS * 2; */
    for (i = 0; i < (ALL_NETWORKS * 2U); i++) {
        any_words(&any_centers[i * GTC_CENTER_WORDS], center_limits, GTC_CENTER_WORDS);
    }
    any_coverage[0].bits = Frama_C_unsigned_long_interval(0, 0xFFFFFFFFUL);
    any.networks = any_networks;
    any.centers = any_centers;
    any.coverage = any_coverage;
    any_words(any_guards, guard_limits, 4U);
    any_words(&any_guards[GTC_GUARD_WORDS], guard_limits, 4U);
    any_guards[GUARD_MISSING].bits = Frama_C_unsigned_long_interval(1, 100000);
    any_guards[GTC_GUARD_WORDS + GUARD_MISSING].bits = Frama_C_unsigned_long_interval(1, 100000);
    any.guards = any_guards;
    any.coverage_cells[0] = 3U;
    any.coverage_cells[1] = 2U;
    any.n_networks = SHAPE_NETWORKS;
    any.n_centers = ALL_NETWORKS * 2U;
    any.n_channels = 2U;
}

static void any_record(unsigned i, unsigned long kind)
{
    any_terms[i * GTC_TERM_WORDS].bits = kind;
    any_terms[(i * GTC_TERM_WORDS) + TERM_CHANNEL].bits = 0U;
    if (((CHANNEL_KINDS >> kind) & 1U) != 0U) {
        any.n_fallback_models = (Frama_C_interval(0, 1) != 0) ? 1U : 0U;
        any_terms[(i * GTC_TERM_WORDS) + TERM_CHANNEL].bits =
            (any.n_fallback_models != 0U) ? (1U + (ALL_NETWORKS * 65536UL)) : 1U;
    }
    any_words(&any_terms[(i * GTC_TERM_WORDS) + TERM_PARAMETERS], term_limits[kind - 1U], GTC_TERM_WORDS - 2U);
}

static void any_table(void)
{
    any_members();
    any_arrays();
    any_record(0, GTC_TERM_MEMORY);
    any_record(1, GTC_TERM_PLAY);
    any_record(2, GTC_TERM_HARMONIC);
    any_record(3, SHAPE_KIND);
    any.terms = any_terms;
    any.n_terms = 4U;
}

#else
#define any_table() ((void)0)
#endif

#endif
