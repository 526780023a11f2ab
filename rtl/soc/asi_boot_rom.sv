// SPDX-License-Identifier: Apache-2.0
// asi_boot_rom: 256 words that copy the firmware from flash to RAM. Read data one clock after the request.
module asi_boot_rom #(
  parameter InitFile = ""         // $readmemh, 256 words
) (
  input  logic        clk_i,
  input  logic        req_i,
  input  logic [7:0]  addr_i,     // in words
  output logic [31:0] rdata_o
);
  logic [31:0] mem [256];
  initial if (InitFile != "") $readmemh(InitFile, mem);
  always_ff @(posedge clk_i) if (req_i) rdata_o <= mem[addr_i];
endmodule
