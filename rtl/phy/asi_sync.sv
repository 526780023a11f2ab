// SPDX-License-Identifier: Apache-2.0
// asi_sync: the one synchroniser for asynchronous inputs, two flip-flops per bit.
// Delay: two clocks. ResetValue is what the rest of the chip sees until the first real sample.
module asi_sync #(
  parameter int unsigned       Width      = 1,
  parameter logic [Width-1:0]  ResetValue = '0
) (
  input  logic             clk_i, rst_i,  // rst_i: synchronous, active high
  input  logic [Width-1:0] async_i,
  output logic [Width-1:0] sync_o
);
  logic [Width-1:0] meta_q;
  always_ff @(posedge clk_i) begin
    meta_q <= rst_i ? ResetValue : async_i;
    sync_o <= rst_i ? ResetValue : meta_q;
  end
endmodule
