// SPDX-License-Identifier: Apache-2.0
// asi_stats: counters of every slave in the statistics RAM: attempts by class, repeated calls, response delay, grid
// deviation. One attempt takes at most 17 clocks; during these it keeps the port, so the core never sees half of it.
// Words: stat_r in rdl/asi.rdl. Each takes three clocks: read, compare, write. The first request of an attempt comes
// one clock early: asi_shared_mem may not serve it. After reset all words are set to 0, one per clock.
// Requirements: ST-001 .. ST-005 (docs/requirements.md); the broadcasts of ST-003 are kept away by asi_xact.
module asi_stats
  import asi_map_pkg::*;
(
  input  logic         clk_i, rst_i,      // rst_i: synchronous, active high
  // asi_xact: one clock per judged attempt, at least 20 clocks apart
  input  logic         att_valid_i,
  input  logic [5:0]   att_index_i,
  input  error_class_e att_class_i,
  input  logic         att_repeat_i,      // the attempt was a repetition
  input  logic         att_final_i,       // the call ends with it
  input  logic [15:0]  att_delay_i,       // clocks, > 0; used when the class is OK, like the next two
  input  logic [7:0]   att_dev_i,         // clocks
  input  logic         att_dev_late_i,
  // statistics RAM, word addresses; read data one clock after the request
  output logic         mem_req_o, mem_we_o,
  output logic [9:0]   mem_addr_o,
  output logic [31:0]  mem_wdata_o,
  input  logic [31:0]  mem_rdata_i
);
  localparam logic [3:0] WordOk        = 4'(StatCount / 4);
  localparam logic [3:0] WordRepeatOk  = 4'(StatRepeatOk / 4);
  localparam logic [3:0] WordRepeatBad = 4'(StatRepeatFailed / 4);
  localparam logic [3:0] WordDelay     = 4'(StatDelay / 4);
  localparam logic [3:0] WordSum       = 4'(StatDelaySum / 4);
  localparam logic [3:0] WordDev       = 4'(StatDeviation / 4);

  typedef enum logic [2:0] {StClear, StIdle, StTake, StRead, StLook, StWrite} state_e;
  state_e      state_d, state_q;
  logic [5:0]  index_d, index_q;
  logic [3:0]  word_d, word_q;           // of the present step; its first value is the class
  logic        repeated_d, repeated_q;   // the last attempt of a call with repetitions
  logic [15:0] delay_d, delay_q;
  logic [8:0]  dev_d, dev_q;             // {late, clocks}
  logic        min_q, max_q, far_q;      // the read word has a larger minimum, a smaller maximum, a smaller deviation
  logic        is_delay, is_sum, is_dev, low_is_new, high_is_new, carry;
  logic [15:0] low_new, low, high;       // write data

  // A word is read + new, or new alone. What must stay is read + 0. In StClear both parts are new, from registers that
  // reset has set to 0.
  assign is_delay    = word_q == WordDelay;
  assign is_sum      = word_q == WordSum;
  assign is_dev      = word_q == WordDev;
  assign low_is_new  = state_q == StClear || (is_delay && min_q) || (is_dev && far_q);
  assign high_is_new = state_q == StClear || (is_delay && max_q);
  always_comb begin
    low_new = '0;
    if (is_sum || (is_delay && min_q)) low_new = delay_q;
    if (is_dev && far_q)               low_new = 16'(dev_q);
    {carry, low} = 17'(mem_rdata_i[15:0]) + 17'(low_new) + 17'(!is_delay && !is_sum && !is_dev);
    if (low_is_new) low = low_new;
    high = mem_rdata_i[31:16] + 16'(carry && !low_is_new);
    if (high_is_new) high = delay_q;
  end
  assign mem_wdata_o = {high, low};
  assign mem_addr_o  = {index_q, word_q};

  always_comb begin
    state_d = state_q;  index_d = index_q;  word_d = word_q;  repeated_d = repeated_q;
    delay_d = delay_q;  dev_d = dev_q;
    mem_req_o = 1'b1;   mem_we_o = 1'b0;
    unique case (state_q)
      // StClear: after reset, every word of every index
      StClear: begin
        mem_we_o = 1'b1;
        {index_d, word_d} = {index_q, word_q} + 10'd1;
        if ({index_q, word_q} == '1) state_d = StIdle;
      end
      // StIdle: no attempt; classes that have no counter (ABORTED) are no attempts
      StIdle: begin
        mem_req_o  = 1'b0;
        index_d    = att_index_i;
        word_d     = att_class_i;
        repeated_d = att_repeat_i && att_final_i;
        delay_d    = att_delay_i;
        dev_d      = {att_dev_late_i, att_dev_i};
        if (att_valid_i && att_class_i <= ErrBadMaster) state_d = StTake;
      end
      StTake: state_d = StRead;
      StRead: state_d = StLook;
      StLook: state_d = StWrite;
      // StWrite: and choose the next word: the class, DELAY, DELAY_SUM, DEVIATION for a good answer, REPEAT_*
      StWrite: begin
        mem_we_o = 1'b1;
        state_d  = StRead;
        unique case (word_q)
          WordOk:                      word_d = WordDelay;
          WordDelay:                   word_d = WordSum;
          WordSum:                     word_d = WordDev;
          WordDev: begin               word_d = WordRepeatOk;   if (!repeated_q) state_d = StIdle; end
          WordRepeatOk, WordRepeatBad:                          state_d = StIdle;
          default: begin               word_d = WordRepeatBad;  if (!repeated_q) state_d = StIdle; end
        endcase
      end
      default: state_d = StIdle;
    endcase
  end

  always_ff @(posedge clk_i) begin
    state_q <= rst_i ? StClear : state_d;
    {index_q, word_q} <= rst_i ? '0 : {index_d, word_d};
    delay_q <= rst_i ? '0 : delay_d;
    dev_q   <= rst_i ? '0 : dev_d;
    repeated_q <= repeated_d;
    min_q   <= mem_rdata_i[15:0] == '0 || mem_rdata_i[15:0] > delay_q;
    max_q   <= mem_rdata_i[31:16] < delay_q;
    far_q   <= mem_rdata_i[7:0] < dev_q[7:0];
  end

`ifndef SYNTHESIS
  always_ff @(posedge clk_i) begin
    if (!rst_i) begin
      Overrun_A: assert (!att_valid_i || state_q == StIdle);
      Write_A:   assert (!mem_we_o || mem_req_o);
      Cleared_A: assert (state_q != StClear || mem_wdata_o == '0);
      Repeat_C:  cover (state_q == StWrite && word_q == WordRepeatOk);
      Failed_C:  cover (state_q == StWrite && word_q == WordRepeatBad);
      Keep_C:    cover (state_q == StWrite && is_delay && !min_q && !max_q);
      Far_C:     cover (state_q == StWrite && is_dev && far_q);
    end
  end
`endif
endmodule
