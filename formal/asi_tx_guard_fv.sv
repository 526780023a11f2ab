// SPDX-License-Identifier: Apache-2.0
// Proof of asi_tx_guard (LT-013), unbounded, for any levels from the transmitter: the pins are those of the transmitter
// in the first P_JABBER of every time it is on, at rest from then until it lets go, one event per cut.
module asi_tx_guard_fv (input logic clk_i, rst_i, man_i, en_i);
`ifdef FV_COVER
  localparam int unsigned Jabber = 8, JabberNs = 1_000;
`else
  localparam int unsigned Jabber = 2_400, JabberNs = 300_000;  // clocks at 8 MHz, counted by hand
`endif
  logic man, en, jabber;
  asi_tx_guard #(.ClkHz(8_000_000), .JabberNs(JabberNs)) dut (
    .clk_i, .rst_i, .man_i, .en_i, .tx_man_o(man), .tx_en_o(en), .jabber_o(jabber)
  );

  logic        init_q = 1'b1, live_q = 1'b0;
  logic [12:0] on_q;      // clocks without a break in which the transmitter was on, before this one
  logic [12:0] pin_q;     // the same of the pin
  logic        was_q;     // the transmitter was cut before
  always_ff @(posedge clk_i) begin
    init_q <= 1'b0;
    if (init_q) assume (rst_i);
    live_q <= 1'b1;
    on_q   <= (rst_i || !en_i) ? '0 : (on_q != '1) ? on_q + 1'b1 : on_q;
    pin_q  <= (rst_i || !en)   ? '0 : pin_q + 1'b1;
    was_q  <= !rst_i && (was_q || jabber);
    if (live_q && !rst_i) begin
      Never_A: assert (pin_q < 13'(Jabber) || !en);              // never longer
      Early_A: assert (!(en_i && !en) || on_q >= 13'(Jabber));   // never cut earlier
      Pass_A:  assert (on_q >= 13'(Jabber) || (en == en_i && man == man_i));
      Rest_A:  assert (on_q < 13'(Jabber) || (man && !en));
      Event_A: assert (jabber == (en_i && on_q == 13'(Jabber)));
      // for the induction
      Count_A: assert (on_q >= 13'(Jabber) ? dut.cut : 13'(dut.cnt_q) == on_q + 13'(dut.Start));
      Cut_A:   assert (dut.cut_q == (on_q > 13'(Jabber)) || !en_i || on_q == '0);
      Was_A:   assert (!dut.cut || !(on_q > 13'(Jabber)) || dut.cut_q);
      Pin_A:   assert (pin_q == (on_q > 13'(Jabber) ? '0 : on_q));
    end
    Recover_C: cover (!rst_i && was_q && en && pin_q == 13'd3);  // on again after a cut
  end
endmodule
