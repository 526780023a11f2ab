// SPDX-License-Identifier: Apache-2.0
// asi_rx_spec: the receiver rules RX-001 .. RX-008, RX-010, written from the text and without regard to size: a table
// of what came in each window, one clock count from the first pulse, all verdicts at the decision. Answers only.
// Read into the rules: a negative and a positive strobe in one clock are two pulses in one place, the positive one
// last; the end pulse is the first pulse of window 12, and only what follows it is a matter of length.
module asi_rx_spec import asi_map_pkg::*; #(
  parameter int Half = 24, Early = 7, Late = 12             // 3 us, 0.875 us, 1.5 us at 8 MHz, counted by hand
) (
  input  logic         clk_i, rst_i, n_i, p_i, en_i,
  output logic         first_o, done_o, busy_o,
  output error_class_e class_o,
  output logic [3:0]   data_o,
  output logic [8:0]   t_o,                                 // clocks since the first pulse
  output logic [12:0]  got_o, pol_o,                        // per window: a pulse came; it was positive
  output logic         start_o, alt_o, timing_o, len_o, ended_o, last_o  // rules broken; last pulse's polarity
);
  localparam int Decision = 14 * Half + Late;               // 43.5 us

  logic        pulse, placed, again, alt, timing, len, no_info;
  logic [12:0] here, got, pol;                              // window of this clock; tables with this clock's pulse
  always_comb begin
    pulse  = n_i || p_i;
    here   = '0;
    for (int k = 1; k <= 12; k++) here[k] = int'(t_o) >= k * Half - Early && int'(t_o) <= k * Half + Late;
    placed = here != '0;
    again  = (here & got_o) != '0;
    got    = got_o;  pol = pol_o;  alt = alt_o;  timing = timing_o;  len = len_o;
    if (pulse && ended_o) len = 1'b1;
    else if (pulse) begin
      got = got_o | here;
      pol = p_i ? pol_o | here : pol_o & ~here;
      if (p_i == last_o)                   alt = 1'b1;      // RX-002
      if (!placed || again || (n_i && p_i)) timing = 1'b1;  // RX-003
    end
    no_info = 1'b0;
    for (int k = 2; k <= 12; k += 2) if (!got[k]) no_info = 1'b1;                    // RX-004
    if      (start_o)                                        class_o = ErrStart;     // RX-001; the order: RX-008
    else if (alt)                                            class_o = ErrAlternation;
    else if (timing)                                         class_o = ErrTiming;
    else if (no_info)                                        class_o = ErrNoInformation;
    else if (!pol[12])                                       class_o = ErrEndBit;    // RX-006
    else if (pol[2] ^ pol[4] ^ pol[6] ^ pol[8] ^ pol[10])    class_o = ErrParity;    // RX-005
    else if (len)                                            class_o = ErrLength;    // RX-007
    else                                                     class_o = ErrOk;
    data_o  = {pol[2], pol[4], pol[6], pol[8]};
    first_o = !busy_o && pulse && en_i;
    done_o  = busy_o && en_i && t_o == 9'(Decision);
  end

  always_ff @(posedge clk_i) begin
    t_o <= t_o + 1'b1;
    {got_o, pol_o, alt_o, timing_o, len_o} <= {got, pol, alt, timing, len};
    if (pulse && !ended_o) last_o <= p_i;
    if (pulse && here[12]) ended_o <= 1'b1;
    if (first_o) begin                                      // RX-010: the only time base
      busy_o <= 1'b1;  t_o <= 9'd1;  got_o <= 13'd1;  pol_o <= '0;  last_o <= p_i;  start_o <= p_i;
      {alt_o, timing_o, len_o, ended_o} <= '0;
    end
    if (rst_i || !en_i || done_o) busy_o <= 1'b0;
  end
endmodule
