// SPDX-License-Identifier: Apache-2.0
// asi_core: the soft core (VexRiscv Min, RV32I) behind one plain bus per side. The only file that knows the core.
// Bus rule, both sides: a request and its inputs are held until ready; with ready a read's data is valid.
module asi_core #(
  parameter logic [31:0] ResetVector = 32'h0000_0000  // first instruction
) (
  input  logic        clk_i, rst_i,                   // rst_i: synchronous, active high
  input  logic        irq_i,                          // level; bit 0 of the core's interrupt array (CSR 0xBC0)
  output logic        ibus_req_o,                     // instruction side, words only
  output logic [31:2] ibus_addr_o,
  input  logic [31:0] ibus_rdata_i,
  input  logic        ibus_ready_i,
  output logic        dbus_req_o, dbus_we_o,          // data side; reads are whole words, the core picks its bytes
  output logic [3:0]  dbus_be_o,
  output logic [31:2] dbus_addr_o,
  output logic [31:0] dbus_wdata_o,
  input  logic [31:0] dbus_rdata_i,
  input  logic        dbus_ready_i
);
  logic        icyc, istb, iwe, dcyc, dstb;
  logic [31:0] imosi;
  logic [3:0]  isel;
  logic [2:0]  icti, dcti;
  logic [1:0]  ibte, dbte;

  VexRiscv u_vexriscv (
    .clk                     (clk_i),
    .reset                   (rst_i),
    .externalResetVector     (ResetVector),
    .timerInterrupt          (1'b0),                  // time is a register and an event (TIME, EVENT.tick)
    .softwareInterrupt       (1'b0),
    .externalInterruptArray  ({31'b0, irq_i}),
    .iBusWishbone_CYC        (icyc),
    .iBusWishbone_STB        (istb),
    .iBusWishbone_ACK        (ibus_ready_i),
    .iBusWishbone_WE         (iwe),
    .iBusWishbone_ADR        (ibus_addr_o),
    .iBusWishbone_DAT_MISO   (ibus_rdata_i),
    .iBusWishbone_DAT_MOSI   (imosi),
    .iBusWishbone_SEL        (isel),
    .iBusWishbone_ERR        (1'b0),
    .iBusWishbone_CTI        (icti),
    .iBusWishbone_BTE        (ibte),
    .dBusWishbone_CYC        (dcyc),
    .dBusWishbone_STB        (dstb),
    .dBusWishbone_ACK        (dbus_ready_i),
    .dBusWishbone_WE         (dbus_we_o),
    .dBusWishbone_ADR        (dbus_addr_o),
    .dBusWishbone_DAT_MISO   (dbus_rdata_i),
    .dBusWishbone_DAT_MOSI   (dbus_wdata_o),
    .dBusWishbone_SEL        (dbus_be_o),
    .dBusWishbone_ERR        (1'b0),
    .dBusWishbone_CTI        (dcti),
    .dBusWishbone_BTE        (dbte)
  );
  assign ibus_req_o = icyc & istb;
  assign dbus_req_o = dcyc & dstb;

  logic unused;                                       // bursts are never asked for, the instruction side only reads
  assign unused = ^{iwe, imosi, isel, icti, dcti, ibte, dbte};
endmodule
