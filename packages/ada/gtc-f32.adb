--  SPDX-License-Identifier: MIT
package body Gtc.F32 with
  SPARK_Mode => Off
is
   use type System.Address;

   function Run_Init (S : in out State; T : Table; Period_Us : Period) return Status
   with Import, Convention => C, External_Name => "gtc_f32_init_20blocks_4terms";
   function Run_Sample (S : in out State; Elapsed_Us : Period; Readings : System.Address) return Status
   with Import, Convention => C, External_Name => "gtc_f32_sample";
   function Run_Bias (S : State; Value : in out Number) return Status
   with Import, Convention => C, External_Name => "gtc_f32_bias";
   function Run_Snapshot (S : State; Value : in out Snapshot) return Status
   with Import, Convention => C, External_Name => "gtc_f32_snapshot";
   function Run_Save (S : State; To : in out Saved_State) return Status
   with Import, Convention => C, External_Name => "gtc_f32_save";
   function Run_Restore
     (S : in out State; T : Table; Period_Us : Period; From : Saved_State; Off : Interfaces.Unsigned_32)
      return Status
   with Import, Convention => C, External_Name => "gtc_f32_restore_20blocks_4terms";
   function Run_Angle (A : in out Angle; Bias, Interval : Number; Value : in out Number) return Status
   with Import, Convention => C, External_Name => "gtc_f32_angle";

   --  The 25th word of a table, docs/FORMAT.md.
   function Channels (T : Table) return Positive is (Positive (T.Head (25)));

   function Is_Started (S : State) return Boolean is (S.Of_Table /= System.Null_Address);

   function Channels (S : State) return Positive is
      T : Table with Import, Address => S.Of_Table;
   begin
      return Channels (T);
   end Channels;

   procedure Init (S : in out State; T : aliased Table; Period_Us : Period; Result : out Status) is
   begin
      Result := Run_Init (S, T, Period_Us);
   end Init;

   procedure Sample (S : in out State; Elapsed_Us : Period; Readings : Numbers; Result : out Status) is
   begin
      Result := Run_Sample (S, Elapsed_Us, Readings'Address);
   end Sample;

   procedure Missed (S : in out State; Elapsed_Us : Period; Result : out Status) is
   begin
      Result := Run_Sample (S, Elapsed_Us, System.Null_Address);
   end Missed;

   procedure Bias (S : State; Value : out Number; Result : out Status) is
   begin
      Value  := 0.0;
      Result := Run_Bias (S, Value);
   end Bias;

   procedure Take (S : State; Value : out Snapshot; Result : out Status) is
   begin
      Value  := (Age_Blocks => 0, Remarks => 0, others => 0.0);
      Result := Run_Snapshot (S, Value);
   end Take;

   procedure Save (S : State; To : out Saved_State; Result : out Status) is
   begin
      To     := (others => 0);
      Result := Run_Save (S, To);
   end Save;

   procedure Restore
     (S      : in out State; T : aliased Table; Period_Us : Period; From : Saved_State;
      Off_Blocks : Interfaces.Unsigned_32; Result : out Status) is
   begin
      Result := Run_Restore (S, T, Period_Us, From, Off_Blocks);
   end Restore;

   procedure Increment (A : in out Angle; Bias, Interval : Number; Value : out Number; Result : out Status) is
   begin
      Value  := 0.0;
      Result := Run_Angle (A, Bias, Interval, Value);
   end Increment;
end Gtc.F32;
