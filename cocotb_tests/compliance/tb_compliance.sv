// SPDX-License-Identifier: Apache-2.0
// tb_compliance: the bench around dut_asi. Clock, echo of the own request, and the handshake turned into toggles, so
// that Python wakes for pulses and results only. A device with another handshake brings its own version of this file.
// One clock is 10 ns of simulated time whatever ClkHz says: the device only knows clocks.
module tb_compliance #(
  parameter int unsigned ClkHz = 16_000_000
);
  timeunit 1ns;
  timeprecision 1ps;

  logic        clk;
  logic        rst = 1'b1, enable = 1'b0;
  // bench: changes go, the rest steady; valid until the device takes it
  logic        go = 1'b0, no_reply = 1'b0;
  logic [10:0] call = '0;
  logic [1:0]  retries = '0;
  // bench: slaves and disturbances; own pulses come from line_echo
  logic        rx_p = 1'b0, rx_n = 1'b0, echo_on = 1'b1;
  logic [5:0]  echo_delay = '0;
  logic        tx_man, tx_en;
  // result: number counts, the others belong to it
  logic [7:0]  res_number;
  logic [3:0]  res_last, res_first, res_data;
  logic [1:0]  res_repeats;
  logic        stalled;         // nothing was sent for StallClocks
  logic [15:0] mutant = '0;     // selects a mutant, 0: none
  localparam int unsigned StallClocks = ClkHz / 1000 * 3;

  logic        go_q, valid_q, ready, valid, echo_p, echo_n, man_q;
  logic [3:0]  last, first, data;
  logic [1:0]  repeats;
  int unsigned quiet_q;

  initial begin
    clk = 1'b0;
    forever #5 clk = ~clk;  // rising edge k at 10 k + 5 ns
  end

  line_echo #(.Width(ClkHz / 1_000_000)) i_echo (
    .clk_i(clk), .rst_i(rst), .on_i(echo_on), .delay_i(echo_delay), .tx_man_i(tx_man), .echo_p_o(echo_p),
    .echo_n_o(echo_n)
  );

  always_ff @(posedge clk) begin
    go_q    <= go;
    valid_q <= !rst && ((go != go_q) || (valid_q && !ready));
    if (rst) res_number <= '0;
    else if (valid) begin
      res_number  <= res_number + 1'b1;
      res_last    <= last;
      res_first   <= first;
      res_data    <= data;
      res_repeats <= repeats;
    end
    man_q   <= tx_man;
    quiet_q <= (rst || man_q != tx_man || stalled) ? 0 : quiet_q + 1;
    stalled <= !rst && quiet_q == StallClocks;
  end

`ifdef NETLIST
  dut_asi u_dut (
`else
  dut_asi #(.ClkHz(ClkHz)) u_dut (
`endif
`ifdef MUTANTS
    .mutant,
`endif
    .clk_i(clk), .rst_i(rst), .enable_i(enable), .req_valid_i(valid_q), .req_ready_o(ready), .req_call_i(call),
    .req_retries_i(retries), .req_no_reply_i(no_reply), .res_valid_o(valid), .res_last_o(last), .res_first_o(first),
    .res_data_o(data), .res_repeats_o(repeats), .rx_p_i(rx_p || echo_p), .rx_n_i(rx_n || echo_n), .tx_man_o(tx_man),
    .tx_en_o(tx_en)
  );
endmodule
