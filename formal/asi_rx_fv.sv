// SPDX-License-Identifier: Apache-2.0
// Proof of asi_rx against asi_rx_spec, unbounded, at the real times: for every train of strobes and any en_i both begin
// and decide in the same clocks, with the same class, and with the same data when it is OK.
// RX-001 .. RX-008, RX-010.
module asi_rx_fv import asi_map_pkg::*; (input logic clk_i, rst_i, n_i, p_i, en_i);
`ifdef FV_COVER
  localparam int Half = 4, Early = 1, Late = 1;
`else
  localparam int Half = 24, Early = 7, Late = 12;
`endif
  logic         first, done, s_first, s_done, busy, start, alt, timing, len, ended, last;
  error_class_e cls, s_cls;
  logic [3:0]   data, s_data;
  logic [8:0]   t;
  logic [12:0]  got, pol;
  asi_rx #(
    .ClkHz(8_000_000), .HalfBitNs(Half * 125), .WinEarlyNs(Early * 125), .WinLateNs(Late * 125), .RxQuietNs(Half * 250)
  ) dut (
    .clk_i, .rst_i, .n_start_i(n_i), .p_start_i(p_i), .en_i, .first_o(first), .done_o(done), .class_o(cls),
    .data_o(data)
  );
  asi_rx_spec #(.Half(Half), .Early(Early), .Late(Late)) spec (
    .clk_i, .rst_i, .n_i, .p_i, .en_i, .first_o(s_first), .done_o(s_done), .busy_o(busy), .class_o(s_cls),
    .data_o(s_data), .t_o(t), .got_o(got), .pol_o(pol), .start_o(start), .alt_o(alt), .timing_o(timing), .len_o(len),
    .ended_o(ended), .last_o(last)
  );

  logic       init_q = 1'b1, live_q = 1'b0;
  logic [5:0] bits, mask;   // the pulses of the even windows so far, the latest lowest
  logic       missed;       // an even window has passed without a pulse
  always_comb begin
    bits = '0;  mask = '0;  missed = 1'b0;
    for (int k = 2; k <= 12; k += 2) begin
      if (got[k]) begin bits = {bits[4:0], pol[k]}; mask = {mask[4:0], 1'b1}; end
      else if (int'(t) > Half * k + Late) missed = 1'b1;
    end
  end

  always_ff @(posedge clk_i) begin
    init_q <= 1'b0;
    if (init_q) assume (rst_i);
    live_q <= 1'b1;
    if (live_q && !rst_i) begin
      First_A: assert (first == s_first);
      Done_A:  assert (done == s_done);
      Class_A: assert (!done || cls == s_cls);
      Data_A:  assert (!done || cls != ErrOk || data == s_data);
    end
    if (live_q) begin
      // for the induction: the block's window and phase are the count of the rule, its flags are its tables
      Busy_A:  assert (dut.state_q == busy);
      if (busy) begin
        Time_A:   assert (t >= 9'd1 && int'(t) <= 14 * Half + Late && int'(dut.ph_q) < Half &&
                          int'(t) + Early == int'(dut.win_q) * Half + int'(dut.ph_q));
        Flags_A:  assert (dut.start_q == start && dut.alt_q == alt && dut.timing_q == timing && dut.len_q == len);
        Last_A:   assert (dut.ended_q == ended && (ended || dut.pol_q == last));
        Table_A:  assert (got[0] && (timing || ended == got[12]));
        Future_A: assert ((got >> (dut.win_q + 4'd1)) == '0);
        End_A:    assert (!ended || dut.win_q != 4'd12 || int'(dut.ph_q) > Early + Late || dut.seen_q);
        Over_A:   assert (!ended || dut.win_q >= 4'd12);
        Seen_A:   assert (timing || ended || dut.win_q > 4'd12 ||
                         dut.seen_q == (int'(dut.ph_q) <= Early + Late && got[dut.win_q]));
        Info_A:   assert (timing || dut.info_q == missed);
        Bits_A:   assert (timing || ((dut.bits_q ^ bits) & mask) == '0);
      end
    end
`ifdef FV_COVER
    // a nominal grid, one place beside it and one after the end; each class is reached
    assume (rst_i == init_q && (en_i || (busy && t == 9'd3)) && !(n_i && p_i));
    assume (!(n_i || p_i) || !busy || (t[1:0] == 2'd0 && t <= 9'd52) || t == 9'd6);
`endif
    if (!rst_i) begin
      Good_C:      cover (done && cls == ErrOk && data == 4'd9);
      Start_C:     cover (done && cls == ErrStart);
      Alternate_C: cover (done && cls == ErrAlternation);
      Timing_C:    cover (done && cls == ErrTiming);
      Missing_C:   cover (done && cls == ErrNoInformation);
      EndBit_C:    cover (done && cls == ErrEndBit);
      Parity_C:    cover (done && cls == ErrParity);
      Length_C:    cover (done && cls == ErrLength);
    end
  end
endmodule
