// SPDX-License-Identifier: Apache-2.0
// asi_monitor_tb: asi_monitor with its ring, and the core's port to it.
module asi_monitor_tb #(
  parameter int unsigned ClkHz = 16_000_000
) (
  input  logic        clk_i, rst_i, n_start_i, p_start_i, enable_i, clear_i,
  input  logic [7:0]  tail_i,
  output logic [7:0]  head_o,
  output logic [15:0] lost_o,
  input  logic        core_req_i, core_we_i,
  input  logic [3:0]  core_be_i,
  input  logic [8:0]  core_addr_i,
  input  logic [31:0] core_wdata_i,
  output logic        core_ready_o,
  output logic [31:0] core_rdata_o
);
  logic        mem_req, mem_we;
  logic [8:0]  mem_addr;
  logic [31:0] mem_wdata;
  asi_monitor #(.ClkHz(ClkHz)) u_dut (
    .clk_i, .rst_i, .n_start_i, .p_start_i, .enable_i, .clear_i, .tail_i, .head_o, .lost_o,
    .mem_req_o(mem_req), .mem_we_o(mem_we), .mem_addr_o(mem_addr), .mem_wdata_o(mem_wdata)
  );
  asi_shared_mem #(.Words(512)) u_mem (
    .clk_i, .rst_i, .core_req_i, .core_we_i, .core_clear_i(1'b0), .core_be_i, .core_addr_i, .core_wdata_i, .core_ready_o,
    .eng_req_i(mem_req), .eng_we_i(mem_we), .eng_addr_i(mem_addr), .eng_wdata_i(mem_wdata), .rdata_o(core_rdata_o)
  );
endmodule
