// SPDX-License-Identifier: Apache-2.0
// Simulation of the proof harness of asi_seq: random inputs that keep its assumptions, so that its rules are also
// checked over whole cycles from reset, and its covers show that the rules had something to check.
module asi_seq_rules_tb import asi_map_pkg::*; (input logic clk_i, rst_i, input logic [4:0] n_i);
  logic        ready_q, again_q, end_q, enable_q, run_q, two_q, hold_q, rid_q, fail_q, alone_q, start_q, try_q, touch_q;
  logic        slow_q, hurry_q;
  logic [3:0]  class_q;
  logic [2:0]  tick_q;
  logic [5:0]  off_q;
  logic [6:0]  len_q;
  logic [7:0]  addr_q;
  logic [12:0] min_q;
  logic [31:0] data_q, free_q;
  logic        taken, repeating, sent, res, fw;
  assign taken     = fv.req_valid && ready_q;
  assign repeating = again_q && fv.line_q && enable_q && fv.sent_age_q >= 10'd400;
  assign sent      = taken || repeating;
  assign res       = fv.line_q && !sent && (!enable_q || (end_q && fv.sent_age_q >= 10'd400));
  assign fw        = try_q && addr_q != 8'(LinkMgmtRes / 4) &&
                     !(addr_q == 8'(LinkMgmtReq / 4) && fv.mpend && fv.cycle_busy);
  asi_seq_fv fv (
    .clk_i, .rst_i, .n_i, .free_i(free_q), .fw_we_i(fw), .fw_addr_i(addr_q), .fw_data_i(data_q), .ready_i(ready_q),
    .res_valid_i(res), .sent_i(sent), .repeat_i(repeating), .res_last_i(enable_q ? class_q : ErrAborted),
    .res_first_i(class_q), .res_data_i(data_q[3:0]), .res_repeats_i(data_q[5:4]), .enable_i(enable_q),
    .cycle_en_i(run_q && enable_q), .two_extra_i(two_q), .out_hold_i(hold_q), .read_id_i(rid_q),
    .tick_us_i(tick_q == '0), .batch_start_i(start_q), .min_cycle_us_i(min_q), .batch_len_i(len_q)
  );

  function automatic logic one_in(int unsigned n);
    return $urandom_range(n - 1) == 0;
  endfunction
  always_ff @(posedge clk_i) begin
    tick_q  <= rst_i ? '0 : tick_q + 1'b1;
    ready_q <= one_in(slow_q ? 300 : 3);
    again_q <= one_in(8);
    end_q   <= one_in(3);
    start_q <= one_in(200);
    class_q <= fail_q || one_in(6) ? 4'($urandom_range(9)) : ErrOk;
    // a mode for some thousand clocks: how firmware, line and plant behave
    if (rst_i || one_in(6_000)) begin
      run_q   <= !one_in(6);
      hold_q  <= one_in(4);
      fail_q  <= one_in(4);
      alone_q <= !one_in(4);                   // no other slot
      touch_q <= one_in(3);                    // slots are switched on and off
      slow_q  <= one_in(3);                    // the line is slow to take a request
      hurry_q <= one_in(3);                    // one management request after the other
      len_q   <= one_in(2) ? 7'd64 : 7'($urandom_range(64));
      min_q   <= one_in(2) ? 13'($urandom_range(900)) : '0;
    end
    if (rst_i || !fv.cycle_busy) two_q <= one_in(3);
    off_q    <= rst_i ? '0 : one_in(4_000) ? '1 : one_in(2_000) ? 6'd1 : off_q - 6'(off_q != '0 && one_in(16));
    enable_q <= off_q == '0;
    free_q   <= alone_q ? '0 : $urandom;
    // firmware
    try_q  <= one_in(4);
    data_q <= {one_in(2), 7'($urandom), 8'($urandom), 16'($urandom)};
    addr_q <= one_in(hurry_q ? 10 : 200) ? 8'(LinkMgmtReq / 4) : one_in(400) ? 8'(LinkInclReq / 4) : 8'hFF;
    if (rst_i || one_in(2_000)) rid_q <= one_in(4);
    if (one_in(300)) addr_q <= 8'(LinkOutImg / 4) | {5'd0, 1'($urandom), n_i[4:3]};
    if (rst_i || one_in(touch_q ? 2_000 : 20_000)) begin
      addr_q <= {1'b0, 2'($urandom), n_i};
      data_q <= {13'($urandom), 3'($urandom_range(3)), 14'($urandom), one_in(2), !one_in(4)};
      try_q  <= 1'b1;
    end
  end
endmodule
