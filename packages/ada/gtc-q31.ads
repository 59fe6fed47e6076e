--  Arithmetic q31: 2^-16 C, 2^-16 C per block, 2^-Bias_Frac_Bits deg/h; increments over microseconds.
--
--  SPDX-License-Identifier: MIT
with Gtc.Binding;
with Gtc.C_Q31; use Gtc.C_Q31;
with Interfaces; use Interfaces;

package Gtc.Q31 is new Gtc.Binding (Number => Integer_32, Zero => 0, Longest => 1_000_000_000, Input_Words => 16);
