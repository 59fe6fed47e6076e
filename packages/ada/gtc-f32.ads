--  Arithmetic f32: C, C per block, deg/h; increments in arcsec over seconds.
--
--  SPDX-License-Identifier: MIT
with Gtc.Binding;
with Gtc.C_F32; use Gtc.C_F32;
with Interfaces.C; use Interfaces.C;

package Gtc.F32 is new Gtc.Binding (Number => C_float, Zero => 0.0, Longest => 1000.0, Input_Words => 14);
