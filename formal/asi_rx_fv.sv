// SPDX-License-Identifier: Apache-2.0
// Proof of asi_rx against asi_rx_spec, unbounded, at the real times: for every train of strobes and any en_i both begin
// and decide in the same clocks, with the same class and deviation, and with the same data when it is OK.
// RX-001 .. RX-008, RX-010, RX-015. Bits = 14 (asi_rx14_fv): the receiver of requests.
module asi_rx_fv import asi_map_pkg::*; #(parameter int Bits = 7) (input logic clk_i, rst_i, n_i, p_i, en_i);
  localparam int End = 2 * (Bits - 1), TimeW = Bits > 7 ? 10 : 9;
`ifdef FV_COVER
  localparam int Half = 4, Early = 1, Late = 1;
`else
  localparam int Half = 24, Early = 7, Late = 12;
`endif
  logic         first, done, s_first, s_done, busy, start, alt, timing, len, ended, last;
  error_class_e cls, s_cls;
  logic [Bits-4:0] data, s_data;
  logic [7:0]   dev, s_dev, held;
  logic         late, s_late, held_late;
  logic [TimeW-1:0] t;
  logic [End:0] got, pol;
  asi_rx #(
    .ClkHz(8_000_000), .Bits(Bits), .HalfBitNs(Half * 125), .WinEarlyNs(Early * 125), .WinLateNs(Late * 125),
    .RxQuietNs(Half * 250)
  ) dut (
    .clk_i, .rst_i, .n_start_i(n_i), .p_start_i(p_i), .en_i, .first_o(first), .done_o(done), .class_o(cls),
    .data_o(data), .dev_o(dev), .dev_late_o(late)
  );
  asi_rx_spec #(.Half(Half), .Early(Early), .Late(Late), .Bits(Bits), .TimeW(TimeW)) spec (
    .clk_i, .rst_i, .n_i, .p_i, .en_i, .first_o(s_first), .done_o(s_done), .busy_o(busy), .class_o(s_cls),
    .data_o(s_data), .t_o(t), .got_o(got), .pol_o(pol), .start_o(start), .alt_o(alt), .timing_o(timing), .len_o(len),
    .ended_o(ended), .last_o(last), .dev_o(s_dev), .dev_held_o(held), .dev_late_o(s_late), .dev_late_held_o(held_late)
  );

  logic       init_q = 1'b1, live_q = 1'b0;
  logic [Bits-2:0] bits, mask;  // the pulses of the even windows so far, the latest lowest
  logic       missed;       // an even window has passed without a pulse
  always_comb begin
    bits = '0;  mask = '0;  missed = 1'b0;
    for (int k = 2; k <= End; k += 2) begin
      if (got[k]) begin bits = {bits[Bits-3:0], pol[k]}; mask = {mask[Bits-3:0], 1'b1}; end
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
      Dev_A:   assert (!done || (dev == s_dev && late == s_late));
    end
    if (live_q) begin
      // for the induction: the block's window and phase are the count of the rule, its flags are its tables
      Busy_A:  assert (dut.state_q == busy);
      if (busy) begin
        Time_A:   assert (t >= TimeW'(1) && int'(t) <= (End + 2) * Half + Late && int'(dut.ph_q) < Half &&
                          int'(t) + Early == int'(dut.win_q) * Half + int'(dut.ph_q));
        Flags_A:  assert (dut.start_q == start && dut.alt_q == alt && dut.timing_q == timing && dut.len_q == len);
        Held_A:   assert (8'(dut.dev_q) == held && dut.dev_late_q == held_late);
        Last_A:   assert (dut.ended_q == ended && (ended || dut.pol_q == last));
        Table_A:  assert (got[0] && (timing || ended == got[End]));
        Future_A: assert ((got >> (int'(dut.win_q) + 1)) == '0);
        End_A:    assert (!ended || int'(dut.win_q) != End || int'(dut.ph_q) > Early + Late || dut.seen_q);
        Over_A:   assert (!ended || int'(dut.win_q) >= End);
        Seen_A:   assert (timing || ended || int'(dut.win_q) > End ||
                         dut.seen_q == (int'(dut.ph_q) <= Early + Late && got[dut.win_q]));
        Info_A:   assert (timing || dut.info_q == missed);
        Bits_A:   assert (timing || ((dut.bits_q ^ bits) & mask) == '0);
      end
    end
`ifdef FV_COVER
    // a nominal grid, one place beside it and one after the end; each class is reached
    assume (rst_i == init_q && (en_i || (busy && t == TimeW'(3))) && !(n_i && p_i));
    assume (!(n_i || p_i) || !busy || (t[1:0] == 2'd0 && int'(t) <= (End + 1) * Half) || t == TimeW'(6) ||
            t == TimeW'(7));
`endif
    if (!rst_i) begin
      Good_C:      cover (done && cls == ErrOk && data[3:0] == 4'd9 && dev == '0);
      DevEarly_C:  cover (done && cls == ErrOk && dev == 8'd1 && !late);
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
