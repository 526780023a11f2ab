// SPDX-License-Identifier: Apache-2.0
// Proof of asi_pulse_filter (RX-009), unbounded: there is a strobe exactly when the last FilterNs were all active and
// FilterNs of inactivity came between this and the strobe before. Both "only after" and "always" follow.
module asi_pulse_filter_fv (input logic clk_i, rst_i, pulse_i);
  localparam int unsigned Clocks = 6;  // 750 ns at 8 MHz, counted by hand
  logic start;
  asi_pulse_filter #(.ClkHz(8_000_000)) dut (.clk_i, .rst_i, .pulse_i, .start_o(start));

  logic              init_q = 1'b1;
  logic [Clocks-1:0] past_q;  // the last samples, before this clock; reset counts as inactive
  logic              rest_q;  // inactive for FilterNs since the last strobe, or reset
  logic              live_q = 1'b0;
  logic [1:0]        strobes_q;
  logic              expected;
  assign expected = &past_q && rest_q;
  always_ff @(posedge clk_i) begin
    init_q <= 1'b0;
    if (init_q) assume (rst_i);
    live_q <= 1'b1;
    past_q <= rst_i ? '0 : {past_q[Clocks-2:0], pulse_i};
    rest_q <= rst_i || (past_q == '0) || (rest_q && !expected);
    strobes_q <= rst_i ? '0 : strobes_q + 2'(start && strobes_q != '1);
    if (live_q) begin
      Exact_A: assert (start == expected);
      // for the induction: the block's own state is that of the rule
      Active_A: assert (past_q == '0 || dut.active_q == (!rest_q || expected));
      Rest_A:   assert (past_q != '0 || !dut.active_q);
      Count_A:  assert (dut.cnt_q < 3'(Clocks));
      Second_C: cover (start && strobes_q == 2'd1);
      Short_C:  cover (past_q == 6'b011111 && !pulse_i && rest_q);      // one clock less than 750 ns
      DropOut_C: cover (&past_q && !rest_q && !start && strobes_q == 2'd1);
    end
  end
endmodule
