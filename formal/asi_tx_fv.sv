// SPDX-License-Identifier: Apache-2.0
// Proof of asi_tx, unbounded, for every call and any number of requests one after the other:
// TL-001, TL-003, TL-004: MAN is at each clock what the table of half bits says; TL-005: first edge down, last edge up;
// LT-001: edges on multiples of 3 us only, to the clock; LT-009: tx_en at every edge, up after arm, down with busy.
module asi_tx_fv (input logic clk_i, rst_i, start_i, arm_i, input logic [10:0] call_i);
`ifdef FV_COVER
  localparam int unsigned Half = 2, HalfBitNs = 250;
`else
  localparam int unsigned Half = 24, HalfBitNs = 3_000;  // at 8 MHz, counted by hand
`endif
  logic busy, last, man, en;
  asi_tx #(.ClkHz(8_000_000), .HalfBitNs(HalfBitNs)) dut (
    .clk_i, .rst_i, .start_i, .arm_i, .call_i, .busy_o(busy), .last_o(last), .tx_man_o(man), .tx_en_o(en)
  );

  // The rule: half bit 0 begins with the falling edge in the middle of the start bit; half bit 2k is the second half of
  // bit k and shows it, half bit 2k - 1 is its first half and shows the complement; 27 half bits in all.
  logic        init_q = 1'b1, live_q = 1'b0;
  logic        on_q;       // a request is on the line
  logic [4:0]  half_q;     // half bit 0..26
  logic [4:0]  clk_q;      // clock in it
  logic [13:0] word_q;     // bit 13 = start bit, 0 = end bit
  logic        arm_q, man_q, was_on_q;
  logic [3:0]  ones;       // in CB, A, I, PB
  logic [4:0]  bit_no;
  logic        expected, earlier, edge_seen;  // MAN now, MAN in the half bit before
  always_comb begin
    ones = '0;
    for (int k = 1; k <= 12; k++) ones = ones + 4'(word_q[k]);
  end
  assign bit_no    = (half_q + 5'd1) >> 1;            // of the word, 0 = start bit
  assign expected  = !on_q || (word_q[13 - bit_no] ^ half_q[0]);
  assign earlier   = (half_q == '0) || (word_q[13 - (half_q >> 1)] ^ !half_q[0]);
  assign edge_seen = man != man_q;

  always_ff @(posedge clk_i) begin
    init_q <= 1'b0;
    if (init_q) assume (rst_i);
    assume (!(start_i && on_q));                      // the contract of start_i
`ifdef FV_COVER  // one request after the other, to be found in little time
    assume (rst_i == init_q && start_i == !on_q && call_i == 11'h3E9);
`endif
    live_q   <= 1'b1;
    arm_q    <= arm_i && !rst_i;
    man_q    <= rst_i || man;
    was_on_q <= on_q && !rst_i;
    if (rst_i) on_q <= 1'b0;
    else if (!on_q && start_i) begin
      on_q   <= 1'b1;  half_q <= '0;  clk_q <= '0;
      word_q <= {1'b0, call_i, call_i[0] ^ call_i[1] ^ call_i[2] ^ call_i[3] ^ call_i[4] ^ call_i[5] ^ call_i[6] ^
                 call_i[7] ^ call_i[8] ^ call_i[9] ^ call_i[10], 1'b1};
    end else if (on_q) begin
      clk_q <= clk_q + 1'b1;
      if (clk_q == 5'(Half - 1)) begin
        clk_q  <= '0;
        half_q <= half_q + 1'b1;
        if (half_q == 5'd26) on_q <= 1'b0;
      end
    end
    if (live_q) begin
      Man_A:     assert (man == expected);
      Busy_A:    assert (busy == on_q);
      Last_A:    assert (last == (on_q && half_q == 5'd26 && clk_q == '0));
      Enable_A:  assert (en == (on_q || arm_q));
      Grid_A:    assert (!edge_seen || (on_q && clk_q == '0));
      EdgeEn_A:  assert (!edge_seen || en);
      First_A:   assert (!on_q || half_q != '0 || clk_q != '0 || (edge_seen && !man));
      End_A:     assert (!last || (edge_seen && man));
      Info_A:    assert (!on_q || half_q[0] || clk_q != '0 || edge_seen);     // an edge in every mid-bit
      Parity_A:  assert (!on_q || !ones[0]);
      // for the induction: where the block is in its word
      Frame_A:   assert (!on_q || (half_q <= 5'd26 && clk_q < 5'(Half) && !word_q[13] && word_q[0]));
      Was_A:     assert (!on_q || was_on_q || (half_q == '0 && clk_q == '0));
      Prev_A:    assert (!on_q || man_q == (clk_q != '0 ? expected : earlier));
      Rest_A:    assert (on_q || man_q);
      State_A:   assert (dut.state_q == (!on_q ? 2'd0 : half_q[0] ? 2'd2 : 2'd1));  // StIdle, StBound, StMid
      Count_A:   assert (!on_q || dut.cnt_q == clk_q);
      Bits_A:    assert (!on_q || dut.bits_q == 13'({word_q[12:0], 13'd0} >> (13 - 5'(half_q >> 1))));
    end
    Repeat_C: cover (!rst_i && last && word_q[11:7] == 5'd31 && man_q == 1'b0);
    Lead_C:   cover (!rst_i && en && !busy && arm_q);
    Over_C:   cover (was_on_q && !on_q && !rst_i && !arm_q);
  end
endmodule
