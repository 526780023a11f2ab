// SPDX-License-Identifier: Apache-2.0
// asi_ram for the iCE40 UP5K: the module of rtl/soc/asi_ram.sv made of two SB_SPRAM256KA, 16 K x 16 bits each.
// They cannot be initialised: the firmware comes from flash (BootFromFlash). Smaller sizes leave depth unused.
module asi_ram #(
  parameter int unsigned Words        = 1024,  // 16384 at most
  parameter              InitFile     = "",    // must stay empty
  parameter              InitPlusarg  = ""     // simulation only, ignored here
) (
  input  logic                     clk_i,
  input  logic                     req_i, we_i,
  input  logic [3:0]               be_i,
  input  logic [$clog2(Words)-1:0] addr_i,
  input  logic [31:0]              wdata_i,
  output logic [31:0]              rdata_o
);
  generate
    if (InitFile != "") begin : g_no_init
      $error("UP5K SPRAM cannot be initialised: set BootFromFlash, leave FirmwareHex empty");
    end
    if (Words > 16384) begin : g_too_big
      $error("two SPRAM blocks hold 16384 words");
    end
    for (genvar h = 0; h < 2; h++) begin : g_half
      SB_SPRAM256KA u_spram (
        .CLOCK      (clk_i),
        .CHIPSELECT (req_i),
        .WREN       (we_i),
        .MASKWREN   ({{2{be_i[2*h+1]}}, {2{be_i[2*h]}}}),
        .ADDRESS    (14'(addr_i)),
        .DATAIN     (wdata_i[16*h +: 16]),
        .DATAOUT    (rdata_o[16*h +: 16]),
        .STANDBY    (1'b0),
        .SLEEP      (1'b0),
        .POWEROFF   (1'b1)                     // active low
      );
    end
  endgenerate
endmodule
