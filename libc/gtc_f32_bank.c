/* gtc_f32_bank.c - several networks in one table, where GTC_WITH_BANK.
 *
 * SPDX-License-Identifier: MIT
 */
#include "gtc_num_f32.h"

#if GTC_WITH_BANK
#include "gtc_bank.inl"
#endif
