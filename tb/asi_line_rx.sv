// SPDX-License-Identifier: Apache-2.0
// asi_line_rx: the receivers of the chip behind comparator levels, as the analog line model drives them: one
// synchroniser and filter, and behind it the receiver of answers (7 bits) and that of requests (14 bits).
module asi_line_rx
  import asi_map_pkg::*;
#(
  parameter int unsigned ClkHz = 16_000_000
) (
  input  logic         clk_i, rst_i,
  input  logic         rx_n_i, rx_p_i, en_i,
  output logic         n_start_o, p_start_o,                   // filtered pulses
  output logic         ans_first_o, ans_done_o, req_first_o, req_done_o,
  output error_class_e ans_class_o, req_class_o,
  output logic [3:0]   ans_data_o,
  output logic [10:0]  req_data_o
);
  logic n_sync, p_sync;
  asi_sync #(.Width(2)) u_sync (.clk_i, .rst_i, .async_i({rx_n_i, rx_p_i}), .sync_o({n_sync, p_sync}));
  asi_pulse_filter #(.ClkHz(ClkHz)) u_filter_n (.clk_i, .rst_i, .pulse_i(n_sync), .start_o(n_start_o));
  asi_pulse_filter #(.ClkHz(ClkHz)) u_filter_p (.clk_i, .rst_i, .pulse_i(p_sync), .start_o(p_start_o));
  asi_rx #(.ClkHz(ClkHz), .Bits(7)) u_answer (
    .clk_i, .rst_i, .n_start_i(n_start_o), .p_start_i(p_start_o), .en_i,
    .first_o(ans_first_o), .done_o(ans_done_o), .class_o(ans_class_o), .data_o(ans_data_o)
  );
  asi_rx #(.ClkHz(ClkHz), .Bits(14)) u_request (
    .clk_i, .rst_i, .n_start_i(n_start_o), .p_start_i(p_start_o), .en_i,
    .first_o(req_first_o), .done_o(req_done_o), .class_o(req_class_o), .data_o(req_data_o)
  );
endmodule
