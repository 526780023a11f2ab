// SPDX-License-Identifier: Apache-2.0
// Proof of asi_sync (LT-002, LT-004: the delay that the timer of asi_xact takes out is constant, two clocks).
module asi_sync_fv (input logic clk_i, rst_i, input logic [1:0] async_i);
  localparam logic [1:0] ResetValue = 2'b10;
  logic [1:0] sync;
  asi_sync #(.Width(2), .ResetValue(ResetValue)) dut (.clk_i, .rst_i, .async_i, .sync_o(sync));

  logic       init_q = 1'b1;           // the first clock
  logic       rst1_q, rst2_q;          // reset one and two clocks ago
  logic [1:0] in1_q, in2_q;            // input one and two clocks ago
  logic [1:0] age_q = '0;              // clocks since the start, at most 2
  always_ff @(posedge clk_i) begin
    init_q <= 1'b0;
    if (init_q) assume (rst_i);
    {rst2_q, rst1_q} <= {rst1_q, rst_i};
    {in2_q, in1_q}   <= {in1_q, async_i};
    if (age_q != 2'd2) age_q <= age_q + 1'b1;
    if (age_q == 2'd2) begin
      Delay_A: assert (sync == ((rst1_q || rst2_q) ? ResetValue : in2_q));
      Rise_C:  cover (!rst1_q && !rst2_q && sync == 2'b11 && in1_q == 2'b00);
      Reset_C: cover (rst1_q && !rst2_q && in2_q != ResetValue);
    end
  end
endmodule
