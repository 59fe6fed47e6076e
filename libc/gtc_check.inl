/* gtc_check.inl - boot self-test of a table, in the numbers included before.
 *
 * SPDX-License-Identifier: MIT
 */

/* 1 if the map gives the known answers of the table. */
static int FN(probes_agree)(const TABLE *table)
{
    uint_least32_t i;

    for (i = 0U; i < table->n_probes; i++) {
        const gtc_word_t *const probe = &table->probes[i * GTC_PROBE_WORDS];
        NUM bias = NUM_ZERO;
        const int status = FN(map)(table, ELEMENT(probe[0]), ELEMENT(probe[1]), &bias);

        if ((status < 0) || ((uint_least32_t)status != probe[3].bits)
            || (FN(bits)(bias) != probe[2].bits)) {
            return 0;
        }
    }
    return 1;
}

int FN(check)(const TABLE *table)
{
    int status = GTC_OK;

    if (table == NULL) {
        status = GTC_E_ARG;
    } else if (!FN(is_usable)(table)) {
        status = GTC_E_LAYOUT;
    } else if (!FN(primitives_work)()) {
        status = GTC_E_SELF_TEST;
    } else if (FN(crc)(table) != table->crc) {
        status = GTC_E_IMAGE;
    } else if (!FN(probes_agree)(table)) {
        status = GTC_E_SELF_TEST;
    } else {
        /* all is well */
    }
    return status;
}
