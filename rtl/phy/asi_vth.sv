// SPDX-License-Identifier: Apache-2.0
// asi_vth: tells the front end to drop the amplitude it has held, once in each pause of the line, so that the next
// telegram's first pulse sets the threshold anew.
// A pulse that has just begun shows as a strobe only StrobeDelay later. So rx_vth_clear_o rises one clock after
// PauseNs since the last strobe, PauseNs + StrobeDelay + 1 clock after the last pulse on the pins: then it is known
// that no pulse came within PauseNs, and no gap inside a legal telegram is longer. It falls early with the next strobe.
// Requirements: LT-014 (docs/requirements.md).
module asi_vth #(
  parameter int unsigned ClkHz      = 16_000_000,
  parameter int unsigned PauseNs    = asi_timing_pkg::PauseNs,
  parameter int unsigned VthClearNs = asi_timing_pkg::VthClearNs
) (
  input  logic clk_i, rst_i,           // rst_i: synchronous, active high
  input  logic n_start_i, p_start_i,   // one clock per filtered pulse
  output logic rx_vth_clear_o          // 1: drop the held amplitude; also in reset and for VthClearNs after it
);
  localparam int unsigned Pause = asi_timing_pkg::clocks(PauseNs, ClkHz);
  localparam int unsigned Stop  = Pause + asi_timing_pkg::clocks(VthClearNs, ClkHz);
  localparam int unsigned CntW  = $clog2(Stop + 1);
  logic [CntW-1:0] cnt_d, cnt_q;       // clocks since the last strobe; rests at Stop
  logic            clear_d;

  always_comb begin
    cnt_d   = (cnt_q == CntW'(Stop)) ? cnt_q : cnt_q + 1'b1;
    clear_d = (cnt_q == CntW'(Stop)) ? 1'b0 : (cnt_q == CntW'(Pause)) || rx_vth_clear_o;
    if (n_start_i || p_start_i) begin cnt_d = CntW'(1); clear_d = 1'b0; end
  end

  always_ff @(posedge clk_i) begin
    cnt_q          <= rst_i ? CntW'(Pause + 1) : cnt_d;
    rx_vth_clear_o <= rst_i ? 1'b1             : clear_d;
  end

`ifndef SYNTHESIS
  // the clear is over before the earliest answer may come
  initial Times_A: assert (VthClearNs > 0 && Stop + 1 + asi_timing_pkg::strobe_delay(asi_timing_pkg::FilterNs, ClkHz) <=
                           asi_timing_pkg::clocks(asi_timing_pkg::RxOpenNs, ClkHz));
  always_ff @(posedge clk_i) if (!rst_i) begin
    Range_A: assert (cnt_q <= CntW'(Stop));
    Clear_A: assert (cnt_q == CntW'(Stop) || rx_vth_clear_o == (cnt_q > CntW'(Pause)));
    Pause_C: cover (rx_vth_clear_o);
    Ended_C: cover (rx_vth_clear_o && (n_start_i || p_start_i));
  end
`endif
endmodule
