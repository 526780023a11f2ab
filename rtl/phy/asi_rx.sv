// SPDX-License-Identifier: Apache-2.0
// asi_rx: receives one telegram of Bits bits from pulse strobes, makes every check and names the first that failed.
// The first pulse is the time base of the whole telegram. Time is kept as window number n and phase inside the window
// grid: phase 0 is the earliest legal start of pulse n, so "inside a window" is one comparison.
// Two choices: a window holds at most one pulse (a second one is a timing error, it could flip a bit), and what follows
// the end pulse is judged by its length only.
// Deviation: a pulse between two windows counts as early for the later one, which is the nearer grid point because the
// late limit is half a half bit. Of equal deviations the first one gives the sign.
// Requirements: RX-001 .. RX-008, RX-010, RX-011, RX-015 (docs/requirements.md).
module asi_rx
  import asi_map_pkg::*;
#(
  parameter int unsigned ClkHz      = 16_000_000,
  parameter int unsigned Bits       = 7,          // 7: response; 14: request (passive monitor)
  parameter int unsigned HalfBitNs  = asi_timing_pkg::HalfBitNs,
  parameter int unsigned WinEarlyNs = asi_timing_pkg::WinEarlyNs,
  parameter int unsigned WinLateNs  = asi_timing_pkg::WinLateNs,
  parameter int unsigned RxQuietNs  = asi_timing_pkg::RxQuietNs  // whole half bits
) (
  input  logic            clk_i, rst_i,        // rst_i: synchronous, active high
  input  logic            n_start_i, p_start_i,  // strobes of asi_pulse_filter
  input  logic            en_i,                // 1: listening; 0 drops a telegram
  output logic            first_o, done_o,     // one clock: first pulse; decision, with class_o and data_o
  output error_class_e    class_o,
  output logic [Bits-4:0] data_o,              // payload, I3..I0 for 7 bits
  // with done_o: largest distance of a pulse, up to the end pulse, from the grid of the first one, in clocks, stops at
  // FF; it was late
  output logic [7:0]      dev_o,
  output logic            dev_late_o
);
  localparam int unsigned Half   = asi_timing_pkg::clocks(HalfBitNs, ClkHz);
  localparam int unsigned Early  = asi_timing_pkg::clocks(WinEarlyNs, ClkHz);
  localparam int unsigned Width  = Early + asi_timing_pkg::clocks(WinLateNs, ClkHz);  // last phase inside a window
  localparam int unsigned EndWin = 2 * (Bits - 1);                    // window of the end pulse
  localparam int unsigned LenWin = EndWin + RxQuietNs / HalfBitNs;    // the length window closes with this window
  localparam int unsigned PhW    = $clog2(Half);
  localparam int unsigned WinW   = $clog2(LenWin + 1);
  function automatic int unsigned max(int unsigned a, int unsigned b);
    return (a > b) ? a : b;
  endfunction
  localparam int unsigned DistMax = max(max(Early, Width - Early), Half + Early - Width - 1);  // farthest off
  localparam int unsigned DistW   = max($clog2(DistMax + 1), 2);

  typedef enum logic {StWait, StRun} state_e;
  state_e          state_d, state_q;
  logic [PhW-1:0]  ph_d, ph_q;
  logic [WinW-1:0] win_d, win_q;
  logic [Bits-2:0] bits_d, bits_q;  // payload, parity bit, end bit
  logic pol_d, pol_q;               // polarity of the last pulse, 1 = positive
  logic seen_d, seen_q;             // this window has its pulse
  logic ended_d, ended_q;           // the end pulse was seen
  logic start_d, start_q, alt_d, alt_q, timing_d, timing_q, info_d, info_q, len_d, len_q;  // failed checks
  logic pulse, in_win, win_end, in_telegram;
  logic late, dev_late_d, dev_late_q;
  logic [DistW-1:0] off, dev_d, dev_q;  // distance from the grid of a pulse in this clock; the largest so far

  assign pulse       = n_start_i || p_start_i;
  assign in_win      = ph_q <= PhW'(Width);
  assign win_end     = ph_q == PhW'(Width);
  assign in_telegram = win_q <= WinW'(EndWin);
  assign data_o      = bits_q[Bits-2:2];
  // phase Early is the grid point of this window; behind the window the distance is that to the next one
  assign late        = in_win && ph_q >= PhW'(Early);
  assign off         = late ? DistW'(ph_q - PhW'(Early)) : DistW'((in_win ? PhW'(Early) : PhW'(Half + Early)) - ph_q);
  assign dev_o       = (DistMax > 255 && dev_d > DistW'(255)) ? 8'hFF : 8'(dev_d);
  assign dev_late_o  = dev_late_d;

  always_comb begin
    state_d = state_q;  ph_d = ph_q;  win_d = win_q;  bits_d = bits_q;
    pol_d   = pol_q;    seen_d = seen_q;  ended_d = ended_q;
    start_d = start_q;  alt_d = alt_q;  timing_d = timing_q;  info_d = info_q;  len_d = len_q;
    dev_d   = dev_q;    dev_late_d = dev_late_q;
    first_o = 1'b0;     done_o = 1'b0;
    unique case (state_q)
      // StWait: the next pulse is the first of a telegram
      StWait: if (pulse) begin
        state_d = StRun;  first_o = en_i;
        ph_d    = PhW'(Early + 1);  win_d = '0;  seen_d = 1'b1;  ended_d = 1'b0;
        pol_d   = p_start_i;  start_d = p_start_i;
        alt_d   = 1'b0;  timing_d = 1'b0;  info_d = 1'b0;  len_d = 1'b0;  dev_d = '0;  dev_late_d = 1'b0;
      end
      // StRun: every pulse is judged when it comes, an empty window when it ends
      StRun: begin
        if (ph_q == PhW'(Half - 1)) begin ph_d = '0; win_d = win_q + 1'b1; end
        else ph_d = ph_q + 1'b1;
        if (pulse && ended_q) len_d = 1'b1;
        if (pulse && !ended_q) begin
          pol_d = p_start_i;
          if (p_start_i == pol_q) alt_d = 1'b1;
          if (!in_win || !in_telegram || seen_q || (n_start_i && p_start_i)) timing_d = 1'b1;
          if (in_win && !win_q[0]) bits_d = {bits_q[Bits-3:0], p_start_i};
          if (in_win && win_q == WinW'(EndWin)) ended_d = 1'b1;
          if (off > dev_q) begin dev_d = off;  dev_late_d = late; end
        end
        seen_d = (seen_q || pulse) && !win_end;
        if (win_end && !win_q[0] && in_telegram && !seen_q && !pulse) info_d = 1'b1;
        if (win_end && win_q == WinW'(LenWin)) begin done_o = en_i; state_d = StWait; end
      end
      default: state_d = StWait;
    endcase
    if (!en_i) begin state_d = StWait; bits_d = '0; end
  end

  // the order of these lines is the reporting order; the pulse of this very clock counts (windows are inclusive)
  always_comb begin
    if      (start_q)            class_o = ErrStart;
    else if (alt_d)              class_o = ErrAlternation;
    else if (timing_d)           class_o = ErrTiming;
    else if (info_q)             class_o = ErrNoInformation;
    else if (!bits_q[0])         class_o = ErrEndBit;
    else if (^bits_q[Bits-2:1])  class_o = ErrParity;
    else if (len_d)              class_o = ErrLength;
    else                         class_o = ErrOk;
  end

  always_ff @(posedge clk_i) begin
    state_q  <= rst_i ? StWait : state_d;
    bits_q   <= rst_i ? '0     : bits_d;
    // set by the first pulse, so they need no reset
    ph_q     <= ph_d;      win_q   <= win_d;    pol_q  <= pol_d;   seen_q <= seen_d;  ended_q <= ended_d;
    start_q  <= start_d;   alt_q   <= alt_d;
    timing_q <= timing_d;  info_q  <= info_d;   len_q  <= len_d;
    dev_q    <= dev_d;     dev_late_q <= dev_late_d;
  end

`ifndef SYNTHESIS
  initial begin
    Windows_A: assert (Width < Half - 1);             // a dead zone remains
    Quiet_A:   assert (RxQuietNs % HalfBitNs == 0 && (RxQuietNs / HalfBitNs) % 2 == 0);
  end
  always_ff @(posedge clk_i) if (!rst_i) begin
    Listening_A: assert (en_i || !(first_o || done_o));
    Decision_A:  assert (!(first_o && done_o));
    EndSeen_A:   assert (!done_o || class_o != ErrOk || ended_q);
    Ok_C:        cover (done_o && class_o == ErrOk);
    Bad_C:       cover (done_o && class_o != ErrOk);
    Dropped_C:   cover (!en_i && state_q == StRun);
  end
`endif
endmodule
