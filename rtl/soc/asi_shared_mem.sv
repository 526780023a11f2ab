// SPDX-License-Identifier: Apache-2.0
// asi_shared_mem: link RAM, statistics RAM or monitor ring: one port, shared by the core and an engine of the line.
// The engine always wins and keeps the port as long as it requests, so what it does in one go the core never sees half
// done, and its next request is ready before the gap on the line ends. The core waits.
// core_clear_i: a core read that returns the word and sets it to 0 before anybody else gets the port (ST-004): it takes
// the port for two clocks, because many block RAMs cannot read and write one word in the same clock. So where it is
// used the first clock of a request of the engine may be lost: there it must read, and read again. With core_clear_i
// tied to 0 every clock of the engine counts. Contract: docs/architecture.md.
module asi_shared_mem #(
  parameter  int unsigned Words = 256,
  localparam int unsigned AddrW = $clog2(Words)
) (
  input  logic             clk_i, rst_i,          // rst_i: synchronous, active high
  // core: request held until ready; read data is valid with ready
  input  logic             core_req_i, core_we_i,
  input  logic             core_clear_i,          // with a read: clear the word; no effect on a write
  input  logic [3:0]       core_be_i,
  input  logic [AddrW-1:0] core_addr_i,           // in words
  input  logic [31:0]      core_wdata_i,
  output logic             core_ready_o,
  // engine: one access per clock, read data one clock later
  input  logic             eng_req_i, eng_we_i,
  input  logic [AddrW-1:0] eng_addr_i,
  input  logic [31:0]      eng_wdata_i,
  output logic [31:0]      rdata_o                // to both
);
  logic             core_go, clear, we;           // clear: second clock of a clearing read, the one of its ready
  logic [3:0]       be;
  logic [AddrW-1:0] addr;
  logic [31:0]      wdata;

  assign clear   = core_ready_o & core_clear_i & ~core_we_i;
  assign core_go = core_req_i & ~core_ready_o & ~eng_req_i;
  always_comb begin
    we = core_go & core_we_i;  be = core_be_i;  addr = core_addr_i;  wdata = core_wdata_i;
    if (clear)          begin we = 1'b1;      be = 4'hF;  wdata = '0; end
    else if (eng_req_i) begin we = eng_we_i;  be = 4'hF;  addr = eng_addr_i;  wdata = eng_wdata_i; end
  end

  always_ff @(posedge clk_i) core_ready_o <= ~rst_i & core_go;

`ifndef FORMAL
  logic [31:0] mem [Words];
  always_ff @(posedge clk_i) begin
    if (we) for (int b = 0; b < 4; b++) if (be[b]) mem[addr][8*b +: 8] <= wdata[8*b +: 8];
    if ((eng_req_i || core_go) && !we) rdata_o <= mem[addr];
  end
`else  // proofs keep one word, any one, and a read of another gives a wrong value: what is proved of it holds for all
  logic [AddrW-1:0] watch_q;   // free at the start, then constant
  logic [31:0]      word_q;
  always_ff @(posedge clk_i) begin
    watch_q <= watch_q;
    if (we && addr == watch_q) for (int b = 0; b < 4; b++) if (be[b]) word_q[8*b +: 8] <= wdata[8*b +: 8];
    if ((eng_req_i || core_go) && !we) rdata_o <= (addr == watch_q) ? word_q : ~word_q;
  end
`endif

`ifndef SYNTHESIS
  logic              held_q, again_q;
  logic [AddrW+37:0] core, core_q;
  logic [AddrW-1:0]  eng_addr_q;
  assign core = {core_we_i, core_clear_i, core_be_i, core_addr_i, core_wdata_i};
  always_ff @(posedge clk_i) begin
    held_q     <= !rst_i && core_req_i && !core_ready_o;
    core_q     <= core;
    again_q    <= !rst_i && clear && eng_req_i;
    eng_addr_q <= eng_addr_i;
    if (!rst_i) begin
      Held_A:  assert (!held_q || (core_req_i && core_q == core));
      Ready_A: assert (!core_ready_o || core_req_i);
      First_A: assert (!clear || !eng_req_i || !eng_we_i);
      Again_A: assert (!again_q || (eng_req_i && !eng_we_i && eng_addr_i == eng_addr_q));
      Wait_C:  cover (core_req_i && eng_req_i);
      Clear_C: cover (clear);
      Lost_C:  cover (clear && eng_req_i);
    end
  end
`endif
endmodule
