// SPDX-License-Identifier: Apache-2.0
// Proof of asi_stats with its memory, unbounded, for any attempts (20 clocks apart) and any traffic of the core, clearing
// reads and writes among it: any one word of the 1024 is at all times what the rules make of it (ST-001, ST-002,
// ST-004, ST-005). The rules are written here a second time: one attempt changes the words of its index at once.
module asi_stats_fv
  import asi_map_pkg::*;
(
  input logic         clk_i, rst_i, valid_i, repeat_i, final_i, late_i, core_req_i, core_we_i, core_clear_i,
  input logic [5:0]   index_i,
  input logic [3:0]   class_i,
  input logic [15:0]  delay_i,
  input logic [7:0]   dev_i,
  input logic [3:0]   core_be_i,
  input logic [9:0]   core_addr_i,
  input logic [31:0]  core_wdata_i
);
  logic        req, we, ready;
  logic [9:0]  addr;
  logic [31:0] wdata, rdata;
  asi_stats dut (
    .clk_i, .rst_i, .att_valid_i(valid_i), .att_index_i(index_i), .att_class_i(error_class_e'(class_i)),
    .att_repeat_i(repeat_i), .att_final_i(final_i), .att_delay_i(delay_i), .att_dev_i(dev_i), .att_dev_late_i(late_i),
    .mem_req_o(req), .mem_we_o(we), .mem_addr_o(addr), .mem_wdata_o(wdata), .mem_rdata_i(rdata)
  );
  asi_shared_mem #(.Words(1024)) mem (
    .clk_i, .rst_i, .core_req_i, .core_we_i, .core_clear_i, .core_be_i, .core_addr_i, .core_wdata_i,
    .core_ready_o(ready), .eng_req_i(req), .eng_we_i(we), .eng_addr_i(addr), .eng_wdata_i(wdata), .rdata_o(rdata)
  );

  logic        init_q = 1'b1, live_q = 1'b0;
  logic [9:0]  watch_q;                    // any word
  logic [31:0] word_q, next, merged;       // what it must be; after the attempt; after a write of the core
  logic [4:0]  rest_q;                     // clocks until the next attempt may come
  logic        held_q, clear_q, go, valid;
  logic [48:0] core, core_q;
  // the present attempt
  logic [5:0]  index_q;
  logic [3:0]  class_q, word;
  logic        again_q;
  logic [15:0] delay_q;
  logic [8:0]  dev_q;
  assign watch_q = mem.watch_q;
  assign core  = {core_we_i, core_clear_i, core_be_i, core_addr_i, core_wdata_i};
  assign go    = core_req_i && !ready && !req;
  assign valid = valid_i && class_i <= 4'd10;
  assign word  = watch_q[3:0];

  always_comb begin
    next = word_q;
    if (watch_q[9:4] == index_q) begin
      if (word == class_q)                                  next = word_q + 1;
      if (word == 4'd11 && again_q && class_q == '0)        next = word_q + 1;
      if (word == 4'd12 && again_q && class_q != '0)        next = word_q + 1;
      if (class_q == '0 && word == 4'd13) begin
        if (word_q[15:0] == '0 || delay_q < word_q[15:0])   next[15:0]  = delay_q;
        if (delay_q > word_q[31:16])                        next[31:16] = delay_q;
      end
      if (class_q == '0 && word == 4'd14)                   next = word_q + 32'(delay_q);
      if (class_q == '0 && word == 4'd15 && dev_q[7:0] > word_q[7:0]) next[15:0] = {7'd0, dev_q};
    end
    merged = word_q;
    for (int b = 0; b < 4; b++) if (core_be_i[b]) merged[8*b +: 8] = core_wdata_i[8*b +: 8];
  end

  // the watched word before the attempt and, from it, after; the core's read found seen_q
  logic [31:0] old_q, seen_q, after;
  logic        touched, go_q;
  logic [4:0]  need;

  // where the update stands: place of the present step and of the watched word in the order of the steps
  logic       busy, clearing, written;
  logic [2:0] step, own;
  function automatic logic [2:0] place(logic [3:0] w);
    return w == 4'd13 ? 3'd1 : w == 4'd14 ? 3'd2 : w == 4'd15 ? 3'd3 : (w == 4'd11 || w == 4'd12) ? 3'd4 : 3'd0;
  endfunction
  assign clearing = dut.state_q == 3'd0;
  assign busy     = dut.state_q >= 3'd3;               // StRead, StLook, StWrite
  assign step     = place(dut.word_q);
  assign own      = place(word);
  assign written  = busy && step > own;

  always_comb begin
    touched = word == class_q || (class_q == '0 && own inside {3'd1, 3'd2, 3'd3}) ||
              (again_q && word == (class_q == '0 ? 4'd11 : 4'd12));
    after = old_q;
    if (own == 3'd0 || own == 3'd4) after = old_q + 1;
    if (own == 3'd1) begin
      if (old_q[15:0] == '0 || delay_q < old_q[15:0]) after[15:0] = delay_q;
      if (delay_q > old_q[31:16]) after[31:16] = delay_q;
    end
    if (own == 3'd2) after = old_q + 32'(delay_q);
    if (own == 3'd3 && dev_q[7:0] > old_q[7:0]) after[15:0] = {7'd0, dev_q};
    // clocks that the update still takes: the next attempt comes after them
    need = dut.state_q == 3'd2 ? 5'd16 : 5'd3 * (5'd4 - 5'(step)) + 5'd6 - 5'(dut.state_q);
  end

  always_ff @(posedge clk_i) begin
    init_q  <= 1'b0;
    live_q  <= 1'b1;
`ifdef FV_COVER  // begins behind the 1024 clocks of the clear
    assume (!rst_i);
    if (init_q) assume (dut.state_q == 3'd1 && !ready && word_q == '0 && mem.word_q == '0 && rest_q == '0);
`else
    if (init_q) assume (rst_i);
`endif
    held_q  <= !rst_i && core_req_i && !ready;
    core_q  <= core;
    assume (!held_q || (core_req_i && core == core_q));                       // the bus rule
    rest_q  <= rst_i ? '0 : valid_i ? 5'd19 : rest_q - 5'(rest_q != '0);
    assume (!valid_i || (rest_q == '0 && !clearing));
    clear_q <= !rst_i && go && !core_we_i && core_clear_i;
    if (valid_i && !rst_i)
      {index_q, class_q, again_q, delay_q, dev_q} <= {index_i, class_i, repeat_i && final_i, delay_i, late_i, dev_i};
    // The word: 0 from reset on; the whole attempt when the update begins; the core's accesses when they are served.
    if (rst_i) word_q <= '0;
    else if (dut.state_q == 3'd2) word_q <= next;
    else if (go && core_addr_i == watch_q && core_we_i)    word_q <= merged;
    else if (go && core_addr_i == watch_q && core_clear_i) word_q <= '0;
    if (dut.state_q == 3'd2) old_q <= word_q;
    seen_q  <= word_q;
    go_q    <= !rst_i && go;

    if (live_q && !rst_i) begin
      // the rule: outside an update the memory holds the word, and the core reads it
      Word_A:   assert (busy || clearing || mem.word_q == word_q || (clear_q && core_addr_i == watch_q));
      Served_A: assert (!(ready && !core_we_i && core_addr_i == watch_q) || rdata == seen_q);
      Alone_A:  assert (!busy || (req && !ready));                            // nobody sees an update half done
      Wait_A:   assert (busy || clearing || dut.state_q == 3'd2 || !req);
      // for the induction
      Clear_A:  assert (clear_q == mem.clear && (!clear_q || (core_addr_i != watch_q || word_q == '0)));
      Go_A:     assert (ready == go_q && (!ready || held_q));
      Zero_A:   assert (!clearing || (word_q == '0 && dut.delay_q == '0 && dut.dev_q == '0 && rest_q == '0 && !ready &&
                                      ({dut.index_q, dut.word_q} <= watch_q || mem.word_q == '0)));
      State_A:  assert (dut.state_q <= 3'd5);
      if (busy || dut.state_q == 3'd2) begin
        Copy_A:   assert (dut.index_q == index_q && dut.repeated_q == again_q && dut.delay_q == delay_q &&
                          dut.dev_q == dev_q && class_q <= 4'd10);
        First_A:  assert (dut.state_q != 3'd2 || dut.word_q == class_q);
        Order_A:  assert (step == 3'd0 ? dut.word_q == class_q :
                          step == 3'd4 ? again_q && dut.word_q == (class_q == '0 ? 4'd11 : 4'd12) : class_q == '0);
      end
      if (busy) begin
        Old_A:    assert (watch_q[9:4] != index_q || !touched || word_q == after);
        Other_A:  assert ((watch_q[9:4] == index_q && touched) || word_q == old_q);
        Memory_A: assert (mem.word_q == (watch_q[9:4] == index_q && touched && !written ? old_q : word_q));
        Read_A:   assert (dut.state_q == 3'd3 || addr != watch_q || rdata == old_q);
        Compare_A: assert (dut.state_q != 3'd5 || addr != watch_q || (
                            dut.min_q == (old_q[15:0] == '0 || delay_q < old_q[15:0]) &&
                            dut.max_q == (delay_q > old_q[31:16]) && dut.far_q == (dev_q[7:0] > old_q[7:0])));
      end
      Rest_A:   assert (clearing || dut.state_q == 3'd1 || rest_q >= need);
    end
    Good_C:    cover (live_q && !rst_i && word == 4'd14 && word_q == 32'h30 && busy && step == 3'd4);
    Failed_C:  cover (live_q && !rst_i && dut.state_q == 3'd5 && dut.word_q == 4'd12 && ready == 1'b0 && held_q);
    Taken_C:   cover (live_q && !rst_i && clear_q && core_addr_i == watch_q && rdata == 32'd1 && dut.state_q == 3'd2);
  end
endmodule
