--  Bias of a gyro from its temperature: thin binding of the gyrotc C runtime, in SPARK's subset of contracts.
--  The manual is gtc.h; functions keep their names, meanings and costs. The options of gtc_config.h are the
--  defaults: a runtime compiled with others does not link, for its names end otherwise.
--
--  SPDX-License-Identifier: MIT
with Interfaces.C;

package Gtc with
  Pure,
  SPARK_Mode => On
is
   use type Interfaces.C.int;

   subtype Status is Interfaces.C.int;

   Ok           : constant Status := 0;
   Warming      : constant Status := 1;
   Clamped      : constant Status := 2;
   Uncovered    : constant Status := 4;
   Held         : constant Status := 8;
   Fallback     : constant Status := 16;
   Channel_Lost : constant Status := 32;
   E_Arg        : constant Status := -1;
   E_Layout     : constant Status := -2;
   E_Self_Test  : constant Status := -3;
   E_Image      : constant Status := -4;
   E_Id         : constant Status := -5;
   E_Period     : constant Status := -6;
   E_Absent     : constant Status := -7;
   E_Rest       : constant Status := -8;

   Max_Slope_Blocks : constant := 20;
   Max_Terms        : constant := 4;

   subtype Word is Interfaces.Unsigned_32;
   type Words is array (Positive range <>) of Word with Convention => C;

   subtype Saved_State is Words (1 .. 39 + Max_Slope_Blocks + 15 * Max_Terms);

   --  Longest sample period that any table takes: a block is shorter than 2^32 microseconds.
   subtype Period is Interfaces.Unsigned_32 range 1 .. Interfaces.Unsigned_32'Last;
end Gtc;
