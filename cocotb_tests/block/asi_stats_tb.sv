// SPDX-License-Identifier: Apache-2.0
// asi_stats_tb: asi_stats with its memory, and the core's port to it.
module asi_stats_tb
  import asi_map_pkg::*;
(
  input  logic        clk_i, rst_i, att_valid_i, att_repeat_i, att_final_i, att_dev_late_i,
  input  logic [5:0]  att_index_i,
  input  logic [3:0]  att_class_i,
  input  logic [15:0] att_delay_i,
  input  logic [7:0]  att_dev_i,
  input  logic        core_req_i, core_we_i, core_clear_i,
  input  logic [3:0]  core_be_i,
  input  logic [9:0]  core_addr_i,
  input  logic [31:0] core_wdata_i,
  output logic        core_ready_o,
  output logic [31:0] core_rdata_o,
  output logic        mem_req_o
);
  logic        mem_we;
  logic [9:0]  mem_addr;
  logic [31:0] mem_wdata;
  asi_stats u_dut (
    .clk_i, .rst_i, .att_valid_i, .att_index_i, .att_class_i(error_class_e'(att_class_i)), .att_repeat_i, .att_final_i,
    .att_delay_i, .att_dev_i, .att_dev_late_i, .mem_req_o, .mem_we_o(mem_we), .mem_addr_o(mem_addr),
    .mem_wdata_o(mem_wdata), .mem_rdata_i(core_rdata_o)
  );
  asi_shared_mem #(.Words(1024)) u_mem (
    .clk_i, .rst_i, .core_req_i, .core_we_i, .core_clear_i, .core_be_i, .core_addr_i, .core_wdata_i, .core_ready_o,
    .eng_req_i(mem_req_o), .eng_we_i(mem_we), .eng_addr_i(mem_addr), .eng_wdata_i(mem_wdata), .rdata_o(core_rdata_o)
  );
endmodule
