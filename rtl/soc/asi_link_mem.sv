// SPDX-License-Identifier: Apache-2.0
// asi_link_mem: the link RAM, 256 words, one port shared by core and sequencer.
// The sequencer always wins: its next request must be ready before the gap on the line ends. The core waits.
module asi_link_mem (
  input  logic        clk_i, rst_i,               // rst_i: synchronous, active high
  // core: request held until ready; read data is valid with ready
  input  logic        core_req_i, core_we_i,
  input  logic [3:0]  core_be_i,
  input  logic [7:0]  core_addr_i,                // in words
  input  logic [31:0] core_wdata_i,
  output logic        core_ready_o,
  // sequencer: one access per clock, read data one clock later
  input  logic        seq_req_i, seq_we_i,
  input  logic [7:0]  seq_addr_i,
  input  logic [31:0] seq_wdata_i,
  output logic [31:0] rdata_o                     // to both
);
  logic [31:0] mem [256];
  logic        core_go, we;
  logic [3:0]  be;
  logic [7:0]  addr;
  logic [31:0] wdata;

  assign core_go = core_req_i & ~core_ready_o & ~seq_req_i;
  assign we      = seq_req_i ? seq_we_i    : core_go & core_we_i;
  assign be      = seq_req_i ? 4'hF        : core_be_i;
  assign addr    = seq_req_i ? seq_addr_i  : core_addr_i;
  assign wdata   = seq_req_i ? seq_wdata_i : core_wdata_i;

  always_ff @(posedge clk_i) begin
    core_ready_o <= ~rst_i & core_go;
    if (we) for (int b = 0; b < 4; b++) if (be[b]) mem[addr][8*b +: 8] <= wdata[8*b +: 8];
    if ((seq_req_i || core_go) && !we) rdata_o <= mem[addr];
  end

`ifndef SYNTHESIS
  logic        held_q;
  logic [44:0] core_q;
  always_ff @(posedge clk_i) begin
    held_q <= !rst_i && core_req_i && !core_ready_o;
    core_q <= {core_we_i, core_be_i, core_addr_i, core_wdata_i};
    if (!rst_i) begin
      Held_A:  assert (!held_q || (core_req_i && core_q == {core_we_i, core_be_i, core_addr_i, core_wdata_i}));
      Ready_A: assert (!core_ready_o || core_req_i);
      Wait_C:  cover (core_req_i && seq_req_i);
    end
  end
`endif
endmodule
