// SPDX-License-Identifier: Apache-2.0
// asi_rx_spec: the receiver rules RX-001 .. RX-008, RX-010, RX-015, written from the text and without regard to size: a
// table of what came in each window, one clock count from the first pulse, all verdicts at the decision.
// Read into the rules: a negative and a positive strobe in one clock are two pulses in one place, the positive one
// last; the end pulse is the first pulse of window 12, and only what follows it is a matter of length.
module asi_rx_spec import asi_map_pkg::*; #(
  parameter int Half = 24, Early = 7, Late = 12,            // 3 us, 0.875 us, 1.5 us at 8 MHz, counted by hand
  parameter int Bits = 7, End = 2 * (Bits - 1), TimeW = 9   // End: window of the end pulse
) (
  input  logic         clk_i, rst_i, n_i, p_i, en_i,
  output logic         first_o, done_o, busy_o,
  output error_class_e class_o,
  output logic [Bits-4:0] data_o,
  output logic [7:0]   dev_o, dev_held_o,                   // largest deviation, this clock's pulse included; up to now
  output logic         dev_late_o, dev_late_held_o,
  output logic [TimeW-1:0] t_o,                             // clocks since the first pulse
  output logic [End:0] got_o, pol_o,                        // per window: a pulse came; it was positive
  output logic         start_o, alt_o, timing_o, len_o, ended_o, last_o  // rules broken; last pulse's polarity
);
  localparam int Decision = (End + 2) * Half + Late;        // 43.5 us for an answer

  logic         pulse, placed, again, alt, timing, len, no_info, parity;
  logic [End:0] here, got, pol;                             // window of this clock; tables with this clock's pulse
  int           from_past, to_next;                         // grid points around this clock
  always_comb begin
    pulse  = n_i || p_i;
    here   = '0;
    for (int k = 1; k <= End; k++) here[k] = int'(t_o) >= k * Half - Early && int'(t_o) <= k * Half + Late;
    placed = here != '0;
    again  = (here & got_o) != '0;
    from_past = '0;
    for (int k = 0; k <= End + 2; k++) if (int'(t_o) >= k * Half) from_past = int'(t_o) - k * Half;
    to_next = Half - from_past;
    {dev_o, dev_late_o} = {dev_held_o, dev_late_held_o};
    if (pulse && !ended_o) begin                            // RX-015: the nearer grid point, the past one of two
      if (from_past <= to_next) begin
        if (from_past > int'(dev_held_o)) begin dev_o = 8'(from_past); dev_late_o = 1'b1; end
      end else if (to_next > int'(dev_held_o)) begin dev_o = 8'(to_next); dev_late_o = 1'b0; end
    end
    got    = got_o;  pol = pol_o;  alt = alt_o;  timing = timing_o;  len = len_o;
    if (pulse && ended_o) len = 1'b1;
    else if (pulse) begin
      got = got_o | here;
      pol = p_i ? pol_o | here : pol_o & ~here;
      if (p_i == last_o)                   alt = 1'b1;      // RX-002
      if (!placed || again || (n_i && p_i)) timing = 1'b1;  // RX-003
    end
    no_info = 1'b0;
    parity  = 1'b0;
    for (int k = 2; k <= End; k += 2) if (!got[k]) no_info = 1'b1;                   // RX-004
    for (int k = 2; k < End; k += 2) parity ^= pol[k];
    for (int k = 2; k < End - 2; k += 2) data_o[Bits - 3 - k / 2] = pol[k];
    if      (start_o)                                        class_o = ErrStart;     // RX-001; the order: RX-008
    else if (alt)                                            class_o = ErrAlternation;
    else if (timing)                                         class_o = ErrTiming;
    else if (no_info)                                        class_o = ErrNoInformation;
    else if (!pol[End])                                      class_o = ErrEndBit;    // RX-006
    else if (parity)                                         class_o = ErrParity;    // RX-005
    else if (len)                                            class_o = ErrLength;    // RX-007
    else                                                     class_o = ErrOk;
    first_o = !busy_o && pulse && en_i;
    done_o  = busy_o && en_i && t_o == TimeW'(Decision);
  end

  always_ff @(posedge clk_i) begin
    t_o <= t_o + 1'b1;
    {got_o, pol_o, alt_o, timing_o, len_o} <= {got, pol, alt, timing, len};
    {dev_held_o, dev_late_held_o} <= {dev_o, dev_late_o};
    if (pulse && !ended_o) last_o <= p_i;
    if (pulse && here[End]) ended_o <= 1'b1;
    if (first_o) begin                                      // RX-010: the only time base
      busy_o <= 1'b1;  t_o <= TimeW'(1);  got_o <= (End+1)'(1);  pol_o <= '0;  last_o <= p_i;  start_o <= p_i;
      {alt_o, timing_o, len_o, ended_o, dev_held_o, dev_late_held_o} <= '0;
    end
    if (rst_i || !en_i || done_o) busy_o <= 1'b0;
  end
endmodule
