// SPDX-License-Identifier: Apache-2.0
// asi_pulse_filter: one strobe per comparator pulse that lasted FilterNs without a break.
// A pause shorter than FilterNs inside a pulse does not end it, so a ringing comparator gives one strobe only.
// Delay: the strobe is high FilterNs after the rise of pulse_i (from the pin: asi_timing_pkg::strobe_delay).
// Requirements: RX-009 (docs/requirements.md).
module asi_pulse_filter #(
  parameter int unsigned ClkHz    = 16_000_000,
  parameter int unsigned FilterNs = asi_timing_pkg::FilterNs
) (
  input  logic clk_i, rst_i,  // rst_i: synchronous, active high
  input  logic pulse_i,       // comparator, synchronised
  output logic start_o        // one clock per accepted pulse
);
  localparam int unsigned Clocks = asi_timing_pkg::clocks(FilterNs, ClkHz);
  localparam int unsigned CntW   = $clog2(Clocks);
  logic            active_q, flip;  // active_q: the filtered pulse; flip: pulse_i has disagreed long enough
  logic [CntW-1:0] cnt_d, cnt_q;    // clocks of disagreement

  always_comb begin
    flip  = (pulse_i != active_q) && (cnt_q == CntW'(Clocks - 1));
    cnt_d = ((pulse_i == active_q) || flip) ? '0 : cnt_q + 1'b1;
  end

  always_ff @(posedge clk_i) begin
    cnt_q    <= rst_i ? '0   : cnt_d;
    active_q <= rst_i ? 1'b0 : active_q ^ flip;
    start_o  <= rst_i ? 1'b0 : flip && !active_q;
  end

`ifndef SYNTHESIS
  initial Filter_A: assert (Clocks >= 2);
  logic start_q;
  always_ff @(posedge clk_i) begin
    start_q <= start_o;
    if (!rst_i) begin
      OneClock_A: assert (!(start_o && start_q));
      Strobe_A:   assert (!start_o || active_q);
      Start_C:    cover (start_o);
      Glitch_C:   cover (!active_q && !pulse_i && cnt_q != '0);
      DropOut_C:  cover (active_q && pulse_i && cnt_q != '0);
    end
  end
`endif
endmodule
