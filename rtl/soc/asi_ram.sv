// SPDX-License-Identifier: Apache-2.0
// asi_ram: single-port 32-bit memory with byte enables. Read data is valid in the clock after the request, not longer.
// A part with memories of its own brings a file with the same module (syn/up5k/asi_ram.sv).
module asi_ram #(
  parameter int unsigned Words        = 1024,  // size; an InitFile must not be longer
  parameter              InitFile     = "",    // $readmemh, one 32-bit word per line; "": not initialised
  parameter              InitPlusarg  = ""     // simulation only: +<InitPlusarg>=<file> is loaded instead
) (
  input  logic                     clk_i,
  input  logic                     req_i, we_i,
  input  logic [3:0]               be_i,       // bytes to write
  input  logic [$clog2(Words)-1:0] addr_i,     // in words
  input  logic [31:0]              wdata_i,
  output logic [31:0]              rdata_o
);
  logic [31:0] mem [Words];

  initial begin
`ifndef SYNTHESIS
    string file;
    if (InitPlusarg != "" && $value$plusargs({InitPlusarg, "=%s"}, file)) $readmemh(file, mem);
    else
`endif
    if (InitFile != "") $readmemh(InitFile, mem);
  end

  always_ff @(posedge clk_i) if (req_i) begin
    if (we_i) begin
      for (int b = 0; b < 4; b++) if (be_i[b]) mem[addr_i][8*b +: 8] <= wdata_i[8*b +: 8];
    end else rdata_o <= mem[addr_i];
  end
endmodule
