// SPDX-License-Identifier: Apache-2.0
// Proof of asi_tx_shape (LT-015), unbounded, for any levels on the pins, also those no transmitter makes: the code
// never jumps, rises only with the current or the bias, and ends at rest, bias and full scale. The table itself is
// compared with the formula in simulation.
module asi_tx_shape_fv (input logic clk_i, rst_i, man_i, en_i);
  localparam int unsigned Steps = 24, Bias = 12, Largest = 21;  // at 8 MHz a step is a clock
  logic [7:0] dac;
  asi_tx_shape #(.ClkHz(8_000_000), .TxBias(Bias)) dut (.clk_i, .rst_i, .man_i, .en_i, .dac_o(dac));

  logic       init_q = 1'b1, live_q = 1'b0, rst_q, sink_q, en_q;
  logic [7:0] dac_q;
  logic [5:0] up_q, down_q;      // clocks without a break in which the current shall go up, down
  logic [5:0] on_q, off_q;       // the same for the bias
  function automatic logic [5:0] count(logic zero, logic [5:0] n);
    return zero ? '0 : (n != '1) ? n + 1'b1 : n;
  endfunction
  // moves of the bias in the last n clocks, every other one makes one and the next does if half
  function automatic logic [4:0] moves(logic [5:0] n, logic half);
    return n >= 6'(2 * Bias) ? 5'(Bias) : 5'((n + 6'(!half)) >> 1);
  endfunction
  logic sink;
  assign sink = en_i && !man_i;
  always_ff @(posedge clk_i) begin
    init_q <= 1'b0;
    if (init_q) assume (rst_i);
    live_q <= 1'b1;
    rst_q  <= rst_i;  dac_q <= dac;  sink_q <= sink;  en_q <= en_i;
    up_q   <= count(rst_i || !sink, up_q);
    down_q <= rst_i ? 6'(Steps)    : count(sink, down_q);
    on_q   <= count(rst_i || !en_i, on_q);
    off_q  <= rst_i ? 6'(2 * Bias) : count(en_i, off_q);
    if (live_q) begin
      Reset_A: assert (!rst_q || dac == '0);
      if (!rst_q) begin
        Up_A:   assert (dac <= dac_q || (en_q && dac - dac_q <= 8'(Largest + 1)));
        Down_A: assert (dac >= dac_q || ((!sink_q || !en_q) && dac_q - dac <= 8'(Largest + 1)));
      end
      Full_A:  assert (up_q < 6'(Steps) || on_q < 6'(2 * Bias) || dac == 8'd255);
      Hold_A:  assert (down_q < 6'(Steps) || on_q < 6'(2 * Bias) || dac == 8'(Bias));
      Zero_A:  assert (down_q < 6'(Steps) || off_q < 6'(2 * Bias) || dac == '0);
      // for the induction
      Pos_A:   assert (dut.pos_q <= 5'(Steps) && (up_q >= 6'(Steps) ? dut.pos_q == 5'(Steps) : 6'(dut.pos_q) >= up_q));
      Low_A:   assert (down_q >= 6'(Steps) ? dut.pos_q == '0 : 6'(dut.pos_q) + down_q <= 6'(Steps));
      Bias_A:  assert (dut.bias_q <= 4'(Bias) && 5'(dut.bias_q) >= moves(on_q, dut.half_q));
      Off_A:   assert (5'(dut.bias_q) + moves(off_q, dut.half_q) <= 5'(Bias));
      Sum_A:   assert (dac == dut.level(dut.pos_q) + 8'(dut.bias_q));
      Div_A:   assert (dut.div_q == '0 && dut.sink_q == (up_q != '0));
    end
    Full_C: cover (!rst_i && dac == 8'd255 && down_q == '0);
    Turn_C: cover (!rst_i && dac > 8'd100 && dac < dac_q && down_q == 6'd1);
    Rest_C: cover (!rst_i && dac == '0 && dac_q == 8'd1);
  end
endmodule
