// SPDX-License-Identifier: Apache-2.0
// asi_seq_tb: asi_seq with a link RAM that a core can write at the same time, and a stand-in for asi_xact.
// The stand-in accepts when its gap is over, waits rsp_clocks_i per attempt and gives the answer that Python chose
// when it saw acc_count_o change. It measures how late an offer came (late_o, clocks after the end of the gap).
module asi_seq_tb
  import asi_map_pkg::*;
#(
  parameter int unsigned DexgRetry = 1, FailCycles = 3, ClkMhz = 8
) (
  input  logic        clk_i, rst_i, enable_i, cycle_en_i, two_extra_i, out_hold_i, read_id_i,
  input  logic        batch_start_i,
  input  logic [12:0] min_cycle_us_i,
  input  logic [6:0]  batch_len_i,
  // answer to the open call: classes, data, repetitions made; clocks per attempt; gap after the result, in clocks
  input  logic [3:0]  rsp_last_i, rsp_first_i, rsp_data_i,
  input  logic [1:0]  rsp_repeats_i,
  input  logic [15:0] rsp_clocks_i, gap_clocks_i, again_clocks_i,
  // the result as the sequencer got it; res_count_o changes with each
  output logic [3:0]  res_last_o, res_first_o,
  output logic [1:0]  res_repeats_o,
  // the last accepted request; acc_count_o changes with each
  output logic [15:0] acc_count_o,
  output logic [10:0] call_o,
  output logic [1:0]  retries_o,
  output logic        no_reply_o,
  output logic [31:0] acc_time_o, late_o, time_o,
  output logic [2:0]  phase_o,
  output logic        req_valid_o,
  // events, counted
  output logic [15:0] cycle_count_o, batch_count_o, lost_count_o, sync_count_o, res_count_o, begun_count_o,
  output logic [15:0] exchange_count_o,
  output logic [31:0] sync_time_o, offer_max_o,
  output logic        batch_busy_o, cycle_busy_o,
  // core
  input  logic        core_req_i,
  input  logic [7:0]  core_addr_i,
  input  logic [31:0] core_wdata_i,
  output logic        core_ack_o  // the write is done at the end of this clock
);
  logic        mem_req, mem_we, req_valid, req_ready, res_valid, sent, again, batch_done, cycle_done, slave_lost, sync;
  logic        exchange_done;
  logic [7:0]  mem_addr;
  logic [31:0] mem_wdata, mem_rdata;
  logic [10:0] req_call;
  logic [1:0]  req_retries, attempt;
  logic        req_no_reply, tick, unused_sel;  // req_sel_o: watched by asi_seq_rules_tb
  logic [2:0]  slot_phase;
  logic [3:0]  res_last, res_first;

  asi_seq #(.DexgRetry(DexgRetry), .FailCycles(FailCycles)) u_dut (
    .clk_i, .rst_i, .mem_req_o(mem_req), .mem_we_o(mem_we), .mem_addr_o(mem_addr), .mem_wdata_o(mem_wdata),
    .mem_rdata_i(mem_rdata), .req_valid_o(req_valid), .req_ready_i(req_ready), .req_call_o(req_call),
    .req_retries_o(req_retries), .req_no_reply_o(req_no_reply), .req_sel_o(unused_sel), .res_valid_i(res_valid),
    .res_last_i(res_last), .res_first_i(res_first), .res_data_i(rsp_data_i), .res_repeats_i(attempt), .sent_i(sent),
    .repeat_i(again),
    .enable_i, .cycle_en_i, .two_extra_i, .out_hold_i, .read_id_i, .min_cycle_us_i, .tick_us_i(tick), .batch_start_i,
    .batch_len_i, .batch_busy_o, .cycle_busy_o, .batch_done_o(batch_done), .cycle_done_o(cycle_done),
    .slave_lost_o(slave_lost), .exchange_done_o(exchange_done), .slot_phase_o(slot_phase), .sync_o(sync)
  );

  // link RAM; the sequencer wins
  logic [31:0] ram [256];
  assign core_ack_o = core_req_i && !mem_req;
  always_ff @(posedge clk_i) begin
    if (mem_req && mem_we) ram[mem_addr] <= mem_wdata;
    if (core_ack_o)        ram[core_addr_i] <= core_wdata_i;
    mem_rdata <= mem_req && !mem_we ? ram[mem_addr] : 32'hDEAD_BEEF;  // stale read data never helps
  end

  // stand-in for asi_xact
  logic        busy, abort;
  logic [15:0] left, gap;
  logic [31:0] late, since;
  assign req_ready = !busy && gap == '0 && enable_i;
  assign req_valid_o = req_valid;
  assign abort     = busy && !enable_i;
  assign res_valid = abort || (busy && left == '0 && attempt == rsp_repeats_i);
  assign res_last  = abort ? ErrAborted : rsp_last_i;
  assign res_first = abort && attempt == '0 ? ErrAborted : rsp_first_i;
  always_ff @(posedge clk_i)
    if (rst_i) begin
      {busy, sent, again, attempt, left, gap, late, since} <= '0;
      {acc_count_o, cycle_count_o, batch_count_o, lost_count_o, sync_count_o, res_count_o, begun_count_o} <= '0;
      exchange_count_o <= '0;
      time_o <= '0;
      tick <= 1'b0;
    end else begin
      time_o <= time_o + 32'd1;
      tick   <= time_o % ClkMhz == 0;
      sent   <= 1'b0;
      again  <= 1'b0;
      if (gap != '0) gap <= gap - 16'd1;
      if (req_ready && !req_valid) late <= late + 32'd1;
      since <= since + 32'd1;
      if (req_ready && req_valid) begin
        busy <= 1'b1;  sent <= 1'b1;  attempt <= '0;  left <= 16'd4;  late <= '0;
        acc_count_o <= acc_count_o + 16'd1;
        {call_o, retries_o, no_reply_o} <= {req_call, req_retries, req_no_reply};
        acc_time_o <= time_o;  late_o <= late;  phase_o <= slot_phase;
      end else if (res_valid) begin
        busy <= 1'b0;  gap <= gap_clocks_i;  res_count_o <= res_count_o + 16'd1;
        {res_last_o, res_first_o, res_repeats_o} <= {res_last, res_first, attempt};  since <= 32'd1;
      end else if (busy && sent && attempt == '0) left <= rsp_clocks_i;  // Python has chosen by now
      else if (busy && left != '0) left <= left - 16'd1;
      else if (busy) begin
        attempt <= attempt + 2'd1;  sent <= 1'b1;  again <= 1'b1;  left <= again_clocks_i;
      end
      begun_count_o <= begun_count_o + 16'(u_dut.begun);
      cycle_count_o <= cycle_count_o + 16'(cycle_done);
      batch_count_o <= batch_count_o + 16'(batch_done);
      lost_count_o  <= lost_count_o + 16'(slave_lost);
      sync_count_o  <= sync_count_o + 16'(sync);
      if (sync) sync_time_o <= time_o;
      exchange_count_o <= exchange_count_o + 16'(exchange_done);
    end

  // longest time from a result to the next offer, over calls that directly follow each other
  logic waiting;
  always_ff @(posedge clk_i)
    if (rst_i) begin waiting <= 1'b0; offer_max_o <= '0; end
    else if (res_valid) waiting <= 1'b1;
    else if (!cycle_busy_o && !batch_busy_o) waiting <= 1'b0;
    else if (waiting && req_valid) begin
      waiting <= 1'b0;
      if (since > offer_max_o) offer_max_o <= since;
    end
endmodule
