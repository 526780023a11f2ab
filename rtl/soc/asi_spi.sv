// SPDX-License-Identifier: Apache-2.0
// asi_spi: byte shifter for the flash, mode 0, MSB first, SCK 16 MHz at most. The data register in asi_regs is the
// shift register: MOSI is its top bit, a shift takes in what MISO was at the rising edge. Requirement: HW-007.
module asi_spi #(
  parameter int unsigned ClkHz = 16_000_000
) (
  input  logic       clk_i, rst_i,     // rst_i: synchronous, active high
  input  logic       start_i,          // pulse: the data register is being written; software waits for busy_o = 0
  input  logic [7:0] data_i,           // data register
  output logic       shift_o,          // pulse: the data register becomes next_o
  output logic [7:0] next_o,
  output logic       busy_o,           // from the clock after start_i until the byte is complete
  output logic       sck_o, mosi_o,
  input  logic       miso_i
);
  localparam int unsigned HalfClocks = (ClkHz + 31_999_999) / 32_000_000;  // clocks per half SCK period

  logic [3:0] half_q;                  // half periods of the byte; SCK is its lowest bit
  logic       half_end, miso_q;

  generate
    if (HalfClocks == 1) begin : g_fast
      assign half_end = busy_o;
    end else begin : g_div
      localparam int unsigned DivW = $clog2(HalfClocks);
      logic [DivW-1:0] div_q;
      assign half_end = busy_o && div_q == DivW'(HalfClocks - 1);
      always_ff @(posedge clk_i) div_q <= (rst_i || !busy_o || half_end) ? '0 : div_q + 1'b1;
    end
  endgenerate

  assign sck_o   = half_q[0];
  assign mosi_o  = data_i[7];
  assign shift_o = half_end && half_q[0];
  assign next_o  = {data_i[6:0], miso_q};

  always_ff @(posedge clk_i) begin
    if (rst_i) begin
      busy_o <= 1'b0;
      half_q <= '0;
    end else begin
      if (start_i)                               busy_o <= 1'b1;
      else if (half_end && half_q == 4'd15)      busy_o <= 1'b0;
      if (half_end)                              half_q <= half_q + 1'b1;   // wraps to 0 with the end of the byte
    end
    if (half_end && !half_q[0]) miso_q <= miso_i;                           // the rising edge
  end

`ifndef SYNTHESIS
  always_ff @(posedge clk_i) if (!rst_i) begin
    Start_A: assert (!(start_i && busy_o));
    Idle_A:  assert (busy_o || half_q == '0);
    Done_C:  cover (shift_o && half_q == 4'd15);
  end
`endif
endmodule
