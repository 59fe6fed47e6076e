--  SPDX-License-Identifier: MIT
package body Gtc.Binding with
  SPARK_Mode => Off
is
   use type System.Address;

   function Channels (T : Table) return Positive is (Positive (T.Head (25)));

   function Is_Started (S : State) return Boolean is (S.Of_Table /= System.Null_Address);

   function Channels (S : State) return Positive is
      T : Table with Import, Address => S.Of_Table;
   begin
      return Channels (T);
   end Channels;

   function Check (T : Table) return Status is (C_Check (T'Address));

   procedure Init (S : in out State; T : aliased Table; Period_Us : Period; Result : out Status) is
   begin
      Result := C_Init (S'Address, T'Address, Period_Us);
   end Init;

   procedure Sample (S : in out State; Elapsed_Us : Period; Readings : Numbers; Result : out Status) is
   begin
      Result := C_Sample (S'Address, Elapsed_Us, Readings'Address);
   end Sample;

   procedure Missed (S : in out State; Elapsed_Us : Period; Result : out Status) is
   begin
      Result := C_Sample (S'Address, Elapsed_Us, System.Null_Address);
   end Missed;

   procedure Bias (S : State; Value : out Number; Result : out Status) is
   begin
      Value  := Zero;
      Result := C_Bias (S'Address, Value'Address);
   end Bias;

   procedure Take (S : State; Value : out Snapshot; Result : out Status) is
   begin
      Result := C_Snapshot (S'Address, Value'Address);
   end Take;

   procedure Save (S : State; To : out Saved_State; Result : out Status) is
   begin
      To     := (others => 0);
      Result := C_Save (S'Address, To'Address);
   end Save;

   procedure Restore
     (S : in out State; T : aliased Table; Period_Us : Period; From : Saved_State; Off_Blocks : Word;
      Result : out Status) is
   begin
      Result := C_Restore (S'Address, T'Address, Period_Us, From'Address, Off_Blocks);
   end Restore;

   procedure Increment (A : in out Angle; Bias, Interval : Number; Value : out Number; Result : out Status) is
   begin
      Value  := Zero;
      Result := C_Angle (A'Address, Bias, Interval, Value'Address);
   end Increment;
end Gtc.Binding;
