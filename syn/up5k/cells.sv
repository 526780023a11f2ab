// SPDX-License-Identifier: Apache-2.0
// Port list of the iCE40 UP5K memory block, for tools that do not know the part (slang).
(* blackbox *)
module SB_SPRAM256KA (
  input  logic [13:0] ADDRESS,
  input  logic [15:0] DATAIN,
  input  logic [3:0]  MASKWREN,
  input  logic        WREN, CHIPSELECT, CLOCK, STANDBY, SLEEP, POWEROFF,
  output logic [15:0] DATAOUT
);
endmodule
