--  Functions of the C runtime, arithmetic q31: names end in the options that it was compiled with.
--
--  SPDX-License-Identifier: MIT
with System;

package Gtc.C_Q31 with
  SPARK_Mode => Off
is
   function C_Check (T : System.Address) return Status
   with Import, Convention => C, External_Name => "gtc_q31_check";
   function C_Init (S, T : System.Address; Period_Us : Word) return Status
   with Import, Convention => C, External_Name => "gtc_q31_init_20blocks_4terms";
   function C_Sample (S : System.Address; Elapsed_Us : Word; Readings : System.Address) return Status
   with Import, Convention => C, External_Name => "gtc_q31_sample";
   function C_Bias (S, Value : System.Address) return Status
   with Import, Convention => C, External_Name => "gtc_q31_bias";
   function C_Snapshot (S, Value : System.Address) return Status
   with Import, Convention => C, External_Name => "gtc_q31_snapshot";
   function C_Save (S, To : System.Address) return Status
   with Import, Convention => C, External_Name => "gtc_q31_save";
   function C_Restore (S, T : System.Address; Period_Us : Word; From : System.Address; Off : Word) return Status
   with Import, Convention => C, External_Name => "gtc_q31_restore_20blocks_4terms";
   function C_Angle (A : System.Address; Bias, Interval : Interfaces.Integer_32; Value : System.Address) return Status
   with Import, Convention => C, External_Name => "gtc_q31_angle";
end Gtc.C_Q31;
