// SPDX-License-Identifier: Apache-2.0
// Proof of asi_shared_mem (ST-004), unbounded, for any traffic of the core: an engine that adds 1 to words, by the rule of
// the clearing read (it reads, reads again, then writes, without a break), and a core that reads and clears them:
// of any word, what the core took and what is left is what the engine has added. And what both sides read is
// the word as it was left by whoever had it last, byte by byte; the core gets every clock that the engine leaves.
module asi_shared_mem_fv #(
  parameter int unsigned Words = 256, localparam int unsigned AddrW = $clog2(Words)
) (
  input  logic             clk_i, rst_i, core_req_i, core_we_i, core_clear_i, eng_req_i, eng_we_i,
  input  logic [3:0]       core_be_i,
  input  logic [AddrW-1:0] core_addr_i, eng_addr_i,
  input  logic [31:0]      core_wdata_i, eng_wdata_i
);
  logic        core_ready;
  logic [31:0] rdata;
  asi_shared_mem #(.Words(Words)) dut (
    .clk_i, .rst_i, .core_req_i, .core_we_i, .core_clear_i, .core_be_i, .core_addr_i, .core_wdata_i,
    .core_ready_o(core_ready), .eng_req_i, .eng_we_i, .eng_addr_i, .eng_wdata_i, .rdata_o(rdata)
  );

  logic              init_q = 1'b1, live_q = 1'b0;
  logic [AddrW-1:0]  watch_q;              // any word
  logic [31:0]       books_q;              // what was there + the engine's increments - what the core took
  logic [1:0]        added_q, taken_q;     // for the covers: increments, clearing reads that found something
  logic [31:0]       shadow_q, merged;     // the watched word as the two sides must see it
  logic              held_q, core_read_q, eng_read_q, clear_q, twice_q;
  logic [AddrW+37:0] core, core_q;
  logic [AddrW-1:0]  eng_addr_q;
  logic [31:0]       before_q;             // the shadow when the last access was made
  logic              lost_q, core_go_q;    // lost_q: the engine's read in a clearing clock does not count
  logic              go, eng_go, is_add;
  assign watch_q = dut.watch_q;
  assign core   = {core_we_i, core_clear_i, core_be_i, core_addr_i, core_wdata_i};
  assign go     = core_req_i && !core_ready && !eng_req_i;      // the core's turn
  assign eng_go = eng_req_i && !clear_q;                        // the engine's
  assign is_add = eng_go && eng_we_i && eng_addr_i == watch_q;
  always_comb begin
    merged = shadow_q;
    for (int b = 0; b < 4; b++) if (core_be_i[b]) merged[8*b +: 8] = core_wdata_i[8*b +: 8];
  end

  always_ff @(posedge clk_i) begin
    init_q  <= 1'b0;
    live_q  <= 1'b1;
    assume (rst_i == init_q && !(rst_i && (core_req_i || core_clear_i || eng_req_i)));
    core_q  <= core;
    eng_addr_q <= eng_addr_i;
    held_q  <= !rst_i && core_req_i && !core_ready;
    assume (!held_q || (core_req_i && core == core_q));                       // the bus rule: held until ready
    // the engine's rule: it writes read + 1 in the clock after it has read the word twice
    twice_q <= !rst_i && eng_read_q && eng_req_i && !eng_we_i && eng_addr_i == eng_addr_q;
    assume (!(eng_req_i && eng_we_i) || (twice_q && eng_addr_i == eng_addr_q && eng_wdata_i == rdata + 1));
    assume (!(clear_q && eng_req_i && eng_we_i));
    assume (!lost_q || (eng_req_i && !eng_we_i && eng_addr_i == eng_addr_q));
    eng_read_q  <= !rst_i && eng_req_i && !eng_we_i;
    core_read_q <= !rst_i && go && !core_we_i;
    clear_q     <= !rst_i && go && !core_we_i && core_clear_i;
    core_go_q   <= !rst_i && go;
    before_q    <= shadow_q;
    lost_q      <= !rst_i && clear_q && eng_req_i;
    if (rst_i) begin books_q <= dut.word_q; {added_q, taken_q} <= '0; end
    else if (go && core_we_i && core_addr_i == watch_q) books_q <= merged;   // a write begins them anew
    else if (is_add) begin books_q <= books_q + 1; added_q <= added_q + 2'(added_q != '1); end
    else if (clear_q && core_addr_i == watch_q) begin
      books_q <= books_q - rdata;
      if (rdata != '0) taken_q <= taken_q + 2'(taken_q != '1);
    end
    // begins with what the memory holds: the engine and the core know nothing of what was before
    if (rst_i) shadow_q <= dut.word_q;
    else if (is_add) shadow_q <= shadow_q + 1;
    else if (go && core_addr_i == watch_q && core_we_i) shadow_q <= merged;
    else if (go && core_addr_i == watch_q && core_clear_i) shadow_q <= '0;
    if (live_q) begin
      Word_A:  assert (dut.word_q == shadow_q || (clear_q && core_addr_i == watch_q && shadow_q == '0));
      Ready_A: assert (core_ready == core_go_q && (!core_ready || held_q));
      Clear_A: assert (dut.clear == clear_q);
      Read_A:  assert (!(core_ready && core_read_q && !clear_q && core_addr_i == watch_q) || rdata == before_q);
      Taken_A: assert (!(clear_q && core_addr_i == watch_q) || (rdata == dut.word_q && rdata == before_q));
      Eng_A:   assert (!(eng_read_q && !lost_q && eng_addr_q == watch_q) || rdata == shadow_q);
      Twice_A: assert (!twice_q || (eng_read_q && !lost_q));
      Count_A: assert (books_q == dut.word_q);
    end
    Lost_C:  cover (live_q && twice_q && added_q == 2'd1 && taken_q == 2'd1);
    Three_C: cover (live_q && added_q == 2'd3 && taken_q == 2'd2 && dut.word_q == 32'd1 && !clear_q);
  end
endmodule
