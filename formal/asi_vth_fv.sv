// SPDX-License-Identifier: Apache-2.0
// Proof of asi_vth (LT-014), unbounded, for any train of strobes: the clear never comes within P_PAUSE of a pulse, on
// either side of it, and always, exactly and only once, when there was none for longer.
module asi_vth_fv (input logic clk_i, rst_i, n_start_i, p_start_i);
  localparam int unsigned Pause = 67, Clear = 16;  // 8.375 us and 2 us at 8 MHz, counted by hand
  logic clear;
  asi_vth #(.ClkHz(8_000_000)) dut (.clk_i, .rst_i, .n_start_i, .p_start_i, .rx_vth_clear_o(clear));

  logic       init_q = 1'b1, live_q = 1'b0, cleared_q;  // cleared_q: since the last strobe
  logic [7:0] since_q;                                  // clocks since the last strobe, this one included
  logic       pulse;
  assign pulse = n_start_i || p_start_i;
  always_ff @(posedge clk_i) begin
    init_q <= 1'b0;
    if (init_q) assume (rst_i);
    live_q    <= 1'b1;
    cleared_q <= !rst_i && !pulse && (cleared_q || clear);
    since_q   <= rst_i ? 8'(Pause + 1) : pulse ? 8'd1 : (since_q != '1) ? since_q + 1'b1 : since_q;
    if (live_q) begin
      Never_A:  assert (!clear || since_q > 8'(Pause));          // the last pulse is longer ago
      // ... and so is the one whose strobe is still to come: with a gap within P_PAUSE it has seen no clear
      Gap_A:    assert (!(pulse && since_q <= 8'(Pause)) || (!clear && !cleared_q));
      Always_A: assert (since_q <= 8'(Pause) || since_q > 8'(Pause + Clear) || clear);
      Once_A:   assert (since_q <= 8'(Pause + Clear) || !clear);
      // for the induction
      Count_A:  assert (dut.cnt_q == 7'(since_q > 8'(Pause + Clear) ? 8'(Pause + Clear) : since_q));
      Since_A:  assert (since_q != '0 && (cleared_q || since_q <= 8'(Pause + 1)));
      Past_A:   assert (!cleared_q || since_q > 8'(Pause));
    end
    Twice_C: cover (!rst_i && clear && since_q == 8'(Pause + Clear));
    Late_C:  cover (!rst_i && pulse && since_q == 8'(Pause));    // the longest gap of a legal telegram
  end
endmodule
