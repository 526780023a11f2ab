// SPDX-License-Identifier: Apache-2.0
// asi_tx_guard: takes a sender that stays on for JabberNs off the line until it lets go. The pins are gated without a
// register in between, so the times of asi_xact are those of the pins: tx_en_o is high for exactly JabberNs at most.
// Requirements: LT-013 (docs/requirements.md).
module asi_tx_guard #(
  parameter int unsigned ClkHz    = 16_000_000,
  parameter int unsigned JabberNs = asi_timing_pkg::JabberNs
) (
  input  logic clk_i, rst_i,        // rst_i: synchronous, active high
  input  logic man_i, en_i,         // from asi_xact: Manchester level, sender on
  output logic tx_man_o, tx_en_o,   // pins
  output logic jabber_o             // one clock, the first one in which a sender is cut off
);
  localparam int unsigned Jabber = asi_timing_pkg::clocks(JabberNs, ClkHz);
  localparam int unsigned CntW   = $clog2(Jabber);
  // The count starts so that its overflow into the top bit is the end of the time: no comparator. There it stops.
  localparam logic [CntW:0] Start = (CntW + 1)'((1 << CntW) - Jabber);
  logic [CntW:0] cnt_d, cnt_q;
  logic          cut, cut_q;        // cut: the time is over; cut_q: it was over one clock ago

  assign cut      = cnt_q[CntW];
  assign tx_man_o = man_i | cut;
  assign tx_en_o  = en_i & ~cut;
  assign jabber_o = en_i & cut & ~cut_q;
  assign cnt_d    = !en_i ? Start : cut ? cnt_q : cnt_q + 1'b1;

  always_ff @(posedge clk_i) begin
    cnt_q <= rst_i ? Start : cnt_d;
    cut_q <= rst_i ? 1'b0  : cut;
  end

`ifndef SYNTHESIS
  initial Jabber_A: assert (Jabber >= 2);
  always_ff @(posedge clk_i) if (!rst_i) begin
    Rest_A:  assert (!cut || (tx_man_o && !tx_en_o));
    Pass_A:  assert (cut || (tx_man_o == man_i && tx_en_o == en_i));
    Event_A: assert (!jabber_o || (en_i && !tx_en_o));
    Cut_C:   cover (jabber_o);
    Again_C: cover (cut_q && !cut && en_i);
  end
`endif
endmodule
