// SPDX-License-Identifier: Apache-2.0
// asi_fabric: both core buses to the memory map of docs/architecture.md. Knows addresses, no meaning.
// RAM and boot ROM are shared by both sides, data first.
// An access to nothing answers at once with 0; a write there is lost.
// (Reading one instruction ahead was tried: only 2 to 4 % less clocks, the core's pipeline rarely takes one a clock.)
module asi_fabric #(
  parameter int unsigned RamWords      = 16384,
  parameter bit          BootFromFlash = 1'b0,           // 0: there is no boot ROM
  localparam int unsigned RamW         = $clog2(RamWords)
) (
  input  logic            clk_i, rst_i,                  // rst_i: synchronous, active high
  // core, instruction side
  input  logic            ibus_req_i,
  input  logic [31:2]     ibus_addr_i,
  output logic [31:0]     ibus_rdata_o,
  output logic            ibus_ready_o,
  // core, data side; write data and byte enables go straight to the targets
  input  logic            dbus_req_i, dbus_we_i,
  input  logic [31:2]     dbus_addr_i,
  output logic [31:0]     dbus_rdata_o,
  output logic            dbus_ready_o,
  // RAM and boot ROM: data in the clock after the request
  output logic            ram_req_o, ram_we_o,
  output logic [RamW-1:0] ram_addr_o,                    // in words; the boot ROM takes the lowest 8 bits
  output logic            rom_req_o,
  input  logic [31:0]     ram_rdata_i, rom_rdata_i,
  // targets with a ready of their own
  output logic            dpm_req_o, link_req_o, stat_req_o, ring_req_o, regs_req_o,
  input  logic [31:0]     dpm_rdata_i, link_rdata_i, stat_rdata_i, ring_rdata_i, regs_rdata_i,
  input  logic            dpm_ready_i, link_ready_i, stat_ready_i, ring_ready_i, regs_ready_i
);
  // ---- where
  logic d_ram, d_rom, d_dpm, d_link, d_stat, d_ring, d_regs, d_none, i_ram, i_rom;
  assign d_ram  = dbus_addr_i < 30'(RamWords);
  assign d_rom  = BootFromFlash && dbus_addr_i[31:10] == 22'h04_0000;   // 0x1000_0000, 1 KB
  assign d_dpm  = dbus_addr_i[31:14] == 18'h1_0000;      // 0x4000_0000, 16 KB
  assign d_regs = dbus_addr_i[31:6]  == 26'h200_0000;    // 0x8000_0000, 64 B
  assign d_link = dbus_addr_i[31:10] == 22'h20_0040;     // 0x8001_0000, 1 KB
  assign d_stat = dbus_addr_i[31:13] == 19'h4_0010;      // 0x8002_0000, 4 KB, and again with clearing reads
  assign d_ring = dbus_addr_i[31:11] == 21'h10_0060;     // 0x8003_0000, 2 KB
  assign d_none = ~(d_ram | d_rom | d_dpm | d_regs | d_link | d_stat | d_ring);
  assign i_ram  = ibus_addr_i < 30'(RamWords);
  assign i_rom  = BootFromFlash && ibus_addr_i[31:10] == 22'h04_0000;

  // ---- the shared memories
  logic d_go, d_done_q, i_go, i_done_q;                  // an access begins; its data is there

  assign d_go = dbus_req_i & (d_ram | d_rom) & ~d_done_q;
  assign i_go = ibus_req_i & (i_ram | i_rom) & ~i_done_q & ~d_go;

  assign ram_addr_o = d_go ? dbus_addr_i[2 +: RamW] : ibus_addr_i[2 +: RamW];
  assign ram_req_o  = d_go ? d_ram : i_go & i_ram;
  assign ram_we_o   = d_go & dbus_we_i;
  assign rom_req_o  = d_go ? d_rom & ~dbus_we_i : i_go & i_rom;

  always_ff @(posedge clk_i) begin
    d_done_q <= ~rst_i & d_go;
    i_done_q <= ~rst_i & i_go;
  end

  // ---- answers
  assign ibus_ready_o = i_done_q | (ibus_req_i & ~(i_ram | i_rom));
  assign ibus_rdata_o = i_rom ? rom_rdata_i : i_ram ? ram_rdata_i : '0;

  assign dpm_req_o  = dbus_req_i & d_dpm;
  assign link_req_o = dbus_req_i & d_link;
  assign stat_req_o = dbus_req_i & d_stat;
  assign ring_req_o = dbus_req_i & d_ring;
  assign regs_req_o = dbus_req_i & d_regs;
  assign dbus_ready_o = d_done_q | (d_dpm & dpm_ready_i) | (d_link & link_ready_i) | (d_regs & regs_ready_i) |
                        (d_stat & stat_ready_i) | (d_ring & ring_ready_i) | (dbus_req_i & d_none);
  assign dbus_rdata_o = ({32{d_ram}}  & ram_rdata_i)  | ({32{d_rom}}  & rom_rdata_i)  |
                        ({32{d_dpm}}  & dpm_rdata_i)  | ({32{d_link}} & link_rdata_i) |
                        ({32{d_regs}} & regs_rdata_i) |
                        ({32{d_stat}} & stat_rdata_i) | ({32{d_ring}} & ring_rdata_i);

`ifndef SYNTHESIS
  logic        d_held_q, i_held_q;
  logic [30:0] d_q;
  logic [31:2] i_q;
  logic [1:0]  i_wait_q;
  always_ff @(posedge clk_i) begin
    d_held_q <= !rst_i && dbus_req_i && !dbus_ready_o;
    i_held_q <= !rst_i && ibus_req_i && !ibus_ready_o;
    d_q      <= {dbus_we_i, dbus_addr_i};
    i_q      <= ibus_addr_i;
    i_wait_q <= (rst_i || !ibus_req_i || ibus_ready_o) ? 2'd0 : i_wait_q + 2'd1;
    if (!rst_i) begin
      DHeld_A:  assert (!d_held_q || (dbus_req_i && d_q == {dbus_we_i, dbus_addr_i}));
      IHeld_A:  assert (!i_held_q || (ibus_req_i && i_q == ibus_addr_i));
      OneD_A:   assert ($onehot0({d_ram, d_rom, d_dpm, d_link, d_stat, d_ring, d_regs}));
      IWait_A:  assert (i_wait_q <= 2'd2);           // data accesses cannot starve the fetches
      Both_C:   cover (d_go && ibus_req_i);
      Nothing_C: cover (dbus_req_i && d_none);
    end
  end
`endif
endmodule
