// SPDX-License-Identifier: Apache-2.0
// asi_rx for proofs that hold whatever a receiver says: every output is free in every clock; it decides only when enabled.
module asi_rx
  import asi_map_pkg::*;
#(
  parameter int unsigned ClkHz = 8_000_000, Bits = 7, HalfBitNs = 0, WinEarlyNs = 0, WinLateNs = 0, RxQuietNs = 0
) (
  input  logic            clk_i, rst_i, n_start_i, p_start_i, en_i,
  output logic            first_o, done_o,
  output error_class_e    class_o,
  output logic [Bits-4:0] data_o,
  output logic [7:0]      dev_o,
  output logic            dev_late_o
);
  (* anyseq *) logic            done;
  (* anyseq *) logic [3:0]      cls;
  (* anyseq *) logic [Bits-4:0] data;
  (* anyseq *) logic [7:0]      dev;
  (* anyseq *) logic            late;
  assign first_o    = 1'b0;
  assign done_o     = en_i && done;
  assign class_o    = error_class_e'(cls);
  assign data_o     = data;
  assign dev_o      = dev;
  assign dev_late_o = late;
endmodule
