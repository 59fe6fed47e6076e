--  Arithmetic q31: 2^-16 C, 2^-16 C per block, 2^-Bias_Frac_Bits deg/h; increments over microseconds.
--
--  SPDX-License-Identifier: MIT
with System;

package Gtc.Q31 with
  SPARK_Mode => On
is
   use type Interfaces.Integer_32;

   subtype Number is Interfaces.Integer_32;
   type Numbers is array (Positive range <>) of aliased Number with Convention => C;

   --  Constant data of an emitted C file: import it with Convention => C, External_Name => "gtc_<id>_q31".
   type Table is limited private;

   --  State of one table; all calls that take it come from one task.
   type State is limited private;

   --  Sum of angle increments, apart from any state.
   type Angle is limited private;

   type Snapshot is record
      Bias          : Number;
      Sigma         : Number;
      Correlation_S : Number;
      Age_Blocks    : Interfaces.Unsigned_32;
      Remarks       : Interfaces.Integer_32;
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
   with Global => null, Post => Check'Result in E_Image | E_Self_Test | E_Layout | Ok,
        Import, Convention => C, External_Name => "gtc_q31_check";

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

   --  The correction with its uncertainty; E_Layout for a table without uncertainties.
   procedure Take (S : State; Value : out Snapshot; Result : out Status)
   with Global => null, Pre => Is_Started (S), Post => Result >= Ok or else Result = E_Layout;

   --  The state as words, for flash.
   procedure Save (S : State; To : out Saved_State; Result : out Status)
   with Global => null, Pre => Is_Started (S), Post => Result = Ok;

   --  Takes over what is kept over Off_Blocks whole blocks without power; negative: Init instead.
   procedure Restore
     (S      : in out State; T : aliased Table; Period_Us : Period; From : Saved_State;
      Off_Blocks : Interfaces.Unsigned_32; Result : out Status)
   with Global => null, Post => Result <= Ok and then (if Result = Ok then Is_Started (S));

   --  The angle to subtract from an angle increment over an interval.
   procedure Increment (A : in out Angle; Bias, Interval : Number; Value : out Number; Result : out Status)
   with Global => null, Pre => Interval >= 0 and then Interval <= 1_000_000_000, Post => Result in E_Arg | Ok;

private
   pragma SPARK_Mode (Off);

   type Addresses is array (Positive range <>) of System.Address with Convention => C;

   type Table is limited record
      Head      : Words (1 .. 33);
      Arrays    : Addresses (1 .. 8);
      Crc       : Word;
      Term_Code : System.Address := System.Null_Address;
   end record
   with Convention => C;

   type Input is record
      Contents : Words (1 .. 12);
      Sum      : Interfaces.Integer_64;
   end record
   with Convention => C;

   type Inputs is array (1 .. Max_Terms + 1) of Input with Convention => C;

   type Contents is limited record
      Of_Table : System.Address := System.Null_Address;
      Numbers  : Words (1 .. 24 + Max_Slope_Blocks + 2 * Max_Terms);
      Channel  : Inputs;
   end record
   with Convention => C;

   type State is new Contents;

   type Angle is limited record
      Rest : Interfaces.Integer_64 := 0;
   end record
   with Convention => C;
end Gtc.Q31;
