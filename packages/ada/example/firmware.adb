--  Feeds a ramp with a missing reading to both arithmetics and prints the bits of what they give.
--
--  SPDX-License-Identifier: MIT
with Ada.Strings.Fixed;
with Ada.Text_IO;
with Ada.Unchecked_Conversion;
with Gtc.F32;
with Gtc.Q31;
with Interfaces.C;

procedure Firmware is
   use type Gtc.Status;
   use type Interfaces.C.C_float;
   use type Interfaces.Integer_32;
   use type Interfaces.Unsigned_32;

   function Bits is new Ada.Unchecked_Conversion (Interfaces.C.C_float, Interfaces.Unsigned_32);
   function Bits is new Ada.Unchecked_Conversion (Interfaces.Integer_32, Interfaces.Unsigned_32);

   Float_Table : aliased Gtc.F32.Table
   with Import, Convention => C, External_Name => "gtc_rlg_0042_f32";
   Fixed_Table : aliased Gtc.Q31.Table
   with Import, Convention => C, External_Name => "gtc_rlg_0042_q31";

   Hex : constant String := "0123456789abcdef";

   function Image (Value : Interfaces.Unsigned_32) return String is
      Text : String (1 .. 8);
      Rest : Interfaces.Unsigned_32 := Value;
   begin
      for K in reverse Text'Range loop
         Text (K) := Hex (Natural (Rest mod 16) + 1);
         Rest     := Rest / 16;
      end loop;
      return Text;
   end Image;

   Float_State : Gtc.F32.State;
   Fixed_State : Gtc.Q31.State;
   Snapshot    : Gtc.F32.Snapshot;
   Float_Bias  : Interfaces.C.C_float;
   Fixed_Bias  : Interfaces.Integer_32;
   Saved       : Gtc.Saved_State;
   Status      : Gtc.Status;
   Remarks     : Gtc.Status;

   procedure Demand (What : Boolean) is
   begin
      if not What then
         raise Program_Error with "status" & Gtc.Status'Image (Status);
      end if;
   end Demand;
begin
   Demand (Gtc.F32.Check (Float_Table) = Gtc.Ok and then Gtc.Q31.Check (Fixed_Table) = Gtc.Ok);
   Gtc.F32.Init (Float_State, Float_Table, 1_000_000, Status);
   Demand (Status = Gtc.Ok);
   Gtc.Q31.Init (Fixed_State, Fixed_Table, 1_000_000, Status);
   Demand (Status = Gtc.Ok);
   for K in 0 .. 599 loop
      if K = 300 then
         Gtc.Q31.Save (Fixed_State, Saved, Status);
         Demand (Status = Gtc.Ok);
         Gtc.Q31.Restore (Fixed_State, Fixed_Table, 1_000_000, Saved, 0, Status);
         Demand (Status = Gtc.Ok);
      end if;
      if K mod 100 = 99 then
         Gtc.F32.Missed (Float_State, 1_000_000, Status);
         Gtc.Q31.Missed (Fixed_State, 1_000_000, Status);
      else
         Gtc.F32.Sample (Float_State, 1_000_000, (1 => 20.0 + Interfaces.C.C_float (K) / 64.0), Status);
         Gtc.Q31.Sample (Fixed_State, 1_000_000, (1 => 20 * 65536 + Interfaces.Integer_32 (K) * 1024), Status);
      end if;
      Gtc.F32.Bias (Float_State, Float_Bias, Remarks);
      Gtc.Q31.Bias (Fixed_State, Fixed_Bias, Status);
      Ada.Text_IO.Put_Line
        (Ada.Strings.Fixed.Trim (K'Image, Ada.Strings.Left) & " " & Image (Bits (Float_Bias)) & " "
         & Image (Bits (Fixed_Bias)) & " "
         & Ada.Strings.Fixed.Trim (Remarks'Image, Ada.Strings.Left));
   end loop;
   Gtc.F32.Take (Float_State, Snapshot, Status);
   Demand (Status = Gtc.E_Absent or else Snapshot.Sigma > 0.0);
end Firmware;
