// SPDX-License-Identifier: Apache-2.0
// top: asi_master as a part of its own, for size and speed runs. The host port goes through serial_host (see there).
// Reset lasts 255 clocks after configuration, until block memories are readable.
module top #(
  parameter int unsigned ClkHz         = 16_000_000,
  parameter bit          BootFromFlash = 1'b0,
  parameter              FirmwareHex   = "",
  parameter              BootRomHex    = ""
) (
  input  logic       clk_i, rst_ni,
  input  logic       rx_p_i, rx_n_i,
  output logic       tx_man_o, tx_en_o,
  output logic [7:0] tx_dac_o,
  output logic       rx_vth_clear_o,
  input  logic       apf_ni, efault_i,
  output logic       spi_sck_o, spi_cs_no, spi_mosi_o,
  input  logic       spi_miso_i,
  input  logic       host_frame_i, host_data_i,
  output logic       host_data_o, host_busy_o, host_irq_o,
  output logic       sync_o, core_wait_o,
  output logic [2:0] phase_o
);
  logic [7:0] por_q;
  logic [1:0] rst_sync_q;
  logic       rst;
  initial por_q = '0;                         // FPGA flip-flops start at 0
  always_ff @(posedge clk_i) begin
    rst_sync_q <= {rst_sync_q[0], rst_ni};
    if (!rst_sync_q[1])  por_q <= '0;
    else if (!(&por_q))  por_q <= por_q + 1'b1;
    rst <= ~&por_q;
  end

  logic        host_req, host_we, host_ready;
  logic [13:2] host_addr;
  logic [3:0]  host_be;
  logic [31:0] host_wdata, host_rdata;
  serial_host u_host (
    .clk_i, .rst_i(rst), .frame_i(host_frame_i), .data_i(host_data_i), .data_o(host_data_o), .busy_o(host_busy_o),
    .host_req_o(host_req), .host_we_o(host_we), .host_addr_o(host_addr), .host_be_o(host_be),
    .host_wdata_o(host_wdata), .host_rdata_i(host_rdata), .host_ready_i(host_ready)
  );
  asi_master #(
    .ClkHz(ClkHz), .BootFromFlash(BootFromFlash), .FirmwareHex(FirmwareHex), .BootRomHex(BootRomHex)
  ) u_master (
    .clk_i, .rst_i(rst), .rx_p_i, .rx_n_i, .tx_man_o, .tx_en_o, .tx_dac_o, .rx_vth_clear_o, .apf_ni, .efault_i,
    .spi_sck_o, .spi_cs_no, .spi_mosi_o, .spi_miso_i,
    .host_req_i(host_req), .host_we_i(host_we), .host_addr_i(host_addr), .host_be_i(host_be),
    .host_wdata_i(host_wdata), .host_rdata_o(host_rdata), .host_ready_o(host_ready), .host_irq_o,
    .sync_o, .phase_o, .core_wait_o
  );
endmodule
