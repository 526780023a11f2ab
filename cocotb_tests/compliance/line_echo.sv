// SPDX-License-Identifier: Apache-2.0
// line_echo: what the receive comparators of a master show of its own transmission: a falling MAN edge is a negative
// pulse of 1 us, a rising one a positive pulse, delay_i clocks later. It works on falling clock edges, so its outputs
// change in the middle of a clock, as everything the bench drives.
module line_echo #(
  parameter int unsigned Width = 16  // clocks
) (
  input  logic       clk_i, rst_i, on_i,
  input  logic [5:0] delay_i,        // clocks
  input  logic       tx_man_i,
  output logic       echo_p_o, echo_n_o
);
  logic        man_q;
  logic [62:0] fell_q, rose_q;       // edges of the last clocks, the newest in bit 0
  logic [63:0] fell, rose;
  logic [7:0]  left_n_q, left_p_q;   // clocks the pulse still lasts
  assign fell = {fell_q, man_q && !tx_man_i && on_i};
  assign rose = {rose_q, !man_q && tx_man_i && on_i};
  assign echo_n_o = left_n_q != '0;
  assign echo_p_o = left_p_q != '0;
  function automatic logic [7:0] left(logic edge_now, logic [7:0] now);
    return edge_now ? 8'(Width) : (now == '0) ? '0 : now - 1'b1;
  endfunction
  always_ff @(negedge clk_i) begin
    man_q    <= tx_man_i;
    fell_q   <= rst_i ? '0 : fell[62:0];
    rose_q   <= rst_i ? '0 : rose[62:0];
    left_n_q <= rst_i ? '0 : left(fell[delay_i], left_n_q);
    left_p_q <= rst_i ? '0 : left(rose[delay_i], left_p_q);
  end
endmodule
