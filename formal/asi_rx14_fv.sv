// SPDX-License-Identifier: Apache-2.0
// asi_rx_fv for requests: the read-back receiver of asi_xact, one of the two of asi_monitor.
module asi_rx14_fv (input logic clk_i, rst_i, n_i, p_i, en_i);
  asi_rx_fv #(.Bits(14)) i_fv (.clk_i, .rst_i, .n_i, .p_i, .en_i);
endmodule
