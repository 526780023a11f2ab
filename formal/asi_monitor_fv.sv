// SPDX-License-Identifier: Apache-2.0
// Proof of the ring of asi_monitor (ST-008), unbounded, for any pulses, any decisions of the receivers, any enable_i and
// clear_i, and a reader that takes records in order, some or none at a time: an unread record is never written; a
// record is complete, its time that of its own first pulse, when head passes it; every telegram is recorded or
// counted as lost, and a record is marked exactly when telegrams were lost right before it.
module asi_monitor_fv #(
`ifdef FV_COVER
  parameter int unsigned RingW = 2
`else
  parameter int unsigned RingW = 3
`endif
) (
  input logic             clk_i, rst_i, n_i, p_i, enable_i, clear_i,
  input logic [RingW-1:0] tail_i
);
  logic [RingW-1:0] head;
  logic [15:0]      lost;
  logic             req, we;
  logic [RingW:0]   addr;
  logic [31:0]      wdata;
`ifdef FV_COVER
  asi_monitor #(.ClkHz(8_000_000), .PauseNs(375), .BadPauseNs(500), .RxOpenNs(500), .RxTimeoutNs(750), .HalfBitNs(125),
                .WinEarlyNs(0), .WinLateNs(0), .RingW(RingW)) dut (
`else
  asi_monitor #(.ClkHz(8_000_000), .RingW(RingW)) dut (
`endif
    .clk_i, .rst_i, .n_start_i(n_i), .p_start_i(p_i), .enable_i, .clear_i, .tail_i, .head_o(head), .lost_o(lost),
    .mem_req_o(req), .mem_we_o(we), .mem_addr_o(addr), .mem_wdata_o(wdata)
  );

  logic             init_q = 1'b1, live_q = 1'b0;
  logic [RingW-1:0] tail_q, head_q, unread, slot;
  logic             clear_q, timed_q, dropped_q, rst_q;
  logic [RingW-1:0] timed_at_q;     // the slot that has the time of the telegram on the line
  logic [15:0]      drops_q;
  assign unread = head - tail_i;
  assign slot   = addr[RingW:1];

  always_ff @(posedge clk_i) begin
    init_q <= 1'b0;
    live_q <= 1'b1;
    if (init_q) assume (rst_i);
    tail_q  <= rst_i ? '0 : tail_i;
    head_q  <= head;
    clear_q <= clear_i;
    rst_q   <= rst_i;
    // the reader: never beyond what is there; with a clear it may set any tail
    if (rst_i || rst_q) assume (tail_i == '0);
    else assume (clear_i || (tail_i - tail_q) <= RingW'(head - tail_q));
    // the telegram on the line: where its time was written
    if (rst_i || clear_i || !enable_i || dut.record) timed_q <= 1'b0;
    if (!rst_i && req && !addr[0] && enable_i && !clear_i) begin timed_q <= 1'b1; timed_at_q <= slot; end
    // telegrams that ended without a record
    if (rst_i || clear_i) {drops_q, dropped_q} <= '0;
    else if (dut.record) begin
      dropped_q <= !req;
      if (!req && drops_q != '1) drops_q <= drops_q + 1'b1;
    end
    if (live_q && !rst_i && !rst_q) begin
      Unread_A: assert (!req || clear_i || RingW'(slot - tail_i) >= unread);
      Head_A:   assert (head == head_q || clear_q || RingW'(head - head_q) == RingW'(1));
      Room_A:   assert (clear_i || !(dut.record && req) || RingW'(head + 1'b1) != tail_i);
      Full_A:   assert (!dut.record || req || RingW'(head + 1'b1) == tail_i);
      Whole_A:  assert (!(dut.record && req) || (addr[0] && timed_q && timed_at_q == slot && slot == head));
      Mark_A:   assert (!(dut.record && req) || wdata[asi_map_pkg::RecordLostLsb] == dropped_q);
      Lost_A:   assert (lost == drops_q);
      Write_A:  assert (we);
      Empty_A:  assert (!clear_q || (head == tail_q && lost == '0 && !dut.mark_q));
      // for the induction
      Timed_A:  assert ((dut.state_q == 2'd2 || dut.state_q == 2'd3) == timed_q && (!timed_q || timed_at_q == head));
      Dropped_A: assert (dut.mark_q == dropped_q);
    end
    Wrap_C:    cover (live_q && !rst_i && head == '0 && head_q == '1 && !clear_q && unread != '0);
    Two_C:     cover (live_q && !rst_i && lost == 16'd2 && unread == '1);
    Marked_C:  cover (live_q && !rst_i && dut.record && req && dropped_q && lost == 16'd1);
  end
endmodule
