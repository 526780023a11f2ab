// SPDX-License-Identifier: Apache-2.0
// tb_asi_master: asi_master with a clock made here, so cocotb wakes up for line and host only.
// The pins are the signals of the bench, named as those of the chip; public.vlt makes them (and only them) visible.
module tb_asi_master #(
  parameter int unsigned ClkHz = 16_000_000
);
  timeunit 1ns;
  timeprecision 1ps;
  localparam realtime HalfPeriod = 0.5e9 / ClkHz;

  logic        clk_i, rst_i = 1'b1;
  logic        rx_p_i = 1'b0, rx_n_i = 1'b0, apf_ni = 1'b1, efault_i = 1'b0, spi_miso_i = 1'b0;
  logic        host_req_i = 1'b0, host_we_i = 1'b0;
  logic [13:2] host_addr_i = '0;
  logic [3:0]  host_be_i = '0;
  logic [31:0] host_wdata_i = '0, host_rdata_o;
  logic        tx_man_o, tx_en_o, spi_sck_o, spi_cs_no, spi_mosi_o, host_ready_o, host_irq_o, sync_o, core_wait_o;
  logic [7:0]  tx_dac_o;
  logic        rx_vth_clear_o;
  logic [2:0]  phase_o;

  initial begin
    clk_i = 1'b0;
    forever #(HalfPeriod) clk_i = ~clk_i;
  end

  asi_master #(.ClkHz(ClkHz)) u_chip (.*);
endmodule
