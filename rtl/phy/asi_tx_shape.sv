// SPDX-License-Identifier: Apache-2.0
// asi_tx_shape: current code of a shaped sender. An edge of MAN becomes a 3 us edge of the current whose derivative is
// a sin^2: i(t)/I0 = t/T - sin(2 pi t/T)/(2 pi), in 24 steps of 125 ns; falling MAN = rising current = negative pulse.
// dac_o = bias + edge. The bias is ramped, one code per 250 ns, so that it makes no pulse of its own: TxBias codes
// while en_i, none at rest; an edge lifts the code by 255 - TxBias. dac_o follows the pins by one clock and never
// jumps, whatever the pins do: a sender that is cut off in an edge turns round where it is.
// Requirements: LT-015 (docs/requirements.md).
module asi_tx_shape #(
  parameter int unsigned ClkHz  = 16_000_000,
  parameter int unsigned TxBias = 12           // codes, 0..63; 12 are reached in 3 us, the shortest lead of tx_en
) (
  input  logic       clk_i, rst_i,             // rst_i: synchronous, active high
  input  logic       man_i, en_i,              // as on the pins: Manchester level, sender on
  output logic [7:0] dac_o
);
  localparam int unsigned Steps  = 24;
  localparam int unsigned Div    = ClkHz / 8_000_000;      // clocks of a step
  localparam int unsigned DivW   = (Div > 1) ? $clog2(Div) : 1;
  localparam int unsigned BiasW  = (TxBias > 0) ? $clog2(TxBias + 1) : 1;
  localparam int unsigned Swing  = 255 - TxBias;
  // i(k/24)/I0 in units of 2^-20; cocotb_tests/block/cocotb_tx_shape.py computes it again
  localparam int unsigned Edge [Steps+1] = '{
    0, 497, 3938, 13066, 30235, 57254, 95258, 144635, 204998, 275210, 353464, 437404, 524288, 611172, 695112,
    773366, 843578, 903941, 953318, 991322, 1018341, 1035510, 1044638, 1048079, 1048576
  };

  logic [4:0]       pos_d, pos_q;                          // steps into the edge: 0 = no current, 24 = full
  logic [DivW-1:0]  div_d, div_q;                          // clocks of this step; 0: a step may begin
  logic [BiasW-1:0] bias_d, bias_q;
  logic             half_q;                                // every other step moves the bias
  logic             sink, sink_q, step;                    // sink: the current goes up, or is up

  assign sink = en_i && !man_i;
  // the first edge sets the phase of the steps; those after it come every 24 steps and fit into it
  assign step = (sink != sink_q) || (div_q == '0);

  always_comb begin
    div_d = (sink != sink_q) ? DivW'(Div > 1 ? 1 : 0) : (div_q == DivW'(Div - 1)) ? '0 : div_q + 1'b1;
    pos_d = pos_q;  bias_d = bias_q;
    if (step && sink && pos_q != 5'(Steps)) pos_d = pos_q + 1'b1;
    if (step && !sink && pos_q != '0)       pos_d = pos_q - 1'b1;
    if (step && half_q && en_i  && bias_q != BiasW'(TxBias)) bias_d = bias_q + 1'b1;
    if (step && half_q && !en_i && bias_q != '0)             bias_d = bias_q - 1'b1;
  end

  // Edge scaled to Swing: a constant table. Places above 24 are never reached; full scale there keeps it small.
  function automatic logic [7:0] level(logic [4:0] pos);
    logic [255:0] codes;
    for (int unsigned k = 0; k < 32; k++)
      codes[8*k +: 8] = 8'((Edge[(k < Steps) ? k : Steps] * Swing + (1 << 19)) >> 20);
    return codes[8*pos +: 8];
  endfunction

  always_ff @(posedge clk_i) begin
    sink_q <= !rst_i && sink;
    div_q  <= rst_i ? '0   : div_d;
    half_q <= rst_i ? 1'b0 : half_q ^ step;
    pos_q  <= rst_i ? '0   : pos_d;
    bias_q <= rst_i ? '0   : bias_d;
    dac_o  <= rst_i ? '0   : level(pos_d) + 8'(bias_d);
  end

`ifndef SYNTHESIS
  initial begin
    Clock_A: assert (ClkHz % 8_000_000 == 0 && ClkHz > 0);
    Bias_A:  assert (TxBias < 64);
  end
  always_ff @(posedge clk_i) if (!rst_i) begin
    Range_A: assert (pos_q <= 5'(Steps));
    Sum_A:   assert (dac_o >= 8'(bias_q));
    Full_C:  cover (dac_o == '1);
    Bias_C:  cover (dac_o == 8'(TxBias) && en_i && sink_q == sink);
    Rest_C:  cover (dac_o == '0 && half_q);
  end
`endif
endmodule
