// SPDX-License-Identifier: Apache-2.0
// line_layer: transmitter, receiver with read-back, sequencer and counters as one top, to count their cells. Memories
// are outside. Not part of the chip; the same connections as in rtl/asi_master.sv.
module line_layer
  import asi_map_pkg::*;
(
  input  logic        clk_i, rst_i, enable_i, cycle_en_i, two_extra_i, out_hold_i, read_id_i, tick_us_i,
  input  logic        batch_start_i,
  input  logic [12:0] min_cycle_us_i,
  input  logic [6:0]  batch_len_i,
  input  logic        rx_p_i, rx_n_i, apf_ni, efault_i,
  output logic        tx_man_o, tx_en_o, rx_vth_clear_o, jabber_o, apf_o, efault_o,
  output logic [7:0]  tx_dac_o,
  output logic        mem_req_o, mem_we_o, stat_req_o, stat_we_o,
  output logic [7:0]  mem_addr_o,
  output logic [9:0]  stat_addr_o,
  output logic [31:0] mem_wdata_o, stat_wdata_o,
  input  logic [31:0] mem_rdata_i, stat_rdata_i,
  output logic        batch_busy_o, cycle_busy_o, batch_done_o, cycle_done_o, exchange_done_o, slave_lost_o, sync_o,
  output logic [2:0]  slot_phase_o
);
  logic         req_valid, req_ready, req_no_reply, req_sel, res_valid, sent, is_repeat, man, man_en, pulse_n, pulse_p;
  logic [10:0]  req_call;
  logic [1:0]   req_retries, res_repeats;
  logic [3:0]   res_data;
  error_class_e res_last, res_first, att_class;
  logic         att_valid, att_repeat, att_final, att_dev_late;
  logic [5:0]   att_index;
  logic [15:0]  att_delay;
  logic [7:0]   att_dev;

  asi_seq u_seq (
    .clk_i, .rst_i, .mem_req_o, .mem_we_o, .mem_addr_o, .mem_wdata_o, .mem_rdata_i,
    .req_valid_o(req_valid), .req_ready_i(req_ready), .req_call_o(req_call), .req_retries_o(req_retries),
    .req_no_reply_o(req_no_reply), .req_sel_o(req_sel), .res_valid_i(res_valid), .res_last_i(res_last),
    .res_first_i(res_first), .res_data_i(res_data), .res_repeats_i(res_repeats), .sent_i(sent), .repeat_i(is_repeat),
    .enable_i, .cycle_en_i, .two_extra_i, .out_hold_i, .read_id_i, .min_cycle_us_i, .tick_us_i, .batch_start_i,
    .batch_len_i, .batch_busy_o, .cycle_busy_o, .batch_done_o, .cycle_done_o, .slave_lost_o, .exchange_done_o,
    .slot_phase_o, .sync_o
  );
  asi_xact u_xact (
    .clk_i, .rst_i, .enable_i, .req_valid_i(req_valid), .req_ready_o(req_ready), .req_call_i(req_call),
    .req_sel_i(req_sel), .req_retries_i(req_retries), .req_no_reply_i(req_no_reply), .res_valid_o(res_valid),
    .res_last_o(res_last), .res_first_o(res_first), .res_data_o(res_data), .res_repeats_o(res_repeats),
    .sent_o(sent), .repeat_o(is_repeat), .att_valid_o(att_valid), .att_index_o(att_index), .att_class_o(att_class),
    .att_repeat_o(att_repeat), .att_final_o(att_final), .att_delay_o(att_delay), .att_dev_o(att_dev),
    .att_dev_late_o(att_dev_late), .pulse_n_o(pulse_n), .pulse_p_o(pulse_p), .rx_p_i, .rx_n_i,
    .tx_man_o(man), .tx_en_o(man_en)
  );
  asi_stats u_stats (
    .clk_i, .rst_i, .att_valid_i(att_valid), .att_index_i(att_index), .att_class_i(att_class),
    .att_repeat_i(att_repeat), .att_final_i(att_final), .att_delay_i(att_delay), .att_dev_i(att_dev),
    .att_dev_late_i(att_dev_late), .mem_req_o(stat_req_o), .mem_we_o(stat_we_o), .mem_addr_o(stat_addr_o),
    .mem_wdata_o(stat_wdata_o), .mem_rdata_i(stat_rdata_i)
  );
  asi_tx_guard u_tx_guard (
    .clk_i, .rst_i, .man_i(man), .en_i(man_en), .tx_man_o, .tx_en_o, .jabber_o
  );
  asi_tx_shape u_tx_shape (.clk_i, .rst_i, .man_i(tx_man_o), .en_i(tx_en_o), .dac_o(tx_dac_o));
  asi_vth u_vth (.clk_i, .rst_i, .n_start_i(pulse_n), .p_start_i(pulse_p), .rx_vth_clear_o);
  asi_line_guard u_guard (.clk_i, .rst_i, .tick_i(tick_us_i), .apf_ni, .efault_i, .apf_o, .efault_o);
endmodule
