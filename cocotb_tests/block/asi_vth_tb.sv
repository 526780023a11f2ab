// SPDX-License-Identifier: Apache-2.0
// asi_vth_tb: asi_vth behind synchroniser and filters, as in asi_master, so tests work on the comparator pins.
module asi_vth_tb #(
  parameter int unsigned ClkHz = 16_000_000
) (
  input  logic clk_i, rst_i, rx_p_i, rx_n_i,
  output logic rx_vth_clear_o
);
  logic rx_p, rx_n, p_start, n_start;
  asi_sync #(.Width(2)) i_sync (.clk_i, .rst_i, .async_i({rx_p_i, rx_n_i}), .sync_o({rx_p, rx_n}));
  asi_pulse_filter #(.ClkHz(ClkHz)) i_filter_p (.clk_i, .rst_i, .pulse_i(rx_p), .start_o(p_start));
  asi_pulse_filter #(.ClkHz(ClkHz)) i_filter_n (.clk_i, .rst_i, .pulse_i(rx_n), .start_o(n_start));
  asi_vth #(.ClkHz(ClkHz)) dut (.clk_i, .rst_i, .n_start_i(n_start), .p_start_i(p_start), .rx_vth_clear_o);
endmodule
