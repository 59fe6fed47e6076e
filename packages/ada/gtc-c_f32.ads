--  Functions of the C runtime, arithmetic f32: names end in the options that it was compiled with.
--
--  SPDX-License-Identifier: MIT
with Interfaces.C;
with System;

package Gtc.C_F32 with
  SPARK_Mode => Off
is
   function C_Check (T : System.Address) return Status
   with Import, Convention => C, External_Name => "gtc_f32_check";
   function C_Init (S, T : System.Address; Period_Us : Word) return Status
   with Import, Convention => C, External_Name => "gtc_f32_init_20blocks_4terms";
   function C_Sample (S : System.Address; Elapsed_Us : Word; Readings : System.Address) return Status
   with Import, Convention => C, External_Name => "gtc_f32_sample";
   function C_Bias (S, Value : System.Address) return Status
   with Import, Convention => C, External_Name => "gtc_f32_bias";
   function C_Snapshot (S, Value : System.Address) return Status
   with Import, Convention => C, External_Name => "gtc_f32_snapshot";
   function C_Save (S, To : System.Address) return Status
   with Import, Convention => C, External_Name => "gtc_f32_save";
   function C_Restore (S, T : System.Address; Period_Us : Word; From : System.Address; Off : Word) return Status
   with Import, Convention => C, External_Name => "gtc_f32_restore_20blocks_4terms";
   function C_Angle (A : System.Address; Bias, Interval : Interfaces.C.C_float; Value : System.Address) return Status
   with Import, Convention => C, External_Name => "gtc_f32_angle";
end Gtc.C_F32;
