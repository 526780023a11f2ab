// SPDX-License-Identifier: Apache-2.0
// dut_asi: the line layer of this project (asi_xact) as a device under test: pins, one request, one result.
// This is what is synthesised for the netlist runs; what belongs to the bench is in tb_compliance.
module dut_asi #(
  parameter int unsigned ClkHz = 16_000_000
) (
  input  logic        clk_i, rst_i, enable_i,
  input  logic        req_valid_i,
  output logic        req_ready_o,
  input  logic [10:0] req_call_i,
  input  logic [1:0]  req_retries_i,
  input  logic        req_no_reply_i,
  output logic        res_valid_o,
  output logic [3:0]  res_last_o, res_first_o,  // codes of error_class_e
  output logic [3:0]  res_data_o,
  output logic [1:0]  res_repeats_o,
  input  logic        rx_p_i, rx_n_i,
  output logic        tx_man_o, tx_en_o
);
  asi_map_pkg::error_class_e last, first;
  assign res_last_o  = last;
  assign res_first_o = first;
  asi_xact #(.ClkHz(ClkHz)) i_xact (
    .clk_i, .rst_i, .enable_i, .req_valid_i, .req_ready_o, .req_call_i, .req_sel_i(1'b0), .req_retries_i,
    .req_no_reply_i, .res_valid_o, .res_last_o(last), .res_first_o(first), .res_data_o, .res_repeats_o, .sent_o(),
    .repeat_o(), .att_valid_o(), .att_index_o(), .att_class_o(), .att_repeat_o(), .att_final_o(), .att_delay_o(),
    .att_dev_o(), .att_dev_late_o(), .pulse_n_o(), .pulse_p_o(), .rx_p_i, .rx_n_i, .tx_man_o, .tx_en_o
  );
endmodule
