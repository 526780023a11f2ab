// SPDX-License-Identifier: Apache-2.0
// asi_tx: sends one request as Manchester levels. Start bit, parity and end bit are made here.
// tx_man_o falls one clock after start_i, rises for the last time 78 us later; busy_o ends 81 us after the first.
// Requirements: TL-001, TL-003, TL-004, LT-001, LT-009 (docs/requirements.md).
module asi_tx #(
  parameter int unsigned ClkHz     = 16_000_000,
  parameter int unsigned HalfBitNs = asi_timing_pkg::HalfBitNs
) (
  input  logic        clk_i, rst_i,      // rst_i: synchronous, active high
  input  logic        start_i, arm_i,    // start_i: one clock, only while busy_o = 0; arm_i: bias on before it
  input  logic [10:0] call_i,            // CB, A4..A0, I4..I0; taken with start_i
  output logic        busy_o, last_o,    // last_o: the clock that begins with the last edge
  output logic        tx_man_o, tx_en_o  // pins; tx_en_o follows arm_i after one clock, as tx_man_o follows start_i
);
  localparam int unsigned Half = asi_timing_pkg::clocks(HalfBitNs, ClkHz);
  localparam int unsigned CntW = $clog2(Half);
  typedef enum logic [1:0] {StIdle, StMid, StBound} state_e;
  state_e          state_d, state_q;
  logic [CntW-1:0] cnt_d, cnt_q;    // clocks in this half bit
  logic [12:0]     bits_d, bits_q;  // bits that still have to come, next one first; the end bit is the last 1
  logic            man_d, en_d, sent;

  assign busy_o = state_q != StIdle;
  assign sent   = bits_q == '0;     // the end bit is on the line
  assign last_o = (state_q == StMid) && sent && (cnt_q == '0);

  always_comb begin
    state_d = state_q;  bits_d = bits_q;  man_d = tx_man_o;
    cnt_d   = (cnt_q == CntW'(Half - 1)) ? '0 : cnt_q + 1'b1;
    unique case (state_q)
      // StIdle: MAN rests high; a request begins in the middle of its start bit
      StIdle: begin
        cnt_d = '0;
        if (start_i) begin
          state_d = StMid;  man_d = 1'b0;  bits_d = {call_i, ^call_i, 1'b1};
        end
      end
      // StMid: second half of a bit; at its end the next bit begins with its complement, or the end cell is over
      StMid: if (cnt_q == CntW'(Half - 1)) begin
        if (sent) state_d = StIdle;
        else begin state_d = StBound; man_d = ~bits_q[12]; end
      end
      // StBound: first half of a bit; in mid-bit MAN takes the value of the bit: falling = 0, rising = 1
      StBound: if (cnt_q == CntW'(Half - 1)) begin
        state_d = StMid;  man_d = bits_q[12];  bits_d = {bits_q[11:0], 1'b0};
      end
      default: state_d = StIdle;
    endcase
    en_d = arm_i || (state_d != StIdle);
  end

  always_ff @(posedge clk_i) begin
    state_q  <= rst_i ? StIdle : state_d;
    cnt_q    <= rst_i ? '0     : cnt_d;
    bits_q   <= rst_i ? '0     : bits_d;
    tx_man_o <= rst_i ? 1'b1   : man_d;
    tx_en_o  <= rst_i ? 1'b0   : en_d;
  end

`ifndef SYNTHESIS
  always_ff @(posedge clk_i) if (!rst_i) begin
    StartIdle_A: assert (!(start_i && busy_o));
    IdleHigh_A:  assert (busy_o || tx_man_o);
    Enabled_A:   assert (!busy_o || tx_en_o);
    LastHigh_A:  assert (!last_o || tx_man_o);
    Sent_C:      cover (last_o);
    Armed_C:     cover (arm_i && !busy_o);
  end
`endif
endmodule
