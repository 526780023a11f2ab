// SPDX-License-Identifier: Apache-2.0
// asi_ram for proofs: only the watched word is kept, a read of any other gives a wrong value. The watched address is
// any constant, so what is proved of this word is proved of all.
module asi_ram #(
  parameter int unsigned Words = 1024
) (
  input  logic                     clk_i,
  input  logic                     req_i, we_i,
  input  logic [3:0]               be_i,
  input  logic [$clog2(Words)-1:0] addr_i,
  input  logic [31:0]              wdata_i,
  output logic [31:0]              rdata_o
);
  logic [$clog2(Words)-1:0] watch_q;   // free at the start, then constant
  logic [31:0]              word_q;
  always_ff @(posedge clk_i) begin
    watch_q <= watch_q;
    if (req_i && we_i) begin
      for (int b = 0; b < 4; b++) if (be_i[b] && addr_i == watch_q) word_q[8*b +: 8] <= wdata_i[8*b +: 8];
    end else if (req_i) rdata_o <= (addr_i == watch_q) ? word_q : ~word_q;
  end
endmodule
