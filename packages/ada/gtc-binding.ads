--  What both arithmetics have in common; Gtc.F32 and Gtc.Q31 are its instances.
--
--  SPDX-License-Identifier: MIT
with System;

generic
   type Number is private;          --  of a reading, a correction, an increment
   Zero        : Number;
   Longest     : Number;            --  interval of an increment
   Input_Words : Positive;          --  of one channel in a state
   with function "<=" (Left, Right : Number) return Boolean is <>;
   with function C_Check (T : System.Address) return Status is <>;
   with function C_Init (S, T : System.Address; Period_Us : Word) return Status is <>;
   with function C_Sample (S : System.Address; Elapsed_Us : Word; Readings : System.Address) return Status is <>;
   with function C_Bias (S, Value : System.Address) return Status is <>;
   with function C_Snapshot (S, Value : System.Address) return Status is <>;
   with function C_Save (S, To : System.Address) return Status is <>;
   with function C_Restore (S, T : System.Address; Period_Us : Word; From : System.Address; Off : Word) return Status
     is <>;
   with function C_Angle (A : System.Address; Bias, Interval : Number; Value : System.Address) return Status is <>;
package Gtc.Binding with
  SPARK_Mode => On
is
   type Numbers is array (Positive range <>) of aliased Number with Convention => C;

   --  Constant data of an emitted C file: import it with Convention => C, External_Name => "gtc_<id>_f32" (or _q31).
   type Table is limited private;

   --  State of one table; all calls that take it come from one task.
   type State is limited private;

   --  Sum of angle increments, separate from any state.
   type Angle is limited private;

   type Snapshot is record
      Bias, Sigma, Correlation_S : Number := Zero;
      Age_Blocks                 : Word   := 0;
      Remarks                    : Status := 0;
   end record
   with Convention => C;

   --  Numbers of a sample: the temperature and the auxiliary channels.
   function Channels (T : Table) return Positive with Global => null;

   --  Whether Init or Restore has started the state.
   function Is_Started (S : State) return Boolean with Global => null;

   --  Numbers of a sample of the state's table.
   function Channels (S : State) return Positive with Global => null, Pre => Is_Started (S);

   --  Boot self-test: layout, arithmetic, checksum, ranges, known answers.
   function Check (T : Table) return Status
   with Global => null, Post => Check'Result in E_Image | E_Self_Test | E_Layout | Ok;

   --  Starts a state for samples that come each Period_Us.
   procedure Init (S : in out State; T : aliased Table; Period_Us : Period; Result : out Status)
   with Global => null, Post => Result <= Ok and then (if Result = Ok then Is_Started (S));

   --  What was read Elapsed_Us after the call before: the temperature, then the auxiliary channels.
   procedure Sample (S : in out State; Elapsed_Us : Period; Readings : Numbers; Result : out Status)
   with Global => null,
        Pre  => Is_Started (S) and then Readings'Length = Channels (S),
        Post => Result >= Ok and then Is_Started (S);

   --  Elapsed_Us in which nothing was read.
   procedure Missed (S : in out State; Elapsed_Us : Period; Result : out Status)
   with Global => null, Pre => Is_Started (S), Post => Result >= Ok and then Is_Started (S);

   --  The correction in force; compensated = measured - bias.
   procedure Bias (S : State; Value : out Number; Result : out Status)
   with Global => null, Pre => Is_Started (S), Post => Result >= Ok;

   --  The correction with its uncertainty; E_Absent for a table without uncertainties.
   procedure Take (S : State; Value : out Snapshot; Result : out Status)
   with Global => null, Pre => Is_Started (S), Post => Result >= Ok or else Result = E_Absent;

   --  The state as words, for flash.
   procedure Save (S : State; To : out Saved_State; Result : out Status)
   with Global => null, Pre => Is_Started (S), Post => Result = Ok;

   --  Takes over what is kept over Off_Blocks whole blocks without power; negative: Init instead.
   procedure Restore
     (S : in out State; T : aliased Table; Period_Us : Period; From : Saved_State; Off_Blocks : Word;
      Result : out Status)
   with Global => null, Post => Result <= Ok and then (if Result = Ok then Is_Started (S));

   --  The angle to subtract from an angle increment over an interval.
   procedure Increment (A : in out Angle; Bias, Interval : Number; Value : out Number; Result : out Status)
   with Global => null, Pre => Zero <= Interval and then Interval <= Longest, Post => Result in E_Arg | Ok;

private
   pragma SPARK_Mode (Off);

   --  As much of a table as is read here: the 25th word is the number of its channels, docs/FORMAT.md.
   type Table is limited record
      Head : Words (1 .. 25);
   end record
   with Convention => C;

   --  Room for a state of C, whose first member is the table's address; a word more where 64 bits are aligned.
   type Contents is limited record
      Of_Table : System.Address := System.Null_Address;
      Numbers  : Words (1 .. 25 + Max_Slope_Blocks + 2 * Max_Terms);
      Inputs   : Words (1 .. 1 + (Max_Terms + 1) * Input_Words);
   end record
   with Convention => C;
   for Contents'Alignment use 8;

   type State is new Contents;

   type Angle is limited record
      Rest : Interfaces.Unsigned_64 := 0;
   end record
   with Convention => C;
end Gtc.Binding;
